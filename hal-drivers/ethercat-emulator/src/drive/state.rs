//! The states of a drive by CiA 402.

/// A state, as the status word shows it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum DriveState {
    /// After power-on.
    #[default]
    NotReady,
    /// Waits for the shutdown command.
    SwitchOnDisabled,
    /// Waits to be switched on.
    ReadyToSwitchOn,
    /// Switched on, without torque.
    SwitchedOn,
    /// With torque, following its mode.
    OperationEnabled,
    /// Stops, or stands after a quick stop.
    QuickStopActive,
    /// Stops because of a fault.
    FaultReactionActive,
    /// Stands in a fault until it is reset.
    Fault,
}

impl DriveState {
    /// The bits of the status word that stand for it.
    pub(super) fn bits(self) -> u16 {
        match self {
            Self::NotReady => 0x00,
            Self::SwitchOnDisabled => 0x40,
            Self::ReadyToSwitchOn => 0x21,
            Self::SwitchedOn => 0x23,
            Self::OperationEnabled => 0x27,
            Self::QuickStopActive => 0x07,
            Self::FaultReactionActive => 0x0F,
            Self::Fault => 0x08,
        }
    }
}

/// What a control word asks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Command {
    DisableVoltage,
    QuickStop,
    Shutdown,
    SwitchOn,
    EnableOperation,
}

impl Command {
    pub(super) fn of(control: u16) -> Self {
        match control & 0x0f {
            bits if bits & 0x02 == 0 => Self::DisableVoltage,
            bits if bits & 0x04 == 0 => Self::QuickStop,
            bits if bits & 0x01 == 0 => Self::Shutdown,
            bits if bits & 0x08 == 0 => Self::SwitchOn,
            _ => Self::EnableOperation,
        }
    }
}
