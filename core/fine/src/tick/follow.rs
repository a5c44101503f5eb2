//! Following the plan: what is asked of the rate of program time, and the sample that results.

use std::sync::atomic::Ordering::Relaxed;

use tandem_rings::Queued;
use tandem_sdk::{AxisVector, EventKind};

use super::govern::{Ask, Ratios, Request};
use super::spindle::SpinUp;
use super::{FineLoop, Phase};
use crate::config::GuardMode;
use crate::cursor::{Reached, is_cut};
use crate::fault::FaultKind;
use crate::guard::Checked;
use crate::outputs::Waits;
use crate::state::Input;

impl FineLoop {
    /// Follows the plan for one period.
    pub(super) fn follow(&mut self) -> (AxisVector, Input) {
        self.counters.late_ratios += self.ratio.take(self.tick);
        self.look_for_stop();
        self.stop_between_lines();
        let ask = self.ask();
        if self.is_spindle_slow() {
            return self.next_position();
        }
        self.cause = self.cause_of(ask);
        if self.plan.cursor.is_resting() {
            self.plan.governor.jump(if ask == Ask::Run {
                self.depth.max_rate.load()
            } else {
                0.0
            });
        }
        if self.plan.governor.sigma() == 0.0
            && ask == Ask::Hold
            && self.controls.soft_fault.load(Relaxed)
        {
            self.fail(FaultKind::Soft);
            return (*self.guard.position(), Input::Trip);
        }
        if let Some(stop) = self
            .stop
            .filter(|_| self.plan.governor.sigma() == 0.0 || self.plan.cursor.is_resting())
        {
            return (self.stand(), self.end_epoch(stop));
        }
        if ask == Ask::Run
            && let Some(input) = self.begin_hand_over()
        {
            return (*self.guard.position(), input);
        }
        if ask == Ask::Run && self.arm_next() {
            return (self.stand(), Input::Run);
        }
        let delta_s = self.govern(ask);
        let waits = self.waits();
        let reached = self.plan.cursor.advance(delta_s, |queued| {
            let event = match queued {
                Queued::Segment { segment, .. } => {
                    return self.spin_up.is_awaited() && is_cut(segment);
                }
                Queued::Event(event) => event,
            };
            let told_rad_per_s = self.outputs.spindle_rad_per_s;
            self.outputs.apply(event, waits);
            if self.outputs.spindle_rad_per_s != told_rad_per_s {
                self.spin_up = SpinUp::begin();
            }
            // At home one sample rests, so that a record begins with it.
            let homing = matches!(
                event.kind,
                EventKind::Correct | EventKind::Homed | EventKind::HomeByDrive
            );
            self.outputs.stop_requested || homing
        });
        self.watch_progress(ask, reached);
        self.begin_edge();
        let mut position = self.plan.cursor.position();
        self.add_joints(&mut position);
        let checked = self.guard.check(&position, self.outputs.unhomed);
        self.counters.jerk_relaxed_samples += u64::from(checked.relaxed);
        let position = self.let_pass(position, &checked);
        (position, self.input(ask, reached))
    }

    /// Chooses the rate for this period; gives the program time that passes, s.
    fn govern(&mut self, ask: Ask) -> f64 {
        let governed = self.plan.govern(Request {
            ask,
            ratios: self.ratios_in_force(),
            single_block: self.given.single_block,
            max_rate: self.depth.max_rate.load(),
            stop_deceleration_mm_per_s2: self.depth.stop_deceleration_mm_per_s2.load(),
        });
        self.progress.ask(governed.least_asked);
        self.counters.queue_limited_samples += u64::from(governed.is_queue_limited);
        self.counters.governed_samples += u64::from(governed.is_unasked);
        if governed.is_jerk_relaxed {
            self.guard.relax_jerk();
        }
        if governed.holds {
            self.controls.hold.store(true, Relaxed);
        }
        governed.delta_s
    }

    /// The operator's feed override, where the program permits it.
    pub(super) fn permitted_override(&self) -> f64 {
        if self.outputs.override_permitted {
            self.given.feed_override
        } else {
            1.0
        }
    }

    pub(super) fn ratios_in_force(&self) -> Ratios {
        let operator = self.permitted_override();
        let [feed, mean_feed] = if self.outputs.adaptive_permitted {
            // What is above 1 is in the ratio already, within the strategy's own bounds.
            let operator = if self.config.strategy_takes_override {
                operator.min(1.0)
            } else {
                operator
            };
            [self.ratio.now(), self.ratio.mean()].map(|ratio| operator * ratio)
        } else {
            [operator; 2]
        };
        let rapid = if self.outputs.override_permitted {
            self.given.rapid_override.min(1.0)
        } else {
            1.0
        };
        Ratios {
            feed,
            mean_feed,
            rapid,
        }
    }

    /// The sample of a period that leaves the axes where they are; the guard knows from it that they stand.
    pub(super) fn stand(&mut self) -> AxisVector {
        let position = *self.guard.position();
        self.guard.check(&position, self.outputs.unhomed);
        self.guard.sent(&position);
        position
    }

    fn let_pass(&mut self, position: AxisVector, checked: &Checked) -> AxisVector {
        if matches!(self.phase, Phase::Ramping(_)) {
            // The kinematics have no joints for this sample: the ramp starts from the one before.
            return self.next_position().0;
        }
        match (checked.breach, self.config.guard) {
            (Some(breach), GuardMode::Stop) => {
                self.counters.guard_stops += 1;
                self.fail(breach);
                self.next_position().0
            }
            (breach, _) => {
                self.counters.limit_violations += u64::from(breach.is_some() || checked.relaxed);
                self.guard.sent(&position);
                position
            }
        }
    }

    /// Which words wait for the operator now.
    fn waits(&self) -> Waits {
        let optional = self.given.optional_stop && !self.config.dry_run;
        Waits {
            program: self.config.pause_at_stops && !self.config.dry_run,
            optional,
        }
    }

    /// What is asked of the rate of program time, before ratios.
    fn ask(&mut self) -> Ask {
        self.spin_up.waits = false;
        if self.outputs.stop_requested {
            self.controls.program_hold.store(true, Relaxed);
            self.given.program_hold = true;
            self.outputs.stop_requested = false;
        }
        let starves = self.queue.look(
            &self.depth,
            self.plan.cursor.program_time_s(),
            self.plan.governor.sigma(),
            self.plan.cursor.path_speed_mm_per_s(),
            self.config.period_s,
        );
        self.counters.starvations += u64::from(starves);
        if self.given.hold || self.given.program_hold || self.controls.soft_fault.load(Relaxed) {
            Ask::Hold
        } else if self.stop.is_some() {
            Ask::Stop
        } else if self.queue.is_starved() {
            Ask::Starve
        } else if self.waits_for_spindle() {
            Ask::Hold
        } else {
            Ask::Run
        }
    }

    fn input(&self, ask: Ask, reached: Reached) -> Input {
        match (&self.phase, ask) {
            (Phase::Ramping(_), _) => Input::Trip,
            (Phase::Faulted, _) => Input::Stopped,
            (_, Ask::Hold | Ask::Stop) => Input::Hold,
            (_, Ask::Starve) => Input::Starve,
            _ if reached == Reached::Rest && self.plan.cursor.is_last() => Input::Rest,
            _ => Input::Run,
        }
    }
}
