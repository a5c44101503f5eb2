//! The state of a joint, and where it stands when its driver is attached.

use std::fmt;

use crate::abi::layout::{Layout, START, fold, fold_text, layout};
use crate::{AxisVector, MAX_AXES};

/// State of one joint's drive: one of seven numbers. It is no `enum`, because drivers write it in every fine period, and what a
/// driver writes that is none of them is told as that number.
#[derive(Clone, Copy, Default, PartialEq, Eq)]
#[repr(transparent)]
pub struct JointState(pub u32);

#[allow(non_upper_case_globals)] // they read as the variants that they stand for
impl JointState {
    /// No torque, the brake closed.
    pub const Disabled: Self = Self(0);
    /// On its way there: torque is built up, the brake opens. Nothing may move it yet.
    pub const Enabling: Self = Self(1);
    /// Following the setpoint.
    pub const Enabled: Self = Self(2);
    /// Moving on its own towards its reference; the setpoint does not count.
    pub const Homing: Self = Self(3);
    /// Coming to rest by its own means.
    pub const QuickStop: Self = Self(4);
    /// The drive reports a fault.
    pub const Fault: Self = Self(5);
    /// The driver does not reach the drive: it left its bus state, or answers have been missing for longer than the driver's
    /// patience. Nothing is known of it.
    pub const Lost: Self = Self(6);

    const NAMES: [&str; 7] = [
        "Disabled",
        "Enabling",
        "Enabled",
        "Homing",
        "QuickStop",
        "Fault",
        "Lost",
    ];

    /// Whether it is one of the seven. Any loop; does not allocate.
    #[inline]
    pub const fn is_known(self) -> bool {
        self.0 <= Self::Lost.0
    }
}

impl fmt::Debug for JointState {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match Self::NAMES.get(self.0 as usize) {
            Some(name) => f.write_str(name),
            None => write!(f, "JointState({})", self.0),
        }
    }
}

impl Layout for JointState {
    // The names in the order of their numbers, from 0 on.
    const HASH: u64 = {
        let mut hash = fold_text(START, "JointState");
        let mut index = 0;
        while index < Self::NAMES.len() {
            hash = fold_text(hash, Self::NAMES[index]);
            index += 1;
        }
        fold(hash, u32::HASH)
    };
}

/// Where the joints stand when the driver has brought its bus up, and what is known of them.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct Attached {
    /// Bit per joint whose position is known: an absolute encoder. The position of another one counts from wherever it stood at
    /// power-on; that it has been homed by a switch since then is what the host remembers.
    pub known: u32,
    /// Bit per joint whose drive says that it is homed, by a method of its own. A joint that is known or homed may be moved by programs:
    /// where neither holds, both bits are cleared ([`Attached::counting_from_power_on`]).
    pub homed: u32,
    /// Position per joint, mm or rad.
    pub position: AxisVector,
    /// State per joint.
    pub state: [JointState; MAX_AXES],
    /// Fault code per joint, the drive's own; 0 for none.
    pub fault_code: [u32; MAX_AXES],
    /// Fine periods by which the setpoint of an exchange is ahead of the feedback of the same exchange, per joint, at most
    /// [`MAX_DELAY_PERIODS`]: 0 where the feedback answers that setpoint.
    pub delay_periods: [u32; MAX_AXES],
}

layout!(Attached {
    known,
    homed,
    position,
    state,
    fault_code,
    delay_periods
});

/// Most periods that feedback may be behind the setpoint.
pub const MAX_DELAY_PERIODS: u32 = 15;

impl Attached {
    /// Joints that stand at `position` and know it, as absolute encoders do, disabled, without delay. Any loop; does not allocate.
    pub fn at(position: AxisVector) -> Self {
        Self {
            known: u32::MAX,
            homed: u32::MAX,
            position,
            state: [JointState::Disabled; MAX_AXES],
            fault_code: [0; MAX_AXES],
            delay_periods: [0; MAX_AXES],
        }
    }

    /// Joints that stand at `position` as counted from power-on, and know no more: they have to be homed. Any loop; does not allocate.
    pub fn counting_from_power_on(position: AxisVector) -> Self {
        Self {
            known: 0,
            homed: 0,
            ..Self::at(position)
        }
    }
}

impl Default for Attached {
    fn default() -> Self {
        Self::at(AxisVector::ZERO)
    }
}
