//! `tandem plugin`.

use std::path::PathBuf;

use clap::{Subcommand, ValueEnum};

use super::key_value;

#[derive(Subcommand)]
pub enum Plugin {
    /// Make a crate with a first plugin, a test and a README
    New {
        /// The folder; its last part names the plugin
        name: PathBuf,
        /// What kind of plugin
        #[arg(long)]
        kind: Kind,
        /// Where the source of Tandem is: a folder, or the URL of a git repository. Without it, the
        /// source around the current folder, else around this program, else that this program was built from
        #[arg(long, value_name = "PATH|URL")]
        sdk: Option<String>,
    },
    /// Load a shared library and judge whether its plugins keep the promises of their contracts
    Check {
        /// The shared library
        library: PathBuf,
        /// Set an option of the plugin, as in `buffer_blocks=20`
        #[arg(long = "set", value_name = "KEY=VALUE", value_parser = key_value)]
        options: Vec<(String, String)>,
        /// Seed of everything random
        #[arg(long, default_value = "1")]
        seed: u64,
        /// Random programs that a planner drives
        #[arg(long, default_value = "10", value_parser = clap::value_parser!(u64).range(1..=1_000_000))]
        programs: u64,
        /// Drive a driver that says it moves metal
        #[arg(long)]
        moves_metal: bool,
        /// Where kinematics are tried: lowest and highest X, Y and Z, mm
        #[arg(long, value_name = "X,X,Y,Y,Z,Z", value_parser = work_area, allow_hyphen_values = true,
              default_value = "-200,200,-200,200,-200,200")]
        work_area: [[f64; 2]; 3],
    },
    /// Print the built-in plugins, or those of shared libraries
    List {
        /// The shared libraries
        libraries: Vec<PathBuf>,
        /// Print where each comes from and what its options are
        #[arg(long, short)]
        verbose: bool,
    },
}

/// The kinds of plugins.
#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Kind {
    /// Turns blocks into motion
    Planner,
    /// Adapts the feed to what the machine feels
    FeedStrategy,
    /// Talks to the drives
    Driver,
    /// Maps axes to joints
    Kinematics,
}

/// Lowest and highest position of three axes, mm.
fn work_area(text: &str) -> Result<[[f64; 2]; 3], String> {
    let numbers: Result<Vec<f64>, _> = text.split(',').map(|part| part.trim().parse()).collect();
    let pairs: Vec<[f64; 2]> = numbers
        .unwrap_or_default()
        .chunks_exact(2)
        .map(|pair| [pair[0], pair[1]])
        .collect();
    let rises = |[low, high]: &[f64; 2]| low < high && low.is_finite() && high.is_finite();
    <[[f64; 2]; 3]>::try_from(pairs)
        .ok()
        .filter(|pairs| text.split(',').count() == 6 && pairs.iter().all(rises))
        .ok_or_else(|| "it is six numbers in mm, from low to high for X, Y and Z".to_string())
}
