//! The driver contract: setpoints to the drives, feedback from them.
//!
//! A complete driver that follows its setpoint exactly:
//!
//! ```
//! use tandem_sdk::{Driver, DriverContext, DriverDescription, Feedback, JointState, PluginError, Setpoint};
//!
//! struct Echo {
//!     joints: usize,
//! }
//!
//! impl Driver for Echo {
//!     fn describe(&self) -> DriverDescription {
//!         DriverDescription::simulated()
//!     }
//!
//!     fn open(&mut self, context: &DriverContext) -> Result<(), PluginError> {
//!         self.joints = context.joint_count as usize;
//!         Ok(())
//!     }
//!
//!     fn start(&mut self) -> Result<(), PluginError> {
//!         Ok(())
//!     }
//!
//!     fn exchange(&mut self, setpoint: &Setpoint, feedback: &mut Feedback) -> Result<(), PluginError> {
//!         feedback.follow(setpoint, self.joints);
//!         Ok(())
//!     }
//!
//!     fn quick_stop(&mut self) {}
//!
//!     fn stop(&mut self) -> Result<(), PluginError> {
//!         Ok(())
//!     }
//! }
//!
//! let mut driver = Echo { joints: 0 };
//! driver.open(&DriverContext::new(3, 0.001)).unwrap();
//! let mut feedback = Feedback::default();
//! driver.exchange(&Setpoint::default(), &mut feedback).unwrap();
//! assert_eq!(feedback.state[2], JointState::Disabled);
//! ```

use crate::abi::layout::{Layout, START, fold, fold_text, layout};
use crate::{AxisVector, MAX_AXES, PluginError, size_of_contract};

/// Most latches a driver reports at once.
pub const MAX_LATCHES: usize = 4;

/// Most analog inputs a driver reports.
pub const MAX_ANALOG: usize = 4;

/// What a driver is told when it is opened.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct DriverContext {
    /// Size of this structure in bytes.
    pub size: u32,
    /// Number of joints.
    pub joint_count: u32,
    /// Fine period: the time between two calls of `exchange`, s.
    pub fine_period_s: f64,
    /// Where a simulated machine stands at power-on, mm or rad per joint.
    pub start_position: AxisVector,
    /// Seed for anything random a simulated driver does.
    pub seed: u64,
}

layout!(DriverContext { size, joint_count, fine_period_s, start_position, seed });

impl DriverContext {
    /// A context for `joint_count` joints at zero.
    pub fn new(joint_count: usize, fine_period_s: f64) -> Self {
        Self {
            size: size_of_contract::<Self>(),
            joint_count: joint_count as u32,
            fine_period_s,
            start_position: AxisVector::ZERO,
            seed: 0,
        }
    }
}

/// What a driver says of itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(C)]
pub struct DriverDescription {
    /// Size of this structure in bytes.
    pub size: u32,
    /// 1 where no metal moves: `guard.mode = "count"` and the virtual clock are permitted.
    pub simulated: u32,
}

layout!(DriverDescription { size, simulated });

impl DriverDescription {
    /// A simulated driver.
    pub fn simulated() -> Self {
        Self { size: size_of_contract::<Self>(), simulated: 1 }
    }

    /// A driver with real drives behind it.
    pub fn real() -> Self {
        Self { size: size_of_contract::<Self>(), simulated: 0 }
    }
}

/// What the drives are told each fine period.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct Setpoint {
    /// Size of this structure in bytes.
    pub size: u32,
    /// 1 while the drives are to hold or move, 0 to let go.
    pub enable: u32,
    /// 1 for one period to reset a drive fault.
    pub reset: u32,
    /// Reserved, zero.
    pub reserved: u32,
    /// Number of the fine period.
    pub tick: u64,
    /// Digital outputs, bit n is output n.
    pub outputs: u64,
    /// Position per joint, mm or rad.
    pub position: AxisVector,
    /// Velocity per joint, mm/s or rad/s: the difference to the last setpoint.
    pub velocity: AxisVector,
    /// Acceleration per joint, mm/s² or rad/s²: the second difference.
    pub acceleration: AxisVector,
    /// Spindle speed, rad/s, positive clockwise.
    pub spindle_rad_per_s: f64,
}

layout!(Setpoint { size, enable, reset, reserved, tick, outputs, position, velocity, acceleration, spindle_rad_per_s });

impl Default for Setpoint {
    fn default() -> Self {
        Self {
            size: size_of_contract::<Self>(),
            enable: 0,
            reset: 0,
            reserved: 0,
            tick: 0,
            outputs: 0,
            position: AxisVector::ZERO,
            velocity: AxisVector::ZERO,
            acceleration: AxisVector::ZERO,
            spindle_rad_per_s: 0.0,
        }
    }
}

/// State of one joint's drive: one of three numbers. It is no `enum`, because drivers write it in every fine period, and what a
/// driver writes that is none of them is told as that number.
#[derive(Clone, Copy, Default, PartialEq, Eq)]
#[repr(transparent)]
pub struct JointState(pub u32);

#[allow(non_upper_case_globals)] // they read as the variants that they stand for
impl JointState {
    /// No torque.
    pub const Disabled: Self = Self(0);
    /// Following the setpoint.
    pub const Enabled: Self = Self(1);
    /// The drive reports a fault.
    pub const Fault: Self = Self(2);

    /// Whether it is one of the three. Any loop; does not allocate.
    #[inline]
    pub const fn is_known(self) -> bool {
        self.0 <= Self::Fault.0
    }
}

impl std::fmt::Debug for JointState {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match *self {
            Self::Disabled => f.write_str("Disabled"),
            Self::Enabled => f.write_str("Enabled"),
            Self::Fault => f.write_str("Fault"),
            Self(number) => write!(f, "JointState({number})"),
        }
    }
}

impl Layout for JointState {
    // The names in the order of their numbers, from 0 on.
    const HASH: u64 = fold(fold_text(START, "JointState Disabled Enabled Fault"), u32::HASH);
}

/// A position caught by the drive on an input edge.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(C)]
pub struct Latch {
    /// Number of the input.
    pub input: u32,
    /// 1 for a rising edge, 2 for a falling one, 0 for no latch.
    pub edge: u32,
    /// Positions per joint at the edge, mm or rad.
    pub position: AxisVector,
}

layout!(Latch { input, edge, position });

/// What the drives report each fine period.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct Feedback {
    /// Size of this structure in bytes.
    pub size: u32,
    /// State per joint.
    pub state: [JointState; MAX_AXES],
    /// Fault code per joint, the drive's own; 0 for none.
    pub fault_code: [u32; MAX_AXES],
    /// Position per joint, mm or rad.
    pub position: AxisVector,
    /// Speed per joint, mm/s or rad/s.
    pub speed: AxisVector,
    /// Mean motor current of the past period, A.
    pub current_a: AxisVector,
    /// Digital inputs, bit n is input n.
    pub inputs: u64,
    /// Analog inputs, in units that the machine's builder knows: a dynamometer, a spindle load.
    pub analog: [f64; MAX_ANALOG],
    /// Latched positions.
    pub latches: [Latch; MAX_LATCHES],
    /// Spindle speed, rad/s.
    pub spindle_rad_per_s: f64,
    /// Spindle angle, rad.
    pub spindle_angle_rad: f64,
}

layout!(Feedback {
    size,
    state,
    fault_code,
    position,
    speed,
    current_a,
    inputs,
    analog,
    latches,
    spindle_rad_per_s,
    spindle_angle_rad
});

impl Default for Feedback {
    fn default() -> Self {
        Self {
            size: size_of_contract::<Self>(),
            state: [JointState::Disabled; MAX_AXES],
            fault_code: [0; MAX_AXES],
            position: AxisVector::ZERO,
            speed: AxisVector::ZERO,
            current_a: AxisVector::ZERO,
            inputs: 0,
            analog: [0.0; MAX_ANALOG],
            latches: [Latch::default(); MAX_LATCHES],
            spindle_rad_per_s: 0.0,
            spindle_angle_rad: 0.0,
        }
    }
}

impl Feedback {
    /// What ideal drives report: `joints` joints stand where they are told to, and hold while they are enabled. Any loop;
    /// does not allocate.
    pub fn follow(&mut self, setpoint: &Setpoint, joints: usize) {
        (self.position, self.speed) = (setpoint.position, setpoint.velocity);
        let state = if setpoint.enable == 0 { JointState::Disabled } else { JointState::Enabled };
        self.state[..joints].fill(state);
    }
}

/// Talks to the drives. At most these seven methods; `exchange` and `quick_stop` run on the fine loop.
pub trait Driver: Send {
    /// Simulated or real.
    fn describe(&self) -> DriverDescription;

    /// Whether the options go with the machine: everything that can be told without hardware. It is asked before
    /// [`Driver::open`], and by `tandem check`, which opens no driver: so it touches nothing, and writes nothing. Host; may
    /// allocate. A driver whose options go with every machine leaves it out.
    ///
    /// # Errors
    /// What does not go together, and which option it is ([`PluginError::of_option`]).
    fn check(&self, _context: &DriverContext) -> Result<(), PluginError> {
        Ok(())
    }

    /// Claims the hardware. Host, before the loops; may allocate.
    ///
    /// # Errors
    /// What is missing.
    fn open(&mut self, context: &DriverContext) -> Result<(), PluginError>;

    /// The loops are about to run. Host; may allocate.
    ///
    /// # Errors
    /// Why the drives cannot be enabled.
    fn start(&mut self) -> Result<(), PluginError>;

    /// One fine period: sends `setpoint`, fills `feedback`. Fine loop: no allocation, no lock, bounded time.
    ///
    /// # Errors
    /// The drives are lost: the machine faults. Use [`PluginError::fixed`], which does not allocate.
    fn exchange(&mut self, setpoint: &Setpoint, feedback: &mut Feedback) -> Result<(), PluginError>;

    /// Bring the drives to rest by their own means, now. Fine loop: no allocation.
    fn quick_stop(&mut self);

    /// The loops have ended: release the hardware. Host; may allocate.
    ///
    /// # Errors
    /// What could not be released or written: a run that was good so far ends with this as its fault.
    fn stop(&mut self) -> Result<(), PluginError>;
}
