//! The operator's end of a run: commands from keys and sockets, and what they are told of the machine.
//!
//! Everything here is on the soft side. A command reaches the fine loop as an atomic, through [`OperatorHub::give`] whoever
//! gives it; a client that reads slowly loses telemetry and never costs the machine time.
//!
//! Keys, signals and clients at sockets share one `tandem_session::operator::OperatorHub`; what it gives ends in the
//! same atomics as a command file. One thread of ordinary priority serves all clients with non-blocking sockets and a
//! bounded outbox for each: no client can hold up another, or a loop. A panic in the handling of a client is caught
//! there and costs that client. Places are counted by listener and by who somebody is, so that strangers cannot keep the
//! owner out. The protocol is docs/operator.md.

mod client;
mod hub;
mod lease;
mod listen;
mod outbox;
mod places;
mod pty;
mod reply;
mod request;
mod rhythm;
mod role;
mod server;
mod service;
mod session;
mod socket_file;
mod status;
mod stream;
mod token;

pub use hub::OperatorHub;
pub(crate) use lease::{Lease, News};
pub use listen::Listen;
pub(crate) use reply::Problem;
pub(crate) use rhythm::Rhythm;
pub use role::Role;
pub use server::Server;
pub(crate) use service::{Protocol, Service, StatusText};
pub(crate) use session::{Answer, MAX_OWNERS};
pub use status::{Counters, Position, StatusLine};
pub use token::{Tokens, new as new_token};
