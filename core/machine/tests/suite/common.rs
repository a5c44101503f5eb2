//! Shared by the integration tests.

use std::path::{Path, PathBuf};

use tandem_machine::{Machine, MachineError};

/// The directory of the fixtures.
pub fn fixtures() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures")
}

/// Reads a machine with `--set` overrides, each `key=value`.
pub fn read(path: &Path, overrides: &[&str]) -> Result<Machine, MachineError> {
    let split = |text: &&str| {
        text.split_once('=')
            .map(|(key, value)| (key.to_owned(), value.to_owned()))
    };
    Machine::read(
        path,
        &overrides.iter().filter_map(split).collect::<Vec<_>>(),
    )
}

/// The words with which a machine is refused, the fixtures' directory left out.
pub fn refusal(path: &Path, overrides: &[&str]) -> String {
    let error = read(path, overrides).expect_err(&path.display().to_string());
    error
        .to_string()
        .replace(&format!("{}/", fixtures().display()), "")
}
