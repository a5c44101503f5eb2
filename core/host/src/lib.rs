//! The host: plugins by name, joints, both loops on a clock, and what they did as numbers.
//!
//! [`Run::prepare`] reads nothing but the machine and the program, checks the whole program, and refuses before
//! anything moves. [`Run::drive`] hands the two loops to a clock.
//!
//! The modules, each of which needs only those before it:
//!
//! 1. `error`, `switches`: why a run does not start, and what it is asked for
//! 2. `plugins`: the registry, libraries, the log that plugins write to, and a watch over calls that do not come back
//! 3. `joints`: what the drives move, their limits and their travel
//! 4. `drives`: the drivers of a machine as the one that the fine loop calls
//! 5. `messages`: faults, drives, inputs and the spindle in words
//! 6. `policy`: the policy script
//! 7. `soft`: the soft loop with commands, feed strategy and observer
//! 8. `clock`: lockstep, and real time
//! 9. `setup`: from a machine and a program to everything that a run needs
//! 10. `run`: one run
//! 11. `resident`: a machine that stays, and drives job after job

mod clock;
#[cfg(test)]
#[path = "../../../tests/counting_allocator.rs"]
mod counting_allocator;
mod drives;
mod error;
mod joints;
mod messages;
mod plugins;
mod policy;
mod resident;
mod run;
mod setup;
mod soft;
mod switches;

pub use clock::latency::{Latency, measure_latency};
pub use clock::periods::Timing;
pub use drives::attached_driver;
pub use error::HostError;
pub use joints::apart::Apart;
pub use messages::drive_states;
pub use messages::roles::holding as holding_inputs;
pub use messages::spindle::awaited as awaited_spindle;
pub use plugins::hang::at_hang;
pub use plugins::loading::load as load_plugins;
pub use plugins::plugin_log::drain_plugin_log;
pub use plugins::registry::{PluginRefusal, Registry, moves_metal};
pub use policy::PolicySetup;
pub use resident::{JobOutcome, PreparedJob, Resident};
pub use run::{Outcome, Run};
pub use setup::commands::with_user_commands;
pub use setup::parts::{as_dry_run, axis_limits, interpreter_config, planner, strategy_signals};
pub use setup::ready::{Memory, check_block, check_program, each_block};
pub use setup::stand_in::with_stand_ins;
pub use soft::command::{Command, Timed};
pub use soft::command_file::parse_commands;
pub use soft::soft_loop::{RunObserver, StopAnswer};
pub use switches::{Clock, Lead, Switches};
pub use tandem_fine::Left;
pub use tandem_policy::Parameter as PolicyParameter;
