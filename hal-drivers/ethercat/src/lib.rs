//! EtherCAT drives (CiA 402) and terminals: the driver `ethercat`.
//!
//! `ethercrab` brings the bus up; the exchange of a period is one frame of this driver's own, whose number no late or foreign
//! reply has, and in which each device has a working counter of its own. `docs/ethercat.md` tells how a machine is set up;
//! with `interface = "emulated"` the whole runs on `tandem-ethercat-emulator` in this process, on either clock.

#![allow(
    clippy::large_futures,
    reason = "the futures of ethercrab hold its group of devices"
)]

mod bring_up;
mod bus;
mod check;
mod clock;
mod coe;
mod cyclic;
mod drive;
mod driver;
mod link;
mod mailboxes;
mod map;
mod master;
mod member;
mod options;
mod probe;
mod reactions;
mod recorder;
mod requests;
mod survey;
mod time;
mod words;

pub use bring_up::Identity;
pub use bus::Counters;
pub use driver::EthercatDrives;
pub use options::{
    AnalogOptions, CodeOptions, DeviceOptions, Encoder, HomingOptions, MapBy, Mode, Options,
    ProbeOptions, ReactionOptions, SpindleMode, SpindleOptions, StartupOptions, Sync,
};
pub use requests::{Request, ask_whoever_drives};
pub use survey::{Found, Object, State, Survey, Value, Watch, Watched, context_of, watch};

/// Index and sub-index of an object as people write it, `0x6085` or `0x6099:1`. Any loop; does not allocate.
pub fn object(text: &str) -> Option<(u16, u8)> {
    options::object(text)
}

/// A number as people write it, `0x0402` or `1026`. Any loop; does not allocate.
pub fn number(text: &str) -> Option<u32> {
    options::number(text)
}

tandem_sdk::plugin!(driver "ethercat" = EthercatDrives::new);
