//! Whose machine: one of a machine file, or that of a controller.

use std::path::{Path, PathBuf};

use clap::{Args as Group, CommandFactory, error::ErrorKind};
use tandem_machine::{Machine, MachineError};

use super::key_value;

/// The machine of a machine file, or that of a controller.
#[derive(Group)]
pub struct MachineSource {
    /// The machine file
    #[arg(
        long = "machine",
        value_name = "M.toml",
        required_unless_present = "connect"
    )]
    file: Option<PathBuf>,
    /// Override a key of the machine file, as in planner.plugin=look-ahead
    #[arg(long = "set", value_name = "KEY=VALUE", value_parser = key_value)]
    overrides: Vec<(String, String)>,
    #[command(flatten)]
    controller: Connect,
}

/// Where a controller is.
#[derive(Group)]
pub struct Connect {
    /// Be a client of a controller: at this socket, or where none is named at that of the only controller that runs here
    #[arg(long, value_name = "SOCKET")]
    #[allow(clippy::option_option)] // how clap tells an option with no value from none
    connect: Option<Option<PathBuf>>,
}

impl Connect {
    /// The socket that is named.
    pub fn socket(&self) -> Option<&Path> {
        self.connect.as_ref().and_then(|at| at.as_deref())
    }
}

impl MachineSource {
    /// The controller, where one is asked for.
    pub fn controller(&self) -> Option<&Connect> {
        self.controller.connect.as_ref().map(|_| &self.controller)
    }

    /// The machine file. It is there where no controller is.
    pub fn path(&self) -> &Path {
        self.file.as_deref().unwrap_or(Path::new(""))
    }

    /// Reads the machine file, with what overrides it.
    ///
    /// # Errors
    /// Everything that is wrong in it.
    pub fn machine(&self) -> Result<Machine, MachineError> {
        Machine::read(self.path(), &self.overrides)
    }

    /// Ends the process as a wrong command line does, where one of the options `given`, or one of a machine file, goes with a
    /// controller: what they ask for is the controller's.
    pub fn refuse_with_connect(&self, given: &[(bool, &str)]) {
        let own = [
            (self.file.is_some(), "--machine"),
            (!self.overrides.is_empty(), "--set"),
        ];
        let Some((_, option)) = own.iter().chain(given).find(|(given, _)| *given) else {
            return;
        };
        let why = format!("{option} does not go with --connect: that is the controller's matter");
        super::Args::command()
            .error(ErrorKind::ArgumentConflict, why)
            .exit();
    }
}
