//! `tandem check`: everything that `tandem run` looks at before the drives are claimed.

use std::error::Error;
use std::io::Write;

use tandem_host::{Switches, check_program};
use tandem_machine::Machine;
use tandem_session::HOMING;

use crate::args::Check;
use crate::{REFUSED, built_in, program, refusal};

/// Lists every error of a program, or says what the run would refuse of the machine.
pub fn check(options: &Check) -> Result<u8, Box<dyn Error>> {
    let machine = Machine::read(&options.machine.file.path, &options.machine.file.overrides)?;
    let program = program::open(&options.program)?;
    let name = program.name().to_string();
    // A machine that is to be homed first is run with --home: there is no other run to ask about.
    let homes = options.home || machine.require_homing && !machine.homing.is_empty();
    let home = homes.then_some(HOMING);
    let switches = Switches {
        block_delete: options.machine.block_delete,
        home,
        ..Switches::default()
    };
    let report = check_program(machine, &built_in::registry()?, program, switches)?;
    if report.is_ok() {
        program::print_warnings(&report);
        let (lines, blocks, length_mm) = (report.lines, report.blocks, report.length_mm);
        let _ = writeln!(
            std::io::stdout(),
            "{name}: {lines} lines, {blocks} blocks, {length_mm:.3} mm, no errors{}",
            report
                .seen_to
                .map_or(String::new(), |line| format!(" up to line {line}"))
        );
        if report.open_lines > 0 {
            let open = report.open_lines;
            let _ = writeln!(
                std::io::stdout(),
                "{open} line{} from what a probe or an input answers: the run judges them when it is known",
                if open == 1 { " follows" } else { "s follow" }
            );
        }
        return Ok(0);
    }
    program::print_errors(&report);
    if let Some(path) = &options.report {
        refusal::write(path, &name, &report)?;
    }
    let count = report.diagnostics.len() as u64 + report.unlisted;
    say!("{name}: {count} error{}", if count == 1 { "" } else { "s" });
    Ok(REFUSED)
}
