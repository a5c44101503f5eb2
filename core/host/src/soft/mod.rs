//! The soft side of a run: the rough loop and all that is asked and told beside it, once a rough period.

pub mod command;
pub mod command_file;
pub mod command_log;
pub mod soft_loop;
pub mod strategy;
pub mod waits;
