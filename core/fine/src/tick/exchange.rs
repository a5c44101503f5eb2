//! The exchange with the drives, and what the soft side is told.

use std::iter::once_with;
use std::sync::atomic::Ordering::Relaxed;

use tandem_rings::{Sample, Switched};
use tandem_sdk::AxisVector;

use super::{FineLoop, Left, Phase};
use crate::answer;
use crate::fault::FaultKind;
use crate::state::Input;

impl FineLoop {
    /// Exchanges setpoints and feedback with the drives. Returns whether all joints hold afterwards.
    pub(super) fn exchange(&mut self, axes: &AxisVector) -> bool {
        self.set_joints(axes);
        self.drives.setpoint.arm = self.arm;
        // Where axes are homed, joints are axes.
        self.drives.setpoint.limited = self.outputs.unhomed & self.config.homing_limits;
        self.drives.setpoint.outputs = self.outputs.bits;
        self.drives.setpoint.spindle_rad_per_s = self.spindle_rad_per_s();
        let exchanged = self.drives.exchange(self.tick, &mut self.plugin_error);
        let failed = exchanged.failed;
        self.hear_roles(failed);
        self.hear_spindle();
        self.report_bus(exchanged.age_periods);
        // What is true nearly always is looked at first.
        let (unreadable, all_hold) = (exchanged.unreadable, exchanged.all_hold);
        if (failed || unreadable.is_some() || !all_hold || self.drives.sent.is_some())
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
            answer::reported(&self.drives.feedback, self.drives.joints, moving, own)
                .filter(|_| !resets && !letting_go)
        };
        let far = || {
            let sent = (
                self.drives.sent.as_ref()?,
                &self.config.attached.delay_periods,
            );
            answer::following(
                &self.drives.feedback,
                sent,
                self.drives.joints,
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
            self.drives.tell_to_stand(&joints);
            return;
        }
        let joints = self.joints_of(axes);
        self.drives
            .tell_to_move(&joints, 1.0 / self.config.period_s);
        self.drives.setpoint.homing = 0;
        self.drives.setpoint.enable = u32::from(!self.is_letting_go());
        self.drives.setpoint.reset = 0;
    }

    /// How old what the drives have answered is, and how late the exchange was.
    fn report_bus(&mut self, age_periods: u32) {
        self.counters.old_feedback_periods += u64::from(age_periods > 0);
        let bus = &self.status.bus;
        bus.age_periods.store(age_periods, Relaxed);
        if age_periods > 0 {
            bus.old_periods.fetch_add(1, Relaxed);
        }
        let feedback = &self.drives.feedback;
        bus.has_phase.store(feedback.has_phase != 0, Relaxed);
        bus.phase_ns.store(feedback.phase_ns, Relaxed);
    }

    /// What the drives do for the state of the machine, where `all_hold` or not all of them do.
    pub(super) fn input_of_drives(&self, all_hold: bool) -> Input {
        if all_hold || self.drives.hold_others_than(self.handed_over()) {
            Input::DrivesOn
        } else {
            Input::DrivesOff
        }
    }

    pub(super) fn publish(&mut self, command: &AxisVector, feed_mm_per_s: f64) {
        let (command, feedback) = if self.config.record_drives {
            (*command + self.space.offset, self.drives.feedback.position)
        } else {
            let reported = self.drives.feedback.position;
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
            speed: self.drives.feedback.speed,
            current_a: self.drives.feedback.current_a,
            feed_mm_per_s,
            end_feed_mm_per_s: self.plan.governor.sigma() * self.plan.cursor.path_speed_mm_per_s(),
            programmed_feed_mm_per_s: self.plan.cursor.segment().feed_mm_per_s,
            sigma: self.plan.governor.sigma(),
            ratio,
            feed_override,
            spindle_rad_per_s: self.drives.feedback.spindle_rad_per_s,
            switched,
            phase_ns,
            analog: self.drives.feedback.analog,
            inputs: self.drives.feedback.inputs,
            old_inputs: answer::old_inputs(&self.drives.feedback),
            age_periods: answer::ages(&self.drives.feedback, self.drives.joints),
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
            outputs: self.drives.setpoint.outputs,
            spindle_rad_per_s: self.drives.setpoint.spindle_rad_per_s,
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
        status.inputs.store(self.drives.feedback.inputs, Relaxed);
        status
            .spindle
            .waits
            .store(self.spin_up.waits && self.fault.is_none(), Relaxed);
        status
            .spindle
            .told_rad_per_s
            .store(self.drives.setpoint.spindle_rad_per_s);
        status
            .spindle
            .turns_rad_per_s
            .store(self.drives.feedback.spindle_rad_per_s);
        for (joint, status) in status.joints.iter().enumerate().take(self.drives.joints) {
            status.store(
                self.drives.feedback.state[joint],
                self.drives.feedback.fault_code[joint],
            );
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
