//! What the feed strategy asks for beside the ratio, each in its tick.

use std::sync::atomic::Ordering::Relaxed;

use tandem_rings::RequestKind;

use super::FineLoop;

impl FineLoop {
    /// Takes the requests that are due. A hold is the operator's: it is resumed like one.
    pub(super) fn take_requests(&mut self) {
        while let Ok(next) = self.requests.peek() {
            if next.tick > self.tick {
                return;
            }
            self.counters.late_ratios += u64::from(next.tick < self.tick);
            match next.kind {
                RequestKind::Hold => {
                    self.controls.hold.store(true, Relaxed);
                    self.given.hold = true;
                }
                RequestKind::Fault => self.controls.soft_fault.store(true, Relaxed),
            }
            let _ = self.requests.pop();
        }
    }
}
