//! The way that was driven around one place of a program, beside the programmed path: what a deviation looks like.

use std::collections::BTreeMap;

use tandem_host::RunObserver;
use tandem_machine::Machine;
use tandem_recorder::polyline;
use tandem_rings::Sample;
use tandem_sdk::{Axes, AxisVector, Block, BlockReport, Curve};

/// Points of a drawing at most: one that has more shows no single way any longer.
const MAX_POINTS: usize = 20_000;

/// Lines of points, mm, by the linear axes in the machine's order.
pub type Lines = Vec<Vec<Vec<f64>>>;

/// Collects what passes near a place.
pub struct Scene {
    axes: Axes,
    linear: Vec<usize>,
    centre: Vec<f64>,
    radius_mm: f64,
    last: Option<AxisVector>,
    left: usize,
    /// The programmed path.
    pub programmed: Lines,
    /// The way that was driven.
    pub driven: Lines,
}

impl Scene {
    /// Nothing seen yet of what passes within `radius_mm` of `at_mm`, in each linear axis of `machine`.
    pub fn new(machine: &Machine, at_mm: &BTreeMap<char, f64>, radius_mm: f64) -> Self {
        let axes = machine.axes;
        let linear: Vec<usize> = (0..axes.count()).filter(|i| !axes.is_rotary(*i)).collect();
        let place = |i: &usize| at_mm.get(&axes.letter(*i).to_ascii_lowercase()).copied();
        let centre = linear.iter().map(|i| place(i).unwrap_or(0.0)).collect();
        Self {
            axes,
            linear,
            centre,
            radius_mm,
            last: None,
            left: MAX_POINTS,
            programmed: vec![],
            driven: vec![],
        }
    }

    /// The letters of the linear axes.
    pub fn letters(&self) -> Vec<char> {
        self.linear.iter().map(|i| self.axes.letter(*i)).collect()
    }

    /// The line from `from` to `to`, where it comes near; it goes on from the last one of `lines` where that ends at `from`.
    fn add(&self, lines: &mut Lines, from: &AxisVector, to: &AxisVector) -> bool {
        if !self.is_near(from, to) {
            return false;
        }
        let point = |at: &AxisVector| self.linear.iter().map(|i| at[*i]).collect::<Vec<f64>>();
        let (from, to) = (point(from), point(to));
        match lines.last_mut() {
            Some(line) if line.last() == Some(&from) => line.push(to),
            _ => lines.push(vec![from, to]),
        }
        true
    }

    /// Whether the box around a line touches the box around the place.
    fn is_near(&self, from: &AxisVector, to: &AxisVector) -> bool {
        self.linear.iter().zip(&self.centre).all(|(i, centre)| {
            let (low, high) = (from[*i].min(to[*i]), from[*i].max(to[*i]));
            low <= centre + self.radius_mm && high >= centre - self.radius_mm
        })
    }
}

impl RunObserver for Scene {
    fn block(&mut self, block: &Block, curve: Option<Curve<'_>>, _report: &BlockReport) {
        let mut from = block.start;
        let mut programmed = std::mem::take(&mut self.programmed);
        for to in polyline(&self.axes, block, curve, 0.02 * self.radius_mm) {
            if self.left > 0 && self.add(&mut programmed, &from, &to) {
                self.left -= 1;
            }
            from = to;
        }
        self.programmed = programmed;
    }

    fn sample(&mut self, sample: &Sample, _deviation_mm: f64, _signals: &[f64]) {
        let from = self.last.replace(sample.command).unwrap_or(sample.command);
        let mut driven = std::mem::take(&mut self.driven);
        if self.left > 0 && from != sample.command && self.add(&mut driven, &from, &sample.command)
        {
            self.left -= 1;
        }
        self.driven = driven;
    }
}
