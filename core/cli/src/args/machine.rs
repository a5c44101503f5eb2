//! The arguments of `tandem machine`.

use std::path::PathBuf;

use clap::{Args as Group, Subcommand, ValueEnum};

use super::file_name;

/// What is done about machine files.
#[derive(Subcommand)]
pub enum MachineCommand {
    /// Write a machine file from options, or from answers where no axis is given
    New(NewMachine),
    /// Write a machine file from a LinuxCNC INI file or what grbl answers to $$, and say what could not be taken over
    Import(ImportMachine),
}

#[derive(Group)]
pub struct NewMachine {
    /// The file to write; it is not there yet
    #[arg(value_name = "M.toml", value_parser = file_name)]
    pub out: PathBuf,
    /// The name of the machine; the file's name where left out
    #[arg(long)]
    pub name: Option<String>,
    /// An axis and its travel, as in x=-250:250 (mm) or a=-180:180 (deg); once for each
    #[arg(long = "axis", value_name = "X=LOW:HIGH")]
    pub axes: Vec<String>,
    /// Highest speed in feed motion, mm/min or deg/min: of all axes, or as in z=3000 of one
    #[arg(long = "feed", value_name = "[X=]VALUE", allow_negative_numbers = true)]
    pub feeds: Vec<String>,
    /// Highest speed in rapid motion; the same as in feed motion where left out
    #[arg(
        long = "rapid",
        value_name = "[X=]VALUE",
        allow_negative_numbers = true
    )]
    pub rapids: Vec<String>,
    /// Highest acceleration, mm/s² or deg/s²
    #[arg(
        long = "acceleration",
        value_name = "[X=]VALUE",
        allow_negative_numbers = true
    )]
    pub accelerations: Vec<String>,
    /// Highest jerk, mm/s³ or deg/s³; none is no limit. Left out, the jerk that reaches the acceleration in 50 ms is proposed
    #[arg(
        long = "jerk",
        value_name = "[X=]VALUE|none",
        allow_negative_numbers = true
    )]
    pub jerks: Vec<String>,
}

#[derive(Group)]
pub struct ImportMachine {
    /// The INI file, or the dump
    pub from: PathBuf,
    /// The machine file to write; it is not there yet
    #[arg(long, value_name = "M.toml", value_parser = file_name)]
    pub out: PathBuf,
    /// What it is; found out by its lines where left out
    #[arg(long)]
    pub format: Option<Format>,
    /// Put the proposed jerk in force, and the planner that keeps it
    #[arg(long)]
    pub jerk: bool,
}

/// What can be taken over.
#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Format {
    /// The INI file of a LinuxCNC configuration
    Linuxcnc,
    /// What grbl or grblHAL answers to $$
    Grbl,
}
