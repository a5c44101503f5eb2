//! Control points of the homogeneous curve and of its derivatives, and sums of them.

use tandem_sdk::{AxisVector, MAX_AXES};

use super::MAX_DEGREE;

/// A homogeneous point of a curve in any axes: weighted coordinates, and the weight last.
pub(super) type Wide = [f64; MAX_AXES + 1];
/// The same of a curve in the first three axes: half of the work.
type Narrow = [f64; 4];

/// Non-zero basis functions of one degree.
pub(super) type Row = [f64; MAX_DEGREE + 1];

/// The homogeneous curve and its first three derivatives (A3.3).
#[derive(Clone, Debug)]
pub(super) enum Levels {
    Narrow([Vec<Narrow>; 4]),
    Wide([Vec<Wide>; 4]),
}

impl Levels {
    /// The levels of a curve of `degree` with these homogeneous points.
    pub fn new(points: Vec<Wide>, knots: &[f64], degree: usize) -> Self {
        if points
            .iter()
            .all(|point| point[Narrow::WEIGHT..MAX_AXES].iter().all(|v| *v == 0.0))
        {
            return Self::Narrow(derived(points.iter().map(narrow).collect(), knots, degree));
        }
        Self::Wide(derived(points, knots, degree))
    }

    /// Number of control points.
    pub fn count(&self) -> usize {
        match self {
            Self::Narrow(levels) => levels[0].len(),
            Self::Wide(levels) => levels[0].len(),
        }
    }

    /// Homogeneous point `index`.
    pub fn point(&self, index: usize) -> Wide {
        match self {
            Self::Narrow(levels) => wide(&levels[0][index]),
            Self::Wide(levels) => levels[0][index],
        }
    }
}

/// A point with the lanes that a curve has: the weight is the last one.
pub(super) trait Lanes: Copy {
    /// Index of the weight.
    const WEIGHT: usize;
    /// The coordinates.
    fn axes(&self) -> AxisVector;
}

impl Lanes for Narrow {
    const WEIGHT: usize = 3;
    #[inline]
    fn axes(&self) -> AxisVector {
        let mut vector = AxisVector::ZERO;
        vector.0[..Self::WEIGHT].copy_from_slice(&self[..Self::WEIGHT]);
        vector
    }
}

impl Lanes for Wide {
    const WEIGHT: usize = MAX_AXES;
    #[inline]
    fn axes(&self) -> AxisVector {
        AxisVector(std::array::from_fn(|axis| self[axis]))
    }
}

fn narrow(point: &Wide) -> Narrow {
    [point[0], point[1], point[2], point[MAX_AXES]]
}

fn wide(point: &Narrow) -> Wide {
    let mut all = [0.0; MAX_AXES + 1];
    all[..Narrow::WEIGHT].copy_from_slice(&point[..Narrow::WEIGHT]);
    all[MAX_AXES] = point[Narrow::WEIGHT];
    all
}

/// Control points of the derivatives (A3.3). Where knots coincide they have no span to act on.
fn derived<const N: usize>(
    points: Vec<[f64; N]>,
    knots: &[f64],
    degree: usize,
) -> [Vec<[f64; N]>; 4] {
    let mut levels = [points, Vec::new(), Vec::new(), Vec::new()];
    for order in 1..=degree.min(3) {
        let before = &levels[order - 1];
        let next = before.windows(2).enumerate().map(|(index, pair)| {
            let width = knots[index + degree + 1] - knots[index + order];
            let factor = if width > 0.0 {
                (degree + 1 - order) as f64 / width
            } else {
                0.0
            };
            std::array::from_fn(|n| (pair[1][n] - pair[0][n]) * factor)
        });
        levels[order] = next.collect();
    }
    levels
}

/// The sum of the points from `first` on, weighted by basis functions of `degree`.
#[inline]
pub(super) fn combine<const N: usize>(
    level: &[[f64; N]],
    first: usize,
    degree: usize,
    row: &Row,
) -> [f64; N] {
    let mut sum = [0.0; N];
    for (point, share) in level[first..=first + degree].iter().zip(row) {
        for n in 0..N {
            sum[n] += point[n] * share;
        }
    }
    sum
}

/// `a·x + b·y`.
#[inline]
pub(super) fn mix<const N: usize>(a: f64, x: &[f64; N], b: f64, y: &[f64; N]) -> [f64; N] {
    std::array::from_fn(|n| a * x[n] + b * y[n])
}
