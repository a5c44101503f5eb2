//! The operator's end of a run: commands from keys and sockets, and what they are told of the machine.
//!
//! Everything here is on the soft side. A command reaches the fine loop as an atomic, through [`OperatorHub::give`] whoever
//! gives it; a client that reads slowly loses telemetry and never costs the machine time.

mod client;
mod hub;
mod lease;
mod listen;
mod outbox;
mod places;
mod reply;
mod request;
mod server;
mod session;
mod socket_file;
mod status;
mod token;

pub use hub::OperatorHub;
pub use listen::Listen;
pub use server::Server;
pub use status::{Counters, Position, StatusLine};
