//! The script between interpreter and planner.

use tandem_rough::BlockPolicy;
use tandem_sdk::{Block, Curve, Planner};

use super::host::PolicyHost;

/// Tunes blocks as the script asks, as far as the planner takes them.
pub struct Tuner {
    host: PolicyHost,
    /// Checks only: the planner that drives is busy with the blocks before.
    checker: Box<dyn Planner>,
}

impl Tuner {
    pub fn new(host: PolicyHost, checker: Box<dyn Planner>) -> Self {
        Self { host, checker }
    }
}

impl BlockPolicy for Tuner {
    fn state(&mut self, which: usize, value: f64) {
        self.host.lock().state(which, value);
    }

    fn offer(&mut self, block: &Block, curve: Option<Curve<'_>>) {
        self.host.lock().offer(block, curve);
    }

    fn decide(&mut self, next: Option<(&Block, Option<Curve<'_>>)>) {
        self.host.lock().decide(next);
    }

    fn tuned(&mut self, index: usize, block: &Block, curve: Option<Curve<'_>>) -> Option<Block> {
        let mut policy = self.host.lock();
        let tuning = policy.tuning(index);
        if tuning.is_empty() {
            return None;
        }
        let tuned = Block {
            time_constant_s: tuning.time_constant_s.unwrap_or(block.time_constant_s),
            path_tolerance_mm: tuning.path_tolerance_mm.unwrap_or(block.path_tolerance_mm),
            feed_cap_mm_per_s: tuning.feed_cap_mm_per_s.unwrap_or(block.feed_cap_mm_per_s),
            ..*block
        };
        match self.checker.check(&tuned, curve) {
            Ok(()) => Some(tuned),
            Err(refusal) => {
                policy.refused_by_planner(block.line, &refusal.to_string());
                None
            }
        }
    }
}
