//! `tandem trace`, and the trace that a run writes.

mod binary;
mod diff;
mod export;
mod info;
mod samples;
mod sink;

pub use sink::TraceSink;

use std::error::Error;

use crate::args;

/// Looks into traces.
pub fn trace(command: &args::Trace) -> Result<u8, Box<dyn Error>> {
    match command {
        args::Trace::Export {
            trace,
            csv,
            commands,
        } => export::export(trace, csv, commands.as_deref()),
        args::Trace::Info { trace } => info::info(trace),
        args::Trace::Diff {
            a,
            b,
            commands_only,
        } => diff::diff(a, b, *commands_only),
    }
}
