//! The command line.

mod batch;
#[cfg(feature = "ethercat")]
mod bus;
mod machine;
mod machine_source;
mod plugin;
mod state;
mod trace;

use std::net::SocketAddr;
use std::path::PathBuf;

use clap::{Args as Group, Parser, Subcommand, ValueEnum};
use tandem_session::operator::Role;

#[cfg(feature = "nats")]
pub use batch::Worker;
pub use batch::{Batch, BatchFolder, Nats, Submit, Tune};
#[cfg(feature = "ethercat")]
pub use bus::{Bus, Sdo, Which};
pub use machine::{Format, ImportMachine, MachineCommand, NewMachine};
pub use machine_source::{Connect, MachineSource};
pub use plugin::{Kind, Plugin};
pub use state::{Files, Of, State};
pub use trace::Trace;

/// Tandem, an open CNC motion controller.
#[derive(Parser)]
#[command(
    version,
    about,
    after_help = "Exit status: 0 done, 1 refused (nothing moved), 2 usage, 3 fault or stop while running, or a file not complete."
)]
pub struct Args {
    #[command(subcommand)]
    pub command: Command,
}

#[derive(Subcommand)]
pub enum Command {
    /// Run a part program
    Run(Box<Run>),
    /// List every error of a part program, and what a run would refuse of the machine; nothing moves, no drive is claimed
    Check(Check),
    /// Take lines of G-code from the keyboard or a pipe, each from where the machine stands; quit or exit ends
    Mdi(Box<Mdi>),
    /// Home the axes, as the machine file says
    Home(Home),
    /// Move single axes by hand: with keys, over a socket, or by lines of a pipe; q, or the line quit, ends
    Jog(Box<Jog>),
    /// Stay: one process that keeps drives, offsets and tools, and takes programs, lines, jogs and homing from its clients
    Serve(Box<Serve>),
    /// Say in one line what a controller's machine does
    Status(Status),
    /// Send one request to a controller, and print the answer
    Ask(Ask),
    /// Say how long part programs take; nothing moves
    Estimate(Estimate),
    /// Find out by an experiment how a control takes its time, for estimates
    Calibrate(Calibrate),
    /// Find the settings of a machine that are best for some programs, by simulating them
    Tune(Tune),
    /// Simulate many programs with many settings on many machines
    #[command(subcommand)]
    Batch(Batch),
    /// Find inertia and friction of an axis by air runs, for the feed strategy force-control
    Identify(Identify),
    /// Look into traces: export, info, diff
    #[command(subcommand)]
    Trace(Trace),
    /// Make, build, check and measure policy scripts
    #[command(subcommand)]
    Script(Script),
    /// List plugins and their options; make and check plugins of one's own
    #[command(subcommand)]
    Plugin(Plugin),
    /// Look at an EtherCAT bus: its devices, states, objects and frames; nothing is enabled
    #[cfg(feature = "ethercat")]
    #[command(subcommand)]
    Bus(Bus),
    /// Measure how late the fine loop wakes on this computer, as a histogram
    Latency(Latency),
    /// Look at what lasts of a machine, and exchange it with LinuxCNC
    #[command(subcommand)]
    State(State),
    /// Write a machine file: from options or answers, or from what another control has
    #[command(subcommand)]
    Machine(MachineCommand),
    /// Print what a shell completes on the command line
    Completions {
        /// The shell
        shell: clap_complete::Shell,
    },
    /// Print the manual page
    Man,
}

#[derive(Group)]
pub struct MachineFile {
    /// The machine file
    #[arg(long = "machine", value_name = "M.toml")]
    pub path: PathBuf,
    /// Override a key of the machine file, as in planner.plugin=look-ahead
    #[arg(long = "set", value_name = "KEY=VALUE", value_parser = key_value)]
    pub overrides: Vec<(String, String)>,
}

#[derive(Group)]
pub struct Machine {
    #[command(flatten)]
    pub file: MachineFile,
    /// Leave out the lines that begin with /
    #[arg(long)]
    pub block_delete: bool,
}

/// How a machine is kept ready for what comes while it runs.
#[derive(Group)]
pub struct Session {
    /// The clock that drives the loops
    #[arg(long, default_value = "wall")]
    pub clock: Clock,
    /// Home the axes first, and after every fault, as the machine file says
    #[arg(long)]
    pub home: bool,
    /// Reset faults in which drives stand before they are enabled
    #[arg(long)]
    pub reset: bool,
    #[command(flatten)]
    pub operator: Operator,
    /// Write every sample; a name that ends in .ttr asks for the binary format
    #[arg(long, value_name = "F.csv|F.ttr", value_parser = file_name)]
    pub trace: Option<PathBuf>,
}

impl Session {
    /// The options that concern a process with drives of its own, and whether they are given.
    pub fn of_own_drives(&self) -> [(bool, &'static str); 4] {
        [
            (self.clock != Clock::Wall, "--clock"),
            (self.trace.is_some(), "--trace"),
            (self.operator.listen.is_some(), "--listen"),
            (self.operator.listen_tcp.is_some(), "--listen-tcp"),
        ]
    }
}

#[derive(Group)]
#[allow(
    clippy::struct_excessive_bools,
    reason = "each is a switch of the command line"
)]
pub struct Run {
    /// The part program; - drives lines of standard input as they come
    pub program: PathBuf,
    #[command(flatten)]
    pub place: MachineSource,
    /// Leave out the lines that begin with /
    #[arg(long)]
    pub block_delete: bool,
    /// The clock that drives the loops; without it that of the driver: virtual for simulated drives, wall for real ones
    #[arg(long)]
    pub clock: Option<Clock>,
    /// Home the axes first, as the machine file says
    #[arg(long)]
    pub home: bool,
    /// Reset faults in which drives stand before they are enabled
    #[arg(long)]
    pub reset: bool,
    /// Wait for Enter at M0, M1 and M6 instead of logging them
    #[arg(long)]
    pub pause: bool,
    /// Turn the optional stop on: wait for Enter at M1
    #[arg(long)]
    pub optional_stop: bool,
    /// Move as the program says, at the dry-run feed of the machine; switch no spindle, coolant or output, wait for nobody
    #[arg(long = "dry-run", conflicts_with_all = ["pause", "optional_stop"])]
    pub dry: bool,
    /// Give the operator's commands of a file, a line each: tick,command[,value] (virtual clock)
    #[arg(long, value_name = "F.csv")]
    pub commands: Option<PathBuf>,
    #[command(flatten)]
    pub operator: Operator,
    /// Write every sample; a name that ends in .ttr asks for the binary format. - is standard output, here and for one of
    /// the five files below; what the run says goes to standard error then
    #[arg(long, value_name = "F.csv|F.ttr")]
    pub trace: Option<PathBuf>,
    /// Write the summary
    #[arg(long, value_name = "F.json")]
    pub summary: Option<PathBuf>,
    /// Draw the run
    #[arg(long, value_name = "F.html")]
    pub report: Option<PathBuf>,
    /// Write every block as it was driven
    #[arg(long, value_name = "F.csv")]
    pub blocks: Option<PathBuf>,
    /// Write the motion by rough periods: the displacement of every axis, and the feed at both ends
    #[arg(long, value_name = "F.csv")]
    pub rough: Option<PathBuf>,
    /// Write every switch of spindle, coolant and outputs, and what switched: program, abort, fault or emergency stop
    #[arg(long, value_name = "F.csv")]
    pub events: Option<PathBuf>,
    /// Say how the time of the run compares with the best known time of this program
    #[arg(long, value_name = "SECONDS", value_parser = positive, allow_negative_numbers = true)]
    pub reference_time_s: Option<f64>,
}

#[derive(Group)]
pub struct Operator {
    /// Take operator commands, and tell the status, as JSON lines at a unix socket that only you can reach
    #[arg(long, value_name = "PATH")]
    pub listen: Option<PathBuf>,
    /// The same over TCP, on this computer alone
    #[arg(long, value_name = "127.0.0.1:PORT", requires = "token_file")]
    pub listen_tcp: Option<SocketAddr>,
    /// The token that clients over TCP name first; a random one is made where the file does not exist
    #[arg(long, value_name = "F", requires = "listen_tcp")]
    pub token_file: Option<PathBuf>,
    /// A token like it for clients that drive the machine and do not change what lasts
    #[arg(long, value_name = "F")]
    pub operate_token_file: Option<PathBuf>,
    /// A token like it for clients that look, and stop the machine
    #[arg(long, value_name = "F")]
    pub watch_token_file: Option<PathBuf>,
}

#[derive(Group)]
pub struct Serve {
    #[command(flatten)]
    pub machine: MachineFile,
    /// The file in which offsets, parameters and tools last; where it lies otherwise, docs/controller.md says
    #[arg(long, value_name = "FILE.sqlite")]
    pub state: Option<PathBuf>,
    /// Keep nothing beyond this process
    #[arg(long, conflicts_with = "state")]
    pub no_state: bool,
    #[command(flatten)]
    pub operator: Operator,
    /// Let in senders that speak grbl's protocol, over TCP on this computer
    #[arg(long, value_name = "127.0.0.1:PORT")]
    pub grbl_tcp: Option<SocketAddr>,
    /// Let in such senders at a terminal of our own, to which PATH becomes a link
    #[arg(long, value_name = "PATH")]
    pub grbl_pty: Option<PathBuf>,
    /// The folder of the programs that clients may load by their path
    #[arg(long, value_name = "FOLDER")]
    pub programs: Option<PathBuf>,
    /// Serve the operator's page to browsers on this computer; the address that is printed opens it
    #[cfg(feature = "web")]
    #[arg(long, value_name = "127.0.0.1:PORT")]
    pub http: Option<SocketAddr>,
    /// The file of the token that opens the page, made where it does not exist; without it a token is good for this process
    #[cfg(feature = "web")]
    #[arg(long, value_name = "F", requires = "http")]
    pub http_token_file: Option<PathBuf>,
    /// A name, with a port where it is another one, by which browsers ask for the page through a proxy of yours
    #[cfg(feature = "web")]
    #[arg(long, value_name = "NAME", requires = "http")]
    pub http_host: Vec<String>,
    /// Leave trace, blocks, events and summary of every job in a folder of its own below this one
    #[arg(long, value_name = "FOLDER")]
    pub record: Option<PathBuf>,
    /// Enable real drives at once; simulated ones are enabled without it
    #[arg(long)]
    pub enable: bool,
    /// Leave the drives disabled until a client enables them
    #[arg(long, conflicts_with = "enable")]
    pub disabled: bool,
    /// The clock; virtual replays --requests, exactly and as fast as the processor allows
    #[arg(long, default_value = "wall")]
    pub clock: Clock,
    /// What clients ask, by fine periods: JSON lines as docs/controller.md has them
    #[arg(long, value_name = "F.jsonl")]
    pub requests: Option<PathBuf>,
    /// Writes what clients say, by fine periods, for --requests of a replay
    #[arg(long, value_name = "F.jsonl", conflicts_with = "requests")]
    pub arrivals: Option<PathBuf>,
    /// For tests: fine periods that are counted before the first
    #[arg(long, value_name = "N", default_value = "0", hide = true)]
    pub uptime_periods: u64,
}

#[derive(Group)]
pub struct Status {
    #[command(flatten)]
    pub controller: Connect,
    /// Go on, a line whenever it is another
    #[arg(long)]
    pub watch: bool,
}

#[derive(Group)]
pub struct Ask {
    #[command(flatten)]
    pub controller: Connect,
    /// The request, as in mdi, start, home
    pub request: String,
    /// What goes with it, as in line='G0 X5'
    #[arg(value_name = "KEY=VALUE", value_parser = key_value)]
    pub with: Vec<(String, String)>,
}

#[derive(Group)]
pub struct Mdi {
    #[command(flatten)]
    pub place: MachineSource,
    /// Leave out the lines that begin with /
    #[arg(long)]
    pub block_delete: bool,
    #[command(flatten)]
    pub session: Session,
}

#[derive(Group)]
pub struct Jog {
    #[command(flatten)]
    pub place: MachineSource,
    #[command(flatten)]
    pub session: Session,
}

#[derive(Group)]
pub struct Check {
    /// The part program; - reads it from standard input
    pub program: PathBuf,
    #[command(flatten)]
    pub machine: Machine,
    /// As for a run with --home, which a machine that is to be homed first always is
    #[arg(long)]
    pub home: bool,
    /// Where the program is refused, write why, and draw where the tool does not fit
    #[arg(long, value_name = "F.html")]
    pub report: Option<PathBuf>,
}

#[derive(Group)]
pub struct Home {
    #[command(flatten)]
    pub place: MachineSource,
    /// Reset faults in which drives stand before they are enabled
    #[arg(long)]
    pub reset: bool,
    /// Home this axis only
    #[arg(long, value_name = "LETTER")]
    pub axis: Option<char>,
    /// The clock that drives the loops; without it that of the driver: virtual for simulated drives, wall for real ones
    #[arg(long)]
    pub clock: Option<Clock>,
    /// Write every sample, in the coordinates of the drives
    #[arg(long, value_name = "F.csv|F.ttr")]
    pub trace: Option<PathBuf>,
    /// Draw the motion, in the coordinates of the drives
    #[arg(long, value_name = "F.html")]
    pub report: Option<PathBuf>,
}

#[derive(Group)]
pub struct Estimate {
    /// The part programs; several are estimated at once
    #[arg(required = true)]
    pub programs: Vec<PathBuf>,
    #[command(flatten)]
    pub machine: Machine,
    /// The model: simulate, look-ahead, overlap, regression, or the file that calibrate wrote
    #[arg(long, value_name = "NAME|FILE.toml", default_value = "simulate")]
    pub model: String,
    /// Write a list for programs instead of a table for people
    #[arg(long)]
    pub json: bool,
    /// Say how the estimates compare with what was measured: the columns program, seconds and reading_error_s of a CSV file
    #[arg(long, value_name = "F.csv")]
    pub measured: Option<PathBuf>,
    /// Draw the length of the blocks against the feed reached in them
    #[arg(long, value_name = "F.html", value_parser = file_name)]
    pub report: Option<PathBuf>,
}

#[derive(Group)]
pub struct Calibrate {
    #[command(flatten)]
    pub machine: Machine,
    /// Write the model
    #[arg(long, value_name = "MODEL.toml", required_unless_present = "program", value_parser = file_name)]
    pub out: Option<PathBuf>,
    /// Fit to the times of a file instead of an experiment; - is what is typed in; docs/machining-time.md has its columns
    #[arg(long, value_name = "F.csv")]
    pub from: Option<PathBuf>,
    /// Minimum feeds of V paths that were read at the other control, for the regression
    #[arg(long, value_name = "F.csv", requires = "from")]
    pub corners: Option<PathBuf>,
    /// Fit to the log of a control that has driven what --program writes: the columns t_s and line of a CSV file, such as a trace
    #[arg(long, value_name = "F.csv", conflicts_with_all = ["from", "program"])]
    pub log: Option<PathBuf>,
    /// Only write the experiment as a program, to be run and timed at another control
    #[arg(long, value_name = "F.ngc", conflicts_with_all = ["out", "from", "model"], value_parser = file_name)]
    pub program: Option<PathBuf>,
    /// Fit this form instead of the one that fits best
    #[arg(long)]
    pub model: Option<Form>,
    /// Take the fit though it is worse than what is asked for; the model file says by how much
    #[arg(long, conflicts_with = "program")]
    pub accept: bool,
    /// The clock that drives the experiment; without it that of the driver: virtual for simulated drives, wall for real ones
    #[arg(long)]
    pub clock: Option<Clock>,
}

#[derive(Group)]
pub struct Identify {
    /// The machine file
    #[arg(long = "machine", value_name = "M.toml")]
    pub machine: PathBuf,
    /// Override a key of the machine file
    #[arg(long = "set", value_name = "KEY=VALUE", value_parser = key_value)]
    pub overrides: Vec<(String, String)>,
    /// The axis, which moves through its travel without a cut
    #[arg(long, value_name = "LETTER")]
    pub axis: char,
    /// The file to write, which the machine file includes; beside it and called after machine and axis where left out
    #[arg(long, value_name = "F.toml", value_parser = file_name)]
    pub out: Option<PathBuf>,
    /// The clock that drives the experiment; without it that of the driver: virtual for simulated drives, wall for real ones
    #[arg(long)]
    pub clock: Option<Clock>,
}

/// The forms that can be fitted.
#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Form {
    /// Blocks of at least a constant time
    Overlap,
    /// Junction feeds
    LookAhead,
    /// The published linear regression
    Regression,
    /// The planner smooth with limits and tolerance of its own
    Smooth,
    /// The planner block-overlap with limits and tolerance of its own
    BlockOverlap,
}

#[derive(Group)]
pub struct Latency {
    /// The period, ms
    #[arg(long = "period", value_name = "MS", default_value = "1", value_parser = positive)]
    pub period_ms: f64,
    /// How long to measure, s
    #[arg(long = "duration", value_name = "S", default_value = "10", value_parser = positive)]
    pub duration_s: f64,
    /// Keep every core busy meanwhile
    #[arg(long)]
    pub load: bool,
    /// Draw the histogram
    #[arg(long, value_name = "F.html", value_parser = file_name)]
    pub report: Option<PathBuf>,
    /// Show beside it what `cyclictest -h` has printed by the end of the measurement
    #[arg(long, value_name = "F")]
    pub cyclictest: Option<PathBuf>,
}

#[derive(Subcommand)]
pub enum Script {
    /// Make a folder with a first script and the SDK of its language
    New {
        /// The folder; its last part names the script
        name: PathBuf,
        /// The language
        #[arg(long, default_value = "as")]
        lang: Language,
    },
    /// Build a module from a .ts, a .c, or the folder of a Rust crate
    Build {
        /// The source
        source: PathBuf,
        /// The module to write; beside the source where it is not stated
        #[arg(long, value_name = "F.wasm", value_parser = file_name)]
        out: Option<PathBuf>,
    },
    /// Print what a module is: calls, parameters, memory; try it on a sample
    Check {
        /// The module
        script: PathBuf,
        /// Take parameters and limits from this machine
        #[arg(long, value_name = "M.toml")]
        machine: Option<PathBuf>,
        /// Override a key of the machine file
        #[arg(long = "set", value_name = "KEY=VALUE", value_parser = key_value, requires = "machine")]
        overrides: Vec<(String, String)>,
    },
    /// Measure what a module costs: fuel and time of a call
    Bench {
        /// The module
        script: PathBuf,
        /// Calls to measure
        #[arg(long, default_value = "100000", value_parser = clap::value_parser!(u32).range(1..=100_000_000))]
        calls: u32,
    },
    /// Say which languages can be built on this computer, and what to install for the others
    Doctor,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Language {
    /// TypeScript with the numbers of WASM, compiled by asc
    As,
    /// C
    C,
    /// Rust
    Rust,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Clock {
    /// In lockstep, as fast as the processor allows
    Virtual,
    /// In real time
    Wall,
}

impl Operator {
    /// The files of the tokens that let do less, and what.
    pub fn role_token_files(&self) -> Vec<(PathBuf, Role)> {
        let files = [
            (&self.operate_token_file, Role::Operate),
            (&self.watch_token_file, Role::Watch),
        ];
        files
            .into_iter()
            .filter_map(|(file, role)| Some((file.clone()?, role)))
            .collect()
    }

    /// Why tokens of roles have no door, where they have none.
    pub fn check_tokens(&self, has_page: bool) -> Result<(), String> {
        if has_page || self.listen_tcp.is_some() || self.role_token_files().is_empty() {
            return Ok(());
        }
        Err(
            "--operate-token-file and --watch-token-file go with a door that asks for tokens"
                .into(),
        )
    }

    /// Whether no client can come.
    pub fn is_nowhere(&self) -> bool {
        self.listen.is_none() && self.listen_tcp.is_none()
    }
}

impl From<Clock> for tandem_host::Clock {
    fn from(clock: Clock) -> Self {
        match clock {
            Clock::Virtual => Self::Virtual,
            Clock::Wall => Self::Wall,
        }
    }
}

/// A file to write where standard output carries other text.
fn file_name(text: &str) -> Result<PathBuf, String> {
    if text == "-" {
        return Err("standard output carries other text here: name a file".to_string());
    }
    Ok(text.into())
}

fn key_value(text: &str) -> Result<(String, String), String> {
    let (key, value) = text.split_once('=').ok_or("it has the form key=value")?;
    Ok((key.trim().to_string(), value.to_string()))
}

fn positive(text: &str) -> Result<f64, String> {
    let value = text.parse().ok().filter(|v: &f64| (1e-3..=1e6).contains(v));
    value.ok_or_else(|| "it is a number from 0.001 to 1000000".to_string())
}
