//! Where the machine time of a run goes: to which block, and to what bound there. Counted in samples, so that all parts
//! together are the time of the motion.

use std::collections::VecDeque;

use tandem_rings::{MachineState, Sample, StopCause};
use tandem_sdk::{Block, BlockKind, BlockReport, LimitedBy};

/// What the time of a sample went to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TimeGoesTo {
    /// The block's motion, with what the planner says held its feed down.
    Limit(LimitedBy),
    /// A dwell.
    Dwell,
    /// The machine was being stopped, or kept at rest.
    Stop(StopCause),
    /// The operator's override, below 100 %.
    Override,
    /// The ratio of the feed strategy and of policies, below 1.
    Strategy,
    /// Program time passed slower though no ratio asked for it: the way back from a stop or an override, what the ring of
    /// segments holds, or a plan beyond its limits.
    Governor,
    /// At rest with nothing to drive: the program waits for an input, or what follows a probe is planned.
    Rest,
    /// Motion of a block that no planner has reported.
    Unreported,
}

impl TimeGoesTo {
    /// As it is written.
    pub fn name(self) -> &'static str {
        match self {
            Self::Limit(by) => limited_by(by),
            Self::Dwell => "dwell",
            Self::Stop(cause) => match cause {
                StopCause::HoldInput => "hold-input",
                StopCause::ProgramStop => "program-stop",
                StopCause::Edge => "input-edge",
                StopCause::SoftFault => "soft-fault",
                cause => cause.name(),
            },
            Self::Override => "override",
            Self::Strategy => "strategy",
            Self::Governor => "governor",
            Self::Rest => "rest",
            Self::Unreported => "unreported",
        }
    }
}

/// A block that moves, or will.
#[derive(Clone, Copy, Debug)]
struct Open {
    index: u64,
    length_mm: f64,
    /// What its motion is counted under.
    goes_to: TimeGoesTo,
    time_s: f64,
}

/// Shares the samples out over the blocks that were reported.
#[derive(Debug)]
pub struct BlockTimes {
    period_s: f64,
    /// The highest ratio of the feed that the plan is made for.
    max_feed_ratio: f64,
    /// In the order of the program, from the block that moves on.
    open: VecDeque<Open>,
    /// The last sample had come; time is what lies between samples.
    started: bool,
}

/// Rates of program time so near to 1 are 1.
const FULL_RATE: f64 = 1.0 - 1e-9;

impl BlockTimes {
    /// Nothing seen. Allocates as blocks come.
    pub fn new(period_s: f64, max_feed_ratio: f64) -> Self {
        Self {
            period_s,
            max_feed_ratio,
            open: VecDeque::new(),
            started: false,
        }
    }

    /// A block is planned for good. Blocks come in order.
    pub fn block(&mut self, block: &Block, report: &BlockReport) {
        let dwell = block.kind == BlockKind::Dwell;
        let goes_to = if dwell {
            TimeGoesTo::Dwell
        } else {
            TimeGoesTo::Limit(report.limited_by)
        };
        self.open.push_back(Open {
            index: block.index,
            length_mm: block.length_mm,
            goes_to,
            time_s: 0.0,
        });
    }

    /// A sample was sent: `part` is told what its period went to and how much of it, s, and `passed` the index and the time
    /// of each block that the machine has left behind, s.
    pub fn sample(
        &mut self,
        sample: &Sample,
        mut part: impl FnMut(TimeGoesTo, f64),
        mut passed: impl FnMut(u64, f64),
    ) {
        let mut left_s = if self.started { self.period_s } else { 0.0 };
        self.started = true;
        let asked = self.asked(sample);
        // Most samples leave none behind.
        if self
            .open
            .front()
            .is_some_and(|open| open.index < sample.block)
        {
            left_s = self.leave_behind(sample, left_s, asked, &mut part, &mut passed);
        }
        match self
            .open
            .front_mut()
            .filter(|open| open.index == sample.block)
        {
            Some(open) => {
                open.time_s += left_s;
                part(asked.unwrap_or(open.goes_to), left_s);
            }
            None => part(asked.unwrap_or(TimeGoesTo::Unreported), left_s),
        }
    }

    /// Forgets the blocks that lie behind that of `sample`, in whose period `left_s` passed; gives what is left of that for its own.
    fn leave_behind(
        &mut self,
        sample: &Sample,
        mut left_s: f64,
        asked: Option<TimeGoesTo>,
        part: &mut impl FnMut(TimeGoesTo, f64),
        passed: &mut impl FnMut(u64, f64),
    ) -> f64 {
        // They are few: each sample forgets those that it has left behind.
        let behind = self.open.iter();
        let here = behind.take_while(|open| open.index < sample.block).count();
        // Blocks that are shorter than the period have passed inside it: each takes its part of the way.
        let behind_mm: f64 = self
            .open
            .range(1.min(here)..here)
            .map(|open| open.length_mm)
            .sum();
        let moved_mm = (sample.feed_mm_per_s * self.period_s).max(behind_mm);
        for place in 0..here {
            let Some(mut open) = self.open.pop_front() else {
                break;
            };
            if place > 0 && moved_mm > 0.0 {
                let share_s = (self.period_s * open.length_mm / moved_mm).min(left_s);
                left_s -= share_s;
                open.time_s += share_s;
                part(asked.unwrap_or(open.goes_to), share_s);
            }
            passed(open.index, open.time_s);
        }
        left_s
    }

    /// Nothing follows: `passed` is told of the blocks that are left, in order.
    pub fn finish(&mut self, mut passed: impl FnMut(u64, f64)) {
        self.open
            .drain(..)
            .for_each(|open| passed(open.index, open.time_s));
    }

    /// What the period went to other than to the plan of its block.
    fn asked(&self, sample: &Sample) -> Option<TimeGoesTo> {
        if sample.cause != StopCause::None {
            return Some(TimeGoesTo::Stop(sample.cause));
        }
        if sample.state == MachineState::Standstill {
            return Some(TimeGoesTo::Rest);
        }
        if sample.sigma >= FULL_RATE {
            return None;
        }
        let rapid = sample.programmed_feed_mm_per_s.is_infinite();
        let operator = if rapid {
            sample.given.rapid_override
        } else {
            sample.feed_override
        };
        // The sample holds both together.
        let strategy = if rapid || operator <= 0.0 {
            1.0
        } else {
            sample.ratio / operator
        };
        if operator < 1.0 && operator <= strategy {
            Some(TimeGoesTo::Override)
        } else if strategy < 1.0 {
            Some(TimeGoesTo::Strategy)
        } else if !rapid && operator * strategy < self.max_feed_ratio {
            // The plan is made for more than the program asks for, which is what was driven.
            Some(TimeGoesTo::Limit(LimitedBy::Feed))
        } else {
            Some(TimeGoesTo::Governor)
        }
    }
}

/// What held the feed down, as it is written.
pub(crate) fn limited_by(reason: LimitedBy) -> &'static str {
    match reason {
        LimitedBy::Feed => "feed",
        LimitedBy::Acceleration => "acceleration",
        LimitedBy::Curvature => "curvature",
        LimitedBy::Junction => "junction",
        LimitedBy::Velocity => "velocity",
        LimitedBy::Buffer => "buffer",
        LimitedBy::TimeConstant => "time-constant",
        LimitedBy::Tolerance => "tolerance",
        LimitedBy::Jerk => "jerk",
        LimitedBy::Policy => "policy",
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tandem_sdk::AxisVector;

    fn report(block: u64, limited_by: LimitedBy) -> BlockReport {
        BlockReport {
            limited_by,
            block,
            start_feed_mm_per_s: 0.0,
            peak_feed_mm_per_s: 0.0,
            end_feed_mm_per_s: 0.0,
            // What a planner guesses does not count.
            time_s: 1e6,
            time_constant_s: f64::NAN,
        }
    }

    #[test]
    fn blocks_shorter_than_a_period_share_it_by_their_lengths() {
        let mut times = BlockTimes::new(1e-3, 1.0);
        for index in 0..4 {
            let block = Block {
                kind: BlockKind::Line,
                index,
                length_mm: 0.02,
                ..Block::at(AxisVector::ZERO)
            };
            times.block(
                &block,
                &report(
                    index,
                    if index == 1 {
                        LimitedBy::Junction
                    } else {
                        LimitedBy::Feed
                    },
                ),
            );
        }
        let sample = |block, feed_mm_per_s| Sample {
            block,
            feed_mm_per_s,
            sigma: 1.0,
            state: MachineState::Running,
            ..Sample::default()
        };
        let (mut by, mut blocks) = (vec![], vec![]);
        for sample in [sample(0, 0.0), sample(3, 50.0), sample(3, 30.0)] {
            times.sample(
                &sample,
                |goes_to, s| by.push((goes_to.name(), s)),
                |index, s| blocks.push((index, s)),
            );
        }
        times.finish(|index, s| blocks.push((index, s)));
        let junction: f64 = by
            .iter()
            .filter(|(name, _)| *name == "junction")
            .map(|(_, s)| s)
            .sum();
        assert!((junction - 0.4e-3).abs() < 1e-12, "0.02 of 0.05 mm: {by:?}");
        assert!(
            (by.iter().map(|(_, s)| s).sum::<f64>() - 2e-3).abs() < 1e-12,
            "{by:?}"
        );
        assert!(
            (blocks.iter().map(|(_, s)| s).sum::<f64>() - 2e-3).abs() < 1e-12,
            "{blocks:?}"
        );
        assert_eq!(
            blocks.iter().map(|(index, _)| *index).collect::<Vec<_>>(),
            [0, 1, 2, 3]
        );
    }

    /// The knob stands at 50 %, and on the way back from a hold the rate is there too.
    #[test]
    fn an_override_that_the_program_forbids_takes_no_time() {
        for (feed_override, ratio, name) in [(0.5, 0.5, "override"), (1.0, 1.0, "governor")] {
            let mut sample = Sample {
                feed_override,
                ratio,
                sigma: 0.5,
                programmed_feed_mm_per_s: 10.0,
                state: MachineState::Running,
                ..Sample::default()
            };
            sample.given.feed_override = 0.5;
            let goes_to = BlockTimes::new(1e-3, 1.0).asked(&sample).unwrap();
            assert_eq!(goes_to.name(), name);
        }
    }
}
