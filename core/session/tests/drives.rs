//! Drives that demand something: that stand anywhere, know nothing, home themselves, and stay in fault from one run to the next.

use std::cell::RefCell;
use std::path::Path;
use std::sync::{Arc, Mutex};

use tandem_gcode::Program;
use tandem_host::{
    Clock, Command, HostError, Outcome, Registry, Run, RunObserver, Switches, Timed,
};
use tandem_machine::Machine;
use tandem_rings::{Sample, StopCause};
use tandem_sdk::{
    Attached, AxisVector, Driver, DriverContext, DriverDescription, Feedback, JointState,
    NoOptions, PluginError, Setpoint, local_plugin,
};
use tandem_session::jog::{Jog, JogController, JogInput, JogRest, JogSession, Reach};

const AXES: usize = 3;

/// The drives themselves, which outlive every driver. On the virtual clock everything runs on one thread.
#[derive(Clone, Default)]
struct Hardware {
    position: AxisVector,
    known: u32,
    faulty: Option<usize>,
    /// The exchange in which a drive faults.
    faults_at: u64,
    exchanges: u64,
    resets: u32,
    /// Method of each joint that its driver was told.
    methods: [i32; AXES],
    homed: u32,
    homing_for: u64,
    inputs: u64,
    /// The drives never come up.
    never_enables: bool,
    /// Exchanges between which the door is open.
    open: std::ops::Range<u64>,
    told: Vec<Setpoint>,
}

thread_local! {
    static HARDWARE: RefCell<Hardware> = RefCell::new(Hardware::default());
}

struct Cell;

impl Driver for Cell {
    fn describe(&self) -> DriverDescription {
        DriverDescription {
            hexadecimal_codes: 1,
            enable_s: 2.0,
            ..DriverDescription::simulated()
        }
    }
    fn open(&mut self, context: &DriverContext) -> Result<(), PluginError> {
        HARDWARE.with_borrow_mut(|drives| {
            drives.methods = std::array::from_fn(|joint| context.joints[joint].homing_method);
        });
        Ok(())
    }
    fn start(&mut self) -> Result<Attached, PluginError> {
        Ok(HARDWARE.with_borrow(|drives| {
            let mut attached = Attached {
                known: drives.known,
                homed: 0,
                ..Attached::at(drives.position)
            };
            if let Some(joint) = drives.faulty {
                (attached.state[joint], attached.fault_code[joint]) = (JointState::Fault, 0x7210);
            }
            attached
        }))
    }
    fn exchange(
        &mut self,
        setpoint: &Setpoint,
        feedback: &mut Feedback,
    ) -> Result<(), PluginError> {
        HARDWARE.with_borrow_mut(|drives| {
            drives.exchanges += 1;
            drives.told.push(*setpoint);
            if setpoint.reset != 0 {
                (drives.faulty, drives.resets) = (None, drives.resets + 1);
            }
            if drives.exchanges == drives.faults_at {
                drives.faulty = Some(1);
            }
            for joint in 0..AXES {
                let homes = setpoint.homing >> joint & 1 == 1;
                let state = match setpoint.enable {
                    _ if drives.faulty == Some(joint) => JointState::Fault,
                    0 => JointState::Disabled,
                    _ if drives.never_enables => JointState::Enabling,
                    _ if homes && drives.homed >> joint & 1 == 0 => JointState::Homing,
                    _ => JointState::Enabled,
                };
                feedback.state[joint] = state;
                feedback.fault_code[joint] = if state == JointState::Fault {
                    0x7210
                } else {
                    0
                };
                if state == JointState::Homing {
                    drives.homing_for += 1;
                    drives.position[joint] += 0.01;
                    if drives.homing_for > 100 {
                        (drives.position[joint], drives.homing_for) = (-7.5, 0);
                        drives.homed |= 1 << joint;
                        drives.known |= 1 << joint;
                        feedback.state[joint] = JointState::Enabled;
                    }
                } else if state == JointState::Enabled && !homes {
                    drives.position[joint] = setpoint.position[joint];
                }
            }
            feedback.homed = drives.homed;
            feedback.position = drives.position;
            feedback.inputs = if drives.open.contains(&drives.exchanges) {
                0
            } else {
                drives.inputs
            };
        });
        Ok(())
    }
    fn quick_stop(&mut self) {}
    fn stop(&mut self) -> Result<(), PluginError> {
        Ok(())
    }
    fn explain(&self, _joint: u32, code: u32) -> tandem_sdk::Words {
        tandem_sdk::Words::new(if code == 0x7210 { "overvoltage" } else { "" })
    }
}

fn set(change: impl FnOnce(&mut Hardware)) {
    HARDWARE.with_borrow_mut(|drives| {
        *drives = Hardware {
            known: 7,
            inputs: u64::MAX,
            ..Hardware::default()
        };
        change(drives);
    });
}

fn hardware() -> Hardware {
    HARDWARE.with_borrow(Clone::clone)
}

fn registry() -> Registry {
    let mut registry = Registry::default();
    registry.register(tandem_look_ahead::PLUGIN).unwrap();
    registry
        .register(local_plugin!(driver "cell" = |_: &NoOptions| Ok(Cell)))
        .unwrap();
    registry
}

fn machine(settings: &[(&str, &str)]) -> Machine {
    let path =
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/machines/mill-3axis.toml");
    let own = [("driver.plugin", "cell")];
    let settings: Vec<_> = own
        .iter()
        .chain(settings)
        .map(|(k, v)| ((*k).to_string(), (*v).to_string()))
        .collect();
    Machine::read(&path, &settings).unwrap()
}

/// Keeps why the machine stood.
#[derive(Default)]
struct Watch {
    causes: Vec<StopCause>,
    notes: Vec<String>,
}

impl RunObserver for Watch {
    fn sample(&mut self, sample: &Sample, _deviation_mm: f64, _signals: &[f64]) {
        self.causes.push(sample.cause);
    }
    fn note(&mut self, note: &str) {
        self.notes.push(note.to_string());
    }
}

fn prepare(text: &str, settings: &[(&str, &str)], switches: Switches) -> Result<Run, HostError> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("program.ngc");
    std::fs::write(&path, text).unwrap();
    Run::prepare(
        machine(settings),
        &registry(),
        Program::open(&path).unwrap(),
        switches,
    )
}

fn refusal(text: &str, settings: &[(&str, &str)], switches: Switches) -> String {
    prepare(text, settings, switches)
        .err()
        .map(|error| error.to_string())
        .expect("it is refused")
}

fn drive(run: Run, commands: &[Timed]) -> (Outcome, Watch) {
    let mut watch = Watch::default();
    let outcome = run.drive(Clock::Virtual, commands, &mut watch).unwrap();
    (outcome, watch)
}

const WORK: &str = "G21 G90 G53 G0 X0 Y0 Z0\nM3 S1000\nF3000\nG1 X60\nM2\n";

/// Asks for one jog after the other.
#[derive(Clone)]
struct Script {
    jogs: Vec<Jog>,
    said: Arc<Mutex<Vec<String>>>,
}

impl JogInput for Script {
    fn period(&mut self, jogs: &JogController) {
        if !jogs.is_ready() || !jogs.is_still() {
            return;
        }
        if self.jogs.is_empty() {
            return jogs.end();
        }
        let asked = jogs.ask(self.jogs.remove(0));
        self.said
            .lock()
            .unwrap()
            .push(asked.err().unwrap_or_else(|| "taken".to_string()));
    }
    fn is_waiting(&self) -> bool {
        false
    }
    fn rested(&mut self, _: &JogController, _: &JogRest) {}
    fn refused(&mut self, why: &str) {
        self.said.lock().unwrap().push(why.to_string());
    }
}

/// What is said of these jogs of X, each by a distance in mm at a feed in mm/min; waits for the joints to hold first.
fn jog(asked: &[(f64, f64)]) -> Vec<String> {
    let by = |(distance_mm, feed): &(f64, f64)| Jog {
        axis: 0,
        reach: Reach::By {
            distance_mm: *distance_mm,
        },
        feed_mm_per_s: feed / 60.0,
    };
    let said = Arc::new(Mutex::new(vec![]));
    // The first one is asked for where the machine file has the axis: it wakes the machine up.
    let hand = Script {
        jogs: asked.iter().map(by).collect(),
        said: Arc::clone(&said),
    };
    let (registry, switches) = (
        registry(),
        Switches {
            unhomed: true,
            ..Switches::default()
        },
    );
    let session = JogSession::new(machine(&[]), &registry, switches, Box::new(hand)).unwrap();
    let (outcome, _) = drive(session.enable().unwrap(), &[]);
    assert_eq!(outcome.summary.fault, None);
    said.lock().unwrap().clone()
}

#[test]
fn an_axis_outside_of_its_travel_is_jogged_inward_only_and_runs_no_program() {
    set(|drives| drives.position[0] = 260.0);
    let words = refusal(WORK, &[], Switches::default());
    assert!(words.contains(
        "where the machine starts, joint x would reach 260 mm, beyond its travel of -250 to 250"
    ));
    let said = jog(&[
        (0.5, 600.0),
        (-3.0, 600.0),
        (1.0, 600.0),
        (-20.0, 600.0),
        (-600.0, 600.0),
    ]);
    assert!(
        said.iter()
            .any(|word| word.contains("x would reach 258 mm, beyond its travel")),
        "{said:?}"
    );
    assert!(
        (hardware().position[0] - 237.0).abs() < 1e-9,
        "{:?} {said:?}",
        hardware().position
    );
    let told = hardware().told;
    let highest = told
        .iter()
        .map(|told| told.position[0])
        .fold(f64::MIN, f64::max);
    assert!(highest <= 260.0, "{highest}");
}

#[test]
fn an_axis_that_does_not_know_where_it_is_is_jogged_slowly_and_runs_no_program() {
    set(|drives| drives.known = 0b110);
    let words = refusal(WORK, &[], Switches::default());
    assert!(
        words
            .contains("it is not known where x stands: home the machine first, or run with --home"),
        "{words}"
    );
    let home = Switches {
        home: Some(tandem_session::HOMING),
        ..Switches::default()
    };
    let words = refusal(WORK, &[("homing.y", "{drive_method = 35}")], home);
    assert!(
        words.contains("it is not known where x stands, and no [homing.<axis>] table homes it"),
        "{words}"
    );
    let said = jog(&[(5.0, 1600.0), (5.0, 1500.0)]);
    let slow = "it is not known where x stands: until it is homed its feed is at most 1500 mm/min, not 1600 mm/min";
    assert_eq!(said, [slow, "taken"]);
    assert!((hardware().position[0] - 5.0).abs() < 1e-9);
}

#[test]
fn a_drive_homes_its_axis_and_the_program_begins_there() {
    set(|drives| (drives.position[0], drives.known) = (123.0, 0b110));
    let homing = [("homing.x", "{drive_method = 35}"), ("axes.x.home_mm", "4")];
    let (outcome, _) = drive(
        Run::home(
            machine(&homing),
            &registry(),
            tandem_session::HOMING,
            Switches::default(),
        )
        .unwrap(),
        &[],
    );
    assert_eq!(
        (outcome.summary.fault, hardware().methods),
        (None, [35, 0, 0])
    );
    assert!(
        (hardware().position[0] - 4.0).abs() < 1e-9,
        "{:?}",
        hardware().position
    );
    assert!(
        outcome.summary.max_velocity_mm_s["x"] <= 250.0 * (1.0 + 1e-6),
        "{:?}",
        outcome.summary.max_velocity_mm_s
    );
    set(|drives| (drives.position[0], drives.known) = (-300.0, 0b110));
    let home = Switches {
        home: Some(tandem_session::HOMING),
        ..Switches::default()
    };
    let (outcome, _) = drive(prepare(WORK, &homing, home).unwrap(), &[]);
    assert_eq!(outcome.summary.fault, None);
    assert!(
        (hardware().position[0] - 60.0).abs() < 1e-9,
        "{:?}",
        hardware().position
    );
    let told = hardware().told;
    assert!(told.iter().filter(|told| told.homing == 1).count() > 100);
}

#[test]
fn a_fault_that_outlives_a_run_is_reset_by_the_operator_and_only_then() {
    set(|drives| drives.faults_at = 300);
    let (outcome, _) = drive(prepare(WORK, &[], Switches::default()).unwrap(), &[]);
    let words = outcome.summary.fault.unwrap();
    assert!(
        words.contains("the drive of axis Y reports fault 0x7210 (overvoltage)"),
        "{words}"
    );
    for _ in 0..3 {
        let words = refusal(WORK, &[], Switches::default());
        assert!(
            words
                .contains("the drive of y stands in fault 0x7210 (overvoltage); --reset clears it"),
            "{words}"
        );
    }
    assert_eq!(hardware().resets, 0);
    let (outcome, _) = drive(
        prepare(
            WORK,
            &[],
            Switches {
                reset: true,
                ..Switches::default()
            },
        )
        .unwrap(),
        &[],
    );
    assert_eq!((outcome.summary.fault, hardware().resets), (None, 1));
}

#[test]
fn a_reset_in_a_session_reaches_the_drives() {
    for round in 1..=20_u64 {
        set(|drives| drives.faults_at = 20 * round);
        let go = Jog {
            axis: 0,
            reach: Reach::By { distance_mm: 20.0 },
            feed_mm_per_s: 50.0,
        };
        let said = Arc::new(Mutex::new(vec![]));
        let hand = Script {
            jogs: vec![go; 2],
            said: Arc::clone(&said),
        };
        let (registry, switches) = (
            registry(),
            Switches {
                unhomed: true,
                ..Switches::default()
            },
        );
        let mut session =
            JogSession::new(machine(&[]), &registry, switches, Box::new(hand)).unwrap();
        let (outcome, _) = drive(session.enable().unwrap(), &[]);
        assert!(outcome.summary.fault.is_some(), "round {round}");
        session.stands_at(outcome.position);
        assert!(
            session
                .enable()
                .is_err_and(|refused| refused.to_string().contains("stands in fault 0x7210"))
        );
        session.reset_drives();
        let (outcome, _) = drive(session.enable().unwrap(), &[]);
        assert_eq!(
            (outcome.summary.fault, hardware().resets),
            (None, 1),
            "round {round}"
        );
    }
}

/// They waited until the joints held, which they may never do.
#[test]
fn commands_of_the_first_tick_act_while_the_drives_are_enabled() {
    let at_once = |command, text: &str| {
        set(|drives| drives.never_enables = true);
        drive(
            prepare(text, &[], Switches::default()).unwrap(),
            &[Timed { tick: 0, command }],
        )
        .0
        .summary
    };
    let stopped = at_once(Command::EmergencyStop, WORK);
    assert!(
        stopped
            .fault
            .is_some_and(|words| words.contains("emergency stop"))
    );
    assert!(hardware().told.len() <= 3 && hardware().told.iter().all(|told| told.enable == 0));
    let aborted = at_once(Command::Abort, WORK);
    assert_eq!(
        (aborted.fault, aborted.stopped.as_deref()),
        (None, Some("stopped by the operator before the first line"))
    );
    assert!(hardware().told.len() <= 3 && hardware().told.iter().all(|told| told.enable == 0));
    // A hold lets them hold: they are waited for, and the machine stands then.
    let held = at_once(Command::Hold, WORK);
    assert!(
        held.fault
            .is_some_and(|words| words.contains("is enabling")),
        "they never come up"
    );
    set(|_| ());
    let hold = [
        Timed {
            tick: 0,
            command: Command::Hold,
        },
        Timed {
            tick: 700,
            command: Command::Abort,
        },
    ];
    let (outcome, watch) = drive(prepare(WORK, &[], Switches::default()).unwrap(), &hold);
    assert_eq!(outcome.summary.fault, None);
    let moved = hardware()
        .told
        .iter()
        .any(|told| told.velocity != AxisVector::ZERO);
    assert!(
        !moved
            && watch.causes[1..700]
                .iter()
                .all(|cause| *cause == StopCause::Hold)
    );
}

#[test]
fn a_door_holds_a_program_until_it_is_closed_and_resumed() {
    let door = [("inputs.guard", "{input = 9, role = \"door\"}")];
    set(|drives| drives.open = 300..900);
    let resume = |tick| Timed {
        tick,
        command: Command::Resume,
    };
    let (outcome, watch) = drive(
        prepare(WORK, &door, Switches::default()).unwrap(),
        &[resume(500), resume(1200)],
    );
    assert_eq!(outcome.summary.fault, None);
    assert!((hardware().position[0] - 60.0).abs() < 1e-9);
    let held = watch
        .causes
        .iter()
        .filter(|cause| **cause == StopCause::Door)
        .count();
    assert!((800..=1000).contains(&held), "{held}");
    assert!(
        watch
            .notes
            .iter()
            .any(|note| note == "input guard holds the machine: close it, then resume")
    );
    let told = hardware().told;
    assert!(
        told[310..890]
            .iter()
            .all(|told| told.spindle_rad_per_s == 0.0)
    );
    assert!(told[250].spindle_rad_per_s > 0.0 && told[1300].spindle_rad_per_s > 0.0);
}

#[test]
fn an_emergency_stop_that_is_pressed_lets_nothing_hold() {
    set(|drives| drives.open = 0..u64::MAX);
    let stop = [("inputs.button", "{input = 3, role = \"emergency-stop\"}")];
    let (outcome, _) = drive(prepare(WORK, &stop, Switches::default()).unwrap(), &[]);
    let words = outcome.summary.fault.unwrap();
    assert!(
        words.starts_with("emergency stop: input button (3) is open (line"),
        "{words}"
    );
    assert!(hardware().told.iter().all(|told| told.enable == 0));
}
