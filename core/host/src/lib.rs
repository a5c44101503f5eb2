//! The host: plugins by name, both loops on a clock, what they did as numbers.
//!
//! [`Run::prepare`] reads nothing but the machine and the program, checks the whole program, and refuses before
//! anything moves. [`Run::virtual_clock`] and [`Run::wall_clock`] drive the same two loops.

mod claim;
mod command;
mod command_file;
mod command_log;
#[cfg(test)]
#[path = "../../../tests/counting_allocator.rs"]
mod counting_allocator;
mod density;
mod drives;
mod dry_run;
mod error;
mod exchange_time;
mod fault_text;
mod hang;
pub mod joint_words;
mod joints;
mod lines;
mod loading;
mod phase;
mod plugin_log;
mod policy;
mod pump;
mod ready;
mod realtime;
mod realtime_latency;
mod realtime_periods;
mod registry;
mod roles;
mod rules;
mod run;
mod setup;
mod spindle;
mod stand_in;
mod strategy;
mod summarise;
mod virtual_clock;
mod waits;
mod wall_clock;

pub use command::{Command, Timed};
pub use command_file::parse_commands;
pub use drives::attached_driver;
pub use error::HostError;
pub use hang::at_hang;
pub use loading::load as load_plugins;
pub use plugin_log::drain_plugin_log;
pub use policy::PolicySetup;
pub use pump::{RunObserver, StopAnswer};
pub use ready::{check_block, check_program, each_block};
pub use realtime_latency::{Latency, measure_latency};
pub use realtime_periods::Timing;
pub use registry::{PluginRefusal, Registry};
pub use roles::holding as holding_inputs;
pub use run::{Clock, Lead, Outcome, Run, Switches};
pub use setup::{axis_limits, interpreter_config, moves_metal, planner};
pub use spindle::awaited as awaited_spindle;
pub use stand_in::with_stand_ins;
pub use tandem_fine::Left;
