//! Rests that end an epoch: an input edge or an abort stops the machine on the path, and what was queued after it no longer
//! counts.
//!
//! # Exact rest
//!
//! A plan that comes to rest ends with a segment of zero duration that holds the programmed position bit for bit. When
//! the fine loop reaches a segment flagged `ENDS_AT_REST`, its period ends there: what is left of the period is not
//! used. So one sample stands exactly on the programmed position, increments do not add up rounding over a program, and
//! motion after a rest starts on a tick.

use std::sync::atomic::Ordering::Relaxed;

use tandem_rings::{MachineState, Rest, RestCause, StopCause};
use tandem_sdk::{Arm, AxisVector, Edge};

use super::govern::Ask;
use super::{FineLoop, Phase};
use crate::edge::arm_for;
use crate::fault::FaultKind;
use crate::state::Input;

/// A stop for good, until its rest is reported.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Stop {
    cause: RestCause,
    /// Joint positions at the edge.
    latch: Option<AxisVector>,
}

impl Stop {
    pub(super) fn abort() -> Self {
        Self {
            cause: RestCause::Abort,
            latch: None,
        }
    }

    pub(super) fn of(cause: RestCause) -> Self {
        Self { cause, latch: None }
    }

    pub(super) fn attached() -> Self {
        Self {
            cause: RestCause::Attached,
            latch: None,
        }
    }
}

impl FineLoop {
    /// Before a period: an abort, a jog that is let go, axes whose position is set anew, or a motion that ended without its
    /// edge.
    pub(super) fn look_for_stop(&mut self) {
        if self.given.abort {
            self.stop = Some(Stop::abort());
        } else if self.is_jog_let_go() {
            self.stop.get_or_insert(Stop::abort());
        } else if let Some(by) = self
            .outputs
            .correction
            .filter(|_| self.plan.cursor.is_resting())
        {
            self.outputs.correction = None;
            self.correct(&by);
            self.stop = Some(Stop {
                cause: RestCause::Corrected,
                latch: None,
            });
        } else if self.plan.cursor.is_resting()
            && self.plan.cursor.segment().stop_on.edge != Edge::None
        {
            self.stop.get_or_insert(Stop {
                cause: RestCause::Missed,
                latch: None,
            });
        }
    }

    /// Why the rate of program time is to go down: what lasts longest comes first.
    pub(super) fn cause_of(&self, ask: Ask) -> StopCause {
        match (ask, self.stop.map(|stop| stop.cause)) {
            (Ask::Run, _) => StopCause::None,
            _ if self.controls.soft_fault.load(Relaxed) => StopCause::SoftFault,
            (_, Some(RestCause::Abort)) => StopCause::Abort,
            (_, Some(RestCause::Edge | RestCause::Already)) => StopCause::Edge,
            (Ask::Hold, _) if self.given.hold => self.cause_of_hold(),
            (Ask::Hold, _) if self.spin_up.waits => StopCause::Spindle,
            (Ask::Hold, _) => StopCause::ProgramStop,
            (Ask::Stop, _) => StopCause::None,
            (Ask::Starve, _) => StopCause::Starvation,
        }
    }

    /// Sets the position of the axes anew where the machine rests. The drives are sent what they were sent before.
    fn correct(&mut self, by: &AxisVector) {
        self.guard.correct(by);
        self.space.offset = self.space.offset - *by;
    }

    /// At a rest: tells the drives what the next motion waits for. Whether they are told in this period, so that it begins in the
    /// next one.
    pub(super) fn arm_next(&mut self) -> bool {
        if !self.plan.cursor.is_resting() {
            return false;
        }
        let arm = arm_for(&self.plan.cursor.next_stop_on());
        let is_new = arm != self.arm && arm != Arm::default();
        self.arm = arm;
        is_new
    }

    /// After a move: a motion that waits for an edge may have begun.
    pub(super) fn begin_edge(&mut self) {
        if self.edge.begin(
            self.plan.cursor.segment(),
            &self.drives.feedback,
            &self.config.home_switches,
        ) {
            self.stop.get_or_insert(Stop {
                cause: RestCause::Already,
                latch: None,
            });
        }
    }

    /// After an exchange: the edge may have come.
    pub(super) fn watch_edge(&mut self) {
        let stop_on = &self.plan.cursor.segment().stop_on;
        if stop_on.edge == Edge::None
            || self.stop.is_some()
            || !matches!(self.phase, Phase::Following)
        {
            return;
        }
        if let Some(latch) = self.edge.find(
            stop_on,
            &self.drives.feedback,
            &self.drives.measured,
            self.config.period_s,
            &self.config.home_switches,
        ) {
            self.stop = Some(Stop {
                cause: RestCause::Edge,
                latch: Some(latch),
            });
        }
    }

    /// At rest: reports it and ends the epoch. Where the reports before have not been taken yet, it waits for that.
    pub(super) fn end_epoch(&mut self, stop: Stop) -> Input {
        let latch = stop.latch.map(|joints| self.axes_of(&joints));
        let rest = Rest {
            epoch: self.plan.cursor.epoch(),
            cause: stop.cause,
            tick: self.tick,
            block: self.plan.cursor.segment().block,
            line: self.plan.cursor.segment().line,
            stop_on: self.plan.cursor.segment().stop_on,
            position: self.config.axes_alone(self.guard.position()),
            latch,
            program_time_s: self.plan.cursor.program_time_s(),
            path_mm: self.plan.cursor.path_mm(),
        };
        if self.rests.push(rest).is_err() {
            return Input::Hold;
        }
        self.plan.cursor.end_epoch(self.guard.position());
        self.edge.end();
        self.arm = Arm::default();
        self.plan.forget_ahead();
        self.queue.forget();
        (self.stop, self.phase) = (None, Phase::AwaitingReplan);
        // A jog that is let go leaves a hold as it is: the next one waits for its end too. An abort that comes while the joints
        // are enabled is still to act.
        if self.given.abort && stop.cause != RestCause::Attached {
            self.outputs.abort();
            let controls = &self.controls;
            for flag in [&controls.hold, &controls.program_hold, &controls.abort] {
                flag.store(false, Relaxed);
            }
        }
        Input::Rest
    }

    /// Motion starts again when the rough loop has taken the report and enough of the new epoch is queued.
    pub(super) fn await_replan(&mut self) -> Input {
        if self.controls.soft_fault.load(Relaxed) {
            self.fail(FaultKind::Soft);
            return Input::Trip;
        }
        if self.outputs.ended {
            return Input::Rest;
        }
        if self.given.abort {
            return self.end_epoch(Stop::abort());
        }
        let enough = self.depth.is_of(self.plan.cursor.epoch())
            && self.depth.may_start(self.plan.cursor.program_time_s());
        if self.plan.cursor.drop_older() && enough && self.state == MachineState::Standstill {
            self.phase = Phase::Following;
        }
        Input::Rest
    }
}
