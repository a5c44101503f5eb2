//! The commands as clients of a controller.

mod connection;
mod find;
mod home;
mod jog;
mod looks;
mod mdi;
mod panel;
mod run;
mod work;

pub use home::home;
pub use jog::jog;
pub use looks::{ask, status};
pub use mdi::mdi;
pub use run::run;
