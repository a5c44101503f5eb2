//! The host's part of the contract: what the fine loop sends, and what it waits for.

use tandem_sdk::{
    Arm, Attached, AxisVector, Driver, Feedback, JointState, MAX_DELAY_PERIODS, PluginError,
    Setpoint,
};

use super::pace::Pace;
use super::watch::{STANDS_MM, Watch};
use super::{Failed, JOINTS, context};
use crate::heap;
use crate::machine::FINE_PERIOD_S;
use crate::report::Report;
use crate::timing::Timing;

/// Fine periods of the way out and back.
const WAY_PERIODS: u64 = 800;

/// Silent fine periods: more than any drive waits for its host.
const SILENT_PERIODS: u64 = 200;

/// Edge that is armed on the first half of the way.
const ARMED: Arm = Arm { input: 0, edge: 1 };

/// A driver, and what its host knows of it.
pub struct Host<'a> {
    driver: &'a mut dyn Driver,
    report: &'a mut Report,
    timing: &'a mut Timing,
    setpoint: Setpoint,
    feedback: Feedback,
    watch: Watch,
    /// Bit per joint that has been enabled since it was last told to be.
    held: u32,
    /// Where the driver was left, where it has been stopped before.
    left: Option<AxisVector>,
    has_faulted: bool,
    bits: Vec<u64>,
    heap_uses: u64,
    /// None where nothing moves: a period then takes as long as its exchange.
    pace: Option<Pace>,
}

fn failed(method: &str) -> impl FnOnce(PluginError) -> Failed {
    move |error| (method.to_string(), error)
}

impl<'a> Host<'a> {
    pub fn new(driver: &'a mut dyn Driver, report: &'a mut Report, timing: &'a mut Timing) -> Self {
        Self {
            driver,
            report,
            timing,
            setpoint: Setpoint::default(),
            feedback: Feedback::default(),
            watch: Watch::default(),
            held: 0,
            left: None,
            has_faulted: false,
            bits: Vec::new(),
            heap_uses: 0,
            pace: None,
        }
    }

    /// From here on a fine period takes as long as it says.
    pub fn keep_to_the_clock(&mut self, pace: Pace) {
        self.pace = Some(pace);
    }

    /// The bits of all positions, and how often the heap was used.
    pub fn leave(self) -> (Vec<u64>, u64) {
        if !self.has_faulted {
            self.report.skip(
                "reset of faults",
                "no drive went into a fault, not by 200 silent periods either",
            );
        }
        (self.bits, self.heap_uses)
    }

    pub fn open(&mut self) -> Result<(), Failed> {
        self.driver
            .open(&context(self.pace.is_some()))
            .map_err(failed("open"))
    }

    /// Brings the bus up, and judges what the driver says of its joints.
    pub fn start(&mut self) -> Result<(), Failed> {
        let attached = self.driver.start().map_err(failed("start"))?;
        self.judge_attached(&attached);
        self.setpoint = Setpoint {
            position: attached.position,
            ..Setpoint::default()
        };
        self.feedback = Feedback {
            position: attached.position,
            state: attached.state,
            ..Feedback::default()
        };
        self.watch = Watch::new(&attached);
        Ok(())
    }

    fn judge_attached(&mut self, attached: &Attached) {
        const CHECK: &str = "where the joints stand";
        self.report.judged(CHECK);
        for joint in 0..JOINTS {
            let (position, state) = (attached.position[joint], attached.state[joint]);
            let mut find = |words: String| {
                self.report
                    .find(CHECK, format!("start: joint {joint}: {words}"));
            };
            if !position.is_finite() {
                find(format!("its position is {position}"));
            }
            if !state.is_known() {
                find(format!("its state is {}, which stands for none", state.0));
            }
            if [
                JointState::Enabling,
                JointState::Enabled,
                JointState::Homing,
            ]
            .contains(&state)
            {
                find(format!("it is {state:?} before it was told to be"));
            }
            if attached.delay_periods[joint] > MAX_DELAY_PERIODS {
                find(format!(
                    "its feedback is {} periods behind; {MAX_DELAY_PERIODS} is the most",
                    attached.delay_periods[joint]
                ));
            }
            // What counts from power-on is known no better after a second start.
            let moved = self
                .left
                .filter(|_| attached.known >> joint & 1 == 1)
                .map(|left| (left[joint] - position).abs());
            if let Some(moved) = moved.filter(|moved| *moved > STANDS_MM) {
                find(format!(
                    "it was left {moved} from where it says that it stands"
                ));
            }
        }
    }

    /// One fine period.
    fn exchange(&mut self) -> Result<(), Failed> {
        self.setpoint.tick += 1;
        self.exchange_again()
    }

    /// One fine period without a new tick.
    fn exchange_again(&mut self) -> Result<(), Failed> {
        if let Some(pace) = &mut self.pace {
            pace.wait();
        }
        let before = heap::uses();
        let (driver, setpoint, feedback) = (&mut *self.driver, &self.setpoint, &mut self.feedback);
        let answer = self.timing.of(|| driver.exchange(setpoint, feedback));
        self.heap_uses += heap::uses() - before;
        let period = self.setpoint.tick;
        answer.map_err(failed(&format!("exchange, period {period}")))?;
        self.watch.look(&self.setpoint, &self.feedback, self.report);
        self.bits.extend(
            self.feedback.position.0[..JOINTS]
                .iter()
                .map(|v| v.to_bits()),
        );
        self.setpoint.reset = 0;
        Ok(())
    }

    /// Nothing is enabled, each joint is told to be where it stands.
    pub fn wait(&mut self, periods: u64) -> Result<(), Failed> {
        const CHECK: &str = "nothing is enabled unasked";
        self.report.judged(CHECK);
        for _ in 0..periods {
            self.follow_feedback();
            self.exchange()?;
            let on = [JointState::Enabling, JointState::Enabled];
            if let Some(joint) = (0..JOINTS).find(|joint| on.contains(&self.feedback.state[*joint]))
            {
                self.report.find(
                    CHECK,
                    format!("period {}: joint {joint} is", self.setpoint.tick),
                );
            }
        }
        Ok(())
    }

    fn follow_feedback(&mut self) {
        self.setpoint.position = self.feedback.position;
        (self.setpoint.velocity, self.setpoint.acceleration) = (AxisVector::ZERO, AxisVector::ZERO);
    }

    /// Joints are told to be where they stand until they are enabled, and to stay there from then on.
    pub fn enable(&mut self) -> Result<(), Failed> {
        const CHECK: &str = "enabling";
        self.report.judged(CHECK);
        if self.is_in_trouble() {
            self.recover()?;
        }
        self.follow_feedback();
        (self.setpoint.enable, self.held) = (1, 0);
        let most = periods(self.driver.describe().enable_s);
        for _ in 0..most {
            self.exchange()?;
            if self.is_in_trouble() {
                return self.recover().and_then(|()| self.enable());
            }
            self.hold_what_is_enabled();
            if self.held.count_ones() as usize == JOINTS {
                return Ok(());
            }
        }
        let joint = (0..JOINTS)
            .find(|joint| self.held >> joint & 1 == 0)
            .unwrap_or_default();
        let state = self.feedback.state[joint];
        self.report.find(
            CHECK,
            format!("joint {joint} is {state:?} at the end of the driver's own enable_s"),
        );
        Err((
            "exchange".to_string(),
            PluginError::new(format!("joint {joint} is never enabled")),
        ))
    }

    fn hold_what_is_enabled(&mut self) {
        for joint in 0..JOINTS {
            if self.feedback.state[joint] == JointState::Enabled {
                self.held |= 1 << joint;
            } else {
                self.held &= !(1 << joint);
                self.setpoint.position[joint] = self.feedback.position[joint];
            }
        }
        self.judge_place("no jump when enabled");
    }

    /// Whether the joints that are enabled are where they are told to be, at rest.
    fn judge_place(&mut self, check: &'static str) {
        self.report.judged(check);
        for joint in (0..JOINTS)
            .filter(|joint| self.held >> joint & 1 == 1 && self.feedback.age_periods[*joint] == 0)
        {
            let away = (self.feedback.position[joint] - self.setpoint.position[joint]).abs();
            // What is no number is found by another check.
            if away > STANDS_MM {
                let period = self.setpoint.tick;
                self.report.find(
                    check,
                    format!("period {period}: joint {joint} is {away} from where it stood"),
                );
            }
        }
    }

    /// Joints that are enabled hold.
    pub fn hold(&mut self, periods: u64) -> Result<(), Failed> {
        const CHECK: &str = "feedback";
        self.report.judged(CHECK);
        (self.setpoint.velocity, self.setpoint.acceleration) = (AxisVector::ZERO, AxisVector::ZERO);
        for period in 0..periods {
            self.exchange()?;
            if self.is_in_trouble() {
                self.recover()?;
                return self.enable();
            }
            self.judge_holding(CHECK);
            // A drive that comes to rest may swing for a while.
            if period >= SETTLING_PERIODS {
                self.judge_place("no jump when enabled");
            }
        }
        Ok(())
    }

    fn judge_holding(&mut self, check: &'static str) {
        let states = &self.feedback.state[..JOINTS];
        if states.iter().any(|state| *state != JointState::Enabled) {
            let words = format!(
                "period {}: the drives were enabled and do not hold: {states:?}",
                self.setpoint.tick
            );
            self.report.find(check, words);
        }
    }

    /// A smooth way out and back, with an edge armed on the first half of it.
    pub fn go(&mut self) -> Result<(), Failed> {
        let start = self.setpoint.position;
        for period in 0..WAY_PERIODS {
            let phase = (period + 1) as f64 / WAY_PERIODS as f64;
            let way = 5.0 * (std::f64::consts::PI * phase).sin().powi(2);
            self.aim(start + AxisVector::from_slice(&[way, -way, way / 2.0]));
            self.setpoint.arm = if period < WAY_PERIODS / 2 {
                ARMED
            } else {
                Arm::default()
            };
            self.exchange()?;
            if self.is_in_trouble() {
                self.recover()?;
                return self.enable();
            }
            self.judge_holding("feedback");
        }
        self.aim(start);
        Ok(())
    }

    fn aim(&mut self, position: AxisVector) {
        let velocity = (position - self.setpoint.position) * (1.0 / FINE_PERIOD_S);
        self.setpoint.acceleration = (velocity - self.setpoint.velocity) * (1.0 / FINE_PERIOD_S);
        (self.setpoint.position, self.setpoint.velocity) = (position, velocity);
    }

    /// The drives come to rest by their own means; what they say of it on the way is theirs.
    pub fn quick_stop(&mut self) -> Result<(), Failed> {
        let before = heap::uses();
        self.driver.quick_stop();
        self.heap_uses += heap::uses() - before;
        (0..100).try_for_each(|_| self.exchange())
    }

    /// Exchanges go on until every joint has let go.
    pub fn disable(&mut self) -> Result<(), Failed> {
        const CHECK: &str = "letting go";
        self.report.judged(CHECK);
        (self.setpoint.enable, self.held) = (0, 0);
        let most = periods(self.driver.describe().disable_s);
        for _ in 0..most {
            self.exchange()?;
            let has_let_go = |state: &JointState| {
                [JointState::Disabled, JointState::Fault, JointState::Lost].contains(state)
            };
            if self.feedback.state[..JOINTS].iter().all(has_let_go) {
                return self.wait(20);
            }
        }
        let states = &self.feedback.state[..JOINTS];
        self.report.find(
            CHECK,
            format!("at the end of the driver's own disable_s the joints are {states:?}"),
        );
        Ok(())
    }

    /// The tick stands still, as where the host hangs: drives that watch it go into a fault of their own.
    pub fn fall_silent(&mut self) -> Result<(), Failed> {
        (0..SILENT_PERIODS).try_for_each(|_| self.exchange_again())?;
        if self.is_in_trouble() {
            self.recover()?;
            return self.enable();
        }
        Ok(())
    }

    fn is_in_trouble(&self) -> bool {
        let states = &self.feedback.state[..JOINTS];
        states.contains(&JointState::Fault) || states.contains(&JointState::Lost)
    }

    /// A fault stays until it is reset, and no longer; a joint that is lost is attached again.
    fn recover(&mut self) -> Result<(), Failed> {
        const CHECK: &str = "reset of faults";
        if self.is_lost() {
            return self.attach_again();
        }
        self.has_faulted = true;
        self.report.judged(CHECK);
        let joint = (0..JOINTS)
            .find(|joint| self.feedback.state[*joint] == JointState::Fault)
            .unwrap_or_default();
        for enable in [1, 0, 1, 0] {
            self.setpoint.enable = enable;
            for _ in 0..20 {
                self.follow_feedback();
                self.exchange()?;
                if !self.is_in_trouble() {
                    let (period, state) = (self.setpoint.tick, self.feedback.state[joint]);
                    let words = format!(
                        "period {period}: joint {joint} was in fault and is {state:?} without a reset"
                    );
                    self.report.find(CHECK, words);
                    return Ok(());
                }
            }
        }
        self.setpoint.reset = 1;
        for _ in 0..periods(self.driver.describe().enable_s) {
            self.follow_feedback();
            self.exchange()?;
            if self.is_lost() {
                return self.attach_again();
            }
            if !self.is_in_trouble() {
                return Ok(());
            }
        }
        let state = self.feedback.state[joint];
        self.report.find(
            CHECK,
            format!("joint {joint} is {state:?} for the whole of enable_s behind a reset"),
        );
        Err((
            "exchange".to_string(),
            PluginError::new(format!("joint {joint} cannot be reset")),
        ))
    }

    fn is_lost(&self) -> bool {
        self.feedback.state[..JOINTS].contains(&JointState::Lost)
    }

    /// Nothing is known of a joint that was lost, where it stands neither.
    fn attach_again(&mut self) -> Result<(), Failed> {
        self.stop()?;
        self.left = None;
        self.start()?;
        self.wait(10)
    }

    pub fn stop(&mut self) -> Result<(), Failed> {
        self.left = Some(self.feedback.position);
        self.driver.stop().map_err(failed("stop"))
    }
}

/// Fine periods in which a drive comes to rest where it is told to.
const SETTLING_PERIODS: u64 = 90;

/// Whole fine periods of a time; half a minute where it is no time.
fn periods(seconds: f64) -> u64 {
    let seconds = if seconds.is_finite() {
        seconds.clamp(0.0, 30.0)
    } else {
        30.0
    };
    (seconds / FINE_PERIOD_S).ceil() as u64 + 1
}
