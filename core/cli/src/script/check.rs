//! `tandem script check`.

use std::error::Error;
use std::io::Write;
use std::path::Path;

use tandem_host::{PolicySetup, strategy_signals};
use tandem_machine::Machine;
use tandem_policy::{Engine, InputKind, Instance, Policy};

use super::sample;
use crate::built_in::registry;

/// Prints what a script is, and what it does to a sample, with the parameters and limits of `machine` where one is given.
pub fn check(
    path: &Path,
    machine: Option<&Path>,
    overrides: &[(String, String)],
) -> Result<u8, Box<dyn Error>> {
    let mut setup = match machine {
        Some(file) => {
            let script = ("policy.script".to_string(), path.display().to_string());
            let overrides: Vec<_> = overrides.iter().cloned().chain([script]).collect();
            let machine = Machine::read(file, &overrides)?;
            let signals = strategy_signals(&machine, &registry()?)?;
            PolicySetup::of(&machine, signals)?
        }
        None => PolicySetup::default(),
    };
    let named = |e: &dyn std::fmt::Display| format!("{}: {e}", path.display());
    let bytes = std::fs::read(path).map_err(|e| named(&e))?;
    let script = Engine::new()?.compile(&bytes).map_err(|e| named(&e))?;
    let instance = Instance::new(&script, &setup.budget, &setup.values).map_err(|e| named(&e))?;
    if machine.is_none() {
        setup.facts.signals = sample::signals(&instance);
    }
    let mut policy = Policy::new(
        script.clone(),
        setup.values,
        setup.budget,
        setup.bounds,
        &setup.facts,
    )
    .map_err(|e| named(&e))?;
    for which in 0..policy.program_inputs().len() {
        policy.state(which, 0.0);
    }
    for block in &sample::window() {
        policy.offer(block, None);
    }
    policy.decide(None);
    let ratios: Vec<f64> = (0..125)
        .filter_map(|index| policy.period(&sample::period(index)))
        .collect();
    let mut out = std::io::stdout().lock();
    let has = |there: bool, what: &'static str| there.then_some(what);
    let calls = [
        has(script.tunes_blocks, "on_blocks"),
        has(script.answers_periods, "on_period"),
    ];
    let calls: Vec<_> = calls
        .into_iter()
        .flatten()
        .chain(has(script.keeps_state, "save and restore"))
        .collect();
    writeln!(
        out,
        "{}: {} bytes, ABI version {}",
        path.display(),
        bytes.len(),
        script.version
    )?;
    writeln!(out, "calls       {}", calls.join(", "))?;
    writeln!(
        out,
        "memory      {} of {} pages",
        instance.memory_pages(),
        setup.budget.memory_pages
    )?;
    parameters(&mut out, &instance)?;
    inputs(&mut out, &instance)?;
    dry_run(&mut out, &policy, &ratios)?;
    let failed = policy.counters().troubles() > 0;
    for note in policy
        .take_notes()
        .iter()
        .filter(|note| note.contains("strike"))
    {
        writeln!(out, "{note}")?;
    }
    Ok(u8::from(failed))
}

fn parameters(out: &mut impl Write, instance: &Instance) -> std::io::Result<()> {
    if instance.parameters().is_empty() {
        return writeln!(out, "parameters  none");
    }
    writeln!(out, "parameters")?;
    for parameter in instance.parameters() {
        let tandem_policy::Parameter {
            name,
            description,
            lowest,
            highest,
            default,
        } = parameter;
        writeln!(
            out,
            "  {name} = {default}, from {lowest} to {highest}: {description}"
        )?;
    }
    Ok(())
}

/// What it looks at by name.
fn inputs(out: &mut impl Write, instance: &Instance) -> std::io::Result<()> {
    for (index, input) in instance.inputs().iter().enumerate() {
        let kind = match input.kind {
            InputKind::Program => "of the program",
            InputKind::Signal => "signal",
            InputKind::Axis => "axis",
        };
        let words = if input.words.is_empty() {
            String::new()
        } else {
            format!(": a number, or {}", input.words.join(", "))
        };
        let optional = if input.is_optional { ", if there" } else { "" };
        writeln!(
            out,
            "{:<11} {kind} {}{optional}{words}",
            if index == 0 { "sees" } else { "" },
            input.name
        )?;
    }
    Ok(())
}

fn dry_run(out: &mut impl Write, policy: &Policy, ratios: &[f64]) -> std::io::Result<()> {
    let counters = policy.counters();
    let tuned = counters.time_constants + counters.tolerances + counters.feed_caps;
    let limited = counters.limited;
    writeln!(
        out,
        "dry run     64 blocks: {} time constants, {} tolerances, {} feeds; {limited} requests limited; {} fuel",
        counters.time_constants, counters.tolerances, counters.feed_caps, counters.max_window_fuel
    )?;
    if let (Some(least), Some(most)) = (
        ratios.iter().copied().reduce(f64::min),
        ratios.iter().copied().reduce(f64::max),
    ) {
        writeln!(
            out,
            "            125 rough periods: feed ratio {least:.3} to {most:.3}; {} fuel",
            counters.max_period_fuel
        )?;
    }
    if tuned == 0 && ratios.is_empty() && counters.troubles() == 0 {
        writeln!(out, "            it asks for nothing on this sample")?;
    }
    Ok(())
}
