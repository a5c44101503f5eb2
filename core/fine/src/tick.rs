//! The fine loop itself.

use std::sync::Arc;
use std::sync::atomic::Ordering::Relaxed;

use rtrb::{Consumer, Producer};
use tandem_rings::{Controls, Depth, FineEnd, MachineState, Ratio, Sample, Status};
use tandem_sdk::{AxisVector, Driver, Feedback, JointState, Kinematics, Setpoint};

use crate::answer::{self, Numbers};
use crate::config::{FineConfig, GuardMode};
use crate::cursor::{Cursor, Reached};
use crate::fault::{Fault, FaultKind};
use crate::governor::Governor;
use crate::guard::{Checked, Guard};
use crate::outputs::Outputs;
use crate::points::Points;
use crate::ramp::Ramp;
use crate::state::{self, Input};

/// What the fine loop counted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counters {
    /// Samples handed out.
    pub samples: u64,
    /// Samples the guard stopped: 0 or 1.
    pub guard_stops: u64,
    /// Samples beyond a limit that were sent all the same (`guard.mode = "count"`).
    pub limit_violations: u64,
    /// Samples with σ < 1 though nothing asked for it.
    pub governed_samples: u64,
    /// How often the queue ran low.
    pub starvations: u64,
    /// Ratios that came after the tick they were meant for.
    pub late_ratios: u64,
    /// Fine periods that passed without a sample.
    pub missed_periods: u64,
}

#[derive(Debug)]
#[allow(clippy::large_enum_variant)] // one of it lives for the whole run
enum Phase {
    /// Nothing has moved yet: the queue fills.
    Waiting,
    Following,
    Ramping(Ramp),
    Faulted,
}

/// Why the rate of program time is to go down.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Ask {
    Run,
    Hold,
    Starve,
}

/// The hard loop. [`FineLoop::tick`] runs on the fine thread and does not allocate; the rest is the host's.
pub struct FineLoop {
    config: FineConfig,
    driver: Box<dyn Driver>,
    kinematics: Option<Box<dyn Kinematics>>,
    joints: usize,
    controls: Arc<Controls>,
    status: Arc<Status>,
    depth: Arc<Depth>,
    samples: Producer<Sample>,
    ratios: Consumer<Ratio>,
    next_ratio: Option<Ratio>,
    ratio: f64,
    cursor: Cursor,
    points: Points,
    governor: Governor,
    guard: Guard,
    outputs: Outputs,
    phase: Phase,
    state: MachineState,
    starved: bool,
    recovering: bool,
    tick: u64,
    setpoint: Setpoint,
    feedback: Feedback,
    counters: Counters,
    fault: Option<Fault>,
}

/// The feed ratios that count now.
struct Ratios {
    feed: f64,
    rapid: f64,
}

impl FineLoop {
    /// A loop at rest. `driver` is open and started; `kinematics` is `None` where joints are axes. Host; allocates.
    pub fn new(
        config: &FineConfig,
        end: FineEnd,
        driver: Box<dyn Driver>,
        kinematics: Option<Box<dyn Kinematics>>,
    ) -> Self {
        let (limits, axes) = (&config.limits.axes, config.axis_count());
        Self {
            config: *config,
            driver,
            joints: kinematics.as_ref().map_or(axes, |k| k.joint_count(axes)),
            kinematics,
            controls: end.controls,
            status: end.status,
            depth: end.depth,
            samples: end.samples,
            ratios: end.ratios,
            next_ratio: None,
            ratio: 1.0,
            cursor: Cursor::new(end.segments, &config.position),
            points: Points::new(limits, axes),
            governor: Governor::new(limits, axes, config.period_s),
            guard: Guard::new(config),
            outputs: Outputs::default(),
            phase: Phase::Waiting,
            state: MachineState::Fault,
            starved: false,
            recovering: false,
            tick: 0,
            setpoint: Setpoint::default(),
            feedback: Feedback::default(),
            counters: Counters::default(),
            fault: None,
        }
    }

    /// One fine period: fine thread, no allocation, bounded work.
    pub fn tick(&mut self) {
        let ended = self.outputs.ended;
        let waiting = matches!(self.phase, Phase::Waiting);
        let before_mm = self.cursor.path_mm();
        let (position, input) = self.next_position();
        self.exchange(&position);
        self.state = state::next(state::next(self.state, self.drives()), input);
        let started = !(waiting && matches!(self.phase, Phase::Waiting));
        if started && !ended && !self.outputs.ended {
            let feed = (self.cursor.path_mm() - before_mm) / self.config.period_s;
            self.publish(&position, feed);
        }
        self.tick += u64::from(started);
        self.report();
    }

    /// Fine periods went by without a sample; more than `most` are a fault. Fine thread.
    pub fn missed(&mut self, periods: u64, most: u64) {
        self.counters.missed_periods += periods;
        if periods > most {
            self.fail(FaultKind::MissedPeriods);
        }
    }

    /// Acknowledges a fault: the drives may be enabled. A machine starts faulted. Host, between runs.
    pub fn reset(&mut self) {
        self.state = state::next(self.state, Input::Reset);
    }

    /// Number of the fine period that comes next: 0 until the first motion.
    pub fn next_tick(&self) -> u64 {
        self.tick
    }

    /// What was counted so far.
    pub fn counters(&self) -> Counters {
        self.counters
    }

    /// The fault, if there is one.
    pub fn fault(&self) -> Option<Fault> {
        self.fault
    }

    /// Whether the program has ended, or a fault has brought the machine to rest.
    pub fn is_over(&self) -> bool {
        self.outputs.ended || matches!(self.phase, Phase::Faulted)
    }

    /// Hands the driver back. Host.
    pub fn into_driver(self) -> Box<dyn Driver> {
        self.driver
    }

    fn next_position(&mut self) -> (AxisVector, Input) {
        if self.controls.emergency_stop.load(Relaxed) {
            self.fail(FaultKind::EmergencyStop);
        }
        match &mut self.phase {
            Phase::Waiting => (*self.guard.position(), self.wait()),
            Phase::Following => self.follow(),
            Phase::Ramping(ramp) => {
                let position = ramp.next();
                let over = ramp.is_over();
                (self.ramp_out(position, over), if over { Input::Stopped } else { Input::Trip })
            }
            Phase::Faulted => (*self.guard.position(), Input::Stopped),
        }
    }

    /// Motion starts when the drives hold and enough is queued.
    fn wait(&mut self) -> Input {
        if self.controls.soft_fault.load(Relaxed) {
            self.fail(FaultKind::Soft);
            return Input::Trip;
        }
        if self.state == MachineState::Standstill && self.depth.may_start(self.cursor.program_time_s()) {
            self.phase = Phase::Following;
        }
        Input::Rest
    }

    fn ramp_out(&mut self, position: AxisVector, over: bool) -> AxisVector {
        let checked = self.guard.check(&position);
        self.guard.sent(&position, &checked);
        if over {
            self.driver.quick_stop();
            self.phase = Phase::Faulted;
        }
        position
    }

    /// Follows the plan for one period.
    fn follow(&mut self) -> (AxisVector, Input) {
        self.take_ratio();
        let ask = self.ask();
        if self.cursor.is_resting() {
            self.governor.jump(if ask == Ask::Run { 1.0 } else { 0.0 });
        }
        if self.governor.sigma() == 0.0 && ask == Ask::Hold && self.controls.soft_fault.load(Relaxed) {
            self.fail(FaultKind::Soft);
            return (*self.guard.position(), Input::Trip);
        }
        let delta_s = self.govern(ask);
        let reached = self.cursor.advance(delta_s, |event| self.outputs.apply(event));
        let position = self.cursor.position();
        let checked = self.guard.check(&position);
        let position = self.let_pass(position, &checked);
        (position, self.input(ask, reached))
    }

    fn let_pass(&mut self, position: AxisVector, checked: &Checked) -> AxisVector {
        match (checked.breach, self.config.guard) {
            (Some(breach), GuardMode::Stop) => {
                self.counters.guard_stops += 1;
                self.fail(breach);
                self.next_position().0
            }
            (breach, _) => {
                self.counters.limit_violations += u64::from(breach.is_some());
                self.guard.sent(&position, checked);
                position
            }
        }
    }

    /// What is asked of the rate of program time, before ratios.
    fn ask(&mut self) -> Ask {
        let stop_wanted = self.config.pause_at_stops && self.outputs.stop_requested;
        if stop_wanted {
            self.controls.hold.store(true, Relaxed);
            self.status.program_stop.store(true, Relaxed);
            self.outputs.stop_requested = false;
        }
        self.watch_queue();
        if self.controls.hold.load(Relaxed) || self.controls.soft_fault.load(Relaxed) {
            Ask::Hold
        } else if self.starved {
            Ask::Starve
        } else {
            Ask::Run
        }
    }

    /// Starvation: the end of the queue is a wall unless it ends at rest, and the machine must be able to stop before.
    fn watch_queue(&mut self) {
        let wall_s = self.depth.wall_s.load();
        if self.starved {
            self.starved = !self.depth.may_start(self.cursor.program_time_s());
            return;
        }
        let speed = self.governor.sigma() * self.cursor.path_speed_mm_per_s();
        let deceleration = self.depth.stop_deceleration_mm_per_s2.load();
        // The declared deceleration is kept within the governor's margin and from the next period on.
        let stop_s = speed / (STOP_SHARE * deceleration) + 3.0 * self.config.period_s;
        if speed > 0.0 && wall_s - self.cursor.program_time_s() < stop_s {
            self.starved = true;
            self.counters.starvations += 1;
        }
    }

    /// Chooses the rate for this period; gives the program time that passes, s.
    fn govern(&mut self, ask: Ask) -> f64 {
        self.cursor.scan(self.config.period_s, &mut self.points);
        // Under `count` everything is sent: forms that break limits on purpose are not slowed.
        let counting = self.config.guard == GuardMode::Count;
        let limit = if counting { 1.0 } else { Governor::plan_limit(&self.points) };
        let ratios = self.ratios_in_force();
        let wanted = if ask == Ask::Run { self.ratio_target(&ratios) } else { 0.0 };
        let target = wanted.min(limit);
        let unchanged = target == self.governor.sigma();
        let sigma = if unchanged { target } else { self.governor.choose(target, &self.points) };
        let asked = ask != Ask::Run || ratios.feed < self.config.max_feed_ratio || ratios.rapid < 1.0;
        self.recovering = asked || (self.recovering && sigma < 1.0);
        self.counters.governed_samples += u64::from(sigma < 1.0 && !self.recovering);
        self.governor.take(sigma).min(self.points.covered_s.max(if self.cursor.is_resting() { f64::MAX } else { 0.0 }))
    }

    fn ratios_in_force(&self) -> Ratios {
        let operator = |value: f64| if self.outputs.override_permitted { value } else { 1.0 };
        let adaptive = if self.outputs.adaptive_permitted { self.ratio } else { 1.0 };
        Ratios {
            feed: operator(self.controls.feed_override.load()) * adaptive,
            rapid: operator(self.controls.rapid_override.load()).min(1.0),
        }
    }

    /// The rate at which the path speed is at most ratio × programmed feed at the end of the period.
    fn ratio_target(&mut self, ratios: &Ratios) -> f64 {
        let (from, from_mm) = (self.governor.sigma(), self.cursor.path_mm());
        let mut sigma = from;
        // The plan at the end of the period depends on the rate sought: three rounds settle it.
        for _ in 0..3 {
            let delta_s = self.governor.program_time_s(sigma);
            let ahead = self.cursor.ahead(delta_s);
            let at_end = within(ratios.feed * ahead.feed_mm_per_s, ahead.speed_mm_per_s);
            let mean = if delta_s > 0.0 { (ahead.path_mm - from_mm) / delta_s } else { ahead.speed_mm_per_s };
            let of_period = 2.0 * within(ratios.feed * ahead.most_feed_mm_per_s, mean) - from;
            let next = if ahead.rapid { ratios.rapid } else { at_end.min(of_period).clamp(0.0, 1.0) };
            if next == sigma {
                break;
            }
            sigma = next;
        }
        sigma
    }

    /// Takes the ratios that are due.
    fn take_ratio(&mut self) {
        loop {
            let Some(next) = self.next_ratio.take().or_else(|| self.ratios.pop().ok()) else { return };
            if next.tick > self.tick {
                self.next_ratio = Some(next);
                return;
            }
            self.counters.late_ratios += u64::from(next.tick < self.tick);
            self.ratio = next.ratio;
        }
    }

    fn input(&self, ask: Ask, reached: Reached) -> Input {
        match (&self.phase, ask) {
            (Phase::Ramping(_), _) => Input::Trip,
            (Phase::Faulted, _) => Input::Stopped,
            (_, Ask::Hold) => Input::Hold,
            (_, Ask::Starve) => Input::Starve,
            _ if reached == Reached::Rest && self.cursor.is_last() => Input::Rest,
            _ => Input::Run,
        }
    }

    /// Goes into the fault reaction: the first cause counts.
    fn fail(&mut self, kind: FaultKind) {
        if self.fault.is_some() {
            return;
        }
        self.fault = Some(Fault { kind, tick: self.tick, line: self.cursor.segment().line });
        self.phase = Phase::Ramping(Ramp::new(&self.config, self.guard.position(), self.guard.velocity()));
    }

    fn exchange(&mut self, axes: &AxisVector) {
        let joints = self.kinematics.as_ref().map_or(*axes, |k| k.to_joints(axes));
        let rate = 1.0 / self.config.period_s;
        let velocity =
            if self.setpoint.enable == 0 { AxisVector::ZERO } else { (joints - self.setpoint.position) * rate };
        self.setpoint.acceleration = (velocity - self.setpoint.velocity) * rate;
        self.setpoint.velocity = velocity;
        self.setpoint.position = joints;
        self.setpoint.tick = self.tick;
        self.setpoint.enable = u32::from(!matches!(self.phase, Phase::Faulted));
        self.setpoint.outputs = self.outputs.bits;
        self.setpoint.spindle_rad_per_s = self.outputs.spindle_rad_per_s;
        let last = Numbers::of(&self.feedback);
        let failed = self.driver.exchange(&self.setpoint, &mut self.feedback).is_err();
        let moving = matches!(self.state, MachineState::Running | MachineState::Holding | MachineState::Starved);
        let unreadable = last.replace_wrong_ones(&mut self.feedback, self.joints);
        let fault = failed.then_some(FaultKind::Driver).or(unreadable);
        if let Some(kind) = fault.or_else(|| answer::reported(&self.feedback, self.joints, moving)) {
            self.fail(kind);
        }
    }

    fn drives(&self) -> Input {
        let on = self.feedback.state[..self.joints].iter().all(|s| *s == JointState::Enabled);
        if on { Input::DrivesOn } else { Input::DrivesOff }
    }

    fn publish(&mut self, command: &AxisVector, feed_mm_per_s: f64) {
        let to_axes = |v: &AxisVector| self.kinematics.as_ref().map_or(*v, |k| k.to_axes(v));
        let sample = Sample {
            tick: self.tick,
            block: self.cursor.segment().block,
            line: self.cursor.segment().line,
            state: self.state,
            command: *command,
            feedback: to_axes(&self.feedback.position),
            speed: self.feedback.speed,
            current_a: self.feedback.current_a,
            feed_mm_per_s,
            programmed_feed_mm_per_s: self.cursor.segment().feed_mm_per_s,
            sigma: self.governor.sigma(),
            ratio: self.ratio * self.controls.feed_override.load(),
            spindle_rad_per_s: self.feedback.spindle_rad_per_s,
        };
        self.counters.samples += 1;
        if self.samples.push(sample).is_err() {
            self.status.lost_samples.fetch_add(1, Relaxed);
        }
    }

    fn report(&self) {
        let status = &self.status;
        status.tick.store(self.tick, Relaxed);
        status.program_time_s.store(self.cursor.program_time_s());
        status.feed_mm_per_s.store(self.governor.sigma() * self.cursor.path_speed_mm_per_s());
        status.line.store(self.cursor.segment().line, Relaxed);
        status.state.store(self.state as u32, Relaxed);
        status.inputs.store(self.feedback.inputs, Relaxed);
        status.idle.store(self.cursor.is_resting() && self.cursor.is_last(), Relaxed);
    }
}

/// The rate at which a planned speed is at most `allowed`; 1 where it is anyway, to the rounding of a long path.
fn within(allowed: f64, planned_mm_per_s: f64) -> f64 {
    if planned_mm_per_s * (1.0 - FEED_TOLERANCE) > allowed { allowed / planned_mm_per_s } else { 1.0 }
}

/// Relative tolerance on the feed: differences of path coordinates of 1e6 mm have this rounding.
const FEED_TOLERANCE: f64 = 1e-7;

/// Share of the declared stop deceleration that the starvation stop counts on.
const STOP_SHARE: f64 = 0.95;
