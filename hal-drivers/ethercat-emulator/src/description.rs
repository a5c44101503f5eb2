//! The bus as a file describes it.

use serde::Deserialize;
use thiserror::Error;

use crate::drive::DriveDescription;
pub use crate::esc::Clocking;
use crate::faults::BusFault;

/// A bus: its devices in the order in which a frame meets them, what goes wrong, and when.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub struct BusDescription {
    /// The devices.
    #[serde(default)]
    pub devices: Vec<DeviceDescription>,
    /// What goes wrong.
    #[serde(default)]
    pub faults: Vec<BusFault>,
    /// Inputs of terminals that follow the position of a drive.
    #[serde(default)]
    pub switches: Vec<Switch>,
}

/// An input of a terminal, closed by where a drive stands.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Switch {
    /// Device with the input.
    pub device: usize,
    /// Number of the input, from 0.
    pub input: usize,
    /// The drive.
    pub drive: usize,
    /// Position above which the input is on, in counts.
    pub above_counts: f64,
}

/// What kind of device.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Kind {
    /// A bus coupler: no process data.
    Coupler,
    /// A terminal with digital inputs.
    DigitalInputs,
    /// A terminal with digital outputs, which its watchdog switches off.
    DigitalOutputs,
    /// A terminal with analog inputs, and a mailbox.
    AnalogInputs,
    /// A terminal with analog outputs, and a mailbox.
    AnalogOutputs,
    /// A drive by CiA 402.
    Drive,
    /// Whatever an image of a SII describes, without its application.
    Image,
}

/// One device.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DeviceDescription {
    /// What it is.
    pub kind: Kind,
    /// What messages call it; by default its kind.
    #[serde(default)]
    pub name: String,
    /// Vendor that it states.
    pub vendor: Option<u32>,
    /// Product that it states.
    pub product: Option<u32>,
    /// Revision that it states.
    pub revision: Option<u32>,
    /// Serial number that it states.
    #[serde(default)]
    pub serial: u32,
    /// Alias that its SII holds; 0 is none.
    #[serde(default)]
    pub alias: u16,
    /// Channels of a terminal.
    pub channels: Option<u8>,
    /// Where it is plugged in: port 1 of the device before it, unless stated.
    pub plug: Option<Plug>,
    /// Time that a frame takes from the device before to this one, in ns.
    #[serde(default = "default_cable_ns")]
    pub cable_ns: u64,
    /// What it has of distributed clocks.
    pub clocking: Option<Clocking>,
    /// How much its clock is fast, in parts in a million.
    #[serde(default)]
    pub drift_ppm: f64,
    /// Its local time when the emulator's is 0, in ns.
    #[serde(default)]
    pub clock_start_ns: u64,
    /// Units that map logical addresses; as many as such a device has, unless stated.
    pub fmmus: Option<u8>,
    /// Sync managers; as many as such a device has, unless stated.
    pub sync_managers: Option<u8>,
    /// Whether its SII answers 8 bytes at a time; otherwise 4.
    pub wide_sii: Option<bool>,
    /// Bytes of each of its mailboxes.
    pub mailbox_bytes: Option<u16>,
    /// Whether it answers complete access.
    pub complete_access: Option<bool>,
    /// What its register of features, 0x0008, holds; as such a device has it, unless stated.
    pub features: Option<u16>,
    /// Objects of its dictionary that it has besides.
    #[serde(default)]
    pub objects: Vec<ObjectDescription>,
    /// The image of a SII, for the kind `image`.
    #[serde(default)]
    pub image: Vec<u8>,
    /// The drive, for the kind `drive`.
    #[serde(default)]
    pub drive: DriveDescription,
}

/// An entry of a dictionary. One to four bytes are a number, more are octets.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ObjectDescription {
    /// Index of the object.
    pub index: u16,
    /// Sub-index.
    #[serde(default)]
    pub sub: u8,
    /// Its value at power-on, lowest byte first.
    pub value: Vec<u8>,
    /// Whether a master may write it.
    #[serde(default)]
    pub writable: bool,
}

/// A port of a device before this one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Plug {
    /// Number of the device, from 0.
    pub device: usize,
    /// Its port, 1 to 3.
    pub port: usize,
}

fn default_cable_ns() -> u64 {
    300
}

/// Why a description is refused.
#[derive(Debug, Error, PartialEq, Eq)]
pub enum DescriptionError {
    /// The text is none.
    #[error("{0}")]
    Toml(String),
    /// A device cannot be built.
    #[error("device {device}: {cause}")]
    Device {
        /// Its number, from 0.
        device: usize,
        /// What is wrong with it.
        cause: String,
    },
    /// A fault or a switch names what is not there.
    #[error("{0}")]
    Reference(String),
}

impl DeviceDescription {
    /// A device of a kind, as if a file named nothing else.
    pub fn new(kind: Kind) -> Self {
        Self {
            kind,
            name: String::new(),
            vendor: None,
            product: None,
            revision: None,
            serial: 0,
            alias: 0,
            channels: None,
            plug: None,
            cable_ns: default_cable_ns(),
            clocking: None,
            drift_ppm: 0.0,
            clock_start_ns: 0,
            fmmus: None,
            sync_managers: None,
            wide_sii: None,
            mailbox_bytes: None,
            complete_access: None,
            features: None,
            objects: vec![],
            image: vec![],
            drive: DriveDescription::default(),
        }
    }
}

impl BusDescription {
    /// Reads a description. An unknown key is an error, and its message says where.
    ///
    /// # Errors
    /// Text that is no description.
    pub fn from_toml(text: &str) -> Result<Self, DescriptionError> {
        toml::from_str(text).map_err(|e| DescriptionError::Toml(e.to_string()))
    }
}
