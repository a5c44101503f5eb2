//! `[probe]`.

use crate::section::Section;

/// Highest number of a digital input.
pub(crate) const LAST_INPUT: u32 = 63;

/// The probe of the machine.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Probe {
    /// Number of its digital input, 0 to 63.
    pub input: u32,
    /// The input is 0 where the probe touches.
    pub inverted: bool,
}

impl Probe {
    /// Reads `[probe]`; `None` where it is wrong, which is reported.
    pub(crate) fn read(probe: &Section<'_>) -> Option<Self> {
        let inverted = probe.truth("invert").unwrap_or(false);
        let input = probe.required("input", |section, key| section.whole(key, 0, LAST_INPUT))?;
        Some(Self { input, inverted })
    }
}
