//! The rests that end an epoch: what the fine loop reports to the rough loop.

use tandem_sdk::{AxisVector, StopOn};

/// Why the machine was brought to rest before the end of its queue.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RestCause {
    /// The edge that the motion waited for ([`StopOn`]) came.
    Edge,
    /// The motion that waits for an edge ended without it.
    Missed,
    /// The input had the level waited for before the motion began.
    Already,
    /// The operator's abort, or a jog that is let go.
    Abort,
    /// All joints are enabled: planning starts here.
    Attached,
    /// The position of an axis is set anew here ([`tandem_sdk::EventKind::Correct`]); nothing has moved.
    Corrected,
}

/// A rest that ends an epoch. The fine loop drops everything queued behind it and moves again with entries of the next
/// epoch only; the rough loop, when it takes this, plans on from `position`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rest {
    /// The epoch that it ends; the next one is one higher.
    pub epoch: u32,
    /// Why.
    pub cause: RestCause,
    /// Fine period in which the machine rested.
    pub tick: u64,
    /// Block that moved.
    pub block: u64,
    /// Program line that moved.
    pub line: u32,
    /// What the motion waited for.
    pub stop_on: StopOn,
    /// Position commanded, axis space, mm or rad: on the path, the last one sent.
    pub position: AxisVector,
    /// For [`RestCause::Edge`]: position measured at the edge, axis space: the drives' latch where they have one, else
    /// the feedback of the period in which the edge was seen.
    pub latch: Option<AxisVector>,
    /// Program time, s: the next epoch goes on from it.
    pub program_time_s: f64,
    /// Path coordinate, mm: the next epoch goes on from it.
    pub path_mm: f64,
}
