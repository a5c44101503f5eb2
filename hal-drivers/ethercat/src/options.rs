//! The options of the driver.

use serde::{Deserialize, Serialize};

/// What leads the drives' cycle.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Sync {
    /// Frames, as they come.
    #[default]
    FreeRun,
    /// SYNC0 of the drives' own distributed clocks.
    Dc,
}

/// What a drive knows at power-on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Encoder {
    /// Where its joint stands.
    #[default]
    Absolute,
    /// Nothing: it counts from wherever the joint stood.
    Incremental,
}

/// What process data a drive exchanges.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum MapBy {
    /// What this driver needs, written into 1600 and 1A00 at every start.
    #[default]
    Driver,
    /// What the device maps by itself; what is missing there is refused.
    Device,
}

/// How a joint is moved.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Mode {
    /// Cyclic synchronous position (mode 8).
    #[default]
    Csp,
}

/// How a spindle is turned.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum SpindleMode {
    /// Cyclic synchronous velocity (mode 9).
    #[default]
    Csv,
    /// Profile velocity (mode 3): the drive has a ramp of its own.
    Pv,
}

/// The touch probe input of a drive.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ProbeOptions {
    /// Number of the driver's input that the same contact closes.
    pub input: u32,
    /// Touch probe 1 or 2 of the drive.
    pub latch: u8,
}

/// Speeds of a homing by the drive, in mm or rad.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HomingOptions {
    /// Towards the switch (6099:01), mm/s or rad/s.
    pub fast_per_s: f64,
    /// At the switch and to the index pulse (6099:02), mm/s or rad/s.
    pub slow_per_s: f64,
    /// Acceleration (609A), mm/s² or rad/s².
    pub acceleration_per_s2: f64,
}

/// An object that is written at every start, and read back. One value is stated.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StartupOptions {
    /// Object, `0x6085`, or `0x6099:1` with a sub-index.
    pub sdo: String,
    /// Its value, where it has 8 bits.
    pub u8: Option<u8>,
    /// With a sign.
    pub i8: Option<i8>,
    /// 16 bits.
    pub u16: Option<u16>,
    /// With a sign.
    pub i16: Option<i16>,
    /// 32 bits.
    pub u32: Option<u32>,
    /// With a sign.
    pub i32: Option<i32>,
}

/// What a drive is to do by itself, as its objects 605A to 605E and 6007 say it in numbers. What is stated is compared at every
/// start.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ReactionOptions {
    /// On a quick stop (605A).
    pub quick_stop: Option<i16>,
    /// On a shutdown (605B).
    pub shutdown: Option<i16>,
    /// When its operation is disabled (605C).
    pub disable: Option<i16>,
    /// On a halt (605D).
    pub halt: Option<i16>,
    /// On a fault of its own (605E).
    pub fault: Option<i16>,
    /// When the bus is lost (6007).
    pub bus_lost: Option<i16>,
}

/// An analog value among the inputs of a device.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AnalogOptions {
    /// Number of the driver's analog input, 0 to 3.
    pub input: usize,
    /// Byte of the device's inputs at which its 16 bits begin.
    pub byte: usize,
    /// What one step of it stands for.
    #[serde(default = "one")]
    pub scale: f64,
    /// What 0 stands for.
    #[serde(default)]
    pub offset: f64,
}

/// A drive that turns the spindle. `counts_per_turn` counts.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SpindleOptions {
    /// How.
    #[serde(default)]
    pub mode: SpindleMode,
    /// How far from the speed it is told it may be and count as at speed, percent of it.
    #[serde(default = "five")]
    pub at_speed_percent: f64,
}

/// What a code of this drive means.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CodeOptions {
    /// The code as the drive's manual writes it, `0x7305`.
    pub code: String,
    /// In words.
    pub text: String,
}

fn one() -> f64 {
    1.0
}

fn five() -> f64 {
    5.0
}

fn yes() -> bool {
    true
}

/// One device of the bus.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DeviceOptions {
    /// What messages call it; its joint or its position where nothing is stated.
    #[serde(default)]
    pub name: String,
    /// Its place in the order in which a frame meets the devices, from 0; or by `alias`.
    pub position: Option<u16>,
    /// The alias that its SII holds.
    pub alias: Option<u16>,
    /// Vendor and product that it must have, `0x0e1a:0x0402`.
    pub product: String,
    /// Revision that it must have; any where none is stated.
    pub revision: Option<u32>,
    /// The joint that it moves, by its name.
    pub joint: Option<String>,
    /// Counts of its encoder for a mm of a linear joint.
    pub counts_per_mm: Option<f64>,
    /// Counts of its encoder for a turn: of a rotary joint or a spindle, or of the screw with `mm_per_turn`.
    pub counts_per_turn: Option<f64>,
    /// What a turn of the screw moves a linear joint, mm.
    pub mm_per_turn: Option<f64>,
    /// Whether it counts the other way round.
    #[serde(default)]
    pub invert: bool,
    /// What it counts where the joint stands at 0.
    #[serde(default)]
    pub zero_counts: i64,
    /// How the joint is moved.
    #[serde(default)]
    pub mode: Mode,
    /// What it knows at power-on.
    #[serde(default)]
    pub encoder: Encoder,
    /// Whether it is told the velocity as well (60B1), so that it does not lag.
    #[serde(default = "yes")]
    pub feed_forward: bool,
    /// Torque that it is told beforehand (60B2) for an acceleration, permille of the rated one for 1 mm/s² or 1 rad/s².
    #[serde(default)]
    pub torque_permille_per_acceleration: f64,
    /// Its units of velocity (606C, 60B1, 60FF) for one count/s.
    #[serde(default = "one")]
    pub velocity_scale: f64,
    /// Current at rated torque, A; read from 6075 where none is stated.
    pub rated_current_a: Option<f64>,
    /// Which process data.
    #[serde(default)]
    pub map: MapBy,
    /// Its touch probe.
    pub probe: Option<ProbeOptions>,
    /// Speeds of homing by the drive.
    pub homing: Option<HomingOptions>,
    /// What it is to do by itself on stops, faults and a lost bus.
    #[serde(default)]
    pub reactions: ReactionOptions,
    /// Objects that are written at every start.
    #[serde(default)]
    pub startup: Vec<StartupOptions>,
    /// The driver's inputs that its input bits are, from the first bit on; -1 leaves one out. Of a drive: bits of 60FD.
    #[serde(default)]
    pub inputs: Vec<i32>,
    /// The driver's outputs that its output bits are, from the first bit on; -1 leaves one out.
    #[serde(default)]
    pub outputs: Vec<i32>,
    /// Analog values among its inputs.
    #[serde(default)]
    pub analog: Vec<AnalogOptions>,
    /// The spindle that it turns.
    pub spindle: Option<SpindleOptions>,
    /// What its codes mean.
    #[serde(default)]
    pub codes: Vec<CodeOptions>,
}

tandem_sdk::options! {
    /// Options of the driver `ethercat`; the keys of `[drivers.<name>.options]`.
    pub struct Options {
        /// The network interface, or `emulated`: the emulator inside this process, for either clock.
        pub interface: String = String::new(),
        /// What leads the drives' cycle: frames as they come, or SYNC0 of distributed clocks.
        pub sync: Sync = Sync::FreeRun,
        /// With distributed clocks: how long after SYNC0 the frame is to pass the first clock, µs; half a fine period where
        /// nothing is stated.
        pub phase_us: Option<f64> = None,
        /// How long the devices wait for a frame before they stop by themselves, ms: register 0x0420 of each.
        pub watchdog_ms: f64 = 20.0,
        /// How many frames in a row may be lost before a joint is.
        pub max_lost_frames: u32 = 2,
        /// Longest time that enabling takes, brakes included, s.
        pub enable_s: f64 = 5.0,
        /// Longest time from letting go until all brakes are closed, s.
        pub disable_s: f64 = 5.0,
        /// Whether the drives watch the following error themselves (6065 is read, and must be a window).
        pub drives_watch_following: bool = false,
        /// Fine periods by which the setpoint of an exchange is ahead of its feedback, 0 to 15; 1, or 2 with distributed clocks,
        /// where nothing is stated.
        pub delay_periods: Option<u32> = None,
        /// All devices of the bus.
        pub devices: Vec<DeviceOptions> = Vec::new(),
        /// For `interface = "emulated"`: the bus, as the emulator's files describe it; made of `devices` where nothing is stated.
        pub emulated: Option<toml::Table> = None,
    }
}

/// The interface that is none.
pub(crate) const EMULATED: &str = "emulated";

/// A number as people write it, `0x0402` or `1026`.
pub(crate) fn number(text: &str) -> Option<u32> {
    let text = text.trim();
    match text.strip_prefix("0x").or_else(|| text.strip_prefix("0X")) {
        Some(digits) => u32::from_str_radix(digits, 16).ok(),
        None => text.parse().ok(),
    }
}

/// Two numbers with a colon between them.
pub(crate) fn pair(text: &str) -> Option<(u32, u32)> {
    let (first, second) = text.split_once(':')?;
    Some((number(first)?, number(second)?))
}

/// Index and sub-index of `0x6085` or `0x6099:1`.
pub(crate) fn object(text: &str) -> Option<(u16, u8)> {
    let (index, sub) = if text.contains(':') {
        pair(text)?
    } else {
        (number(text)?, 0)
    };
    Some((index.try_into().ok()?, sub.try_into().ok()?))
}

impl StartupOptions {
    /// Its value as bytes, lowest first; none where it states no or several values.
    pub(crate) fn bytes(&self) -> Option<Vec<u8>> {
        let values = [
            self.u8.map(|value| value.to_le_bytes().to_vec()),
            self.i8.map(|value| value.to_le_bytes().to_vec()),
            self.u16.map(|value| value.to_le_bytes().to_vec()),
            self.i16.map(|value| value.to_le_bytes().to_vec()),
            self.u32.map(|value| value.to_le_bytes().to_vec()),
            self.i32.map(|value| value.to_le_bytes().to_vec()),
        ];
        let mut stated = values.into_iter().flatten();
        let value = stated.next();
        if stated.next().is_some() { None } else { value }
    }
}

impl DeviceOptions {
    /// Counts for a mm, or a rad where it turns; none where nothing says so.
    pub(crate) fn counts_per_unit(&self, rotary: bool) -> Option<f64> {
        let counts = match (
            rotary,
            self.counts_per_mm,
            self.counts_per_turn,
            self.mm_per_turn,
        ) {
            (false, Some(counts), None, None) => counts,
            (false, None, Some(counts), Some(mm)) => counts / mm,
            (true, None, Some(counts), None) => counts / std::f64::consts::TAU,
            _ => return None,
        };
        let sign = if self.invert { -1.0 } else { 1.0 };
        (counts.is_finite() && counts > 0.0).then_some(counts * sign)
    }

    /// Whether it is a drive.
    pub(crate) fn is_drive(&self) -> bool {
        self.joint.is_some() || self.spindle.is_some()
    }

    /// What a fault calls it: `device 2`.
    pub(crate) fn title(&self) -> String {
        match (self.position, self.alias) {
            (Some(position), _) => format!("device {position}"),
            (None, alias) => format!("the device of alias {}", alias.unwrap_or_default()),
        }
    }

    /// Whether the machine moves, reads or switches anything by it.
    pub(crate) fn is_used(&self) -> bool {
        let any = |lines: &[i32]| lines.iter().any(|line| *line >= 0);
        self.is_drive() || any(&self.inputs) || any(&self.outputs) || !self.analog.is_empty()
    }

    /// What messages call it: `device 2 (z)`.
    pub(crate) fn called(&self, place: usize) -> String {
        let name = if self.name.is_empty() {
            self.joint.as_deref().unwrap_or_default()
        } else {
            &self.name
        };
        let name = if name.is_empty() && self.spindle.is_some() {
            "spindle"
        } else {
            name
        };
        if name.is_empty() {
            format!("device {place}")
        } else {
            format!("device {place} ({name})")
        }
    }
}
