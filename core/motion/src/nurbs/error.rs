//! Why something is no NURBS curve.

/// What is wrong with the data of a curve. Indices count from 0.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum NurbsError {
    /// The degree is out of range.
    #[error("a NURBS curve has degree 1 to 5, not {0}")]
    Degree(usize),
    /// Too few control points.
    #[error("a curve of degree {degree} needs at least {} control points, not {points}", degree + 1)]
    Points {
        /// The degree.
        degree: usize,
        /// Control points given.
        points: usize,
    },
    /// The number of weights is not that of the control points.
    #[error("{points} control points need {points} weights, not {weights}")]
    Weights {
        /// Control points given.
        points: usize,
        /// Weights given.
        weights: usize,
    },
    /// A weight that is not positive.
    #[error("weight {index} is {value}: weights are greater than zero")]
    Weight {
        /// Which weight.
        index: usize,
        /// Its value.
        value: f64,
    },
    /// Weights so far apart that digits are lost.
    #[error(
        "the largest weight is {ratio:.1e} times the smallest: at most 1e6 is evaluated to its digits"
    )]
    WeightRatio {
        /// Largest by smallest.
        ratio: f64,
    },
    /// A control point that is not finite.
    #[error("control point {0} is not finite")]
    Point(usize),
    /// The number of knots is wrong.
    #[error("{points} control points of degree {degree} need {} knots (points + degree + 1), not {knots}", points + degree + 1)]
    Knots {
        /// Control points given.
        points: usize,
        /// The degree.
        degree: usize,
        /// Knots given.
        knots: usize,
    },
    /// A knot below the one before, or not finite.
    #[error("knot {index} is {value}, the one before it {before}: knots never fall")]
    Knot {
        /// Which knot.
        index: usize,
        /// Its value.
        value: f64,
        /// The value before it.
        before: f64,
    },
    /// A knot inside that stands so often that the curve falls apart.
    #[error(
        "knot {value} stands {count} times inside a curve of degree {degree}: the curve breaks in two there"
    )]
    Multiplicity {
        /// The knot.
        value: f64,
        /// How often it stands.
        count: usize,
        /// The degree.
        degree: usize,
    },
    /// A knot at an end that stands so often that the control point there has no part in the curve.
    #[error(
        "knot {value} stands {count} times at an end of a curve of degree {degree}, {} are the most: the curve would not \
         reach its control point there",
        degree + 1
    )]
    End {
        /// The knot.
        value: f64,
        /// How often it stands.
        count: usize,
        /// The degree.
        degree: usize,
    },
    /// Two knots that differ by no more than rounding.
    #[error("knots {index} and {} differ by {difference:e} only: make them equal or keep them apart", index + 1)]
    Close {
        /// The first of the two.
        index: usize,
        /// How far they are apart.
        difference: f64,
    },
    /// The curve has no parameter range.
    #[error("all knots that bound the curve are {0}: the curve has no extent")]
    Empty(f64),
    /// The curve stays at one point.
    #[error("all control points coincide: the curve has no length")]
    NoLength,
    /// On a part of the curve only axes move that path speed does not count.
    #[error(
        "between the knots {from} and {to} only rotary axes move: a feed in mm says nothing about them"
    )]
    NotCounted {
        /// Start of the part.
        from: f64,
        /// End of the part.
        to: f64,
    },
    /// A knot to insert that is not inside, or stands too often already.
    #[error(
        "knot {0} cannot be inserted: it lies outside or stands as often as the degree already"
    )]
    Insert(f64),
}
