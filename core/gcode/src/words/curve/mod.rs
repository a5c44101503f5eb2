//! G5, G5.1, G5.2, G5.3 and G6.2: curves. Here is what they share, from the line that opens one to the block.

mod bezier;
mod lines;
mod places;

use std::sync::Arc;

use tandem_motion::nurbs::{Nurbs, NurbsError};
use tandem_sdk::{AxisVector, Block, BlockKind, NurbsData};

use super::modes::FeedMode;
use super::{Action, Group, Shape, Word};
use crate::item::Item;
use crate::line::Line;
use crate::line_error::{Checked, LineError, Span};
use crate::state::MotionMode;
use crate::syntax::line_words::LineWords;
use places::{Origin, Places};

pub(super) const WORDS: &[Word] = &[
    Word::new(
        "G5",
        Group::Motion,
        "XYIJPQ",
        "cubic Bezier curve in XY; I J second control point from the start, P Q third from the end",
        Action::Move(Shape::Curve, bezier::cubic),
        "G5 X9 Y0 I1 J3 P-1 Q3",
    ),
    Word::new(
        "G5.1",
        Group::Motion,
        "XYIJ",
        "quadratic Bezier curve in XY; I J middle control point from the start",
        Action::Move(Shape::Curve, bezier::quadratic),
        "G5.1 X9 Y0 I4 J3",
    ),
    Word::new(
        "G5.2",
        Group::Motion,
        "XYZABCUVWPL",
        "NURBS curve until G5.3: a control point a line; P weight, L order",
        Action::MoveOnce(Shape::Curve, lines::open_linuxcnc),
        "G5.2 P1 L3\nX3 Y5\nX6 Y0 P2\nX9 Y4\nG5.3",
    ),
    Word::new(
        "G5.3",
        Group::Motion,
        "",
        "end of the NURBS curve of G5.2",
        Action::Act(super::nothing),
        "G5.2\nX3 Y5\nX6 Y0\nG5.3",
    ),
    Word::new(
        "G6.2",
        Group::Motion,
        "XYZABCUVWPKRQ",
        "NURBS curve: a control point, knot K and weight R a line, then knots alone; P order; Q is accepted and has no effect",
        Action::MoveOnce(Shape::Curve, lines::open_fanuc),
        "G6.2 P3 K0\nK0 X3 Y5\nK0 X6\nK1\nK1\nK1",
    ),
];

/// What is wrong with a G5.3 that no curve has read as its last line.
pub(super) const NONE_OPEN: &str = "G5.3 ends a curve, and none is open: G5.2 opens one";

/// How the lines of a curve are to be read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Dialect {
    /// G5.2 … G5.3: control points with weights, the knots follow from the order.
    LinuxCnc,
    /// G06.2: control points with weights and knots, then as many knots alone as the order.
    Fanuc,
}

/// A curve whose lines are being read.
#[derive(Clone, Debug)]
pub(crate) struct Curve {
    pub dialect: Dialect,
    /// The line that opened it.
    pub line: u32,
    /// Degree + 1, once it is known.
    pub order: Option<usize>,
    pub points: Vec<AxisVector>,
    pub weights: Vec<f64>,
    pub knots: Vec<f64>,
    pub places: Places,
    /// F of the opening line under G93, 1/min.
    pub inverse_time: Option<f64>,
    /// A line was wrong, or the machine's position is not known: read to the end, but make no block.
    pub broken: bool,
}

impl Curve {
    fn new(dialect: Dialect, line: u32) -> Self {
        Self {
            dialect,
            line,
            order: None,
            points: Vec::new(),
            weights: Vec::new(),
            knots: Vec::new(),
            places: Places::default(),
            inverse_time: None,
            broken: false,
        }
    }

    pub fn add(&mut self, point: AxisVector, weight: f64) {
        self.points.push(point);
        self.weights.push(weight);
    }

    /// What a curve of Fanuc's still lacks.
    fn missing_knots(&self) -> String {
        let order = self.order.unwrap_or(0);
        let alone = self.knots.len().saturating_sub(self.points.len());
        format!(
            "of the {order} knots (K) that stand alone behind the last control point {} are missing",
            order - alone
        )
    }

    fn data(self, degree: usize) -> NurbsData {
        NurbsData {
            degree,
            control_points: self.points,
            weights: self.weights,
            knots: self.knots,
        }
    }
}

/// The curve that is being read, and how the last G5 ended.
#[derive(Clone, Debug, Default)]
pub(crate) struct Curves {
    pub(super) open: Option<Curve>,
    tail: Option<bezier::Tail>,
}

impl Curves {
    /// Whether lines of a curve may follow.
    #[inline]
    pub fn is_open(&self) -> bool {
        self.open.is_some()
    }

    /// Keeps the line `number` of a curve, which has just been read.
    #[inline]
    pub fn note(&mut self, number: u32, text: &[u8]) {
        if let Some(curve) = &mut self.open {
            let count = curve.points.len().max(curve.knots.len());
            curve.places.note(number, text, count);
        }
    }

    /// Line `number`, which could not be obeyed, would have opened a curve: its lines are read, and make no block.
    pub fn pass_over(&mut self, words: &LineWords, number: u32) {
        let codes = words.g.as_slice().iter().map(|code| code.tenths);
        let mut dialects = codes.filter_map(|tenths| match tenths {
            52 => Some(Dialect::LinuxCnc),
            62 => Some(Dialect::Fanuc),
            _ => None,
        });
        if let Some(dialect) = dialects.next_back().filter(|_| self.open.is_none()) {
            self.open = Some(Curve {
                broken: true,
                ..Curve::new(dialect, number)
            });
        }
    }

    /// The line that was read last is wrong.
    pub fn spoil(&mut self) {
        if let Some(curve) = &mut self.open {
            curve.broken = true;
        }
    }

    /// Whether a line with `words` belongs to the curve that is open.
    ///
    /// # Errors
    /// It does not, though the curve is not complete: the curve is given up.
    #[inline]
    pub fn goes_on(&mut self, words: &LineWords) -> Checked<bool> {
        if self.open.is_none() {
            Ok(false)
        } else {
            self.is_of_curve(words)
        }
    }

    #[cold]
    fn is_of_curve(&mut self, words: &LineWords) -> Checked<bool> {
        let Some(curve) = &self.open else {
            return Ok(false);
        };
        let own = |tenths: u16| match curve.dialect {
            Dialect::LinuxCnc => matches!(tenths, 52 | 53),
            Dialect::Fanuc => tenths == 62,
        };
        let foreign = words.g.as_slice().iter().find(|code| !own(code.tenths));
        let Some(code) = foreign.or(words.m.as_slice().first()) else {
            return Ok(true);
        };
        let message = match curve.dialect {
            Dialect::LinuxCnc if ends_curve(words) => {
                "G5.3 ends a curve: no other G or M word stands in its line".to_string()
            }
            Dialect::LinuxCnc => {
                let line = curve.line;
                format!(
                    "the curve that line {line} opens is not complete: G5.3, which ends it, is missing before this line"
                )
            }
            Dialect::Fanuc => {
                format!(
                    "the curve that line {} opens is not complete: {}",
                    curve.line,
                    curve.missing_knots()
                )
            }
        };
        let known = curve.broken;
        self.open = None;
        if known {
            Ok(false)
        } else {
            Err(LineError::new(code.span, "nurbs", message))
        }
    }

    /// The program ends: no curve may be open.
    pub fn end(&mut self) -> Checked<()> {
        match self.open.take() {
            Some(curve) if !curve.broken => {
                let message = format!(
                    "the program ends within the curve that line {} opens",
                    curve.line
                );
                Err(LineError::new(Span::new(0, 1), "nurbs", message))
            }
            _ => Ok(()),
        }
    }
}

/// Opens a curve at the programmed position, whose weight its reader adds.
pub(crate) fn open_curve(line: &mut Line, dialect: Dialect, uncertain: u32) -> Checked<()> {
    line.state.motion = MotionMode::None;
    line.state.curves.open = Some(Curve {
        inverse_time: line
            .words
            .get(b'F')
            .filter(|_| line.state.modes.feed.mode == FeedMode::InverseTime),
        broken: uncertain != 0,
        ..Curve::new(dialect, line.state.line)
    });
    line.refuse_machine_coordinates()?;
    // The lines of the curve have no F: what holds here holds for all of it.
    line.feed(1.0, true).map(|_| ())
}

/// A line of the curve that is open.
pub(crate) fn curve_line(line: &mut Line) -> Checked<()> {
    let Some(mut curve) = line.state.curves.open.take() else {
        return Ok(());
    };
    let done = match curve.dialect {
        Dialect::LinuxCnc => lines::linuxcnc_line(line, &mut curve),
        Dialect::Fanuc => lines::fanuc_line(line, &mut curve),
    };
    match done {
        Ok(false) => line.state.curves.open = Some(curve),
        Ok(true) => return close_curve(line, curve),
        Err(error) => {
            // A broken curve of Fanuc's ends where a line without a knot comes.
            let known = std::mem::replace(&mut curve.broken, true);
            line.state.curves.open =
                Some(curve).filter(|c| c.dialect == Dialect::Fanuc || !ends_curve(line.words));
            return if known { Ok(()) } else { Err(error) };
        }
    }
    Ok(())
}

fn ends_curve(words: &LineWords) -> bool {
    words.g.as_slice().iter().any(|code| code.tenths == 53)
}

/// The curve is complete: checks it and makes its block.
fn close_curve(line: &mut Line, mut curve: Curve) -> Checked<()> {
    if curve.broken {
        return Ok(());
    }
    let order = curve.order.unwrap_or(0);
    let weight = if curve.dialect == Dialect::LinuxCnc {
        b'P'
    } else {
        b'R'
    };
    if curve.dialect == Dialect::LinuxCnc {
        curve.knots = uniform_knots(order, curve.points.len());
    }
    let places = std::mem::take(&mut curve.places);
    let origin = Origin {
        line: curve.line,
        inverse_time: curve.inverse_time,
        places,
        weight,
    };
    push_curve(line, &origin, curve.data(order - 1))
}

/// Makes the block of a whole curve that begins at the programmed position.
fn push_curve(line: &mut Line, origin: &Origin, data: NurbsData) -> Checked<()> {
    let made = Nurbs::new(&data, &line.config.axes);
    let curve =
        made.map_err(|error| origin.blame(curve_error(line, origin.line, &error), &error, &data))?;
    check_curve_travel(line, &curve, origin)?;
    let length_mm = curve.length().mm;
    let feed_mm_per_s = match origin.inverse_time {
        Some(per_min) if per_min > 0.0 => length_mm * per_min / 60.0,
        _ => line.feed(length_mm, slides(line, &data))?,
    };
    let end = *data
        .control_points
        .last()
        .unwrap_or(&line.state.path.position);
    let blank = line.state.blank_block();
    let block = Block {
        kind: BlockKind::Nurbs,
        end,
        line: origin.line,
        length_mm,
        feed_mm_per_s,
        ..blank
    };
    line.state.path.position = end;
    line.state.path.advance_to(end);
    line.out.push(Item::Block(block, Some(Arc::new(data))));
    Ok(())
}

fn curve_error(line: &Line, opened: u32, error: &NurbsError) -> LineError {
    let message = if opened == line.state.line {
        error.to_string()
    } else {
        format!("the curve that line {opened} opens: {error}")
    };
    line.motion_error("nurbs", message)
}

/// Whether a linear axis moves.
fn slides(line: &Line, data: &NurbsData) -> bool {
    data.control_points
        .iter()
        .any(|point| line.moves_linear(&(*point - data.control_points[0])))
}

fn check_curve_travel(line: &Line, curve: &Nurbs, origin: &Origin) -> Checked<()> {
    for axis in 0..line.letters.count() {
        let ((low, high), (min, max)) = (curve.extent(axis), line.config.travel_mm[axis]);
        let beyond = |error| {
            let (limit, above) = if high > max {
                (max, true)
            } else {
                (min, false)
            };
            origin.blame_travel(
                error,
                curve,
                (axis, line.letters.letter(axis)),
                limit,
                above,
            )
        };
        if high > low {
            line.check_travel(axis, low, high).map_err(beyond)?;
        }
    }
    Ok(())
}

/// Knots of LinuxCNC's curves: clamped, and one apart inside.
fn uniform_knots(order: usize, points: usize) -> Vec<f64> {
    (0..points + order)
        .map(|index| index.clamp(order - 1, points) as f64 - (order - 1) as f64)
        .collect()
}
