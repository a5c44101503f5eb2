//! One program under one model.

use tandem_gcode::{CheckReport, Program};
use tandem_host::{Clock, HostError, Registry, Run, RunObserver, Switches, each_block};
use tandem_machine::Machine;
use tandem_rings::{Rest, RestCause};
use tandem_sdk::{Block, BlockKind, BlockReport, Curve, Limits};

use crate::choice::Choice;
use crate::element::Element;
use crate::model::{Case, Model, Spent};
use crate::tally::Tally;

/// What a program takes.
#[derive(Clone, Debug)]
pub struct Estimate {
    /// The program, as it was opened.
    pub program: String,
    /// The model's name.
    pub model: &'static str,
    /// Time, s. Under the simulation whole fine periods; the parts of the tally are then those of the planner, before
    /// rounding.
    pub estimated_s: f64,
    /// Where it goes.
    pub tally: Tally,
    /// How often an edge did not come, and was assumed where the motion towards it ended.
    pub assumed_edges: u64,
}

/// Why there is no estimate.
#[derive(Debug, thiserror::Error)]
pub enum EstimateError {
    /// The machine or the program refuses.
    #[error(transparent)]
    Host(#[from] HostError),
    /// The simulated run ended before the program did.
    #[error("{program}: the simulated run ended before the program: {cause}")]
    Stopped {
        /// The program.
        program: String,
        /// Why.
        cause: String,
    },
}

/// Estimates the time of `program` on `machine`. Reads the program once, twice for the simulation; keeps a bounded number
/// of blocks.
///
/// # Errors
/// The program has errors, or plugins refuse; the simulated run does not come to the program's end.
pub fn estimate(
    machine: &Machine,
    registry: &Registry,
    program: Program,
    switches: Switches,
    choice: &Choice,
) -> Result<Estimate, EstimateError> {
    match (choice.model(), choice) {
        (Some(mut model), _) => closed(machine, program, switches, choice.name(), model.as_mut()),
        (None, Choice::Planned(planned)) => {
            let machine = planned.machine(machine);
            simulate(&machine, registry, program, switches, choice.name())
        }
        (None, _) => simulate(machine, registry, program, switches, choice.name()),
    }
}

fn closed(
    machine: &Machine,
    mut program: Program,
    switches: Switches,
    name: &'static str,
    model: &mut dyn Model,
) -> Result<Estimate, EstimateError> {
    let mut tally = Tally::default();
    let mut add = |element: &Element, spent: &Spent| tally.add(element, spent);
    let report = each_block(machine, &mut program, switches, &mut |block, curve| {
        model.block(&Element::new(block, curve, &machine.limits), &mut add);
    })?;
    if !report.is_ok() {
        return Err(HostError::Check(Box::new(report)).into());
    }
    model.finish(&mut add);
    Ok(Estimate {
        program: program.name().to_string(),
        model: name,
        estimated_s: tally.all.time_s,
        tally,
        assumed_edges: 0,
    })
}

fn simulate(
    machine: &Machine,
    registry: &Registry,
    program: Program,
    switches: Switches,
    model: &'static str,
) -> Result<Estimate, EstimateError> {
    let name = program.name().to_string();
    let switches = Switches {
        clock: Some(Clock::Virtual),
        ..switches
    };
    let run = Run::prepare(machine.clone(), registry, program, switches)?;
    let mut watch = Watch {
        limits: machine.limits,
        tally: Tally::default(),
        missed: 0,
    };
    let summary = run.drive(Clock::Virtual, &[], &mut watch)?.summary;
    if let Some(cause) = summary.fault.or(summary.stopped) {
        return Err(EstimateError::Stopped {
            program: name,
            cause,
        });
    }
    Ok(Estimate {
        program: name,
        model,
        estimated_s: summary.motion_time_s,
        tally: watch.tally,
        assumed_edges: if switches.assumes_edges {
            watch.missed
        } else {
            0
        },
    })
}

/// Takes the planner's own report of each block; samples pass by.
struct Watch {
    limits: Limits,
    tally: Tally,
    missed: u64,
}

impl RunObserver for Watch {
    fn rest(&mut self, rest: &Rest) {
        self.missed += u64::from(rest.cause == RestCause::Missed);
    }

    fn block(&mut self, block: &Block, curve: Option<Curve<'_>>, report: &BlockReport) {
        let element = Element::new(block, curve, &self.limits);
        let cut = !matches!(block.kind, BlockKind::Dwell | BlockKind::Rapid);
        let case = cut.then(|| case_of(&element, report));
        let spent = Spent {
            time_s: report.time_s,
            reached_mm_per_s: report.peak_feed_mm_per_s,
            case,
        };
        self.tally.add(&element, &spent);
    }
}

fn case_of(element: &Element, report: &BlockReport) -> Case {
    let reaches = |feed: f64| report.peak_feed_mm_per_s <= feed * (1.0 + 1e-9);
    if report.peak_feed_mm_per_s >= element.feed_mm_per_s * (1.0 - 1e-6) {
        Case::ReachesFeed
    } else if reaches(report.end_feed_mm_per_s) {
        Case::SpeedsUp
    } else if reaches(report.start_feed_mm_per_s) {
        Case::SlowsDown
    } else {
        Case::Peak
    }
}

/// The errors of a program, where that is why there is no estimate.
pub fn program_errors(error: &EstimateError) -> Option<&CheckReport> {
    match error {
        EstimateError::Host(HostError::Check(report)) => Some(report),
        _ => None,
    }
}
