//! What reads something from outside, each as one function of bytes that panics where the reader breaks a promise: it neither
//! panics nor hangs, it says where and why it refuses, and what it takes makes sense.
//!
//! `tests/fuzz` drives these functions with what its coverage leads it to. The test of this crate drives them with sound
//! examples that were damaged at random, which needs no other build: it is what the gate has time for.

pub mod calibration;
pub mod command_file;
pub mod ethercat_frame;
pub mod grbl;
pub mod interpreter;
pub mod machine_file;
pub mod operator;
pub mod policy_module;
pub mod trace_file;

mod damage;

use std::path::{Path, PathBuf};

pub use damage::Damage;

/// Judges one input, and panics where a promise is broken.
pub type Judge = fn(&[u8]);

/// A reader, and the folders of sound examples that it begins from.
pub struct Reader {
    /// Its name in `tests/fuzz/readers`.
    pub name: &'static str,
    /// Its judge.
    pub judge: Judge,
    /// Folders of examples.
    pub examples: Vec<PathBuf>,
    /// Words that are worth to be tried, one a line as in a dictionary of libFuzzer.
    pub words: PathBuf,
}

/// The readers of `tests/fuzz/readers`: a line each, with the folders of its examples.
///
/// # Panics
/// The list names a reader that is not here.
pub fn readers() -> Vec<Reader> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let list = include_str!("../../fuzz/readers");
    let lines = list
        .lines()
        .filter(|line| !line.is_empty() && !line.starts_with('#'));
    lines
        .map(|line| {
            let mut words = line.split_whitespace();
            let (name, judge) = judge(words.next().expect("a name"));
            Reader {
                name,
                judge,
                examples: words.map(|folder| root.join(folder)).collect(),
                words: root.join(format!("tests/fuzz/seeds/{name}.dict")),
            }
        })
        .collect()
}

fn judge(name: &str) -> (&'static str, Judge) {
    const JUDGES: [(&str, Judge); 9] = [
        ("calibration", calibration::judge),
        ("command_file", command_file::judge),
        ("ethercat_frame", ethercat_frame::judge),
        ("grbl", grbl::judge),
        ("interpreter", interpreter::judge),
        ("machine_file", machine_file::judge),
        ("operator", operator::judge),
        ("policy_module", policy_module::judge),
        ("trace_file", trace_file::judge),
    ];
    *JUDGES
        .iter()
        .find(|(of, _)| *of == name)
        .unwrap_or_else(|| panic!("no reader is called {name}"))
}
