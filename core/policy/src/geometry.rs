//! Where a block lies and which way it goes, for scripts that look at it.

use std::f64::consts::{FRAC_PI_2, TAU};

use tandem_motion::Path;
use tandem_motion::nurbs::Nurbs;
use tandem_sdk::{ArcGeometry, Axes, AxisVector, Block, BlockKind, Curve};

use crate::abi::block as at;
use crate::shape::CURVATURE_PLACES;

/// What stands behind [`at::BYTES_SMALL`] in a block, as bytes.
pub type Geometry = [u8; at::BYTES_V2 - at::BYTES_SMALL];

/// How far each axis moves for each mm of a path.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Ways {
    pub start: AxisVector,
    pub end: AxisVector,
    /// The lowest anywhere.
    pub lowest: AxisVector,
    /// The highest anywhere.
    pub highest: AxisVector,
}

impl Ways {
    /// Those of `block`; zero where nothing moves.
    pub fn of(block: &Block, curve: Option<Curve<'_>>, axes: &Axes) -> Self {
        match block.kind {
            BlockKind::Dwell => Self::default(),
            BlockKind::Nurbs => curve
                .and_then(|curve| Self::of_curve(curve, axes))
                .unwrap_or_default(),
            BlockKind::Rapid | BlockKind::Line => {
                let way = block.end - block.start;
                let length = axes.path_length(&way);
                Self::straight(if length > 0.0 {
                    way * (1.0 / length)
                } else {
                    AxisVector::ZERO
                })
            }
            BlockKind::Arc => Path::new(block)
                .map(|path| Self::of_arc(&path, &block.arc))
                .unwrap_or_default(),
        }
    }

    fn straight(direction: AxisVector) -> Self {
        Self {
            start: direction,
            end: direction,
            lowest: direction,
            highest: direction,
        }
    }

    /// In the plane of the circle the direction turns with the angle; every other axis moves evenly.
    fn of_arc(path: &Path, arc: &ArcGeometry) -> Self {
        let length_mm = path.length_mm();
        let mut ways = Self {
            end: path.direction(length_mm),
            ..Self::straight(path.direction(0.0))
        };
        let share = arc.radius_mm * arc.sweep_rad / length_mm;
        for (axis, quarter_turn) in [(arc.plane[0], FRAC_PI_2), (arc.plane[1], 0.0)] {
            // −sin a = cos(a + π/2).
            let from = arc.start_angle_rad + quarter_turn;
            let (low, high) = cosines(from, from + arc.sweep_rad);
            let ends = [share * low, share * high];
            let axis = axis as usize;
            ways.lowest[axis] = ends[0].min(ends[1]);
            ways.highest[axis] = ends[0].max(ends[1]);
        }
        ways
    }

    fn of_curve(curve: Curve<'_>, axes: &Axes) -> Option<Self> {
        let curve = Nurbs::new(&curve.to_data(), axes).ok()?;
        let (from, to) = curve.range();
        let place = |index: usize| from + (to - from) * index as f64 / CURVATURE_PLACES as f64;
        let mut directions = (0..=CURVATURE_PLACES)
            .filter_map(|index| Some(curve.along_path(place(index))?.direction));
        let mut ways = Self::straight(directions.next()?);
        for direction in directions {
            ways.end = direction;
            for (axis, share) in direction.0.into_iter().enumerate() {
                ways.lowest[axis] = ways.lowest[axis].min(share);
                ways.highest[axis] = ways.highest[axis].max(share);
            }
        }
        Some(ways)
    }
}

/// The lowest and the highest cosine between two angles.
fn cosines(one: f64, other: f64) -> (f64, f64) {
    let (from, to) = (one.min(other), one.max(other));
    // Whether `angle`, or the same some turns on, lies between them.
    let passes = |angle: f64| ((from - angle) / TAU).ceil() * TAU + angle <= to;
    let (first, last) = (from.cos(), to.cos());
    let low = if passes(std::f64::consts::PI) {
        -1.0
    } else {
        first.min(last)
    };
    let high = if passes(0.0) { 1.0 } else { first.max(last) };
    (low, high)
}

/// The geometry of `block` as it crosses into a script.
pub fn geometry(block: &Block, curve: Option<Curve<'_>>, axes: &Axes) -> Geometry {
    let ways = Ways::of(block, curve, axes);
    let mut bytes = [0; size_of::<Geometry>()];
    let fields = [
        (at::START, &block.start),
        (at::END, &block.end),
        (at::OFFSET, &block.offset),
        (at::START_DIRECTION, &ways.start),
        (at::END_DIRECTION, &ways.end),
        (at::LOWEST_SHARE, &ways.lowest),
        (at::HIGHEST_SHARE, &ways.highest),
    ];
    for (place, values) in fields {
        put_vector(&mut bytes, place - at::BYTES_SMALL, values);
    }
    bytes
}

/// Writes the entries of `values` one after the other from `at` on.
pub fn put_vector(bytes: &mut [u8], at: usize, values: &AxisVector) {
    for (index, value) in values.0.iter().enumerate() {
        crate::abi::put_f64(bytes, at + 8 * index, *value);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;
    use tandem_rig::Random;

    fn axes() -> Axes {
        Axes::new(&[('X', false), ('Y', false), ('Z', false)]).unwrap()
    }

    #[test]
    fn a_plunging_line_has_its_share_of_each_axis_everywhere() {
        let block = Block {
            kind: BlockKind::Line,
            end: AxisVector::from_slice(&[3.0, 0.0, -4.0]),
            length_mm: 5.0,
            ..Block::at(AxisVector::ZERO)
        };
        let ways = Ways::of(&block, None, &axes());
        let off = ways.start - AxisVector::from_slice(&[0.6, 0.0, -0.8]);
        assert!(off.0.iter().all(|off| off.abs() < 1e-15), "{ways:?}");
        assert_eq!(ways, Ways::straight(ways.start));
        assert_eq!(
            Ways::of(&Block::at(AxisVector::ZERO), None, &axes()),
            Ways::default()
        );
    }

    #[test]
    fn the_shares_of_a_helix_are_those_of_its_samples() {
        let mut random = Random::from_the_clock();
        for _ in 0..200 {
            let start_angle_rad = random.between(-7.0, 7.0);
            let sweep_rad =
                random.between(0.05, 9.0) * if random.below(2) == 0 { 1.0 } else { -1.0 };
            let (radius_mm, rise_mm) = (random.between(0.5, 20.0), random.between(-5.0, 5.0));
            let on = |angle: f64, z: f64| {
                AxisVector::from_slice(&[radius_mm * angle.cos(), radius_mm * angle.sin(), z])
            };
            let block = Block {
                kind: BlockKind::Arc,
                start: on(start_angle_rad, 0.0),
                end: on(start_angle_rad + sweep_rad, rise_mm),
                arc: ArcGeometry {
                    plane: [0, 1],
                    center_mm: [0.0; 2],
                    radius_mm,
                    start_angle_rad,
                    sweep_rad,
                },
                length_mm: (radius_mm * sweep_rad).hypot(rise_mm),
                ..Block::at(AxisVector::ZERO)
            };
            let ways = Ways::of(&block, None, &axes());
            let path = Path::new(&block).unwrap();
            for axis in 0..3 {
                let shares = (0..=2000).map(|index| {
                    path.direction(path.length_mm() * f64::from(index) / 2000.0)[axis]
                });
                let (low, high) = shares.fold((f64::MAX, f64::MIN), |(low, high), share| {
                    (low.min(share), high.max(share))
                });
                let near = |one: f64, other: f64| (one - other).abs() < 1e-4;
                assert!(
                    near(ways.lowest[axis], low) && near(ways.highest[axis], high),
                    "axis {axis}: {ways:?} but {low} to {high} of {block:?}"
                );
            }
        }
    }

    #[test]
    fn the_shares_of_a_curve_are_those_of_all_its_places() {
        let data = crate::shape::tests::parabola(1);
        let block = Block {
            kind: BlockKind::Nurbs,
            ..Block::at(AxisVector::ZERO)
        };
        let ways = Ways::of(&block, Some(data.curve()), &axes());
        let (diagonal, near) = (0.5_f64.sqrt(), |one: f64, other: f64| {
            (one - other).abs() < 1e-6
        });
        assert!(
            near(ways.lowest[0], diagonal) && near(ways.highest[0], 1.0),
            "{ways:?}"
        );
        assert!(
            near(ways.lowest[1], -diagonal) && near(ways.highest[1], diagonal),
            "{ways:?}"
        );
        assert!(
            near(ways.start[1], diagonal) && near(ways.end[1], -diagonal),
            "{ways:?}"
        );
    }

    #[test]
    fn cosines_see_the_turning_points() {
        assert_eq!(cosines(-0.1, 0.1).1, 1.0);
        assert_eq!(cosines(PI + 0.1, PI - 0.1).0, -1.0);
        assert_eq!(cosines(0.0, 20.0), (-1.0, 1.0));
        let (low, high) = cosines(0.5, 1.0);
        assert_eq!((low, high), (1.0_f64.cos(), 0.5_f64.cos()));
    }
}
