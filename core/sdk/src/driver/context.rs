//! What a driver is told when it is opened, and what it says of itself.

use std::fmt;

use crate::abi::layout::layout;
use crate::{AxisLimits, AxisVector, MAX_AXES};

/// A short name that crosses the contract by value: UTF-8, cut at a character where it is too long, filled up with zeros.
#[derive(Clone, Copy, PartialEq, Eq)]
#[repr(C)]
pub struct Name {
    bytes: [u8; 32],
}

layout!(Name { bytes });

impl Name {
    /// `text`, or as much of it as there is room for. Any loop; does not allocate.
    pub fn new(text: &str) -> Self {
        let mut bytes = [0; 32];
        let mut length = text.len().min(bytes.len());
        while !text.is_char_boundary(length) {
            length -= 1;
        }
        bytes[..length].copy_from_slice(&text.as_bytes()[..length]);
        Self { bytes }
    }

    /// The text. Any loop; does not allocate.
    pub fn as_str(&self) -> &str {
        let length = self
            .bytes
            .iter()
            .position(|byte| *byte == 0)
            .unwrap_or(self.bytes.len());
        std::str::from_utf8(&self.bytes[..length]).unwrap_or("a name that is not UTF-8")
    }
}

impl fmt::Debug for Name {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.as_str().fmt(f)
    }
}

/// One joint that a driver moves.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct JointDescription {
    /// Its name in the machine file; the letter of its axis where the joints are the axes.
    pub name: Name,
    /// 1 where it turns: its numbers are in rad. 0 where it slides: mm.
    pub rotary: u32,
    /// Method by which the drive itself homes it (`CiA 402` numbers); 0 where the host homes it, or nobody does.
    pub homing_method: i32,
    /// Torque that its drive keeps to while it is homed ([`crate::Setpoint::limited`]), percent of the rated one; infinite where
    /// none is stated.
    pub homing_torque_percent: f64,
    /// What it may do.
    pub limits: AxisLimits,
}

layout!(JointDescription {
    name,
    rotary,
    homing_method,
    homing_torque_percent,
    limits
});

/// What a driver is told when it is opened.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct DriverContext {
    /// Number of joints.
    pub joint_count: u32,
    /// Fine period: the time between two calls of `exchange`, s.
    pub fine_period_s: f64,
    /// Where a simulated machine stands at power-on, mm or rad per joint. Real drives know better.
    pub start_position: AxisVector,
    /// Seed for anything random a simulated driver does.
    pub seed: u64,
    /// The joints; the first `joint_count` count.
    pub joints: [JointDescription; MAX_AXES],
    /// Bit per digital input that the machine file reads from this driver, in the driver's own numbers: switches, index pulses, the probe,
    /// named inputs.
    pub inputs: u64,
    /// Bit per digital output that is this driver's: all of them where it has the whole machine (`[driver]`), whether anything switches
    /// them or not.
    pub outputs: u64,
    /// Bit per analog input that the machine file expects of this driver.
    pub analog: u32,
    /// 1 where the spindle is this driver's, as that of the whole machine's driver is.
    pub spindle: u32,
    /// 1 where the loops run in real time. On the virtual clock, 0, what takes a simulated driver time costs the computer none.
    pub real_time: u32,
}

layout!(DriverContext {
    joint_count,
    fine_period_s,
    start_position,
    seed,
    joints,
    inputs,
    outputs,
    analog,
    spindle,
    real_time
});

impl DriverContext {
    /// A context for `joint_count` joints at zero, named by their numbers and without limits; nothing else is expected of the
    /// driver. For tests of drivers. Host; does not allocate.
    pub fn new(joint_count: usize, fine_period_s: f64) -> Self {
        const NAMES: [&str; MAX_AXES] = ["0", "1", "2", "3", "4", "5", "6", "7"];
        let joint = |i: usize| JointDescription {
            name: Name::new(NAMES[i]),
            rotary: 0,
            homing_method: 0,
            homing_torque_percent: f64::INFINITY,
            limits: AxisLimits::unlimited(),
        };
        Self {
            joint_count: joint_count as u32,
            fine_period_s,
            start_position: AxisVector::ZERO,
            seed: 0,
            joints: std::array::from_fn(joint),
            inputs: 0,
            outputs: 0,
            analog: 0,
            spindle: 0,
            real_time: 0,
        }
    }
}

/// What a driver says of itself, whatever the machine; it may follow from its options. One whose bus can be emulated says then that it is
/// simulated, and is judged and run without hardware.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct DriverDescription {
    /// 1 where no metal moves: `guard.mode = "count"` and the virtual clock are permitted.
    pub simulated: u32,
    /// 1 where the drives themselves fault when a joint is too far from its setpoint. A real driver that does not needs
    /// `max_following_error` for each joint.
    pub watches_following: u32,
    /// 1 where an exchange may take longer than a fine period, as of a spindle on a serial line: the host calls it on a thread of its
    /// own, and the fine loop never waits for it. Such a driver has no joints.
    pub slow: u32,
    /// 1 where codes are written in hexadecimal, as `CiA 402` has them; 0 for decimal.
    pub hexadecimal_codes: u32,
    /// 1 where its feedback says how far an exchange was from where the bus wants it ([`crate::Feedback::phase_ns`]): the wall
    /// clock follows it, so at most one driver of a machine may.
    pub gives_phase: u32,
    /// Longest time that enabling all joints takes, brakes included, s; past it the host gives up and says which joint is not.
    /// More than 0 and at most [`MAX_ENABLE_S`], or the driver is refused.
    pub enable_s: f64,
    /// Longest time from `enable = 0` to the last joint's [`crate::JointState::Disabled`], s. The exchange goes on until then.
    /// More than 0 and at most [`MAX_ENABLE_S`], or the driver is refused.
    pub disable_s: f64,
}

layout!(DriverDescription {
    simulated,
    watches_following,
    slow,
    hexadecimal_codes,
    gives_phase,
    enable_s,
    disable_s
});

/// Longest time that a driver may ask a host to wait for, s: ten minutes. What brings a bus up is done in
/// [`crate::Driver::start`] and has no limit; contactors and brakes are done within seconds.
pub const MAX_ENABLE_S: f64 = 600.0;

/// Time that a driver which states nothing else has for enabling and for disabling, s: contactors, self-tests and brakes of
/// ordinary drives take less than a second.
const ORDINARY_S: f64 = 5.0;

impl DriverDescription {
    /// A simulated driver. Any loop; does not allocate.
    pub const fn simulated() -> Self {
        Self {
            simulated: 1,
            ..Self::real()
        }
    }

    /// A driver with real drives behind it. Any loop; does not allocate.
    pub const fn real() -> Self {
        Self {
            simulated: 0,
            watches_following: 0,
            slow: 0,
            hexadecimal_codes: 0,
            gives_phase: 0,
            enable_s: ORDINARY_S,
            disable_s: ORDINARY_S,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_that_is_too_long_is_cut_at_a_character() {
        assert_eq!(Name::new("x").as_str(), "x");
        assert_eq!(Name::new("").as_str(), "");
        let long = "a".repeat(31) + "ä";
        assert_eq!(Name::new(&long).as_str(), "a".repeat(31));
        assert_eq!(Name::new(&"b".repeat(32)).as_str(), "b".repeat(32));
    }
}
