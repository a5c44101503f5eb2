//! What a policy is told of the machine, once.

use tandem_sdk::Axes;

/// The machine as a policy needs it.
#[derive(Clone, Copy, Debug)]
pub struct Facts {
    /// The axes: turn angles count the linear ones.
    pub axes: Axes,
    /// Time constant of blocks that state none, s.
    pub time_constant_s: f64,
    /// Path tolerance of blocks that state none, mm.
    pub path_tolerance_mm: f64,
    /// Rough period, s.
    pub rough_period_s: f64,
}
