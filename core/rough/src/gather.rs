//! How long a sender's lines are gathered before the machine begins to move.
//!
//! A machine that began with the first line would brake for its end before the next has come. So it waits until what has come takes some
//! time by its feed, or until that time is over. Once it moves, what is queued gives the sender time, and nothing is gathered.

use tandem_sdk::Block;

/// How long that is, s: whoever starts a job takes it for at once, and the answer of a program at the other end of a cable takes less.
const MAX_GATHER_S: f64 = 0.1;

/// What has come since there was nothing to plan.
#[derive(Debug, Default)]
pub struct Gathering {
    blocks: u32,
    /// What they take at their feeds alone; rapids nothing, s.
    at_feed_s: f64,
    /// Since the first of them, s.
    waited_s: f64,
    /// The machine moves by it.
    moves: bool,
}

impl Gathering {
    /// The planner has taken `block`.
    pub fn accepted(&mut self, block: &Block) {
        self.blocks = self.blocks.saturating_add(1);
        self.at_feed_s += block.dwell_s + block.length_mm / block.command_feed_mm_per_s();
    }

    /// A rough period has passed.
    pub fn pass(&mut self, period_s: f64) {
        if self.blocks > 0 {
            self.waited_s += period_s;
        }
    }

    /// The planner has emitted some of it; `is_deep` says that as much is queued as a stop asks for, by which the machine moves.
    pub fn emitted(&mut self, is_deep: bool) {
        self.moves |= is_deep;
    }

    /// All that was planned is emitted.
    pub fn restart(&mut self) {
        *self = Self::default();
    }

    /// Whether what has come is too little to begin with.
    pub fn goes_on(&self, period_s: f64) -> bool {
        self.may_wait(period_s) && self.at_feed_s < MAX_GATHER_S
    }

    /// Whether the machine does not move yet, and there is time to wait. A line that is alone, as one by hand or a jog, waits for one
    /// period only.
    pub fn may_wait(&self, period_s: f64) -> bool {
        let most_s = if self.blocks > 1 {
            MAX_GATHER_S
        } else {
            period_s
        };
        !self.moves && self.blocks > 0 && self.waited_s < most_s
    }
}
