//! Whole runs on the virtual clock: `cargo bench -p tandem-host`. Both passes of the interpreter, planner, both loops,
//! simulated drives; no trace. An item is a sample, so that at 1 kHz thousands of items a second are × real time.

use std::path::Path;
use std::time::{Duration, Instant};

use divan::counter::ItemsCount;
use tandem_gcode::Program;
use tandem_host::{Clock, Registry, Run};
use tandem_machine::Machine;
use tandem_recorder::Summary;

/// Then the fastest of 50 whole runs of each, which `-- smooth` does for that planner alone.
fn main() {
    divan::main();
    // All of them, or those that the command line names.
    let named: Vec<String> = std::env::args().collect();
    let all = ["look-ahead", "block-overlap", "smooth"];
    let is_named = |planner: &&str| named.iter().any(|name| name == planner);
    let any = all.iter().any(is_named);
    for planner in all.iter().filter(|planner| !any || is_named(planner)) {
        let each = ["square", "serpentine", "raster", "spiral"].map(|name| fastest(planner, name));
        let (motion_s, took_s) = each
            .iter()
            .fold((0.0, 0.0), |sum, each| (sum.0 + each.0, sum.1 + each.1));
        println!(
            "{planner}, the four together: {:.0} × real time",
            motion_s / took_s
        );
    }
}

/// Motion time and the shortest time that it took, s.
fn fastest(planner: &str, name: &str) -> (f64, f64) {
    let example = Example::new(planner, name);
    let runs = (0..50).map(|_| timed(&example));
    let (elapsed, summary) = runs.min_by_key(|(elapsed, _)| *elapsed).unwrap();
    let (motion_s, took_s) = (summary.motion_time_s, elapsed.as_secs_f64());
    println!(
        "{planner}, {name}: {} blocks, {motion_s:.1} s of motion in {:.1} ms, {:.0} × real time",
        summary.blocks,
        took_s * 1e3,
        motion_s / took_s
    );
    (motion_s, took_s)
}

/// A program of the examples on the example machine.
struct Example {
    machine: Machine,
    registry: Registry,
    text: Vec<u8>,
}

impl Example {
    fn new(planner: &str, name: &str) -> Self {
        let examples = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples");
        let mut registry = Registry::default();
        registry.register(tandem_look_ahead::PLUGIN).unwrap();
        registry.register(tandem_block_overlap::PLUGIN).unwrap();
        registry.register(tandem_smooth::PLUGIN).unwrap();
        registry.register(tandem_sim::PLUGIN).unwrap();
        // Each planner takes its own default options.
        let overrides = [("planner.plugin", planner), ("planner.options", "{}")];
        let overrides = overrides.map(|(key, value)| (key.to_string(), value.to_string()));
        // It needs a jerk limit.
        let machine = if planner == "smooth" {
            "mill-3axis-smooth"
        } else {
            "mill-3axis"
        };
        let machine = examples.join(format!("machines/{machine}.toml"));
        Self {
            machine: Machine::read(&machine, &overrides).unwrap(),
            registry,
            text: std::fs::read(examples.join(format!("programs/{name}.ngc"))).unwrap(),
        }
    }

    fn run(&self) -> Summary {
        let program = Program::spool("bench", self.text.as_slice()).unwrap();
        let run = Run::prepare(
            self.machine.clone(),
            &self.registry,
            program,
            tandem_host::Switches::default(),
        )
        .unwrap();
        let outcome = run.drive(Clock::Virtual, &[], &mut ()).unwrap();
        assert!(outcome.fault.is_none() && outcome.summary.starvations == 0);
        outcome.summary
    }
}

fn timed(example: &Example) -> (Duration, Summary) {
    let started = Instant::now();
    let summary = example.run();
    (started.elapsed(), summary)
}

#[divan::bench(args = ["serpentine", "raster", "spiral"])]
fn run(bencher: divan::Bencher, name: &str) {
    drive(bencher, "look-ahead", name);
}

#[divan::bench(args = ["serpentine", "raster", "spiral"])]
fn run_block_overlap(bencher: divan::Bencher, name: &str) {
    drive(bencher, "block-overlap", name);
}

#[divan::bench(args = ["square", "serpentine", "raster", "spiral"])]
fn run_smooth(bencher: divan::Bencher, name: &str) {
    drive(bencher, "smooth", name);
}

fn drive(bencher: divan::Bencher, planner: &str, name: &str) {
    let example = Example::new(planner, name);
    let samples = example.run().samples;
    bencher
        .counter(ItemsCount::new(samples))
        .bench_local(|| example.run());
}
