//! What goes wrong in any frame while drives home their joints, while a probe is awaited, and where clocks lead.

use std::fmt::Write;

use tandem_host::Switches;

use crate::ethercat::{Ran, fault, frames_of, judge, ran_with, seeds};
use tandem_rig::Random;

/// What a machine of two drives is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Task {
    /// One drive homes its joint at a limit switch, the other at its index pulse; then both move.
    Homing,
    /// One drive catches the edge of a probe; then its joint goes to a mm above what was touched.
    Probing,
    /// Distributed clocks lead, and both joints move.
    Clocks,
}

impl Task {
    fn program(self) -> &'static str {
        match self {
            Self::Homing => "G21 G90 G94 F4000\nG1 X0.1 Y0.1\nM2\n",
            Self::Probing => "G21 G90 G94 F1500\nG38.2 Y0.9\nG1 X0.1 Y[#5062-0.2]\nM2\n",
            Self::Clocks => "G21 G90 G94 F4000\nG1 X0.25 Y-0.3\nG1 X0 Y0.1\nM2\n",
        }
    }

    fn switches(self) -> Switches {
        Switches {
            home: (self == Self::Homing).then_some(tandem_session::HOMING),
            ..Switches::default()
        }
    }

    /// Two drives of a machine drawn from a seed, with these faults of the bus.
    fn table(self, seed: u64, faults: &str) -> String {
        self.table_of(seed, faults, 0.45)
    }

    /// The same, with the edge of the probe there.
    fn table_of(self, seed: u64, faults: &str, edge_mm: f64) -> String {
        let mut random = Random::new(seed + 40);
        let mut text = "format = 1\n[planner]\nplugin = \"look-ahead\"\n".to_string();
        for axis in ["x", "y"] {
            let (feed, acceleration) = (3000 + random.below(6000), 500 + random.below(1500));
            let _ = writeln!(
                text,
                "[axes.{axis}]\ntravel_mm = [-250, 250]\nmax_feed_mm_per_min = {feed}\n\
                 max_acceleration_mm_per_s2 = {acceleration}\nmax_following_error_mm = 2"
            );
        }
        let sync = if self == Self::Clocks {
            "dc"
        } else {
            "free-run"
        };
        let homing = if self == Self::Homing {
            "homing = { fast_per_s = 30, slow_per_s = 10, acceleration_per_s2 = 2000 }\n"
        } else {
            ""
        };
        text += match self {
            Self::Homing => {
                "[homing.x]\nsequence = 1\ndrive_method = 17\n[homing.y]\nsequence = 2\ndrive_method = 33\n"
            }
            Self::Probing => "[probe]\ninput = 0\n",
            Self::Clocks => "",
        };
        let _ = writeln!(
            text,
            "[drivers.bus]\nplugin = \"ethercat\"\njoints = [\"x\", \"y\"]\ninputs = [0]\n[drivers.bus.options]\n\
             interface = \"emulated\"\nsync = \"{sync}\"\nmax_lost_frames = 2\nwatchdog_ms = 20"
        );
        let mut devices = String::new();
        for (position, axis) in ["x", "y"].iter().enumerate() {
            let counts = 2000 + random.below(8000);
            let probe = if self == Self::Probing && *axis == "y" {
                "probe = { input = 0, latch = 1 }\n"
            } else {
                ""
            };
            let _ = writeln!(
                text,
                "[[drivers.bus.options.devices]]\nposition = {position}\nproduct = \"0x0e1a:0x0402\"\njoint = \"{axis}\"\n\
                 counts_per_mm = {counts}\n{homing}{probe}"
            );
            let counts = counts as f64;
            let (limit, turn, edge) = (-0.3 * counts, 0.4 * counts, edge_mm * counts);
            let _ = writeln!(
                devices,
                "[[drivers.bus.options.emulated.devices]]\nkind = \"drive\"\ndrift_ppm = {:.1}\n\
                 drive = {{ negative_limit_counts = {limit:.1}, counts_per_turn = {turn:.1}, probes_counts = [{edge:.1}, 1e12] }}",
                random.between(-100.0, 100.0)
            );
        }
        text + &devices + faults
    }

    fn ran(self, seed: u64, faults: &str) -> Ran {
        ran_with(&self.table(seed, faults), self.program(), self.switches())
    }
}

/// Faults for good that any program ends by, and the words that they are told in.
const FOR_GOOD: [(&str, &str); 9] = [
    ("kind = \"lost-reply\"", "no frame comes back"),
    ("kind = \"lost-request\"", "no frame comes back"),
    ("kind = \"cut\", behind = 0", "device 1: "),
    (
        "kind = \"deaf\", device = 0",
        "device 0: the working counter says",
    ),
    (
        "kind = \"drive-fault\", device = 1, code = 0x7305",
        "fault 0x7305 (device 1: encoder 1)",
    ),
    (
        "kind = \"al-error\", device = 0, state = \"safe-op\", code = 0x1b",
        "device 0: it left OP: 001B",
    ),
    (
        "kind = \"disables-itself\", device = 1",
        "device 1: it let go by itself",
    ),
    (
        "kind = \"torque-off\", device = 0",
        "device 0: it let go by itself",
    ),
    ("kind = \"power-cycle\", device = 1", "device 1: "),
];

/// Faults that are over within the driver's patience.
const PASSING: [(&str, &str); 8] = [
    ("cycles = 1", "kind = \"lost-reply\""),
    ("cycles = 2", "kind = \"lost-request\""),
    ("cycles = 1", "kind = \"late\", by_us = 3500.0"),
    ("cycles = 1", "kind = \"duplicate\", after_us = 1200.0"),
    ("cycles = 1", "kind = \"swapped\""),
    ("cycles = 1", "kind = \"corrupt\", byte = 20, mask = 255"),
    ("cycles = 2", "kind = \"deaf\", device = 1"),
    ("cycles = 2", "kind = \"cut\""),
];

fn lasting(what: &str) -> &str {
    let of_the_wire = ["lost-reply", "lost-request"];
    if of_the_wire.iter().any(|kind| what.contains(kind)) {
        "ms = 1e6"
    } else {
        ""
    }
}

/// The machine rests behind its fault: the last two samples are the same.
fn assert_rests(case: &str, ran: &Ran) {
    if let [.., before, last] = &ran.samples.0[..] {
        assert_eq!(last.command, before.command, "{case}: it is at rest");
    }
}

/// Every frame of a program with every one of these faults.
fn each(task: Task, faults: &[(&str, &str)], judged: impl Fn(&str, u64, &str, Ran)) {
    for seed in 0..seeds() {
        let (first, count) = frames_of(|faults| task.ran(seed, faults));
        for (lasts, what) in faults {
            for n in first..first + count - 6 {
                let case = format!(
                    "{task:?}, seed {seed}: {what} in frame {n}, {} of it",
                    n - first
                );
                let faults = fault(&format!("cycle = {n}"), lasts, what);
                judged(&case, seed, what, task.ran(seed, &faults));
            }
        }
    }
}

fn for_good(task: Task) {
    let faults = FOR_GOOD.map(|(what, _)| (lasting(what), what));
    each(task, &faults, |case, seed, what, ran| {
        let words = FOR_GOOD.iter().find(|of| of.0 == what).unwrap().1;
        let told = ran
            .fault
            .as_ref()
            .unwrap_or_else(|| panic!("{case}: nobody noticed"));
        assert!(!ran.refused && told.contains(words), "{case}: {told}");
        // Where a drive has its joint in its hands, what is told to it is where it is.
        if task == Task::Homing {
            assert_rests(case, &ran);
        } else {
            judge(case, &task.table(seed, ""), &ran.samples);
        }
    });
}

#[test]
fn whatever_goes_wrong_while_drives_home_is_named_and_the_joints_come_to_rest() {
    for_good(Task::Homing);
}

#[test]
fn whatever_goes_wrong_while_a_probe_is_awaited_is_named_and_the_joints_come_to_rest() {
    for_good(Task::Probing);
}

/// Where a program of the task ends, and the lowest place that it comes to, mm.
fn ends(ran: &Ran) -> [f64; 2] {
    let last = ran.samples.0.last().unwrap().command;
    [last[0], last[1]]
}

fn passes(task: Task, count_mm: f64) {
    let whole: Vec<_> = (0..seeds()).map(|seed| ends(&task.ran(seed, ""))).collect();
    each(task, &PASSING, |case, seed, _, ran| {
        assert_eq!(ran.fault, None, "{case}");
        assert!(
            ran.samples.0.iter().any(|sample| sample.age_periods[1] > 0)
                || case.contains("duplicate"),
            "{case}: it was not seen"
        );
        for (end, expected) in ends(&ran).iter().zip(whole[seed as usize]) {
            assert!(
                (end - expected).abs() <= count_mm,
                "{case}: {end} instead of {expected}"
            );
        }
    });
}

/// The program behind it ends where it is to: the axes are where their drives have homed them.
#[test]
fn frames_that_are_lost_while_drives_home_change_no_place() {
    passes(Task::Homing, 0.0);
}

/// What the probe touched is the drive's own place at the edge, whichever frame tells it.
#[test]
fn frames_that_are_lost_while_a_probe_is_awaited_change_no_place_that_was_touched() {
    passes(Task::Probing, 0.001);
}

/// An edge in each period of the block that awaits it, and between periods: the program goes on from the drive's own place at it.
#[test]
fn an_edge_in_any_period_of_a_block_is_the_place_that_was_touched() {
    for seed in 0..seeds() {
        let whole = Task::Probing.ran(seed, "");
        // Of the way to the edge, which is the same with each.
        let way = whole.samples.0.iter().map(|sample| sample.command[1]);
        let mut places: Vec<f64> = way
            .take_while(|y| *y < 0.45)
            .filter(|y| *y > 0.02)
            .collect();
        places.dedup();
        assert!(places.len() > 10, "{places:?}");
        for pair in places.windows(2) {
            for share in [0.02, 0.5, 0.98] {
                let edge_mm = pair[0] + share * (pair[1] - pair[0]);
                let text = Task::Probing.table_of(seed, "", edge_mm);
                let ran = ran_with(&text, Task::Probing.program(), Switches::default());
                let case = format!("seed {seed}, an edge at {edge_mm} mm");
                assert_eq!(ran.fault, None, "{case}");
                judge(&case, &text, &ran.samples);
                let touched_mm = ends(&ran)[1] + 0.2;
                // A count, and what the edge is rounded to in the file.
                assert!(
                    (touched_mm - edge_mm).abs() < 0.0012,
                    "{case}: {touched_mm}"
                );
            }
        }
    }
}

/// Clocks that jump, are lost, or miss a pulse at any frame of a program.
#[test]
fn whatever_goes_wrong_with_clocks_in_any_frame_passes_or_is_named() {
    let undisturbed: Vec<_> = (0..seeds())
        .map(|seed| Task::Clocks.ran(seed, "").samples.0)
        .collect();
    let faults = [
        ("", "kind = \"lost-clock\", device = 0"),
        ("", "kind = \"missed-sync\", device = 1, pulses = 200"),
        ("", "kind = \"missed-sync\", device = 1, pulses = 2"),
        ("", "kind = \"clock-jump\", device = 1, by_ns = 50000"),
        ("", "kind = \"clock-jump\", device = 0, by_ns = 200000"),
        ("cycles = 2", "kind = \"lost-reply\""),
    ];
    each(Task::Clocks, &faults, |case, seed, what, ran| {
        let words = if what.contains("lost-clock") {
            Some("the clock that leads the others")
        } else if what.contains("pulses = 200") {
            Some("device 1: it left OP: 002C")
        } else {
            None
        };
        let Some(words) = words else {
            assert_eq!(ran.fault, None, "{case}");
            let commands = |samples: &[tandem_rings::Sample]| {
                samples
                    .iter()
                    .map(|sample| sample.command)
                    .collect::<Vec<_>>()
            };
            assert!(
                commands(&ran.samples.0) == commands(&undisturbed[seed as usize]),
                "{case}: another command was sent"
            );
            return;
        };
        let told = ran
            .fault
            .as_ref()
            .unwrap_or_else(|| panic!("{case}: nobody noticed"));
        assert!(told.contains(words), "{case}: {told}");
        judge(case, &Task::Clocks.table(seed, ""), &ran.samples);
    });
}
