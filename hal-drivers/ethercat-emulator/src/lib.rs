//! EtherCAT drives (CiA 402) and I/O terminals without hardware.
//!
//! [`Bus`] is the devices: a frame goes in, and comes back as they change it. [`Wire`] is a bus behind a cable on which
//! frames take their time and a script of faults happens to them. Neither has a clock or does I/O: every call says what time
//! it is, in ns from power-on, so a test on virtual time is repeatable to the bit. The devices have clocks of their own all
//! the same: their watchdogs, brakes and loops go on in the time that passes, whether frames come or not.
//!
//! The command `tandem-ethercat-emulator` puts a wire on a network interface, in real time.

mod al;
mod blueprint;
mod bus;
mod bytes;
mod description;
mod device;
mod drive;
mod esc;
mod faults;
mod firmware;
mod frame;
mod preset;
mod raw_socket;
mod sii;
mod troubles;
mod wire;

pub use al::{AlCode, AlState};
pub use blueprint::Identity;
pub use bus::{Bus, MAX_FRAME};
pub use description::{
    BusDescription, Clocking, DescriptionError, DeviceDescription, Kind, ObjectDescription, Plug,
    Switch,
};
pub use device::Device;
pub use drive::{Cut, DriveDescription, DriveState};
pub use faults::{BusFault, SdoRefusal, Span, What, When};
pub use firmware::Counters;
pub use frame::{ETHERTYPE, is_ethercat};
pub use raw_socket::{RawError, RawSocket};
pub use wire::Wire;
