//! What people read when a machine is refused: every file of `fixtures/bad` beside the exact text that it causes.

use std::fs;
use std::path::PathBuf;

use crate::common::{fixtures, refusal};

#[test]
fn every_bad_file_is_refused_in_the_expected_words() {
    let files = bad_files();
    assert!(files.len() > 30, "the fixtures are found");
    for file in files {
        let expected = fs::read_to_string(file.with_extension("txt")).unwrap_or_default();
        assert_eq!(refusal(&file, &[]) + "\n", expected, "{}", file.display());
    }
}

fn bad_files() -> Vec<PathBuf> {
    let entries = fs::read_dir(fixtures().join("bad")).unwrap();
    let mut files: Vec<_> = entries
        .map(|e| e.unwrap().path())
        .filter(|p| p.extension().unwrap() == "toml")
        .collect();
    files.sort();
    files
}
