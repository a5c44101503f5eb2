//! Jobs and results of `tandem-batch` over NATS `JetStream`, which keeps them and deals them out to workers on any computers.
//!
//! Each batch has two streams and a store of inputs. A job lies in the first until it is acknowledged; workers fetch one at a
//! time and beat while they simulate, so that a job runs again only where its worker is gone. A result is published with the
//! condition that its subject has none yet: whoever comes second is told so by the server, and compares. Only the feature `nats` makes
//! anything of this crate.

#[cfg(feature = "nats")]
mod server;
#[cfg(feature = "nats")]
mod work;

#[cfg(feature = "nats")]
pub use server::{Collected, Progress, Server};
#[cfg(feature = "nats")]
pub use work::Worker;
