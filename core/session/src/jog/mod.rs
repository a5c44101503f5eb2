//! Jogging: an operator moves one axis, on until it is let go or by a distance.
//!
//! Keys, sockets and scripts ask through one [`Jogs`]. Motion is planned like that of a program, a line at a time; a
//! jog that is let go, or whose keep-alive is late, is stopped by the fine loop on the path, and the next one starts there.

mod panel;
mod session;
#[cfg(test)]
mod tests;
mod words;

pub use panel::Jogs;
pub use session::{JogHand, JogSession};
pub use words::{JogWords, ReachWords};

use tandem_sdk::AxisVector;

/// How far a jog goes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Reach {
    /// Towards the end of the travel, as long as it is kept alive.
    On {
        /// Towards higher positions.
        positive: bool,
    },
    /// By a distance, with its sign.
    By {
        /// The distance, mm or rad.
        distance_mm: f64,
    },
}

/// One jog.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Jog {
    /// Index of the axis.
    pub axis: usize,
    /// How far.
    pub reach: Reach,
    /// Feed, mm/s or rad/s.
    pub feed_mm_per_s: f64,
}

/// How a jog came to its end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum JogEnd {
    /// Its distance is driven.
    Arrived,
    /// It has come to the end of the travel.
    AtLimit,
    /// The operator has let go, aborted, or asked for another jog.
    LetGo,
    /// Nobody has kept it alive in time.
    Late,
}

/// A jog that is over: the machine rests.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JogRest {
    /// Index of the axis that moved.
    pub axis: usize,
    /// How.
    pub end: JogEnd,
    /// Where the machine stands, mm or rad.
    pub position: AxisVector,
}
