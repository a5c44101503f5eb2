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
}

impl Stretch {
    /// The first knot behind `s_mm`; infinite where there is none. Does not allocate.
    pub fn next_knot_mm(&self, s_mm: f64) -> f64 {
        let index = self.knots_mm.partition_point(|knot| *knot <= s_mm);
        self.knots_mm.get(index).copied().unwrap_or(f64::INFINITY)
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
            let knots_mm = inside.map(|knot| table.length_at(&curve, knot)).collect();
            Stretch {
                length_mm: table.length().mm,
                turns: *turns,
                table: Some(table),
                knots_mm,
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
        match (&self.shape, &self.stretches[index].table) {
            (Shape::Curve(curve), Some(table)) => {
                table.along_path(curve, s_mm, place).unwrap_or_else(|| {
                    let position = table.position(curve, s_mm, place);
                    AlongPath {
                        position,
                        ..AlongPath::default()
                    }
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
