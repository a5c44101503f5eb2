//! The machine starts where its drives stand: anywhere, on every kinematics, with drives that are as demanding as real ones are.

use std::fmt::Write;
use std::path::{Path, PathBuf};

use tandem_rig::Random;

use crate::harness::{Done, Scenario, judge_trace, overlapping, root};

/// What the drives ask for: they come up one after the other, the last joint has no brake and sinks until it is held, encoders
/// count microns and are noisy, answers are two periods behind, and frames get lost, never more in a row than the patience.
const DEMANDING: &str = "enable_s=[0.05,0.3,0.1],brake_s=[0.1,0.05,0],sag_mm_per_s=[0,0,-0.02],encoder_count_mm=0.001,\
                         encoder_noise_mm=0.0005,delay_periods=2,patience_periods=5,\
                         lost_frames={probability=0.02,periods=2},late_frames={probability=0.01}";

/// How far a linear joint may start from where it was put, mm: counts, noise, and what it sinks by until it is held.
const FOUND_MM: f64 = 0.02;

/// The same of an axis that a rotary joint moves, mm or degrees: its counts are thousandths of a radian.
const FOUND_ROTARY: f64 = 0.2;

/// An example machine: its axes with the range in which it is put somewhere, and where its joints are then.
struct Machine {
    file: &'static str,
    axes: &'static [(&'static str, f64, f64)],
    /// How far from where it was put it may start.
    found: f64,
    joints: fn(&[f64]) -> Vec<f64>,
}

const MACHINES: [Machine; 5] = [
    Machine {
        found: FOUND_MM,
        file: "mill-3axis.toml",
        axes: &[
            ("x", -200.0, 200.0),
            ("y", -200.0, 200.0),
            ("z", -80.0, 80.0),
        ],
        joints: <[f64]>::to_vec,
    },
    Machine {
        found: FOUND_ROTARY,
        file: "mill-4axis.toml",
        axes: &[
            ("x", -200.0, 200.0),
            ("y", -200.0, 200.0),
            ("z", -80.0, 80.0),
            ("a", -300.0, 300.0),
        ],
        joints: |axes| vec![axes[0], axes[1], axes[2], axes[3].to_radians()],
    },
    Machine {
        found: FOUND_MM,
        file: "corexy.toml",
        axes: &[("x", -80.0, 80.0), ("y", -80.0, 80.0), ("z", 0.0, 40.0)],
        joints: |axes| vec![axes[0] + axes[1], axes[0] - axes[1], axes[2]],
    },
    Machine {
        found: FOUND_MM,
        file: "gantry.toml",
        axes: &[
            ("x", -200.0, 200.0),
            ("y", -100.0, 100.0),
            ("z", -80.0, 80.0),
        ],
        joints: |axes| vec![axes[0], axes[1], axes[1], axes[2]],
    },
    Machine {
        found: FOUND_ROTARY,
        file: "rotary-table.toml",
        axes: &[
            ("x", 50.0, 250.0),
            ("y", -500.0, 500.0),
            ("z", 10.0, 60.0),
            ("v", -20.0, 20.0),
        ],
        joints: |axes| vec![axes[0], axes[1] / 30.0, axes[2], axes[3]],
    },
];

/// A run that begins at `place`, with a first move that is relative or absolute.
struct Attached {
    done: Done,
    place: Vec<f64>,
    program: PathBuf,
}

fn attach(machine: &Machine, seed: u64, relative: bool, settings: &[&str]) -> Attached {
    let mut random = Random::new(seed);
    let place: Vec<_> = machine
        .axes
        .iter()
        .map(|(_, low, high)| random.between(*low, *high))
        .collect();
    let joints: Vec<_> = (machine.joints)(&place)
        .iter()
        .map(ToString::to_string)
        .collect();
    let first = if relative {
        "G91\nG1 X7 Y-5\nG90\n"
    } else {
        ""
    };
    let middle: Vec<_> = machine.axes[..2]
        .iter()
        .map(|(_, low, high)| f64::midpoint(*low, *high))
        .collect();
    let (x, y) = (middle[0] + 10.0, middle[1] - 4.0);
    let program = format!(
        "G21 G90 G17 G64\nF4000\n{first}G1 X{x} Y{y}\nG2 X{} Y{y} I-5\nG1 Y{}\nM2\n",
        x - 10.0,
        y + 6.0
    );
    let options = format!(
        "driver.options={{seed={seed},start_mm=[{}],{DEMANDING}}}",
        joints.join(",")
    );
    let file = root().join("examples/machines").join(machine.file);
    let done = Scenario::text(&program)
        .on(&file)
        .with(&["--set", &options])
        .with(settings)
        .run();
    let path = done.file("program.ngc");
    Attached {
        done,
        place,
        program: path,
    }
}

impl Attached {
    /// Where the trace begins, per axis.
    fn first(&self, machine: &Machine) -> Vec<f64> {
        let unit = |axis: &str| if axis == "a" { "deg" } else { "mm" };
        machine
            .axes
            .iter()
            .map(|(axis, ..)| self.done.column(&format!("{axis}_cmd_{}", unit(axis)))[0])
            .collect()
    }

    /// The oracle's machine file: the example, standing where the trace begins.
    fn machine_that_stands(&self, machine: &Machine) -> PathBuf {
        let example = root().join("examples/machines").join(machine.file);
        let mut text = format!("format = 1\ninclude = [{:?}]\n", example.to_string_lossy());
        for ((axis, ..), at) in machine.axes.iter().zip(self.first(machine)) {
            let unit = if *axis == "a" { "deg" } else { "mm" };
            writeln!(text, "[axes.{axis}]\nstart_{unit} = {at:?}").unwrap();
        }
        let file = self.done.file("stands.toml");
        std::fs::write(&file, text).unwrap();
        file
    }

    fn assert_right(&self, machine: &Machine, what: &str, rounds_corners: bool) {
        let done = &self.done;
        done.assert_driven(what, &["lost_samples"]);
        for (at, place) in self.first(machine).iter().zip(&self.place) {
            assert!(
                (at - place).abs() < machine.found,
                "{what}: it begins at {at} and stood at {place}"
            );
        }
        self.assert_oracle_passes(machine, what, rounds_corners);
    }

    fn assert_oracle_passes(&self, machine: &Machine, what: &str, rounds_corners: bool) {
        let file = self.machine_that_stands(machine);
        let trace = self.done.file("trace.csv");
        let verdict = judge_trace(&trace, Path::new(&self.program), &file, |options| {
            if rounds_corners {
                overlapping(options);
            } else {
                options.vertex_tolerance_mm = Some(0.1);
            }
        });
        assert!(verdict.passed(), "{what}: {verdict}");
    }
}

#[test]
fn the_machine_starts_where_its_drives_stand() {
    for machine in &MACHINES {
        for (seed, relative) in [(1, true), (2, false), (3, true)] {
            let what = format!("{}, seed {seed}", machine.file);
            attach(machine, seed, relative, &[]).assert_right(machine, &what, false);
        }
    }
}

#[test]
fn every_planner_starts_there() {
    let planners: [&[&str]; 3] = [
        &["--set", "planner.plugin=block-overlap"],
        &[
            "--set",
            "planner.plugin=smooth",
            "--set",
            "motion.jerk=limit",
        ],
        &[
            "--set",
            "planner.plugin=nurbs",
            "--set",
            "motion.jerk=limit",
        ],
    ];
    for (seed, settings) in (11..).zip(planners) {
        let what = format!("{settings:?}");
        attach(&MACHINES[0], seed, true, settings).assert_right(&MACHINES[0], &what, true);
    }
}

/// A vertical axis that is up first holds while it waits for another, however long that takes.
#[test]
fn a_joint_that_gravity_pulls_does_not_sink_while_it_waits_for_another() {
    let options = "driver.options={start_mm=[0,0,40],enable_s=[3,0.1,0.1],brake_s=[0,0,0.1],sag_mm_per_s=[0,0,-20],\
                   encoder_count_mm=0.001}";
    let done = Scenario::text("G21 G91\nF3000\nG1 X5 Z5\nM2\n")
        .with(&["--set", options])
        .run();
    assert_eq!(done.status(), 0, "{}", done.errors());
    let z = done.column("z_cmd_mm");
    assert!((z[0] - 40.0).abs() <= 0.01, "it sank by {} mm", 40.0 - z[0]);
    assert!((z.last().unwrap() - z[0] - 5.0).abs() < 1e-9);
}

/// What is not known is not driven from; the operator who says so takes it upon him.
#[test]
fn an_encoder_that_counts_from_power_on_is_no_place_to_start_from() {
    let program = "G21 G91\nF3000\nG1 X5\nM2\n";
    let options = [
        "--set",
        "driver.options={encoder=\"incremental\",start_mm=[37.5]}",
    ];
    let refused = Scenario::text(program).with(&options).run();
    assert!(
        refused.status() == 1 && refused.errors().contains("it is not known where"),
        "{}",
        refused.errors()
    );
}

/// A drive that never comes up is not waited for without end: it is named, with its state.
#[test]
fn a_drive_that_never_comes_up_is_named() {
    let done = Scenario::text("G21 G91\nF3000\nG1 X5\nM2\n")
        .with(&["--set", "driver.options={enable_s=[0.1,inf]}"])
        .run();
    assert_eq!(done.status(), 3, "{}", done.errors());
    assert!(
        done.errors().contains("Enabling") || done.errors().contains("enabl"),
        "{}",
        done.errors()
    );
}

/// Row by row: a fault has its words, a drive that falls out of the bus is no good run, and frames that are lost for longer than
/// the patience are told.
#[test]
fn drives_that_fail_in_motion_are_told_by_name() {
    let program = "G21 G91\nF3000\nG1 X50 Y20\nM2\n";
    let cases = [
        (
            "faults=[{joint=1,tick=300,code=29200,text=\"brake chopper\"}]",
            "brake chopper",
        ),
        ("faults=[{joint=0,tick=300,lost=true}]", "axis X"),
        (
            "lost_frames={ticks=[300],periods=5},patience_periods=4",
            "lost",
        ),
    ];
    for (options, words) in cases {
        let done = Scenario::text(program)
            .with(&["--set", &format!("driver.options={{{options}}}")])
            .run();
        assert_eq!(done.status(), 3, "{options}: {}", done.errors());
        let said = done.errors();
        assert!(said.contains(words), "{options}: {said}");
        assert_eq!(
            (done.number("limit_violations"), done.number("guard_stops")),
            (0.0, 0.0),
            "{options}"
        );
    }
}

/// Frames that are lost, but not for longer than the patience, change no command.
#[test]
fn lost_frames_up_to_the_patience_change_no_command() {
    let program = "G21 G91\nF3000\nG1 X50 Y20\nG1 Y-30\nM2\n";
    let run = |options: &str| {
        let done = Scenario::text(program)
            .with(&["--set", &format!("driver.options={{{options}}}")])
            .run();
        assert_eq!(done.status(), 0, "{}", done.errors());
        (done.cells("x_cmd_mm"), done.cells("y_cmd_mm"))
    };
    let whole = run("");
    for options in [
        "lost_frames={probability=0.05},patience_periods=20",
        "late_frames={ticks=[200,700],periods=3}",
    ] {
        assert!(run(options) == whole, "{options}");
    }
}

/// One frame more than the patience is a fault in that very period, one fewer is nothing; the machine, the period, the tick and
/// whether frames are lost or late are drawn, and the drives' own watchdog waits longer. In real time the same fault comes.
#[test]
fn a_frame_beyond_the_patience_is_a_fault_in_its_period_on_both_clocks() {
    let program = "G21 G91\nF3000\nG1 X40 Y20\nG1 Y-30 Z4\nM2\n";
    for seed in 0..12 {
        let mut random = Random::new(900 + seed);
        let (patience, tick) = (random.below(9), 40 + random.below(200));
        let kind = random.pick(&["lost_frames", "late_frames"]);
        let period = random.pick(&["0.5", "1", "2"]);
        let acceleration = random.between(300.0, 3000.0);
        let run = |periods: u64, more: &[&str]| {
            let frames = format!(
                "driver.options={{{kind}={{ticks=[{tick}],periods={periods}}},patience_periods={patience},\
                 watchdog_periods=100}}"
            );
            let settings = [
                format!("loops.fine_period_ms={period}"),
                format!("axes.x.max_acceleration_mm_per_s2={acceleration}"),
                frames,
            ];
            let set: Vec<&str> = settings.iter().flat_map(|it| ["--set", it]).collect();
            Scenario::text(program).with(&set).with(more).run()
        };
        let case = format!("seed {seed}: {kind}, patience {patience}, tick {tick}, {period} ms");
        let commands =
            |done: &Done| ["x", "y", "z"].map(|axis| done.cells(&format!("{axis}_cmd_mm")));
        let kept = |done: &Done| (done.number("limit_violations"), done.number("guard_stops"));
        if patience > 0 {
            let within = run(patience, &[]);
            let whole = Scenario::text(program)
                .with(&["--set", &format!("loops.fine_period_ms={period}")])
                .with(&[
                    "--set",
                    &format!("axes.x.max_acceleration_mm_per_s2={acceleration}"),
                ])
                .run();
            assert_eq!(within.status(), 0, "{case}: {}", within.errors());
            assert!(commands(&within) == commands(&whole), "{case}");
        }
        let beyond = run(patience + 1, &[]);
        assert_eq!(beyond.status(), 3, "{case}");
        let at = format!("tick {}", tick + patience);
        let said = beyond.errors();
        assert!(
            said.contains("lost") && said.contains(&at),
            "{case}: not at {at}: {said}"
        );
        assert_eq!(kept(&beyond), (0.0, 0.0), "{case}");
        if seed < 2 {
            let lenient = [
                "loops.max_missed_periods=1000000",
                "loops.max_missed_share=1",
            ];
            let more = ["--clock", "wall", "--set", lenient[0], "--set", lenient[1]];
            let beyond = run(patience + 1, &more);
            assert_eq!(beyond.status(), 3, "{case}");
            assert!(
                beyond.errors().contains("lost"),
                "{case}: {}",
                beyond.errors()
            );
            assert_eq!(kept(&beyond), (0.0, 0.0), "{case}");
        }
    }
}
