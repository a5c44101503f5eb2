//! The exchange with the drives, and what the soft side is told.

use std::iter::once_with;
use std::sync::atomic::Ordering::Relaxed;

use tandem_rings::{Sample, Switched};
use tandem_sdk::{AxisVector, JointState};

use super::{FineLoop, Left, Phase};
use crate::answer::{self, Numbers};
use crate::fault::FaultKind;
use crate::state::Input;

impl FineLoop {
    /// Exchanges setpoints and feedback with the drives. Returns whether all joints hold afterwards.
    pub(super) fn exchange(&mut self, axes: &AxisVector) -> bool {
        self.set_joints(axes);
        self.setpoint.tick = if self.beats_on {
            self.setpoint.tick + 1
        } else {
            self.tick
        };
        self.setpoint.arm = self.arm;
        // Where axes are homed, joints are axes.
        self.setpoint.limited = self.outputs.unhomed & self.config.homing_limits;
        self.setpoint.outputs = self.outputs.bits;
        self.setpoint.spindle_rad_per_s = self.spindle_rad_per_s();
        let last = Numbers::of(&self.feedback);
        let failed = self.ask_driver();
        self.hear_roles(failed);
        self.hear_spindle();
        let unreadable =
            last.replace_wrong_ones(&mut self.feedback, self.measured.last(), self.joints);
        self.remember();
        // What is true nearly always is looked at first.
        let all_hold = answer::all_hold(&self.feedback, self.joints);
        if (failed || unreadable.is_some() || !all_hold || self.sent.is_some())
            && let Some(kind) = self.fault_of_answer(failed, unreadable)
        {
            self.fail(kind);
        }
        self.watch_attach();
        self.watch_edge();
        self.watch_release(failed);
        all_hold
    }

    /// The fault that the drives' answer is, where it is one: of an exchange that `failed`, or with numbers that are `unreadable`.
    #[inline(never)]
    fn fault_of_answer(&self, failed: bool, unreadable: Option<FaultKind>) -> Option<FaultKind> {
        // From the first motion on the drives hold, at rest too: what let go has moved.
        let moving = matches!(
            self.phase,
            Phase::Following | Phase::AwaitingReplan | Phase::HandedOver(_)
        );
        let own = self.handed_over();
        let fault = failed.then_some(FaultKind::Driver).or(unreadable);
        let (holding, letting_go) = (self.attach.is_done(), self.is_letting_go());
        let resets = self.is_resetting();
        let reported = || {
            answer::reported(&self.feedback, self.joints, moving, own)
                .filter(|_| !resets && !letting_go)
        };
        let far = || {
            let sent = (self.sent.as_ref()?, &self.config.attached.delay_periods);
            answer::following(
                &self.feedback,
                sent,
                self.joints,
                &self.config.max_following_error_mm,
                own,
            )
        };
        fault
            .or_else(reported)
            .or_else(|| far().filter(|_| holding && !letting_go))
    }

    /// Tells the setpoint where the joints are to be, and how they move.
    fn set_joints(&mut self, axes: &AxisVector) {
        let still = if !self.attach.is_done() {
            Some(self.hold_still())
        } else if self.handed_over() != 0 {
            Some(self.hold_the_others(axes))
        } else {
            None
        };
        if let Some(joints) = still {
            // They are told to be where they stand: that is no motion, though the numbers may change.
            self.setpoint.position = joints;
            (self.setpoint.velocity, self.setpoint.acceleration) =
                (AxisVector::ZERO, AxisVector::ZERO);
            return;
        }
        self.setpoint.homing = 0;
        let (joints, rate) = (self.joints_of(axes), 1.0 / self.config.period_s);
        let velocity = (joints - self.setpoint.position) * rate;
        self.setpoint.acceleration = (velocity - self.setpoint.velocity) * rate;
        (self.setpoint.position, self.setpoint.velocity) = (joints, velocity);
        self.setpoint.enable = u32::from(!self.is_letting_go());
        self.setpoint.reset = 0;
    }

    /// Keeps what was sent, where it is asked for, and what came back of it.
    fn remember(&mut self) {
        if let Some(sent) = &mut self.sent {
            sent.push(&self.setpoint.position);
        }
        self.measured.push(&self.feedback.position);
        let ages = self.feedback.age_periods[..self.joints].iter();
        let age_periods = ages.fold(0, |oldest: u32, age| oldest.max(*age));
        self.counters.old_feedback_periods += u64::from(age_periods > 0);
        let bus = &self.status.bus;
        bus.age_periods.store(age_periods, Relaxed);
        if age_periods > 0 {
            bus.old_periods.fetch_add(1, Relaxed);
        }
        bus.has_phase.store(self.feedback.has_phase != 0, Relaxed);
        bus.phase_ns.store(self.feedback.phase_ns, Relaxed);
    }

    /// Whether the exchange failed; the driver's first words about it are kept for the host.
    fn ask_driver(&mut self) -> bool {
        match self.driver.exchange(&self.setpoint, &mut self.feedback) {
            Ok(()) => false,
            Err(error) => {
                self.plugin_error.get_or_insert(error);
                true
            }
        }
    }

    /// What the drives do for the state of the machine, where `all_hold` or not all of them do.
    pub(super) fn drives(&self, all_hold: bool) -> Input {
        if all_hold {
            return Input::DrivesOn;
        }
        let own = self.handed_over();
        let holds = |joint: usize| {
            own >> joint & 1 == 1 || self.feedback.state[joint] == JointState::Enabled
        };
        let on = (0..self.joints).all(holds);
        if on {
            Input::DrivesOn
        } else {
            Input::DrivesOff
        }
    }

    pub(super) fn publish(&mut self, command: &AxisVector, feed_mm_per_s: f64) {
        let (command, feedback) = if self.config.record_drives {
            (*command + self.offset, self.feedback.position)
        } else {
            let reported = self.feedback.position;
            (self.config.axes_alone(command), self.axes_of(&reported))
        };
        let (switched, phase_ns) = (self.switched(), self.phase_ns());
        let (ratio, feed_override) = (self.ratios_in_force().feed, self.permitted_override());
        let sample = || Sample {
            tick: self.tick,
            block: self.plan.cursor.segment().block,
            line: self.plan.cursor.segment().line,
            state: self.state,
            command,
            feedback,
            speed: self.feedback.speed,
            current_a: self.feedback.current_a,
            feed_mm_per_s,
            end_feed_mm_per_s: self.plan.governor.sigma() * self.plan.cursor.path_speed_mm_per_s(),
            programmed_feed_mm_per_s: self.plan.cursor.segment().feed_mm_per_s,
            sigma: self.plan.governor.sigma(),
            ratio,
            feed_override,
            spindle_rad_per_s: self.feedback.spindle_rad_per_s,
            switched,
            phase_ns,
            analog: self.feedback.analog,
            inputs: self.feedback.inputs,
            old_inputs: answer::old_inputs(&self.feedback),
            age_periods: answer::ages(&self.feedback, self.joints),
            cause: self.cause,
            given: self.given,
        };
        self.counters.samples += 1;
        match self.samples.write_chunk_uninit(1) {
            // Made in its slot: to push it would copy it.
            Ok(slot) => _ = slot.fill_from_iter(once_with(sample)),
            Err(_) => _ = self.status.lost_samples.fetch_add(1, Relaxed),
        }
    }

    /// What is on when the loop begins: a session goes on as the run before it has left the machine. Host, before the first tick.
    pub fn begin_switched(&mut self, switched: &Switched) {
        (self.outputs.bits, self.outputs.spindle_rad_per_s) =
            (switched.outputs, switched.spindle_rad_per_s);
        self.outputs.by = switched.by;
    }

    /// What was sent last.
    pub(super) fn switched(&self) -> Switched {
        Switched {
            outputs: self.setpoint.outputs,
            spindle_rad_per_s: self.setpoint.spindle_rad_per_s,
            by: self.outputs.by,
        }
    }

    /// Keeps what was switched, and when.
    pub(super) fn keep_switched(&mut self) {
        let switched = self.switched();
        if switched != self.left.switched {
            let segment = self.plan.cursor.segment();
            self.left = Left {
                tick: self.tick,
                block: segment.block,
                line: segment.line,
                switched,
            };
        }
    }

    pub(super) fn report(&self) {
        let status = &self.status;
        status.tick.store(self.tick, Relaxed);
        status
            .program_time_s
            .store(self.plan.cursor.program_time_s());
        // Off the plan nothing is fed, as in the samples: σ keeps what it was when the fault came.
        let feed_mm_per_s = if self.fault.is_some() {
            0.0
        } else {
            self.plan.governor.sigma() * self.plan.cursor.path_speed_mm_per_s()
        };
        status.feed_mm_per_s.store(feed_mm_per_s);
        status.line.store(self.plan.cursor.segment().line, Relaxed);
        status.state.store(self.state as u32, Relaxed);
        status.inputs.store(self.feedback.inputs, Relaxed);
        status
            .spindle
            .waits
            .store(self.spin_up.waits && self.fault.is_none(), Relaxed);
        status
            .spindle
            .told_rad_per_s
            .store(self.setpoint.spindle_rad_per_s);
        status
            .spindle
            .turns_rad_per_s
            .store(self.feedback.spindle_rad_per_s);
        for (joint, status) in status.joints.iter().enumerate().take(self.joints) {
            status.store(self.feedback.state[joint], self.feedback.fault_code[joint]);
        }
        status
            .enabling
            .store(!self.attach.is_done() && self.fault.is_none(), Relaxed);
        status.idle.store(
            self.plan.cursor.is_resting() && self.plan.cursor.is_last(),
            Relaxed,
        );
        status.counts.store(&self.counters);
    }
}
