//! The dead man's switch of a jog: where nobody keeps it alive, the machine stops on the path, whatever the soft side does.

use std::sync::atomic::Ordering::Relaxed;

use super::FineLoop;

/// Fine periods since the operator last kept the jog alive.
#[derive(Debug, Default)]
pub(super) struct KeepAlive {
    beats: u64,
    periods: u64,
}

impl FineLoop {
    /// Before a period: lets go of a jog whose keep-alive is late.
    pub(super) fn watch_jog(&mut self) {
        let jog = &self.controls.jog;
        let beats = jog.beats.load(Relaxed);
        if beats != self.keep_alive.beats {
            self.keep_alive = KeepAlive { beats, periods: 0 };
            return;
        }
        self.keep_alive.periods = self.keep_alive.periods.saturating_add(1);
        let most = jog.max_periods.load(Relaxed);
        if most > 0 && self.keep_alive.periods >= most {
            jog.let_go.store(true, Relaxed);
        }
    }

    /// Periods without a sample are time in which nobody kept the jog alive.
    pub(super) fn miss_beats(&mut self, periods: u64) {
        self.keep_alive.periods = self.keep_alive.periods.saturating_add(periods);
    }

    /// Whether the jog is to stop.
    pub(super) fn is_jog_let_go(&self) -> bool {
        self.controls.jog.let_go.load(Relaxed)
    }
}
