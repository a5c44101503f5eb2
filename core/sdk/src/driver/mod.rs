//! The driver contract: setpoints to the drives, feedback from them.
//!
//! A complete driver that follows its setpoint exactly:
//!
//! ```
//! use tandem_sdk::{
//!     Attached, AxisVector, Driver, DriverContext, DriverDescription, Feedback, JointState, PluginError, Setpoint,
//! };
//!
//! struct Echo {
//!     joints: usize,
//!     position: AxisVector,
//! }
//!
//! impl Driver for Echo {
//!     fn describe(&self) -> DriverDescription {
//!         DriverDescription::simulated()
//!     }
//!
//!     fn open(&mut self, context: &DriverContext) -> Result<(), PluginError> {
//!         (self.joints, self.position) = (context.joint_count as usize, context.start_position);
//!         Ok(())
//!     }
//!
//!     fn start(&mut self) -> Result<Attached, PluginError> {
//!         Ok(Attached::at(self.position))
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
//! let mut driver = Echo { joints: 0, position: AxisVector::ZERO };
//! driver.open(&DriverContext::new(3, 0.001)).unwrap();
//! let attached = driver.start().unwrap();
//! assert_eq!((attached.known & 7, attached.position), (7, AxisVector::ZERO));
//! let mut feedback = Feedback::default();
//! driver.exchange(&Setpoint::default(), &mut feedback).unwrap();
//! assert_eq!(feedback.state[2], JointState::Disabled);
//! ```

mod context;
mod exchange;
mod state;

pub use context::{DriverContext, DriverDescription, JointDescription, MAX_ENABLE_S, Name};
pub use exchange::{Arm, Feedback, Latch, MAX_ANALOG, MAX_DIGITAL, MAX_LATCHES, Setpoint};
pub use state::{Attached, JointState, MAX_DELAY_PERIODS};

use crate::PluginError;
use crate::text::Words;

/// Talks to the drives. Its life: `open`, then any number of times `start`, exchanges, `stop`.
///
/// From the end of `start` to the first exchange, and from the last exchange to `stop`, nobody calls it, for seconds where a
/// program is long to check: the driver keeps its bus alive by itself, and its drives as they are.
pub trait Driver: Send {
    /// What it is, whatever the machine.
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

    /// Claims the hardware for the joints, inputs and outputs of `context`. Host, before the loops; may allocate.
    ///
    /// # Errors
    /// What is missing.
    fn open(&mut self, context: &DriverContext) -> Result<(), PluginError>;

    /// Brings the bus up, which may take seconds, and tells where the joints stand. Nothing is enabled and nothing moves. Host;
    /// may allocate.
    ///
    /// # Errors
    /// Why the drives cannot be reached.
    fn start(&mut self) -> Result<Attached, PluginError>;

    /// On a machine with several drivers, before the exchanges of a period: what takes its time on a wire may begin here with
    /// `setpoint`, which the exchange of the same period is given again, so that the drivers wait for their answers together. An
    /// exchange without it sends by itself, as that of the driver does whose exchange comes first. Fine loop: no allocation, no
    /// lock, bounded time. A driver that sends and receives in one go leaves it out.
    ///
    /// Gives whether the driver ever has something to begin here: who is told `false` need not ask again until the next
    /// [`Driver::start`].
    fn send(&mut self, _setpoint: &Setpoint) -> bool {
        false
    }

    /// One fine period: sends `setpoint` and fills `feedback`, which still holds what the driver wrote in the last period. Fine
    /// loop: no allocation, no lock, bounded time.
    ///
    /// A lost frame is no failure: the old numbers go out again with their age, until the driver's patience is over and the joint
    /// is [`JointState::Lost`].
    ///
    /// # Errors
    /// The driver itself cannot go on: the machine faults. Use [`PluginError::fixed`], which does not allocate.
    fn exchange(&mut self, setpoint: &Setpoint, feedback: &mut Feedback)
    -> Result<(), PluginError>;

    /// Bring the drives to rest by their own means, now: a fault has been answered by setpoints that came to rest, or could not be.
    /// Exchanges go on; the drives are [`JointState::QuickStop`] until they rest, follow no setpoint, and are enabled again only
    /// after an exchange with `enable = 0`, or with `reset = 1`. Fine loop: no allocation.
    fn quick_stop(&mut self);

    /// Leaves the drives without torque and ends what [`Driver::start`] began; what [`Driver::open`] claimed is kept, for `start` may
    /// follow. Host; may allocate.
    ///
    /// # Errors
    /// What could not be released or written: a run that was good so far ends with this as its fault.
    fn stop(&mut self) -> Result<(), PluginError>;

    /// What a fault code of the drive of `joint` means, in words without the code itself; no words where it is not known.
    /// Drives of several makers on one bus give one code different meanings. Host, between exchanges or after them; may
    /// allocate. A driver whose drives have no codes leaves it out.
    fn explain(&self, _joint: u32, _code: u32) -> Words {
        Words::default()
    }
}
