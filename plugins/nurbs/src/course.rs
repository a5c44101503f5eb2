//! The path of a block by arc length, in smooth stretches.

use tandem_motion::Path;
use tandem_motion::nurbs::{AlongPath, ArcLength, Nurbs, NurbsError, Piece, Place};
use tandem_sdk::{Axes, AxisVector, Block, BlockKind, Curve, NurbsData, PlannerContext};

/// A stretch no longer than this is rounding, mm.
const MIN_MM: f64 = 1e-9;

/// Where a curve turns on less than this it is driven from rest to rest, mm: even with 100 m/s² it would be passed at 0.01 mm/s,
/// which gains nothing, and no grid of places is as fine as the path beside it.
const HAIRPIN_MM: f64 = 1e-9;

/// What a block moves along: a curve, or a line or arc.
#[derive(Clone, Debug)]
enum Shape {
    Path(Box<Path>),
    Curve(Box<Nurbs>),
}

/// The path of one block, cut where it has corners.
#[derive(Clone, Debug)]
pub struct Course {
    shape: Shape,
    stretches: Vec<Stretch>,
    end: AxisVector,
    /// Entries that are axes.
    axes: usize,
}

/// A smooth part of a course.
#[derive(Clone, Debug)]
pub struct Stretch {
    /// Length, mm.
    pub length_mm: f64,
    /// It ends where the curve turns back: at rest.
    pub turns: bool,
    table: Option<ArcLength>,
    /// Where its knots lie inside: there the third derivative may jump, mm from its start.
    knots_mm: Vec<f64>,
    /// The shortest way from one of its ends or knots to the next, mm.
    shortest_mm: f64,
    /// Directions in which a part of a curve begins and ends: where it stands still in its parameter the derivatives there are
    /// rounding.
    directions: Option<[AxisVector; 2]>,
    /// Whether it stands still in its parameter at its start and at its end.
    still: [bool; 2],
}

impl Stretch {
    /// The first knot behind `s_mm`; infinite where there is none. Does not allocate.
    pub fn next_knot_mm(&self, s_mm: f64) -> f64 {
        let index = self.knots_mm.partition_point(|knot| *knot <= s_mm);
        self.knots_mm.get(index).copied().unwrap_or(f64::INFINITY)
    }

    /// The shortest way from one of its ends or knots to the next, mm.
    pub fn shortest_mm(&self) -> f64 {
        self.shortest_mm
    }

    /// Directions in which a part of a curve begins and ends, but where it turns back: there it rests.
    pub fn directions(&self) -> Option<&[AxisVector; 2]> {
        self.directions.as_ref()
    }
}

impl Course {
    /// The course of `block`, which has a copy of its `curve`; `None` for rest. Allocates.
    ///
    /// # Errors
    /// A curve that is none.
    pub fn new(
        context: &PlannerContext,
        block: &Block,
        curve: Option<Curve<'_>>,
    ) -> Result<Option<Self>, NurbsError> {
        let end = block.end;
        let count = context.axes.count();
        if block.kind != BlockKind::Nurbs {
            return Ok(Path::with_lanes(block, context.joint_lanes).map(|path| {
                let stretches = vec![Stretch {
                    length_mm: path.length_mm(),
                    turns: false,
                    table: None,
                    knots_mm: Vec::new(),
                    shortest_mm: path.length_mm(),
                    directions: None,
                    still: [false; 2],
                }];
                Self {
                    shape: Shape::Path(Box::new(path)),
                    stretches,
                    end,
                    axes: count,
                }
            }));
        }
        let curve = curve_of(&context.axes, curve)?;
        let stretch = |(piece, turns): &(Piece, bool)| {
            let table = ArcLength::of_piece(&curve, piece);
            let inside = curve
                .inner_knots()
                .filter(|knot| *knot > piece.range.0 && *knot < piece.range.1);
            let length_mm = table.length().mm;
            let knots_mm = apart(inside.map(|knot| table.length_at(&curve, knot)), length_mm);
            Stretch {
                length_mm,
                turns: *turns,
                table: Some(table),
                shortest_mm: shortest_mm(&knots_mm, length_mm),
                knots_mm,
                directions: Some([piece.start_direction, piece.end_direction]),
                still: curve.stands_still_at_ends(piece),
            }
        };
        // Between points of a polygon that coincide there is nothing to drive.
        let pieces = curve
            .pieces()
            .into_iter()
            .flat_map(|piece| between_hairpins(&curve, piece))
            .collect::<Vec<_>>();
        let stretches = pieces
            .iter()
            .map(stretch)
            .filter(|stretch| stretch.length_mm > MIN_MM)
            .collect();
        Ok(Some(Self {
            shape: Shape::Curve(Box::new(curve)),
            stretches,
            end,
            axes: count,
        }))
    }

    /// Its smooth stretches.
    pub fn stretches(&self) -> &[Stretch] {
        &self.stretches
    }

    /// Where it ends: the programmed point.
    pub fn end(&self) -> &AxisVector {
        &self.end
    }

    /// Position and derivatives by arc length at `s_mm` of stretch `index`. Where a curve stands still in its parameter
    /// (a cusp) direction and curvature are zero. Does not allocate.
    pub fn at(&self, index: usize, s_mm: f64, place: &mut Place) -> AlongPath {
        let stretch = &self.stretches[index];
        match (&self.shape, &stretch.table) {
            (Shape::Curve(curve), Some(table)) => {
                let still = stretch.still[0] && s_mm <= 0.0
                    || stretch.still[1] && s_mm >= stretch.length_mm;
                let known = if still {
                    None
                } else {
                    table.along_path(curve, s_mm, place)
                };
                known.unwrap_or_else(|| AlongPath {
                    position: table.position(curve, s_mm, place),
                    ..AlongPath::default()
                })
            }
            (Shape::Path(path), _) => AlongPath {
                position: path.position(s_mm),
                direction: path.direction(s_mm),
                curvature: path.curvature(s_mm),
                third: path.third(s_mm),
                ..AlongPath::default()
            },
            (Shape::Curve(_), None) => AlongPath::default(),
        }
    }

    /// Distance from `s_mm` of stretch `index` within which the path has no feature that it does not have there, mm. Does
    /// not allocate.
    pub fn smooth_for_mm(&self, index: usize, s_mm: f64, place: &mut Place) -> f64 {
        let Some(table) = &self.stretches[index].table else {
            return f64::INFINITY;
        };
        let (length_mm, end_mm) = table.part(s_mm, place);
        (length_mm / 3.0).min((end_mm - s_mm).max(length_mm / 100.0))
    }

    /// Whether it is a line.
    pub fn is_straight(&self) -> bool {
        matches!(&self.shape, Shape::Path(path) if path.is_straight())
    }

    /// Length of a vector over the axes that path speed counts.
    pub fn counted_length(&self, vector: &AxisVector) -> f64 {
        match &self.shape {
            Shape::Curve(curve) => curve.counted_length(vector),
            // The derivatives of lines and arcs are by path length already.
            Shape::Path(path) if path.is_straight() => 0.0,
            Shape::Path(_) => vector.0[..self.axes]
                .iter()
                .map(|v| v * v)
                .sum::<f64>()
                .sqrt(),
        }
    }
}

/// The knots of a stretch between which there is more to drive than rounding, and before its end as well.
fn apart(knots_mm: impl Iterator<Item = f64>, length_mm: f64) -> Vec<f64> {
    let mut apart = Vec::new();
    for knot_mm in knots_mm {
        let before_mm = apart.last().copied().unwrap_or(0.0);
        if knot_mm - before_mm > MIN_MM && length_mm - knot_mm > MIN_MM {
            apart.push(knot_mm);
        }
    }
    apart
}

/// The shortest way from the start of a stretch, its knots or its end to the next of them, mm.
fn shortest_mm(knots_mm: &[f64], length_mm: f64) -> f64 {
    let ends = || knots_mm.iter().copied().chain([length_mm]);
    std::iter::once(0.0)
        .chain(ends())
        .zip(ends())
        .map(|(from_mm, to_mm)| to_mm - from_mm)
        .fold(f64::INFINITY, f64::min)
}

/// The parts of a piece from hairpin to hairpin, and whether they end in one.
fn between_hairpins(curve: &Nurbs, piece: Piece) -> Vec<(Piece, bool)> {
    let mut ends = curve.hairpins(piece.range, HAIRPIN_MM);
    ends.push(piece.range.1);
    let starts = std::iter::once(piece.range.0).chain(ends.iter().copied());
    let part = |range: (f64, f64)| (Piece { range, ..piece }, range.1 < piece.range.1);
    starts.zip(ends.iter().copied()).map(part).collect()
}

/// The curve that was handed over with a block, checked. Without one it is a curve of no points.
pub(crate) fn curve_of(axes: &Axes, curve: Option<Curve<'_>>) -> Result<Nurbs, NurbsError> {
    Nurbs::new(
        &curve.map_or_else(NurbsData::default, |curve| curve.to_data()),
        axes,
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two knots and the end that only rounding tells apart from what is before them are no places of their own, and the shortest
    /// way is that between the others.
    #[test]
    fn knots_that_rounding_tells_apart_are_one() {
        let knots_mm = apart(
            [0.5e-9, 1.0, 1.0 + 0.5e-9, 1.25, 2.0 - 0.5e-9].into_iter(),
            2.0,
        );
        assert_eq!(knots_mm, [1.0, 1.25]);
        assert_eq!(shortest_mm(&knots_mm, 2.0), 0.25);
        assert_eq!(shortest_mm(&[0.125, 1.0], 2.0), 0.125);
        assert_eq!(shortest_mm(&[], 2.0), 2.0);
    }
}
