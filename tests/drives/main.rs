//! Drivers of a machine from the outside: several on one machine, and what only drivers with real drives behind them show.
//!
//! `TANDEM_SEEDS=n` asks for more random faults than usual.

mod after;
mod cable;
#[path = "../counting_allocator.rs"]
mod counting_allocator;
mod double;
mod eight;
mod ethercat;
mod every_frame;
#[path = "../../core/host/tests/drives/four_axes.rs"]
mod four_axes;
mod keeper;
mod measures;
mod real;
mod several;
mod slow;
mod tower;

use tandem_host::{Registry, RunObserver};
use tandem_rings::Sample;

use four_axes::{machine, program, try_machine};

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
