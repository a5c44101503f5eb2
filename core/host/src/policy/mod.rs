//! The policy script of the machine: made from the machine file, asked by the rough loop and once a rough period, loaded
//! anew when its file changes.

mod host;
mod means;
mod reload;
mod setup;
mod tuner;

pub use host::PolicyHost;
pub use means::{Looks, Means};
pub use reload::Reloader;
pub use setup::PolicySetup;
pub use tuner::Tuner;
