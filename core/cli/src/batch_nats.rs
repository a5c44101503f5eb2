//! `tandem batch … --nats`.

use std::collections::BTreeMap;
use std::error::Error;
use std::io::{Write, stdout};
use std::path::Path;
use std::process;
use std::sync::Arc;
use std::time::Duration;

use tandem_batch::{Build, Folder, JobResult, simulate};
use tandem_batch_nats::{Server, Worker};

use crate::batch::{collect, list, plugins, show, stop_at_signals, threads};
use crate::{FAULT, args};

/// Does `command` at the server at `url`.
pub fn batch(command: &args::Batch, folder: &Path, url: &str) -> Result<u8, Box<dyn Error>> {
    let (_, nats) = command.place();
    let of_folder = folder.file_name().map(|name| name.to_string_lossy());
    let name = nats.name.as_deref().or(of_folder.as_deref());
    let server = Server::connect(url, name.unwrap_or_default())?;
    match command {
        args::Batch::Submit(options) => {
            let folder = list(options)?;
            let ack_wait = Duration::from_secs(nats.ack_wait_s);
            server.submit(&folder.jobs()?, &folder.inputs()?, ack_wait)?;
            Ok(0)
        }
        args::Batch::Worker(options) => work(&server, options),
        args::Batch::Status(_) => status(&server, &Folder::open(folder)?),
        args::Batch::Collect(options) => {
            let folder = Folder::open(folder)?;
            let results = keep(&server, &folder)?;
            collect(
                &folder,
                &results,
                options.csv.as_deref(),
                options.sqlite.as_deref(),
            )
        }
        args::Batch::Cancel(_) => {
            server.cancel()?;
            Ok(0)
        }
    }
}

fn work(server: &Server, options: &args::Worker) -> Result<u8, Box<dyn Error>> {
    let inputs = Arc::new(Folder::create(&options.folder)?.inputs()?);
    let of_jobs = Arc::clone(&inputs);
    let worker = Worker {
        inputs,
        build: Build::of_this_process()?,
        simulate: Arc::new(move |job| simulate(job, &of_jobs, &plugins())),
        threads: threads(options.threads),
        stop: stop_at_signals()?,
        name: format!(
            "{}-{}",
            rustix::system::uname().nodename().to_string_lossy(),
            process::id()
        ),
        tell: Arc::new(|done| show(&format!("{done} jobs"))),
    };
    let done = server.work(&worker)?;
    show("");
    let _ = writeln!(stdout(), "{done} jobs done");
    Ok(0)
}

fn status(server: &Server, folder: &Folder) -> Result<u8, Box<dyn Error>> {
    let (jobs, progress) = (folder.jobs()?.len(), server.progress()?);
    let is_whole = progress.done >= jobs;
    let _ = writeln!(
        stdout(),
        "{} of {jobs} jobs done, {} of them twice{}",
        progress.done,
        progress.again,
        if !is_whole && progress.left == 0 {
            ", cancelled"
        } else {
            ""
        }
    );
    Ok(if is_whole { 0 } else { FAULT })
}

/// Keeps what the server has in the folder; the folder's results, and those that differ beside them.
fn keep(
    server: &Server,
    folder: &Folder,
) -> Result<BTreeMap<String, Vec<JobResult>>, Box<dyn Error>> {
    let collected = server.collect(&folder.jobs()?)?;
    let mut differing = collected.differing;
    for result in collected.results {
        // Of the same name, and not the same: one of the two computers is not to be trusted, and which one is not known.
        let there = folder.results(result.build.clone())?.get(&result.job);
        match there {
            Some(there) if there == result => {}
            Some(_) => differing.push(result),
            None => folder.record(&result)?,
        }
    }
    let mut results = folder.all_results()?;
    for result in differing {
        results.entry(result.job.clone()).or_default().push(result);
    }
    Ok(results)
}
