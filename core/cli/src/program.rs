//! Opening part programs and printing their errors.

use std::io;
use std::path::Path;

use tandem_gcode::{CheckReport, Program, ProgramError};

/// Opens `path`; `-` is standard input.
pub fn open(path: &Path) -> Result<Program, ProgramError> {
    if path.as_os_str() == "-" {
        Program::spool("standard input", io::stdin().lock())
    } else {
        Program::open(path)
    }
}

/// Prints what is worth to be known of a program that is driven all the same.
pub fn print_warnings(report: &CheckReport) {
    for warning in &report.warnings {
        say!("{warning}");
    }
}

/// Prints the errors of a program, and its warnings before them.
pub fn print_errors(report: &CheckReport) {
    print_warnings(report);
    for diagnostic in &report.diagnostics {
        say!("{diagnostic}");
    }
    if report.unlisted > 0 {
        say!("and {} more errors", report.unlisted);
    }
}
