//! What a policy is told of the machine, once.

use tandem_sdk::Axes;

/// The machine as a policy needs it.
#[derive(Clone, Debug)]
pub struct Facts {
    /// The axes: turn angles count the linear ones.
    pub axes: Axes,
    /// Time constant of blocks that state none, s.
    pub time_constant_s: f64,
    /// Path tolerance of blocks that state none, mm.
    pub path_tolerance_mm: f64,
    /// Rough period, s.
    pub rough_period_s: f64,
    /// Number and diameter, mm, of the tools that have one.
    pub tool_diameters_mm: Vec<(u32, f64)>,
    /// Names of the signals that a script may ask for: those of the feed strategy, the analog and the digital inputs.
    pub signals: Vec<String>,
}

impl Default for Facts {
    /// A machine with the axes X, Y and Z that states nothing: 50 ms, 0.01 mm, a rough period of 8 ms, no tool and no signal.
    fn default() -> Self {
        let axes = Axes::new(&[('X', false), ('Y', false), ('Z', false)])
            .unwrap_or_else(|e| unreachable!("{e}"));
        Self {
            axes,
            time_constant_s: 0.05,
            path_tolerance_mm: 0.01,
            rough_period_s: 0.008,
            tool_diameters_mm: vec![],
            signals: vec![],
        }
    }
}
