//! Constructors that do not come back are told outside of runs too, where what a machine is is asked: at manual input's start.

use std::path::Path;
use std::sync::{Condvar, Mutex};
use std::time::Duration;

use tandem_host::{Registry, at_hang, moves_metal, planner};
use tandem_machine::Machine;
use tandem_sdk::{Identity, KinematicsContext, NoOptions, PluginError, local_plugin};
use tandem_sim::SimulatedDrives;

/// What was said of a hang, and by which it ends here: in a program the process ends.
static SAID: (Mutex<Option<String>>, Condvar) = (Mutex::new(None), Condvar::new());
/// Where nobody watches, nobody says anything.
const PATIENCE: Duration = Duration::from_secs(20);

fn hang() -> PluginError {
    let said = SAID.0.lock().unwrap();
    drop(
        SAID.1
            .wait_timeout_while(said, PATIENCE, |said| said.is_none())
            .unwrap(),
    );
    PluginError::fixed("it has come back")
}

fn drives(_: &NoOptions) -> Result<SimulatedDrives, PluginError> {
    Err(hang())
}

fn kinematics(_: &NoOptions, _: &KinematicsContext) -> Result<Identity, PluginError> {
    Err(hang())
}

fn machine(name: &str, section: &str) -> Machine {
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../../examples/machines")
        .join(name);
    let set = [
        (format!("{section}.plugin"), "waits"),
        ("loops.soft_hang_after_s".to_string(), "0.1"),
    ];
    Machine::read(&path, &set.map(|(key, value)| (key, value.to_string()))).unwrap()
}

#[test]
fn a_constructor_that_does_not_come_back_is_told_where_drives_and_planner_are_asked_about() {
    at_hang(|words| {
        *SAID.0.lock().unwrap() = Some(words.to_string());
        SAID.1.notify_all();
    });
    let mut registry = Registry::default();
    registry
        .register(local_plugin!(driver "waits" = drives))
        .unwrap();
    registry
        .register(local_plugin!(kinematics "waits" = kinematics))
        .unwrap();
    registry.register(tandem_look_ahead::PLUGIN).unwrap();
    let said = || SAID.0.lock().unwrap().take();

    assert!(
        !moves_metal(&machine("mill-3axis.toml", "driver"), &registry),
        "it cannot be made"
    );
    let words = "waits: its constructor does not come back: no answer for 0.1 s";
    assert_eq!(said(), Some(format!("driver {words}")));

    assert!(planner(&machine("corexy.toml", "kinematics"), &registry).is_err());
    assert_eq!(said(), Some(format!("kinematics {words}")));
}
