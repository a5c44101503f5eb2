//! States of a device on its bus, and the codes that say why it left one.

use serde::Deserialize;

/// A state of the application layer.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum AlState {
    /// Neither mailbox nor process data.
    #[default]
    Init,
    /// Mailbox.
    PreOp,
    /// Mailbox and inputs.
    SafeOp,
    /// Mailbox, inputs and outputs.
    Op,
}

impl AlState {
    /// The state of a number as registers hold it; none for others, as for a boot state, which no device here has.
    pub fn of(number: u16) -> Option<Self> {
        match number & 0x0f {
            1 => Some(Self::Init),
            2 => Some(Self::PreOp),
            4 => Some(Self::SafeOp),
            8 => Some(Self::Op),
            _ => None,
        }
    }

    /// Its number.
    pub fn number(self) -> u16 {
        match self {
            Self::Init => 1,
            Self::PreOp => 2,
            Self::SafeOp => 4,
            Self::Op => 8,
        }
    }

    /// The state above.
    pub(crate) fn next(self) -> Option<Self> {
        match self {
            Self::Init => Some(Self::PreOp),
            Self::PreOp => Some(Self::SafeOp),
            Self::SafeOp => Some(Self::Op),
            Self::Op => None,
        }
    }
}

/// Why a device is in an error, as register 0x0134 holds it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(transparent)]
pub struct AlCode(pub u16);

impl AlCode {
    /// A step that is not allowed from this state.
    pub const INVALID_CHANGE: Self = Self(0x0011);
    /// A state that there is not.
    pub const UNKNOWN_STATE: Self = Self(0x0012);
    /// The boot state, which is not supported.
    pub const NO_BOOT: Self = Self(0x0013);
    /// The sync managers of the mailbox are not set up.
    pub const MAILBOX: Self = Self(0x0016);
    /// Sync events are missing.
    pub const SYNC_ERROR: Self = Self(0x001A);
    /// No process data for too long.
    pub const WATCHDOG: Self = Self(0x001B);
    /// The sync manager of the outputs does not fit what is mapped.
    pub const OUTPUTS: Self = Self(0x001D);
    /// The sync manager of the inputs does not fit what is mapped.
    pub const INPUTS: Self = Self(0x001E);
    /// The drive's own clock found no more sync events.
    pub const FATAL_SYNC_ERROR: Self = Self(0x002C);
    /// SYNC0 does not come.
    pub const NO_SYNC: Self = Self(0x002D);
    /// The clock of the device does not follow.
    pub const PLL: Self = Self(0x0032);
    /// The cycle of SYNC0 is none that the device can follow.
    pub const SYNC_CYCLE: Self = Self(0x0035);
}
