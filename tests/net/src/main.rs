//! Compares two builds of `tandem` over all examples, random programs, and the cases of the scenarios, and prints what
//! differs. `CONTRIBUTING.md` says when to use it.
//!
//! It is a crate of its own because it draws with the campaign's generator, which itself stands on `tests/rig`.

mod cases;
mod compare;
mod declared;
mod numbers;
mod run;
mod tally;

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use clap::Parser;

use crate::cases::Case;
use crate::compare::{Finding, compare};
use crate::declared::Declared;
use crate::tally::Tally;

/// Compares what two builds of tandem do; prints differences only, then a table. Exit status 1: they differ.
#[derive(Parser)]
struct Arguments {
    /// The build as it was
    old: PathBuf,
    /// The build as it is
    new: PathBuf,
    /// Folder with cases that the scenarios recorded
    #[arg(long)]
    cases: Option<PathBuf>,
    /// Random programs with each of the five planners
    #[arg(long, default_value_t = 40)]
    seeds: u64,
    /// Only cases whose name has this in it
    #[arg(long, default_value = "")]
    only: String,
    /// The changes that are meant
    #[arg(long, default_value = "tests/net/messages.toml")]
    messages: PathBuf,
    /// Runs at the same time
    #[arg(long, default_value_t = 2)]
    jobs: usize,
    /// Folder in which the files of cases that differ are left
    #[arg(long, default_value = "target/net/different")]
    keep: PathBuf,
}

fn main() -> ExitCode {
    match act(&Arguments::parse()) {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        Err(cause) => {
            eprintln!("{cause}");
            ExitCode::from(2)
        }
    }
}

/// Whether nothing differs.
fn act(arguments: &Arguments) -> Result<bool, String> {
    let declared = Declared::read(&arguments.messages)?;
    let binaries = [&arguments.old, &arguments.new].map(|path| {
        path.canonicalize()
            .map_err(|e| format!("{}: {e}", path.display()))
    });
    let [old, new] = binaries;
    let binaries = [old?, new?];
    let mut cases = cases::all(&project(), arguments.cases.as_deref(), arguments.seeds)?;
    cases.retain(|case| case.name.contains(&arguments.only));
    let _ = std::fs::remove_dir_all(&arguments.keep);
    let findings = compare_all(arguments, &binaries, &cases, &declared)?;
    let mut tally = Tally::default();
    for (case, finding) in cases.iter().zip(&findings) {
        print!("{}", finding.text(&case.name));
        tally.add(case, finding);
    }
    print!("{}", tally.text());
    for unused in declared.unused() {
        println!("the declared change of {unused:?} was met nowhere");
    }
    Ok(tally.passed())
}

/// The folder of the workspace.
fn project() -> PathBuf {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    folder.canonicalize().unwrap_or(folder)
}

/// Every case with both builds, in the order of the cases.
fn compare_all(
    arguments: &Arguments,
    binaries: &[PathBuf; 2],
    cases: &[Case],
    declared: &Declared,
) -> Result<Vec<Finding>, String> {
    let next = AtomicUsize::new(0);
    let found: Mutex<Vec<Option<Result<Finding, String>>>> =
        Mutex::new(cases.iter().map(|_| None).collect());
    std::thread::scope(|scope| {
        for _ in 0..arguments.jobs.max(1) {
            scope.spawn(|| {
                while let Some((index, case)) = take(&next, cases) {
                    let finding = compare(case, binaries, declared, &arguments.keep);
                    found.lock().expect("no comparison panics").as_mut_slice()[index] =
                        Some(finding);
                }
            });
        }
    });
    let found = found.into_inner().expect("no comparison panics");
    found
        .into_iter()
        .map(|finding| finding.expect("every case is compared"))
        .collect()
}

fn take<'a>(next: &AtomicUsize, cases: &'a [Case]) -> Option<(usize, &'a Case)> {
    let index = next.fetch_add(1, Ordering::Relaxed);
    cases.get(index).map(|case| (index, case))
}
