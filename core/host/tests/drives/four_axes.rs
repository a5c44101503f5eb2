//! A machine of four axes with drivers of its own, and programs for it.

use tandem_gcode::Program;
use tandem_machine::Machine;

/// Four axes, and these tables of drivers.
pub fn machine(drivers: &str) -> Machine {
    try_machine(drivers).unwrap()
}

pub fn try_machine(drivers: &str) -> Result<Machine, String> {
    let mut text = "format = 1\n[planner]\nplugin = \"look-ahead\"\n".to_string();
    for axis in ["x", "y", "z", "a"] {
        let keys = if axis == "a" {
            "kind = \"rotary\"\ntravel_deg = [-360, 360]\nmax_feed_deg_per_min = 7200\nmax_acceleration_deg_per_s2 = 900\n"
        } else {
            "travel_mm = [-250, 250]\nmax_feed_mm_per_min = 6000\nmax_acceleration_mm_per_s2 = 800\n"
        };
        text.extend(["[axes.", axis, "]\n", keys]);
    }
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("machine.toml");
    std::fs::write(&path, text + drivers).unwrap();
    Machine::read(&path, &[]).map_err(|error| error.to_string())
}

pub fn program(text: &str) -> Program {
    Program::spool("p.ngc", text.as_bytes()).unwrap()
}
