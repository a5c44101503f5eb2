//! `EtherCAT` drives behind the host, on the emulator and on virtual time: what goes wrong in any frame of a program.

#![allow(
    clippy::format_push_string,
    reason = "a machine file in pieces, once a test"
)]

use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use tandem_host::{Clock, Command as Order, Run, Switches, Timed};
use tandem_machine::Machine;
use tandem_rig::Random;

use crate::{Samples, program, registry};

/// All joints move, one past the end of the 32 bits that its drive counts in.
const SHORT: &str = "G21 G90 G94 F4000\nG1 X0.25 Y-0.3 Z0.2\nG1 X0 Y0 Z-0.1\nM2\n";

/// One in so many frames is tried with each kind of trouble.
const ONE_IN: u64 = 4;

/// Three drives, a terminal and up to three drives more behind it that hold, with a machine of its own for every seed: limits, counts,
/// directions, period, drives.
pub fn table(seed: u64, faults: &str, options: &str) -> String {
    let mut random = Random::new(seed);
    let mut text = "format = 1\n[planner]\nplugin = \"look-ahead\"\n".to_string();
    let period_ms = random.pick(&[0.25, 0.5, 1.0, 2.0]);
    let axes = &["x", "y", "z", "u", "v", "w"][..3 + random.below(4) as usize];
    text += &format!(
        "[loops]\nfine_period_ms = {period_ms}\nrough_period_ms = {}\n",
        8.0 * period_ms
    );
    for axis in axes {
        text += &format!(
            "[axes.{axis}]\ntravel_mm = [-250, 250]\nmax_feed_mm_per_min = {}\nmax_acceleration_mm_per_s2 = {}\n\
             max_following_error_mm = 2\n",
            3000 + random.below(6000),
            500 + random.below(1500)
        );
    }
    text += &format!(
        "[drivers.bus]\nplugin = \"ethercat\"\njoints = {axes:?}\ninputs = [0, 1, 2, 3]\n\
         [drivers.bus.options]\ninterface = \"emulated\"\n"
    );
    text += &format!(
        "max_lost_frames = 2\nwatchdog_ms = {}\n{options}\n",
        20.0 * period_ms
    );
    for (number, axis) in axes.iter().enumerate() {
        let position = number + usize::from(number > 2);
        let counts = 1000 + random.below(9000);
        let zero = if *axis == "y" {
            i64::from(i32::MAX) - 500
        } else {
            0
        };
        text += &format!(
            "[[drivers.bus.options.devices]]\nposition = {position}\nproduct = \"0x0e1a:0x0402\"\njoint = \"{axis}\"\n\
             counts_per_mm = {counts}\ninvert = {}\nzero_counts = {zero}\n",
            random.below(2) == 1
        );
    }
    text += "[[drivers.bus.options.devices]]\nposition = 3\nproduct = \"2:0x03f03052\"\ninputs = [0, 1, 2, 3]\n";
    text += "[[drivers.bus.options.emulated.devices]]\nkind = \"drive\"\n";
    text += &format!(
        "[[drivers.bus.options.emulated.devices]]\nkind = \"drive\"\ndrive = {{ position_counts = {}.0 }}\n",
        i64::from(i32::MAX) - 500
    );
    text += "[[drivers.bus.options.emulated.devices]]\nkind = \"drive\"\ndrive = { brake_open_ms = 40.0, brake_close_ms = 30.0 }\n";
    text += "[[drivers.bus.options.emulated.devices]]\nkind = \"digital-inputs\"\n";
    for _ in 3..axes.len() {
        text += "[[drivers.bus.options.emulated.devices]]\nkind = \"drive\"\n";
    }
    text + faults
}

/// A fault of the emulated bus as the machine file has it.
pub fn fault(at: &str, lasts: &str, what: &str) -> String {
    let lasts = if lasts.is_empty() {
        String::new()
    } else {
        format!("lasts = {{ {lasts} }}\n")
    };
    format!(
        "[[drivers.bus.options.emulated.faults]]\nat = {{ {at} }}\n{lasts}what = {{ {what} }}\n"
    )
}

/// The machine of this file.
pub fn machine(text: &str) -> Machine {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("machine.toml");
    std::fs::write(&path, text).unwrap();
    Machine::read(&path, &[]).unwrap_or_else(|error| panic!("{error}"))
}

/// How many machines are tried.
pub fn seeds() -> u64 {
    std::env::var("TANDEM_SEEDS")
        .ok()
        .and_then(|count| count.parse().ok())
        .unwrap_or(1)
}

/// A part of what is tried, which is drawn anew each time; all where `TANDEM_EVERY` is set.
pub struct Part {
    one_in: usize,
    from: usize,
}

impl Part {
    /// One in so many.
    pub fn drawn(one_in: u64) -> Self {
        let is_long = std::env::var_os("TANDEM_EVERY").is_some();
        let one_in = if is_long { 1 } else { one_in };
        Self {
            one_in: one_in as usize,
            from: Random::from_the_clock().below(one_in) as usize,
        }
    }

    /// Those of the part.
    pub fn of<T>(&self, all: impl IntoIterator<Item = T>) -> impl Iterator<Item = T> {
        all.into_iter().skip(self.from).step_by(self.one_in)
    }
}

/// What a run came to: its samples, and the words of its fault or of its refusal.
pub struct Ran {
    pub samples: Samples,
    pub fault: Option<String>,
    pub refused: bool,
}

fn ran(text: &str) -> Ran {
    ran_with(text, SHORT, Switches::default())
}

/// Runs a program on the machine of this file.
pub fn ran_with(text: &str, of_program: &str, switches: Switches) -> Ran {
    ran_by(text, of_program, switches, &[])
}

/// The same, with an operator.
fn ran_by(text: &str, of_program: &str, switches: Switches, operator: &[Timed]) -> Ran {
    let machine = machine(text);
    let run = match Run::prepare(machine, &registry(), program(of_program), switches) {
        Ok(run) => run,
        Err(error) => {
            return Ran {
                samples: Samples::default(),
                fault: Some(error.to_string()),
                refused: true,
            };
        }
    };
    let mut samples = Samples::default();
    match run.drive(Clock::Virtual, operator, &mut samples) {
        Ok(outcome) => Ran {
            samples,
            fault: outcome.summary.fault,
            refused: false,
        },
        Err(error) => Ran {
            samples,
            fault: Some(error.to_string()),
            refused: true,
        },
    }
}

/// Every setpoint within the limits of its axis, and the last one at rest.
pub fn judge(case: &str, text: &str, samples: &Samples) {
    let machine = machine(text);
    for window in samples.0.windows(3) {
        for axis in 0..machine.axes.count() {
            let at = |i: usize| window[i].command[axis];
            let before = (at(1) - at(0)) / machine.fine_period_s;
            let after = (at(2) - at(1)) / machine.fine_period_s;
            let limit = machine.limits.axes()[axis];
            assert!(
                after.abs() <= limit.feed_mm_per_s * (1.0 + 1e-9),
                "{case}: axis {axis}: {after} mm/s"
            );
            let change = (after - before).abs() / machine.fine_period_s;
            assert!(
                change <= limit.acceleration_mm_per_s2 * (1.0 + 1e-6),
                "{case}: axis {axis}: {change} mm/s²"
            );
        }
    }
    if let [.., before, last] = &samples.0[..] {
        assert_eq!(last.command, before.command, "{case}: it is at rest");
    }
}

/// The frame of process data, from 1, in which the program's first sample was sent, and the number of its samples.
fn frames(seed: u64) -> (u64, u64) {
    frames_of(|faults| ran(&table(seed, faults, "")))
}

/// The same of what `ran` runs with faults of the bus.
pub fn frames_of(ran: impl Fn(&str) -> Ran) -> (u64, u64) {
    let whole = ran("");
    assert_eq!(whole.fault, None);
    // A reply that is lost in frame n is missing in sample n − first.
    for n in (1..4000).step_by(20) {
        let lost = fault(
            &format!("cycle = {n}"),
            "cycles = 1",
            "kind = \"lost-reply\"",
        );
        let ran = ran(&lost);
        if let Some(seen) = ran
            .samples
            .0
            .iter()
            .position(|sample| sample.age_periods[0] > 0)
        {
            return (n - seen as u64, whole.samples.0.len() as u64);
        }
    }
    panic!("no frame of the program was found");
}

/// What goes wrong for good at any frame is a fault that names the device and says why; the joints come to rest within their limits.
#[test]
fn whatever_goes_wrong_in_any_frame_is_named_and_the_joints_come_to_rest() {
    let part = Part::drawn(ONE_IN);
    for seed in 0..seeds() {
        let (first, count) = frames(seed);
        for (lasts, what, words) in [
            ("ms = 1e6", "kind = \"lost-reply\"", "no frame comes back"),
            ("ms = 1e6", "kind = \"lost-request\"", "no frame comes back"),
            // One more than the driver is patient with.
            ("cycles = 3", "kind = \"lost-reply\"", "no frame comes back"),
            (
                "ms = 1e6",
                "kind = \"late\", by_us = 9000.0",
                "no frame comes back",
            ),
            (
                "ms = 1e6",
                "kind = \"corrupt\", byte = 20, mask = 255",
                "no frame comes back",
            ),
            (
                "cycles = 3",
                "kind = \"deaf\", device = 2",
                "device 2: the working counter says",
            ),
            // The terminal is the machine's too.
            (
                "",
                "kind = \"cut\", behind = 2",
                "device 3: the working counter says",
            ),
            (
                "",
                "kind = \"deaf\", device = 3",
                "device 3: the working counter says",
            ),
            ("", "kind = \"mode-shown\", device = 0, mode = 3", "axis X"),
            (
                "",
                "kind = \"cut\", behind = 1",
                "device 2: the working counter says",
            ),
            (
                "",
                "kind = \"cut\", behind = 0",
                "device 1: the working counter says",
            ),
            ("", "kind = \"cut\"", "no frame comes back"),
            // Plugged in again, too late.
            (
                "cycles = 20",
                "kind = \"cut\", behind = 1",
                "device 2: the working counter says",
            ),
            (
                "",
                "kind = \"deaf\", device = 1",
                "device 1: the working counter says",
            ),
            (
                "",
                "kind = \"drive-fault\", device = 2, code = 0x7305",
                "axis Z reports fault 0x7305 (device 2: encoder 1)",
            ),
            (
                "",
                "kind = \"al-error\", device = 1, state = \"safe-op\", code = 0x1a",
                "device 1: it left OP: 001A, synchron",
            ),
            (
                "",
                "kind = \"al-error\", device = 0, state = \"safe-op\", code = 0x2c",
                "device 0: it left OP: 002C, fatal",
            ),
            (
                "",
                "kind = \"al-error\", device = 2, state = \"safe-op\", code = 0x1b",
                "device 2: it left OP: 001B, sync manager watchdog",
            ),
            (
                "",
                "kind = \"al-error\", device = 1, state = \"pre-op\", code = 0x32",
                "device 1: it left OP: 0032, the device's clock does not follow",
            ),
            (
                "",
                "kind = \"disables-itself\", device = 0",
                "device 0: it let go by itself",
            ),
            (
                "",
                "kind = \"torque-off\", device = 1",
                "device 1: it let go by itself",
            ),
            ("", "kind = \"power-cycle\", device = 1", "device 1: "),
        ] {
            for n in part.of(first..first + count - 4) {
                let case = format!(
                    "seed {seed}: {what} in frame {n}, {} of the program",
                    n - first
                );
                let text = table(seed, &fault(&format!("cycle = {n}"), lasts, what), "");
                let ran = ran(&text);
                judge(&case, &text, &ran.samples);
                let told = ran
                    .fault
                    .unwrap_or_else(|| panic!("{case}: nobody noticed"));
                assert!(!ran.refused && told.contains(words), "{case}: {told}");
            }
        }
    }
}

/// What is over within the driver's patience, and what no device was meant by, changes not one command.
#[test]
fn what_passes_within_patience_changes_no_command() {
    let part = Part::drawn(ONE_IN);
    for seed in 0..seeds() {
        let (first, count) = frames(seed);
        let whole = ran(&table(seed, "", ""));
        let commands = |ran: &Ran| {
            ran.samples
                .0
                .iter()
                .map(|sample| sample.command)
                .collect::<Vec<_>>()
        };
        let undisturbed = commands(&whole);
        for (lasts, what, old) in [
            ("cycles = 1", "kind = \"lost-reply\"", 1),
            ("cycles = 2", "kind = \"lost-request\"", 2),
            ("cycles = 1", "kind = \"late\", by_us = 3500.0", 1),
            ("cycles = 1", "kind = \"late\", by_us = 100.0", 0),
            ("cycles = 1", "kind = \"duplicate\", after_us = 50.0", 0),
            ("cycles = 1", "kind = \"duplicate\", after_us = 4200.0", 0),
            ("cycles = 1", "kind = \"swapped\"", 1),
            ("cycles = 1", "kind = \"corrupt\", byte = 20, mask = 255", 1),
            ("cycles = 1", "kind = \"corrupt\", byte = 26, mask = 1", 1),
            ("cycles = 1", "kind = \"truncated\", bytes = 40", 1),
            ("cycles = 1", "kind = \"foreign\"", 0),
            ("cycles = 1", "kind = \"stray\"", 0),
            ("cycles = 2", "kind = \"deaf\", device = 1", 2),
            ("cycles = 2", "kind = \"cut\"", 2),
            ("cycles = 1", "kind = \"cut\", behind = 0", 1),
            // Mailboxes are none of the process data.
            ("", "kind = \"silent-mailbox\", device = 1", 0),
            (
                "",
                "kind = \"sdo-abort\", device = 1, index = 0x6085, abort = 0x06010000",
                0,
            ),
            (
                "",
                "kind = \"emergencies\", device = 1, messages = 9, code = 0x6100",
                0,
            ),
        ] {
            for n in part.of(first..first + count - 6) {
                let case = format!(
                    "seed {seed}: {what} in frame {n}, {} of the program",
                    n - first
                );
                let ran = ran(&table(
                    seed,
                    &fault(&format!("cycle = {n}"), lasts, what),
                    "",
                ));
                assert_eq!(ran.fault, None, "{case}");
                assert!(
                    commands(&ran) == undisturbed,
                    "{case}: another command was sent"
                );
                let oldest = ran
                    .samples
                    .0
                    .iter()
                    .map(|sample| sample.age_periods[1])
                    .max()
                    .unwrap();
                assert_eq!(oldest, old, "{case}: age of the feedback");
                let back = ran.samples.0.last().unwrap().age_periods[1];
                assert_eq!(back, 0, "{case}: it is new again");
            }
        }
    }
}

/// An emergency stop in any period: the drives are told a ramp within their limits, and then to stop by themselves.
#[test]
fn an_emergency_stop_in_any_period_comes_to_rest_within_the_limits() {
    let part = Part::drawn(ONE_IN);
    for seed in 0..seeds() {
        let text = table(seed, "", "");
        let (_, count) = frames(seed);
        for tick in part.of(0..count - 4) {
            let case = format!("seed {seed}: at tick {tick}");
            let stop = Timed {
                tick,
                command: Order::EmergencyStop,
            };
            let ran = ran_by(&text, SHORT, Switches::default(), &[stop]);
            judge(&case, &text, &ran.samples);
            let told = ran.fault.unwrap_or_default();
            assert!(told.contains("emergency stop"), "{case}: {told}");
        }
    }
}

/// What is wrong from the start on is refused, or given up, in words that name the device.
#[test]
fn what_is_wrong_from_the_start_is_refused_in_words() {
    let always = |what: &str| fault("ms = 0.0", "", what);
    for (what, words) in [
        (
            "kind = \"refuse-state\", device = 2, state = \"safe-op\", code = 0x1d",
            "device 2 (z): it refuses SAFE-OP and is in PRE-OP: 001D",
        ),
        (
            "kind = \"refuse-state\", device = 2, state = \"safe-op\", code = 0x1e",
            "001E, invalid input configuration",
        ),
        (
            "kind = \"refuse-state\", device = 0, state = \"safe-op\", code = 0x35",
            "0035, the cycle time of SYNC0",
        ),
        (
            "kind = \"refuse-state\", device = 1, state = \"op\", code = 0x32",
            "device 1 (y): it refuses OP and is in SAFE-OP: 0032",
        ),
        (
            "kind = \"hang-state\", device = 1, state = \"op\"",
            "device 1 (y): it stays in SAFE-OP and does not come to OP",
        ),
        (
            "kind = \"hang-state\", device = 1, state = \"safe-op\"",
            "device 1 (y): it stays in PRE-OP and does not come to SAFE-OP",
        ),
        (
            "kind = \"sdo-abort\", device = 2, index = 0x60c2, sub = 1, abort = 0x06090030",
            "device 2 (z): reading 60C2:01: it refuses",
        ),
        (
            "kind = \"sdo-abort\", device = 1, index = 0x1600, sub = 1, abort = 0x06040041",
            "device 1 (y): writing 1600:01: it refuses",
        ),
        (
            "kind = \"silent-mailbox\", device = 2",
            "device 2 (z): reading 6502:00: its mailbox does not answer",
        ),
        (
            "kind = \"emergencies\", device = 2, messages = 100000, code = 0x6100",
            "device 2 (z): reading 6502:00: it sends an emergency message in place of each answer",
        ),
        (
            "kind = \"mode-shown\", device = 0, mode = 3",
            "another mode of operation (6061)",
        ),
        (
            "kind = \"never-enables\", device = 1",
            "device 1: it was told to enable, and its status (6041) stays at",
        ),
        ("kind = \"brake\", device = 1, open_ms = 6000.0", "axis Y"),
    ] {
        let text = table(3, &always(what), "");
        let ran = ran(&text);
        let told = ran
            .fault
            .unwrap_or_else(|| panic!("{what}: nobody noticed"));
        assert!(told.contains(words), "{what}: {told}");
        assert!(
            ran.samples
                .0
                .windows(2)
                .all(|pair| pair[0].command == pair[1].command),
            "{what}: it moved"
        );
    }
    let slow = ran(&table(
        3,
        &always("kind = \"brake\", device = 1, open_ms = 3000.0"),
        "",
    ));
    assert_eq!(slow.fault, None, "a brake of 3 s is waited for");
}

/// Another bus than the machine file's is refused, with what is there.
#[test]
fn another_bus_is_refused_with_what_is_there() {
    let text = table(4, "", "");
    let emulated = "[[drivers.bus.options.emulated.devices]]\n";
    let of_file = "[[drivers.bus.options.devices]]\nposition = 1\n";
    let count = text.matches(emulated).count();
    let there = |devices: usize| {
        format!("{devices} devices are on the bus, and the machine file has {count}")
    };
    let (one_less, one_more) = (there(count - 1), there(count + 1));
    for (case, changed, words) in [
        (
            "one device less",
            text.replacen(&format!("{emulated}kind = \"digital-inputs\"\n"), "", 1),
            one_less.as_str(),
        ),
        (
            "one more",
            format!("{text}{emulated}kind = \"coupler\"\n"),
            one_more.as_str(),
        ),
        (
            "swapped",
            {
                let terminal = format!("{emulated}kind = \"digital-inputs\"\n");
                let without = text.replacen(&terminal, "", 1);
                without.replacen(emulated, &format!("{terminal}{emulated}"), 1)
            },
            "device 0 (x): its vendor is 0x0002, and the machine file wants 0x0e1a",
        ),
        (
            "vendor",
            text.replacen("0x0e1a:0x0402", "0x0e1b:0x0402", 1),
            "device 0 (x): its vendor is 0x0e1a",
        ),
        (
            "product",
            text.replacen("0x0e1a:0x0402", "0x0e1a:0x0403", 1),
            "device 0 (x): its product is 0x0402",
        ),
        (
            "revision",
            text.replacen(of_file, &format!("{of_file}revision = 7\n"), 1),
            "device 1 (y): its revision is 0x1, and the machine file wants 0x7",
        ),
        (
            "alias",
            text.replacen(
                of_file,
                "[[drivers.bus.options.devices]]\nalias = 1001\n",
                1,
            ),
            "devices[1]: no device on the bus has the alias 1001",
        ),
    ] {
        let told = ran(&changed)
            .fault
            .unwrap_or_else(|| panic!("{case}: nobody noticed"));
        assert!(told.contains(words), "{case}: {told}");
    }
}

/// The same run again is the same run: every sample to the bit, with clocks that drift too.
#[test]
fn runs_repeat_to_the_bit() {
    for options in ["", "sync = \"dc\"\nphase_us = 250.0"] {
        let text = table(5, "", options).replacen(
            "kind = \"drive\"\n",
            "kind = \"drive\"\ndrift_ppm = 80.0\n",
            1,
        );
        let (one, two) = (ran(&text), ran(&text));
        assert_eq!(one.fault, None, "{options}");
        assert!(one.samples.0.len() > 20);
        assert!(
            format!("{:?}", one.samples.0) == format!("{:?}", two.samples.0),
            "{options}"
        );
    }
}

fn example() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/machines/ethercat.toml")
}

/// Homes the example machine by its drives and runs a program on it.
fn run_on_the_example(text: &str) -> Ran {
    let machine = Machine::read(&example(), &[]).unwrap();
    let switches = Switches {
        home: Some(tandem_session::HOMING),
        ..Switches::default()
    };
    let run = Run::prepare(machine, &registry(), program(text), switches)
        .unwrap_or_else(|error| panic!("{error}"));
    let mut samples = Samples::default();
    let outcome = run.drive(Clock::Virtual, &[], &mut samples).unwrap();
    assert_eq!(
        (
            outcome.summary.limit_violations,
            outcome.summary.guard_stops
        ),
        (0, 0)
    );
    Ran {
        samples,
        fault: outcome.summary.fault,
        refused: false,
    }
}

/// The whole tower: drives that home themselves, programs, a spindle that is waited for.
#[test]
fn the_example_machine_homes_and_runs_the_example_programs() {
    for name in ["square", "spiral", "serpentine", "raster"] {
        let program = example().with_file_name(format!("../programs/{name}.ngc"));
        let program = std::fs::read_to_string(program).unwrap();
        let ran = run_on_the_example(&program.replacen("G64", "M3 S3000\nG64", 1));
        assert_eq!(ran.fault, None, "{name}");
        let last = ran.samples.0.last().unwrap();
        for axis in 0..3 {
            let away = (last.feedback[axis] - last.command[axis]).abs();
            // Feedback is a period behind, and a drive settles for some more.
            assert!(away < 0.02, "{name}: axis {axis} stands {away} mm off");
        }
    }
}

/// The probe closes an input of every drive: what each caught at the edge is the point.
#[test]
fn the_example_machine_touches_off() {
    let ran = run_on_the_example("G21 G90 G94 F300\nG38.2 Z-30\nG1 Z5\nM2\n");
    assert_eq!(ran.fault, None);
    let lowest = ran
        .samples
        .0
        .iter()
        .map(|sample| sample.command[2])
        .fold(f64::INFINITY, f64::min);
    assert!(
        (-20.5..-20.0).contains(&lowest),
        "the plate is at -20 mm: {lowest}"
    );
}

/// A fault in mid-program, its reset, and on: as an operator does it, through the command.
#[test]
fn a_fault_is_reset_and_the_machine_goes_on() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("machine.toml");
    let what = "kind = \"drive-fault\", device = 1, code = 0x7305, stays = false";
    std::fs::write(
        &path,
        std::fs::read_to_string(example()).unwrap() + &fault("ms = 14000.0", "", what),
    )
    .unwrap();
    let tandem = |arguments: &[&str], input: &str| {
        let mut child = Command::new(env!("CARGO_BIN_EXE_tandem"))
            .args(arguments)
            .arg("--machine")
            .arg(&path)
            .args(["--home", "--clock", "virtual"])
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        child
            .stdin
            .take()
            .unwrap()
            .write_all(input.as_bytes())
            .unwrap();
        let output = child.wait_with_output().unwrap();
        let told =
            String::from_utf8_lossy(&output.stdout) + String::from_utf8_lossy(&output.stderr);
        (output.status.code(), told.to_string())
    };
    let words = "fault: driver bus (ethercat): the drive of axis Y reports fault 0x7305 (device 1: encoder 1)";
    let (status, told) = tandem(&["mdi"], "G90 G1 X30 F600\n!reset\nG1 X5 Y2\nquit\n");
    assert!(told.contains(words), "{told}");
    assert!(
        told.contains("x_mm 5.0000  y_mm 2.0000  z_mm 0.0000"),
        "{told}"
    );
    assert_eq!(status, Some(0), "{told}");
    let (status, told) = tandem(&["run", "-"], "G21 G90 G94 F300\nG1 X30\nM2\n");
    assert!(
        status == Some(3) && told.contains(words),
        "{status:?} {told}"
    );
}
