//! A real driver that keeps its bus alive by itself where nobody calls it, and what it may rely on for that: drives with torque
//! are in the host's hands, drives in its own have none, and everything that was started is stopped.

use std::collections::BTreeMap;
use std::sync::atomic::AtomicBool;
use std::sync::atomic::Ordering::Relaxed;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use serde::Deserialize;
use tandem_host::{Clock, Run, RunObserver, Switches};
use tandem_rings::{Controls, Sample};
use tandem_sdk::{
    Attached, AxisVector, Driver, DriverContext, DriverDescription, Feedback, JointState, Plugin,
    PluginError, RawOptions, Setpoint, local_plugin, parse_options,
};

use crate::{machine, program, registry};

/// Cycles without a setpoint behind which the watchdog of a drive with torque bites. A cycle takes a millisecond at least.
const PATIENCE: u64 = 3000;
/// Exchanges until a drive holds, and until its brake is closed.
const ENABLES: u64 = 3;
const BRAKES: u64 = 5;
/// How far a joint without torque creeps in a cycle in which nobody calls, mm or rad.
const CREEP: f64 = 1e-4;

/// What the drives see of the bus.
#[derive(Debug, Default)]
struct Drives {
    joints: usize,
    position: AxisVector,
    /// Exchanges since the drives were told to hold, and to let go.
    holding: u64,
    letting_go: u64,
    has_torque: bool,
    faults_at: Option<u64>,
    is_faulty: bool,
    /// Cycles since the last exchange.
    silent: u64,
    /// Cycles that the driver kept the bus alive by itself, before the first exchange and behind the last.
    kept: u64,
    bites: u64,
    /// How far the furthest setpoint that gave a joint torque was from where it stood, mm or rad.
    jump: f64,
    exchanges: u64,
    calls: Vec<&'static str>,
}

impl Drives {
    fn called(&mut self, call: &'static str) {
        if self.calls.last() != Some(&call) {
            self.calls.push(call);
        }
    }

    /// One cycle of the bus, which goes on whoever calls.
    fn cycle(&mut self) {
        self.silent += 1;
        if self.has_torque {
            self.bites += u64::from(self.silent == PATIENCE);
        } else if self.silent > 1 {
            self.kept += 1;
            self.position[0] -= CREEP;
        }
    }

    fn state(&self) -> JointState {
        match (self.is_faulty, self.holding) {
            (true, _) => JointState::Fault,
            (_, 0) if self.has_torque => JointState::Enabled,
            (_, 0) => JointState::Disabled,
            (_, exchanges) if exchanges > ENABLES => JointState::Enabled,
            _ => JointState::Enabling,
        }
    }
}

type Bus = Arc<Mutex<Drives>>;

/// The bus of each machine, which outlives its driver.
static BUSES: Mutex<BTreeMap<String, Bus>> = Mutex::new(BTreeMap::new());

fn bus(name: &str) -> Bus {
    let mut buses = BUSES.lock().unwrap_or_else(PoisonError::into_inner);
    Arc::clone(buses.entry(name.to_string()).or_default())
}

fn lock(bus: &Bus) -> MutexGuard<'_, Drives> {
    bus.lock().unwrap_or_else(PoisonError::into_inner)
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Options {
    name: String,
    /// Exchange in which a drive faults.
    #[serde(default)]
    faults_at: Option<u64>,
}

struct Keeper {
    bus: Bus,
    keeps: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

fn plugin() -> Plugin {
    local_plugin!(driver "keeper" = Keeper::made)
}

impl Keeper {
    fn made(options: &RawOptions) -> Result<Self, PluginError> {
        let options: Options = parse_options(&options.0)?;
        let bus = bus(&options.name);
        lock(&bus).faults_at = options.faults_at;
        Ok(Self {
            bus,
            keeps: Arc::default(),
            thread: None,
        })
    }
}

impl Driver for Keeper {
    fn describe(&self) -> DriverDescription {
        DriverDescription {
            watches_following: 1,
            enable_s: 1.0,
            ..DriverDescription::real()
        }
    }

    fn open(&mut self, context: &DriverContext) -> Result<(), PluginError> {
        let mut drives = lock(&self.bus);
        drives.called("open");
        drives.joints = context.joint_count as usize;
        Ok(())
    }

    fn start(&mut self) -> Result<Attached, PluginError> {
        let mut drives = lock(&self.bus);
        drives.called("start");
        let (bus, keeps) = (Arc::clone(&self.bus), Arc::clone(&self.keeps));
        keeps.store(true, Relaxed);
        self.thread = Some(thread::spawn(move || {
            while keeps.load(Relaxed) {
                thread::sleep(Duration::from_millis(1));
                lock(&bus).cycle();
            }
        }));
        Ok(Attached::at(drives.position))
    }

    fn exchange(
        &mut self,
        setpoint: &Setpoint,
        feedback: &mut Feedback,
    ) -> Result<(), PluginError> {
        let mut drives = lock(&self.bus);
        drives.called("exchange");
        (drives.silent, drives.exchanges) = (0, drives.exchanges + 1);
        drives.is_faulty |= drives.faults_at == Some(drives.exchanges);
        if setpoint.enable == 0 {
            (drives.holding, drives.letting_go) = (0, drives.letting_go + 1);
            drives.has_torque &= drives.letting_go < BRAKES;
        } else {
            (drives.holding, drives.letting_go) = (drives.holding + 1, 0);
        }
        // A drive in fault closes its brake by itself.
        drives.has_torque &= !drives.is_faulty;
        if drives.state() == JointState::Enabled && setpoint.enable != 0 {
            let away = (setpoint.position - drives.position).0[..drives.joints]
                .iter()
                .fold(0.0, |a: f64, b| a.max(b.abs()));
            if !drives.has_torque {
                drives.jump = drives.jump.max(away);
            }
            (drives.has_torque, drives.position) = (true, setpoint.position);
        }
        feedback.follow(setpoint, drives.joints);
        feedback.state[..drives.joints].fill(drives.state());
        feedback.position = drives.position;
        Ok(())
    }

    fn quick_stop(&mut self) {
        lock(&self.bus).called("quick stop");
    }

    fn stop(&mut self) -> Result<(), PluginError> {
        // The bus lives to here: the drives have been heard of in between.
        lock(&self.bus).called("stop");
        self.keeps.store(false, Relaxed);
        self.thread.take().map_or(Ok(()), |thread| {
            thread
                .join()
                .map_err(|_| PluginError::fixed("its bus has ended"))
        })
    }
}

/// A machine with this driver; `more` of its options.
fn prepare(name: &str, more: &str, text: &str) -> Result<Run, String> {
    let patient = "[loops]\nmax_missed_periods = 100000\nmax_missed_share = 1\n";
    let drivers = format!(
        "[driver]\nplugin = \"keeper\"\noptions = {{ name = \"{name}\"{more} }}\n{patient}"
    );
    let mut registry = registry();
    registry.register(plugin()).unwrap();
    Run::prepare(
        machine(&drivers),
        &registry,
        program(text),
        Switches::default(),
    )
    .map_err(|error| error.to_string())
}

/// Until the driver has kept its bus alive for some cycles more: as long as a program is to be checked.
fn wait(name: &str) {
    let before = lock(&bus(name)).kept;
    while lock(&bus(name)).kept < before + 30 {
        thread::sleep(Duration::from_millis(1));
    }
}

const MOVES: &str = "G21 G90 G94 F6000\nG1 X50\nG1 Y50\nM2\n";

/// What the operator does as soon as the machine moves.
struct Operator(Arc<Controls>, Option<fn(&Controls) -> &AtomicBool>);

impl RunObserver for Operator {
    fn sample(&mut self, _sample: &Sample, _deviation_mm: f64, _signals: &[f64]) {
        if let Some(of) = self.1.take() {
            of(&self.0).store(true, Relaxed);
        }
    }
}

/// Watchdogs bit in good runs too: while a program was checked before its first exchange, and while it was reported.
#[test]
fn drives_with_torque_are_exchanged_with_until_their_brakes_are_closed_and_the_others_are_left_to_their_driver()
 {
    let abort: fn(&Controls) -> &AtomicBool = |controls| &controls.abort;
    let stop: fn(&Controls) -> &AtomicBool = |controls| &controls.emergency_stop;
    for (name, more, operator, fault) in [
        ("kept-to-its-end", "", None, None),
        ("kept-aborted", "", Some(abort), None),
        ("kept-stopped", "", Some(stop), Some("emergency stop")),
        (
            "kept-faulty",
            ", faults_at = 60",
            None,
            Some("the drive of axis X reports fault"),
        ),
    ] {
        let run = prepare(name, more, MOVES).unwrap();
        wait(name);
        let mut operator = Operator(run.controls(), operator);
        let summary = run.drive(Clock::Wall, &[], &mut operator).unwrap().summary;
        let words = summary.fault.unwrap_or_default();
        assert!(
            fault.map_or(words.is_empty(), |fault| words.contains(fault)),
            "{name}: {words}"
        );
        let bus = bus(name);
        let drives = lock(&bus);
        let is_fault = fault.is_some();
        let calls: &[&str] = if is_fault {
            &[
                "open",
                "start",
                "exchange",
                "quick stop",
                "exchange",
                "stop",
            ]
        } else {
            &["open", "start", "exchange", "stop"]
        };
        assert_eq!(drives.calls, calls, "{name}");
        assert_eq!(
            (drives.bites, drives.has_torque),
            (0, false),
            "{name}: nothing holds that nobody exchanges with"
        );
        assert!(
            drives.kept >= 30,
            "{name}: {} cycles on its own",
            drives.kept
        );
        assert!(
            drives.jump < 20.0 * CREEP,
            "{name}: what has crept meanwhile is enabled where it is: {}",
            drives.jump
        );
        // A drive in fault has no torque any more: its brake is not waited for.
        let let_go = if name == "kept-faulty" { 1 } else { BRAKES };
        assert!(
            drives.letting_go >= let_go,
            "{name}: {} exchanges to let go in",
            drives.letting_go
        );
    }
}

/// What refuses a run behind `start` lets go of what was started, and exchanges with nobody.
#[test]
fn drives_that_were_started_for_nothing_are_stopped_without_an_exchange() {
    let refused = prepare(
        "kept-refused",
        "",
        "G21 G90 G94 F6000\nG1 X5\nG1 X9999\nM2\n",
    )
    .err()
    .unwrap();
    assert!(refused.contains("errors in the program"), "{refused}");
    drop(prepare("kept-dropped", "", MOVES).unwrap());
    let on_the_wrong_clock = prepare("kept-virtual", "", MOVES).unwrap();
    wait("kept-virtual");
    assert!(
        on_the_wrong_clock
            .drive(Clock::Virtual, &[], &mut ())
            .is_err()
    );
    for name in ["kept-refused", "kept-dropped", "kept-virtual"] {
        let bus = bus(name);
        let drives = lock(&bus);
        assert_eq!(
            (&drives.calls[..], drives.exchanges),
            (&["open", "start", "stop"][..], 0),
            "{name}"
        );
    }
}
