//! Directions at the ends of a block, the turn between two of them, and the curvature of a block.

use tandem_motion::Path;
use tandem_motion::nurbs::Nurbs;
use tandem_sdk::{Axes, AxisVector, Block, BlockKind, Curve, MAX_AXES};

/// Places on a curve at which its curvature is looked at.
pub const CURVATURE_PLACES: usize = 16;

/// A direction over the linear axes, of unit length.
pub type Direction = [f64; MAX_AXES];

/// 1 for a linear axis, else 0.
#[derive(Clone, Copy, Debug)]
pub struct LinearAxes([f64; MAX_AXES]);

impl LinearAxes {
    /// Those of `axes`.
    pub fn of(axes: &Axes) -> Self {
        let linear = |axis: usize| axis < axes.count() && !axes.is_rotary(axis);
        Self(std::array::from_fn(|axis| {
            f64::from(u8::from(linear(axis)))
        }))
    }

    /// The way `from` one point `to` another over the linear axes, of unit length; none where none of them moves.
    #[inline]
    fn unit(&self, from: &AxisVector, to: &AxisVector) -> Option<Direction> {
        let linear: Direction =
            std::array::from_fn(|axis| (to.0[axis] - from.0[axis]) * self.0[axis]);
        let inverse = 1.0 / square(&linear).sqrt();
        inverse
            .is_finite()
            .then(|| linear.map(|part| part * inverse))
    }
}

/// Directions at the ends and the largest curvature.
pub struct Shape {
    pub start: Option<Direction>,
    pub end: Option<Direction>,
    pub curvature_per_mm: f64,
}

impl Shape {
    /// That of `block` on a machine with `axes`, of which `linear` are linear.
    #[inline]
    pub fn of(block: &Block, curve: Option<Curve<'_>>, axes: &Axes, linear: &LinearAxes) -> Self {
        match block.kind {
            BlockKind::Rapid | BlockKind::Line => {
                let direction = linear.unit(&block.start, &block.end);
                Self {
                    start: direction,
                    end: direction,
                    curvature_per_mm: 0.0,
                }
            }
            BlockKind::Nurbs => {
                curve.map_or_else(Self::none, |curve| Self::of_curve(curve, axes, linear))
            }
            BlockKind::Arc => Self::of_arc(block, linear),
            BlockKind::Dwell => Self::none(),
        }
    }

    fn none() -> Self {
        Self {
            start: None,
            end: None,
            curvature_per_mm: 0.0,
        }
    }

    fn of_arc(block: &Block, linear: &LinearAxes) -> Self {
        let Some(path) = Path::new(block) else {
            return Self::none();
        };
        let direction = |s_mm: f64| linear.unit(&AxisVector::ZERO, &path.direction(s_mm));
        Self {
            start: direction(0.0),
            end: direction(path.length_mm()),
            curvature_per_mm: square(&path.curvature(0.0).0).sqrt(),
        }
    }

    /// A curve: its curvature is looked at in places of equal distance in its parameter.
    fn of_curve(curve: Curve<'_>, axes: &Axes, linear: &LinearAxes) -> Self {
        let Ok(curve) = Nurbs::new(&curve.to_data(), axes) else {
            return Self::none();
        };
        let (from, to) = curve.range();
        let direction = |u: f64| {
            let at = curve.along_path(u)?;
            linear.unit(&AxisVector::ZERO, &at.direction)
        };
        let place = |i: usize| from + (to - from) * i as f64 / CURVATURE_PLACES as f64;
        let curvatures =
            (0..=CURVATURE_PLACES).filter_map(|i| curve.curvature(&curve.derivatives(place(i))));
        Self {
            start: direction(from),
            end: direction(to),
            curvature_per_mm: curvatures.fold(0.0, f64::max),
        }
    }
}

/// The turn between two directions u and v of unit length: the squares of |v − u| and |v + u|, whose quotient is the square of
/// the tangent of half the turn. No digits are lost at either end.
pub type HalfTurn = [f64; 2];

/// The turn from `before` to `after`; none where there is none of either.
#[inline]
pub fn half_turn(before: Option<&Direction>, after: Option<&Direction>) -> HalfTurn {
    let (Some(before), Some(after)) = (before, after) else {
        return [0.0, 1.0];
    };
    let difference: Direction = std::array::from_fn(|axis| after[axis] - before[axis]);
    let sum: Direction = std::array::from_fn(|axis| after[axis] + before[axis]);
    [square(&difference), square(&sum)]
}

/// Tangent up to which [`small_arc_tangent`] holds.
const SMALL: f64 = 0.4375;

/// The turns, rad: 0 is straight on, π a reversal. Most turns of a path are small, so all are first taken as such, in a loop
/// without branches; the others follow.
pub fn turns_rad(half_turns: &[HalfTurn], turns_rad: &mut Vec<f64>) {
    turns_rad.clear();
    turns_rad.extend(
        half_turns
            .iter()
            .map(|[sine, cosine]| 2.0 * small_arc_tangent((sine / cosine).sqrt())),
    );
    for (turn_rad, [sine, cosine]) in turns_rad.iter_mut().zip(half_turns) {
        if *sine >= SMALL * SMALL * cosine {
            *turn_rad = 2.0 * (sine / cosine).sqrt().atan();
        }
    }
}

/// Arc tangent of 0 ≤ x < [`SMALL`]: the polynomial of fdlibm (`s_atan.c`), summed in pairs.
#[inline]
fn small_arc_tangent(x: f64) -> f64 {
    let z = x * x;
    let (z2, z4) = (z * z, z * z * (z * z));
    let first = (3.333_333_333_333_293e-1 - 1.999_999_999_987_648_3e-1 * z)
        + (1.428_571_427_250_346_6e-1 - 1.111_111_040_546_235_6e-1 * z) * z2;
    let second = (9.090_887_133_436_507e-2 - 7.691_876_205_044_83e-2 * z)
        + (6.661_073_137_387_531e-2 - 5.833_570_133_790_573_5e-2 * z) * z2;
    let third = (4.976_877_994_615_932e-2 - 3.653_157_274_421_691_6e-2 * z)
        + 1.628_582_011_536_578_2e-2 * z2;
    x - x * z * (first + z4 * (second + z4 * third))
}

/// Square of the length; sums in pairs, which the compiler makes vectors of.
#[inline]
fn square(vector: &[f64; MAX_AXES]) -> f64 {
    let [a, b, c, d, e, f, g, h] = vector.map(|part| part * part);
    ((a + e) + (c + g)) + ((b + f) + (d + h))
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use tandem_sdk::NurbsData;

    /// A parabola that rises and falls again: X goes on all the way, axis `across` first forward and then back, by as much at the ends.
    /// Its curvature is largest in the middle: its second derivative of 40 over the square of its first one of 20.
    pub fn parabola(across: usize) -> NurbsData {
        let point = |x: f64, y: f64| {
            let mut point = AxisVector::from_slice(&[x]);
            point[across] = y;
            point
        };
        NurbsData {
            degree: 2,
            control_points: vec![point(0.0, 0.0), point(10.0, 10.0), point(20.0, 0.0)],
            weights: vec![1.0; 3],
            knots: vec![0.0, 0.0, 0.0, 1.0, 1.0, 1.0],
        }
    }

    fn turn_rad(before: &Direction, after: &Direction) -> f64 {
        let mut turns = vec![];
        turns_rad(&[half_turn(Some(before), Some(after))], &mut turns);
        turns[0]
    }

    #[test]
    fn turns_keep_their_digits_from_straight_on_to_a_reversal() {
        let before = [1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
        for index in 0..=10_000 {
            let turn = std::f64::consts::PI * (f64::from(index) / 10_000.0).powi(4);
            let after = [turn.cos(), 0.0, turn.sin(), 0.0, 0.0, 0.0, 0.0, 0.0];
            let found = turn_rad(&before, &after);
            assert!(
                (found - turn).abs() <= 1e-15 + 4e-15 * turn,
                "{found} of {turn}"
            );
        }
        assert_eq!(half_turn(None, Some(&before)), [0.0, 1.0]);
    }

    #[test]
    fn small_arc_tangents_are_those_of_the_library() {
        for index in 0..100_000 {
            let x = f64::from(index) / 1e5 * SMALL;
            assert!(
                (small_arc_tangent(x) - x.atan()).abs() <= 2.3e-16 * x,
                "{x}"
            );
        }
    }

    fn axes() -> Axes {
        Axes::new(&[('X', false), ('A', true), ('Y', false)]).unwrap()
    }

    #[test]
    fn only_linear_axes_have_a_direction() {
        let linear = LinearAxes::of(&axes());
        let unit = |to: &[f64]| linear.unit(&AxisVector::ZERO, &AxisVector::from_slice(to));
        assert_eq!(unit(&[0.0, 2.0, 0.0]), None, "the table turns");
        let both = unit(&[3.0, 100.0, 4.0]).unwrap();
        assert!((both[0] - 0.6).abs() < 1e-15 && (both[2] - 0.8).abs() < 1e-15);
        assert_eq!(both[1], 0.0);
    }

    #[test]
    fn every_axis_counts_in_a_length() {
        for axis in 0..MAX_AXES {
            let mut vector = [0.0; MAX_AXES];
            vector[axis] = -3.0;
            assert_eq!(square(&vector), 9.0, "axis {axis}");
        }
        assert_eq!(square(&[1.0; MAX_AXES]), 8.0);
    }

    #[test]
    fn the_curvature_of_a_curve_is_that_of_its_sharpest_place() {
        let data = parabola(2);
        let block = Block {
            kind: BlockKind::Nurbs,
            ..Block::at(AxisVector::ZERO)
        };
        let linear = LinearAxes::of(&axes());
        let shape = Shape::of(&block, Some(data.curve()), &axes(), &linear);
        assert!((shape.curvature_per_mm - 0.1).abs() < 1e-9);
        let start = shape.start.unwrap();
        assert!((start[0] - start[2]).abs() < 1e-12 && start[0] > 0.7);
    }
}
