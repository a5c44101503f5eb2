//! Curves over several lines, from the line that opens one to the block: what LinuxCNC's G5.2 and Fanuc's G06.2 share.

use std::sync::Arc;

use tandem_motion::nurbs::{Nurbs, NurbsError};
use tandem_sdk::{AxisVector, Block, BlockKind, NurbsData, OwnedBlock};

use crate::curve_places::{Origin, Places};
use crate::fault::{Checked, Fault, Span};
use crate::interpreter::Interpreter;
use crate::item::Item;
use crate::state::Motion;
use crate::table::Group;

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
    pub fn add(&mut self, point: AxisVector, weight: f64) {
        self.points.push(point);
        self.weights.push(weight);
    }

    /// What a curve of Fanuc's still lacks.
    fn missing_knots(&self) -> String {
        let order = self.order.unwrap_or(0);
        let alone = self.knots.len().saturating_sub(self.points.len());
        format!("of the {order} knots (K) that stand alone behind the last control point {} are missing", order - alone)
    }

    fn data(self, degree: usize) -> NurbsData {
        NurbsData { degree, control_points: self.points, weights: self.weights, knots: self.knots }
    }
}

impl Interpreter {
    /// Opens a curve at the programmed position, whose weight its reader adds.
    pub(crate) fn open_curve(&mut self, dialect: Dialect, uncertain: u32) -> Checked<()> {
        self.state.motion = Motion::None;
        self.curve = Some(Curve {
            dialect,
            line: self.state.line,
            order: None,
            points: Vec::new(),
            weights: Vec::new(),
            knots: Vec::new(),
            places: Places::default(),
            inverse_time: self.words.get(b'F').filter(|_| self.state.feed.inverse_time),
            broken: uncertain != 0,
        });
        if self.orders.get(Group::NonModal) == Some(530) {
            return Err(self.orders.fault(Group::NonModal, "conflict", "G53 goes with G0 and G1 only"));
        }
        // The lines of the curve have no F: what holds here holds for all of it.
        self.feed(1.0, true).map(|_| ())
    }

    /// Keeps the line of a curve that has just been read.
    #[inline]
    pub(crate) fn note_curve_line(&mut self, text: &[u8]) {
        if let Some(curve) = &mut self.curve {
            let count = curve.points.len().max(curve.knots.len());
            curve.places.note(self.state.line, text, count);
        }
    }

    /// Whether this line belongs to the curve that is open.
    ///
    /// # Errors
    /// It does not, though the curve is not complete: the curve is given up.
    pub(crate) fn goes_on(&mut self) -> Checked<bool> {
        let Some(curve) = &self.curve else { return Ok(false) };
        let own = |tenths: u16| match curve.dialect {
            Dialect::LinuxCnc => matches!(tenths, 52 | 53),
            Dialect::Fanuc => tenths == 62,
        };
        let foreign = self.words.g.as_slice().iter().find(|code| !own(code.tenths));
        let Some(code) = foreign.or(self.words.m.as_slice().first()) else { return Ok(true) };
        if curve.dialect == Dialect::LinuxCnc && self.ends_curve() {
            let (span, broken) = (code.span, curve.broken);
            self.curve = None;
            let alone = || Fault::new(span, "nurbs", "G5.3 ends a curve: no other G or M word stands in its line");
            return if broken { Ok(false) } else { Err(alone()) };
        }
        let missing = match curve.dialect {
            Dialect::LinuxCnc => "G5.3, which ends it, is missing before this line".to_string(),
            Dialect::Fanuc => curve.missing_knots(),
        };
        let (line, broken, span) = (curve.line, curve.broken, code.span);
        self.curve = None;
        if broken {
            return Ok(false);
        }
        Err(Fault::new(span, "nurbs", format!("the curve that line {line} opens is not complete: {missing}")))
    }

    /// A line of the curve that is open.
    pub(crate) fn curve_line(&mut self, out: &mut Vec<Item>) -> Checked<()> {
        self.orders.clear();
        let Some(mut curve) = self.curve.take() else { return Ok(()) };
        let done = match curve.dialect {
            Dialect::LinuxCnc => self.linuxcnc_line(&mut curve),
            Dialect::Fanuc => self.fanuc_line(&mut curve),
        };
        match done {
            Ok(false) => self.curve = Some(curve),
            Ok(true) => return self.close_curve(curve, out),
            Err(fault) => {
                // A broken curve of Fanuc's ends where a line without a knot comes.
                let known = std::mem::replace(&mut curve.broken, true);
                self.curve = Some(curve).filter(|c| c.dialect == Dialect::Fanuc || !self.ends_curve());
                return if known { Ok(()) } else { Err(fault) };
            }
        }
        Ok(())
    }

    fn ends_curve(&self) -> bool {
        self.words.g.as_slice().iter().any(|code| code.tenths == 53)
    }

    /// The program ends: no curve may be open.
    pub(crate) fn no_curve_open(&mut self) -> Checked<()> {
        match self.curve.take() {
            Some(curve) if !curve.broken => {
                let message = format!("the program ends within the curve that line {} opens", curve.line);
                Err(Fault::new(Span::new(0, 1), "nurbs", message))
            }
            _ => Ok(()),
        }
    }

    /// The curve is complete: checks it and makes its block.
    fn close_curve(&mut self, mut curve: Curve, out: &mut Vec<Item>) -> Checked<()> {
        if curve.broken {
            return Ok(());
        }
        let order = curve.order.unwrap_or(0);
        let weight = if curve.dialect == Dialect::LinuxCnc { b'P' } else { b'R' };
        if curve.dialect == Dialect::LinuxCnc {
            curve.knots = uniform_knots(order, curve.points.len());
        }
        let places = std::mem::take(&mut curve.places);
        let origin = Origin { line: curve.line, inverse_time: curve.inverse_time, places, weight };
        self.push_curve(&origin, curve.data(order - 1), out)
    }

    /// Makes the block of a whole curve that begins at the programmed position.
    pub(crate) fn push_curve(&mut self, origin: &Origin, data: NurbsData, out: &mut Vec<Item>) -> Checked<()> {
        let made = Nurbs::new(&data, &self.config.axes);
        let curve = made.map_err(|error| origin.blame(self.curve_fault(origin.line, &error), &error, &data))?;
        self.check_curve_travel(&curve, origin)?;
        let length_mm = curve.length().mm;
        let line = origin.line;
        let feed_mm_per_s = match origin.inverse_time {
            Some(per_min) if per_min > 0.0 => length_mm * per_min / 60.0,
            _ => self.feed(length_mm, self.slides(&data))?,
        };
        let end = *data.control_points.last().unwrap_or(&self.state.position);
        let block = Block { kind: BlockKind::Nurbs, end, line, length_mm, feed_mm_per_s, ..self.state.blank_block() };
        self.state.last_end = end;
        self.state.position = end;
        self.state.next_index += 1;
        self.state.at_rest = false;
        out.push(Item::Curve(OwnedBlock::new(block, Some(Arc::new(data)))));
        Ok(())
    }

    fn curve_fault(&self, line: u32, error: &NurbsError) -> Fault {
        let message = if line == self.state.line {
            error.to_string()
        } else {
            format!("the curve that line {line} opens: {error}")
        };
        self.motion_fault("nurbs", message)
    }

    /// Whether a linear axis moves.
    fn slides(&self, data: &NurbsData) -> bool {
        data.control_points.iter().any(|point| self.moves_linear(&(*point - data.control_points[0])))
    }

    fn check_curve_travel(&self, curve: &Nurbs, origin: &Origin) -> Checked<()> {
        for axis in 0..self.letters.count() {
            let ((low, high), (min, max)) = (curve.extent(axis), self.config.travel_mm[axis]);
            let beyond = |fault| {
                let (limit, above) = if high > max { (max, true) } else { (min, false) };
                origin.blame_travel(fault, curve, (axis, self.letters.letter(axis)), limit, above)
            };
            if high > low {
                self.check_travel(axis, low, high).map_err(beyond)?;
            }
        }
        Ok(())
    }
}

/// Knots of LinuxCNC's curves: clamped, and one apart inside.
fn uniform_knots(order: usize, points: usize) -> Vec<f64> {
    (0..points + order).map(|index| index.clamp(order - 1, points) as f64 - (order - 1) as f64).collect()
}
