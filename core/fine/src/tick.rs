//! The fine loop itself: the order in which its parts act in a period, and what a fault does to them.
//!
//! Each part owns what it knows and knows nothing of this file: [`operator`] what is asked for, [`rate`] the plan and how fast
//! program time passes, [`stops`] which rest ends an epoch, [`actuation`] the guard, the joints and the drives, [`report`] what the
//! soft side is told. A part that finds a fault gives it back; [`FineLoop::fail`] is where the machine reacts.

mod actuation;
mod attach;
mod drives;
mod govern;
mod hand_over;
mod host;
mod joints;
mod missed;
mod operator;
mod pieces;
mod progress;
mod queue;
mod rate;
mod ratio;
mod release;
mod report;
mod roles;
mod spindle;
mod stops;

use tandem_rings::{
    Counters, MachineState, Queued, Rest, RestCause, Sample, StopCause, Switched, SwitchedBy,
};
use tandem_sdk::{AxisVector, Edge, EventKind, PluginError};

use crate::answer;
use crate::config::{FineConfig, GuardMode, Joints};
use crate::cursor::{Reached, is_cut};
use crate::fault::{Fault, FaultKind, InputFault};
use crate::guard::Checked;
use crate::outputs::{Outputs, Waits};
use crate::ramp::Ramp;
use crate::state::{self, Input};
use actuation::Actuation;
use attach::Watched;
use drives::SetpointExtras;
use govern::Ask;
use hand_over::{Found, HandOver};
use missed::Missed;
use operator::Operator;
use rate::Rate;
use release::Release;
pub use report::{JobEnd, Left};
use report::{Present, Report};
use roles::{Doing, RoleWatch};
use spindle::SpinUp;
use stops::{Stop, Stops};

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

impl Phase {
    /// The joint in its drive's hands.
    fn hand(&mut self) -> Option<&mut HandOver> {
        match self {
            Self::HandedOver(hand) => Some(hand),
            _ => None,
        }
    }

    /// Joints in their drives' hands, a bit each.
    fn handed_over(&self) -> u32 {
        match self {
            Self::HandedOver(hand) => 1 << hand.joint(),
            _ => 0,
        }
    }
}

/// The hard loop. [`FineLoop::tick`] runs on the fine thread and does not allocate; the rest is the host's.
pub struct FineLoop {
    config: FineConfig,
    operator: Operator,
    rate: Rate,
    stops: Stops,
    outputs: Outputs,
    spin_up: SpinUp,
    roles: RoleWatch,
    actuation: Actuation,
    release: Release,
    missed: Missed,
    report: Report,
    counters: Counters,
    phase: Phase,
    state: MachineState,
    tick: u64,
    fault: Option<Fault>,
    plugin_error: Option<PluginError>,
}

/// A period.
impl FineLoop {
    /// One fine period: fine thread, no allocation, bounded work.
    pub fn tick(&mut self) {
        let had_ended = self.outputs.ended;
        self.operator.begin_period(had_ended);
        self.stops.set_cause(StopCause::None);
        self.counters.late_ratios += self.operator.take_requests(self.tick);
        self.watch_roles();
        self.release.begin_period(had_ended);
        let waiting = matches!(self.phase, Phase::Waiting);
        let before_mm = self.rate.cursor().path_mm();
        let (position, input) = self.next_position();
        let all_hold = self.exchange(&position);
        self.state = state::next(
            state::next(self.state, self.input_of_drives(all_hold)),
            input,
        );
        let started = !(waiting && matches!(self.phase, Phase::Waiting));
        let recorded = (self.outputs.unhomed == 0 || self.config.record_drives)
            && self.phase.handed_over() == 0;
        let switched = self.switched();
        let is_sampled = started && recorded && !had_ended && !self.outputs.ended;
        if is_sampled {
            let feed = (self.rate.cursor().path_mm() - before_mm) / self.config.period_s;
            self.publish(&position, feed, switched);
        }
        let segment = self.rate.cursor().segment();
        self.report.keep_switched(self.tick, segment, &switched);
        self.tick += u64::from(started);
        let present = Present {
            tick: self.tick,
            state: self.state,
            is_faulted: self.fault.is_some(),
            end_feed_mm_per_s: self.end_feed_mm_per_s(),
            waits_for_spindle: self.spin_up.waits(),
            all_hold: self.actuation.all_hold(),
            is_sampled,
        };
        let drives = self.actuation.drives();
        self.report
            .tell(&present, &self.rate, drives, &self.counters);
    }

    /// Before a period: what the inputs with a role ask for in it.
    fn watch_roles(&mut self) {
        let (meant, drives) = (&self.config.roles, self.actuation.drives());
        let Some(tripped) = self.roles.judge(meant, drives.feedback()) else {
            return;
        };
        self.report.tell_tripped(tripped.all);
        let stop_on = &self.rate.cursor().segment().stop_on;
        let stays = || self.release.stays_enabled(self.operator.lets_drives_go());
        let doing = Doing {
            moves: matches!(self.phase, Phase::Following)
                && drives.setpoint().velocity != AxisVector::ZERO,
            homes: self.outputs.unhomed != 0,
            holds: self.actuation.all_hold() && (!self.outputs.ended || stays()),
            awaited: roles::awaited(stop_on),
        };
        if let Some(kind) = self.roles.fault(meant, &tripped, &doing) {
            // What the operator's emergency stop switches off, that of an input does too, whatever has been a fault before.
            if let FaultKind::Input {
                role: InputFault::EmergencyStop,
                ..
            } = kind
            {
                self.operator.press_emergency_stop();
            }
            self.fail(kind);
        }
        // The spindle of an open door is off, whatever the axes do.
        if self.roles.opens_door(&self.config.roles, &tripped) {
            self.outputs.switch_by_door();
        }
        if self.fault.is_some() || !self.actuation.all_hold() || self.outputs.ended {
            return;
        }
        if self.roles.asks_for_hold(&self.config.roles, &tripped) {
            self.operator.hold();
        }
        // Where the operator has resumed, what was switched off comes first.
        if !self.operator.inputs().hold && self.roles.resume() {
            self.outputs.switch_by_door();
            self.spin_up = SpinUp::begin();
        }
    }

    fn next_position(&mut self) -> (AxisVector, Input) {
        if self.operator.inputs().emergency_stop {
            // Also where another fault is being ramped out: it may be why somebody presses it.
            self.outputs
                .switch_off(self.config.kept_outputs, SwitchedBy::EmergencyStop);
            self.fail(FaultKind::EmergencyStop);
        }
        match &mut self.phase {
            Phase::Waiting => (self.actuation.position(), self.wait()),
            Phase::Following => self.follow(),
            Phase::AwaitingReplan => (self.stand(), self.await_replan()),
            Phase::HandedOver(hand) => {
                let hand = *hand;
                let input = self.watch_hand(hand);
                (self.stand(), input)
            }
            Phase::Ramping(ramp) => {
                self.stops.set_cause(StopCause::Fault);
                let (mut position, over) = (ramp.next(), ramp.is_over());
                self.add_joints(&mut position);
                let over = over && self.actuation.joints_rest(&self.config);
                self.ramp_out(&position, over);
                (position, if over { Input::Stopped } else { Input::Trip })
            }
            Phase::Faulted => {
                self.stops.set_cause(StopCause::Fault);
                (self.actuation.position(), Input::Stopped)
            }
        }
    }

    fn stand(&mut self) -> AxisVector {
        self.actuation.stand(self.outputs.unhomed)
    }

    /// Motion starts when the drives hold and enough is queued.
    fn wait(&mut self) -> Input {
        if self.fails_with_soft_side() {
            return Input::Trip;
        }
        let aborts = self.operator.inputs().abort;
        if aborts && !self.actuation.all_hold() {
            return self.give_up_enabling();
        }
        if self.state != MachineState::Standstill {
            return Input::Rest;
        }
        if aborts || self.operator.is_jog_let_go() {
            return self.end_epoch(Stop::of(RestCause::Abort));
        }
        if self.rate.may_start() {
            self.phase = Phase::Following;
        }
        Input::Rest
    }

    /// The operator aborts before the joints hold: they are not told to any more, and nothing follows.
    fn give_up_enabling(&mut self) -> Input {
        let input = self.end_epoch(Stop::of(RestCause::Abort));
        if matches!(self.phase, Phase::AwaitingReplan) {
            self.outputs.ended = true;
            self.release.begin();
        }
        input
    }

    /// Motion starts again when the rough loop has taken the report and enough of the new epoch is queued.
    fn await_replan(&mut self) -> Input {
        if self.fails_with_soft_side() {
            return Input::Trip;
        }
        if self.outputs.ended {
            return Input::Rest;
        }
        if self.operator.inputs().abort {
            return self.end_epoch(Stop::of(RestCause::Abort));
        }
        if self.rate.may_start() && self.state == MachineState::Standstill {
            self.phase = Phase::Following;
        }
        Input::Rest
    }

    /// Where nothing moves along the plan, a failure of the soft side is a fault at once.
    fn fails_with_soft_side(&mut self) -> bool {
        let has_failed = self.operator.has_soft_fault();
        if has_failed {
            self.fail(FaultKind::Soft);
        }
        has_failed
    }
}

/// Following the plan.
impl FineLoop {
    /// Follows the plan for one period.
    fn follow(&mut self) -> (AxisVector, Input) {
        self.counters.late_ratios += self.rate.take_ratios(self.tick);
        self.look_for_stop();
        let single_block = self.operator.inputs().single_block;
        if self.rate.is_between_lines(single_block) {
            self.operator.hold();
        }
        let ask = self.ask();
        if let Some(kind) = self.spin_up.fault(self.actuation.drives(), &self.config) {
            self.fail(kind);
            return self.next_position();
        }
        self.stops.set_cause(self.cause_of(ask));
        self.rate.begin_at_rest(ask);
        if ask == Ask::Hold && self.rate.sigma() == 0.0 && self.fails_with_soft_side() {
            return (self.actuation.position(), Input::Trip);
        }
        if let Some(stop) = self.stops.stop().filter(|_| self.rate.stands()) {
            return (self.stand(), self.end_epoch(stop));
        }
        if ask == Ask::Run {
            if let Some(input) = self.begin_hand_over() {
                return (self.actuation.position(), input);
            }
            let next = self.rate.next_stop_on();
            if next.is_some_and(|stop_on| self.stops.arm_for(&stop_on)) {
                return (self.stand(), Input::Run);
            }
        }
        let delta_s = self.govern(ask, single_block);
        let reached = self.advance(delta_s);
        let inputs = self.operator.inputs();
        let late = self
            .rate
            .watch_progress(ask, reached, &self.config, &self.outputs, inputs);
        if let Some(kind) = late {
            self.fail(kind);
        }
        let (cursor, drives) = (self.rate.cursor(), self.actuation.drives());
        self.stops
            .begin_edge(cursor.segment(), drives, &self.config);
        let mut position = cursor.position(self.config.lane_count());
        self.add_joints(&mut position);
        let checked = self.actuation.check(&position, self.outputs.unhomed);
        self.counters.jerk_relaxed_samples += u64::from(checked.relaxed);
        let position = self.let_pass(position, &checked);
        (position, self.input(ask, reached))
    }

    /// An abort, a jog that is let go, axes whose position is set anew, or a motion that ended without its edge.
    fn look_for_stop(&mut self) {
        let cursor = self.rate.cursor();
        if self.operator.inputs().abort {
            self.stops.ask(RestCause::Abort);
        } else if self.operator.is_jog_let_go() {
            self.stops.ask_first(RestCause::Abort);
        } else if cursor.is_resting() {
            if let Some(by) = self.outputs.correction.take() {
                self.actuation.correct(&by);
                self.stops.ask(RestCause::Corrected);
            } else if cursor.segment().stop_on.edge != Edge::None {
                self.stops.ask_first(RestCause::Missed);
            }
        }
    }

    /// What is asked of the rate of program time, before ratios.
    fn ask(&mut self) -> Ask {
        self.spin_up.begin_period();
        if std::mem::take(&mut self.outputs.stop_requested) {
            self.operator.hold_for_program();
        }
        let starves = self.rate.look_at_queue(self.config.period_s);
        self.counters.starvations += u64::from(starves);
        if self.operator.is_held() || self.operator.has_soft_fault() {
            return Ask::Hold;
        }
        if self.stops.stop().is_some() {
            return Ask::Stop;
        }
        if self.rate.is_starved() {
            return Ask::Starve;
        }
        let stands_inside = self.rate.stands_inside();
        let drives = self.actuation.drives();
        let is_cutting = || self.rate.is_cutting();
        if self
            .spin_up
            .look(drives, &self.config, stands_inside, is_cutting)
        {
            Ask::Hold
        } else {
            Ask::Run
        }
    }

    /// Why the rate of program time is to go down: what lasts longest comes first.
    fn cause_of(&self, ask: Ask) -> StopCause {
        match (ask, self.stops.stop().map(|stop| stop.cause)) {
            (Ask::Run, _) => StopCause::None,
            _ if self.operator.has_soft_fault() => StopCause::SoftFault,
            (_, Some(RestCause::Abort)) => StopCause::Abort,
            (_, Some(RestCause::Edge | RestCause::Already)) => StopCause::Edge,
            (Ask::Hold, _) if self.operator.inputs().hold => self.roles.cause_of_hold(),
            (Ask::Hold, _) if self.spin_up.waits() => StopCause::Spindle,
            (Ask::Hold, _) => StopCause::ProgramStop,
            (Ask::Stop, _) => StopCause::None,
            (Ask::Starve, _) => StopCause::Starvation,
        }
    }

    fn ratios_in_force(&self) -> ratio::Ratios {
        self.rate
            .ratios_in_force(&self.config, &self.outputs, self.operator.inputs())
    }

    /// Chooses the rate for this period; gives the program time that passes, s.
    fn govern(&mut self, ask: Ask, single_block: bool) -> f64 {
        let ratios = self.ratios_in_force();
        let governed = self.rate.govern(ask, ratios, single_block);
        self.counters.queue_limited_samples += u64::from(governed.is_queue_limited);
        self.counters.governed_samples += u64::from(governed.is_unasked);
        if governed.is_jerk_relaxed {
            self.actuation.relax_jerk();
        }
        if governed.holds {
            self.operator.hold_from_next_period();
        }
        governed.delta_s
    }

    /// Moves on by `delta_s` of program time, and switches what is met on the way.
    fn advance(&mut self, delta_s: f64) -> Reached {
        // Which words wait for the operator now.
        let waits = Waits {
            program: self.config.pause_at_stops && !self.config.dry_run,
            optional: self.operator.inputs().optional_stop && !self.config.dry_run,
        };
        self.rate.advance(delta_s, |queued| {
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
        })
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
                self.actuation.send(&position);
                position
            }
        }
    }

    fn input(&self, ask: Ask, reached: Reached) -> Input {
        match (&self.phase, ask) {
            (Phase::Ramping(_), _) => Input::Trip,
            (Phase::Faulted, _) => Input::Stopped,
            (_, Ask::Hold | Ask::Stop) => Input::Hold,
            (_, Ask::Starve) => Input::Starve,
            _ if reached == Reached::Rest && self.rate.cursor().is_last() => Input::Rest,
            _ => Input::Run,
        }
    }

    /// At rest: reports it and ends the epoch. Where the reports before have not been taken yet, it waits for that.
    fn end_epoch(&mut self, stop: Stop) -> Input {
        let latch = stop.latch.map(|joints| self.axes_of(&joints));
        if self.fault.is_some() {
            // The kinematics do not know where the drives caught the edge: nothing is planned from there.
            return Input::Trip;
        }
        let position = self.actuation.position();
        let cursor = self.rate.cursor();
        let is_reported = self.stops.report(Rest {
            epoch: cursor.epoch(),
            cause: stop.cause,
            tick: self.tick,
            block: cursor.segment().block,
            line: cursor.segment().line,
            stop_on: cursor.segment().stop_on,
            position: self.config.axes_alone(&position),
            latch,
            program_time_s: cursor.program_time_s(),
            path_mm: cursor.path_mm(),
        });
        if !is_reported {
            return Input::Hold;
        }
        self.rate.end_epoch(&position);
        self.phase = Phase::AwaitingReplan;
        // A jog that is let go leaves a hold as it is: the next one waits for its end too. An abort that comes while the joints
        // are enabled is still to act.
        if self.operator.inputs().abort && stop.cause != RestCause::Attached {
            self.outputs.abort();
            self.operator.forget_abort();
        }
        Input::Rest
    }
}

/// Homing by the drives.
impl FineLoop {
    /// At a rest: hands the joint over that an event has named.
    fn begin_hand_over(&mut self) -> Option<Input> {
        if !self.rate.cursor().is_resting() {
            return None;
        }
        let (joint, within_s) = self.outputs.hand_over.take()?;
        let drives = self.actuation.drives();
        if joint >= drives.joints() {
            return None;
        }
        self.phase = Phase::HandedOver(HandOver::begin(joint, within_s, drives));
        Some(Input::Run)
    }

    /// What one period of a joint in its drive's hands is to the machine's state.
    fn watch_hand(&mut self, mut hand: HandOver) -> Input {
        let is_held = self.operator.is_held();
        let gives_up = self.operator.inputs().abort || self.operator.is_jog_let_go();
        let period_s = self.config.period_s;
        let found = self
            .actuation
            .look_at_hand(&mut hand, period_s, is_held, gives_up);
        match found {
            Found::Homed => {
                self.take_back(hand.joint());
                self.end_epoch(Stop::of(RestCause::Corrected))
            }
            Found::GivenUp => {
                self.take_back(hand.joint());
                self.end_epoch(Stop::of(RestCause::Abort))
            }
            Found::Late(kind) => {
                self.fail(kind);
                Input::Trip
            }
            Found::Goes if self.fails_with_soft_side() => Input::Trip,
            Found::Goes => {
                self.phase = Phase::HandedOver(hand);
                if is_held { Input::Hold } else { Input::Run }
            }
        }
    }

    /// The machine stands where the drive says that its joint is.
    fn take_back(&mut self, joint: usize) {
        let joints = self.actuation.take_back(&self.config, joint);
        self.stand_at(&joints);
        self.actuation.forget_way(&joints);
    }
}

/// Joints and drives.
impl FineLoop {
    /// What was sent last.
    fn switched(&self) -> Switched {
        let setpoint = self.actuation.drives().setpoint();
        Switched {
            outputs: setpoint.outputs,
            spindle_rad_per_s: setpoint.spindle_rad_per_s,
            by: self.outputs.by,
        }
    }

    /// Whether the drives are to let go: the program had ended before this period and no other job may follow, or a fault has
    /// brought the machine to rest.
    fn is_letting_go(&self) -> bool {
        self.release.is_due(self.operator.lets_drives_go()) || matches!(self.phase, Phase::Faulted)
    }

    /// Exchanges setpoints and feedback with the drives. Returns whether all joints hold afterwards.
    fn exchange(&mut self, axes: &AxisVector) -> bool {
        let lets_go = self.is_letting_go();
        let may_hold =
            || self.fault.is_none() && !lets_go && self.roles.may_enable(&self.config.roles);
        let hand = self.phase.hand();
        self.actuation
            .set_joints(&self.config, axes, hand, may_hold, lets_go);
        let extras = SetpointExtras {
            arm: self.stops.arm(),
            // Where axes are homed, joints are axes.
            limited: self.outputs.unhomed & self.config.homing_limits,
            outputs: self.outputs.bits,
            spindle_rad_per_s: if self.roles.is_door_open() {
                0.0
            } else {
                self.outputs.spindle_rad_per_s
            },
        };
        let exchanged = self
            .actuation
            .exchange(self.tick, &extras, &mut self.plugin_error);
        let drives = self.actuation.drives();
        self.roles.hear(exchanged.failed);
        self.spin_up.hear(drives, &self.config);
        self.counters.old_feedback_periods += u64::from(exchanged.age_periods > 0);
        self.report
            .tell_bus(drives.feedback(), exchanged.age_periods);
        // What is true nearly always is looked at first.
        if exchanged.failed
            || exchanged.unreadable.is_some()
            || !exchanged.all_hold
            || drives.judges_following()
        {
            let moving = matches!(
                self.phase,
                Phase::Following | Phase::AwaitingReplan | Phase::HandedOver(_)
            );
            let own = self.phase.handed_over();
            let fault =
                self.actuation
                    .fault_of_answer(&self.config, &exchanged, moving, own, lets_go);
            if let Some(kind) = fault {
                self.fail(kind);
            }
        }
        if !self.actuation.all_hold() && self.fault.is_none() && !lets_go {
            self.watch_attach();
        }
        if matches!(self.phase, Phase::Following) {
            let stop_on = &self.rate.cursor().segment().stop_on;
            self.stops
                .watch_edge(stop_on, self.actuation.drives(), &self.config);
        }
        if lets_go {
            let max_periods = self.config.disable_periods;
            self.release
                .watch(self.actuation.drives(), exchanged.failed, max_periods);
        }
        exchanged.all_hold
    }

    /// After an exchange with joints that do not all hold: where they do now, the machine stands where they are, and planning starts
    /// from there.
    fn watch_attach(&mut self) {
        match self.actuation.watch_attach(self.config.enable_periods) {
            Watched::Goes => return,
            Watched::Late(kind) => return self.fail(kind),
            Watched::AllHold => {}
        }
        if let Some(joints) = self.actuation.found_elsewhere(&self.config) {
            self.stand_at(&joints);
        }
        if self.fault.is_none() && self.config.plans_from_rest {
            self.end_epoch(Stop::of(RestCause::Attached));
            // Ticks are counted from the first motion on.
            self.phase = Phase::Waiting;
        }
    }

    /// What the drives do for the state of the machine, where `all_hold` or not all of them do.
    fn input_of_drives(&self, all_hold: bool) -> Input {
        let own = self.phase.handed_over();
        if all_hold || self.actuation.drives().hold_others_than(own) {
            Input::DrivesOn
        } else {
            Input::DrivesOff
        }
    }

    /// A sample on its way to the guard gets the joints behind the axes.
    #[inline]
    fn add_joints(&mut self, position: &mut AxisVector) {
        let after_fault = self.fault.is_some();
        if let Some(kind) = self
            .actuation
            .add_joints(&self.config, after_fault, position)
        {
            self.lose_way(kind);
        }
    }

    /// Axis coordinates of what the drives report, mm or rad. Where the kinematics do not know, the last ones, and a fault.
    #[inline]
    fn axes_of(&mut self, joints: &AxisVector) -> AxisVector {
        if let Some(axes) = self.actuation.space().axes_alone(joints) {
            return axes;
        }
        match self.actuation.axes_by_kinematics(&self.config, joints) {
            Ok(axes) => axes,
            Err(kind) => {
                self.lose_way(kind);
                *self.actuation.space().last_axes()
            }
        }
    }

    /// Takes the place of `joints` as that of the axes; what a joint is beside them, such as one of a gantry, it keeps.
    fn stand_at(&mut self, joints: &AxisVector) {
        let axes = self.axes_of(joints);
        let mut position = self.config.axes_alone(&axes);
        match self.config.joints {
            Joints::Axes => {}
            Joints::Sums(lanes) => lanes.fill(&mut position),
            Joints::Curved { .. } => self.add_joints(&mut position),
        }
        self.actuation.place(&self.config, joints, &position);
    }

    /// Path speed at the end of the period, mm/s. Off the plan nothing is fed: σ keeps what it was when the fault came.
    fn end_feed_mm_per_s(&self) -> f64 {
        if self.fault.is_some() {
            0.0
        } else {
            self.rate.end_feed_mm_per_s()
        }
    }

    fn publish(&mut self, command: &AxisVector, feed_mm_per_s: f64, switched: Switched) {
        let reported = self.actuation.drives().feedback().position;
        let (command, feedback) = if self.config.record_drives {
            (*command + *self.actuation.space().offset(), reported)
        } else {
            (self.config.axes_alone(command), self.axes_of(&reported))
        };
        let ratio = self.ratios_in_force().feed;
        let drives = self.actuation.drives();
        let (answer, segment) = (drives.feedback(), self.rate.cursor().segment());
        let given = self.operator.inputs();
        let end_feed_mm_per_s = self.end_feed_mm_per_s();
        self.counters.samples += 1;
        self.report.publish(|| Sample {
            tick: self.tick,
            block: segment.block,
            line: segment.line,
            state: self.state,
            command,
            feedback,
            speed: answer.speed,
            current_a: answer.current_a,
            feed_mm_per_s,
            end_feed_mm_per_s,
            programmed_feed_mm_per_s: segment.feed_mm_per_s,
            sigma: self.rate.sigma(),
            ratio,
            feed_override: self.outputs.permitted_override(given),
            spindle_rad_per_s: answer.spindle_rad_per_s,
            switched,
            phase_ns: drives.phase_ns(),
            analog: answer.analog,
            inputs: answer.inputs,
            old_inputs: answer::old_inputs(answer),
            age_periods: answer::ages(answer, drives.joints()),
            cause: self.stops.cause(),
            given: *given,
        });
    }
}

/// Faults.
impl FineLoop {
    /// Goes into the fault reaction: the first cause counts.
    fn fail(&mut self, kind: FaultKind) {
        if self.fault.is_some() {
            return;
        }
        // What a drive has in its hands is taken back as it is.
        if let Phase::HandedOver(hand) = &self.phase {
            let joint = hand.joint();
            self.phase = Phase::AwaitingReplan;
            self.take_back(joint);
        }
        self.stops.disarm();
        self.fault = Some(Fault {
            kind,
            tick: self.tick,
            line: self.rate.cursor().segment().line,
        });
        self.phase = Phase::Ramping(Ramp::new(&self.config, self.actuation.guard()));
    }

    /// The kinematics do not know the way; the plugin's own words about it are kept for the host.
    #[cold]
    fn lose_way(&mut self, kind: FaultKind) {
        if self.fault.is_none()
            && let Some(error) = self.actuation.space().error()
        {
            self.plugin_error.get_or_insert(error);
        }
        self.fail(kind);
    }

    fn ramp_out(&mut self, position: &AxisVector, over: bool) {
        self.actuation.check(position, self.outputs.unhomed);
        self.actuation.send(position);
        if over {
            if self.outputs.by != SwitchedBy::EmergencyStop {
                self.outputs
                    .switch_off(self.config.kept_outputs, SwitchedBy::Fault);
            }
            self.actuation.quick_stop();
            self.phase = Phase::Faulted;
        }
    }
}
