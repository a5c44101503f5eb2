//! `tandem machine`: a machine file of one's own, from answers or from what another control has.

mod draft;
mod grbl;
mod linuxcnc;
mod new;
mod questions;

use std::error::Error;
use std::fs;
use std::io::Write;
use std::path::Path;

use tandem_machine::Machine;

use crate::REFUSED;
use crate::args::{Format, ImportMachine, MachineCommand};

use draft::Draft;

/// Does what the subcommand says.
pub fn machine(command: &MachineCommand) -> Result<u8, Box<dyn Error>> {
    match command {
        MachineCommand::New(options) => {
            let draft = new::draft(options)?;
            write(&options.out, &draft)?;
            conclude(&options.out, &draft);
            Ok(0)
        }
        MachineCommand::Import(options) => import(options),
    }
}

/// What was read of another control's file.
struct Taken {
    draft: Draft,
    /// Lines that were not taken over, and why.
    left: Vec<AtLine>,
}

/// Something to say of a line.
#[derive(Debug, PartialEq, Eq)]
struct AtLine {
    /// From 1.
    line: usize,
    why: String,
}

impl AtLine {
    fn new(line: usize, why: impl Into<String>) -> Self {
        Self {
            line,
            why: why.into(),
        }
    }
}

fn import(options: &ImportMachine) -> Result<u8, Box<dyn Error>> {
    let from = &options.from;
    let at = |e: &dyn std::fmt::Display| format!("{}: {e}", from.display());
    let bytes = fs::read(from).map_err(|e| at(&e))?;
    let text = String::from_utf8(bytes).map_err(|e| at(&e))?;
    let name = from.file_stem().unwrap_or_default().to_string_lossy();
    let read = match options.format.unwrap_or_else(|| guess(&text)) {
        Format::Linuxcnc => linuxcnc::read(&text, &name),
        Format::Grbl => grbl::read(&text, &name),
    };
    let Taken { mut draft, left } = match read {
        Ok(taken) => taken,
        Err(wrong) => {
            for AtLine { line, why } in wrong {
                say!("{}:{line}: error: {why}", from.display());
            }
            return Ok(REFUSED);
        }
    };
    if options.jerk {
        draft.propose_jerk();
    }
    write(&options.out, &draft)?;
    for AtLine { line, why } in &left {
        say!("{}:{line}: not taken over: {why}", from.display());
    }
    conclude(&options.out, &draft);
    Ok(0)
}

/// What grbl answers begins with dollars; an INI file has sections.
fn guess(text: &str) -> Format {
    let is_setting = |line: &str| line.trim_start().starts_with('$') && line.contains('=');
    if text.lines().any(is_setting)
        && !text
            .lines()
            .any(|line| line.trim_start().starts_with("[EMC"))
    {
        Format::Grbl
    } else {
        Format::Linuxcnc
    }
}

/// Writes the file, where it is one that would be taken; nothing is written over.
fn write(path: &Path, draft: &Draft) -> Result<(), String> {
    let at = |e: &dyn std::fmt::Display| format!("{}: {e}", path.display());
    let mut file = fs::File::create_new(path).map_err(|e| at(&e))?;
    let written = file
        .write_all(draft.text().as_bytes())
        .and_then(|()| file.sync_all())
        .map_err(|e| at(&e))
        .and_then(|()| {
            let read = Machine::read(path, &[]);
            read.map(|_| ()).map_err(|e| e.to_string())
        });
    if written.is_err() {
        // Nobody is to take it for a machine file.
        let _ = fs::remove_file(path);
    }
    written
}

/// Says what was written, and what to do with it.
fn conclude(path: &Path, draft: &Draft) {
    let mut out = std::io::stdout().lock();
    // A reader that has gone away is no reason to fail.
    let _ = writeln!(
        out,
        "{}: {} axes, planner {}, simulated drives",
        path.display(),
        draft.axes.len(),
        draft.planner()
    );
    let _ = writeln!(out, "next: tandem serve --machine {}", path.display());
}
