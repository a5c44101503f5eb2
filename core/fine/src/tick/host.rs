//! What the host calls of the fine loop beside its periods: how it begins, follows another one, and what it says of itself.

use rtrb::Producer;
use tandem_rings::{Counters, FineEnd, MachineState, RestCause, Sample, Switched};
use tandem_sdk::{AxisVector, Driver, JointState, Kinematics, PluginError};

use super::actuation::Actuation;
use super::missed::Missed;
use super::operator::Operator;
use super::rate::Rate;
use super::release::Release;
use super::report::{JobEnd, Left, Report};
use super::roles::RoleWatch;
use super::spindle::SpinUp;
use super::stops::{Stop, Stops};
use super::{FineLoop, Phase};
use crate::config::FineConfig;
use crate::fault::Fault;
use crate::outputs::Outputs;
use crate::state::{self, Input};

impl FineLoop {
    /// A loop at rest. `driver` is open and started; `kinematics` is `None` where joints are axes. Host; allocates.
    pub fn new(
        config: &FineConfig,
        end: FineEnd,
        driver: Box<dyn Driver>,
        kinematics: Option<Box<dyn Kinematics>>,
    ) -> Self {
        Self {
            config: *config,
            operator: Operator::new(end.controls, end.requests),
            rate: Rate::new(config, end.segments, end.ratios, end.depth),
            stops: Stops::new(end.rests),
            outputs: Outputs::new(config.dry_run, config.unhomed),
            spin_up: SpinUp::default(),
            roles: RoleWatch::default(),
            actuation: Actuation::new(config, driver, kinematics),
            release: Release::default(),
            missed: Missed::new(config),
            report: Report::new(end.status, end.samples),
            counters: Counters::default(),
            phase: Phase::Waiting,
            state: MachineState::Fault,
            tick: 0,
            fault: None,
            plugin_error: None,
        }
    }

    /// Hands samples out through another ring from here on. Host, before the first tick.
    pub fn hand_out_through(&mut self, samples: Producer<Sample>) {
        self.report.hand_out_through(samples);
    }

    /// What is on when the loop begins: a session goes on as the run before it has left the machine. Host, before the first tick.
    pub fn begin_switched(&mut self, switched: &Switched) {
        self.outputs.take_over(switched);
    }

    /// The drives stay enabled when the program has ended, and are told to stay where they are, until somebody says that
    /// they are to let go ([`tandem_rings::Controls::drives_let_go`]). Host, before the first tick.
    pub fn stay(&mut self) {
        self.release.stay();
    }

    /// There is nothing to do: the drives are not enabled, and the exchange with them goes on. Host, before the first tick.
    pub fn begin_ended(&mut self) {
        self.outputs.ended = true;
        self.release.begin();
    }

    /// Acknowledges a fault: the drives may be enabled. A machine starts faulted; one that has faulted since resets its drives,
    /// enables them where they stand, and reports the rest there. Host, between ticks.
    pub fn reset(&mut self) {
        self.state = state::next(self.state, Input::Reset);
        if matches!(self.phase, Phase::Faulted) {
            self.actuation.attach_again(true);
            self.actuation.lead_again();
            self.fault = None;
            self.plugin_error = None;
            self.release.forget();
            self.rate.forget(&self.config);
            (self.roles, self.spin_up) = (RoleWatch::default(), SpinUp::default());
            self.phase = Phase::Waiting;
        }
    }

    /// Takes the place of `last`, which rests and has ended or is in fault: from here on this loop has the drives, and knows
    /// what they were told and have answered. What this job counts begins anew; what was on stays on. Where the drives of
    /// `last` hold, they go on holding, and the job begins at the next fine period; else they are enabled first, where they
    /// stand, and their faults reset with `resets`.
    ///
    /// Fine thread, between ticks; does not allocate. `last` keeps what it counted, and is dropped by the host.
    pub fn succeed(&mut self, last: &mut Self, resets: bool) {
        self.actuation.take_over(&mut last.actuation);
        self.outputs.take_over(&last.outputs.switched());
        self.spin_up = last.spin_up;
        if self.outputs.ended {
            return;
        }
        // The joints of a gantry were homed each by itself, or are going to be: what is an axis here was none there.
        let is_placed = self.actuation.stands_like(&last.actuation);
        let holds = last.has_ended()
            && last.actuation.all_hold()
            && self.actuation.drives().setpoint().enable != 0;
        if holds {
            (self.state, self.roles) = (last.state, std::mem::take(&mut last.roles));
            if !is_placed {
                let told = self.actuation.drives().setpoint().position;
                self.stand_at(&told);
            }
            self.actuation.stay_attached();
            self.end_epoch(Stop::of(RestCause::Attached));
            self.phase = Phase::Waiting;
        } else {
            // Where the joints stand is asked of the drives once more.
            if !is_placed {
                let answered = self.actuation.drives().feedback().position;
                self.stand_at(&answered);
            }
            self.actuation.attach_again(resets);
            self.state = MachineState::Disabled;
        }
    }
}

/// What the loop says of itself.
impl FineLoop {
    /// Number of the fine period that comes next: 0 until the first motion.
    pub fn next_tick(&self) -> u64 {
        self.tick
    }

    /// How much later than its bus wants it the last exchange was, ns; `None` as long as no driver tells. Fine thread.
    pub fn phase_ns(&self) -> Option<i64> {
        self.actuation.drives().phase_ns()
    }

    /// What was counted so far.
    pub fn counters(&self) -> Counters {
        self.counters
    }

    /// The fault, if there is one.
    pub fn fault(&self) -> Option<Fault> {
        self.fault
    }

    /// What the driver, or the kinematics, said when it failed first. Host.
    pub fn plugin_error(&self) -> Option<&PluginError> {
        self.plugin_error.as_ref()
    }

    /// Whether the program has ended: nothing of this job moves any more. Any side.
    pub fn has_ended(&self) -> bool {
        self.outputs.ended && !matches!(self.phase, Phase::Ramping(_) | Phase::Faulted)
    }

    /// Whether the program has ended, or a fault has brought the machine to rest, and the drives have let go.
    pub fn is_over(&self) -> bool {
        self.release.is_over()
    }

    /// Whether nothing is left to do: the program has ended, and the drives have let go where they do not stay enabled; or a
    /// fault has brought the machine to rest. Any side.
    pub fn is_done(&self) -> bool {
        self.is_over() || self.release.may_be_followed() && self.has_ended()
    }

    /// Whether the joints do not hold yet: nothing can move, and planning waits for them. Any side.
    pub fn is_attaching(&self) -> bool {
        !self.actuation.all_hold() && !self.is_over()
    }

    /// The driver, for what its codes mean. Host, between ticks.
    pub fn driver(&self) -> &dyn Driver {
        self.actuation.drives().driver()
    }

    /// Whether the driver did not reach the drive of some joint in the last exchange. Host.
    pub fn has_lost_joints(&self) -> bool {
        self.actuation.drives().states().contains(&JointState::Lost)
    }

    /// Whether the joints came to rest each on its own, away from where the axes were to be. Host.
    pub fn joints_went_alone(&self) -> bool {
        !self.actuation.space().axes_lead()
    }

    /// The position sent last, in the coordinates of the drives, which homing does not change, mm or rad. Where the joints
    /// came to rest on their own, it is what the kinematics make of them, if that leads back. Host.
    pub fn sent(&self) -> AxisVector {
        self.actuation.sent(&self.config)
    }

    /// Where the joints were told to be last, mm or rad. Host.
    pub fn told_to_joints(&self) -> AxisVector {
        self.actuation.drives().setpoint().position
    }

    /// What was switched last. The period that ends a program switches, and has no sample. Host.
    pub fn left(&self) -> Left {
        self.report.left()
    }

    /// What the job did, once it has ended. Fine thread or host; does not allocate.
    pub fn job_end(&self) -> JobEnd {
        JobEnd {
            counters: self.counters,
            left: Left {
                switched: self.switched(),
                ..self.report.left()
            },
            position: self.config.axes_alone(&self.actuation.position()),
        }
    }

    /// Hands the driver back. Host.
    pub fn into_driver(self) -> Box<dyn Driver> {
        self.actuation.into_driver()
    }

    /// `periods` fine periods went by without a sample, `in_a_row` of them with those that were reported before them.
    ///
    /// In motion more in a row than [`crate::MissedLimits::in_a_row`], or more of a sliding second than
    /// [`crate::MissedLimits::share`], are a fault. Fine thread; does not allocate; bounded work.
    pub fn missed(&mut self, periods: u64, in_a_row: u64) {
        let first = self.tick.saturating_add(self.counters.missed_periods);
        self.counters.missed_periods += periods;
        self.operator.miss_beats(periods);
        if in_a_row == periods {
            self.missed.begin_row();
        }
        // What was sent last moves, or nothing does.
        let mut velocity = self.actuation.guard().velocity().0.iter();
        if velocity.all(|speed| *speed == 0.0) {
            return;
        }
        self.counters.missed_in_motion += periods;
        if let Some(kind) = self.missed.count(first, periods) {
            self.fail(kind);
        }
    }
}
