//! Jogging: an operator moves one axis, on until it is let go or by a distance.
//!
//! Keys, sockets and scripts ask through one [`JogController`]. Motion is planned like that of a program, a line at a time; a
//! jog that is let go, or whose keep-alive is late, is stopped by the fine loop on the path, and the next one starts there.
//!
//! `tandem jog` is a run whose source is a `tandem_session::jog::JogSession`. Keys, clients and lines ask its
//! `JogController`; the source turns what waits into one line block at rest, towards the travel limit or by a distance.
//! The dead man's switch lies in the fine loop (`core/fine/src/tick/operator.rs`): it counts periods since the last
//! beat, an atomic, and lets go by the same mechanism as an abort, an epoch that ends at a rest on the path. A hold
//! stays in force, for the next jog too.

mod controller;
mod message;
mod session;
#[cfg(test)]
mod tests;

pub use controller::JogController;
pub use message::{Jog, JogEnd, JogMessage, JogRest, Reach, ReachMessage};
pub(crate) use session::Jogging;
pub use session::{JogInput, JogSession};
