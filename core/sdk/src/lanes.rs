//! Joints that are sums of axes, as planners carry them along.

use crate::abi::layout::layout;
use crate::{AxisLimits, AxisVector, Limits, MAX_AXES};

/// Joints that several axes move together (the belts of a `CoreXY`), each a *lane* behind the machine's axes: entry
/// `first() + n` of every vector holds what lane n is of the axes, `Σ weight · axis`.
///
/// The host fills the lanes of what it hands to a planner: start and end of a block, the control points of a curve, the
/// position at reset. `Limits::axes` in the planner's context goes on with the limits of the lanes. Lines and curves carry
/// them by being linear; what is not, an arc for one, fills them with [`JointLanes::fill`]. The host fills the lanes of
/// every segment again, from its axes.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct JointLanes {
    first: u32,
    count: u32,
    weights: [AxisVector; MAX_AXES],
}

layout!(JointLanes {
    first,
    count,
    weights
});

impl JointLanes {
    /// Lanes behind `axes` axes, one for each of `weights`.
    ///
    /// # Errors
    /// No lane, or more than the [`MAX_AXES`] entries of a vector hold behind the axes.
    pub fn new(axes: usize, weights: &[AxisVector]) -> Result<Self, String> {
        let count = weights.len();
        if count == 0 || axes + count > MAX_AXES {
            return Err(format!(
                "{count} joints that are sums of axes, on {axes} axes: together there are 1 to {MAX_AXES} of them"
            ));
        }
        let all = std::array::from_fn(|i| weights.get(i).copied().unwrap_or(AxisVector::ZERO));
        Ok(Self {
            first: axes as u32,
            count: count as u32,
            weights: all,
        })
    }

    /// The entry of the first lane: the number of axes.
    #[inline]
    pub fn first(&self) -> usize {
        self.first as usize
    }

    /// The weights of the axes in each lane.
    pub fn weights(&self) -> &[AxisVector] {
        &self.weights[..self.count as usize]
    }

    /// Fills the lanes of `vector` (a position, a direction, a velocity) from its axes. Any loop; does not allocate.
    #[inline]
    pub fn fill(&self, vector: &mut AxisVector) {
        for (lane, weights) in self.weights().iter().enumerate() {
            let mut sum = 0.0;
            for axis in 0..self.first() {
                sum += weights[axis] * vector[axis];
            }
            vector[self.first() + lane] = sum;
        }
    }

    /// The limits of the axes alone, narrowed until every lane keeps its own in whatever way the axes move:
    /// `Σ |weight| · limit` of the axes is at most the limit of the lane, for each of them. Travel stays as it is.
    pub(crate) fn narrowed(&self, limits: &Limits) -> Limits {
        let mut narrow = Limits {
            count: self.first,
            ..*limits
        };
        for (lane, weights) in self.weights().iter().enumerate() {
            let of = &limits.axes[self.first() + lane];
            let weights = &weights.0[..self.first()];
            let axes = &mut narrow.axes[..self.first()];
            share(axes, weights, of.feed_mm_per_s, |axis| {
                &mut axis.feed_mm_per_s
            });
            share(axes, weights, of.rapid_mm_per_s, |axis| {
                &mut axis.rapid_mm_per_s
            });
            share(axes, weights, of.acceleration_mm_per_s2, |axis| {
                &mut axis.acceleration_mm_per_s2
            });
            share(axes, weights, of.jerk_mm_per_s3, |axis| {
                &mut axis.jerk_mm_per_s3
            });
            share(axes, weights, of.speed_difference_mm_per_s, |axis| {
                &mut axis.speed_difference_mm_per_s
            });
        }
        narrow
    }

    /// The same for polynomials, one an entry. Any loop; does not allocate.
    pub fn fill_polynomials(&self, coefficients: &mut [[f64; 6]; MAX_AXES]) {
        for (lane, weights) in self.weights().iter().enumerate() {
            let mut sum = [0.0; 6];
            for axis in 0..self.first() {
                for (to, from) in sum.iter_mut().zip(&coefficients[axis]) {
                    *to += weights[axis] * from;
                }
            }
            coefficients[self.first() + lane] = sum;
        }
    }
}

/// Makes one limit of `axes` smaller until together they ask no more of a lane than `most`: each gets an equal part of it, and
/// those that ask for less leave the rest to the others. Parts in proportion would leave an axis next to nothing beside one
/// that is a thousand times as quick.
fn share(
    axes: &mut [AxisLimits],
    weights: &[f64],
    most: f64,
    limit: fn(&mut AxisLimits) -> &mut f64,
) {
    let mut asked = [0.0; MAX_AXES];
    for (axis, weight) in weights
        .iter()
        .enumerate()
        .filter(|(_, weight)| **weight != 0.0)
    {
        asked[axis] = weight.abs() * *limit(&mut axes[axis]);
    }
    if asked.iter().sum::<f64>() <= most {
        return;
    }
    let mut part = 0.0;
    for _ in 0..MAX_AXES {
        let modest: f64 = asked.iter().filter(|asked| **asked <= part).sum();
        let others = asked.iter().filter(|asked| **asked > part).count();
        if others > 0 {
            part = (most - modest) / others as f64;
        }
    }
    for (axis, weight) in weights
        .iter()
        .enumerate()
        .filter(|(axis, _)| asked[*axis] > part)
    {
        *limit(&mut axes[axis]) = part / weight.abs();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn belts() -> JointLanes {
        let weights = [[1.0, 1.0], [1.0, -1.0]].map(|w| AxisVector::from_slice(&w));
        JointLanes::new(3, &weights).unwrap()
    }

    #[test]
    fn lanes_are_sums_of_the_axes() {
        let mut vector = AxisVector::from_slice(&[5.0, 2.0, 9.0, f64::NAN, -1.0]);
        belts().fill(&mut vector);
        assert_eq!(vector, AxisVector::from_slice(&[5.0, 2.0, 9.0, 7.0, 3.0]));
        let mut polynomials = [[0.0; 6]; MAX_AXES];
        polynomials[0] = [1.0; 6];
        polynomials[1] = [0.0, 1.0, 2.0, 3.0, 4.0, 5.0];
        belts().fill_polynomials(&mut polynomials);
        assert_eq!(polynomials[3], [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
        assert_eq!(polynomials[4], [1.0, 0.0, -1.0, -2.0, -3.0, -4.0]);
    }

    fn limits(of: &[[f64; 2]]) -> Limits {
        let each = |[most, jerk]: &[f64; 2]| AxisLimits {
            min_mm: -1.0,
            max_mm: 1.0,
            feed_mm_per_s: *most,
            rapid_mm_per_s: *most,
            acceleration_mm_per_s2: *most,
            jerk_mm_per_s3: *jerk,
            speed_difference_mm_per_s: 0.0,
        };
        Limits::new(&of.iter().map(each).collect::<Vec<_>>()).unwrap()
    }

    fn narrowed_accelerations(all: &Limits) -> Vec<f64> {
        let narrow = belts().narrowed(all);
        let axes = narrow.axes().iter();
        axes.map(|axis| axis.acceleration_mm_per_s2).collect()
    }

    #[test]
    fn axes_share_what_a_lane_has() {
        let none = f64::INFINITY;
        let all = limits(&[
            [250.0, none],
            [125.0, none],
            [40.0, none],
            [250.0, 1000.0],
            [400.0, none],
        ]);
        let narrow = belts().narrowed(&all);
        let feeds: Vec<f64> = narrow
            .axes()
            .iter()
            .map(|axis| axis.feed_mm_per_s)
            .collect();
        assert_eq!(narrow.count, 3);
        assert_eq!(
            feeds,
            [125.0, 125.0, 40.0],
            "equal parts, and an axis that no lane has a part of"
        );
        let jerks: Vec<f64> = narrow
            .axes()
            .iter()
            .map(|axis| axis.jerk_mm_per_s3)
            .collect();
        assert_eq!(jerks, [500.0, 500.0, none]);
    }

    #[test]
    fn a_slow_axis_keeps_what_it_has_beside_a_quick_one() {
        let all = limits(&[
            [14.0, 1e3],
            [27_000.0, 1e5],
            [40.0, 1e3],
            [7.0, 400.0],
            [23_000.0, 1e5],
        ]);
        assert_eq!(narrowed_accelerations(&all)[..2], [3.5, 3.5]);
        let all = limits(&[
            [14.0, 1e3],
            [27_000.0, 1e5],
            [40.0, 1e3],
            [7014.0, 400.0],
            [23_000.0, 1e5],
        ]);
        assert_eq!(narrowed_accelerations(&all)[..2], [14.0, 7000.0]);
    }

    #[test]
    fn a_vector_has_no_more_entries() {
        assert!(JointLanes::new(3, &[]).is_err());
        assert!(
            JointLanes::new(7, &[AxisVector::ZERO; 2])
                .unwrap_err()
                .contains('8')
        );
    }
}
