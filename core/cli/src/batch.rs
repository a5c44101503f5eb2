//! `tandem batch`.

use std::collections::BTreeMap;
use std::error::Error;
use std::io::{IsTerminal, Write, stderr, stdout};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::thread;

use signal_hook::consts::{SIGINT, SIGTERM};
use tandem_batch::{
    Bench, Build, Folder, Inputs, Job, JobResult, Listed, Plugins, Shard, Table, files, grid,
    simulate,
};
use tandem_machine::Machine;
use tandem_recorder::Output;

use crate::{FAULT, args, built_in};

/// How many jobs a worker takes between two looks whether it is to stop.
const AT_ONCE: usize = 64;

/// Many simulations.
pub fn batch(command: &args::Batch) -> Result<u8, Box<dyn Error>> {
    if let (folder, args::Nats { url: Some(url), .. }) = command.place() {
        return at_a_server(command, folder, url);
    }
    match command {
        args::Batch::Submit(options) => submit(options),
        args::Batch::Worker(options) => {
            let folder = Folder::open(&options.folder)?;
            work(
                &folder,
                options.shard.unwrap_or(Shard::ALL),
                options.threads,
            )
        }
        args::Batch::Status(of) => status(&of.folder),
        args::Batch::Collect(options) => {
            let folder = Folder::open(&options.folder)?;
            let results = folder.all_results()?;
            collect(
                &folder,
                &results,
                options.csv.as_deref(),
                options.sqlite.as_deref(),
            )
        }
        args::Batch::Cancel(args::BatchFolder { folder, .. }) => {
            Folder::open(folder)?.cancel()?;
            Ok(0)
        }
    }
}

#[cfg(feature = "nats")]
use crate::batch_nats::batch as at_a_server;

#[cfg(not(feature = "nats"))]
fn at_a_server(_: &args::Batch, _: &Path, _: &str) -> Result<u8, Box<dyn Error>> {
    Err("this tandem was built without NATS: build it with the feature nats".into())
}

/// The plugins that are linked in.
pub fn plugins() -> Plugins<'static> {
    Plugins {
        registry: &built_in::registry,
        ideal_drives: built_in::IDEAL_DRIVES,
    }
}

/// The hashes of the programs that `patterns` name, with their names.
pub fn programs(
    patterns: &[String],
    inputs: &Inputs,
) -> Result<Vec<(PathBuf, String)>, Box<dyn Error>> {
    let mut programs = vec![];
    for pattern in patterns {
        for path in files(pattern)? {
            let hash = inputs.put_file(&path)?;
            programs.push((path, hash));
        }
    }
    Ok(programs)
}

/// Set by the first Ctrl-C, or SIGTERM; the second ends the process.
pub fn stop_at_signals() -> Result<Arc<AtomicBool>, Box<dyn Error>> {
    let stop = Arc::new(AtomicBool::new(false));
    for signal in [SIGINT, SIGTERM] {
        signal_hook::flag::register_conditional_default(signal, Arc::clone(&stop))?;
        signal_hook::flag::register(signal, Arc::clone(&stop))?;
    }
    Ok(stop)
}

/// As many as are asked for, or as there are cores.
pub fn threads(asked: Option<u16>) -> usize {
    asked.map_or_else(
        || thread::available_parallelism().map_or(1, usize::from),
        usize::from,
    )
}

/// A line that the next one replaces, on a terminal.
pub fn show(text: &str) {
    if stderr().is_terminal() {
        let _ = write!(stderr(), "\r\x1b[K{text}");
    }
}

/// Lists the jobs in the folder, and says how many.
pub fn list(options: &args::Submit) -> Result<Folder, Box<dyn Error>> {
    let folder = Folder::create(&options.folder)?;
    let inputs = folder.inputs()?;
    let programs = programs(&options.programs, &inputs)?;
    let sets = grid(&options.vary)?;
    let mut jobs = vec![];
    for path in &options.machine {
        let machine = Machine::read(path, &options.overrides)?;
        let hash = inputs.put_machine(&machine)?;
        for (program, text) in &programs {
            let job = |set: &Vec<(String, String)>| Listed {
                program: program.display().to_string(),
                machine: machine.name.clone(),
                job: Job {
                    program: text.clone(),
                    machine: hash.clone(),
                    set: set.clone(),
                    block_delete: options.block_delete,
                },
            };
            jobs.extend(sets.iter().map(job));
        }
    }
    folder.submit(&jobs)?;
    let _ = writeln!(
        stdout(),
        "{}: {} jobs: {} programs, {} machines, {} settings",
        options.folder.display(),
        jobs.len(),
        programs.len(),
        options.machine.len(),
        sets.len()
    );
    Ok(folder)
}

fn submit(options: &args::Submit) -> Result<u8, Box<dyn Error>> {
    let folder = list(options)?;
    if !options.local {
        return Ok(0);
    }
    match work(&folder, Shard::ALL, None)? {
        0 => collect(&folder, &folder.all_results()?, None, None),
        status => Ok(status),
    }
}

/// Simulates what belongs to `shard`; exit status 3 where it was stopped before its end.
fn work(folder: &Folder, shard: Shard, asked: Option<u16>) -> Result<u8, Box<dyn Error>> {
    let (inputs, results) = (folder.inputs()?, folder.results(Build::of_this_process()?)?);
    let all = folder.jobs()?;
    let own = all
        .into_iter()
        .enumerate()
        .filter(|(place, _)| shard.has(*place));
    let jobs: Vec<Job> = own.map(|(_, listed)| listed.job).collect();
    let (plugins, stop, marks) = (plugins(), stop_at_signals()?, folder.marks());
    let mut done = 0;
    for some in jobs.chunks(AT_ONCE * threads(asked)) {
        if folder.is_cancelled() {
            stop.store(true, Relaxed);
        }
        let (before, count) = (done, jobs.len());
        let bench = Bench {
            results: &results,
            marks: &marks,
            simulate: &|job| simulate(job, &inputs, &plugins),
            threads: threads(asked),
            stop: &stop,
            tell: &|now| show(&format!("{} of {count} jobs", before + now)),
        };
        done += bench.run(some)?.iter().flatten().count();
    }
    show("");
    let _ = writeln!(stdout(), "{done} of {} jobs done", jobs.len());
    Ok(if done == jobs.len() { 0 } else { FAULT })
}

fn status(path: &Path) -> Result<u8, Box<dyn Error>> {
    let folder = Folder::open(path)?;
    let (jobs, results) = (folder.jobs()?, folder.all_results()?);
    let table = Table::new(&jobs, &results, &Build::of_this_process()?);
    let _ = writeln!(
        stdout(),
        "{} of {} jobs done, {} of them without numbers{}",
        table.len(),
        jobs.len(),
        table.without_numbers.len(),
        if folder.is_cancelled() {
            ", cancelled"
        } else {
            ""
        }
    );
    Ok(if table.missing == 0 { 0 } else { FAULT })
}

/// Writes the table of `results`; exit status 3 where some are missing or differ.
pub fn collect(
    folder: &Folder,
    results: &BTreeMap<String, Vec<JobResult>>,
    csv: Option<&Path>,
    sqlite: Option<&Path>,
) -> Result<u8, Box<dyn Error>> {
    let jobs = folder.jobs()?;
    let table = Table::new(&jobs, results, &Build::of_this_process()?);
    let path = csv.map_or_else(|| folder.file("results.csv"), Path::to_path_buf);
    let mut out = Output::create(&path)?;
    table
        .write_csv(&mut out)
        .map_err(|e| format!("{}: {e}", path.display()))?;
    out.finish()?;
    if let Some(path) = sqlite {
        table.write_sqlite(path)?;
    }
    for (place, cause) in &table.without_numbers {
        say!("{}: {cause}", shown(&jobs[*place]));
    }
    for place in &table.differing {
        say!(
            "{}: {}",
            shown(&jobs[*place]),
            differing(&results[&jobs[*place].job.id()])
        );
    }
    let _ = writeln!(
        stdout(),
        "{} of {} jobs in {}",
        table.len(),
        jobs.len(),
        path.display()
    );
    let whole = table.missing == 0 && table.differing.is_empty();
    Ok(if whole { 0 } else { FAULT })
}

fn shown(listed: &Listed) -> String {
    let set = tandem_batch::shown(&listed.job.set);
    format!(
        "{} on {}{}{set}",
        listed.program,
        listed.machine,
        if set.is_empty() { "" } else { " " }
    )
}

fn differing(results: &[JobResult]) -> String {
    let build =
        |result: &JobResult| format!("{:.8}/{:.8}", result.build.binary, result.build.maths);
    let builds: Vec<String> = results.iter().map(build).collect();
    format!(
        "other results from other builds or computers: {}",
        builds.join(", ")
    )
}
