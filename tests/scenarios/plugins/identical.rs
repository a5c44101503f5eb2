//! A built-in planner in a shared library drives as the one that is linked in: bit for bit.

use std::path::Path;

use tandem_host::{Clock, Registry, Run, RunObserver, Switches};
use tandem_machine::Machine;
use tandem_rings::Sample;
use tandem_sdk::Plugin;

use crate::harness::{mill, root};
use crate::plugins::built::built_in;

#[derive(Default)]
struct Bits(Vec<[u64; 6]>);

impl RunObserver for Bits {
    fn sample(&mut self, sample: &Sample, deviation_mm: f64, _signals: &[f64]) {
        let c = sample.command;
        let [x, y, z, feed, deviation] = [c[0], c[1], c[2], sample.feed_mm_per_s, deviation_mm].map(f64::to_bits);
        self.0.push([sample.tick, x, y, z, feed, deviation]);
    }
}

/// All samples of a run of `program` with the planner `choice`, which is linked in where `registered` says so.
fn run(choice: &str, registered: Option<Plugin>, program: &Path, settings: &[(&str, &str)]) -> Vec<[u64; 6]> {
    let mut overrides = vec![("planner.plugin".to_string(), choice.to_string())];
    overrides.extend(settings.iter().map(|(key, value)| ((*key).to_string(), (*value).to_string())));
    let machine = Machine::read(&mill(), &overrides).unwrap();
    let mut registry = Registry::default();
    for plugin in [Some(tandem_sim::PLUGIN), registered].into_iter().flatten() {
        registry.register(plugin).unwrap();
    }
    let program = tandem_gcode::Program::open(program).unwrap();
    let mut bits = Bits::default();
    let run = Run::prepare(machine, &registry, program, Switches::default()).unwrap();
    let outcome = run.drive(Clock::Virtual, &[], &mut bits).unwrap();
    assert_eq!(outcome.summary.fault, None);
    bits.0
}

fn compare(package: &str, plugin: Plugin, programs: &[&str], settings: &[(&str, &str)]) {
    let library = built_in(package);
    for name in programs {
        let program = root().join("examples/programs").join(name);
        let linked = run(plugin.name(), Some(plugin), &program, settings);
        let loaded = run(library.to_str().unwrap(), None, &program, settings);
        assert!(linked.len() > 100 && linked == loaded, "{package}: {name}");
    }
}

const ALL: &[&str] = &["square.ngc", "spiral.ngc", "two-step-arcs.ngc"];

#[test]
fn look_ahead() {
    compare("tandem-look-ahead", tandem_look_ahead::PLUGIN, ALL, &[]);
}

#[test]
fn block_overlap() {
    compare("tandem-block-overlap", tandem_block_overlap::PLUGIN, ALL, &[]);
}

#[test]
fn nurbs() {
    compare("tandem-nurbs", tandem_nurbs::PLUGIN, &["square.ngc", "two-step-arcs.ngc"], &[]);
}

#[test]
fn after_interpolation() {
    let count = [("guard.mode", "count"), ("planner.options.filter", "bell")];
    compare("tandem-after-interpolation", tandem_after_interpolation::PLUGIN, ALL, &count);
}
