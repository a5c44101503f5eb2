//! Jogging: an operator moves one axis, on until it is let go or by a distance.
//!
//! Keys, sockets and scripts ask through one [`JogController`]. Motion is planned like that of a program, a line at a time; a
//! jog that is let go, or whose keep-alive is late, is stopped by the fine loop on the path, and the next one starts there.

mod controller;
mod message;
mod session;
#[cfg(test)]
mod tests;

pub use controller::JogController;
pub use message::{Jog, JogEnd, JogMessage, JogRest, Reach, ReachMessage};
pub use session::{JogInput, JogSession};
