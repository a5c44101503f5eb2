//! The driver against the emulator, exchange by exchange on virtual time.

use crate::common;

use tandem_ethercat::{EthercatDrives, Options};
use tandem_ethercat_emulator::{AlCode, AlState, DriveState, What};
use tandem_sdk::{
    Arm, Attached, AxisVector, Driver, DriverContext, Feedback, JointState, Latch, Name,
    PluginOptions, Setpoint,
};

const PERIOD_S: f64 = 0.001;
/// Counts for a mm, or for a rad times 2π.
const COUNTS: f64 = 8388.608;

pub struct Rig {
    pub driver: EthercatDrives,
    pub setpoint: Setpoint,
    pub feedback: Feedback,
    pub attached: Attached,
}

pub fn drive(position: u32, joint: &str, more: &str) -> String {
    format!(
        "[[devices]]\nposition = {position}\nproduct = \"0x0e1a:0x0402\"\njoint = \"{joint}\"\ncounts_per_mm = {COUNTS}\n{more}\n"
    )
}

pub fn emulated(more: &str) -> String {
    format!("[[emulated.devices]]\nkind = \"drive\"\n{more}\n")
}

impl Rig {
    pub fn open(text: &str, names: &[&str]) -> (EthercatDrives, DriverContext) {
        let options = Options::read(&format!("interface = \"emulated\"\n{text}")).unwrap();
        let driver = EthercatDrives::new(&options).unwrap();
        let mut context = DriverContext::new(names.len(), PERIOD_S);
        for (joint, name) in context.joints.iter_mut().zip(names) {
            joint.name = Name::new(name);
        }
        (driver, context)
    }

    pub fn of(text: &str, names: &[&str]) -> Self {
        let (driver, context) = Self::open(text, names);
        Self::with(driver, &context)
    }

    pub fn with(mut driver: EthercatDrives, context: &DriverContext) -> Self {
        driver.open(context).unwrap();
        let attached = driver.start().unwrap();
        Self::started(driver, attached)
    }

    pub fn started(driver: EthercatDrives, attached: Attached) -> Self {
        let (setpoint, feedback) = common::begin(&attached);
        Self {
            driver,
            setpoint,
            feedback,
            attached,
        }
    }

    pub fn exchange(&mut self) {
        self.setpoint.tick += 1;
        self.driver
            .exchange(&self.setpoint, &mut self.feedback)
            .unwrap();
        self.setpoint.reset = 0;
    }

    /// Until joint 0 is in a state; fails after 2 s.
    pub fn until(&mut self, state: JointState) {
        for _ in 0..2000 {
            self.exchange();
            if self.feedback.state[0] == state {
                return;
            }
        }
        panic!(
            "it stays {:?} {:x}",
            self.feedback.state[0], self.feedback.fault_code[0]
        );
    }

    pub fn enable(&mut self) {
        self.setpoint.enable = 1;
        self.until(JointState::Enabled);
        self.setpoint.position = self.feedback.position;
    }

    /// Moves joint 0 by so much in every period.
    pub fn go(&mut self, step: f64) {
        self.setpoint.position[0] += step;
        self.setpoint.velocity[0] = step / PERIOD_S;
        self.exchange();
    }

    fn latch(&self) -> Option<Latch> {
        self.feedback
            .latches
            .iter()
            .find(|latch| latch.edge != 0)
            .copied()
    }

    pub fn emulator<T>(
        &mut self,
        look: impl FnOnce(&mut tandem_ethercat_emulator::Wire) -> T,
    ) -> T {
        self.driver.with_emulator(look).unwrap()
    }

    pub fn inject(&mut self, what: What) {
        self.emulator(|wire| wire.inject(what, None)).unwrap();
    }

    pub fn drive_state(&mut self) -> (AlState, Option<AlCode>, DriveState) {
        self.emulator(|wire| {
            let device = &wire.bus().devices()[0];
            (
                device.al_state(),
                device.al_code(),
                device.drive_state().unwrap(),
            )
        })
    }

    fn place_mm(&mut self) -> f64 {
        self.emulator(|wire| {
            wire.bus().devices()[0]
                .position_and_velocity_counts()
                .unwrap()
                .0
                / COUNTS
        })
    }
}

/// A probe's edge in each period of a motion, and between periods: the position is the drive's, whenever the edge comes.
#[test]
fn an_edge_in_any_period_is_told_once_with_the_drives_own_position() {
    for edge in 0..40 {
        let at_mm = 1.0 + f64::from(edge) * 0.0137;
        let probe = drive(0, "x", "probe = { input = 5, latch = 1 }");
        let probes = format!("drive = {{ probes_counts = [{:?}, 1e12] }}", at_mm * COUNTS);
        let mut rig = Rig::of(&format!("{probe}{}", emulated(&probes)), &["x"]);
        rig.enable();
        rig.setpoint.arm = Arm { input: 5, edge: 1 };
        (0..5).for_each(|_| rig.exchange());
        let mut caught = vec![];
        for _ in 0..200 {
            rig.go(0.01);
            caught.extend(rig.latch());
        }
        // Back and over it again: it is not armed anew.
        for step in [-0.01, 0.01] {
            for _ in 0..150 {
                rig.go(step);
                caught.extend(rig.latch());
            }
        }
        assert_eq!(caught.len(), 1, "{at_mm}: {caught:?}");
        let latch = caught[0];
        assert_eq!((latch.input, latch.edge, latch.joints), (5, 1, 1));
        assert!(
            (latch.position[0] - at_mm).abs() < 2.0 / COUNTS,
            "{at_mm}: {}",
            latch.position[0]
        );
        assert!((0.0..0.004).contains(&latch.before_s), "{}", latch.before_s);
        // A second touch, armed anew.
        rig.setpoint.arm = Arm::default();
        (0..150).for_each(|_| rig.go(-0.01));
        rig.setpoint.arm = Arm { input: 5, edge: 1 };
        (0..5).for_each(|_| rig.exchange());
        let second = (0..200).filter_map(|_| {
            rig.go(0.01);
            rig.latch()
        });
        assert_eq!(second.count(), 1, "{at_mm}: the second touch");
        // Armed behind the edge, nothing comes.
        rig.setpoint.arm = Arm::default();
        (0..5).for_each(|_| rig.exchange());
        rig.setpoint.arm = Arm { input: 5, edge: 1 };
        let late = (0..100).filter(|_| {
            rig.go(0.01);
            rig.latch().is_some()
        });
        assert_eq!(late.count(), 0, "{at_mm}: armed too late");
    }
}

#[test]
fn counts_go_on_past_the_end_of_32_bits_both_ways() {
    for (start, step) in [
        (i64::from(i32::MAX) - 2000, 0.01),
        (i64::from(i32::MIN) + 2000, -0.01),
    ] {
        let of_drive = drive(0, "x", &format!("zero_counts = {start}"));
        let place = emulated(&format!("drive = {{ position_counts = {start}.0 }}"));
        let mut rig = Rig::of(&format!("{of_drive}{place}"), &["x"]);
        assert_eq!(rig.attached.position[0], 0.0);
        rig.enable();
        (0..100).for_each(|_| rig.go(step));
        rig.setpoint.velocity[0] = 0.0;
        (0..100).for_each(|_| rig.exchange());
        let moved = rig.feedback.position[0];
        assert!((moved - 100.0 * step).abs() < 2.0 / COUNTS, "{moved}");
        let really = rig.place_mm() - start as f64 / COUNTS;
        assert!(
            (really - 100.0 * step).abs() < 2.0 / COUNTS,
            "the axis itself: {really}"
        );
    }
}

/// A drive that stands anywhere does not move when it is enabled, whatever the host says before.
#[test]
fn nothing_moves_when_a_drive_is_enabled() {
    let place = emulated("drive = { position_counts = 314572.8, brake_open_ms = 50.0 }");
    let mut rig = Rig::of(&format!("{}{place}", drive(0, "x", "")), &["x"]);
    assert!((rig.attached.position[0] - 37.5).abs() < 1e-3);
    // A host that plans from elsewhere: until the joint is enabled its setpoint does not count.
    rig.setpoint.position[0] = 0.0;
    rig.setpoint.enable = 1;
    let mut farthest = 0.0_f64;
    while rig.feedback.state[0] != JointState::Enabled {
        rig.exchange();
        let place_mm = rig.place_mm();
        farthest = farthest.max((place_mm - 37.5).abs());
    }
    rig.setpoint.position[0] = rig.feedback.position[0];
    for _ in 0..100 {
        rig.exchange();
        let place_mm = rig.place_mm();
        farthest = farthest.max((place_mm - 37.5).abs());
    }
    assert!(farthest < 3.0 / COUNTS, "it moved by {farthest} mm");
}

/// A drive's fault in each of its states is told with its code, stays until a reset, and is gone behind it.
#[test]
fn a_fault_in_any_state_stays_until_it_is_reset() {
    for before in [
        JointState::Disabled,
        JointState::Enabling,
        JointState::Enabled,
        JointState::QuickStop,
    ] {
        let place = emulated("drive = { brake_open_ms = 50.0 }");
        let mut rig = Rig::of(&format!("{}{place}", drive(0, "x", "")), &["x"]);
        match before {
            JointState::Disabled => rig.exchange(),
            JointState::Enabling => {
                rig.setpoint.enable = 1;
                (0..10).for_each(|_| rig.exchange());
            }
            _ => rig.enable(),
        }
        if before == JointState::QuickStop {
            (0..50).for_each(|_| rig.go(0.05));
            rig.driver.quick_stop();
            (0..3).for_each(|_| rig.exchange());
        }
        assert_eq!(rig.feedback.state[0], before);
        rig.inject(What::DriveFault {
            device: 0,
            code: 0x7305,
            stays: false,
        });
        rig.until(JointState::Fault);
        assert_eq!(rig.feedback.fault_code[0], 0x7305, "{before:?}");
        assert_eq!(
            rig.driver.explain(0, 0x7305).as_str(),
            "device 0: encoder 1"
        );
        for enable in [1, 0, 1, 0] {
            rig.setpoint.enable = enable;
            rig.setpoint.position = rig.feedback.position;
            rig.setpoint.velocity = AxisVector::ZERO;
            for _ in 0..20 {
                rig.exchange();
                assert_eq!(
                    rig.feedback.state[0],
                    JointState::Fault,
                    "{before:?}: without a reset"
                );
            }
        }
        rig.setpoint.reset = 1;
        rig.until(JointState::Disabled);
        rig.enable();
    }
}

/// How a drive comes to where a fault meets it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Way {
    /// It is enabled.
    Up,
    /// It moves, and is stopped.
    QuickStop,
    /// It moves, and has another fault.
    Fault,
}

/// The same behind any exchange on the way up, in a quick stop and in the reaction to another fault, so that each state of CiA 402 has
/// had one.
#[test]
fn a_fault_in_each_state_of_cia_402_is_told_by_its_code() {
    let mut met = vec![];
    let fault = |code: u16| What::DriveFault {
        device: 0,
        code,
        stays: false,
    };
    let mut meets = |way: Way, exchanges: u32| {
        let place = emulated(
            "drive = { brake_open_ms = 20.0, quick_stop_deceleration_counts_per_s2 = 4000000 }",
        );
        let mut rig = Rig::of(&format!("{}{place}", drive(0, "x", "")), &["x"]);
        if way == Way::Up {
            rig.setpoint.enable = u32::from(exchanges > 0);
        } else {
            rig.enable();
            (0..100).for_each(|_| rig.go(0.05));
        }
        match way {
            Way::Up => {}
            Way::QuickStop => rig.driver.quick_stop(),
            Way::Fault => rig.inject(fault(0x7305)),
        }
        (0..exchanges).for_each(|_| rig.exchange());
        let state = rig.drive_state().2;
        if !met.contains(&state) {
            met.push(state);
        }
        rig.inject(fault(0x8611));
        (0..200).for_each(|_| rig.exchange());
        assert_eq!(rig.feedback.state[0], JointState::Fault, "{state:?}");
        // In a fault, and on its way there, it is the first one that it shows, or the last.
        let is_in_fault = matches!(state, DriveState::FaultReactionActive | DriveState::Fault);
        let code = rig.feedback.fault_code[0];
        assert!(
            code == 0x8611 || is_in_fault && code == 0x7305,
            "{state:?}, behind {exchanges} exchanges: {code:#x}"
        );
        (rig.setpoint.reset, rig.setpoint.enable) = (1, 0);
        rig.until(JointState::Disabled);
        rig.enable();
    };
    (0..40).for_each(|exchanges| meets(Way::Up, exchanges));
    for exchanges in [2, 5, 150] {
        meets(Way::QuickStop, exchanges);
        meets(Way::Fault, exchanges);
    }
    for state in [
        DriveState::SwitchOnDisabled,
        DriveState::ReadyToSwitchOn,
        DriveState::SwitchedOn,
        DriveState::OperationEnabled,
        DriveState::QuickStopActive,
        DriveState::FaultReactionActive,
        DriveState::Fault,
    ] {
        assert!(met.contains(&state), "{state:?} is none of {met:?}");
    }
}

/// A reply that comes late, twice or out of order is never the one awaited: feedback is old where it is, and never old as new.
#[test]
fn no_reply_of_another_exchange_is_taken_for_the_one_awaited() {
    let ride = |what: Option<What>| {
        let mut rig = Rig::of(&format!("{}{}", drive(0, "x", ""), emulated("")), &["x"]);
        rig.enable();
        let mut seen = vec![];
        // As many as a number of eight bits takes to come round, and more.
        for n in 0..300 {
            if let Some(what) = what.clone().filter(|_| n == 20) {
                rig.inject(what);
            }
            rig.go(0.02);
            seen.push((rig.feedback.age_periods[0], rig.feedback.position[0]));
        }
        seen
    };
    let whole = ride(None);
    for (what, old) in [
        (What::Late { by_us: 900.0 }, 1),
        (What::Late { by_us: 1500.0 }, 1),
        (What::Late { by_us: 256_000.0 }, 1),
        (What::Duplicate { after_us: 950.0 }, 0),
        (What::Duplicate { after_us: 2001.0 }, 0),
        (What::Swapped, 1),
        (What::Foreign, 0),
        (What::Stray, 0),
        (What::LostReply, 1),
    ] {
        let seen = ride(Some(what.clone()));
        assert_eq!(
            seen.iter().map(|(age, _)| u64::from(*age)).sum::<u64>(),
            old,
            "{what:?}"
        );
        for (n, ((age, position), (_, undisturbed))) in seen.iter().zip(&whole).enumerate() {
            assert!(
                *age > 0 || position == undisturbed,
                "{what:?}: exchange {n}: {position} is not new"
            );
        }
    }
}

/// Eight drives in periods of 250 µs: one frame holds them, and they are in OP within 3 s of their power-on.
#[test]
fn eight_drives_are_up_within_three_seconds_and_exchange_every_250_us() {
    let names = ["a", "b", "c", "d", "e", "f", "g", "h"];
    for sync in ["free-run", "dc"] {
        let drives: String = (0..)
            .zip(names)
            .map(|(position, name)| drive(position, name, ""))
            .collect();
        let (driver, mut context) = Rig::open(&format!("sync = \"{sync}\"\n{drives}"), &names);
        context.fine_period_s = 250e-6;
        let mut rig = Rig::with(driver, &context);
        let up_ns = rig.emulator(|wire| wire.bus().now_ns());
        assert!(up_ns < 3_000_000_000, "{sync}: {} ms", up_ns / 1_000_000);
        println!(
            "{sync}: eight drives are in OP {} ms behind their power-on",
            up_ns / 1_000_000
        );
        rig.setpoint.enable = 1;
        (0..400).for_each(|_| rig.exchange());
        assert_eq!(rig.feedback.state, [JointState::Enabled; 8], "{sync}");
        let counters = rig.driver.counters();
        assert_eq!(
            (counters.lost, counters.short, counters.strays),
            (0, 0, 0),
            "{sync}"
        );
    }
}

/// A joint that is lost stays so until the bus is brought up anew, and is as before then.
#[test]
fn a_lost_drive_stays_lost_until_the_bus_is_brought_up_again() {
    let mut rig = Rig::of(&format!("{}{}", drive(0, "x", ""), emulated("")), &["x"]);
    rig.enable();
    (0..100).for_each(|_| rig.go(0.02));
    rig.inject(What::AlError {
        device: 0,
        state: AlState::SafeOp,
        code: AlCode::FATAL_SYNC_ERROR,
    });
    rig.setpoint.velocity = AxisVector::ZERO;
    rig.until(JointState::Lost);
    assert_eq!(rig.feedback.fault_code[0], 0x1_002C);
    assert!(
        rig.driver
            .explain(0, 0x1_002C)
            .as_str()
            .contains("it left OP: 002C, fatal synchronization error")
    );
    rig.setpoint.reset = 1;
    for _ in 0..50 {
        rig.exchange();
        assert_eq!(rig.feedback.state[0], JointState::Lost);
    }
    rig.driver.stop().unwrap();
    let attached = rig.driver.start().unwrap();
    assert_eq!(
        attached.state[0],
        JointState::Fault,
        "its drive says why it stopped"
    );
    (rig.setpoint, rig.feedback) = (
        Setpoint {
            position: attached.position,
            ..Setpoint::default()
        },
        Feedback::default(),
    );
    rig.setpoint.reset = 1;
    rig.until(JointState::Disabled);
    rig.enable();
    (0..50).for_each(|_| rig.go(0.02));
}

/// The devices' own watchdog stops the drives where the master falls silent: it was set to `watchdog_ms`.
#[test]
fn a_master_that_falls_silent_is_noticed_after_its_watchdog_ms() {
    let mut rig = Rig::of(
        &format!("watchdog_ms = 7\n{}{}", drive(0, "x", ""), emulated("")),
        &["x"],
    );
    rig.enable();
    (0..50).for_each(|_| rig.go(0.02));
    let now_ns = rig.emulator(|wire| wire.bus().now_ns());
    rig.emulator(|wire| wire.advance(now_ns + 6_500_000));
    assert_eq!(
        rig.drive_state(),
        (AlState::Op, None, DriveState::OperationEnabled)
    );
    rig.emulator(|wire| wire.advance(now_ns + 7_600_000));
    let (state, code, _) = rig.drive_state();
    assert_eq!((state, code), (AlState::SafeOp, Some(AlCode::WATCHDOG)));
}

#[test]
fn quick_stop_ramps_by_the_drive_and_holds_until_it_is_let_go() {
    let mut rig = Rig::of(&format!("{}{}", drive(0, "x", ""), emulated("")), &["x"]);
    rig.enable();
    (0..200).for_each(|_| rig.go(0.05));
    rig.driver.quick_stop();
    for _ in 0..200 {
        rig.go(0.05);
    }
    let velocity = rig.emulator(|wire| {
        wire.bus().devices()[0]
            .position_and_velocity_counts()
            .unwrap()
            .1
    });
    assert!(
        velocity.abs() < 10.0,
        "it still moves by {velocity} counts/s"
    );
    assert_ne!(rig.feedback.state[0], JointState::Enabled);
    assert_eq!(rig.feedback.fault_code[0], 0);
    rig.setpoint.enable = 0;
    rig.setpoint.velocity = AxisVector::ZERO;
    rig.until(JointState::Disabled);
    rig.enable();
}

/// What a drive does on a quick stop is its own: over which ramp, and whether it holds behind it.
#[test]
fn a_quick_stop_is_the_drives_own_whatever_its_option() {
    for (option, holds) in [(1, false), (2, false), (5, true), (6, true)] {
        let startup = format!("startup = [{{ sdo = \"0x605a\", i16 = {option} }}]");
        let mut rig = Rig::of(
            &format!("{}{}", drive(0, "x", &startup), emulated("")),
            &["x"],
        );
        rig.enable();
        (0..200).for_each(|_| rig.go(0.05));
        rig.driver.quick_stop();
        (0..200).for_each(|_| rig.go(0.05));
        let stands_mm = rig.place_mm();
        let (_, _, state) = rig.drive_state();
        assert_eq!(
            state == DriveState::QuickStopActive,
            holds,
            "option {option}: {state:?}"
        );
        (0..50).for_each(|_| rig.go(0.05));
        let moved_mm = rig.place_mm() - stands_mm;
        assert!(
            moved_mm.abs() < 3.0 / COUNTS,
            "option {option}: it moved on by {moved_mm} mm"
        );
        rig.setpoint.enable = 0;
        rig.setpoint.velocity = AxisVector::ZERO;
        rig.until(JointState::Disabled);
        rig.enable();
        let jump_mm = rig.place_mm() - stands_mm;
        assert!(
            jump_mm.abs() < 3.0 / COUNTS,
            "option {option}: it jumped by {jump_mm} mm"
        );
    }
}

/// What drives do by themselves is compared with the machine file before anything is enabled.
#[test]
fn what_a_drive_does_by_itself_is_compared_with_the_machine_file() {
    let of_drive = |number: u16, index: u16| {
        let [low, high] = number.to_le_bytes();
        emulated(&format!(
            "objects = [{{ index = {index}, sub = 0, value = [{low}, {high}], writable = true }}]"
        ))
    };
    let start = |of_machine: &str, of_drive: &str| {
        let (mut driver, context) =
            Rig::open(&format!("{}{of_drive}", drive(0, "x", of_machine)), &["x"]);
        driver.open(&context).unwrap();
        driver
            .start()
            .err()
            .map(|error| error.message().to_string())
    };
    for (of_machine, of_drive, words) in [
        (
            "",
            of_drive(0, 0x605E),
            "what it does on a fault (605E) is 0, no torque, so that the axis runs out; set it with startup",
        ),
        (
            "",
            of_drive(0, 0x6007),
            "what it does when the bus is lost (6007) is 0, nothing",
        ),
        ("", of_drive(2, 0x6007), "(6007) is 2, no torque"),
        (
            "reactions = { quick_stop = 6 }",
            emulated(""),
            "(605A) is 2, the ramp of a quick stop (6085); the machine file wants 6",
        ),
        (
            "reactions = { shutdown = 0 }",
            emulated(""),
            "what it does on a shutdown (605B) is 1",
        ),
        ("reactions = { disable = 0 }", emulated(""), "(605C) is 1"),
        (
            "reactions = { halt = 4 }",
            emulated(""),
            "(605D) is 1, its ramp (6084); the machine file wants 4",
        ),
    ] {
        let refused =
            start(of_machine, &of_drive).unwrap_or_else(|| panic!("{words}: it was let in"));
        assert!(
            refused.contains("device 0 (x)") && refused.contains(words),
            "{refused}"
        );
    }
    for (of_machine, of_drive) in [
        ("reactions = { fault = 0 }", of_drive(0, 0x605E)),
        (
            "startup = [{ sdo = \"0x605e\", i16 = 1 }]",
            of_drive(0, 0x605E),
        ),
        (
            "reactions = { quick_stop = 6, shutdown = 1, disable = 1, halt = 1, fault = 2, bus_lost = 1 }\n\
             startup = [{ sdo = \"0x605a\", i16 = 6 }]",
            emulated(""),
        ),
    ] {
        assert_eq!(start(of_machine, &of_drive), None, "{of_machine}");
    }
}

/// Terminals: bits and words of any device are the lines and values that the options name.
#[test]
fn lines_and_analog_values_of_terminals() {
    let text = "[[devices]]\nposition = 0\nproduct = \"0x0e1a:0x0402\"\njoint = \"x\"\ncounts_per_mm = 1000\n\
                [[devices]]\nposition = 1\nproduct = \"2:0x03f03052\"\ninputs = [-1, 7, 2]\n\
                [[devices]]\nposition = 2\nproduct = \"2:0x07d83052\"\noutputs = [4, -1, 1]\n\
                [[devices]]\nposition = 3\nproduct = \"2:0x0bbc3052\"\nanalog = [{ input = 1, byte = 2, scale = 0.5, offset = 3 }]\n";
    let mut rig = Rig::of(text, &["x"]);
    rig.emulator(|wire| {
        wire.bus_mut().device_mut(1).unwrap().set_input(1, true);
        wire.bus_mut()
            .device_mut(3)
            .unwrap()
            .set_analog_input(0, -100);
    });
    rig.setpoint.outputs = 1 << 1 | 1 << 63;
    (0..5).for_each(|_| rig.exchange());
    assert_eq!(rig.feedback.inputs, 1 << 7);
    assert_eq!(rig.feedback.analog[1], -47.0);
    let outputs = rig.emulator(|wire| {
        let device = &wire.bus().devices()[2];
        [0, 1, 2].map(|output| device.output(output).unwrap())
    });
    assert_eq!(outputs, [false, false, true]);
}

/// Options that go with no machine, or not with this one, are refused with the key.
#[test]
fn options_are_refused_with_their_key() {
    let refused = |text: &str| {
        let options = Options::read(text).unwrap();
        let of_machine = |driver: EthercatDrives| {
            let (_, context) = Rig::open(&drive(0, "x", ""), &["x"]);
            driver.check(&context).err()
        };
        let error = EthercatDrives::new(&options)
            .map_or_else(Some, of_machine)
            .unwrap();
        (
            error.option().unwrap_or_default().to_string(),
            error.message().to_string(),
        )
    };
    let ok = format!("interface = \"emulated\"\n{}", drive(0, "x", ""));
    let with = |from: &str, to: &str| refused(&ok.replace(from, to));
    assert_eq!(refused("").0, "interface");
    assert_eq!(with("0x0e1a:0x0402", "0e1a").0, "devices[0].product");
    assert_eq!(with("position = 0", "").0, "devices[0]");
    assert_eq!(
        with("position = 0", "position = 4").0,
        "devices[0].position"
    );
    assert_eq!(
        with("joint = \"x\"", "joint = \"q\"").1,
        "\"q\": this driver's joints are x"
    );
    assert_eq!(
        with(&format!("counts_per_mm = {COUNTS}"), "counts_per_turn = 3").0,
        "devices[0]"
    );
    assert_eq!(
        with("[[devices]]", "watchdog_ms = 1\n[[devices]]").0,
        "watchdog_ms"
    );
    assert_eq!(
        with("[[devices]]", "phase_us = 1000\n[[devices]]").0,
        "phase_us"
    );
    let startup = "joint = \"x\"\nstartup = [{ sdo = \"6o85\", u32 = 1 }]";
    assert_eq!(
        with("joint = \"x\"", startup).0,
        "devices[0].startup[0].sdo"
    );
    let startup = "joint = \"x\"\nstartup = [{ sdo = \"0x6085\", u32 = 1, i8 = 1 }]";
    assert_eq!(with("joint = \"x\"", startup).0, "devices[0].startup[0]");
    assert_eq!(
        with(
            "interface = \"emulated\"",
            "interface = \"eth9\"\nemulated = {}"
        )
        .0,
        "emulated"
    );
}
