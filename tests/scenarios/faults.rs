//! Faults on purpose: what is lost, late or wrong between host and drives ends in a controlled stop, or does no harm.

use std::collections::BTreeSet;
use std::path::Path;

use tandem_oracle::{Trace, judge};

use crate::harness::{Done, Scenario, root};

const PERIOD_S: f64 = 1e-3;

/// A run of an example with the entries of `faults.wrap`, as inline tables, and further settings.
fn faulty(program: &str, wrap: &str, settings: &[&str]) -> Done {
    let mut arguments = vec![String::from("--set"), format!("faults.wrap=[{wrap}]")];
    arguments.extend(
        settings
            .iter()
            .flat_map(|setting| ["--set".to_string(), (*setting).to_string()]),
    );
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    Scenario::of(&root().join("examples/programs").join(program))
        .with(&arguments)
        .run()
}

fn free(program: &str) -> Done {
    Scenario::of(&root().join("examples/programs").join(program)).run()
}

/// The command columns as they stand in the trace, byte for byte.
fn commands(done: &Done) -> Vec<Vec<String>> {
    [
        "t_s",
        "line",
        "x_cmd_mm",
        "y_cmd_mm",
        "z_cmd_mm",
        "feed_mm_s",
    ]
    .map(|name| done.cells(name))
    .into()
}

/// The tick that the fault names.
fn fault_tick(done: &Done) -> u64 {
    let errors = done.errors();
    let tick = errors
        .split("tick ")
        .nth(1)
        .and_then(|rest| rest.split(',').next());
    tick.and_then(|tick| tick.parse().ok())
        .unwrap_or_else(|| panic!("no tick in {errors}"))
}

/// Exit status 3, the driver and `words` named, at rest in the state `fault`, limits kept to the standstill, and on the
/// path up to the fault. Gives the tick.
fn assert_stopped(done: &Done, words: &str) -> u64 {
    let errors = done.errors();
    assert_eq!(done.status(), 3, "{errors}");
    assert!(
        errors.contains("fault: driver sim: ") && errors.contains(words),
        "{words:?} is not in {errors}"
    );
    let tick = fault_tick(done);
    let verdict = done.judge(|options| {
        options.ends_early = true;
        options.sample_tolerance_mm = Some(2e-6);
        options.path_until_s = Some(tick as f64 * PERIOD_S);
    });
    assert!(verdict.passed(), "fault at {tick}: {verdict}");
    assert_eq!(
        done.cells("state").last().unwrap(),
        "fault",
        "fault at {tick}"
    );
    for name in ["x_cmd_mm", "y_cmd_mm", "z_cmd_mm"] {
        let command = done.column(name);
        let [.., before, last] = command[..] else {
            continue;
        };
        assert!(
            before == last || command.len() <= 2,
            "fault at {tick}: {name} still moves"
        );
    }
    tick
}

/// Ticks of a run of `samples` samples: the first and last ones, and every `step`-th between.
fn ticks(samples: usize, step: usize) -> BTreeSet<usize> {
    (1..4)
        .chain((4..samples).step_by(step))
        .chain(samples - 3..samples)
        .collect()
}

#[test]
fn a_failing_exchange_stops_within_limits_at_whatever_tick() {
    for (program, step) in [("square.ngc", 23), ("serpentine.ngc", 131)] {
        let samples = free(program).column("t_s").len();
        for tick in ticks(samples, step) {
            let done = faulty(
                program,
                &format!("{{kind = \"fail\", from_tick = {tick}}}"),
                &[],
            );
            assert_eq!(assert_stopped(&done, "the exchange failed"), tick as u64);
        }
    }
}

#[test]
fn every_nth_exchange_fails_and_the_first_failure_counts() {
    for (every, calls) in [(1, 1), (7, 7), (50, 50), (333, 333)] {
        let done = faulty(
            "square.ngc",
            &format!("{{kind = \"fail\", every = {every}}}"),
            &[],
        );
        let at_call = faulty(
            "square.ngc",
            &format!("{{kind = \"fail\", at_call = {calls}}}"),
            &[],
        );
        assert!(assert_stopped(&done, "the exchange failed") < every);
        assert_eq!(commands(&done), commands(&at_call), "every {every}");
    }
}

#[test]
fn the_check_of_a_fault_can_fail() {
    let done = faulty("square.ngc", "{kind = \"fail\", from_tick = 500}", &[]);
    let tick = assert_stopped(&done, "the exchange failed");
    let passes = |change: &dyn Fn(&mut Trace)| {
        let machine = tandem_oracle::Machine::read(&crate::harness::mill()).unwrap();
        let mut trace = Trace::read(&done.file("trace.csv")).unwrap();
        change(&mut trace);
        let mut options = tandem_oracle::Options::for_machine(&machine);
        options.ends_early = true;
        options.sample_tolerance_mm = Some(2e-6);
        options.path_until_s = Some(tick as f64 * PERIOD_S);
        let program = std::fs::read_to_string(root().join("examples/programs/square.ngc")).unwrap();
        judge(&trace, &program, &machine, &options).passed()
    };
    assert!(passes(&|_| ()));
    assert!(
        !passes(&|trace| trace.rows[400].command[0] += 1e-3),
        "off the path before the fault"
    );
    assert!(
        !passes(&|trace| trace.rows.last_mut().unwrap().command[0] += 0.1),
        "a jump after it"
    );
}

#[test]
fn what_is_lost_repeated_or_late_does_not_disturb_the_commands() {
    for program in ["square.ngc", "serpentine.ngc"] {
        let free = free(program);
        let expected = commands(&free);
        assert!(
            free.cells("x_fb_mm") == free.cells("x_cmd_mm"),
            "ideal drives are where they are told to be"
        );
        for fault in [
            "{kind = \"drop\", every = 50, periods = 5}",
            "{kind = \"drop\", probability = 0.02, from_tick = 100, until_tick = 900}",
            "{kind = \"duplicate\", every = 13, periods = 2}",
            "{kind = \"delay\", periods = 5, from_tick = 100, until_tick = 400}",
            "{kind = \"freeze\", every = 100, periods = 40, joint = 0}",
            "{kind = \"corrupt\", probability = 0.5, magnitude_mm = 0.5}",
        ] {
            let done = faulty(program, fault, &["faults.seed=7"]);
            assert_eq!(done.status(), 0, "{fault}: {}", done.errors());
            done.assert_within_limits();
            assert!(commands(&done) == expected, "{program}, {fault}");
            assert!(
                done.cells("x_fb_mm") != done.cells("x_cmd_mm"),
                "{fault} did nothing"
            );
        }
    }
}

#[test]
fn drives_that_hear_nothing_for_too_long_stop_by_themselves() {
    for (fault, first) in [
        ("{kind = \"drop\", from_tick = 300, until_tick = 306}", 306),
        (
            "{kind = \"duplicate\", from_tick = 300, until_tick = 310}",
            305,
        ),
        ("{kind = \"delay\", periods = 6, from_tick = 300}", 305),
    ] {
        let done = faulty("square.ngc", fault, &[]);
        assert_eq!(
            assert_stopped(&done, "axis X reports fault 1"),
            first,
            "{fault}"
        );
        let patient = faulty("square.ngc", fault, &["driver.options.watchdog_periods=20"]);
        assert_eq!(patient.status(), 0, "{fault}: {}", patient.errors());
    }
}

#[test]
fn the_feedback_shows_the_ramp_of_drives_whose_host_is_silent() {
    // The drives get no new setpoint, the host still hears them, and takes no notice but for the fault itself.
    let settings = ["driver.options.quick_stop_deceleration_mm_per_s2=1000"];
    let done = faulty(
        "square.ngc",
        "{kind = \"duplicate\", from_tick = 200}",
        &settings,
    );
    let tick = assert_stopped(&done, "reports fault 1") as usize;
    let x = done.column("x_fb_mm");
    let speed: Vec<f64> = x
        .windows(2)
        .map(|pair| (pair[1] - pair[0]) / PERIOD_S)
        .collect();
    for index in tick..x.len() - 2 {
        let slower = speed[index - 1] - speed[index];
        assert!(
            speed[index] < 1.0 || (slower - 1.0).abs() < 1e-6,
            "period {index} slows by {slower} mm/s"
        );
    }
    assert!(speed[tick - 2] > 50.0, "it moved");
}

#[test]
fn feedback_that_is_no_number_is_a_fault_of_the_driver() {
    for (value, joint, axis) in [("nan", 0, 'X'), ("inf", 2, 'Z')] {
        for tick in [1, 250, 700] {
            let wrap = format!(
                "{{kind = \"corrupt\", value = \"{value}\", joint = {joint}, from_tick = {tick}}}"
            );
            let done = faulty("square.ngc", &wrap, &[]);
            let words = format!("the feedback of axis {axis} is not a finite number");
            assert_eq!(assert_stopped(&done, &words), tick);
        }
    }
}

fn seed() -> u64 {
    std::env::var("TANDEM_SEED").map_or(7, |seed| seed.parse().unwrap())
}

#[test]
fn the_same_seed_gives_the_same_trace() {
    let wrap = "{kind = \"drop\", probability = 0.05}, {kind = \"corrupt\", probability = 0.1, magnitude_mm = 0.25}, \
                {kind = \"fail\", probability = 0.0005}";
    let settings = ["driver.options.model=second-order"];
    let trace = |seed: u64| {
        println!("seed {seed}");
        let seed = format!("faults.seed={seed}");
        let done = faulty("serpentine.ngc", wrap, &[settings[0], &seed]);
        if done.status() != 0 {
            assert_stopped(&done, "the exchange failed");
        }
        std::fs::read(done.file("trace.csv")).unwrap()
    };
    let mut traces = BTreeSet::new();
    for seed in seed()..seed() + 5 {
        let first = trace(seed);
        assert!(first == trace(seed), "seed {seed}");
        traces.insert(first);
    }
    assert_eq!(traces.len(), 5, "another seed, another trace");
}

#[test]
fn nonsense_in_a_machine_file_is_refused_at_its_place() {
    let mill = std::fs::read_to_string(crate::harness::mill()).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("mill.toml");
    let lines = mill.lines().count();
    let refused = |faults: &str| {
        std::fs::write(&path, format!("{mill}\n[faults]\n{faults}")).unwrap();
        let done = run_on(&path);
        assert_eq!(done.status(), 1);
        assert!(!done.file("trace.csv").exists());
        done.errors()
    };
    for (faults, line, words) in [
        (
            "sed = 7\n",
            3,
            "1: faults.sed: unknown key `sed`; did you mean `seed`?",
        ),
        (
            "[[faults.wrap]]\nkind = \"frieze\"\n",
            4,
            "1: faults.wrap[0].kind: unknown kind `frieze`; did you mean `freeze`?",
        ),
        (
            "[[faults.wrap]]\nkind = \"fail\"\nat_call = 3\n[[faults.wrap]]\nkind = \"drop\"\nevry = 3\n",
            8,
            "1: faults.wrap[1].evry:",
        ),
        (
            "[[faults.wrap]]\nkind = \"drop\"\nevery = 3\nat_call = 9\n",
            6,
            "1: faults.wrap[0].at_call: contradicts every",
        ),
        (
            "[[faults.wrap]]\nkind = \"freeze\"\nevery = 3\njoint = 3\n",
            6,
            "1: faults.wrap[0].joint: the machine has joints 0 to 2",
        ),
    ] {
        let errors = refused(faults);
        let place = format!("mill.toml:{}:{words}", lines + line);
        assert!(errors.contains(&place), "{place} is not in {errors}");
    }
}

fn run_on(machine: &Path) -> Done {
    Scenario::of(&root().join("examples/programs/square.ngc"))
        .on(machine)
        .run()
}
