//! A job on the virtual clock: what it takes, and what it comes to.

use std::collections::{BTreeMap, VecDeque};

use tandem_gcode::Program;
use tandem_host::{Clock, HostError, Registry, Run, RunObserver, Switches, with_stand_ins};
use tandem_machine::Machine;
use tandem_rings::Sample;
use tandem_sdk::{AxisVector, Block, BlockKind, BlockReport, Curve};

use crate::inputs::Inputs;
use crate::job::Job;
use crate::result::{Ended, numbers_of};

/// The plugins that are linked in, and which of them stands in for real drives.
pub struct Plugins<'a> {
    /// Makes a registry of them.
    pub registry: &'a (dyn Fn() -> Result<Registry, String> + Sync),
    /// The driver of ideal drives.
    pub ideal_drives: &'a str,
}

/// Errors of a program that are told; the rest are counted.
const MAX_ERRORS: usize = 3;

/// What the program is called in messages: its place on this computer is no part of the job.
pub const PROGRAM: &str = "program";

/// Simulates a job. Beside the numbers of the summary there are `max_corner_error_mm`, the largest distance of a block's end
/// from the way that was driven, `max_NAME` for the magnitude of each signal of the feed strategy, and where on the path the
/// largest deviation was: `deviation_at_line`, and `deviation_at_mm.x` and so on. Host; allocates.
pub fn simulate(job: &Job, inputs: &Inputs, plugins: &Plugins<'_>) -> Ended {
    let refused = |cause: String| Ended::Refused(inputs.without_names_of_here(&cause));
    let mut watch = Watch::default();
    let run = match prepare(job, inputs, plugins) {
        Ok((machine, run)) => {
            watch.begin(&machine, &run);
            run
        }
        Err(cause) => return refused(cause),
    };
    match run.drive(Clock::Virtual, &[], &mut watch) {
        Err(error) => refused(error.to_string()),
        Ok(outcome) => {
            let summary = outcome.summary;
            if let Some(cause) = summary.fault.as_ref().or(summary.stopped.as_ref()) {
                return Ended::Stopped(inputs.without_names_of_here(cause));
            }
            let mut numbers = numbers_of(&summary);
            watch.add_to(&mut numbers);
            Ended::Done(numbers)
        }
    }
}

/// The same, with `observer` told of everything.
///
/// # Errors
/// The machine or the program is refused, or the run does not come to its end; in words.
pub fn simulate_with(
    job: &Job,
    inputs: &Inputs,
    plugins: &Plugins<'_>,
    observer: &mut dyn RunObserver,
) -> Result<(), String> {
    let (_, run) = prepare(job, inputs, plugins)?;
    let summary = run.drive(Clock::Virtual, &[], observer);
    let summary = summary.map_err(|e| e.to_string())?.summary;
    summary.fault.or(summary.stopped).map_or(Ok(()), Err)
}

fn prepare(job: &Job, inputs: &Inputs, plugins: &Plugins<'_>) -> Result<(Machine, Run), String> {
    let machine = inputs
        .machine(&job.machine, &job.set)
        .map_err(|e| e.to_string())?;
    let registry = (plugins.registry)()?;
    let (machine, notes) = with_stand_ins(&machine, &registry, Some(plugins.ideal_drives))
        .map_err(|e| e.to_string())?;
    let switches = Switches {
        block_delete: job.block_delete,
        assumes_edges: !notes.is_empty(),
        clock: Some(Clock::Virtual),
        ..Switches::default()
    };
    let text = inputs.get(&job.program).map_err(|e| e.to_string())?;
    let program = Program::spool(PROGRAM, text.as_slice()).map_err(|e| e.to_string())?;
    let run = Run::prepare(machine.clone(), &registry, program, switches).map_err(words)?;
    Ok((machine, run))
}

/// Why a run was refused, with the first errors of its program.
fn words(error: HostError) -> String {
    let HostError::Check(report) = error else {
        return error.to_string();
    };
    let listed = report.diagnostics.iter().take(MAX_ERRORS);
    let mut lines: Vec<String> = listed.map(ToString::to_string).collect();
    let count = report.diagnostics.len() as u64 + report.unlisted;
    let more = count - lines.len() as u64;
    if more > 0 {
        lines.push(format!("and {more} more errors"));
    }
    lines.join("\n")
}

/// Blocks that a corner is still looked at after it was passed: what a filter can hold of short ones.
const BLOCKS_BEHIND: u64 = 64;

/// The end of a block, while samples come by.
struct Corner {
    block: u64,
    at: AxisVector,
    nearest_mm: f64,
}

/// Watches what the summary does not have.
#[derive(Default)]
struct Watch {
    /// Letter and place of each linear axis.
    axes: Vec<(char, usize)>,
    signals: Vec<String>,
    max_signals: Vec<f64>,
    corners: VecDeque<Corner>,
    max_corner_error_mm: f64,
    last: Option<AxisVector>,
    max_deviation_mm: f64,
    deviation_at: Option<(u32, AxisVector)>,
}

impl Watch {
    fn begin(&mut self, machine: &Machine, run: &Run) {
        let linear = (0..machine.axes.count()).filter(|i| !machine.axes.is_rotary(*i));
        self.axes = linear
            .map(|i| (machine.axes.letter(i).to_ascii_lowercase(), i))
            .collect();
        self.signals = run.signals();
        self.max_signals = vec![0.0; self.signals.len()];
    }

    fn add_to(&self, numbers: &mut BTreeMap<String, f64>) {
        let left = self
            .corners
            .iter()
            .filter(|corner| corner.nearest_mm.is_finite());
        let worst = left.fold(self.max_corner_error_mm, |most, corner| {
            most.max(corner.nearest_mm)
        });
        numbers.insert("max_corner_error_mm".to_string(), worst);
        for (name, most) in self.signals.iter().zip(&self.max_signals) {
            numbers.insert(format!("max_{name}"), *most);
        }
        if let Some((line, at)) = &self.deviation_at {
            numbers.insert("deviation_at_line".to_string(), f64::from(*line));
            for (letter, i) in &self.axes {
                numbers.insert(format!("deviation_at_mm.{letter}"), at[*i]);
            }
        }
    }

    /// The distance of a point from the way between the last two samples, linear axes alone.
    fn distance_mm(&self, from: &AxisVector, to: &AxisVector, point: &AxisVector) -> f64 {
        let linear = || self.axes.iter().map(|(_, i)| *i);
        let (mut along, mut length) = (0.0, 0.0);
        for i in linear() {
            along += (point[i] - from[i]) * (to[i] - from[i]);
            length += (to[i] - from[i]).powi(2);
        }
        let share = if length > 0.0 {
            (along / length).clamp(0.0, 1.0)
        } else {
            0.0
        };
        let square: f64 = linear()
            .map(|i| (point[i] - from[i] - share * (to[i] - from[i])).powi(2))
            .sum();
        square.sqrt()
    }

    fn look_at_corners(&mut self, sample: &Sample, from: &AxisVector) {
        let to = &sample.command;
        let mut moved = 0.0_f64;
        for (_, i) in &self.axes {
            let i = *i;
            moved = moved.max((to[i] - from[i]).abs());
        }
        let mut place = 0;
        while place < self.corners.len() && self.corners[place].block <= sample.block + 1 {
            let corner = &self.corners[place];
            let distance_mm = self.distance_mm(from, to, &corner.at);
            let (block, nearest_mm) = (corner.block, corner.nearest_mm.min(distance_mm));
            self.corners[place].nearest_mm = nearest_mm;
            // Passed, and left behind by more than it was missed by: the way does not come back to it within the block.
            let left = block < sample.block && distance_mm > 4.0 * nearest_mm + 4.0 * moved;
            if left || block + BLOCKS_BEHIND < sample.block {
                self.max_corner_error_mm = self.max_corner_error_mm.max(nearest_mm);
                self.corners.remove(place);
            } else {
                place += 1;
            }
        }
    }
}

impl RunObserver for Watch {
    fn block(&mut self, block: &Block, _curve: Option<Curve<'_>>, _report: &BlockReport) {
        if block.length_mm > 0.0 && block.kind != BlockKind::Dwell {
            self.corners.push_back(Corner {
                block: block.index,
                at: block.end,
                nearest_mm: f64::INFINITY,
            });
        }
    }

    fn sample(&mut self, sample: &Sample, deviation_mm: f64, signals: &[f64]) {
        for (most, now) in self.max_signals.iter_mut().zip(signals) {
            *most = most.max(now.abs());
        }
        if deviation_mm > self.max_deviation_mm {
            self.max_deviation_mm = deviation_mm;
            self.deviation_at = Some((sample.line, sample.command));
        }
        let last = self.last.replace(sample.command).unwrap_or(sample.command);
        self.look_at_corners(sample, &last);
    }
}
