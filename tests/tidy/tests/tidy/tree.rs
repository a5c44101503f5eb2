//! The files of the repository.

use std::path::{Path, PathBuf};
use std::process::Command;

/// A file of the repository.
pub struct File {
    /// Path from the root, with slashes.
    pub name: String,
    /// Its text; empty where it is none.
    pub text: String,
}

/// The folder of the workspace.
pub fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../..")
        .canonicalize()
        .unwrap()
}

/// The text of one file.
pub fn read(name: &str) -> String {
    std::fs::read_to_string(root().join(name)).unwrap_or_else(|e| panic!("{name}: {e}"))
}

/// All files that git tracks, or without git all files outside `target`, with one of the endings.
pub fn files(endings: &[&str]) -> Vec<File> {
    let names = tracked().unwrap_or_else(walked);
    assert!(names.len() > 100, "only {} files were found", names.len());
    let wanted = names
        .into_iter()
        .filter(|name| endings.iter().any(|ending| name.ends_with(ending)));
    // A file that git still tracks may be deleted in the working tree.
    wanted
        .filter(|name| root().join(name).is_file())
        .map(File::read)
        .collect()
}

impl File {
    fn read(name: String) -> Self {
        let bytes = std::fs::read(root().join(&name)).unwrap_or_default();
        Self {
            name,
            text: String::from_utf8(bytes).unwrap_or_default(),
        }
    }

    /// The lines with their numbers, from 1.
    pub fn lines(&self) -> impl Iterator<Item = (usize, &str)> {
        self.text
            .lines()
            .enumerate()
            .map(|(index, line)| (index + 1, line))
    }
}

fn tracked() -> Option<Vec<String>> {
    let listed = Command::new("git")
        .arg("-C")
        .arg(root())
        .args(["ls-files", "-z"])
        .output()
        .ok()?;
    let text = String::from_utf8(listed.stdout).ok()?;
    let names: Vec<String> = text
        .split('\0')
        .filter(|name| !name.is_empty())
        .map(str::to_string)
        .collect();
    (listed.status.success() && !names.is_empty()).then_some(names)
}

fn walked() -> Vec<String> {
    let (mut names, mut folders) = (vec![], vec![root()]);
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            let name = path
                .strip_prefix(root())
                .unwrap()
                .to_string_lossy()
                .replace('\\', "/");
            match path.is_dir() {
                true if name != ".git" && !name.ends_with("target") => folders.push(path),
                true => {}
                false => names.push(name),
            }
        }
    }
    names.sort();
    names
}
