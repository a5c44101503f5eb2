//! `[outputs.*]`: what the machine's builder says of its digital outputs.

use crate::section::Section;

/// Highest number of an output that a program switches.
const LAST_OUTPUT: u32 = 61;

/// A digital output with a name.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Output {
    /// Its name.
    pub name: String,
    /// Its number, 0 to 61.
    pub output: u32,
    /// A fault and an emergency stop leave it as it is; else they switch it off.
    pub kept: bool,
}

/// Reads `[outputs.*]`; what is wrong is reported and left out.
pub(crate) fn read(root: &Section<'_>) -> Vec<Output> {
    let section = root.section("outputs");
    let mut all: Vec<Output> = vec![];
    for name in section.keys() {
        let table = section.section(name);
        let kept = table
            .choice("on_fault", &[("off", false), ("keep", true)])
            .unwrap_or(false);
        let Some(output) = table.required("output", |table, key| table.whole(key, 0, LAST_OUTPUT))
        else {
            continue;
        };
        match all.iter().find(|other| other.output == output) {
            Some(other) => table.refuse(
                "output",
                format!("output {output} is outputs.{} already", other.name),
            ),
            None => all.push(Output {
                name: name.to_owned(),
                output,
                kept,
            }),
        }
    }
    all
}
