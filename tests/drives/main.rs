//! Drivers of a machine from the outside: several on one machine, and what only drivers with real drives behind them show.
//!
//! `TANDEM_SEEDS=n` asks for more random faults than usual.

mod cable;
#[path = "../counting_allocator.rs"]
mod counting_allocator;
mod double;
mod ethercat;
mod keeper;
mod mapping;
mod measures;
mod real;
mod several;
mod slow;
mod tower;

use tandem_gcode::Program;
use tandem_host::{Registry, RunObserver};
use tandem_machine::Machine;
use tandem_rings::Sample;

/// A registry with the driver for tests beside those that are needed.
fn registry() -> Registry {
    let mut registry = Registry::default();
    for plugin in [
        tandem_sim::PLUGIN,
        tandem_look_ahead::PLUGIN,
        tandem_ethercat::PLUGIN,
        double::plugin(),
    ] {
        registry.register(plugin).unwrap();
    }
    registry
}

/// Four axes, and these tables of drivers.
fn machine(drivers: &str) -> Machine {
    try_machine(drivers).unwrap()
}

fn try_machine(drivers: &str) -> Result<Machine, String> {
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

fn program(text: &str) -> Program {
    Program::spool("p.ngc", text.as_bytes()).unwrap()
}

/// A program in which all axes move all the time.
const SQUARE: &str = "G21 G90 G94 F4000\nG1 X40 Y10 Z5 A90\nG1 X0 Y30 Z-5 A0\nG1 X-40 Y0 Z0 A-90\nG1 X0 Y0 Z0 A0\nM2\n";

/// Keeps all samples.
#[derive(Default)]
struct Samples(Vec<Sample>);

impl RunObserver for Samples {
    fn sample(&mut self, sample: &Sample, _deviation_mm: f64, _signals: &[f64]) {
        self.0.push(*sample);
    }
}
