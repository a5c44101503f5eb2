//! The `tandem` command: the only crate that prints.

#![allow(
    clippy::doc_markdown,
    reason = "LinuxCNC and EtherCAT are names, not code"
)]

/// A line to standard error. A reader that has gone away is no reason to fail.
macro_rules! say {
    ($($text:tt)*) => {{
        use std::io::Write as _;
        let _ = writeln!(std::io::stderr(), $($text)*);
    }};
}

mod args;
mod batch;
#[cfg(feature = "nats")]
mod batch_nats;
mod broken;
mod built_in;
#[cfg(feature = "ethercat")]
mod bus;
mod calibrate;
mod check;
mod client;
mod clock;
mod corners;
mod curves;
mod estimate;
mod generate;
mod hang;
mod home;
mod identify;
mod jog;
mod latency;
mod machine;
mod mdi;
mod operator;
mod piped;
mod plugin;
mod program;
mod progress;
mod refusal;
mod report;
mod run;
mod script;
mod serve;
mod session_record;
mod state;
mod tolerances;
mod trace;
mod tune;
mod warnings;
#[cfg(feature = "web")]
mod web;

use std::process::ExitCode;

use clap::Parser;

use crate::args::{Args, Command};

/// Exit status: bad input, nothing moved. (0 is done; 2, a wrong command line, is clap's.)
const REFUSED: u8 = 1;
/// Exit status: a fault or stop while running.
const FAULT: u8 = 3;

fn main() -> ExitCode {
    let command = Args::parse().command;
    hang::arrange();
    let status = match command {
        Command::Run(options) => match options.place.controller() {
            Some(at) => client::run(at, &options),
            None => run::run(&options),
        },
        Command::Mdi(options) => match options.place.controller() {
            Some(at) => client::mdi(at, &options),
            None => mdi::mdi(&options),
        },
        Command::Jog(options) => match options.place.controller() {
            Some(at) => client::jog(at, &options),
            None => jog::jog(&options),
        },
        Command::Check(options) => check::check(&options),
        Command::Home(options) => match options.place.controller() {
            Some(at) => client::home(at, &options),
            None => home::home(&options),
        },
        Command::Serve(options) => serve::serve(&options),
        Command::Status(options) => client::status(&options),
        Command::Ask(options) => client::ask(&options),
        Command::Estimate(options) => estimate::estimate(&options),
        Command::Calibrate(options) => calibrate::calibrate(&options),
        Command::Tune(options) => tune::tune(&options),
        Command::Batch(command) => batch::batch(&command),
        Command::Identify(options) => identify::identify(&options),
        Command::Trace(command) => trace::trace(&command),
        Command::Script(command) => script::script(&command),
        Command::Plugin(command) => plugin::plugin(&command),
        #[cfg(feature = "ethercat")]
        Command::Bus(command) => bus::bus(&command),
        Command::Latency(options) => latency::latency(&options),
        Command::State(command) => state::state(&command),
        Command::Machine(command) => machine::machine(&command),
        Command::Completions { shell } => Ok(generate::completions(shell)),
        Command::Man => generate::man().map_err(Into::into),
    };
    // What plugins said before something was refused, or after the last run.
    tandem_host::drain_plugin_log(&mut |line| say!("{line}"));
    ExitCode::from(status.unwrap_or_else(|error| {
        say!("{error}");
        REFUSED
    }))
}
