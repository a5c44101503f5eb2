//! The closed models on 100 000 blocks in memory, and the simulation by real time: `cargo bench -p tandem-estimate`.

use std::path::Path;
use std::time::Instant;

use divan::counter::ItemsCount;
use tandem_estimate::{Choice, Element, estimate, total_s};
use tandem_gcode::Program;
use tandem_host::{Registry, Switches};
use tandem_machine::Machine;

const BLOCKS: usize = 100_000;

fn main() {
    divan::main();
    for name in ["serpentine", "raster", "spiral"] {
        simulate(name);
    }
}

fn examples() -> std::path::PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples")
}

fn mill() -> Machine {
    Machine::read(&examples().join("machines/mill-3axis.toml"), &[]).unwrap()
}

/// A path that turns a little at each block and has blocks of many lengths.
fn elements() -> Vec<Element> {
    let one = |index: usize| {
        let number = index as f64;
        let length_mm = 0.05 + 1.5 * (number * 0.618_034).fract().powi(2);
        Element::line(length_mm, 0.4 * (number * 0.05).sin(), 50.0)
    };
    (0..BLOCKS).map(one).collect()
}

#[divan::bench(args = ["regression", "overlap", "look-ahead"])]
fn closed(bencher: divan::Bencher, name: &str) {
    let (machine, elements) = (mill(), elements());
    let choice = Choice::named(name, &machine).unwrap();
    bencher.counter(ItemsCount::new(BLOCKS)).bench_local(|| {
        let total_s = total_s(choice.model().unwrap().as_mut(), elements.iter().copied());
        assert!(total_s > 0.0);
        total_s
    });
}

/// The best of a few whole estimates: both passes of the interpreter included.
fn simulate(name: &str) {
    let mut registry = Registry::default();
    registry.register(tandem_look_ahead::PLUGIN).unwrap();
    registry.register(tandem_sim::PLUGIN).unwrap();
    let (machine, text) = (
        mill(),
        std::fs::read(examples().join(format!("programs/{name}.ngc"))).unwrap(),
    );
    let once = |_| {
        let program = Program::spool("bench", text.as_slice()).unwrap();
        let started = Instant::now();
        let estimate = estimate(
            &machine,
            &registry,
            program,
            Switches::default(),
            &Choice::Simulate,
        )
        .unwrap();
        estimate.estimated_s / started.elapsed().as_secs_f64()
    };
    let best = (0..20).map(once).fold(0.0, f64::max);
    println!("simulate {name}: {best:.0} × real time");
}
