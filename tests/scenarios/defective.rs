//! Planners with a defect: the guard stops them, and the oracle sees them without the guard.

use std::path::{Path, PathBuf};

use tandem_host::{Clock, Outcome, Registry, Run, RunObserver};
use tandem_look_ahead::{LookAhead, Options};
use tandem_machine::Machine;
use tandem_oracle::Kind;
use tandem_recorder::TraceCsv;
use tandem_rig::Bent;
use tandem_rings::Sample;
use tandem_sdk::{PlannerContext, Plugin, PluginError};

use crate::harness::{judge_trace, mill};

/// The look-ahead planner with one of the machine's numbers 1 % too high.
macro_rules! optimist {
    ($name:ident, $change:expr) => {
        fn $name(options: &Options, context: &PlannerContext) -> Result<LookAhead, PluginError> {
            let mut context = *context;
            let change: fn(&mut PlannerContext) = $change;
            change(&mut context);
            LookAhead::new(options, &context)
        }
    };
}

optimist!(too_fast, |context| context.limits.axes.iter_mut().for_each(
    |axis| {
        axis.feed_mm_per_s *= 1.01;
        axis.rapid_mm_per_s *= 1.01;
    }
));
optimist!(too_hard, |context| context
    .limits
    .axes
    .iter_mut()
    .for_each(|axis| axis.acceleration_mm_per_s2 *= 1.011));
/// 1 % faster than programmed, and it says that the feed was higher.
fn too_keen(options: &Options, context: &PlannerContext) -> Result<Bent, PluginError> {
    let mut keen = *context;
    keen.max_feed_ratio = 1.01;
    let bent = declared(LookAhead::new(options, &keen)?, context);
    Ok(bent.emits(|segment| segment.feed_mm_per_s *= 1.01))
}

/// Steps where blocks meet twice as large as allowed, not declared.
fn too_abrupt(options: &Options, context: &PlannerContext) -> Result<Bent, PluginError> {
    let mut rough = *context;
    rough
        .limits
        .axes
        .iter_mut()
        .for_each(|axis| axis.speed_difference_mm_per_s *= 4.0);
    Ok(declared(LookAhead::new(options, &rough)?, context))
}

/// Off the path by a hundredth of a millimetre in Z, everywhere between the ends.
fn off_the_path(options: &Options, context: &PlannerContext) -> Result<Bent, PluginError> {
    let bent = declared(LookAhead::new(options, context)?, context);
    Ok(bent.emits(|segment| {
        let at = segment.coefficients[0][0] / 40.0;
        segment.coefficients[2][0] += 1e-3 * (std::f64::consts::PI * at.clamp(0.0, 1.0)).sin();
    }))
}

/// Everything 1 % too far in X.
fn too_far(options: &Options, context: &PlannerContext) -> Result<Bent, PluginError> {
    let bent = declared(LookAhead::new(options, context)?, context);
    Ok(bent.emits(|segment| segment.coefficients[0].iter_mut().for_each(|c| *c *= 1.01)))
}

/// Says that its steps of speed are those that the machine of `context` allows.
fn declared(inner: LookAhead, context: &PlannerContext) -> Bent {
    let allowed = context.limits.axes.map(|a| a.speed_difference_mm_per_s);
    Bent::new(inner).describes(move |description| description.speed_difference_mm_per_s = allowed)
}

struct Tracing(TraceCsv);

impl RunObserver for Tracing {
    fn sample(&mut self, sample: &Sample, _deviation_mm: f64, signals: &[f64]) {
        self.0.sample(sample, signals).unwrap();
    }
}

/// The plugin `defective` that a constructor makes.
macro_rules! defective {
    ($open:ident) => {
        tandem_sdk::local_plugin!(planner "defective" = $open)
    };
}

struct Ran {
    outcome: Outcome,
    folder: tempfile::TempDir,
    machine: PathBuf,
}

impl Ran {
    fn at(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }
}

fn run(plugin: Plugin, text: &str, guard: &str) -> Ran {
    let folder = tempfile::tempdir().unwrap();
    let (program, trace) = (folder.path().join("p.ngc"), folder.path().join("trace.csv"));
    std::fs::write(&program, text).unwrap();
    let machine_path = mill();
    let overrides = [("guard.mode", guard), ("planner.plugin", "defective")]
        .map(|(k, v)| (k.to_string(), v.to_string()));
    let machine = Machine::read(&machine_path, &overrides).unwrap();
    let mut registry = Registry::default();
    registry.register(tandem_sim::PLUGIN).unwrap();
    registry.register(plugin).unwrap();
    let run = Run::prepare(
        machine.clone(),
        &registry,
        tandem_gcode::Program::open(&program).unwrap(),
        tandem_host::Switches::default(),
    )
    .unwrap();
    let mut tracing = Tracing(TraceCsv::create(&trace, &machine, &[]).unwrap());
    let outcome = run.drive(Clock::Virtual, &[], &mut tracing).unwrap();
    tracing.0.finish().unwrap();
    Ran {
        outcome,
        folder,
        machine: machine_path,
    }
}

fn kinds(ran: &Ran, ends_early: bool) -> Vec<Kind> {
    let verdict = judge_trace(
        &ran.at("trace.csv"),
        &ran.at("p.ngc"),
        Path::new(&ran.machine),
        |options| {
            options.ends_early = ends_early;
            options.sample_tolerance_mm = Some(if ends_early { 1e3 } else { 2e-6 });
            options.vertex_tolerance_mm = Some(1e3);
        },
    );
    assert!(verdict.not_judged.is_none(), "{verdict}");
    verdict.kinds()
}

const RAPID: &str = "G21 G90\nG0 X200\nG0 X-200\nM2\n";
const CORNER: &str = "G21 G90\nF6000\nG1 X20\nG1 Y20\nG1 X0\nM2\n";
const LINE: &str = "G21 G90\nF3000\nG1 X40\nM2\n";

#[test]
fn the_guard_stops_what_exceeds_a_limit_and_ramps_out_within_limits() {
    for (plugin, text, word) in [
        (defective!(too_abrupt), CORNER, "acceleration"),
        (defective!(too_abrupt), RAPID, ""),
    ] {
        let ran = run(plugin, text, "stop");
        if word.is_empty() {
            assert_eq!(ran.outcome.summary.fault, None, "nothing steps here");
            continue;
        }
        let fault = ran.outcome.summary.fault.clone().unwrap();
        assert!(
            fault.contains(word) && fault.contains("defective") && fault.contains("axis"),
            "{fault}"
        );
        assert_eq!(ran.outcome.summary.guard_stops, 1);
        assert_eq!(
            kinds(&ran, true),
            [],
            "what was sent, to standstill, is within limits"
        );
    }
}

#[test]
fn the_governor_slows_what_exceeds_a_limit_and_counts_it() {
    for plugin in [defective!(too_fast), defective!(too_hard)] {
        let ran = run(plugin, RAPID, "stop");
        assert!(ran.outcome.summary.governed_samples > 0 || ran.outcome.summary.guard_stops > 0);
        assert_eq!(
            kinds(&ran, ran.outcome.fault.is_some()),
            [],
            "what was sent is within limits"
        );
    }
}

#[test]
fn the_oracle_sees_a_feed_one_percent_too_high() {
    let ran = run(defective!(too_keen), LINE, "count");
    assert_eq!(kinds(&ran, false), [Kind::Feed]);
}

#[test]
fn the_oracle_sees_an_axis_one_percent_too_fast_or_accelerating_too_hard() {
    assert_eq!(
        kinds(&run(defective!(too_fast), RAPID, "count"), false),
        [Kind::Velocity, Kind::Feed]
    );
    assert_eq!(
        kinds(&run(defective!(too_hard), RAPID, "count"), false),
        [Kind::SpeedStep]
    );
}

#[test]
fn the_oracle_sees_a_travel_one_percent_too_far() {
    let text = "G21 G90\nF6000\nG1 X249\nG1 X0\nM2\n";
    let found = kinds(&run(defective!(too_far), text, "count"), false);
    assert!(
        found.contains(&Kind::Travel) && found.contains(&Kind::PathDeviation),
        "{found:?}"
    );
    let ran = run(defective!(too_far), text, "stop");
    assert!(
        ran.outcome
            .summary
            .fault
            .as_ref()
            .is_some_and(|f| f.contains("travel")),
        "{:?}",
        ran.outcome.summary.fault
    );
}

#[test]
fn the_oracle_sees_a_planner_off_the_path() {
    let ran = run(defective!(off_the_path), LINE, "count");
    assert!(
        kinds(&ran, false).contains(&Kind::PathDeviation),
        "{:?}",
        kinds(&ran, false)
    );
}

#[test]
fn the_oracle_sees_steps_that_are_too_large() {
    let ran = run(defective!(too_abrupt), CORNER, "count");
    assert!(ran.outcome.summary.limit_violations > 0);
    assert_eq!(kinds(&ran, false), [Kind::SpeedStep]);
}
