//! The place where the tool does not fit, as it is told and drawn.

use std::f64::consts::TAU;

use super::corner::{along, beside};
use crate::line::Line;
use crate::line_error::{LineError, Sketch, show};
use crate::words::circle::Point;

/// Points that an arc is drawn by.
const ARC_POINTS: u32 = 48;

/// A programmed move in the plane.
#[derive(Clone, Copy, Debug)]
pub(super) struct Programmed {
    pub line: u32,
    pub from: Point,
    pub to: Point,
    /// Of an arc: its centre, and whether it turns clockwise.
    pub bend: Option<(Point, bool)>,
}

impl Programmed {
    fn points(&self) -> Vec<Point> {
        let Some((center, clockwise)) = self.bend else {
            return vec![self.from, self.to];
        };
        let polar = |point: Point| {
            let [x, y] = [point[0] - center[0], point[1] - center[1]];
            (y.atan2(x), x.hypot(y))
        };
        let ((start, radius_mm), (end, _)) = (polar(self.from), polar(self.to));
        let turn = if clockwise { start - end } else { end - start };
        let turn = turn.rem_euclid(TAU);
        let turn = if turn < 1e-9 { TAU } else { turn };
        let turn = if clockwise { -turn } else { turn };
        let at = |step: u32| {
            let angle = start + turn * f64::from(step) / f64::from(ARC_POINTS);
            along(center, [angle.cos(), angle.sin()], radius_mm)
        };
        (0..=ARC_POINTS).map(at).collect()
    }
}

/// The tool would cut into what the lines leave.
#[cold]
pub(super) fn gouge(line: &Line, of: u32, why: &str) -> LineError {
    let word = line.state.compensation.word();
    let now = line.state.line;
    let radius = show(line.state.compensation.radius_mm);
    let message = format!(
        "with {word} and a tool of radius {radius} mm the moves of the lines {of} and {now} cannot be driven: {why}; a smaller \
         tool, or another path"
    );
    drawn(line, line.motion_error("gouge", message))
}

/// An error with the moves around the corner, and the tool beside it.
#[cold]
pub(super) fn drawn(line: &Line, mut error: LineError) -> LineError {
    let compensation = &line.state.compensation;
    let moves = compensation.programmed_moves.iter().flatten();
    let towards = beside(compensation.direction, compensation.side);
    error.sketch = Some(Box::new(Sketch {
        axes: compensation
            .plane
            .map(|axis| line.letters.letter(axis) as char),
        moves: moves.map(|one| (one.line, one.points())).collect(),
        tool_at_mm: along(compensation.programmed, towards, compensation.radius_mm),
        tool_radius_mm: compensation.radius_mm,
    }));
    error
}
