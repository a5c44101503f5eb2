//! The protocol of grbl 1.1, for senders that speak nothing else, on the lines of the controller.
//!
//! A sender is a client like any other: it needs the lease for what moves, and its lines are judged, planned through and driven
//! as lines by hand are. What it is told differs: `ok` where a line was taken, else a number that it knows with our words beside
//! it. A line is taken when the planner has room behind those before it; until then it waits here, counted in `Bf:`.
//!
//! Some lines are answered when they are driven, as grbl does: dwells, probes, stops, tool changes and the end of a program.
//! Senders use them to wait for the machine.

mod errors;
mod line;
mod realtime;
mod report;
mod reset;
mod scan;
mod sender;
mod settings;

#[cfg(test)]
mod tests;

pub use scan::{Heard, RealTime, Scanner};
pub(crate) use sender::Sender;
pub(crate) use settings::Settings;

/// Bytes of lines without an answer that a sender may have on the way, as `[OPT:]` and `Bf:` tell it.
pub const RX_BYTES: usize = 1024;
