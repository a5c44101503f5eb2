//! Lines that move axes.

use std::f64::consts::PI;

use super::{
    arc,
    codes::LineCodes,
    line::Line,
    state::{FeedMode, Motion, State},
};
use crate::{
    Position,
    geometry::minus,
    path::{self, Element, Feed, Shape},
};

/// Chords whose sum is the length of a piece of a curve.
const CHORDS: u32 = 64;
/// What is shorter is the rounding of a sum of distances, and no motion; mm or degrees.
const NO_MOVE: f64 = 1e-10;
/// Arcs are cut into pieces so that none is mistaken for its chord.
const GREATEST_SWEEP_RAD: f64 = PI / 8.0;

impl State<'_> {
    /// Moves to where the axis words of a line say.
    pub fn move_axes(
        &mut self,
        line: &mut Line,
        codes: &LineCodes,
        number: usize,
    ) -> Result<(), String> {
        let axes = self.take_axes(line)?;
        let is_arc = codes.once.is_none() && matches!(self.motion, Some(Motion::Arc { .. }));
        if axes.is_empty()
            && !(is_arc
                && ['I', 'J', 'K', 'R']
                    .into_iter()
                    .any(|letter| line.has(letter)))
        {
            return Ok(());
        }
        let motion = codes
            .once
            .or(self.motion)
            .ok_or("axis words without a motion word")?;
        if is_arc && codes.machine_coordinates {
            return Err("G53 with an arc".into());
        }
        let mut target = self.target(&axes, codes.machine_coordinates);
        if motion == Motion::Probe {
            target = self.probed(target, number);
        }
        let shapes = match motion {
            Motion::Arc { clockwise } => pieces(&arc::build(self, line, &target, clockwise)?),
            _ if is_rounding(&minus(&target, &self.position)) => Vec::new(),
            _ => vec![Shape::Line(path::Line::new(self.position, target))],
        };
        self.append(shapes, motion, number)?;
        self.position = target;
        Ok(())
    }

    fn target(&self, axes: &[(usize, f64)], machine_coordinates: bool) -> Position {
        let mut target = self.position;
        for &(axis, value) in axes {
            target[axis] = match (machine_coordinates, self.incremental) {
                (true, _) => value,
                (false, true) => self.position[axis] + value,
                (false, false) => value + self.offset_mm(axis),
            };
        }
        target
    }

    /// Where a probe ends: the point of its line next to where the trace leaves the program line. So a machine that
    /// comes to rest beside the line is off its path.
    fn probed(&self, target: Position, number: usize) -> Position {
        let rest = self.rows.iter().rfind(|row| row.line as usize == number);
        let Some(rest) = rest.filter(|_| target != self.position) else {
            return target;
        };
        let line = path::Line::new(self.position, target);
        line.at(line.foot(&rest.command).clamp(0.0, 1.0))
    }

    /// Appends pieces of one block to the path.
    pub fn append(
        &mut self,
        shapes: Vec<Shape>,
        motion: Motion,
        number: usize,
    ) -> Result<(), String> {
        if shapes.is_empty() {
            return Ok(());
        }
        let arc = matches!(motion, Motion::Arc { .. });
        let linear = |index: usize| !self.machine.axis(index).is_some_and(|axis| axis.rotary);
        let moves_linear = arc
            || shapes.iter().any(|shape| {
                let moved = minus(&shape.at(1.0), &shape.at(0.0));
                (0..moved.len()).any(|axis| linear(axis) && moved[axis] != 0.0)
            });
        let counted = |axis: usize| linear(axis) == moves_linear;
        let feed = if motion == Motion::Rapid {
            Feed::Rapid
        } else {
            let length_mm = shapes
                .iter()
                .map(|shape| counted_length_mm(shape, &counted))
                .sum();
            Feed::PerSecond(self.feed_per_s(length_mm, moves_linear)?)
        };
        let last = shapes.len() - 1;
        self.elements.extend(
            shapes
                .into_iter()
                .enumerate()
                .map(|(index, shape)| Element {
                    line: number as u32,
                    shape,
                    feed,
                    moves_linear,
                    tolerance_mm: self.tolerance_mm.unwrap_or(self.machine.path_tolerance_mm),
                    exact_stop: (self.exact_stop || motion == Motion::Probe) && index == last,
                }),
        );
        Ok(())
    }

    /// The programmed feed in mm/s, or deg/s where no linear axis moves.
    fn feed_per_s(&self, length_mm: f64, moves_linear: bool) -> Result<f64, String> {
        let (feed, unit_mm) = self
            .feed
            .filter(|&(feed, _)| feed > 0.0)
            .ok_or("motion without a feed")?;
        let per_minute = match (self.feed_mode, moves_linear) {
            (FeedMode::InverseTime, _) => feed * length_mm,
            (FeedMode::PerMinute, true) => feed * unit_mm,
            (FeedMode::PerMinute, false) => feed,
        };
        Ok(per_minute / 60.0)
    }
}

/// Length over the axes that path speed counts.
fn counted_length_mm(shape: &Shape, counted: &impl Fn(usize) -> bool) -> f64 {
    let squares = |along: &Position| {
        (0..along.len())
            .filter(|&axis| counted(axis))
            .map(|axis| along[axis].powi(2))
            .sum()
    };
    match shape {
        Shape::Line(_) => {
            let squared: f64 = squares(&minus(&shape.at(1.0), &shape.at(0.0)));
            squared.sqrt()
        }
        Shape::Curve(_) => {
            let chord = |step: u32| {
                let ends =
                    [step, step + 1].map(|step| shape.at(f64::from(step) / f64::from(CHORDS)));
                let squared: f64 = squares(&minus(&ends[1], &ends[0]));
                squared.sqrt()
            };
            (0..CHORDS).map(chord).sum()
        }
        Shape::Arc(arc) => {
            let squared: f64 = squares(&arc.along);
            (arc.radius_mm * arc.sweep_rad).hypot(squared.sqrt())
        }
    }
}

fn pieces(arc: &path::Arc) -> Vec<Shape> {
    let count = (arc.sweep_rad.abs() / GREATEST_SWEEP_RAD).ceil().max(1.0) as usize;
    let fraction = |index: usize| index as f64 / count as f64;
    (0..count)
        .map(|index| Shape::Arc(arc.part(fraction(index), fraction(index + 1))))
        .collect()
}

fn is_rounding(way: &Position) -> bool {
    way.iter().all(|by| by.abs() < NO_MOVE)
}
