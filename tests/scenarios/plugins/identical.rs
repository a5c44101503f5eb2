//! A built-in plugin in a shared library drives as the one that is linked in: bit for bit.

use std::path::{Path, PathBuf};

use tandem_host::{Clock, Registry, Run, RunObserver, Switches};
use tandem_machine::Machine;
use tandem_rings::Sample;
use tandem_sdk::{Plugin, PluginKind};

use crate::harness::{mill, root};
use crate::plugins::built::built_in;

#[derive(Default)]
struct Bits(Vec<Vec<u64>>);

impl RunObserver for Bits {
    fn sample(&mut self, sample: &Sample, deviation_mm: f64, signals: &[f64]) {
        let (c, f) = (sample.command, sample.feedback);
        let plain = [
            c[0],
            c[1],
            c[2],
            f[0],
            f[1],
            f[2],
            sample.feed_mm_per_s,
            sample.ratio,
            deviation_mm,
        ];
        let bits = plain.iter().chain(signals).map(|number| number.to_bits());
        self.0
            .push(std::iter::once(sample.tick).chain(bits).collect());
    }
}

/// What plugins a run has beside the one in question.
const OTHERS: &[Plugin] = &[
    tandem_sim::PLUGIN,
    tandem_look_ahead::PLUGIN,
    tandem_corexy::PLUGIN,
];

fn section(kind: PluginKind) -> &'static str {
    match kind {
        PluginKind::Planner => "planner",
        PluginKind::FeedStrategy => "feed_strategy",
        PluginKind::Driver => "driver",
        PluginKind::Kinematics => "kinematics",
    }
}

/// All samples of a run with `plugin`, which is linked in, or loaded where a library is given.
fn run(
    plugin: Plugin,
    library: Option<&Path>,
    machine: &Path,
    program: &Path,
    settings: &[(&str, &str)],
) -> Bits {
    let choice = library.map_or(plugin.name(), |path| path.to_str().unwrap());
    let mut overrides = vec![(
        format!("{}.plugin", section(plugin.kind())),
        choice.to_string(),
    )];
    overrides.extend(
        settings
            .iter()
            .map(|(key, value)| ((*key).to_string(), (*value).to_string())),
    );
    let machine = Machine::read(machine, &overrides).unwrap();
    let is_it = |other: &Plugin| other.kind() == plugin.kind() && other.name() == plugin.name();
    let mut registry = Registry::default();
    for other in OTHERS
        .iter()
        .filter(|other| !is_it(other))
        .chain(library.is_none().then_some(&plugin))
    {
        registry.register(*other).unwrap();
    }
    let program = tandem_gcode::Program::open(program).unwrap();
    let mut bits = Bits::default();
    let run = Run::prepare(machine, &registry, program, Switches::default()).unwrap();
    let outcome = run.drive(Clock::Virtual, &[], &mut bits).unwrap();
    assert_eq!(outcome.summary.fault, None);
    bits
}

fn example(folder: &str, name: &str) -> PathBuf {
    root().join("examples").join(folder).join(name)
}

fn compare_on(
    machine: &Path,
    package: &str,
    plugin: Plugin,
    programs: &[&str],
    settings: &[(&str, &str)],
) {
    let library = built_in(package);
    for name in programs {
        let program = example("programs", name);
        let linked = run(plugin, None, machine, &program, settings);
        let loaded = run(plugin, Some(&library), machine, &program, settings);
        assert!(
            linked.0.len() > 100 && linked.0 == loaded.0,
            "{package}: {name}"
        );
    }
}

fn compare(package: &str, plugin: Plugin, programs: &[&str], settings: &[(&str, &str)]) {
    compare_on(&mill(), package, plugin, programs, settings);
}

const ALL: &[&str] = &["square.ngc", "spiral.ngc", "two-step-arcs.ngc"];

#[test]
fn look_ahead() {
    compare("tandem-look-ahead", tandem_look_ahead::PLUGIN, ALL, &[]);
}

#[test]
fn block_overlap() {
    compare(
        "tandem-block-overlap",
        tandem_block_overlap::PLUGIN,
        ALL,
        &[],
    );
}

#[test]
fn nurbs() {
    compare(
        "tandem-nurbs",
        tandem_nurbs::PLUGIN,
        &["square.ngc", "two-step-arcs.ngc"],
        &[],
    );
}

#[test]
fn after_interpolation() {
    let count = [("guard.mode", "count"), ("planner.options.filter", "bell")];
    compare(
        "tandem-after-interpolation",
        tandem_after_interpolation::PLUGIN,
        ALL,
        &count,
    );
}

#[test]
fn smooth() {
    let machine = example("machines", "mill-3axis-smooth.toml");
    compare_on(
        &machine,
        "tandem-smooth",
        tandem_smooth::PLUGIN,
        &["square.ngc", "two-step-arcs.ngc"],
        &[],
    );
}

#[test]
fn the_simulated_drives() {
    let seeded = [
        ("driver.options.model", "servo"),
        ("driver.options.seed", "7"),
    ];
    compare("tandem-sim", tandem_sim::PLUGIN, &["square.ngc"], &seeded);
}

#[test]
fn the_force_control() {
    let machine = example("machines", "force-step.toml");
    compare_on(
        &machine,
        "tandem-force-control",
        tandem_force_control::PLUGIN,
        &["force-step.ngc"],
        &[],
    );
}

#[test]
fn the_kinematics() {
    let machine = example("machines", "corexy.toml");
    compare_on(
        &machine,
        "tandem-corexy",
        tandem_corexy::PLUGIN,
        &["corexy.ngc"],
        &[],
    );
    let machine = example("machines", "rotary-table.toml");
    compare_on(
        &machine,
        "tandem-wrapped-rotary",
        tandem_wrapped_rotary::PLUGIN,
        &["cylinder.ngc"],
        &[],
    );
}
