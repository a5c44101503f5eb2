//! Plugins that misbehave on purpose: the host lives on, the fault names them, and no sample leaves the limits.

use std::path::{Path, PathBuf};
use std::process::Command;

use tandem_host::HostError;

use crate::bench::{Bench, Ran};
use crate::harness::{Done, Scenario, mill, root};
use crate::plugins::built::third_party;

const PROGRAM: &str = "G21 G90\nF3000\nG1 X40 Y10\nG1 X0 Y20\nG4 P0.1\nG1 X10 Y0\nM2\n";

/// What a hostile plugin is told.
struct Mischief {
    section: &'static str,
    misbehave: &'static str,
    method: &'static str,
    call: u32,
}

impl Mischief {
    fn of(section: &'static str, misbehave: &'static str, method: &'static str, call: u32) -> Self {
        Self {
            section,
            misbehave,
            method,
            call,
        }
    }

    fn settings(&self, library: &Path) -> Vec<(String, String)> {
        let key = |key: &str| format!("{}.{key}", self.section);
        vec![
            (key("plugin"), library.display().to_string()),
            (key("options.misbehave"), self.misbehave.to_string()),
            (key("options.method"), self.method.to_string()),
            (key("options.call"), self.call.to_string()),
            (
                key("options.curved"),
                (self.section == "kinematics").to_string(),
            ),
        ]
    }

    /// Runs the program. Where it begins, everything that is sent is within limits, to standstill.
    fn run(&self) -> Result<Ran, HostError> {
        let (settings, bench) = self.bench();
        let ran = bench.try_run(&settings)?;
        let verdict = bench.judge(&ran, |options| {
            options.ends_early = true;
            options.sample_tolerance_mm = Some(1e3);
            options.vertex_tolerance_mm = Some(1e3);
        });
        assert!(verdict.passed(), "{self}: {verdict}");
        Ok(ran)
    }

    /// A kinematics runs on a machine that states its joints, and moves them along a curve. The oracle judges the axes.
    fn bench(&self) -> (Vec<(String, String)>, Bench) {
        let (mut settings, bench) = (self.settings(&third_party("hostile")), Bench::text(PROGRAM));
        if self.section != "kinematics" {
            return (settings, bench);
        }
        settings.push((
            "joints.a.max_acceleration_mm_per_s2".to_string(),
            "5000".to_string(),
        ));
        let mut bench = bench.on(&root().join("examples/machines/corexy.toml"));
        bench.judging.joints = tandem_oracle::Machine::read(&mill()).unwrap().joints;
        (settings, bench)
    }

    /// What the run, or its refusal, says.
    fn words(&self) -> String {
        match self.run() {
            Err(HostError::Check(report)) => report
                .diagnostics
                .iter()
                .map(|found| found.message.as_str())
                .collect(),
            Err(refusal) => refusal.to_string(),
            Ok(ran) => ran.outcome.summary.fault.unwrap_or_default(),
        }
    }
}

impl std::fmt::Display for Mischief {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(
            f,
            "{}: {} in call {} of {}",
            self.section, self.misbehave, self.call, self.method
        )
    }
}

/// All methods of all kinds that are called in a run and whose panic ends it, with the calls that are tried.
const METHODS: &[(&str, &str, &[u32])] = &[
    ("planner", "new", &[1]),
    ("planner", "describe", &[1]),
    ("planner", "check", &[1, 2, 4]),
    ("planner", "accept", &[1, 2, 3, 5]),
    ("planner", "finish", &[1]),
    ("planner", "advance", &[1, 2, 3, 4]),
    ("feed_strategy", "new", &[1]),
    ("feed_strategy", "signals", &[1]),
    ("feed_strategy", "max_ratio_change_per_s", &[1]),
    ("feed_strategy", "takes_override", &[1]),
    ("feed_strategy", "update", &[1, 2, 50]),
    ("driver", "new", &[1]),
    ("driver", "describe", &[1]),
    ("driver", "open", &[1]),
    ("driver", "start", &[1]),
    ("driver", "exchange", &[1, 2, 100, 700]),
    ("kinematics", "new", &[1]),
    ("kinematics", "joint_count", &[1]),
    ("kinematics", "health", &[1]),
    ("kinematics", "to_joints", &[1, 40, 75, 400, 1001, 2000]),
    ("kinematics", "to_axes", &[1, 40, 75, 400, 1001]),
];

#[test]
fn it_behaves_where_it_is_told_nothing() {
    for section in ["planner", "feed_strategy", "driver", "kinematics"] {
        let ran = Mischief::of(section, "never", "", 1).run().unwrap();
        assert_eq!(ran.outcome.summary.fault, None, "{section}");
    }
}

#[test]
fn a_panic_in_any_call_of_any_method_ends_in_a_fault_that_names_it() {
    for (section, method, calls) in METHODS {
        for call in *calls {
            for misbehave in ["panic", "panic-twice"] {
                let mischief = Mischief::of(section, misbehave, method, *call);
                let words = mischief.words();
                let method = if *method == "new" {
                    "its constructor"
                } else {
                    method
                };
                assert!(words.contains("hostile"), "{mischief}: {words:?}");
                assert!(
                    words.contains(&format!("panicked in {method}")),
                    "{mischief}: {words:?}"
                );
            }
        }
    }
}

/// Methods that are called where no fault can come of it any more, or only after a stop: through the command.
fn command(mischief: &Mischief, program: &str, commands: &str, more: &[&str]) -> Done {
    let settings = mischief.settings(&third_party("hostile"));
    let settings: Vec<String> = settings
        .iter()
        .filter(|(key, _)| !key.ends_with("curved"))
        .map(|(k, v)| format!("{k}={v}"))
        .collect();
    let arguments: Vec<&str> = settings
        .iter()
        .flat_map(|setting| ["--set", setting])
        .collect();
    Scenario::text(program)
        .with(&arguments)
        .with(more)
        .commands(commands)
        .run()
}

fn assert_within_limits_to_rest(done: &Done, mischief: &Mischief) {
    let verdict = done.judge(|options| {
        options.ends_early = true;
        options.sample_tolerance_mm = Some(1e3);
        options.vertex_tolerance_mm = Some(1e3);
    });
    assert!(verdict.passed(), "{mischief}: {verdict}");
}

#[test]
fn a_panic_in_quick_stop_is_told_beside_the_fault() {
    let mischief = Mischief::of("driver", "panic", "quick_stop", 1);
    let done = command(&mischief, PROGRAM, "300,emergency-stop\n", &[]);
    assert_eq!(done.status(), 3, "{}", done.errors());
    assert!(
        done.summary()["fault"]
            .as_str()
            .unwrap()
            .contains("emergency stop"),
        "{}",
        done.summary()["fault"]
    );
    assert!(
        done.errors().contains("hostile panicked in quick_stop"),
        "{}",
        done.errors()
    );
    assert_within_limits_to_rest(&done, &mischief);
}

/// A run that is good so far has not ended well where the drives are not let go of.
#[test]
fn drives_that_are_not_let_go_of_are_a_fault() {
    for (misbehave, words) in [
        ("panic", "hostile panicked in stop"),
        ("fail", "it fails as it was told"),
    ] {
        let mischief = Mischief::of("driver", misbehave, "stop", 1);
        let done = command(&mischief, PROGRAM, "", &[]);
        assert_eq!(done.status(), 3, "{mischief}: {}", done.errors());
        let fault = done.summary()["fault"].as_str().unwrap().to_string();
        assert!(
            fault.contains("not let go of") && fault.contains(words),
            "{mischief}: {fault}"
        );
        assert_within_limits_to_rest(&done, &mischief);
        let done = command(&mischief, PROGRAM, "300,emergency-stop\n", &[]);
        assert!(
            done.summary()["fault"]
                .as_str()
                .unwrap()
                .contains("emergency stop"),
            "{}",
            done.summary()["fault"]
        );
        assert!(
            done.errors().contains(words),
            "{mischief}: {}",
            done.errors()
        );
    }
}

#[test]
fn a_panic_behind_the_end_is_told() {
    for (section, method) in [
        ("driver", "drop"),
        ("planner", "drop"),
        ("feed_strategy", "drop"),
        ("kinematics", "drop"),
    ] {
        let mischief = Mischief::of(section, "panic", method, 1);
        let identity = ["--set", "joints={x={axis='x'},y={axis='y'},z={axis='z'}}"];
        let done = command(
            &mischief,
            PROGRAM,
            "",
            if section == "kinematics" {
                &identity
            } else {
                &[]
            },
        );
        assert_eq!(done.status(), 0, "{mischief}: {}", done.errors());
        assert!(
            done.errors()
                .contains(&format!("hostile panicked in {method}")),
            "{mischief}: {}",
            done.errors()
        );
        assert_within_limits_to_rest(&done, &mischief);
    }
}

#[test]
fn a_panic_in_a_thread_of_a_plugin_is_told() {
    let mischief = Mischief::of("driver", "panic", "thread", 1);
    let done = command(&mischief, PROGRAM, "", &[]);
    assert_eq!(done.status(), 0, "{}", done.errors());
    let words = "error: a thread of a plugin panicked (hostile/src/mischief.rs:";
    assert!(
        done.errors().contains(words) && done.errors().contains("as it was told"),
        "{}",
        done.errors()
    );
}

/// Nothing is driven, and what plugins say is told all the same.
#[test]
fn a_panic_before_a_refusal_is_told() {
    let mischief = Mischief::of("driver", "panic", "drop", 1);
    let done = command(
        &mischief,
        PROGRAM,
        "",
        &["--set", "feed_strategy.plugin=none"],
    );
    assert_eq!(done.status(), 1, "{}", done.errors());
    for words in ["no feed strategy is called", "hostile panicked in drop"] {
        assert!(done.errors().contains(words), "{words}: {}", done.errors());
    }
}

/// A probe that touches nothing ends at rest, and the planner begins again from there.
#[test]
fn a_panic_in_reset_is_a_fault() {
    let program = "G21 G90\nF3000\nG38.3 Z-10 F1500\nG1 X20\nM2\n";
    for misbehave in ["never", "panic", "panic-twice"] {
        // The first call is where the joints are enabled, the second behind the probe.
        let mischief = Mischief::of("planner", misbehave, "reset", 2);
        let done = command(&mischief, program, "", &["--set", "probe.input=3"]);
        let expected = if misbehave == "never" { 0 } else { 3 };
        assert_eq!(done.status(), expected, "{mischief}: {}", done.errors());
        let named = done.errors().contains("hostile panicked in reset");
        assert_eq!(named, misbehave != "never", "{mischief}: {}", done.errors());
        assert!(
            !done.errors().contains("thread '"),
            "the panic itself prints nothing: {}",
            done.errors()
        );
        assert_within_limits_to_rest(&done, &mischief);
    }
}

#[test]
fn numbers_that_are_none_or_far_beyond_end_in_a_fault_that_names_it() {
    for (section, method, calls, words) in [
        (
            "planner",
            "advance",
            [1, 2, 3],
            "advance emits a segment with a number that is not finite",
        ),
        ("feed_strategy", "update", [1, 2, 30], "update answers"),
        ("driver", "exchange", [1, 20, 500], "the feedback of axis"),
    ] {
        for call in calls {
            let mischief = Mischief::of(section, "not-a-number", method, call);
            let said = mischief.words();
            assert!(
                said.contains(words) && said.contains("hostile"),
                "{mischief}: {said:?}"
            );
        }
    }
    for call in [1, 2, 3] {
        let ran = Mischief::of("planner", "beyond", "advance", call)
            .run()
            .unwrap();
        let fault = ran.outcome.summary.fault.unwrap();
        assert!(
            fault.contains("hostile") && fault.contains("guard"),
            "{fault}"
        );
    }
    for (method, words) in [
        ("to_joints", "the position of joint 0 (a) is"),
        ("to_axes", "the position of axis X is"),
    ] {
        for call in [400, 1001] {
            let mischief = Mischief::of("kinematics", "not-a-number", method, call);
            let said = mischief.words();
            assert!(
                said.contains(&format!("kinematics {}", third_party("hostile").display())),
                "{mischief}: {said:?}"
            );
            assert!(said.contains(words), "{mischief}: {said:?}");
        }
    }
    for call in [400, 1001] {
        let said = Mischief::of("kinematics", "beyond", "to_joints", call).words();
        assert!(
            said.starts_with("guard: kinematics")
                && said.contains("asks for joint a position 1000000"),
            "{said}"
        );
    }
    // A ratio of a million is a wish: what is driven is the programmed feed.
    assert_eq!(
        Mischief::of("feed_strategy", "beyond", "update", 5).words(),
        ""
    );
}

#[test]
fn a_number_that_stands_for_no_state_of_a_drive_ends_in_a_fault_that_names_it() {
    for call in [1, 20, 500] {
        let words = Mischief::of("driver", "foreign", "exchange", call).words();
        let said =
            "its exchange gives 250 as the state of axis Z: 0 (disabled) to 6 (lost) are known";
        assert!(
            words.contains("hostile") && words.contains(said),
            "{call}: {words:?}"
        );
    }
}

#[test]
fn output_without_end_ends() {
    for call in [1, 2] {
        let words = Mischief::of("planner", "endless", "advance", call).words();
        assert!(
            words.contains("hostile") && words.contains("emits without end"),
            "{words}"
        );
    }
    for (method, words) in [
        ("advance", "gets on"),
        ("accept", "it is full, and advance emits nothing"),
    ] {
        for call in [1, 2] {
            let mischief = Mischief::of("planner", "dawdle", method, call);
            let said = mischief.words();
            assert!(
                said.contains("hostile") && said.contains(words),
                "{mischief}: {said:?}"
            );
        }
    }
}

#[test]
fn the_wrong_order_and_failures_are_faults() {
    let words = Mischief::of("planner", "order", "advance", 2).words();
    assert!(
        words.contains("hostile") && words.contains("a report of a block that it was not given"),
        "{words}"
    );
    for (section, method) in [
        ("planner", "advance"),
        ("feed_strategy", "update"),
        ("driver", "exchange"),
    ] {
        let words = Mischief::of(section, "fail", method, 3).words();
        assert!(
            words.contains("hostile") && words.contains("it fails as it was told"),
            "{section}: {words}"
        );
    }
}

fn check(mischief: &Mischief, programs: &str) -> (Option<i32>, String) {
    let library: PathBuf = third_party("hostile");
    let settings = mischief.settings(&library);
    let options = settings
        .iter()
        .filter_map(|(key, value)| Some((key.split_once(".options.")?.1, value)));
    let options: Vec<String> = options
        .flat_map(|(key, value)| ["--set".into(), format!("{key}={value}")])
        .collect();
    let output = Command::new(env!("CARGO_BIN_EXE_tandem"))
        .args(["plugin", "check", "--programs", programs])
        .arg(&library)
        .args(options)
        .output()
        .unwrap();
    (
        output.status.code(),
        String::from_utf8_lossy(&output.stdout).into_owned(),
    )
}

/// What is done in the first calls is found in the first program.
const ONE_PROGRAM: &str = "1";

#[test]
fn the_conformance_kit_finds_it_out() {
    let (status, out) = check(&Mischief::of("any", "never", "", 1), "3");
    assert_eq!(status, Some(0), "{out}");
    let by_kind = [
        (
            "planner",
            &["describe", "check", "accept", "finish", "advance", "reset"][..],
        ),
        (
            "feed strategy",
            &[
                "signals",
                "max_ratio_change_per_s",
                "takes_override",
                "update",
            ],
        ),
        (
            "driver",
            &[
                "describe",
                "open",
                "start",
                "exchange",
                "quick_stop",
                "stop",
            ],
        ),
        (
            "kinematics",
            &["joint_count", "to_joints", "to_axes", "health"],
        ),
    ];
    for (kind, method) in by_kind
        .iter()
        .flat_map(|(kind, methods)| methods.iter().map(move |method| (kind, method)))
    {
        let mischief = Mischief::of("any", "panic", method, 1);
        let (status, out) = check(&mischief, ONE_PROGRAM);
        let words = format!("panicked in {method}");
        assert!(
            status == Some(1) && out.contains(&words),
            "{kind}: {mischief}: {status:?}\n{out}"
        );
    }
    for (misbehave, method, words) in [
        ("panic", "advance", "panicked in advance"),
        ("panic", "exchange", "panicked in exchange"),
        ("panic", "update", "panicked in update"),
        ("panic", "to_joints", "panicked in to_joints"),
        ("panic", "quick_stop", "panicked in quick_stop"),
        ("fail", "stop", "FAILED lifecycle"),
        ("not-a-number", "advance", "not finite"),
        ("not-a-number", "update", "ratio in range"),
        ("beyond", "update", "ratio in range"),
        ("not-a-number", "exchange", "not finite"),
        ("beyond", "to_axes", "to joints and back"),
        ("endless", "advance", "emits without end"),
        ("order", "advance", "FAILED reports"),
    ] {
        let mischief = Mischief::of(
            "any",
            misbehave,
            method,
            if method.ends_with("stop") { 1 } else { 7 },
        );
        let (status, out) = check(&mischief, ONE_PROGRAM);
        assert!(
            status == Some(1) && out.contains(words),
            "{mischief}: {status:?}\n{out}"
        );
    }
}
