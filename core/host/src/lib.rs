//! The host: plugins by name, both loops on a clock, what they did as numbers.
//!
//! [`Run::prepare`] reads nothing but the machine and the program, checks the whole program, and refuses before
//! anything moves. [`Run::virtual_clock`] and [`Run::wall_clock`] drive the same two loops.

mod block_times;
mod claim;
mod command;
mod command_file;
mod command_log;
#[cfg(test)]
#[path = "../../../tests/counting_allocator.rs"]
mod counting_allocator;
mod curve_watch;
mod density;
mod drives;
mod dry_run;
mod error;
mod exchange_time;
mod fault_text;
mod hang;
mod homing;
pub mod jog;
mod joint_words;
mod joints;
mod lateness;
mod lines;
mod loading;
mod manual;
mod monitor;
pub mod operator;
mod path_watch;
mod phase;
mod plugin_log;
mod policy;
mod pump;
mod ready;
mod realtime;
mod realtime_latency;
mod realtime_periods;
mod record;
mod registry;
mod roles;
mod rules;
mod run;
mod setup;
mod spindle;
mod stand_in;
mod stops;
mod strategy;
mod summarise;
mod summary;
mod virtual_clock;
mod waits;
mod wall_clock;
mod worst;

pub use block_times::{BlockTimes, TimeGoesTo};
pub use command::{Command, Timed};
pub use command_file::parse_commands;
pub use curve_watch::{CurveWatch, OnCurve};
pub use drives::attached_driver;
pub use error::HostError;
pub use hang::at_hang;
pub use joints::JointPeaks;
pub use lateness::{Lateness, Row};
pub use loading::load as load_plugins;
pub use manual::{Dialogue, NextLine, Session};
pub use monitor::Monitor;
pub use plugin_log::drain_plugin_log;
pub use policy::{PolicySetup, PolicySummary};
pub use pump::{RunObserver, StopAnswer};
pub use ready::{check_program, each_block};
pub use realtime::PageFaults;
pub use realtime_latency::{Latency, measure_latency};
pub use realtime_periods::Timing;
pub use record::{
    BlocksCsv, EventsCsv, Output, RecordError, SWITCHED_COLUMNS, TraceCsv, flush_outputs, outputs_word, rpm,
};
pub use registry::{PluginRefusal, Registry};
pub use run::{Clock, Outcome, Run, Switches};
pub use setup::moves_metal;
pub use stand_in::with_stand_ins;
pub use stops::Stop;
pub use summary::{
    ExchangeUs, FORMAT as SUMMARY_FORMAT, LatenessUs, OfLimit, OfLimits, PlanningRow, PlanningUs, Summary,
};
pub use tandem_fine::Left;
