//! EtherCAT drives (CiA 402) and terminals: the driver `ethercat`.
//!
//! `ethercrab` brings the bus up; the exchange of a period is one frame of this driver's own, whose number no late or foreign
//! reply has, and in which each device has a working counter of its own. `docs/ethercat.md` tells how a machine is set up;
//! with `interface = "emulated"` the whole runs on `tandem-ethercat-emulator` in this process, on either clock.

#![allow(clippy::large_futures, reason = "the futures of ethercrab hold its group of devices")]

mod bring_up;
mod bus;
mod check;
mod coe;
mod cyclic;
mod drive;
mod driver;
mod link;
mod map;
mod master;
mod options;
mod probe;
mod time;
mod words;

pub use bring_up::Identity;
pub use bus::Counters;
pub use driver::EthercatDrives;
pub use options::{
    AnalogOptions, CodeOptions, DeviceOptions, Encoder, HomingOptions, MapBy, Mode, Options, ProbeOptions, SpindleMode,
    SpindleOptions, StartupOptions, Sync,
};

tandem_sdk::plugin!(driver "ethercat" = EthercatDrives::new);
