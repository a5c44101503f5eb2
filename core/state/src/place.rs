//! Where the state of a machine lies.

use std::ffi::OsString;
use std::path::PathBuf;

use crate::error::StateError;

/// The state file of the machine called `name`, where nobody names one: `NAME.sqlite` in the folder that systemd has made
/// (`STATE_DIRECTORY`), else in `tandem` of `XDG_STATE_HOME`, else in `~/.local/state/tandem`. Characters of the name that do
/// not belong into a file's name become `-`.
///
/// # Errors
/// None of these is set.
pub fn default_path(name: &str) -> Result<PathBuf, StateError> {
    path_with(name, |variable| std::env::var_os(variable))
}

fn path_with(
    name: &str,
    variable: impl Fn(&str) -> Option<OsString>,
) -> Result<PathBuf, StateError> {
    // What is relative is to be passed over, says the XDG base directory specification.
    let folder = |name: &str| {
        variable(name)
            .map(PathBuf::from)
            .filter(|path| path.is_absolute())
    };
    // Systemd names several folders with colons between.
    let systemd = variable("STATE_DIRECTORY").and_then(|list| std::env::split_paths(&list).next());
    let folder = systemd
        .filter(|path| path.is_absolute())
        .or_else(|| folder("XDG_STATE_HOME").map(|path| path.join("tandem")))
        .or_else(|| folder("HOME").map(|path| path.join(".local/state/tandem")))
        .ok_or(StateError::Nowhere)?;
    Ok(folder.join(format!("{}.sqlite", file_name(name))))
}

fn file_name(name: &str) -> String {
    let plain = |c: char| {
        if c.is_alphanumeric() || "-_.".contains(c) {
            c
        } else {
            '-'
        }
    };
    let name: String = name.chars().map(plain).take(80).collect();
    let name = name.trim_start_matches('.');
    if name.is_empty() {
        "machine".into()
    } else {
        name.into()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn path(name: &str, set: &[(&str, &str)]) -> String {
        let variable = |wanted: &str| {
            set.iter()
                .find(|(name, _)| *name == wanted)
                .map(|(_, value)| value.into())
        };
        path_with(name, variable).unwrap().display().to_string()
    }

    #[test]
    fn the_folder_that_is_set_first_counts() {
        let home = ("HOME", "/home/me");
        assert_eq!(
            path("mill", &[home]),
            "/home/me/.local/state/tandem/mill.sqlite"
        );
        assert_eq!(
            path("mill", &[home, ("XDG_STATE_HOME", "/s")]),
            "/s/tandem/mill.sqlite"
        );
        assert_eq!(
            path("mill", &[home, ("XDG_STATE_HOME", "s")]),
            "/home/me/.local/state/tandem/mill.sqlite"
        );
        assert_eq!(
            path("mill", &[home, ("STATE_DIRECTORY", "/var/lib/tandem:/x")]),
            "/var/lib/tandem/mill.sqlite"
        );
        assert_eq!(path_with("mill", |_| None), Err(StateError::Nowhere));
    }

    #[test]
    fn a_name_cannot_leave_the_folder() {
        let home = [("HOME", "/h")];
        assert_eq!(
            path("../a b/c", &home),
            "/h/.local/state/tandem/-a-b-c.sqlite"
        );
        assert_eq!(path("..", &home), "/h/.local/state/tandem/machine.sqlite");
    }
}
