//! The campaign as a command.

use std::ops::RangeInclusive;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration;

use clap::{Parser, Subcommand};
use tandem_campaign::campaign::{Plan, campaign};
use tandem_campaign::case::Case;
use tandem_campaign::draw::draw;
use tandem_campaign::machine::Planner;
use tandem_campaign::minimise::minimise;
use tandem_campaign::worker::{Worker, serve};

/// Random machines, programs and operators, driven and judged.
#[derive(Parser)]
#[command(args_conflicts_with_subcommands = true)]
struct Arguments {
    #[command(subcommand)]
    command: Option<Command>,
    /// First and last seed, as in 1..20000
    #[arg(long, default_value = "1..1000", value_parser = seeds)]
    seeds: RangeInclusive<u64>,
    /// All machines have this planner
    #[arg(long, value_parser = planner)]
    planner: Option<Planner>,
    /// Runs at the same time
    #[arg(long, default_value_t = 2)]
    jobs: usize,
    /// Seconds of a processor that a run may take
    #[arg(long, default_value_t = 30)]
    patience_s: u64,
    /// Failures of each planner and kind that are made smaller
    #[arg(long, default_value_t = 2)]
    minimise: u64,
    /// Runs that making one smaller may take
    #[arg(long, default_value_t = 1500)]
    minimiser_runs: u32,
    /// Folder for what fails
    #[arg(long, default_value = "target/campaign")]
    out: PathBuf,
}

#[derive(Subcommand)]
enum Command {
    /// Drives and judges the case in a folder
    Judge {
        /// A folder with program.ngc, machine.toml and, where there are any, commands.csv
        folder: PathBuf,
    },
    /// Makes the failing case in a folder smaller
    Minimise {
        /// A folder as for judge
        folder: PathBuf,
        /// Folder for the smaller case
        out: PathBuf,
    },
    /// Writes the case of a seed to a folder
    Draw {
        /// The seed
        seed: u64,
        /// Folder for the files
        out: PathBuf,
        /// The planner of the machine
        #[arg(long, value_parser = planner)]
        planner: Option<Planner>,
    },
    /// Drives what the parent writes to standard input
    #[command(hide = true)]
    Worker,
}

fn seeds(text: &str) -> Result<RangeInclusive<u64>, String> {
    let number = |text: &str| {
        text.trim_start_matches('=')
            .parse::<u64>()
            .map_err(|e| e.to_string())
    };
    let (first, last) = text
        .split_once("..")
        .ok_or("seeds are written as 1..20000")?;
    Ok(number(first)?..=number(last)?)
}

fn planner(name: &str) -> Result<Planner, String> {
    Planner::named(name).ok_or_else(|| "no such planner".to_string())
}

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    match act(arguments) {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        Err(cause) => {
            eprintln!("{cause}");
            ExitCode::from(2)
        }
    }
}

/// Whether nothing failed.
fn act(arguments: Arguments) -> Result<bool, String> {
    let binary = std::env::current_exe().map_err(|e| e.to_string())?;
    let patience = Duration::from_secs(arguments.patience_s);
    let spare = |name: &str| {
        std::env::temp_dir().join(format!("tandem-campaign-{name}-{}", std::process::id()))
    };
    match arguments.command {
        Some(Command::Worker) => serve().map(|()| true).map_err(|e| e.to_string()),
        Some(Command::Judge { folder }) => {
            let work = spare("judge");
            let report = Worker::new(&binary, &work, patience).run(&Case::read(&folder)?);
            let _ = std::fs::remove_dir_all(work);
            println!("{report:?}");
            Ok(!report.is_failure())
        }
        Some(Command::Minimise { folder, out }) => {
            let (work, case) = (spare("minimise"), Case::read(&folder)?);
            let mut worker = Worker::new(&binary, &work, patience);
            let report = worker.run(&case);
            if !report.is_failure() {
                return Err(format!("it does not fail: {report:?}"));
            }
            let (smallest, report) = minimise(
                &mut |case| worker.run(case),
                &case,
                &report,
                arguments.minimiser_runs,
            );
            let _ = std::fs::remove_dir_all(work);
            smallest.write(&out)?;
            println!("{report:?}\n{}", Case::replay(&out));
            Ok(true)
        }
        Some(Command::Draw { seed, out, planner }) => {
            draw(seed, planner).write(&out).map(|()| true)
        }
        None => {
            let Arguments {
                seeds,
                planner,
                jobs,
                minimise,
                minimiser_runs,
                out,
                ..
            } = arguments;
            println!("seeds {} to {}, {jobs} jobs", seeds.start(), seeds.end());
            let plan = Plan {
                seeds,
                planner,
                jobs,
                patience,
                minimised: minimise,
                minimiser_runs,
                binary,
                out,
            };
            let tally = campaign(&plan, &|words| print!("{words}"));
            print!("{}", tally.table());
            Ok(tally.passed())
        }
    }
}
