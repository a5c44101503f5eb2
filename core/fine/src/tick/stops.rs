//! Rests that end an epoch: an input edge or an abort stops the machine on the path, and what was queued after it no longer
//! counts.
//!
//! # Exact rest
//!
//! A plan that comes to rest ends with a segment of zero duration that holds the programmed position bit for bit. When
//! the fine loop reaches a segment flagged `ENDS_AT_REST`, its period ends there: what is left of the period is not
//! used. So one sample stands exactly on the programmed position, increments do not add up rounding over a program, and
//! motion after a rest starts on a tick.

use rtrb::Producer;
use tandem_rings::{Rest, RestCause, StopCause};
use tandem_sdk::{Arm, AxisVector, Edge, Segment, StopOn};

use super::drives::Drives;
use crate::config::FineConfig;
use crate::edge::{EdgeWatch, arm_for};

/// A stop for good, until its rest is reported.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Stop {
    pub(super) cause: RestCause,
    /// Joint positions at the edge.
    pub(super) latch: Option<AxisVector>,
}

impl Stop {
    /// A stop without a place that was latched.
    pub(super) fn of(cause: RestCause) -> Self {
        Self { cause, latch: None }
    }
}

/// The stop that is asked for, the edge that may ask for one, and who hears of the rest.
pub(super) struct Stops {
    stop: Option<Stop>,
    edge: EdgeWatch,
    /// What the drives are to catch.
    arm: Arm,
    rests: Producer<Rest>,
    /// Why the rate of program time goes down in this period.
    cause: StopCause,
}

impl Stops {
    /// Nothing is asked for. Host.
    pub(super) fn new(rests: Producer<Rest>) -> Self {
        Self {
            stop: None,
            edge: EdgeWatch::default(),
            arm: Arm::default(),
            rests,
            cause: StopCause::None,
        }
    }

    /// The stop that is asked for.
    #[inline]
    pub(super) fn stop(&self) -> Option<Stop> {
        self.stop
    }

    /// Asks for a stop, whatever was asked for before.
    pub(super) fn ask(&mut self, cause: RestCause) {
        self.stop = Some(Stop::of(cause));
    }

    /// Asks for a stop where none is asked for.
    pub(super) fn ask_first(&mut self, cause: RestCause) {
        self.stop.get_or_insert(Stop::of(cause));
    }

    /// Why the rate of program time goes down in this period.
    pub(super) fn cause(&self) -> StopCause {
        self.cause
    }

    /// The rate of program time goes down in this period because of `cause`.
    pub(super) fn set_cause(&mut self, cause: StopCause) {
        self.cause = cause;
    }

    /// What the drives are to catch.
    pub(super) fn arm(&self) -> Arm {
        self.arm
    }

    /// At a rest: the drives are told what the motion that begins next waits for. Whether they are told in this period, so that it
    /// begins in the next one.
    pub(super) fn arm_for(&mut self, next: &StopOn) -> bool {
        let arm = arm_for(next);
        let is_new = arm != self.arm && arm != Arm::default();
        self.arm = arm;
        is_new
    }

    /// The drives are to catch nothing.
    pub(super) fn disarm(&mut self) {
        self.arm = Arm::default();
    }

    /// After a move: a motion that waits for an edge may have begun, and the input be what it waits for already.
    #[inline]
    pub(super) fn begin_edge(&mut self, segment: &Segment, drives: &Drives, config: &FineConfig) {
        if self
            .edge
            .begin(segment, drives.feedback(), &config.home_switches)
        {
            self.ask_first(RestCause::Already);
        }
    }

    /// After an exchange, following the plan: the edge that the motion waits for may have come.
    #[inline]
    pub(super) fn watch_edge(&mut self, stop_on: &StopOn, drives: &Drives, config: &FineConfig) {
        if stop_on.edge == Edge::None || self.stop.is_some() {
            return;
        }
        let latch = self.edge.find(
            stop_on,
            drives.feedback(),
            drives.measured(),
            config.period_s,
            &config.home_switches,
        );
        if latch.is_some() {
            self.stop = Some(Stop {
                cause: RestCause::Edge,
                latch,
            });
        }
    }

    /// Reports a rest; then nothing is asked for. `false` where the reports before have not been taken yet: it waits for that.
    pub(super) fn report(&mut self, rest: Rest) -> bool {
        if self.rests.push(rest).is_err() {
            return false;
        }
        self.edge.end();
        self.disarm();
        self.stop = None;
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rtrb::RingBuffer;

    #[test]
    fn drives_are_told_once_what_they_are_to_catch() {
        let (rests, _reader) = RingBuffer::new(1);
        let mut stops = Stops::new(rests);
        let rising = StopOn {
            input: 3,
            edge: Edge::Rising,
            ..StopOn::default()
        };
        let falling = StopOn {
            edge: Edge::Falling,
            ..rising
        };
        assert!(
            !stops.arm_for(&StopOn::default()),
            "there is nothing to catch"
        );
        for edge in [rising, falling] {
            assert!(stops.arm_for(&edge));
            assert!(!stops.arm_for(&edge), "they know it");
            assert_eq!(stops.arm(), arm_for(&edge));
        }
        assert!(!stops.arm_for(&StopOn::default()));
        assert_eq!(stops.arm(), Arm::default());
    }
}
