//! When a source of lines or jogs by hand may believe that the machine stands.

/// How often in a row the rough loop has found everything driven.
#[derive(Clone, Copy, Debug, Default)]
pub struct Standstill(u32);

impl Standstill {
    /// Once is not enough: the fine loop says so once a period, and may have taken a segment since.
    const TIMES: u32 = 2;

    /// The rough loop asks whether the source may go on; `driven` is whether everything before is driven. Soft side.
    pub fn look(&mut self, driven: bool) {
        self.0 = if driven { self.0 + 1 } else { 0 };
    }

    /// Whether the machine stands.
    pub fn is_still(self) -> bool {
        self.0 >= Self::TIMES
    }

    /// Something is to be driven.
    pub fn moves(&mut self) {
        self.0 = 0;
    }
}
