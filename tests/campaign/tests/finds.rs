//! That the campaign finds what it is for: planners with a defect, samples that were moved, workers that die.

use std::path::Path;
use std::time::Duration;

use tandem_campaign::case::{Case, MachineText};
use tandem_campaign::minimise::minimise;
use tandem_campaign::run::{drive, registry, run};
use tandem_campaign::verdict::{Report, judge};
use tandem_campaign::worker::Worker;
use tandem_host::Registry;
use tandem_look_ahead::{LookAhead, Options};
use tandem_rig::Bent;
use tandem_sdk::{Advanced, AxisVector, PlannerContext, Plugin, PluginError, Segment};

/// Every axis accelerates 1 % too hard.
fn too_hard(options: &Options, context: &PlannerContext) -> Result<LookAhead, PluginError> {
    let mut context = *context;
    context
        .limits
        .axes
        .iter_mut()
        .for_each(|axis| axis.acceleration_mm_per_s2 *= 1.01);
    LookAhead::new(options, &context)
}

/// Everything 1 % too far in X.
fn too_far(options: &Options, context: &PlannerContext) -> Result<Bent, PluginError> {
    let bent = Bent::new(LookAhead::new(options, context)?);
    Ok(bent.emits(|segment| segment.coefficients[0].iter_mut().for_each(|c| *c *= 1.01)))
}

/// It rests at the end and never says so.
fn endless(options: &Options, context: &PlannerContext) -> Result<Bent, PluginError> {
    let bent = Bent::new(LookAhead::new(options, context)?);
    Ok(bent.advances(|duration_s, sink, advanced| {
        if advanced.done == 1 {
            let end = AxisVector::from_slice(&[40.0, 3.0]);
            sink.segment(&Segment::rest(&end, duration_s));
            *advanced = Advanced {
                duration_s,
                done: 0,
            };
        }
    }))
}

const MACHINE: &str = "format = 1
[axes.x]
travel_mm = [-10, 40]
max_feed_mm_per_min = 6000
max_acceleration_mm_per_s2 = 800
[axes.y]
travel_mm = [-10, 40]
max_feed_mm_per_min = 6000
max_acceleration_mm_per_s2 = 800
[planner]
plugin = \"look-ahead\"
[driver]
plugin = \"sim\"
[loops]
fine_period_ms = 1
rough_period_ms = 8
[motion]
path_tolerance_mm = 0.01
[guard]
mode = \"count\"
";

fn case() -> Case {
    let program = "G21 G90\nF3000\nG1 X10 Y3\nG1 X40\nM2\n".to_string();
    Case {
        program,
        machine: MachineText::parse(MACHINE),
        commands: "20,feed-override,0.5\n90,feed-override,1\n".into(),
    }
}

fn registry_with(plugin: Plugin) -> Registry {
    let mut registry = Registry::default();
    for plugin in [tandem_sim::PLUGIN, plugin] {
        registry.register(plugin).unwrap();
    }
    registry
}

fn judged(case: &Case, registry: &Registry) -> Report {
    let folder = tempfile::tempdir().unwrap();
    run(case, folder.path(), registry)
}

#[test]
fn what_keeps_everything_is_clean() {
    let report = judged(&case(), &registry());
    assert_eq!((report.kind.as_str(), report.why.as_str()), ("clean", ""));
    assert!(report.samples > 500 && !report.is_failure());
}

#[test]
fn a_limit_exceeded_by_one_percent_is_found() {
    let defective = tandem_sdk::local_plugin!(planner "look-ahead" = too_hard);
    // With nothing asked for, so that the governor has no other reason to slow down.
    let case = Case {
        commands: String::new(),
        ..case()
    };
    let report = judged(&case, &registry_with(defective));
    assert!(
        ["governed", "acceleration", "violations"].contains(&report.kind.as_str()),
        "{report:?}"
    );
}

#[test]
fn travel_beyond_the_end_is_found() {
    let defective = tandem_sdk::local_plugin!(planner "look-ahead" = too_far);
    let report = judged(&case(), &registry_with(defective));
    assert_eq!(report.kind, "travel", "{report:?}");
    assert!((report.size - 0.4).abs() < 0.01, "{report:?}");
}

#[test]
fn a_machine_that_never_arrives_is_found() {
    let defective = tandem_sdk::local_plugin!(planner "look-ahead" = endless);
    let report = judged(&case(), &registry_with(defective));
    assert_eq!(report.kind, "standstill", "{report:?}");
}

#[test]
fn one_sample_that_was_moved_is_found() {
    let (case, folder) = (case(), tempfile::tempdir().unwrap());
    let mut driven =
        drive(&case, folder.path(), &registry()).unwrap_or_else(|report| panic!("{report:?}"));
    assert_eq!(
        judge(&driven.ran, &case, &driven.judging, &driven.asked).kind,
        "clean"
    );
    let middle = driven.ran.rows.len() / 2;
    driven.ran.rows[middle].command[1] += 1e-4;
    let report = judge(&driven.ran, &case, &driven.judging, &driven.asked);
    assert!(
        ["acceleration", "speed-step", "path"].contains(&report.kind.as_str()),
        "{report:?}"
    );
    driven.ran.rows[middle].command[1] -= 1e-4;
    driven.ran.rows.truncate(middle);
    let report = judge(&driven.ran, &case, &driven.judging, &driven.asked);
    assert!(
        report.is_failure(),
        "a record that ends in the middle: {report:?}"
    );
}

#[test]
fn a_failing_case_becomes_small() {
    let defective = tandem_sdk::local_plugin!(planner "look-ahead" = too_far);
    let (registry, folder) = (registry_with(defective), tempfile::tempdir().unwrap());
    let program = "G21 G90\nF3000\nG4 P0.01\nG1 X10 Y3\nG1 X20.123 Y5\nG0 X0\nG1 X40\nG1 Y7\nM2\n"
        .to_string();
    let case = Case { program, ..case() };
    let mut again = |case: &Case| run(case, folder.path(), &registry);
    let first = again(&case);
    let (smallest, last) = minimise(&mut again, &case, &first, 400);
    assert_eq!(
        (first.kind.as_str(), last.kind.as_str()),
        ("travel", "travel")
    );
    assert!(smallest.commands.is_empty(), "{}", smallest.commands);
    assert!(
        smallest.program.lines().count() <= 3,
        "{}",
        smallest.program
    );
    assert!(
        !smallest.machine.text().contains("[axes.y]"),
        "{}",
        smallest.machine.text()
    );
}

/// A worker that is a shell script, in `folder`.
fn script(folder: &Path, name: &str, script: &str, patience_s: u64) -> Worker {
    let path = folder.join(name);
    std::fs::write(&path, format!("#!/bin/sh\n{script}\n")).unwrap();
    let mut mode = std::fs::metadata(&path).unwrap().permissions();
    std::os::unix::fs::PermissionsExt::set_mode(&mut mode, 0o755);
    std::fs::set_permissions(&path, mode).unwrap();
    Worker::new(&path, &folder.join("work"), Duration::from_secs(patience_s))
}

#[test]
fn a_worker_that_dies_or_hangs_is_one_failed_run_and_what_it_keeps_of_others_is_none() {
    let folder = tempfile::tempdir().unwrap();
    let worker = |name: &str, words: &str, patience_s: u64| {
        let words = format!("read line\n{words}");
        script(folder.path(), name, &words, patience_s).run(&case())
    };
    assert_eq!(worker("dies", "kill -ABRT $$", 60).kind, "abort");
    assert_eq!(
        worker(
            "asks",
            "echo 'memory allocation of 9 bytes failed' >&2; kill -ABRT $$",
            60
        )
        .kind,
        "memory"
    );
    assert_eq!(worker("sleeps", "exec sleep 600", 1).kind, "hang");
    assert_eq!(worker("turns", "while :; do :; done", 1).kind, "hang");
    let answer = |kind: &str, memory_mb: u32| {
        format!("read line; printf 'x\\t{kind}\\t0\\t9\\t{memory_mb}\\t\\n'")
    };
    let (clean, memory) = (answer("clean", 148), answer("memory", 203));
    let words = format!("{clean}; {memory}; read line");
    let mut keeps = script(folder.path(), "keeps", &words, 60);
    for _ in 0..3 {
        let report = keeps.run(&case());
        assert_eq!((report.kind.as_str(), report.memory_mb), ("clean", 148.0));
    }
    let words = format!("{memory}; {memory}; read line");
    let mut takes = script(folder.path(), "takes", &words, 60);
    for _ in 0..2 {
        assert_eq!(takes.run(&case()).kind, "memory");
    }
    let real = Path::new(env!("CARGO_BIN_EXE_tandem-campaign"));
    let report =
        Worker::new(real, &folder.path().join("work"), Duration::from_mins(2)).run(&case());
    assert_eq!(report.kind, "clean", "{report:?}");
}
