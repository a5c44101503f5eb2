//! The curve and what must hold of its data.

use tandem_sdk::{Axes, AxisVector, MAX_AXES, NurbsData};

use super::NurbsError;
use super::levels::{Lanes, Levels, Wide};

/// Highest degree.
pub const MAX_DEGREE: usize = 5;
/// Largest weight by smallest weight that keeps the digits of the curve.
pub const MAX_WEIGHT_RATIO: f64 = 1e6;
/// Knots closer than this share of the parameter range are an accident of rounding.
const CLOSE: f64 = 1e-10;

/// A NURBS curve of degree 1 to 5 over up to 8 axes, its data checked and owned.
///
/// The parameter u runs over the knots that bound the curve, `knots[degree]` to `knots[points]`. The curve need not be
/// clamped.
#[derive(Clone, Debug)]
pub struct Nurbs {
    pub(super) degree: usize,
    pub(super) knots: Vec<f64>,
    pub(super) levels: Levels,
    /// All weights are equal: the curve is a polynomial on each span.
    pub(super) plain: bool,
    /// 1 for the axes whose motion path speed counts, else 0.
    pub(super) counted: AxisVector,
}

impl Nurbs {
    /// The curve of `data` on a machine with `axes`: path speed counts the linear axes where any of them moves, else the
    /// rotary ones. Allocates.
    ///
    /// # Errors
    /// What is wrong with degree, control points, weights or knots; a curve of no extent.
    pub fn new(data: &NurbsData, axes: &Axes) -> Result<Self, NurbsError> {
        check_points(data)?;
        check_knots(data)?;
        let homogeneous = data
            .control_points
            .iter()
            .zip(&data.weights)
            .map(|(point, weight)| homogeneous(point, *weight));
        let levels = Levels::new(homogeneous.collect(), &data.knots, data.degree);
        let plain = data.weights.iter().all(|weight| *weight == data.weights[0]);
        let counted = counted(data, axes)?;
        check_spans(data, &counted)?;
        Ok(Self {
            degree: data.degree,
            knots: data.knots.clone(),
            levels,
            plain,
            counted,
        })
    }

    /// The degree.
    pub fn degree(&self) -> usize {
        self.degree
    }

    /// The knots.
    pub fn knots(&self) -> &[f64] {
        &self.knots
    }

    /// Number of control points.
    pub fn points(&self) -> usize {
        self.levels.count()
    }

    /// Control point and weight `index`.
    pub fn control_point(&self, index: usize) -> (AxisVector, f64) {
        let point = self.levels.point(index);
        (
            point.axes() * (1.0 / point[Wide::WEIGHT]),
            point[Wide::WEIGHT],
        )
    }

    /// First and last parameter.
    pub fn range(&self) -> (f64, f64) {
        (self.knots[self.degree], self.knots[self.points()])
    }

    /// Length of a displacement or derivative as path speed counts it.
    #[inline]
    pub fn counted_length(&self, vector: &AxisVector) -> f64 {
        self.counted_product(vector, vector).sqrt()
    }

    #[inline]
    pub(super) fn counted_product(&self, a: &AxisVector, b: &AxisVector) -> f64 {
        let mut sum = 0.0;
        for axis in 0..a.0.len() {
            sum += a[axis] * b[axis] * self.counted[axis];
        }
        sum
    }

    /// The data the curve was made of, as far as it is kept. Allocates.
    pub fn data(&self) -> NurbsData {
        NurbsData {
            degree: self.degree,
            control_points: (0..self.points())
                .map(|index| self.control_point(index).0)
                .collect(),
            weights: (0..self.points())
                .map(|index| self.control_point(index).1)
                .collect(),
            knots: self.knots.clone(),
        }
    }
}

fn homogeneous(point: &AxisVector, weight: f64) -> Wide {
    let mut homogeneous = [weight; MAX_AXES + 1];
    for (to, from) in homogeneous.iter_mut().zip(point.0) {
        *to = from * weight;
    }
    homogeneous
}

fn check_points(data: &NurbsData) -> Result<(), NurbsError> {
    let degree = data.degree;
    let points = data.control_points.len();
    if !(1..=MAX_DEGREE).contains(&degree) {
        return Err(NurbsError::Degree(degree));
    }
    if points <= degree {
        return Err(NurbsError::Points { degree, points });
    }
    if let Some(index) = data
        .control_points
        .iter()
        .position(|point| !point.is_finite())
    {
        return Err(NurbsError::Point(index));
    }
    if data.weights.len() != points {
        return Err(NurbsError::Weights {
            points,
            weights: data.weights.len(),
        });
    }
    let wrong = |weight: &f64| !weight.is_finite() || *weight <= 0.0;
    if let Some(index) = data.weights.iter().position(wrong) {
        return Err(NurbsError::Weight {
            index,
            value: data.weights[index],
        });
    }
    let (low, high) = data
        .weights
        .iter()
        .fold((f64::INFINITY, 0.0f64), |(low, high), w| {
            (low.min(*w), high.max(*w))
        });
    if high > MAX_WEIGHT_RATIO * low {
        return Err(NurbsError::WeightRatio { ratio: high / low });
    }
    Ok(())
}

fn check_knots(data: &NurbsData) -> Result<(), NurbsError> {
    let degree = data.degree;
    let points = data.control_points.len();
    let knots = &data.knots;
    if knots.len() != points + degree + 1 {
        return Err(NurbsError::Knots {
            points,
            degree,
            knots: knots.len(),
        });
    }
    let mut before = f64::NEG_INFINITY;
    for (index, value) in knots.iter().copied().enumerate() {
        if !value.is_finite() || value < before {
            return Err(NurbsError::Knot {
                index,
                value,
                before,
            });
        }
        before = value;
    }
    let first = knots[degree];
    let last = knots[points];
    if last <= first {
        return Err(NurbsError::Empty(first));
    }
    for value in [first, last] {
        let count = knots.iter().filter(|knot| **knot == value).count();
        if count > degree + 1 {
            return Err(NurbsError::End {
                value,
                count,
                degree,
            });
        }
    }
    check_spacing(data, first, last)
}

fn check_spacing(data: &NurbsData, first: f64, last: f64) -> Result<(), NurbsError> {
    let inside = data
        .knots
        .iter()
        .enumerate()
        .filter(|(_, knot)| **knot > first && **knot < last);
    for (index, value) in inside {
        let count = data.knots[index..]
            .iter()
            .take_while(|knot| *knot == value)
            .count();
        if count > data.degree {
            return Err(NurbsError::Multiplicity {
                value: *value,
                count,
                degree: data.degree,
            });
        }
    }
    for index in data.degree..data.control_points.len() {
        let difference = data.knots[index + 1] - data.knots[index];
        if difference > 0.0 && difference < CLOSE * (last - first) {
            return Err(NurbsError::Close { index, difference });
        }
    }
    Ok(())
}

/// No span moves only axes that path speed does not count.
fn check_spans(data: &NurbsData, counted: &AxisVector) -> Result<(), NurbsError> {
    for span in data.degree..data.control_points.len() {
        let from = data.knots[span];
        let to = data.knots[span + 1];
        let points = &data.control_points[span - data.degree..=span];
        let same = |axis: usize| points.iter().all(|point| point[axis] == points[0][axis]);
        let stands = (0..MAX_AXES).all(|axis| counted[axis] == 0.0 || same(axis));
        if to > from && stands && !(0..MAX_AXES).all(same) {
            return Err(NurbsError::NotCounted { from, to });
        }
    }
    Ok(())
}

/// Which axes path speed counts on this curve.
fn counted(data: &NurbsData, axes: &Axes) -> Result<AxisVector, NurbsError> {
    let moves = |axis: usize| {
        data.control_points
            .iter()
            .any(|point| point[axis] != data.control_points[0][axis])
    };
    let moving = |rotary: bool| {
        (0..axes.count()).filter(move |axis| axes.is_rotary(*axis) == rotary && moves(*axis))
    };
    let rotary = moving(false).next().is_none();
    let mut counted = AxisVector::ZERO;
    for axis in moving(rotary) {
        counted[axis] = 1.0;
    }
    if counted == AxisVector::ZERO {
        Err(NurbsError::NoLength)
    } else {
        Ok(counted)
    }
}
