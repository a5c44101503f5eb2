//! The driver contract over the simulated joints, spindle, switches and bus.

use std::time::{Duration, Instant};

use tandem_sdk::{
    Attached, AxisVector, Driver, DriverContext, DriverDescription, Feedback, Latch, MAX_AXES,
    PluginError, Setpoint, Words,
};

use crate::bus_clock::BusClock;
use crate::encoder::{Encoders, PowerOn, attached};
use crate::faults::DriveFaults;
use crate::hard_stop::HardStops;
use crate::joint::Motion;
use crate::mechanics::Mechanics;
use crate::options::Options;
use crate::power::Power;
use crate::spindle::Spindle;
use crate::switches::Switches;
use crate::times::{MARGIN_S, longest, periods};
use crate::watchdog::Watchdog;
use crate::wire::{Frame, Wire};

/// Fault code of every joint whose drives stopped by themselves because the host fell silent.
pub const WATCHDOG_FAULT: u32 = 1;

/// Where the driver is in its life.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Life {
    Closed,
    Opened,
    Running,
    Stopped,
}

/// Simulated drives behind the driver contract.
///
/// Joints stand where their options or [`DriverContext::start_position`] have them at power-on, which is the first start after an
/// opening; a driver that is started again finds them where they were left. While `enable` is 0 they do not follow: they run out
/// at the quick-stop deceleration and rest where they come to rest. After [`Driver::quick_stop`] they ramp to rest, are then
/// reported disabled, and follow again after an exchange with `enable = 0` or `reset = 1`. The spindle always follows.
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
    mechanics: Mechanics,
    powers: [Power; MAX_AXES],
    encoders: Encoders,
    faults: DriveFaults,
    stops: HardStops,
    wire: Wire,
    bus_clock: Option<BusClock>,
    bus_start: Duration,
    started: Instant,
    /// The setpoint that the drives heard last.
    heard: Setpoint,
    /// 1 where a reset is still to be sent.
    unheard_reset: u32,
    /// Exchanges since the start.
    exchanges: u64,
    /// What was last heard of each joint.
    told: [Motion; MAX_AXES],
    /// Fine periods since then.
    silent_periods: [u32; MAX_AXES],
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
            mechanics: Mechanics::new(&options, &AxisVector::ZERO, 0, period_s),
            powers: [Power::new(0, 0); MAX_AXES],
            encoders: Encoders::new(&options),
            faults: DriveFaults::new(&options.faults),
            stops: HardStops::new(&options.hard_stops),
            wire: Wire::new(&options, &Feedback::default(), period_s),
            bus_clock: None,
            bus_start: Duration::ZERO,
            started: Instant::now(),
            heard: Setpoint::default(),
            unheard_reset: 0,
            exchanges: 0,
            told: [Motion::default(); MAX_AXES],
            silent_periods: [0; MAX_AXES],
            spindle: Spindle::new(options.spindle_time_constant_s, period_s),
            watchdog: Watchdog::new(options.watchdog_periods),
            switches: Switches::new(&options),
            shift: AxisVector::ZERO,
            options,
            life: Life::Closed,
            joint_count: 0,
            period_s,
            quick_stopping: false,
        }
    }

    /// Lets a period go by on the drives' own clock in which no exchange comes at all, as when the host's process has ended. The
    /// answer is how the joints are after it, which nobody is told. For tests; no run calls it.
    pub fn pass(&mut self) -> Feedback {
        let mut feedback = Feedback::default();
        if self.life == Life::Running {
            self.mechanics.begin();
            self.watchdog.pass();
            self.miss();
            self.report(&mut feedback);
        }
        feedback
    }

    fn check_machine(&self, context: &DriverContext) -> Result<(), PluginError> {
        let count = context.joint_count as usize;
        if !(1..=MAX_AXES).contains(&count) {
            return Err(PluginError::new(format!(
                "sim: a machine has 1 to {MAX_AXES} joints, not {count}"
            )));
        }
        if !(context.fine_period_s.is_finite() && context.fine_period_s > 0.0) {
            return Err(PluginError::new(format!(
                "sim: no fine period: {} s",
                context.fine_period_s
            )));
        }
        if !context.start_position.is_finite() {
            return Err(PluginError::fixed(
                "sim: the start position is not a finite number",
            ));
        }
        self.options.check_joint_numbers(count)
    }

    /// The drives get their power: nobody has told them anything yet.
    fn power_on(&mut self, start: &AxisVector) {
        let (options, period_s) = (&self.options, self.period_s);
        let PowerOn { reading, shift } = PowerOn::new(options, start);
        let of_joint =
            |list: &[f64], joint: usize| list.get(joint).or(list.last()).copied().unwrap_or(0.0);
        let power = |joint: usize| {
            let wake_periods = periods(of_joint(&options.enable_s, joint), period_s);
            Power::new(
                wake_periods,
                periods(of_joint(&options.brake_s, joint), period_s),
            )
        };
        self.powers = std::array::from_fn(power);
        self.mechanics = Mechanics::new(options, &reading, self.joint_count, period_s);
        self.encoders = Encoders::new(options);
        self.shift = shift;
    }

    /// The bus is up: everything between host and drives begins anew.
    fn begin(&mut self) {
        let (options, period_s) = (&self.options, self.period_s);
        self.spindle = Spindle::new(options.spindle_time_constant_s, period_s);
        self.watchdog = Watchdog::new(options.watchdog_periods);
        self.bus_clock = options
            .bus_clock
            .as_ref()
            .map(|clock| BusClock::new(clock, period_s, options.seed));
        self.heard = Setpoint::default();
        self.unheard_reset = 0;
        self.exchanges = 0;
        self.quick_stopping = false;
        self.faults.start();
        self.faults.step(0, 0, &mut self.powers);
        self.mechanics.begin();
        let [_, at] = self.real_way();
        self.switches.start(&at);
        self.started = Instant::now();
    }

    /// The drives hear the setpoint, unless its frame is lost. A reset that is lost goes with the next frame: the host sends it
    /// once.
    fn hand_over(&mut self, setpoint: &Setpoint, frame: Frame) {
        let reset = setpoint.reset | self.unheard_reset;
        if frame == Frame::Lost {
            self.unheard_reset = reset;
        } else {
            self.heard = Setpoint { reset, ..*setpoint };
            self.unheard_reset = 0;
        }
    }

    /// Lives through the periods up to and with this exchange. Fine loop.
    fn live(&mut self) {
        if self.heard.reset != 0 {
            self.watchdog.reset();
            self.powers.iter_mut().for_each(Power::reset);
        }
        let heard = self.watchdog.hear(self.heard.tick);
        (0..heard.missed).for_each(|_| self.miss());
        if heard.fresh || self.heard.enable == 0 {
            self.watchdog.fed();
            self.obey();
        } else {
            self.miss();
        }
    }

    /// One period with a setpoint.
    fn obey(&mut self) {
        if self.heard.enable == 0 || self.heard.reset != 0 {
            self.quick_stopping = false;
        }
        self.mechanics.set_velocity(&self.heard.velocity);
        self.advance(self.heard.position);
    }

    /// One period without a new setpoint: on at the last velocity, until the watchdog ends that.
    fn miss(&mut self) {
        if self.mechanics.is_following() {
            self.watchdog.silence();
        }
        if self.watchdog.is_tripped() {
            self.powers
                .iter_mut()
                .for_each(|power| power.fail(WATCHDOG_FAULT));
        }
        let to = self.mechanics.coast();
        self.advance(to);
    }

    /// Moves all joints over one period.
    fn advance(&mut self, mut to: AxisVector) {
        let follow = self.heard.enable != 0 && !self.quick_stopping;
        let powers = &mut self.powers[..self.joint_count];
        for power in powers.iter_mut() {
            power.command(follow);
        }
        self.stops
            .press(&mut to, &self.shift, self.heard.limited, powers);
        self.mechanics.step(powers, &to, self.spindle.speed);
        for (joint, power) in powers.iter_mut().enumerate() {
            power.settle(self.mechanics.is_at_rest(joint));
        }
    }

    /// Writes every field of the joints and every input; latches of the period before are over.
    fn report(&mut self, feedback: &mut Feedback) {
        self.tell(feedback);
        for joint in 0..self.joint_count {
            feedback.current_a[joint] = self.mechanics.current_a(joint);
        }
        feedback.analog = self.mechanics.analog();
        self.switch(feedback);
        feedback.spindle_rad_per_s = self.spindle.speed;
        feedback.spindle_angle_rad = self.spindle.angle;
        feedback.spindle_at_speed = u32::from(self.spindle.is_at_speed());
    }

    /// What is heard of each joint; of one that is lost, what was heard last.
    fn tell(&mut self, feedback: &mut Feedback) {
        for (joint, power) in self.powers[..self.joint_count].iter().enumerate() {
            if power.is_lost() {
                self.silent_periods[joint] = self.silent_periods[joint].saturating_add(1);
            } else {
                let seen = self.mechanics.seen(joint);
                self.told[joint] = Motion {
                    position: self.encoders.read(seen.position),
                    speed: seen.speed,
                };
                self.silent_periods[joint] = 0;
            }
            feedback.position[joint] = self.told[joint].position;
            feedback.speed[joint] = self.told[joint].speed;
            feedback.state[joint] = power.state();
            feedback.fault_code[joint] = power.code();
            feedback.age_periods[joint] = self.silent_periods[joint];
        }
    }

    /// The inputs after a period, and the positions caught in it, as the drives see them.
    fn switch(&mut self, feedback: &mut Feedback) {
        feedback.inputs = 0;
        feedback
            .latches
            .iter_mut()
            .filter(|latch| latch.edge != 0)
            .for_each(|latch| *latch = Latch::default());
        if self.switches.are_none() {
            return;
        }
        let [from, to] = self.real_way();
        let latches = &mut feedback.latches;
        feedback.inputs = self
            .switches
            .step([&from, &to], self.heard.arm, self.period_s, latches);
        for latch in latches.iter_mut().filter(|latch| latch.edge != 0) {
            for joint in (0..self.joint_count).filter(|joint| latch.joints >> joint & 1 == 1) {
                latch.position[joint] = self
                    .encoders
                    .read(latch.position[joint] - self.shift[joint]);
            }
        }
    }

    /// Where the joints really were before this exchange, and where they are.
    fn real_way(&self) -> [AxisVector; 2] {
        self.mechanics.way().map(|joints| joints + self.shift)
    }

    /// The frame gets through or not; where none has for too long, every joint is lost.
    fn deliver(&mut self, frame: Frame, feedback: &mut Feedback) {
        if !self.wire.is_ideal() && self.wire.deliver(frame, feedback) {
            self.powers.iter_mut().for_each(Power::lose);
            feedback.state[..self.joint_count].fill(tandem_sdk::JointState::Lost);
        }
    }

    fn refuse_unless(&self, wanted: &[Life], call: [&'static str; 4]) -> Result<(), PluginError> {
        if wanted.contains(&self.life) {
            Ok(())
        } else {
            Err(PluginError::fixed(call[self.life as usize]))
        }
    }
}

impl Driver for SimulatedDrives {
    fn describe(&self) -> DriverDescription {
        let gives_phase = u32::from(self.options.bus_clock.is_some());
        let ideal = DriverDescription {
            gives_phase,
            ..DriverDescription::simulated()
        };
        let (enable_s, brake_s) = (&self.options.enable_s, &self.options.brake_s);
        if enable_s.is_empty() && brake_s.is_empty() {
            return ideal;
        }
        let closing_s = longest(brake_s);
        DriverDescription {
            enable_s: longest(enable_s) + closing_s + MARGIN_S,
            disable_s: closing_s + MARGIN_S,
            ..ideal
        }
    }

    fn check(&self, context: &DriverContext) -> Result<(), PluginError> {
        self.check_machine(context)
    }

    fn open(&mut self, context: &DriverContext) -> Result<(), PluginError> {
        const REFUSED: [&str; 4] = [
            "",
            "sim: open is refused: the driver is already opened",
            "sim: open is refused: the driver is running",
            "",
        ];
        self.refuse_unless(&[Life::Closed, Life::Stopped], REFUSED)?;
        self.check_machine(context)?;
        self.joint_count = context.joint_count as usize;
        let bus_start_s = if context.real_time != 0 {
            self.options.bus_start_s
        } else {
            0.0
        };
        (self.period_s, self.bus_start) =
            (context.fine_period_s, Duration::from_secs_f64(bus_start_s));
        self.stops.open(context);
        self.power_on(&context.start_position);
        self.life = Life::Opened;
        Ok(())
    }

    fn start(&mut self) -> Result<Attached, PluginError> {
        const REFUSED: [&str; 4] = [
            "sim: start is refused: the driver is closed",
            "",
            "sim: start is refused: the driver is already running",
            "",
        ];
        self.refuse_unless(&[Life::Opened, Life::Stopped], REFUSED)?;
        std::thread::sleep(self.bus_start);
        self.begin();
        let mut first = Feedback::default();
        self.tell(&mut first);
        self.switch(&mut first);
        self.wire = Wire::new(&self.options, &first, self.period_s);
        self.life = Life::Running;
        let stands = attached(self.options.encoder, first.position);
        let delay_periods = [self.options.delay_periods; MAX_AXES];
        Ok(Attached {
            state: first.state,
            fault_code: first.fault_code,
            delay_periods,
            ..stands
        })
    }

    fn exchange(
        &mut self,
        setpoint: &Setpoint,
        feedback: &mut Feedback,
    ) -> Result<(), PluginError> {
        const REFUSED: [&str; 4] = [
            "sim: exchange is refused: the driver is closed",
            "sim: exchange is refused: the driver is opened but not started",
            "",
            "sim: exchange is refused: the driver is stopped",
        ];
        self.refuse_unless(&[Life::Running], REFUSED)?;
        let finite = setpoint.position.is_finite() && setpoint.velocity.is_finite();
        if !(finite && setpoint.spindle_rad_per_s.is_finite()) {
            return Err(PluginError::fixed(
                "sim: exchange is refused: the setpoint is not a finite number",
            ));
        }
        let frame = self.wire.send(setpoint.tick);
        self.hand_over(setpoint, frame);
        self.exchanges += 1;
        self.mechanics.begin();
        self.live();
        self.faults
            .step(setpoint.tick, self.exchanges, &mut self.powers);
        self.spindle.follow(self.heard.spindle_rad_per_s);
        self.report(feedback);
        self.heard.reset = 0;
        self.deliver(frame, feedback);
        if let Some(clock) = &mut self.bus_clock {
            let now_ns = i64::try_from(self.started.elapsed().as_nanos()).unwrap_or(i64::MAX);
            (feedback.has_phase, feedback.phase_ns) = (1, clock.phase_ns(now_ns));
        }
        Ok(())
    }

    fn quick_stop(&mut self) {
        self.quick_stopping = self.life == Life::Running;
    }

    fn stop(&mut self) -> Result<(), PluginError> {
        if self.life != Life::Closed {
            self.life = Life::Stopped;
        }
        self.powers.iter_mut().for_each(Power::cut);
        self.quick_stopping = false;
        Ok(())
    }

    fn explain(&self, _joint: u32, code: u32) -> Words {
        self.faults.explain(code)
    }
}
