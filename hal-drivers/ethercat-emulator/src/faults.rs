//! What goes wrong on a bus, as data: what, when, how long.

use serde::Deserialize;

use crate::al::{AlCode, AlState};

/// One thing that goes wrong.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BusFault {
    /// When it begins.
    pub at: When,
    /// How long it lasts. A fault of the wire lasts for one frame unless stated, any other for ever.
    pub lasts: Option<Span>,
    /// What it is.
    pub what: What,
}

/// When a fault begins.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum When {
    /// With this frame; the first that comes in is 1.
    Frame(u64),
    /// With this frame of process data; the first is 1.
    Cycle(u64),
    /// At this time, in ms.
    Ms(f64),
}

/// How long a fault lasts.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Span {
    /// So many frames.
    Frames(u64),
    /// So many frames of process data.
    Cycles(u64),
    /// So many ms.
    Ms(f64),
}

/// What goes wrong. Devices are counted from 0.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum What {
    /// The frame does not reach any device.
    LostRequest,
    /// The devices see the frame, the master never sees it again.
    LostReply,
    /// The reply comes later.
    Late {
        /// By so many µs.
        by_us: f64,
    },
    /// The reply comes once more.
    Duplicate {
        /// So many µs after the first.
        after_us: f64,
    },
    /// The reply comes behind the next one.
    Swapped,
    /// Bits of the reply are turned over.
    Corrupt {
        /// Byte of the frame, from 0, at most its last.
        byte: usize,
        /// Bits of it.
        mask: u8,
    },
    /// The reply ends early.
    Truncated {
        /// Bytes that are left.
        bytes: usize,
    },
    /// Another master's reply comes before the own one.
    Foreign,
    /// A frame of another protocol comes before the reply.
    Stray,
    /// The cable is cut behind a device, or, without one, before the first.
    Cut {
        /// The last device that is reached.
        behind: Option<usize>,
    },
    /// A device sees no process data, so that the working counter is low.
    Deaf {
        /// The device.
        device: usize,
    },
    /// A device loses its power.
    PowerCycle {
        /// The device.
        device: usize,
    },
    /// A device falls into a state, with a code.
    AlError {
        /// The device.
        device: usize,
        /// The state.
        state: AlState,
        /// The code.
        code: AlCode,
    },
    /// A device refuses a state.
    RefuseState {
        /// The device.
        device: usize,
        /// The state.
        state: AlState,
        /// The code that it gives.
        code: AlCode,
    },
    /// A device never answers to the request for a state.
    HangState {
        /// The device.
        device: usize,
        /// The state.
        state: AlState,
    },
    /// A device refuses to read and write an entry.
    SdoAbort(SdoRefusal),
    /// A device takes messages and answers none.
    SilentMailbox {
        /// The device.
        device: usize,
    },
    /// A device sends an emergency message before each of its next answers.
    Emergencies {
        /// The device.
        device: usize,
        /// So many of them.
        messages: u32,
        /// The code in them.
        code: u16,
    },
    /// A drive goes into a fault.
    DriveFault {
        /// The device.
        device: usize,
        /// Its code, object 603F.
        code: u16,
        /// Whether a reset does not help while this lasts.
        #[serde(default)]
        stays: bool,
    },
    /// A drive never gets beyond *Switched on*.
    NeverEnables {
        /// The device.
        device: usize,
    },
    /// A drive switches itself off.
    DisablesItself {
        /// The device.
        device: usize,
    },
    /// A drive's brake takes its time to open.
    Brake {
        /// The device.
        device: usize,
        /// So many ms.
        open_ms: f64,
    },
    /// A drive is in another mode than it was asked for.
    ModeShown {
        /// The device.
        device: usize,
        /// The mode.
        mode: i8,
    },
    /// Safe torque off of a drive.
    TorqueOff {
        /// The device.
        device: usize,
    },
    /// A drive's axis does not move.
    Blocked {
        /// The device.
        device: usize,
    },
    /// The process holds against a drive.
    Load {
        /// The device.
        device: usize,
        /// Torque as a share of the rated one.
        share: f64,
    },
    /// The oscillator of a device is off.
    Drift {
        /// The device.
        device: usize,
        /// How much it is fast, in parts in a million.
        ppm: f64,
    },
    /// The clock of a device jumps.
    ClockJump {
        /// The device.
        device: usize,
        /// So many ns ahead.
        by_ns: i64,
    },
    /// A device no longer answers to the registers of its clock.
    LostClock {
        /// The device.
        device: usize,
    },
    /// A device misses SYNC0.
    MissedSync {
        /// The device.
        device: usize,
        /// So many times.
        pulses: u32,
    },
    /// A digital input of a terminal, or a probe of a drive, is on.
    Input {
        /// The device.
        device: usize,
        /// The input, from 0.
        input: usize,
    },
    /// An analog input of a terminal has a value.
    Analog {
        /// The device.
        device: usize,
        /// The input, from 0.
        input: usize,
        /// The value.
        value: i16,
    },
}

/// An entry of a dictionary that is refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SdoRefusal {
    /// The device.
    pub device: usize,
    /// Index of the object.
    pub index: u16,
    /// Sub-index; every one unless stated.
    pub sub: Option<u8>,
    /// The code of the abort.
    pub abort: u32,
}

impl SdoRefusal {
    pub(crate) fn meets(&self, index: u16, sub: u8) -> bool {
        self.index == index && self.sub.is_none_or(|refused| refused == sub)
    }
}

impl What {
    /// Whether it is one of single frames.
    pub(crate) fn is_of_frames(&self) -> bool {
        matches!(
            self,
            Self::LostRequest
                | Self::LostReply
                | Self::Late { .. }
                | Self::Duplicate { .. }
                | Self::Swapped
                | Self::Corrupt { .. }
                | Self::Truncated { .. }
                | Self::Foreign
                | Self::Stray
        )
    }

    /// The device that it is about.
    pub(crate) fn device(&self) -> Option<usize> {
        match self {
            Self::Cut { behind } => *behind,
            Self::SdoAbort(refusal) => Some(refusal.device),
            Self::Deaf { device }
            | Self::PowerCycle { device }
            | Self::AlError { device, .. }
            | Self::RefuseState { device, .. }
            | Self::HangState { device, .. }
            | Self::SilentMailbox { device }
            | Self::Emergencies { device, .. }
            | Self::DriveFault { device, .. }
            | Self::NeverEnables { device }
            | Self::DisablesItself { device }
            | Self::Brake { device, .. }
            | Self::ModeShown { device, .. }
            | Self::TorqueOff { device }
            | Self::Blocked { device }
            | Self::Load { device, .. }
            | Self::Drift { device, .. }
            | Self::ClockJump { device, .. }
            | Self::LostClock { device }
            | Self::MissedSync { device, .. }
            | Self::Input { device, .. }
            | Self::Analog { device, .. } => Some(*device),
            _ => None,
        }
    }

    /// Whether it is about a drive alone.
    pub(crate) fn needs_drive(&self) -> bool {
        matches!(
            self,
            Self::DriveFault { .. }
                | Self::NeverEnables { .. }
                | Self::DisablesItself { .. }
                | Self::Brake { .. }
                | Self::ModeShown { .. }
                | Self::TorqueOff { .. }
                | Self::Blocked { .. }
                | Self::Load { .. }
        )
    }
}
