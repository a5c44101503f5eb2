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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::RoughConfig;
    use tandem_sdk::AxisVector;

    const PERIOD_S: f64 = 1.0 / 64.0;

    /// Stops from 50 mm/s take 0.1 s, so 0.378 s at the feed are enough.
    fn gathering() -> Gathering {
        let mut config = RoughConfig::new(PERIOD_S, PERIOD_S);
        for (speed, acceleration, jerk) in [(100.0, 1000.0, 2e4), (60.0, 2000.0, 4e4)] {
            config.gather_for(&AxisLimits {
                feed_mm_per_s: speed / 2.0,
                rapid_mm_per_s: speed,
                acceleration_mm_per_s2: acceleration,
                jerk_mm_per_s3: jerk,
                ..AxisLimits::unlimited()
            });
        }
        Gathering::new(config.slowness)
    }

    /// A block of this length, mm, at this feed, mm/s.
    fn block(length_mm: f64, feed_mm_per_s: f64) -> Block {
        Block {
            length_mm,
            feed_mm_per_s,
            ..Block::at(AxisVector::ZERO)
        }
    }

    /// So many blocks of 20 ms at 50 mm/s `at_once`, `every` so many periods, up to a `count`; how many have come when nothing is waited
    /// for any more, and in which period that is.
    fn blocks_gathered((at_once, every): (u32, u32), count: u32) -> (u32, u32) {
        let mut gathering = gathering();
        let mut came = 0;
        for period in 0..1000 {
            gathering.pass(PERIOD_S);
            if period % every == 0 && came < count {
                (0..at_once).for_each(|_| gathering.accepted(&block(1.0, 50.0)));
                came += at_once;
            }
            if !gathering.goes_on(PERIOD_S) {
                return (came, period);
            }
        }
        panic!("it waits for ever");
    }

    #[test]
    fn it_waits_until_what_has_come_lasts_for_three_stops() {
        assert_eq!(blocks_gathered((1, 1), u32::MAX), (19, 18));
    }

    #[test]
    fn a_slower_sender_is_waited_for_as_long_as_that() {
        assert_eq!(blocks_gathered((2, 3), u32::MAX), (18, 25));
    }

    #[test]
    fn a_sender_that_pauses_is_not_waited_for() {
        let (came, period) = blocks_gathered((1, 1), 5);
        assert_eq!((came, period), (5, 4 + 7));
    }

    #[test]
    fn a_line_that_is_alone_waits_for_one_period() {
        assert_eq!(blocks_gathered((1, 1), 1), (1, 1));
    }

    #[test]
    fn nothing_is_waited_for_before_a_line_and_once_the_machine_moves() {
        let mut gathering = gathering();
        gathering.pass(PERIOD_S);
        assert!(!gathering.may_wait(PERIOD_S));
        gathering.accepted(&block(0.5, 50.0));
        gathering.emitted(false);
        assert!(
            gathering.may_wait(PERIOD_S),
            "what is emitted is too little to move by"
        );
        gathering.emitted(true);
        gathering.emitted(false);
        assert!(!gathering.may_wait(PERIOD_S));
        gathering.restart();
        gathering.accepted(&block(0.5, 50.0));
        assert!(
            gathering.may_wait(PERIOD_S),
            "all of it is driven, and more has come"
        );
    }

    #[test]
    fn a_feed_that_no_axis_reaches_is_that_of_the_fastest() {
        let mut gathering = gathering();
        gathering.accepted(&block(10.0, 1e6));
        assert_eq!(
            (gathering.at_feed_s, gathering.max_feed_mm_per_s),
            (0.1, 100.0)
        );
        gathering.accepted(&block(0.0, 1e6));
        assert_eq!(gathering.at_feed_s, 0.1, "a dwell has no feed");
        gathering.accepted(&Block {
            dwell_s: 0.25,
            ..block(0.0, 50.0)
        });
        assert_eq!(gathering.at_feed_s, 0.35, "a dwell takes its time");
    }
}
