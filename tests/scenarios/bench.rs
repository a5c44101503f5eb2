//! Runs in this process, through the same host and plugins as the command: thousands of disturbed runs in seconds.

use std::cell::RefCell;
use std::ffi::OsStr;
use std::path::{Path, PathBuf};

use tandem_host::{Clock, HostError, Outcome, Registry, Run, RunObserver, Switches, Timed};
use tandem_machine::Machine;
use tandem_oracle::{Options, Row, Trace, Verdict, judge};
use tandem_recorder::TraceCsv;
use tandem_rig::{Bent, CASES_VARIABLE, record_case};
use tandem_rings::{MachineState, Sample};
use tandem_sdk::{Planner, PlannerContext, PluginError, RawOptions, Segment, local_plugin};

use crate::harness::mill;

/// A program on the mill.
pub struct Bench {
    program: PathBuf,
    machine: PathBuf,
    text: String,
    pub judging: tandem_oracle::Machine,
    _folder: Option<tempfile::TempDir>,
}

/// What a run did.
pub struct Ran {
    pub samples: Vec<Sample>,
    pub outcome: Outcome,
    /// What the planner emitted.
    pub segments: Vec<Segment>,
}

impl Bench {
    /// The program of a file.
    pub fn of(program: &Path) -> Self {
        let text = std::fs::read_to_string(program).unwrap();
        let judging = tandem_oracle::Machine::read(&mill()).unwrap();
        Self {
            program: program.to_owned(),
            machine: mill(),
            text,
            judging,
            _folder: None,
        }
    }

    /// A program text.
    pub fn text(text: &str) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("program.ngc");
        std::fs::write(&path, text).unwrap();
        Self {
            _folder: Some(folder),
            ..Self::of(&path)
        }
    }

    /// On another machine, with the planner that it names.
    pub fn on(self, machine: &Path) -> Self {
        let judging = tandem_oracle::Machine::read(machine).unwrap();
        Self {
            machine: machine.to_owned(),
            judging,
            ..self
        }
    }

    /// Runs it with commands, a line each as in `--commands`, undisturbed otherwise.
    pub fn run(&self, commands: &str) -> Ran {
        self.run_with(commands, &[])
    }

    /// Runs it with further settings of the machine.
    pub fn run_with(&self, commands: &str, settings: &[(&str, &str)]) -> Ran {
        let mut settings: Vec<_> = settings
            .iter()
            .map(|(k, v)| ((*k).to_string(), (*v).to_string()))
            .collect();
        if self.machine == mill() && settings.iter().all(|(key, _)| key != "planner.plugin") {
            settings.push(("planner.plugin".to_string(), "watched".to_string()));
        }
        self.drive(&settings, commands).unwrap()
    }

    /// Runs it with commands as the machine file says, unless something refuses.
    pub fn try_commands(&self, commands: &str) -> Result<Ran, HostError> {
        self.drive(&[], commands)
    }

    /// Runs it with the built-in plugins and further settings of the machine, unless something refuses.
    pub fn try_run(&self, settings: &[(String, String)]) -> Result<Ran, HostError> {
        self.drive(settings, "")
    }

    /// The same with commands.
    pub fn try_run_with(
        &self,
        settings: &[(String, String)],
        commands: &str,
    ) -> Result<Ran, HostError> {
        self.drive(settings, commands)
    }

    fn drive(&self, settings: &[(String, String)], commands: &str) -> Result<Ran, HostError> {
        self.record(settings, commands);
        let commands: Vec<Timed> = commands
            .lines()
            .map(|line| Timed::parse(line).unwrap())
            .collect();
        let machine = Machine::read(&self.machine, settings).unwrap();
        let program = tandem_gcode::Program::open(&self.program).unwrap();
        let run = Run::prepare(machine, &registry(), program, Switches::default())?;
        let mut kept = Kept::default();
        EMITTED.take();
        let outcome = run.drive(Clock::Virtual, &commands, &mut kept)?;
        Ok(Ran {
            samples: kept.0,
            outcome,
            segments: EMITTED.take(),
        })
    }

    /// Keeps the case for the comparison of two builds, where one is asked for: as the command would run it.
    fn record(&self, settings: &[(String, String)], commands: &str) {
        if std::env::var_os(CASES_VARIABLE).is_none() {
            return;
        }
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("commands.csv");
        std::fs::write(&file, commands).unwrap();
        let files = [
            "--machine".as_ref(),
            self.machine.as_os_str(),
            "--commands".as_ref(),
            file.as_os_str(),
        ];
        let settings = settings
            .iter()
            .filter(|(_, value)| value != "watched")
            .map(|(key, value)| format!("{key}={value}"));
        let settings: Vec<String> = settings
            .flat_map(|setting| ["--set".to_string(), setting])
            .collect();
        let run = ["run".as_ref(), self.program.as_os_str()]
            .into_iter()
            .chain(files);
        record_case(run.chain(settings.iter().map(OsStr::new)), "");
    }

    /// The oracle's verdict: samples on the path to 2 nm, corners cut by no more than a chord between two samples.
    pub fn judge(&self, ran: &Ran, adjust: impl FnOnce(&mut Options)) -> Verdict {
        let fastest = ran
            .samples
            .iter()
            .fold(0.0, |most: f64, sample| most.max(sample.feed_mm_per_s));
        let mut options = Options::for_machine(&self.judging);
        options.sample_tolerance_mm = Some(2e-6);
        options.vertex_tolerance_mm = Some((fastest * self.judging.fine_period_s / 2.0).max(1e-6));
        adjust(&mut options);
        judge(&self.trace(ran), &self.text, &self.judging, &options)
    }

    /// The samples as the oracle reads them.
    fn trace(&self, ran: &Ran) -> Trace {
        let axes = self.judging.axes.iter().map(|axis| axis.index).collect();
        let rows = ran
            .samples
            .iter()
            .map(|sample| row(sample, self.judging.fine_period_s))
            .collect();
        Trace {
            axes,
            rows,
            ..Trace::default()
        }
    }
}

/// The verdict as a result.
pub fn passed(verdict: &Verdict) -> Result<(), String> {
    verdict
        .passed()
        .then_some(())
        .ok_or_else(|| verdict.to_string())
}

fn row(sample: &Sample, fine_period_s: f64) -> Row {
    let mut row = Row {
        t_s: TraceCsv::t_s(sample.tick, fine_period_s),
        line: sample.line,
        ..Row::default()
    };
    row.command[..3].copy_from_slice(&sample.command.0[..3]);
    row
}

impl Ran {
    /// Where the axes came to rest, by their names, mm and deg.
    pub fn ends(&self) -> [&std::collections::BTreeMap<String, f64>; 2] {
        [
            &self.outcome.summary.end_position_mm,
            &self.outcome.summary.end_position_deg,
        ]
    }

    /// Nothing went wrong, no count says that something nearly did, and the program is driven to its end.
    pub fn expect_clean(&self) -> Result<(), String> {
        let summary = &self.outcome.summary;
        let counts = [
            summary.limit_violations,
            summary.guard_stops,
            summary.governed_samples,
            summary.lost_samples,
        ];
        match summary.fault.as_ref().or(summary.stopped.as_ref()) {
            Some(ended_early) => Err(ended_early.clone()),
            None if counts != [0; 4] => Err(format!(
                "violations, guard stops, governed, lost: {counts:?}"
            )),
            None => self.expect_ended(),
        }
    }

    /// In a state in which a program ends.
    fn expect_ended(&self) -> Result<(), String> {
        let state = self.samples.last().map(|sample| sample.state);
        let ended = state.is_some_and(|state| {
            [MachineState::Running, MachineState::Standstill].contains(&state)
        });
        ended.then_some(()).ok_or(format!("ends {state:?}"))
    }

    /// Ended by the operator's abort: no fault, at rest, and nothing was ramped out.
    pub fn expect_aborted(&self) -> Result<(), String> {
        let ramped = self
            .samples
            .iter()
            .any(|sample| sample.state == MachineState::Stopping);
        match &self.outcome.summary {
            summary if summary.stopped.is_none() => Err("it was not stopped".to_string()),
            summary if summary.fault.is_some() || ramped => {
                Err(format!("{:?}, ramped: {ramped}", summary.fault))
            }
            _ => self.expect_rest_in(MachineState::Standstill),
        }
    }

    /// At rest in `state` at the end.
    pub fn expect_rest_in(&self, state: MachineState) -> Result<(), String> {
        let [.., before, last] = &self.samples[..] else {
            return Err("fewer than two samples".to_string());
        };
        let at_rest = before.command == last.command;
        (at_rest && last.state == state)
            .then_some(())
            .ok_or(format!("ends {:?}, at rest: {at_rest}", last.state))
    }

    /// Every change of state is one that the table of states knows.
    pub fn expect_known_changes(&self) -> Result<(), String> {
        let change = |pair: &[Sample]| (pair[0].state, pair[1].state);
        let unknown = self
            .samples
            .windows(2)
            .map(change)
            .find(|(from, to)| from != to && !may_follow(*from, *to));
        unknown.map_or(Ok(()), |(from, to)| Err(format!("{from:?} became {to:?}")))
    }
}

/// Whether `to` can follow `from` while the drives hold and nobody resets.
fn may_follow(from: MachineState, to: MachineState) -> bool {
    use MachineState::{Fault, Holding, Running, Standstill, Starved, Stopping};
    match from {
        Standstill | Running | Holding | Starved => {
            [Standstill, Running, Holding, Starved, Stopping, Fault].contains(&to)
        }
        Stopping => to == Fault,
        _ => false,
    }
}

/// Samples after which a run is one that does not end.
const MAX_SAMPLES: usize = 4_000_000;

#[derive(Default)]
struct Kept(Vec<Sample>);

impl RunObserver for Kept {
    fn sample(&mut self, sample: &Sample, _deviation_mm: f64, _signals: &[f64]) {
        assert!(self.0.len() < MAX_SAMPLES, "the run does not end");
        self.0.push(*sample);
    }
}

fn registry() -> Registry {
    let watched = local_plugin!(planner "watched" = watched);
    let boastful = local_plugin!(planner "boastful" = boastful);
    let mut registry = Registry::default();
    let smooth = local_plugin!(planner "watched-smooth" = watched_smooth);
    let nurbs = local_plugin!(planner "watched-nurbs" = watched_nurbs);
    let planners = [
        tandem_look_ahead::PLUGIN,
        tandem_block_overlap::PLUGIN,
        tandem_after_interpolation::PLUGIN,
        tandem_nurbs::PLUGIN,
        tandem_smooth::PLUGIN,
    ];
    let others = [
        tandem_sim::PLUGIN,
        tandem_corexy::PLUGIN,
        tandem_wrapped_rotary::PLUGIN,
    ];
    for plugin in planners
        .into_iter()
        .chain(others)
        .chain([watched, boastful, smooth, nurbs])
    {
        registry.register(plugin).unwrap();
    }
    registry
}

thread_local! {
    static EMITTED: RefCell<Vec<Segment>> = const { RefCell::new(vec![]) };
}

/// The look-ahead planner; what it emits is kept.
fn watched(options: &RawOptions, context: &PlannerContext) -> Result<Bent, PluginError> {
    let inner = tandem_look_ahead::PLUGIN.planner(&options.0, context)?;
    Ok(kept(inner, 1.0))
}

/// The planner inside the tolerance; what it emits is kept.
fn watched_smooth(options: &RawOptions, context: &PlannerContext) -> Result<Bent, PluginError> {
    let inner = tandem_smooth::PLUGIN.planner(&options.0, context)?;
    Ok(kept(inner, 1.0))
}

/// The planner of curves; what it emits is kept.
fn watched_nurbs(options: &RawOptions, context: &PlannerContext) -> Result<Bent, PluginError> {
    let inner = tandem_nurbs::PLUGIN.planner(&options.0, context)?;
    Ok(kept(inner, 1.0))
}

/// The same as `watched`, and it declares to leave twice the deceleration to stop with: half the depth of the ring.
fn boastful(options: &RawOptions, context: &PlannerContext) -> Result<Bent, PluginError> {
    let inner = tandem_look_ahead::PLUGIN.planner(&options.0, context)?;
    Ok(kept(inner, 2.0))
}

/// What it emits is kept, and it declares `boast` times the deceleration that it leaves to stop with.
fn kept(inner: Box<dyn Planner>, boast: f64) -> Bent {
    Bent::of(inner).emits(move |segment| {
        segment.stop_deceleration_mm_per_s2 *= boast;
        EMITTED.with_borrow_mut(|emitted| emitted.push(*segment));
    })
}
