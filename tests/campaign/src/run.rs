//! One run in this process, and its judgement.

use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::path::Path;

use tandem_host::{Clock, HostError, Outcome, Registry, Run, RunObserver, Switches};
use tandem_machine::Machine;
use tandem_oracle::{Joints, Row, axis_index};
use tandem_recorder::TraceCsv;
use tandem_rings::Sample;

use crate::bound::{Bound, Sways};
use crate::case::Case;
use crate::verdict::{Asked, Report, judge};

/// Samples after which a run is ended, whatever the bound says: a program that needs more is not what is drawn.
pub const MAX_SAMPLES: usize = 600_000;
/// Time without any motion at the end of a run that has taken too long, s: it stands still.
const STILL_S: f64 = 0.2;

/// What a run left for the judge.
pub struct Ran {
    /// Every sample, as the oracle reads them.
    pub rows: Vec<Row>,
    /// The longest way along the path within one period, mm or deg, that of rotary axes beside linear ones counted too.
    pub longest_step_mm: f64,
    /// What the host says of the run; none where it was ended because it took too long.
    pub outcome: Option<Outcome>,
    /// Most samples that it was given.
    pub max_samples: usize,
    /// Whether the program needs more than [`MAX_SAMPLES`] at the speeds of its axes and joints: it is judged as far as it came.
    pub is_cut_off: bool,
    /// Most memory that the process had until the end of the run, MB.
    pub memory_mb: f64,
}

/// The built-in plugins.
///
/// # Panics
/// Two plugins have one name.
pub fn registry() -> Registry {
    let mut registry = Registry::default();
    let linked = [
        tandem_look_ahead::PLUGIN,
        tandem_after_interpolation::PLUGIN,
        tandem_block_overlap::PLUGIN,
        tandem_nurbs::PLUGIN,
        tandem_smooth::PLUGIN,
        tandem_corexy::PLUGIN,
        tandem_wrapped_rotary::PLUGIN,
        tandem_sim::PLUGIN,
    ];
    for plugin in linked {
        registry
            .register(plugin)
            .expect("each plugin has a name of its own");
    }
    registry
}

/// Drives a case with the plugins of `registry` and judges it. Its files are written to `folder`; what is left there is
/// what was run.
pub fn run(case: &Case, folder: &Path, registry: &Registry) -> Report {
    let planner = case.planner();
    match catch_unwind(AssertUnwindSafe(|| attempt(case, folder, registry))) {
        Ok(Ok(report)) => Report { planner, ..report },
        Ok(Err(report)) => Report { planner, ..*report },
        Err(panic) => {
            let text = panic.downcast_ref::<String>().cloned();
            let text = text.or_else(|| panic.downcast_ref::<&str>().map(ToString::to_string));
            Report {
                planner,
                ..Report::failed("panic", text.unwrap_or_else(|| "without words".to_string()))
            }
        }
    }
}

fn attempt(case: &Case, folder: &Path, registry: &Registry) -> Result<Report, Box<Report>> {
    let driven = drive(case, folder, registry)?;
    Ok(judge(&driven.ran, case, &driven.judging, &driven.asked))
}

/// A run that is to be judged.
pub struct Driven {
    /// What it left.
    pub ran: Ran,
    /// The machine as the oracle reads it.
    pub judging: tandem_oracle::Machine,
    /// What was asked for.
    pub asked: Asked,
}

/// Drives a case without judging it.
///
/// # Errors
/// The report of a case that was refused, or that is none.
pub fn drive(case: &Case, folder: &Path, registry: &Registry) -> Result<Driven, Box<Report>> {
    let wrong = |cause: String| Box::new(Report::failed("no-case", cause));
    case.write(folder).map_err(wrong)?;
    let [program, file] = ["program.ngc", "machine.toml"].map(|name| folder.join(name));
    let machine = Machine::read(&file, &[]).map_err(|e| wrong(e.to_string()))?;
    let judging = tandem_oracle::Machine::read(&file).map_err(|e| wrong(e.to_string()))?;
    if let Joints::Unknown(why) = &judging.joints {
        return Err(wrong(why.clone()));
    }
    let asked = Asked::of(case, &machine).map_err(wrong)?;
    let asks = Bound::of(&program, &machine, &judging, asked.filter_s).map_err(wrong)?;
    let until_s = asked.last_tick as f64 * machine.fine_period_s
        + asked.stalled as f64 * machine.rough_period_s;
    let max_samples = (((asks.time_s + until_s) / machine.fine_period_s) as usize).min(MAX_SAMPLES);
    let parsed = tandem_gcode::Program::open(&program).map_err(|e| wrong(e.to_string()))?;
    forget_most_memory();
    let prepared = Run::prepare(machine.clone(), registry, parsed, Switches::default());
    let run = prepared.map_err(|refusal| Box::new(refused(&refusal)))?;
    let least_samples = asks.least_s / machine.fine_period_s;
    let mut kept = Kept::new(&machine, max_samples, asks.sways, asked.max_ratio);
    let driven = catch_unwind(AssertUnwindSafe(|| {
        run.drive(Clock::Virtual, &asked.commands, &mut kept)
    }));
    let outcome = match driven {
        Ok(outcome) => {
            Some(outcome.map_err(|e| Box::new(Report::failed("refused-in-run", e.to_string())))?)
        }
        Err(panic) if panic.is::<TooLong>() => None,
        Err(panic) => resume_unwind(panic),
    };
    let ran = Ran {
        is_cut_off: outcome.is_none() && least_samples > MAX_SAMPLES as f64,
        rows: kept.rows,
        longest_step_mm: kept.longest_step_mm,
        outcome,
        max_samples,
        memory_mb: max_memory_mb(),
    };
    Ok(Driven {
        ran,
        judging,
        asked,
    })
}

/// What was refused before anything moved: the place and the reason are part of it.
fn refused(refusal: &HostError) -> Report {
    let HostError::Check(report) = refusal else {
        return Report::failed("refused-machine", refusal.to_string());
    };
    let first = report.diagnostics.first();
    let place =
        |d: &tandem_gcode::Diagnostic| format!("line {}:{}: {}", d.line, d.column, d.message);
    Report {
        kind: "refused".to_string(),
        why: first.map_or_else(String::new, place),
        ..Report::default()
    }
}

/// Ends a run from its observer.
struct TooLong;

struct Kept {
    rows: Vec<Row>,
    longest_step_mm: f64,
    axes: Vec<(usize, bool)>,
    sways: Sways,
    max_ratio: f64,
    period_s: f64,
    most: usize,
}

impl Kept {
    fn new(machine: &Machine, most: usize, sways: Sways, max_ratio: f64) -> Self {
        let axis = |axis| {
            (
                axis_index(machine.axes.letter(axis)).unwrap_or_default(),
                machine.axes.is_rotary(axis),
            )
        };
        let axes = (0..machine.axes.count()).map(axis).collect();
        Self {
            rows: vec![],
            longest_step_mm: 0.0,
            axes,
            sways,
            max_ratio,
            period_s: machine.fine_period_s,
            most,
        }
    }
}

impl RunObserver for Kept {
    fn sample(&mut self, sample: &Sample, _deviation_mm: f64, _signals: &[f64]) {
        let mut row = Row {
            t_s: TraceCsv::t_s(sample.tick, self.period_s),
            line: sample.line,
            ..Row::default()
        };
        for (from, &(to, rotary)) in self.axes.iter().enumerate() {
            let at = sample.command[from];
            row.command[to] = if rotary { at.to_degrees() } else { at };
        }
        // Where only rotary axes move, the feed is theirs; so it is where a period ends in a block of that kind.
        let moves = |axis: &(usize, bool)| {
            !axis.1
                && self
                    .rows
                    .last()
                    .is_some_and(|last| last.command[axis.0] != row.command[axis.0])
        };
        let turns = self.axes.iter().any(|axis| axis.1) && !self.axes.iter().any(moves);
        let step = sample.feed_mm_per_s * self.period_s;
        let before = self.rows.last().map_or(sample.line, |last| last.line);
        let ends_in_mm = if turns || self.sways.turns_alone(sample.line) {
            step.to_degrees()
        } else {
            step * self.sways.most(before, sample.line)
        };
        // Before that, the period may have driven blocks of the other kind, whose feed the sample does not tell.
        let passed_deg = if before == sample.line {
            0.0
        } else {
            let time_s = self.max_ratio * self.period_s;
            self.sways.max_turned_alone_deg(before, sample.line, time_s)
        };
        self.longest_step_mm = self.longest_step_mm.max(ends_in_mm + passed_deg);
        self.rows.push(row);
        if self.rows.len() > self.most {
            resume_unwind(Box::new(TooLong));
        }
    }
}

impl Ran {
    /// Whether nothing has moved for a while at the end.
    pub fn stands_still(&self, fine_period_s: f64) -> bool {
        let still = ((STILL_S / fine_period_s) as usize).min(self.rows.len());
        let end = &self.rows[self.rows.len() - still..];
        end.windows(2)
            .all(|pair| pair[0].command == pair[1].command)
    }
}

/// Begins to count anew. Where the system does not allow it, what earlier runs took is counted too.
fn forget_most_memory() {
    let _ = std::fs::write("/proc/self/clear_refs", "5");
}

/// Most memory of this process, MB; 0 where the system does not say.
fn max_memory_mb() -> f64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    let kilobytes = line.and_then(|rest| {
        rest.trim()
            .trim_end_matches("kB")
            .trim()
            .parse::<f64>()
            .ok()
    });
    kilobytes.map_or(0.0, |kb| kb / 1024.0)
}
