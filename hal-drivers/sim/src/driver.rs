//! The driver contract over the simulated joints, spindle and switches.

use std::f64::consts::TAU;

use tandem_sdk::{
    Attached, AxisVector, Driver, DriverContext, DriverDescription, Feedback, JointState, Latch, MAX_ANALOG, MAX_AXES,
    PluginError, Setpoint,
};

use crate::joint::{CURRENT_A_PER_MM_PER_S2, Motion, Servo};
use crate::options::{Model, Options, Switch};
use crate::servo::ServoJoints;
use crate::spindle::Spindle;
use crate::switches::Switches;
use crate::watchdog::Watchdog;

/// Fault code of every joint whose drives stopped by themselves because the host fell silent.
pub const WATCHDOG_FAULT: u32 = 1;

/// Where the driver is in its life.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Life {
    Closed,
    Opened,
    Running,
}

/// Simulated drives behind the driver contract.
///
/// Joints stand at [`DriverContext::start_position`] when started. While `enable` is 0 they do not follow: they run out at
/// the quick-stop deceleration and rest where they come to rest. After [`Driver::quick_stop`] they ramp to rest, are
/// then reported disabled, and follow again after an exchange with `enable = 0` or `reset = 1`. The spindle follows its
/// command in every state.
///
/// Where no new setpoint comes, joints go on at the velocity of the last one; after more than
/// [`Options::watchdog_periods`] such periods in a row they ramp to rest at the quick-stop deceleration and report
/// [`WATCHDOG_FAULT`] until an exchange with `reset = 1`. Drives that are not enabled need no heartbeat.
#[derive(Debug)]
pub struct SimulatedDrives {
    options: Options,
    life: Life,
    joint_count: usize,
    period_s: f64,
    start_position: AxisVector,
    servo: Servo,
    /// The joints of the model `servo`, once started.
    motors: Option<ServoJoints>,
    joints: [Motion; MAX_AXES],
    /// The setpoint that the joints followed last; none while they follow nothing.
    followed: Option<AxisVector>,
    /// The velocity commanded last: the joints go on at it while no setpoint comes.
    velocity: AxisVector,
    quick_stopping: bool,
    watchdog: Watchdog,
    spindle: Spindle,
    switches: Switches,
    /// Where the joints really stand when the drives say zero.
    shift: AxisVector,
}

impl SimulatedDrives {
    /// Drives with checked options, not yet opened.
    pub fn new(options: Options) -> Self {
        let period_s = 0.001; // replaced by `open`
        Self {
            servo: servo(&options, period_s),
            motors: None,
            spindle: Spindle::new(options.spindle_time_constant_s, period_s),
            watchdog: Watchdog::new(options.watchdog_periods),
            switches: Switches::new(&options.switches, options.latches, options.seed),
            shift: unknown_start(&options),
            options,
            life: Life::Closed,
            joint_count: 0,
            period_s,
            start_position: AxisVector::ZERO,
            joints: [Motion::default(); MAX_AXES],
            followed: None,
            velocity: AxisVector::ZERO,
            quick_stopping: false,
        }
    }

    /// Lets a period go by on the drives' own clock in which no exchange comes at all, as when the host's process has ended. The
    /// answer is how the joints are after it, which nobody is told. For tests; no run calls it.
    pub fn pass(&mut self) -> Feedback {
        let mut feedback = Feedback::default();
        if self.life == Life::Running {
            let before = self.joints;
            self.watchdog.pass();
            self.miss();
            self.report(&before, true, &mut feedback);
        }
        feedback
    }

    fn check_machine(&self, context: &DriverContext) -> Result<(), PluginError> {
        let count = context.joint_count as usize;
        if !(1..=MAX_AXES).contains(&count) {
            return Err(PluginError::new(format!("sim: a machine has 1 to {MAX_AXES} joints, not {count}")));
        }
        if !(context.fine_period_s.is_finite() && context.fine_period_s > 0.0) {
            return Err(PluginError::new(format!("sim: no fine period: {} s", context.fine_period_s)));
        }
        if !context.start_position.is_finite() {
            return Err(PluginError::fixed("sim: the start position is not a finite number"));
        }
        let last_joint = |switch: &Switch| switch.shape().map_or(0, |shape| shape.last_joint());
        match self.options.switches.iter().map(last_joint).find(|joint| *joint >= count) {
            Some(joint) => Err(PluginError::of_option(
                "switches",
                format!("joint = {joint}: the machine has joints 0 to {}", count - 1),
            )),
            None => Ok(()),
        }
    }

    /// Lives through the periods up to and with this exchange. Fine loop.
    fn live(&mut self, setpoint: &Setpoint) {
        if setpoint.reset != 0 {
            self.watchdog.reset();
        }
        let heard = self.watchdog.hear(setpoint.tick);
        (0..heard.missed).for_each(|_| self.miss());
        if heard.fresh || setpoint.enable == 0 {
            self.watchdog.fed();
            self.move_joints(setpoint);
        } else {
            self.miss();
        }
    }

    /// One period without a new setpoint: on at the last velocity, until the watchdog ends that.
    fn miss(&mut self) {
        let Some(last) = self.followed else { return self.brake() };
        self.watchdog.silence();
        if self.watchdog.is_tripped() {
            return self.brake();
        }
        let next = last + self.velocity * self.period_s;
        self.follow(&last, &next);
    }

    /// Moves all joints over one period. Fine loop.
    fn move_joints(&mut self, setpoint: &Setpoint) {
        if setpoint.enable == 0 || setpoint.reset != 0 {
            self.quick_stopping = false;
        }
        if setpoint.enable == 0 || self.quick_stopping || self.watchdog.is_tripped() {
            return self.brake();
        }
        // Drives that just begin to follow have no setpoint to interpolate from: for them it is a step.
        let from = self.followed.unwrap_or(setpoint.position);
        self.velocity = setpoint.velocity;
        self.follow(&from, &setpoint.position);
    }

    fn brake(&mut self) {
        self.followed = None;
        let deceleration = self.options.quick_stop_deceleration_mm_per_s2;
        self.joints[..self.joint_count].iter_mut().for_each(|joint| joint.brake(deceleration, self.period_s));
        if let Some(motors) = &mut self.motors {
            motors.hold(&self.joints[..self.joint_count]);
        }
    }

    fn follow(&mut self, from: &AxisVector, to: &AxisVector) {
        if let Some(motors) = &mut self.motors {
            motors.follow(to, &self.velocity, self.spindle.speed);
        }
        for (index, joint) in self.joints[..self.joint_count].iter_mut().enumerate() {
            match self.options.model {
                Model::SecondOrder => self.servo.follow(joint, from[index], to[index]),
                Model::Ideal | Model::Servo => {
                    let ideal = Motion { position: to[index], speed: self.velocity[index] };
                    *joint = self.motors.as_ref().map_or(ideal, |motors| motors.motion(index));
                }
            }
        }
        self.followed = Some(*to);
    }

    /// Writes every field of the joints and every input; latches of the period before are over.
    fn report(&mut self, before: &[Motion; MAX_AXES], enable: bool, feedback: &mut Feedback) {
        for (index, joint) in self.joints[..self.joint_count].iter().enumerate() {
            let seen = self.motors.as_ref().map_or(*joint, |motors| motors.measured(index));
            feedback.position[index] = seen.position;
            feedback.speed[index] = seen.speed;
            let change = || CURRENT_A_PER_MM_PER_S2 * (joint.speed - before[index].speed) / self.period_s;
            feedback.current_a[index] = match (self.options.model, &mut self.motors) {
                (Model::SecondOrder, _) => change(),
                (_, Some(motors)) => motors.current_a(index),
                _ => 0.0,
            };
            feedback.state[index] = self.state(enable, joint);
            feedback.fault_code[index] = if self.watchdog.is_tripped() { WATCHDOG_FAULT } else { 0 };
        }
        let truth = self.motors.as_ref().map(|motors| &motors.truth);
        feedback.analog = truth.map_or([0.0; MAX_ANALOG], |truth| [truth.cutting_torque_nm, truth.depth_mm, 0.0, 0.0]);
        self.switch(before, feedback);
        feedback.spindle_rad_per_s = self.spindle.speed;
        feedback.spindle_angle_rad = self.spindle.angle;
    }

    fn state(&self, enable: bool, joint: &Motion) -> JointState {
        if self.watchdog.is_tripped() {
            return JointState::Fault;
        }
        let at_rest_for_good = self.quick_stopping && joint.speed == 0.0;
        if enable && !at_rest_for_good { JointState::Enabled } else { JointState::Disabled }
    }

    /// The inputs after a period, and the positions caught in it, as the drives see them.
    fn switch(&mut self, before: &[Motion; MAX_AXES], feedback: &mut Feedback) {
        feedback.inputs = 0;
        feedback.latches.iter_mut().filter(|latch| latch.edge != 0).for_each(|latch| *latch = Latch::default());
        if self.switches.are_none() {
            return;
        }
        let (from, to) = (self.real(before), self.real(&self.joints));
        feedback.inputs = self.switches.step(&from, &to, &mut feedback.latches);
        for latch in feedback.latches.iter_mut().filter(|latch| latch.edge != 0) {
            latch.position = latch.position - self.shift;
        }
    }

    /// Where the joints really stand.
    fn real(&self, joints: &[Motion; MAX_AXES]) -> AxisVector {
        AxisVector(std::array::from_fn(|i| joints[i].position + self.shift[i]))
    }

    fn refuse_unless(&self, wanted: Life, refusals: [&'static str; 3]) -> Result<(), PluginError> {
        if self.life == wanted { Ok(()) } else { Err(PluginError::fixed(refusals[self.life as usize])) }
    }
}

/// How far each joint stands from where its drive says: a seeded part of the option.
fn unknown_start(options: &Options) -> AxisVector {
    let mut state = options.seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1;
    AxisVector(std::array::from_fn(|_| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let share = (state >> 11) as f64 / (1u64 << 52) as f64 - 1.0;
        share * options.unknown_start_mm
    }))
}

fn servo(options: &Options, period_s: f64) -> Servo {
    Servo::new(TAU * options.natural_frequency_hz, options.damping_ratio, period_s)
}

impl Driver for SimulatedDrives {
    fn describe(&self) -> DriverDescription {
        DriverDescription::simulated()
    }

    fn check(&self, context: &DriverContext) -> Result<(), PluginError> {
        self.check_machine(context)
    }

    fn open(&mut self, context: &DriverContext) -> Result<(), PluginError> {
        const REFUSED: [&str; 3] =
            ["", "sim: open is refused: the driver is already opened", "sim: open is refused: the driver is running"];
        self.refuse_unless(Life::Closed, REFUSED)?;
        self.check_machine(context)?;
        self.joint_count = context.joint_count as usize;
        self.period_s = context.fine_period_s;
        self.start_position = context.start_position;
        self.servo = servo(&self.options, self.period_s);
        self.life = Life::Opened;
        Ok(())
    }

    fn start(&mut self) -> Result<Attached, PluginError> {
        const REFUSED: [&str; 3] =
            ["sim: start is refused: the driver is closed", "", "sim: start is refused: the driver is already running"];
        self.refuse_unless(Life::Opened, REFUSED)?;
        self.joints = std::array::from_fn(|i| Motion { position: self.start_position[i], speed: 0.0 });
        self.motors = (self.options.model == Model::Servo)
            .then(|| ServoJoints::new(&self.options, &self.start_position, self.joint_count, self.period_s));
        self.spindle = Spindle::new(self.options.spindle_time_constant_s, self.period_s);
        let at = self.real(&self.joints);
        self.switches.start(&at);
        self.followed = None;
        self.velocity = AxisVector::ZERO;
        self.quick_stopping = false;
        self.watchdog = Watchdog::new(self.options.watchdog_periods);
        self.life = Life::Running;
        Ok(Attached::at(self.start_position))
    }

    fn exchange(&mut self, setpoint: &Setpoint, feedback: &mut Feedback) -> Result<(), PluginError> {
        const REFUSED: [&str; 3] = [
            "sim: exchange is refused: the driver is closed",
            "sim: exchange is refused: the driver is opened but not started",
            "",
        ];
        self.refuse_unless(Life::Running, REFUSED)?;
        let finite = setpoint.position.is_finite() && setpoint.velocity.is_finite();
        if !(finite && setpoint.spindle_rad_per_s.is_finite()) {
            return Err(PluginError::fixed("sim: exchange is refused: the setpoint is not a finite number"));
        }
        let before = self.joints;
        self.live(setpoint);
        self.spindle.follow(setpoint.spindle_rad_per_s);
        self.report(&before, setpoint.enable != 0, feedback);
        Ok(())
    }

    fn quick_stop(&mut self) {
        self.quick_stopping = self.life == Life::Running;
    }

    fn stop(&mut self) -> Result<(), PluginError> {
        self.life = Life::Closed;
        self.quick_stopping = false;
        Ok(())
    }
}
