//! The fine loop itself.

mod attach;
mod drives;
mod exchange;
mod follow;
mod govern;
mod hand_over;
mod joints;
mod keep_alive;
mod missed;
mod pieces;
mod progress;
mod queue;
mod ratio;
mod release;
mod request;
mod rest;
mod roles;
mod single_block;
mod spindle;
mod succeed;

use std::sync::Arc;
use std::sync::atomic::Ordering::Relaxed;

use rtrb::{Consumer, Producer};
use tandem_rings::{
    Controls, Counters, Depth, FineEnd, MachineState, OperatorInputs, Rest, Sample, Status,
    StopCause, StrategyRequest, Switched, SwitchedBy,
};
use tandem_sdk::{Arm, AxisVector, Driver, JointState, Kinematics, PluginError};

use crate::config::FineConfig;
use crate::cursor::Cursor;
use crate::edge::EdgeWatch;
use crate::fault::{Fault, FaultKind};
use crate::guard::Guard;
use crate::outputs::Outputs;
use crate::ramp::Ramp;
use crate::state::{self, Input};
use attach::Attach;
use drives::Drives;
use govern::PlanFollower;
use hand_over::HandOver;
use joints::{JointSpace, Lead};
use keep_alive::KeepAlive;
use missed::Missed;
use progress::Progress;
use queue::QueueWatch;
use ratio::StrategyRatio;
use release::Release;
use rest::Stop;
use roles::RoleWatch;
use spindle::SpinUp;
pub use succeed::JobEnd;

/// What the drives were sent beside the axes when that last changed.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Left {
    /// The fine period.
    pub tick: u64,
    /// Block that moved.
    pub block: u64,
    /// Program line that moved.
    pub line: u32,
    /// What was sent.
    pub switched: Switched,
}

#[derive(Debug)]
#[allow(clippy::large_enum_variant)] // one of it lives for the whole run
enum Phase {
    /// Nothing has moved yet: the drives are enabled, and the queue fills.
    Waiting,
    Following,
    /// At the rest that ended an epoch: the rough loop plans the next one from there.
    AwaitingReplan,
    /// At rest: a drive homes its joint.
    HandedOver(HandOver),
    Ramping(Ramp),
    Faulted,
}

/// The hard loop. [`FineLoop::tick`] runs on the fine thread and does not allocate; the rest is the host's.
#[allow(clippy::struct_excessive_bools)] // each is about something else
pub struct FineLoop {
    config: FineConfig,
    drives: Drives,
    space: JointSpace,
    controls: Arc<Controls>,
    given: OperatorInputs,
    cause: StopCause,
    status: Arc<Status>,
    depth: Arc<Depth>,
    samples: Producer<Sample>,
    requests: Consumer<StrategyRequest>,
    rests: Producer<Rest>,
    ratio: StrategyRatio,
    plan: PlanFollower,
    /// Something has moved since the last hold between two lines.
    line_moves: bool,
    guard: Guard,
    edge: EdgeWatch,
    stop: Option<Stop>,
    keep_alive: KeepAlive,
    missed: Missed,
    progress: Progress,
    roles: RoleWatch,
    spin_up: SpinUp,
    outputs: Outputs,
    /// The drives stay enabled when the program has ended: another job may follow.
    stays: bool,
    phase: Phase,
    state: MachineState,
    queue: QueueWatch,
    tick: u64,
    attach: Attach,
    /// What the drives are to catch.
    arm: Arm,
    release: Release,
    left: Left,
    counters: Counters,
    fault: Option<Fault>,
    plugin_error: Option<PluginError>,
}

impl FineLoop {
    /// A loop at rest. `driver` is open and started; `kinematics` is `None` where joints are axes. Host; allocates.
    pub fn new(
        config: &FineConfig,
        end: FineEnd,
        driver: Box<dyn Driver>,
        kinematics: Option<Box<dyn Kinematics>>,
    ) -> Self {
        let joints = joints::count(config, kinematics.as_deref());
        Self {
            config: *config,
            drives: Drives::new(config, driver, joints),
            space: JointSpace::new(config, kinematics),
            controls: end.controls,
            given: OperatorInputs::default(),
            cause: StopCause::None,
            status: end.status,
            depth: end.depth,
            samples: end.samples,
            requests: end.requests,
            rests: end.rests,
            ratio: StrategyRatio::new(end.ratios, config.ratio_periods),
            plan: PlanFollower::new(config, Cursor::new(end.segments, &config.position)),
            line_moves: false,
            guard: Guard::new(config),
            edge: EdgeWatch::default(),
            stop: None,
            keep_alive: KeepAlive::default(),
            missed: Missed::new(config),
            progress: Progress::new(config),
            roles: RoleWatch::default(),
            spin_up: SpinUp::default(),
            outputs: Outputs::new(config.dry_run, config.unhomed),
            stays: false,
            phase: Phase::Waiting,
            state: MachineState::Fault,
            queue: QueueWatch::default(),
            tick: 0,
            attach: Attach::new(config),
            arm: Arm::default(),
            release: Release::default(),
            left: Left::default(),
            counters: Counters::default(),
            fault: None,
            plugin_error: None,
        }
    }

    /// One fine period: fine thread, no allocation, bounded work.
    pub fn tick(&mut self) {
        self.given = OperatorInputs::of(&self.controls);
        // Nothing of this job is left to be aborted: what is asked now is meant for the one that is about to take over.
        self.given.abort &= !self.outputs.ended;
        self.cause = StopCause::None;
        self.watch_jog();
        self.take_requests();
        self.watch_roles();
        let ended = self.outputs.ended;
        self.release.had_ended = ended;
        let waiting = matches!(self.phase, Phase::Waiting);
        let before_mm = self.plan.cursor.path_mm();
        let (position, input) = self.next_position();
        let all_hold = self.exchange(&position);
        self.state = state::next(
            state::next(self.state, self.input_of_drives(all_hold)),
            input,
        );
        let started = !(waiting && matches!(self.phase, Phase::Waiting));
        let recorded =
            (self.outputs.unhomed == 0 || self.config.record_drives) && self.handed_over() == 0;
        if started && recorded && !ended && !self.outputs.ended {
            let feed = (self.plan.cursor.path_mm() - before_mm) / self.config.period_s;
            self.publish(&position, feed);
        }
        self.keep_switched();
        self.tick += u64::from(started);
        self.report();
    }

    /// Hands samples out through another ring from here on. Host, before the first tick.
    pub fn hand_out_through(&mut self, samples: Producer<Sample>) {
        self.samples = samples;
    }

    /// Acknowledges a fault: the drives may be enabled. A machine starts faulted; one that has faulted since resets its drives,
    /// enables them where they stand, and reports the rest there. Host, between ticks.
    pub fn reset(&mut self) {
        self.state = state::next(self.state, Input::Reset);
        if matches!(self.phase, Phase::Faulted) {
            self.attach = Attach::again(self.drives.feedback.position);
            self.fault = None;
            self.plugin_error = None;
            self.space.lead = Lead::Axes;
            self.release = Release::default();
            self.plan.forget_rate(&self.config);
            self.progress = Progress::new(&self.config);
            self.forget_roles();
            self.phase = Phase::Waiting;
        }
    }

    /// Number of the fine period that comes next: 0 until the first motion.
    pub fn next_tick(&self) -> u64 {
        self.tick
    }

    /// How much later than its bus wants it the last exchange was, ns; `None` as long as no driver tells. Fine thread.
    pub fn phase_ns(&self) -> Option<i64> {
        self.drives.phase_ns()
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

    /// Whether the program has ended, or a fault has brought the machine to rest, and the drives have let go.
    pub fn is_over(&self) -> bool {
        self.release.is_over
    }

    /// Whether the joints do not hold yet: nothing can move, and planning waits for them. Any side.
    pub fn is_attaching(&self) -> bool {
        !self.attach.is_done() && !self.is_over()
    }

    /// The driver, for what its codes mean. Host, between ticks.
    pub fn driver(&self) -> &dyn Driver {
        self.drives.driver()
    }

    /// Whether the driver did not reach the drive of some joint in the last exchange. Host.
    pub fn has_lost_joints(&self) -> bool {
        self.drives.feedback.state[..self.drives.joints].contains(&JointState::Lost)
    }

    /// What was switched last. The period that ends a program switches, and has no sample. Host.
    pub fn left(&self) -> Left {
        self.left
    }

    /// Hands the driver back. Host.
    pub fn into_driver(self) -> Box<dyn Driver> {
        self.drives.into_driver()
    }

    fn next_position(&mut self) -> (AxisVector, Input) {
        if self.given.emergency_stop {
            // Also where another fault is being ramped out: it may be why somebody presses it.
            self.outputs
                .switch_off(self.config.kept_outputs, SwitchedBy::EmergencyStop);
            self.fail(FaultKind::EmergencyStop);
        }
        match &mut self.phase {
            Phase::Waiting => (*self.guard.position(), self.wait()),
            Phase::Following => self.follow(),
            Phase::AwaitingReplan => (self.stand(), self.await_replan()),
            Phase::HandedOver(hand) => {
                let hand = *hand;
                self.hand_over(hand)
            }
            Phase::Ramping(ramp) => {
                self.cause = StopCause::Fault;
                let (mut position, over) = (ramp.next(), ramp.is_over());
                self.add_joints(&mut position);
                let over = over && self.joints_rest();
                (
                    self.ramp_out(position, over),
                    if over { Input::Stopped } else { Input::Trip },
                )
            }
            Phase::Faulted => {
                self.cause = StopCause::Fault;
                (*self.guard.position(), Input::Stopped)
            }
        }
    }

    /// Motion starts when the drives hold and enough is queued.
    fn wait(&mut self) -> Input {
        if self.controls.soft_fault.load(Relaxed) {
            self.fail(FaultKind::Soft);
            return Input::Trip;
        }
        if self.given.abort && !self.attach.is_done() {
            return self.give_up_enabling();
        }
        if self.state != MachineState::Standstill {
            return Input::Rest;
        }
        if self.given.abort || self.is_jog_let_go() {
            return self.end_epoch(Stop::abort());
        }
        let of_this_epoch = self.plan.cursor.epoch() == 0
            || (self.depth.is_of(self.plan.cursor.epoch()) && self.plan.cursor.drop_older());
        if of_this_epoch && self.depth.may_start(self.plan.cursor.program_time_s()) {
            self.phase = Phase::Following;
        }
        Input::Rest
    }

    fn ramp_out(&mut self, position: AxisVector, over: bool) -> AxisVector {
        self.guard.check(&position, self.outputs.unhomed);
        self.guard.sent(&position);
        if over {
            if self.outputs.by != SwitchedBy::EmergencyStop {
                self.outputs
                    .switch_off(self.config.kept_outputs, SwitchedBy::Fault);
            }
            self.drives.quick_stop();
            self.phase = Phase::Faulted;
        }
        position
    }

    /// Goes into the fault reaction: the first cause counts.
    fn fail(&mut self, kind: FaultKind) {
        if self.fault.is_some() {
            return;
        }
        self.end_hand_over();
        self.arm = Arm::default();
        self.fault = Some(Fault {
            kind,
            tick: self.tick,
            line: self.plan.cursor.segment().line,
        });
        self.phase = Phase::Ramping(Ramp::new(&self.config, &self.guard));
    }
}
