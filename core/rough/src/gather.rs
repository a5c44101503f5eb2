//! How long a sender's lines are gathered before the machine begins to move.
//!
//! A machine that began with the first line would brake for its end before the next has come. So it waits until what has come is as
//! much, by its feed, as the queue holds for a stop beside getting up to speed and down again; or until the sender pauses. Once it moves,
//! what is queued gives the sender time, and nothing is gathered.

use tandem_sdk::{AxisLimits, Block};

/// A sender from whom nothing has come for so long, s, has paused: whoever starts a job takes it for at once, and the answer of a program
/// at the other end of a cable takes less.
const MAX_PAUSE_S: f64 = 0.1;

/// Changes of speed between rest and the feed that what has come has to last for: up, down, and the one that the queue holds for a stop.
/// With half of that a jerk-limited machine slows to a tenth of its feed before the sender has caught up
/// (`core/session/tests/grbl/planned_through.rs`). A sender that sends as fast as it is driven has sent it in as long.
const GATHERED_STOPS: f64 = 3.0;

/// Rough periods beyond these: what the queue holds beside the stop.
const GATHERED_PERIODS: f64 = 5.0;

/// How slowly the linear axes of a machine change their speed.
#[derive(Clone, Copy, Debug)]
pub struct Slowness {
    /// Highest speed of an axis, mm/s; none is known where there is no linear axis.
    speed_mm_per_s: Option<f64>,
    /// Least acceleration, mm/s².
    acceleration_mm_per_s2: f64,
    /// Longest time in which an acceleration is built up, s.
    ramp_s: f64,
}

impl Slowness {
    /// No axis is known.
    pub const NONE: Self = Self {
        speed_mm_per_s: None,
        acceleration_mm_per_s2: f64::INFINITY,
        ramp_s: 0.0,
    };

    /// Counts a linear axis with these limits.
    pub fn count(&mut self, limits: &AxisLimits) {
        let acceleration = limits.acceleration_mm_per_s2;
        let before_mm_per_s = self.speed_mm_per_s.unwrap_or_default();
        self.speed_mm_per_s = Some(limits.rapid_mm_per_s.max(before_mm_per_s));
        self.acceleration_mm_per_s2 = self.acceleration_mm_per_s2.min(acceleration);
        self.ramp_s = self.ramp_s.max(acceleration / limits.jerk_mm_per_s3);
    }

    /// How long a stop from this feed takes, s.
    fn stop_s(&self, feed_mm_per_s: f64) -> f64 {
        feed_mm_per_s / self.acceleration_mm_per_s2 + self.ramp_s
    }
}

/// What has come since there was nothing to plan.
#[derive(Debug)]
pub struct Gathering {
    slowness: Slowness,
    blocks: u32,
    /// The highest feed among them, mm/s.
    max_feed_mm_per_s: f64,
    /// What they take at their feeds alone, s.
    at_feed_s: f64,
    /// Since the first of them, s.
    waited_s: f64,
    /// Since the last of them, s.
    pause_s: f64,
    /// The machine moves by it.
    moves: bool,
}

impl Gathering {
    /// Nothing has come for a machine that is as slow as that.
    pub fn new(slowness: Slowness) -> Self {
        Self {
            slowness,
            blocks: 0,
            max_feed_mm_per_s: 0.0,
            at_feed_s: 0.0,
            waited_s: 0.0,
            pause_s: 0.0,
            moves: false,
        }
    }

    /// The planner has taken `block`.
    pub fn accepted(&mut self, block: &Block) {
        let most_mm_per_s = self.slowness.speed_mm_per_s.unwrap_or(f64::MAX);
        let feed_mm_per_s = block.command_feed_mm_per_s().min(most_mm_per_s);
        self.blocks = self.blocks.saturating_add(1);
        self.pause_s = 0.0;
        self.at_feed_s += block.dwell_s + block.length_mm / feed_mm_per_s;
        if block.length_mm > 0.0 {
            self.max_feed_mm_per_s = self.max_feed_mm_per_s.max(feed_mm_per_s);
        }
    }

    /// A rough period has passed.
    pub fn pass(&mut self, period_s: f64) {
        if self.blocks > 0 {
            self.waited_s += period_s;
            self.pause_s += period_s;
        }
    }

    /// The planner has emitted some of it; `is_deep` says that as much is queued as a stop asks for, by which the machine moves.
    pub fn emitted(&mut self, is_deep: bool) {
        self.moves |= is_deep;
    }

    /// All that was planned is emitted.
    pub fn restart(&mut self) {
        *self = Self::new(self.slowness);
    }

    /// Whether what has come is too little to begin with.
    pub fn goes_on(&self, period_s: f64) -> bool {
        self.may_wait(period_s) && self.at_feed_s < self.enough_s(period_s)
    }

    /// Time at the feed that is enough to begin with, s.
    fn enough_s(&self, period_s: f64) -> f64 {
        let stop_s = self.slowness.stop_s(self.max_feed_mm_per_s);
        GATHERED_STOPS * stop_s + GATHERED_PERIODS * period_s
    }

    /// Whether the machine does not move yet, and there is time to wait. A line that is alone, as one by hand or a jog, waits for one
    /// period only.
    pub fn may_wait(&self, period_s: f64) -> bool {
        let has_time = if self.blocks > 1 {
            self.pause_s < MAX_PAUSE_S && self.waited_s < self.enough_s(period_s)
        } else {
            self.waited_s < period_s
        };
        !self.moves && self.blocks > 0 && has_time
    }
}
