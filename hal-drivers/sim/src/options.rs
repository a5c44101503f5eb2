//! The options of the simulated drives and what is refused.

use serde::{Deserialize, Serialize};
use tandem_sdk::{MAX_AXES, PluginError, PluginOptions};

use crate::bus_clock::BusClockOptions;
use crate::encoder::Encoder;
use crate::faults::DriveFault;
use crate::hard_stop::HardStop;
use crate::servo::{CuttingOptions, ServoOptions};
use crate::shape::{Bore, Shape};
use crate::wire::{self, Frames};

/// How a joint follows its setpoint.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Model {
    /// The feedback is the setpoint of the same exchange; no motor current.
    #[default]
    Ideal,
    /// A position servo of second order: x″ = ω²·(setpoint − x) − 2ζω·x′.
    SecondOrder,
    /// A motor with its loops, inertia, friction, encoder and current, loaded by the cutting process.
    Servo,
}

/// A simulated switch or surface: its input is 1 while the joints stand in a part of space. It has one shape: a joint
/// above or below a position, a box of joints 0 to 2, or the wall of a bore.
///
/// Several switches may share an input; it is 1 while any of them is on.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Switch {
    /// Number of the digital input, 0 to 63.
    pub input: u32,
    /// Number of the (linear) joint, from 0, of `above_mm` and `below_mm`.
    pub joint: Option<usize>,
    /// The input is 1 while the joint's position is greater than this, mm.
    pub above_mm: Option<f64>,
    /// The input is 1 while the joint's position is less than this, mm.
    pub below_mm: Option<f64>,
    /// The input is 1 within the box from this corner, mm, …
    pub low_mm: Option<[f64; 3]>,
    /// … to this one.
    pub high_mm: Option<[f64; 3]>,
    /// The input is 1 at the wall of the bore and beyond.
    pub bore: Option<Bore>,
    /// Fine periods after a change in which the input is random.
    #[serde(default)]
    pub bounce_periods: u32,
}

tandem_sdk::options! {
    /// Options of the simulated drives; the keys of `[driver.options]`.
    pub struct Options {
        /// How the joints follow.
        pub model: Model = Model::Ideal,
        /// Undamped natural frequency of a second-order joint, Hz. Without effect on ideal ones.
        pub natural_frequency_hz: f64 = 30.0,
        /// Damping ratio ζ of a second-order joint: below 1 it overshoots. Without effect on ideal ones.
        pub damping_ratio: f64 = 0.7,
        /// Time constant with which the spindle's speed follows its command, s; 0: at once.
        pub spindle_time_constant_s: f64 = 0.0,
        /// Deceleration with which every joint stops by itself: in a quick stop, and when the drives are let go, mm/s².
        pub quick_stop_deceleration_mm_per_s2: f64 = 5000.0,
        /// How many fine periods in a row may pass without a new setpoint (an exchange with a new tick) before the drives
        /// stop by themselves, 0 to 100; 0: they never do.
        pub watchdog_periods: u32 = 5,
        /// Simulated switches on the digital inputs; all other inputs are 0.
        pub switches: Vec<Switch> = Vec::new(),
        /// Whether the drives catch the position at the edge of a switch that they are armed for, between two exchanges.
        pub latches: bool = true,
        /// Numbers of the joints whose drives catch it, from 0; empty: all. A drive knows its own joint alone.
        pub latch_joints: Vec<usize> = Vec::new(),
        /// What the encoders know at power-on. Incremental ones count from 0, wherever their joints stand, and say that nothing
        /// is known.
        pub encoder: Encoder = Encoder::Absolute,
        /// Where the joints stand at power-on, from joint 0, mm (rad for a rotary joint); joints beyond the list stand where the
        /// machine file has them.
        pub start_mm: Vec<f64> = Vec::new(),
        /// How far at most each joint stands from there, mm (rad for a rotary joint): seeded, and an absolute encoder knows it.
        pub start_spread_mm: f64 = 0.0,
        /// Steps in which positions are read, mm (rad for a rotary joint); 0: none.
        pub encoder_count_mm: f64 = 0.0,
        /// Noise of the positions read, mm rms (rad for a rotary joint).
        pub encoder_noise_mm: f64 = 0.0,
        /// Time from being told to hold until there is torque, s, from joint 0; the last entry stands for all joints after it.
        /// inf: that joint never comes up.
        pub enable_s: Vec<f64> = Vec::new(),
        /// Time that a brake takes to open and to close, s, from joint 0; the last entry stands for all joints after it. 0: the
        /// joint has no brake.
        pub brake_s: Vec<f64> = Vec::new(),
        /// Speed at which gravity pulls a joint along that has neither torque nor a brake, mm/s (rad/s), below 0 downwards; from
        /// joint 0, joints beyond the list are not pulled.
        pub sag_mm_per_s: Vec<f64> = Vec::new(),
        /// Time that the start of the bus takes, s, where the run is in real time; none on the virtual clock.
        pub bus_start_s: f64 = 0.0,
        /// Drives that go into a fault, or fall out of the bus.
        pub faults: Vec<DriveFault> = Vec::new(),
        /// Ends of the way that joints run into.
        pub hard_stops: Vec<HardStop> = Vec::new(),
        /// Frames that get lost: the drives get no setpoint, the driver no answer.
        pub lost_frames: Option<Frames> = None,
        /// Answers that are not there in time; the setpoints are.
        pub late_frames: Option<Frames> = None,
        /// How many fine periods in a row may pass without an answer before all joints are lost, 0 to 1000.
        pub patience_periods: u32 = 3,
        /// Fine periods that an answer takes from the drives, 0 to 15.
        pub delay_periods: u32 = 0,
        /// A clock of the bus that is not the host's: the drives tell how far each exchange was from its tick. On the virtual
        /// clock nobody steers by it.
        pub bus_clock: Option<BusClockOptions> = None,
        /// How far at most the joints stand from where the drives say at power-on, mm (rad for a rotary joint): each by a
        /// random part of it. Switches are where they are; only homing finds out.
        pub unknown_start_mm: f64 = 0.0,
        /// The joints of the model `servo`, from joint 0; the last entry stands for all joints after it.
        pub servo: Vec<ServoOptions> = Vec::new(),
        /// What the model `servo` cuts.
        pub cutting: Option<CuttingOptions> = None,
        /// Seed of what is random: bounce, the start, noise of encoders and currents, lost and late frames, a random workpiece.
        pub seed: u64 = 1,
    }
}

impl Options {
    /// Reads and checks the TOML text of the options.
    ///
    /// # Errors
    /// An unknown key, a wrong type, or a value that makes no sense, with the reason.
    pub fn parse(text: &str) -> Result<Self, PluginError> {
        let options = Self::read(text)?;
        options.check().map(|()| options)
    }

    /// Checks what a type cannot say.
    ///
    /// # Errors
    /// A value that makes no sense, with the reason.
    pub fn check(&self) -> Result<(), PluginError> {
        // The bounds keep the closed form of the servo far from overflow and underflow at any fine period.
        within("natural_frequency_hz", self.natural_frequency_hz, 1e-3, 1e5)?;
        within("damping_ratio", self.damping_ratio, 1e-3, 1e3)?;
        within(
            "quick_stop_deceleration_mm_per_s2",
            self.quick_stop_deceleration_mm_per_s2,
            1e-3,
            1e9,
        )?;
        within(
            "spindle_time_constant_s",
            self.spindle_time_constant_s,
            0.0,
            1e4,
        )?;
        within("unknown_start_mm", self.unknown_start_mm, 0.0, 1e6)?;
        within(
            "watchdog_periods",
            f64::from(self.watchdog_periods),
            0.0,
            100.0,
        )?;
        self.switches.iter().try_for_each(Switch::check)?;
        self.check_joints()?;
        self.check_bus()?;
        self.check_servo()
    }

    /// Whether a machine with `count` joints has all that are named.
    ///
    /// # Errors
    /// The option that names another one.
    pub(crate) fn check_joint_numbers(&self, count: usize) -> Result<(), PluginError> {
        let last_joint = |switch: &Switch| switch.shape().map_or(0, |shape| shape.last_joint());
        let switches = self
            .switches
            .iter()
            .map(|switch| ("switches", last_joint(switch)));
        let faults = self.faults.iter().map(|fault| ("faults", fault.joint));
        let stops = self
            .hard_stops
            .iter()
            .map(|stop| ("hard_stops", stop.joint));
        let latches = self
            .latch_joints
            .iter()
            .map(|joint| ("latch_joints", *joint));
        let wrong = switches
            .chain(faults)
            .chain(stops)
            .chain(latches)
            .find(|(_, joint)| *joint >= count);
        wrong.map_or(Ok(()), |(key, joint)| {
            Err(PluginError::of_option(
                key,
                format!("joint = {joint}: the machine has joints 0 to {}", count - 1),
            ))
        })
    }

    /// Encoders, delays and brakes.
    fn check_joints(&self) -> Result<(), PluginError> {
        all_within("start_mm", &self.start_mm, -1e6, 1e6)?;
        within("start_spread_mm", self.start_spread_mm, 0.0, 1e6)?;
        within("encoder_count_mm", self.encoder_count_mm, 0.0, 1e3)?;
        within("encoder_noise_mm", self.encoder_noise_mm, 0.0, 1e3)?;
        all_within("enable_s", &self.enable_s, 0.0, f64::INFINITY)?;
        all_within("brake_s", &self.brake_s, 0.0, 60.0)?;
        all_within("sag_mm_per_s", &self.sag_mm_per_s, -1e4, 1e4)?;
        match self.latch_joints.iter().find(|joint| **joint >= MAX_AXES) {
            Some(joint) => Err(refusal(
                "latch_joints",
                &format!("{joint}: a machine has joints 0 to {}", MAX_AXES - 1),
            )),
            None => Ok(()),
        }
    }

    fn check_bus(&self) -> Result<(), PluginError> {
        // Longer than this is a bus that does not start.
        within("bus_start_s", self.bus_start_s, 0.0, 30.0)?;
        within(
            "patience_periods",
            f64::from(self.patience_periods),
            0.0,
            1e3,
        )?;
        wire::check(self)?;
        self.faults.iter().try_for_each(DriveFault::check)?;
        self.hard_stops.iter().try_for_each(HardStop::check)?;
        self.bus_clock
            .as_ref()
            .map_or(Ok(()), BusClockOptions::check)
    }

    fn check_servo(&self) -> Result<(), PluginError> {
        if self.model != Model::Servo {
            let unused = [
                ("servo", !self.servo.is_empty()),
                ("cutting", self.cutting.is_some()),
            ];
            return match unused.iter().find(|(_, stated)| *stated) {
                Some((key, _)) => Err(refusal(key, "goes with model = \"servo\" only")),
                None => Ok(()),
            };
        }
        self.servo
            .iter()
            .enumerate()
            .try_for_each(|(index, servo)| servo.check(index))?;
        self.cutting.as_ref().map_or(Ok(()), CuttingOptions::check)
    }
}

impl Switch {
    fn check(&self) -> Result<(), PluginError> {
        if self.input > 63 {
            return Err(refusal(
                "switches",
                &format!("input = {}: the inputs are 0 to 63", self.input),
            ));
        }
        let positions = [self.above_mm, self.below_mm].into_iter().flatten();
        let corners = [self.low_mm, self.high_mm].into_iter().flatten().flatten();
        let circle = self.bore.iter().flat_map(|bore| {
            [
                bore.centre_mm[0],
                bore.centre_mm[1],
                bore.radius_mm,
                bore.top_mm.unwrap_or(0.0),
            ]
        });
        if let Some(wrong) = positions
            .chain(corners)
            .chain(circle)
            .find(|v| !v.is_finite())
        {
            return Err(refusal("switches", &format!("{wrong}: not a position")));
        }
        within(
            "switches.bounce_periods",
            f64::from(self.bounce_periods),
            0.0,
            1e4,
        )?;
        self.shape()
            .map(|_| ())
            .ok_or_else(|| refusal("switches", SHAPES))
    }

    /// Where it is on; none where the keys do not say one shape.
    pub(crate) fn shape(&self) -> Option<Shape> {
        match (
            self.joint,
            self.above_mm,
            self.below_mm,
            self.low_mm,
            self.high_mm,
            self.bore,
        ) {
            (Some(joint), Some(mm), None, None, None, None) => Some(Shape::Above { joint, mm }),
            (Some(joint), None, Some(mm), None, None, None) => Some(Shape::Below { joint, mm }),
            (None, None, None, Some(low_mm), Some(high_mm), None) => {
                Some(Shape::Box { low_mm, high_mm })
            }
            (None, None, None, None, None, Some(bore)) => Some(Shape::Bore(bore)),
            _ => None,
        }
    }
}

/// What a switch is made of.
const SHAPES: &str =
    "a switch has joint and above_mm, joint and below_mm, low_mm and high_mm, or bore";

pub(crate) fn within(key: &str, value: f64, low: f64, high: f64) -> Result<(), PluginError> {
    // A comparison with NaN is false, so NaN is refused as well.
    if (low..=high).contains(&value) {
        return Ok(());
    }
    Err(PluginError::of_option(
        key,
        format!("{value}: must be {low} to {high}"),
    ))
}

/// Each of at most one number a joint.
fn all_within(key: &str, values: &[f64], low: f64, high: f64) -> Result<(), PluginError> {
    if values.len() > MAX_AXES {
        return Err(refusal(
            key,
            &format!(
                "{} numbers: a machine has {MAX_AXES} joints at most",
                values.len()
            ),
        ));
    }
    values
        .iter()
        .try_for_each(|value| within(key, *value, low, high))
}

pub(crate) fn refusal(key: &str, what: &str) -> PluginError {
    PluginError::of_option(key, what)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn defaults_are_ideal() {
        assert_eq!(Options::parse("").unwrap(), Options::default());
        assert_eq!(Options::default().model, Model::Ideal);
    }

    #[test]
    fn every_key_is_read() {
        let text = "model = \"second-order\"\nnatural_frequency_hz = 12\ndamping_ratio = 1.5\n\
                    spindle_time_constant_s = 0.25\nquick_stop_deceleration_mm_per_s2 = 800\nwatchdog_periods = 9\n\
                    latches = false\nunknown_start_mm = 2.5\nseed = 7\n\
                    [[switches]]\ninput = 3\njoint = 1\nabove_mm = 12.5\n\
                    [[switches]]\ninput = 4\nbore = { centre_mm = [1, 2], radius_mm = 3 }\nbounce_periods = 4\n";
        let options = Options::parse(text).unwrap();
        assert_eq!(options.model, Model::SecondOrder);
        assert_eq!(
            (options.natural_frequency_hz, options.damping_ratio),
            (12.0, 1.5)
        );
        assert_eq!(
            (
                options.spindle_time_constant_s,
                options.quick_stop_deceleration_mm_per_s2
            ),
            (0.25, 800.0)
        );
        assert_eq!(options.watchdog_periods, 9);
        assert_eq!(
            options.switches[0].shape(),
            Some(Shape::Above { joint: 1, mm: 12.5 })
        );
        assert_eq!(
            options.switches[1].shape(),
            Some(Shape::Bore(Bore {
                centre_mm: [1.0, 2.0],
                radius_mm: 3.0,
                top_mm: None
            }))
        );
        assert_eq!(
            (options.switches[1].bounce_periods, options.latches),
            (4, false)
        );
        assert_eq!((options.unknown_start_mm, options.seed), (2.5, 7));
    }

    #[test]
    fn nonsense_is_refused_by_name() {
        let cases = [
            ("natural_frequency_hz = 0", "natural_frequency_hz"),
            ("natural_frequency_hz = nan", "natural_frequency_hz"),
            ("damping_ratio = -0.1", "damping_ratio"),
            ("damping_ratio = inf", "damping_ratio"),
            ("spindle_time_constant_s = -1", "spindle_time_constant_s"),
            (
                "quick_stop_deceleration_mm_per_s2 = 0",
                "quick_stop_deceleration_mm_per_s2",
            ),
            ("watchdog_periods = 101", "0 to 100"),
            ("frequency_hz = 3", "frequency_hz"),
            ("model = \"third-order\"", "third-order"),
            (
                "[[switches]]\ninput = 64\njoint = 0\nabove_mm = 1",
                "0 to 63",
            ),
            (
                "[[switches]]\ninput = 1\njoint = 0\nabove_mm = nan",
                "not a position",
            ),
            (
                "[[switches]]\ninput = 1\njoint = 0\nabove_mm = 1\nbelow_mm = 2",
                "joint and below_mm",
            ),
            ("unknown_start_mm = -1", "unknown_start_mm"),
            ("[[switches]]\ninput = 1\njoint = 0", "above_mm"),
            ("[[switches]]\ninput = 1\njoint = -1\nabove_mm = 1", "-1"),
            ("encoder = \"optical\"", "optical"),
            ("start_mm = [nan]", "start_mm"),
            ("start_mm = [0, 0, 0, 0, 0, 0, 0, 0, 0]", "9 numbers"),
            ("encoder_noise_mm = -1", "encoder_noise_mm"),
            ("enable_s = [-1]", "enable_s"),
            ("brake_s = [inf]", "brake_s"),
            ("latch_joints = [8]", "0 to 7"),
            ("bus_start_s = 31", "bus_start_s"),
            ("delay_periods = 16", "0 to 15"),
            ("lost_frames = { periods = 2 }", "never happen"),
            (
                "late_frames = { probability = 2 }",
                "late_frames.probability",
            ),
            (
                "[[faults]]\njoint = 0\ncode = 3",
                "at a tick or at an exchange",
            ),
            ("[[faults]]\njoint = 0\ntick = 3", "above 0"),
            (
                "[[faults]]\njoint = 0\ntick = 3\nlost = true\ncode = 3",
                "no code",
            ),
            ("[[faults]]\njoint = 8\ntick = 3\ncode = 3", "joint = 8"),
            ("bus_clock = { drift = 3 }", "drift"),
        ];
        for (text, word) in cases {
            let message = Options::parse(text).unwrap_err().to_string();
            assert!(message.contains(word), "{text}: {message}");
        }
    }
}
