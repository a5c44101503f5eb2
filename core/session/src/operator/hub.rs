//! Where all commands come together, and what the operator is told.

use std::sync::atomic::Ordering::{Acquire, Relaxed, Release};
use std::sync::atomic::{AtomicBool, AtomicUsize};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use tandem_host::{Command, awaited_spindle, drive_states, holding_inputs};
use tandem_machine::Machine;
use tandem_recorder::PolicySummary;
use tandem_rings::{Controls, MachineState, Sample, Status};
use tandem_sdk::{Axes, AxisVector};

use crate::jog::{JogController, JogMessage};

use super::status::{Counters, Position, StatusLine};

/// The operator's hub: keys, sockets and whatever else gives commands share one. Soft side; never waits for the fine
/// loop.
pub struct OperatorHub {
    controls: Arc<Controls>,
    status: Arc<Status>,
    machine: Machine,
    axes: Axes,
    max_feed_ratio: f64,
    latest: Mutex<Latest>,
    /// An answer to a program stop: set by a resume, taken by the run.
    go_on: AtomicBool,
    clients: AtomicUsize,
    /// What a session in fault waits for: set by a reset, taken by the session.
    reset: AtomicBool,
    /// Where jogs are asked for, in a session that jogs.
    jogs: Option<Arc<JogController>>,
}

/// What the recorder last saw.
#[derive(Debug)]
struct Latest {
    position: AxisVector,
    /// The fine period of that position.
    tick: u64,
    /// Nothing has moved in the period of that position, as far as it is known.
    rests: bool,
    sigma: f64,
    progress: f64,
    /// Line on which the program waits for the operator.
    waits_on_line: Option<u32>,
    fault: Option<String>,
    stopped: Option<String>,
    /// The session stands in that fault until somebody takes it back.
    waits_for_reset: bool,
    ended: bool,
    policy: Option<PolicySummary>,
}

impl OperatorHub {
    /// The hub of a run on `machine`. Host; allocates.
    pub fn new(machine: &Machine, controls: Arc<Controls>, status: Arc<Status>) -> Self {
        let latest = Latest {
            position: machine.start,
            tick: 0,
            rests: true,
            sigma: 1.0,
            progress: 0.0,
            waits_on_line: None,
            fault: None,
            stopped: None,
            waits_for_reset: false,
            ended: false,
            policy: None,
        };
        Self {
            controls,
            status,
            machine: machine.clone(),
            axes: machine.axes,
            max_feed_ratio: machine.motion.max_feed_ratio,
            latest: Mutex::new(latest),
            go_on: AtomicBool::new(false),
            clients: AtomicUsize::new(0),
            reset: AtomicBool::new(false),
            jogs: None,
        }
    }

    /// The hub of a session that jogs.
    #[must_use]
    pub fn with_jogs(self, jogs: Arc<JogController>) -> Self {
        Self {
            jogs: Some(jogs),
            ..self
        }
    }

    /// Gives a command: the one way to the fine loop for keys and sockets. It acts in the next fine period. The answer is
    /// the number of that period, at the latest the one after it.
    ///
    /// # Errors
    /// What the machine does not allow; nothing has changed.
    pub fn give(&self, command: Command) -> Result<u64, String> {
        self.check(command)?;
        if command == Command::Resume {
            self.go_on.store(true, Release);
        }
        if command == Command::Reset {
            self.reset.store(true, Release);
        }
        command.give(&self.controls);
        if let (Command::Abort, Some(jogs)) = (command, &self.jogs) {
            jogs.forget();
        }
        Ok(self.now())
    }

    /// Asks for a jog, or keeps one alive; without words, lets go of what moves. The answer is that of [`OperatorHub::give`].
    ///
    /// # Errors
    /// Nothing is jogged here, or the jog is refused; nothing has changed.
    pub fn jog(&self, words: Option<&JogMessage>) -> Result<u64, String> {
        let jogs = self
            .jogs
            .as_ref()
            .ok_or("nothing is jogged here: tandem jog does")?;
        match words {
            Some(words) => jogs.ask(words.on(&self.axes)?)?,
            None => jogs.let_go(),
        }
        Ok(self.now())
    }

    /// Number of the next fine period.
    pub fn now(&self) -> u64 {
        self.status.tick.load(Relaxed)
    }

    fn check(&self, command: Command) -> Result<(), String> {
        if command == Command::Resume
            && let Some(names) = holding_inputs(&self.machine, self.status.tripped.load(Relaxed))
        {
            return Err(format!(
                "{names} still holds the machine: resume when it is closed"
            ));
        }
        match command {
            Command::Reset => self.check_reset(),
            Command::StallRough(_) => {
                Err("stall-rough is for tests, from a command file".to_string())
            }
            command => command.check(self.max_feed_ratio),
        }
    }

    /// A fault can be taken back where a session stands in it, and nowhere else.
    fn check_reset(&self) -> Result<(), String> {
        if self.latest().waits_for_reset {
            return Ok(());
        }
        let words = match MachineState::from_number(self.status.state.load(Relaxed)) {
            MachineState::Stopping => "the machine is still being brought to rest",
            MachineState::Fault => {
                "the fault ends this run: the next one resets the drives with --reset"
            }
            _ => "there is no fault to reset",
        };
        Err(words.to_string())
    }

    /// Another job of a machine that stays begins, or its fault is taken back: what was said of the one before is over. Host.
    pub fn begin_job(&self) {
        let mut latest = self.latest();
        latest.fault = None;
        latest.stopped = None;
        latest.waits_on_line = None;
        latest.waits_for_reset = false;
        latest.ended = false;
        self.rest(&mut latest);
        latest.progress = 0.0;
        latest.sigma = 1.0;
        drop(latest);
        self.go_on.store(false, Release);
    }

    /// The machine stands at `position`, mm or rad, though no sample says so. Host.
    pub fn stands_at(&self, position: &AxisVector) {
        let mut latest = self.latest();
        latest.position = *position;
        self.rest(&mut latest);
    }

    /// Nothing moves, and no sample is to come that says so.
    fn rest(&self, latest: &mut Latest) {
        latest.tick = 0;
        latest.rests = true;
        self.status.rests_from_tick.store(0, Relaxed);
    }

    /// Where the machine is by the last sample, mm or rad.
    pub fn position(&self) -> AxisVector {
        self.latest().position
    }

    /// The session stands in `fault`: from now on a reset is taken. Host.
    pub fn begin_fault(&self, fault: &str) {
        let mut latest = self.latest();
        latest.fault = Some(fault.to_string());
        latest.waits_for_reset = true;
    }

    /// Whether somebody has taken back the fault that the session stands in. Host.
    pub fn is_reset(&self) -> bool {
        self.reset.swap(false, Acquire)
    }

    /// The highest feed override that the machine allows.
    pub fn max_feed_ratio(&self) -> f64 {
        self.max_feed_ratio
    }

    /// The operator's atomics, for a job to come.
    pub(crate) fn shared_controls(&self) -> Arc<Controls> {
        Arc::clone(&self.controls)
    }

    /// The operator's atomics as they stand.
    pub fn controls(&self) -> &Controls {
        &self.controls
    }

    /// A sample was sent; `progress` is the share of the program's path that is driven. Host.
    pub fn sample(&self, sample: &Sample, progress: f64) {
        let mut latest = self.latest();
        latest.position = sample.command;
        latest.tick = sample.tick;
        latest.sigma = sample.sigma;
        latest.progress = progress;
        latest.rests = sample.feed_mm_per_s == 0.0 && sample.state != MachineState::Stopping;
    }

    /// What the policy script did until now. Host; allocates.
    pub fn policy(&self, summary: &PolicySummary) {
        self.latest().policy = Some(summary.clone());
    }

    /// The program waits on `line`: from now on a resume answers. Host.
    pub fn begin_wait(&self, line: u32) {
        self.go_on.store(false, Release);
        self.latest().waits_on_line = Some(line);
    }

    /// Whether the operator has said to go on since the program began to wait; then the wait is over. Host.
    pub fn answered(&self) -> bool {
        let answered = self.go_on.swap(false, Acquire);
        if answered {
            self.end_wait();
        }
        answered
    }

    /// The program goes on, whoever said so. Host.
    pub fn end_wait(&self) {
        self.latest().waits_on_line = None;
    }

    /// Whether a stop for good is on its way: an abort or an emergency stop.
    pub fn is_stopping(&self) -> bool {
        [
            &self.controls.abort,
            &self.controls.emergency_stop,
            &self.controls.soft_fault,
        ]
        .iter()
        .any(|s| s.load(Relaxed))
    }

    /// Whether all axes stand, where [`OperatorHub::position`] says.
    pub fn is_at_rest(&self) -> bool {
        self.rests_as_of(&self.latest())
    }

    /// Whether the fine loop stands, and what was seen of it is as new: samples come some periods later than its word.
    fn rests_as_of(&self, latest: &Latest) -> bool {
        let status = &self.status;
        let stands = match MachineState::from_number(status.state.load(Relaxed)) {
            // What was fed last says nothing of these.
            MachineState::Standstill | MachineState::Fault | MachineState::Disabled => true,
            // Off the path, which is fed no more.
            MachineState::Stopping => false,
            // A drive that homes by itself moves though nothing is fed.
            MachineState::Running | MachineState::Holding | MachineState::Starved => {
                status.feed_mm_per_s.load() == 0.0 && !drive_states::is_homing(status)
            }
        };
        stands && latest.rests && latest.tick >= status.rests_from_tick.load(Relaxed)
    }

    /// The line on which the program waits, if it does.
    pub fn waits_on_line(&self) -> Option<u32> {
        self.latest().waits_on_line
    }

    /// The run is over: by a `fault`, `stopped` by the operator, or because all is done. Host.
    pub fn end(&self, fault: Option<&str>, stopped: Option<&str>) {
        let mut latest = self.latest();
        latest.fault = fault.map(str::to_string);
        latest.stopped = stopped.map(str::to_string);
        latest.ended = true;
        latest.waits_for_reset = false;
    }

    /// Clients that could give commands over a socket now.
    pub fn clients(&self) -> usize {
        self.clients.load(Relaxed)
    }

    pub(super) fn set_clients(&self, count: usize) {
        self.clients.store(count, Relaxed);
    }

    /// The machine as it is now, for looking at. Allocates.
    pub fn status(&self) -> StatusLine {
        let status = &self.status;
        let controls = &self.controls;
        let latest = self.latest();
        let state = MachineState::from_number(status.state.load(Relaxed));
        StatusLine {
            state: if latest.fault.is_some() {
                MachineState::Fault
            } else {
                state
            }
            .name(),
            tick: status.tick.load(Relaxed),
            line: status.line.load(Relaxed),
            position: Position::new(&self.axes, &latest.position),
            feed_mm_per_min: if latest.ended {
                0.0
            } else {
                status.feed_mm_per_s.load() * 60.0
            },
            at_rest: latest.ended || self.rests_as_of(&latest),
            sigma: latest.sigma,
            feed_override: controls.feed_override.load(),
            rapid_override: controls.rapid_override.load(),
            hold: controls.hold.load(Relaxed),
            single_block: controls.single_block.load(Relaxed),
            optional_stop: controls.optional_stop.load(Relaxed),
            waits_on_line: latest.waits_on_line,
            progress: latest.progress,
            counters: Counters::of(status),
            policy: latest.policy.clone(),
            joints: drive_states::lines(&self.machine, status),
            enabling: drive_states::enabling(&self.machine, status),
            waits_for: awaited_spindle(status),
            held_by: holding_inputs(&self.machine, status.tripped.load(Relaxed)),
            fault: latest.fault.clone(),
            stopped: latest.stopped.clone(),
        }
    }

    fn latest(&self) -> MutexGuard<'_, Latest> {
        // What lies in it is whole after every statement: a panic elsewhere does not spoil it.
        self.latest.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
