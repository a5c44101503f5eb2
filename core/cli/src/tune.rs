//! `tandem tune`.

mod drawing;

use std::error::Error;
use std::fmt::Write as _;
use std::io::{Write, stdout};
use std::path::Path;

use tandem_batch::{
    Bench, Build, Folder, Inputs, Plugins, Point, Task, Tried, Tuned, key_of, set_of, simulate,
    tune as search,
};
use tandem_machine::Machine;
use tandem_recorder::Output;

use crate::batch::{plugins, programs, show, stop_at_signals, threads};
use crate::{FAULT, REFUSED, args};

/// What the drawing needs besides what was found.
pub struct TuneRun<'a> {
    pub options: &'a args::Tune,
    pub machine: &'a Machine,
    pub task: &'a Task,
    pub tuned: &'a Tuned,
    pub inputs: &'a Inputs,
    pub plugins: &'a Plugins<'a>,
    /// Names of the programs, in the order of the task.
    pub programs: Vec<String>,
}

/// Finds the best settings.
pub fn tune(options: &args::Tune) -> Result<u8, Box<dyn Error>> {
    let machine = Machine::read(&options.machine.path, &options.machine.overrides)?;
    check_keys(options)?;
    let folder = Folder::create(&options.folder)?;
    let inputs = folder.inputs()?;
    let named = programs(&options.programs, &inputs)?;
    let task = Task {
        machine: inputs.put_machine(&machine)?,
        programs: named.iter().map(|(_, hash)| hash.clone()).collect(),
        block_delete: options.block_delete,
        stated: stated(&machine, options),
        parameters: options.vary.clone(),
        objective: key_of(&options.objective),
        keeps: options.keep.clone(),
        against: key_of(&options.against),
        budget: options.budget as usize,
        seed: options.seed,
    };
    let (results, marks) = (folder.results(Build::of_this_process()?)?, folder.marks());
    let (plugins, stop) = (plugins(), stop_at_signals()?);
    let bench = Bench {
        results: &results,
        marks: &marks,
        simulate: &|job| simulate(job, &inputs, &plugins),
        threads: threads(options.threads),
        stop: &stop,
        tell: &|_| (),
    };
    let tuned = search(&task, &bench, &mut |points| progress(points, &task))?;
    show("");
    if tuned.stopped {
        say!(
            "stopped after {} settings; the same command goes on from there",
            tuned.points.len()
        );
        return Ok(FAULT);
    }
    let causes = || {
        tuned
            .points
            .iter()
            .filter_map(|point| point.cause.as_deref())
    };
    // The machine as it is may be driven where nothing else can: then there was nothing to choose from.
    let tried = tuned
        .points
        .iter()
        .skip(1)
        .any(|point| point.cause.is_none());
    let Some(chosen) = tuned.chosen.filter(|_| tried) else {
        let cause = causes().next().unwrap_or("nothing was varied");
        say!("none of the settings could be driven: {cause}");
        return Ok(REFUSED);
    };
    let names = named
        .iter()
        .map(|(path, _)| path.display().to_string())
        .collect();
    let run = TuneRun {
        options,
        machine: &machine,
        task: &task,
        tuned: &tuned,
        inputs: &inputs,
        plugins: &plugins,
        programs: names,
    };
    print(&run, chosen);
    let report = options
        .report
        .clone()
        .unwrap_or_else(|| folder.file("report.html"));
    drawing::write(&report, &run, chosen)?;
    let _ = writeln!(stdout(), "report: {}", report.display());
    if let Some(path) = &options.apply {
        apply(path, &run, &tuned.points[chosen])?;
        let _ = writeln!(stdout(), "settings: {}", path.display());
    }
    Ok(if tuned.points[chosen].is_kept() {
        0
    } else {
        FAULT
    })
}

/// What varies must be something that the machine file may say, at one end of its values at least.
fn check_keys(options: &args::Tune) -> Result<(), Box<dyn Error>> {
    let args::MachineFile { path, overrides } = &options.machine;
    for parameter in &options.vary {
        let with = |share: f64| {
            let set = parameter
                .set(&parameter.values.at(share))
                .collect::<Vec<_>>();
            Machine::read(path, &[overrides.clone(), set].concat())
        };
        if let (Err(error), Err(_)) = (with(0.0), with(1.0)) {
            return Err(error.into());
        }
    }
    Ok(())
}

/// The values of the machine as it is, where it states every key that varies.
fn stated(machine: &Machine, options: &args::Tune) -> Option<Point> {
    let table: toml::Table = machine.effective_toml().parse().ok()?;
    let value = |key: &String| stated_value(&table, key);
    options
        .vary
        .iter()
        .map(|parameter| parameter.keys.first().and_then(value))
        .collect()
}

/// The value of a dotted key, as text.
pub fn stated_value(table: &toml::Table, key: &str) -> Option<String> {
    let mut parts = key.split('.');
    let mut value = table.get(parts.next()?)?;
    for part in parts {
        value = value.as_table()?.get(part)?;
    }
    Some(match value {
        toml::Value::String(text) => text.clone(),
        other => other.to_string(),
    })
}

fn progress(points: &[Tried], task: &Task) {
    let kept = points.iter().filter(|point| point.is_kept());
    let best = kept
        .map(|point| point.score.objective)
        .fold(f64::INFINITY, f64::min);
    let best = if best.is_finite() {
        format!(", best {best:.4}")
    } else {
        String::new()
    };
    show(&format!(
        "{} of {} settings{best}",
        points.len(),
        task.budget
    ));
}

/// `value` of the number `key`, with its unit.
pub fn with_unit(key: &str, value: f64) -> String {
    let (name, scale) = label(key);
    let unit = name.rsplit_once(", ").map_or("", |(_, unit)| unit);
    let value = value * scale;
    let decimals = if value.abs() >= 100.0 { 2 } else { 3 };
    format!("{value:.decimals$} {unit}").trim_end().to_string()
}

/// What people call a number, with its unit, and what it is multiplied by for that unit.
pub fn label(key: &str) -> (String, f64) {
    let plain = |name: &str| name.trim_start_matches("max_").replace('_', " ");
    for (ending, unit, scale) in [
        ("_error_mm", "µm", 1e3),
        ("_deviation_mm", "µm", 1e3),
        ("_nm", "N·m", 1.0),
        ("_mm", "mm", 1.0),
        ("_s", "s", 1.0),
    ] {
        if let Some(name) = key.strip_suffix(ending) {
            let end = ending
                .trim_end_matches("_mm")
                .trim_end_matches("_s")
                .trim_end_matches("_nm");
            let name = if key == "motion_time_s" {
                "time".to_string()
            } else {
                plain(&format!("{name}{end}"))
            };
            return (format!("{name}, {unit}"), scale);
        }
    }
    (key.to_string(), 1.0)
}

/// The first sentence of what came out.
pub fn verdict(run: &TuneRun<'_>, chosen: usize) -> String {
    let (task, points) = (run.task, &run.tuned.points);
    let (best, as_it_is) = (&points[chosen], &points[0]);
    let name = |key: &str| {
        label(key)
            .0
            .rsplit_once(", ")
            .map_or(key.to_string(), |(name, _)| name.to_string())
    };
    let mut text = format!(
        "{} {}",
        name(&task.objective),
        with_unit(&task.objective, best.score.objective)
    );
    if let Some(before) = as_it_is
        .number(&task.objective)
        .filter(|before| *before > 0.0)
    {
        let percent = 100.0 * (best.score.objective / before - 1.0);
        let _ = write!(
            text,
            ", {percent:+.1} % against the machine as it is ({})",
            with_unit(&task.objective, before)
        );
    }
    if let Some(value) = best.number(&task.against) {
        let _ = write!(
            text,
            "; {} {}",
            name(&task.against),
            with_unit(&task.against, value)
        );
        if let Some(before) = as_it_is.number(&task.against) {
            let _ = write!(text, " (as it is {})", with_unit(&task.against, before));
        }
    }
    if !best.is_kept() {
        text += "; no settings keep every limit, and these break them least";
    }
    text
}

fn print(run: &TuneRun<'_>, chosen: usize) {
    let (task, tuned) = (run.task, run.tuned);
    let count = run.programs.len();
    let mut text = format!(
        "{} settings of {} on {count} program{}\n{}\n",
        tuned.points.len(),
        run.machine.name,
        if count == 1 { "" } else { "s" },
        verdict(run, chosen)
    );
    for (key, value) in set_of(&task.parameters, tuned.points[chosen].values.as_ref()) {
        let _ = writeln!(text, "  {key} = {}", toml_value(&value));
    }
    if tuned.points[chosen].values.is_none() {
        text += "  the machine as it is\n";
    }
    // A reader that has gone away (a closed pipe) is no reason to fail.
    let _ = stdout().write_all(text.as_bytes());
}

/// A value as the machine file would have it: what is not TOML is a string.
fn toml_value(text: &str) -> String {
    let is_toml = format!("v = {text}").parse::<toml::Table>().is_ok();
    if is_toml {
        text.to_string()
    } else {
        toml::Value::String(text.to_string()).to_string()
    }
}

/// Writes the chosen settings as a machine file that includes the one they are for.
fn apply(path: &Path, run: &TuneRun<'_>, chosen: &Tried) -> Result<(), Box<dyn Error>> {
    let machine = std::path::absolute(&run.options.machine.path)?;
    let include = toml::Value::String(machine.display().to_string());
    let mut text = format!("format = 1\ninclude = [{include}]\n");
    let set = set_of(&run.task.parameters, chosen.values.as_ref());
    let mut tables: Vec<(String, Vec<String>)> = vec![];
    for (key, value) in run.options.machine.overrides.iter().chain(&set) {
        let (table, name) = key.rsplit_once('.').unwrap_or(("", key));
        let line = format!("{name} = {}", toml_value(value));
        if !tables.iter().any(|(one, _)| one == table) {
            tables.push((table.to_string(), vec![]));
        }
        let of_table = tables.iter_mut().filter(|(one, _)| one == table);
        for (_, lines) in of_table {
            // The later ones count, as on the command line.
            lines.retain(|other| !other.starts_with(&format!("{name} = ")));
            lines.push(line.clone());
        }
    }
    for (table, lines) in &tables {
        let _ = write!(text, "\n[{table}]\n{}\n", lines.join("\n"));
    }
    let mut out = Output::create(path)?;
    out.write_all(text.as_bytes())?;
    out.finish()?;
    // What it says is what was found: read back before anybody relies on it.
    Machine::read(path, &[])?;
    Ok(())
}
