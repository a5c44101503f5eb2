//! `tandem state`.

use std::path::PathBuf;

use clap::{Args as Group, Subcommand, ValueEnum};
use tandem_state::LinearUnit;

use super::{MachineFile, file_name};

#[derive(Subcommand)]
pub enum State {
    /// Print offsets, tools, the last jobs and the alarms
    Show {
        #[command(flatten)]
        of: Of,
        /// How many jobs and alarms
        #[arg(long, default_value = "5", value_parser = clap::value_parser!(u16).range(0..=1000))]
        last: u16,
    },
    /// Write LinuxCNC's parameter file and tool table
    Export {
        #[command(flatten)]
        of: Of,
        #[command(flatten)]
        files: Files,
    },
    /// Take offsets, parameters and tools over from LinuxCNC's parameter file and tool table, and say what was not
    Import {
        #[command(flatten)]
        of: Of,
        #[command(flatten)]
        files: Files,
    },
}

/// Whose state.
#[derive(Group)]
pub struct Of {
    #[command(flatten)]
    pub machine: MachineFile,
    /// The state file; without it the machine's own, in the folder that docs/state.md names
    #[arg(long, value_name = "F.sqlite")]
    pub state: Option<PathBuf>,
}

/// LinuxCNC's files.
#[derive(Group)]
pub struct Files {
    /// The parameter file
    #[arg(long = "var", value_name = "F.var", required_unless_present = "tools", value_parser = file_name)]
    pub variables: Option<PathBuf>,
    /// The tool table
    #[arg(long, value_name = "F.tbl", value_parser = file_name)]
    pub tools: Option<PathBuf>,
    /// The linear unit of the machine at LinuxCNC, in which its files are
    #[arg(long, default_value = "mm")]
    pub unit: Unit,
}

/// Units of length.
#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Unit {
    /// Millimetres
    Mm,
    /// Inches
    Inch,
}

impl From<Unit> for LinearUnit {
    fn from(unit: Unit) -> Self {
        match unit {
            Unit::Mm => Self::Mm,
            Unit::Inch => Self::Inch,
        }
    }
}
