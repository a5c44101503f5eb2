//! `tandem estimate`.

mod drawing;
mod shown;

use std::error::Error;
use std::io::{IsTerminal, Write, stderr};
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};
use std::thread;

use tandem_estimate::{Choice, Estimate, measurements, model_file, program_errors};
use tandem_host::{Switches, with_stand_ins};
use tandem_machine::Machine;

use crate::{REFUSED, args, built_in, program};

/// Estimates the time of programs.
pub fn estimate(options: &args::Estimate) -> Result<u8, Box<dyn Error>> {
    let machine = Machine::read(&options.machine.file.path, &options.machine.file.overrides)?;
    let choice = choice(&options.model, &machine)?;
    let (machine, notes) = with_stand_ins(
        &machine,
        &built_in::registry()?,
        Some(built_in::IDEAL_DRIVES),
    )?;
    for note in &notes {
        say!("{note}");
    }
    let (block_delete, assumes_edges) = (options.machine.block_delete, !notes.is_empty());
    let switches = Switches {
        block_delete,
        assumes_edges,
        ..Switches::default()
    };
    let one = |path: &Path| one(path, &machine, switches, &choice);
    let results = in_parallel(&options.programs, &one);
    let mut estimates = vec![];
    let mut refused = false;
    for result in results {
        match result {
            Ok(estimate) => {
                if estimate.assumed_edges > 0 {
                    let (program, count) = (&estimate.program, estimate.assumed_edges);
                    say!(
                        "{program}: {count} edges of inputs were assumed at the end of the motion towards them"
                    );
                }
                estimates.push(estimate);
            }
            Err(cause) => {
                refused = true;
                say!("{cause}");
            }
        }
    }
    let measured = match &options.measured {
        Some(path) => measurements::read_programs(path)?,
        None => vec![],
    };
    let text = if options.json {
        shown::json(&estimates, &measured)
    } else {
        shown::table(&estimates) + &shown::beside(&estimates, &measured)
    };
    // A reader that has gone away (a closed pipe) is no reason to fail.
    let _ = std::io::stdout().write_all(text.as_bytes());
    if let Some(path) = &options.report {
        drawing::write(path, &machine, &estimates)?;
    }
    Ok(if refused { REFUSED } else { 0 })
}

/// The model that the command line names: a file, where it looks like one.
fn choice(name: &str, machine: &Machine) -> Result<Choice, Box<dyn Error>> {
    let path = Path::new(name);
    let file = name.contains('/')
        || path
            .extension()
            .is_some_and(|extension| extension == "toml");
    Ok(if file {
        model_file::read(path)?
    } else {
        Choice::named(name, machine)?
    })
}

/// One program; why not, in words.
fn one(
    path: &Path,
    machine: &Machine,
    switches: Switches,
    choice: &Choice,
) -> Result<Estimate, String> {
    let program = program::open(path).map_err(|e| e.to_string())?;
    let name = program.name().to_string();
    let registry = built_in::registry()?;
    tandem_estimate::estimate(machine, &registry, program, switches, choice).map_err(|error| {
        let Some(report) = program_errors(&error) else {
            return error.to_string();
        };
        let count = report.diagnostics.len() as u64 + report.unlisted;
        let mut text: Vec<String> = report.diagnostics.iter().map(ToString::to_string).collect();
        text.push(format!(
            "{name}: {count} error{}",
            if count == 1 { "" } else { "s" }
        ));
        text.join("\n")
    })
}

/// What `work` makes of each path, in their order; as many at once as there are cores.
fn in_parallel<T: Send>(paths: &[PathBuf], work: &(impl Fn(&Path) -> T + Sync)) -> Vec<T> {
    let (next, done) = (AtomicUsize::new(0), AtomicUsize::new(0));
    let results: Mutex<Vec<(usize, T)>> = Mutex::new(Vec::with_capacity(paths.len()));
    let active = stderr().is_terminal();
    let show = || {
        if active {
            let _ = write!(
                stderr(),
                "\r\x1b[K{} of {} programs",
                done.load(Relaxed),
                paths.len()
            );
        }
    };
    let worker = || {
        while let Some((index, path)) =
            Some(next.fetch_add(1, Relaxed)).and_then(|i| Some((i, paths.get(i)?)))
        {
            let result = work(path);
            results
                .lock()
                .expect("no worker panics with the lock")
                .push((index, result));
            done.fetch_add(1, Relaxed);
            show();
        }
    };
    show();
    let cores = thread::available_parallelism()
        .map_or(1, usize::from)
        .min(paths.len());
    thread::scope(|scope| (0..cores).for_each(|_| drop(scope.spawn(worker))));
    if active {
        let _ = write!(stderr(), "\r\x1b[K");
    }
    let mut results = results
        .into_inner()
        .expect("no worker panics with the lock");
    results.sort_by_key(|(index, _)| *index);
    results.into_iter().map(|(_, result)| result).collect()
}
