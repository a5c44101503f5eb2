//! `oracle`: judges a trace from the command line.
//!
//! Exit status: 0 pass, 1 fail, 2 usage (a file that cannot be opened included), 3 not judged.

use std::io::Write;
use std::{path::PathBuf, process::ExitCode};

use clap::Parser;
use tandem_oracle::{Error, Machine, Options, Outcome, Trace, Verdict, judge};

/// Judges whether a run kept the machine's limits and the programmed path.
#[derive(Parser)]
#[command(name = "oracle")]
struct Arguments {
    /// Trace CSV of the run.
    trace: PathBuf,
    /// Part program.
    program: PathBuf,
    /// machine.toml of the run.
    machine: PathBuf,
    /// Order of the limits: 2 for velocity and acceleration, 3 for jerk as well.
    #[arg(long, default_value_t = 2, value_parser = clap::value_parser!(u8).range(2..=3))]
    order: u8,
    /// Speed step allowed where blocks meet, linear axes.
    #[arg(long, value_name = "X")]
    speed_difference_mm_per_min: Option<f64>,
    /// Speed step allowed where blocks meet, rotary axes.
    #[arg(long, value_name = "X")]
    speed_difference_deg_per_min: Option<f64>,
    /// Greatest distance of a sample from the path.
    #[arg(long, value_name = "X")]
    sample_tolerance_mm: Option<f64>,
    /// Greatest distance of a programmed vertex from the samples.
    #[arg(long, value_name = "X")]
    vertex_tolerance_mm: Option<f64>,
    /// Greatest distance of an exact-stop position from the nearest sample.
    #[arg(long, value_name = "X", default_value_t = 1e-9)]
    exact_stop_tolerance_mm: f64,
    /// Highest feed ratio asked for during the run.
    #[arg(long, value_name = "X", default_value_t = 1.0)]
    max_ratio: f64,
    /// Relative tolerance of the path speed.
    #[arg(long, value_name = "X", default_value_t = 1e-6)]
    feed_tolerance: f64,
    /// How long another block may lend its feed, for planners that let blocks overlap.
    #[arg(long, value_name = "X")]
    feed_window_ms: Option<f64>,
    /// The fine period of the run, where it is not the machine's.
    #[arg(long, value_name = "X")]
    fine_period_ms: Option<f64>,
    /// The planner of the run, where it is not the machine's.
    #[arg(long, value_name = "NAME")]
    planner: Option<String>,
    /// The run stopped before the end of the program.
    #[arg(long)]
    ends_early: bool,
    /// Judge the path up to this time only.
    #[arg(long, value_name = "X")]
    path_until_s: Option<f64>,
    /// Leave out program lines that begin with a slash.
    #[arg(long)]
    block_delete: bool,
}

fn main() -> ExitCode {
    match run(&Arguments::parse()) {
        Ok(verdict) => {
            // The exit status tells the verdict where nobody reads on.
            let _ = writeln!(std::io::stdout(), "{verdict}");
            ExitCode::from(match verdict.outcome {
                Outcome::Pass => 0,
                Outcome::Fail => 1,
                Outcome::NotJudged { .. } => 3,
            })
        }
        Err(error) => {
            let _ = writeln!(std::io::stderr(), "oracle: {error}");
            ExitCode::from(if matches!(error, Error::Open { .. }) {
                2
            } else {
                3
            })
        }
    }
}

fn run(arguments: &Arguments) -> Result<Verdict, Error> {
    let trace = Trace::read(&arguments.trace)?;
    let program = std::fs::read(&arguments.program).map_err(|cause| Error::Open {
        file: arguments.program.display().to_string(),
        cause: cause.to_string(),
    })?;
    let machine = arguments.machine(Machine::read(&arguments.machine)?);
    Ok(judge(
        &trace,
        &String::from_utf8_lossy(&program),
        &machine,
        &arguments.options(),
    ))
}

impl Arguments {
    fn machine(&self, mut machine: Machine) -> Machine {
        if let Some(period_ms) = self.fine_period_ms {
            machine.fine_period_s = period_ms / 1000.0;
        }
        if let Some(planner) = &self.planner {
            machine.planner.clone_from(planner);
        }
        machine
    }

    fn options(&self) -> Options {
        let mut options = if self.order == 3 {
            Options::with_jerk()
        } else {
            Options::default()
        };
        let per_s = |per_min: f64| per_min / 60.0;
        options.speed_difference_mm_per_s = self
            .speed_difference_mm_per_min
            .map(per_s)
            .or(options.speed_difference_mm_per_s);
        options.speed_difference_deg_per_s = self
            .speed_difference_deg_per_min
            .map(per_s)
            .or(options.speed_difference_deg_per_s);
        Options {
            sample_tolerance_mm: self.sample_tolerance_mm,
            vertex_tolerance_mm: self.vertex_tolerance_mm,
            exact_stop_tolerance_mm: self.exact_stop_tolerance_mm,
            max_ratio: self.max_ratio,
            feed_tolerance: self.feed_tolerance,
            feed_window_s: self.feed_window_ms.map(|window_ms| window_ms / 1000.0),
            ends_early: self.ends_early,
            path_until_s: self.path_until_s,
            block_delete: self.block_delete,
            ..options
        }
    }
}
