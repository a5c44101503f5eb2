//! Many simulations.

use std::path::{Path, PathBuf};

use clap::{Args as Group, Subcommand};
use tandem_batch::{Keep, Parameter, Shard};

use super::{MachineFile, file_name};

#[derive(Group)]
pub struct Tune {
    #[command(flatten)]
    pub machine: MachineFile,
    /// The part programs; a name with * or ? stands for all that it fits
    #[arg(long, required = true, num_args = 1.., value_name = "F.ngc")]
    pub programs: Vec<String>,
    /// What varies: values, as in planner.options.rounds=2,3, or a range, as in motion.path_tolerance_mm=0.005..0.05
    #[arg(long, required = true, value_name = "KEY=VALUES", value_parser = Parameter::read)]
    pub vary: Vec<Parameter>,
    /// What is to be small: time, or a number of the summary
    #[arg(long, value_name = "NUMBER", default_value = "time")]
    pub objective: String,
    /// A limit that must be kept, as in 'max_path_deviation_mm<=0.02'
    #[arg(long, value_name = "NUMBER<=LIMIT", value_parser = Keep::read)]
    pub keep: Vec<Keep>,
    /// The number that the objective is drawn against
    #[arg(long, value_name = "NUMBER", default_value = "max_path_deviation_mm")]
    pub against: String,
    /// Settings to try at most; each is a simulation of every program
    #[arg(long, value_name = "N", default_value = "200", value_parser = clap::value_parser!(u32).range(2..=1_000_000))]
    pub budget: u32,
    /// The same seed gives the same answer
    #[arg(long, value_name = "N", default_value = "1")]
    pub seed: u64,
    /// Where inputs and results lie; the same command goes on there
    #[arg(long, value_name = "FOLDER", default_value = "tandem-tune")]
    pub folder: PathBuf,
    /// Draw what was found; report.html in the folder without it
    #[arg(long, value_name = "F.html", value_parser = file_name)]
    pub report: Option<PathBuf>,
    /// Write the chosen values as a machine file that includes this one
    #[arg(long, value_name = "F.toml", value_parser = file_name)]
    pub apply: Option<PathBuf>,
    /// Leave out the lines that begin with /
    #[arg(long)]
    pub block_delete: bool,
    /// Simulations at once; as many as there are cores without it
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,
}

#[derive(Subcommand)]
pub enum Batch {
    /// Make a folder of jobs: every program on every machine with every combination of what varies
    Submit(Submit),
    /// Simulate the jobs of a folder; those that are done already are not done again
    Worker(Worker),
    /// Say how far the jobs of a folder are; exit status 0 where all are done
    Status(BatchFolder),
    /// Write the results of a folder as a table
    Collect(Collect),
    /// Have the workers of a folder stop after what they are at
    Cancel(BatchFolder),
}

impl Batch {
    /// The folder that it is about, and the server.
    pub fn place(&self) -> (&Path, &Nats) {
        match self {
            Self::Submit(options) => (&options.folder, &options.nats),
            Self::Worker(options) => (&options.folder, &options.nats),
            Self::Collect(options) => (&options.folder, &options.nats),
            Self::Status(of) | Self::Cancel(of) => (&of.folder, &of.nats),
        }
    }
}

/// A server that keeps jobs and results.
#[derive(Group)]
pub struct Nats {
    /// Jobs and results lie at this NATS server instead, if tandem was built with the feature nats
    #[arg(long = "nats", value_name = "URL")]
    pub url: Option<String>,
    /// The name of the batch there; without it that of the folder
    #[arg(long, value_name = "NAME", requires = "url")]
    pub name: Option<String>,
    /// A worker that is silent for so long is taken for gone; the first command that names the batch says so
    #[arg(long, value_name = "S", requires = "url", default_value = "30", value_parser = clap::value_parser!(u64).range(1..=3600))]
    pub ack_wait_s: u64,
}

#[derive(Group)]
pub struct BatchFolder {
    /// The folder
    pub folder: PathBuf,
    #[command(flatten)]
    pub nats: Nats,
}

#[derive(Group)]
pub struct Submit {
    /// The folder, which is made
    pub folder: PathBuf,
    /// The machine files
    #[arg(long, required = true, num_args = 1.., value_name = "M.toml")]
    pub machine: Vec<PathBuf>,
    /// Override a key of the machine files
    #[arg(long = "set", value_name = "KEY=VALUE", value_parser = super::key_value)]
    pub overrides: Vec<(String, String)>,
    /// The part programs; a name with * or ? stands for all that it fits
    #[arg(long, required = true, num_args = 1.., value_name = "F.ngc")]
    pub programs: Vec<String>,
    /// What varies: values, as in planner.options.rounds=2,3, or so many of a range, as in motion.path_tolerance_mm=0.005..0.05:4
    #[arg(long, value_name = "KEY=VALUES", value_parser = Parameter::read)]
    pub vary: Vec<Parameter>,
    /// Leave out the lines that begin with /
    #[arg(long)]
    pub block_delete: bool,
    /// Simulate them at once, on this computer, and write the table
    #[arg(long, conflicts_with = "url")]
    pub local: bool,
    #[command(flatten)]
    pub nats: Nats,
}

#[derive(Group)]
pub struct Worker {
    /// The folder
    pub folder: PathBuf,
    /// Only this part of the jobs, as in 0/8: for arrays
    #[arg(long, value_name = "I/N", conflicts_with = "url")]
    pub shard: Option<Shard>,
    /// Simulations at once; as many as there are cores without it
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,
    #[command(flatten)]
    pub nats: Nats,
}

#[derive(Group)]
pub struct Collect {
    /// The folder
    pub folder: PathBuf,
    /// The table; results.csv in the folder without it
    #[arg(long, value_name = "F.csv", value_parser = file_name)]
    pub csv: Option<PathBuf>,
    /// The table in a new database, as `results`
    #[arg(long, value_name = "F.sqlite", value_parser = file_name)]
    pub sqlite: Option<PathBuf>,
    #[command(flatten)]
    pub nats: Nats,
}
