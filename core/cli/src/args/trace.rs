//! `tandem trace`.

use std::path::PathBuf;

use clap::Subcommand;

/// What is done with traces.
#[derive(Subcommand)]
pub enum Trace {
    /// Write a binary trace as CSV
    Export {
        /// The binary trace
        trace: PathBuf,
        /// The file to write
        #[arg(long, value_name = "F.csv")]
        csv: PathBuf,
        /// Write the operator's commands, for `tandem run --commands`
        #[arg(long, value_name = "F.csv")]
        commands: Option<PathBuf>,
    },
    /// Print what a binary trace holds, and whether it is complete
    Info {
        /// The binary trace
        trace: PathBuf,
    },
    /// Compare two traces, binary or CSV, column by column; exit status 1 where they differ
    Diff {
        /// One trace
        a: PathBuf,
        /// The other
        b: PathBuf,
        /// Compare the positions sent and their times only
        #[arg(long)]
        commands_only: bool,
    },
}
