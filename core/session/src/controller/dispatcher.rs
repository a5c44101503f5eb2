//! Requests of all clients: what is true of the machine and its jobs, and who is told of it.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::io::Write as _;
use std::os::unix::net::UnixStream;
use std::path::PathBuf;
use std::sync::atomic::Ordering::{Acquire, Relaxed, Release};
use std::sync::atomic::{AtomicBool, AtomicI64, AtomicUsize};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::SystemTime;

use serde_json::{Value, json};
use sha2::{Digest, Sha256};
use tandem_gcode::PersistentData;
use tandem_host::JobOutcome;
use tandem_machine::Machine;
use tandem_rings::{MachineState, Status, Switched};
use tandem_sdk::AxisVector;
use tandem_state::{Change, Outcome};

use super::arrivals::Arrivals;
use super::described;
use super::history::{History, alarm_shown};
use super::lines::{Judged, SharedLines, lock};
use super::path::DrawnPath;
use super::persistence::Persistence;
use super::programs::Upload;
use super::scope::Scope;
use super::states::ControllerState;
use crate::jog::{Jog, JogController};
use crate::operator::OperatorHub;

/// Longest program, bytes.
pub const MAX_PROGRAM_BYTES: u64 = 64 << 20;

/// What is driven.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mode {
    /// Nothing; the drives hold, or not.
    Idle,
    /// The drives are on their way to holding.
    Enabling,
    Program,
    Homing,
    Mdi,
    Jog,
}

impl Mode {
    pub fn name(self) -> &'static str {
        match self {
            Self::Idle => "idle",
            Self::Enabling => "enable",
            Self::Program => "program",
            Self::Homing => "home",
            Self::Mdi => "mdi",
            Self::Jog => "jog",
        }
    }
}

/// Who asked, and for which answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RequestId {
    pub client: u64,
    pub id: u64,
}

/// What the loop that drives is to do next.
#[derive(Clone, Debug)]
pub enum Order {
    /// Checks a program, and keeps it for a start where that is asked for.
    Check {
        from: RequestId,
        program: Loaded,
        load: bool,
    },
    Start {
        from: RequestId,
    },
    Mdi,
    /// Lines that are jogs.
    JogLines,
    Jog,
    Home {
        from: RequestId,
        axis: Option<usize>,
    },
    /// Not where an emergency stop has been asked for since, of which there had been so many.
    Enable {
        from: RequestId,
        resets: bool,
        emergency_stops: u64,
    },
    Disable {
        from: RequestId,
    },
    SetPolicyParameter {
        from: RequestId,
        name: String,
        value: f64,
    },
}

impl Order {
    /// Who is answered when it has begun, or will not.
    pub fn from(&self) -> Option<RequestId> {
        match self {
            Self::Check { from, .. }
            | Self::Start { from }
            | Self::Home { from, .. }
            | Self::Enable { from, .. }
            | Self::Disable { from }
            | Self::SetPolicyParameter { from, .. } => Some(*from),
            Self::Mdi | Self::JogLines | Self::Jog => None,
        }
    }

    /// Whether something moves by it, or holds.
    fn moves(&self) -> bool {
        self.drives().is_some() || matches!(self, Self::Enable { .. } | Self::Disable { .. })
    }

    /// What is driven by it; none where it moves nothing.
    fn drives(&self) -> Option<Mode> {
        match self {
            Self::Start { .. } => Some(Mode::Program),
            Self::Home { .. } => Some(Mode::Homing),
            Self::Mdi => Some(Mode::Mdi),
            Self::JogLines | Self::Jog => Some(Mode::Jog),
            _ => None,
        }
    }
}

impl Inner {
    /// What is driven, or is about to be: a program is checked before it begins, and can be held and stopped meanwhile.
    fn mode_to_come(&self) -> Mode {
        let ordered = self.order.as_ref().and_then(Order::drives);
        match self.mode {
            Mode::Idle if self.enabled => ordered.unwrap_or(Mode::Idle),
            mode => mode,
        }
    }

    /// Whether nothing is driven, and something is about to be.
    pub fn is_about_to_move(&self) -> bool {
        self.mode == Mode::Idle && self.mode_to_come() != Mode::Idle
    }
}

/// A program that can be started.
#[derive(Clone, Debug)]
pub struct Loaded {
    pub name: String,
    pub text: Arc<[u8]>,
    /// SHA-256 of the text, as `sha256sum` prints it.
    pub hash: String,
    /// Where every [`LINES_PER_MARK`]th line begins, from the first on, and the number of lines.
    marks: Arc<[usize]>,
    lines: usize,
}

/// Lines from one place that is kept of a text to the next: what is looked through to find one.
const LINES_PER_MARK: usize = 256;
/// Lines of one answer at most, and characters of each: it fits what may wait for a client.
const MAX_LINES: usize = 200;
const MAX_LINE_CHARACTERS: usize = 160;

impl Loaded {
    /// A program, and its hash. Allocates.
    pub fn new(name: String, text: Arc<[u8]>) -> Self {
        let mut hash = String::new();
        for byte in Sha256::digest(&text) {
            let _ = write!(hash, "{byte:02x}");
        }
        let starts = text
            .split_inclusive(|byte| *byte == b'\n')
            .scan(0, |at, line| {
                let start = *at;
                *at += line.len();
                Some(start)
            });
        let mut marks = vec![];
        let mut lines = 0;
        for (number, start) in starts.enumerate() {
            if number.is_multiple_of(LINES_PER_MARK) {
                marks.push(start);
            }
            lines = number + 1;
        }
        Self {
            name,
            text,
            hash,
            marks: marks.into(),
            lines,
        }
    }

    /// `count` lines from line `from` (1 is the first) on, as many of them as one answer holds. Allocates.
    pub fn show(&self, from: u64, count: u64) -> Value {
        let first = usize::try_from(from).unwrap_or(usize::MAX).max(1) - 1;
        let start = self.marks.get(first / LINES_PER_MARK).copied();
        let text = start.map_or(&[][..], |start| &self.text[start..]);
        let lines: Vec<String> = text
            .split(|byte| *byte == b'\n')
            .skip(first % LINES_PER_MARK)
            .take(self.lines.saturating_sub(first))
            .take(usize::try_from(count).unwrap_or(MAX_LINES).min(MAX_LINES))
            .map(|line| {
                let line = line.strip_suffix(b"\r").unwrap_or(line);
                // No character has more than four bytes.
                let part = &line[..line.len().min(4 * MAX_LINE_CHARACTERS)];
                let shown = String::from_utf8_lossy(part);
                shown.chars().take(MAX_LINE_CHARACTERS).collect()
            })
            .collect();
        json!({
            "program": self.name,
            "program_hash": self.hash,
            "from": first + 1,
            "lines": lines,
            "count": self.lines,
        })
    }
}

/// What of the last sample is shown beside its place.
#[derive(Clone, Copy, Debug, Default)]
pub struct Seen {
    /// The block that moves.
    pub block: u64,
    /// Where it ends; none where nothing moves.
    pub end: Option<AxisVector>,
    /// Spindle, coolant and outputs.
    pub switched: Switched,
}

/// Whether a change of what lasts, that a client has asked for, is being written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StateWrite {
    Idle,
    /// It is being written: nothing is begun meanwhile.
    UnderWay,
}

/// What is asked for, and what became of it.
pub struct Inner {
    pub mode: Mode,
    pub enabled: bool,
    pub order: Option<Order>,
    pub unknown_axes: u32,
    pub loaded: Option<Loaded>,
    pub block_delete: bool,
    /// The fault that the machine stands in, and whether it is an emergency stop.
    pub fault: Option<(String, bool)>,
    pub aborting: bool,
    /// So many stops were asked for that end what is driven.
    pub stops: u64,
    /// So many of them are emergency stops.
    pub emergency_stops: u64,
    pub state_write: StateWrite,
    pub history: History,
    /// Parameters of the policy script, as the next job has them.
    pub policy_parameters: BTreeMap<String, f64>,
    /// What the policy script declares, as it is told.
    pub declared_parameters: Vec<Value>,
    /// The state that was told last, and whether a held machine stood.
    last_state: Option<(ControllerState, bool)>,
}

/// What clients and the loop that drives share: each request is judged and answered here, and becomes an order of that loop.
pub struct Dispatcher {
    pub machine: Machine,
    pub hub: Arc<OperatorHub>,
    pub status: Arc<Status>,
    pub lines: SharedLines,
    pub jogs: Arc<JogController>,
    pub persistence: Box<dyn Persistence>,
    pub programs: Option<PathBuf>,
    /// The drives are on a bus, whose frames may be late or lost.
    pub has_bus: bool,
    /// Where what clients say is written, where it is.
    pub arrivals: Option<Arrivals>,
    inner: Mutex<Inner>,
    pub(super) upload: Mutex<Option<Upload>>,
    /// Threads that wait for a disk.
    pub(super) disk_threads: Arc<AtomicUsize>,
    path: Mutex<DrawnPath>,
    scope: Mutex<Scope>,
    seen: Mutex<Seen>,
    frames: Mutex<Vec<(u64, String)>>,
    /// What lasts, as it was last made persistent.
    kept: Mutex<Option<PersistentData>>,
    /// On the virtual clock the time, ms; below zero where the computer's clock says.
    replay_ms: AtomicI64,
    post: Mutex<Vec<(Option<u64>, String)>>,
    bell: (UnixStream, UnixStream),
    over: AtomicBool,
}

/// The answer to a request: at once, or once the loop that drives has looked at it.
pub type Answered = Option<Result<Value, String>>;

impl Dispatcher {
    #[allow(clippy::too_many_arguments)] // the parts of a controller, each once
    pub fn new(
        machine: &Machine,
        hub: Arc<OperatorHub>,
        status: Arc<Status>,
        lines: SharedLines,
        jogs: Arc<JogController>,
        persistence: Box<dyn Persistence>,
        programs: Option<PathBuf>,
        unknown_axes: u32,
    ) -> Result<Self, String> {
        let bell = UnixStream::pair().map_err(|e| format!("no sockets within the process: {e}"))?;
        for end in [&bell.0, &bell.1] {
            end.set_nonblocking(true).map_err(|e| e.to_string())?;
        }
        let inner = Inner {
            mode: Mode::Idle,
            enabled: false,
            order: None,
            unknown_axes,
            loaded: None,
            block_delete: false,
            fault: None,
            aborting: false,
            stops: 0,
            emergency_stops: 0,
            state_write: StateWrite::Idle,
            history: History::of(&persistence.remembered()),
            policy_parameters: BTreeMap::new(),
            declared_parameters: vec![],
            last_state: None,
        };
        Ok(Self {
            machine: machine.clone(),
            hub,
            status,
            lines,
            jogs,
            persistence,
            programs,
            has_bus: false,
            arrivals: None,
            inner: Mutex::new(inner),
            upload: Mutex::default(),
            disk_threads: Arc::default(),
            path: Mutex::new(DrawnPath::new(machine.axes)),
            scope: Mutex::new(Scope::new(machine)),
            seen: Mutex::default(),
            frames: Mutex::default(),
            kept: Mutex::default(),
            replay_ms: AtomicI64::new(-1),
            post: Mutex::default(),
            bell,
            over: AtomicBool::new(false),
        })
    }

    pub fn lock(&self) -> MutexGuard<'_, Inner> {
        // What lies in it is whole after every statement.
        self.inner.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The path that is drawn.
    pub fn path(&self) -> MutexGuard<'_, DrawnPath> {
        self.path.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Who looks at which signals.
    pub fn scope(&self) -> MutexGuard<'_, Scope> {
        self.scope.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// What of the last sample is shown.
    pub fn seen(&self) -> MutexGuard<'_, Seen> {
        self.seen.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// It is so late on the virtual clock, s.
    pub fn set_replay_time(&self, at_s: f64) {
        self.replay_ms.store((at_s * 1e3) as i64, Relaxed);
    }

    /// The time, ms since 1970; on the virtual clock since the process began.
    pub fn now_unix_ms(&self) -> i64 {
        let replay_ms = self.replay_ms.load(Relaxed);
        if replay_ms >= 0 {
            return replay_ms;
        }
        let since = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH);
        since.map_or(0, |since| since.as_millis() as i64)
    }

    /// Keeps what the path has made true since this was called last. Soft side, once a rough period.
    pub fn keep_reached(&self) {
        let mut lines = lock(&self.lines);
        if lines.settle() {
            let persistent = lines.standing().persistent_data();
            drop(lines);
            self.keep(persistent);
        }
    }

    /// Keeps what lasts, where it is otherwise than before.
    pub fn keep(&self, persistent: PersistentData) {
        let mut kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        if kept.as_ref() != Some(&persistent) {
            self.persistence
                .record(Change::Program(Arc::new(persistent.clone())));
            *kept = Some(persistent);
        }
    }

    /// The machine is to come to rest and its drives are to let go, for good.
    pub fn end(&self) {
        self.over.store(true, Release);
    }

    pub fn is_over(&self) -> bool {
        self.over.load(Acquire)
    }

    /// What a client does is written, where that is asked for.
    pub fn note(&self, write: impl FnOnce(&Arrivals) -> Option<String>) {
        if let Some(why) = self.arrivals.as_ref().and_then(write) {
            self.raise("arrivals", &why);
        }
    }

    /// Sends a line to a client, or to all.
    pub fn send(&self, to: Option<u64>, line: &Value) {
        self.post
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .push((to, format!("{line}\n")));
        self.ring();
    }

    /// Wakes the thread that serves the clients; where it rings already, it rings.
    pub(super) fn ring(&self) {
        let _ = (&self.bell.1).write(&[1]);
    }

    /// Sends what the scope has for those who look; with `all` the job is over.
    pub fn send_scope(&self, all: bool) {
        let (frames, done) = self.scope().take(all);
        if !frames.is_empty() {
            let mut waiting = self.frames.lock().unwrap_or_else(PoisonError::into_inner);
            waiting.extend(frames.into_iter().map(|frame| (frame.client, frame.text)));
            drop(waiting);
            self.ring();
        }
        for (client, event) in done {
            self.send(Some(client), &event);
        }
    }

    /// Frames of the scope: what a client may lose.
    pub fn take_frames(&self) -> Vec<(u64, String)> {
        std::mem::take(&mut *self.frames.lock().unwrap_or_else(PoisonError::into_inner))
    }

    pub fn take_post(&self) -> Vec<(Option<u64>, String)> {
        std::mem::take(&mut *self.post.lock().unwrap_or_else(PoisonError::into_inner))
    }

    pub fn bell(&self) -> &UnixStream {
        &self.bell.0
    }

    /// Answers a request that was answered later.
    pub fn answer(&self, from: RequestId, answer: Result<Value, String>) {
        let line = match answer {
            Ok(ok) => json!({ "id": from.id, "ok": ok }),
            Err(why) => {
                json!({ "id": from.id, "error": { "what": "refused", "why": why, "state": self.state().name() } })
            }
        };
        self.send(Some(from.client), &line);
    }

    /// What the machine is doing.
    pub fn state(&self) -> ControllerState {
        self.state_of(&self.lock())
    }

    pub fn state_of(&self, inner: &Inner) -> ControllerState {
        if let Some((_, emergency)) = &inner.fault {
            return if *emergency {
                ControllerState::EmergencyStop
            } else {
                ControllerState::Fault
            };
        }
        let controls = self.hub.controls();
        let stops = [
            &controls.abort,
            &controls.emergency_stop,
            &controls.soft_fault,
        ]
        .iter()
        .any(|s| s.load(Relaxed));
        let ramps =
            MachineState::from_number(self.status.state.load(Relaxed)) == MachineState::Stopping;
        let held = controls.hold.load(Relaxed) || controls.program_hold.load(Relaxed);
        let homing_needed = inner.unknown_axes != 0;
        match inner.mode_to_come() {
            Mode::Enabling => ControllerState::Stopping,
            Mode::Idle if !inner.enabled => ControllerState::Disabled,
            // The loop that drives has not looked yet.
            Mode::Idle if controls.emergency_stop.load(Relaxed) => ControllerState::Stopping,
            Mode::Idle if homing_needed => ControllerState::HomingNeeded,
            Mode::Idle => ControllerState::Ready,
            _ if stops || ramps || inner.aborting => ControllerState::Stopping,
            _ if held => ControllerState::Held,
            Mode::Program | Mode::Homing => ControllerState::Running,
            Mode::Mdi => ControllerState::Mdi,
            Mode::Jog => ControllerState::Manual,
        }
    }

    /// Tells everybody where the state is another one than last, and where a machine that is held has come to rest.
    pub fn tell_state(&self) {
        let mut inner = self.lock();
        let state = self.state_of(&inner);
        let at_rest = self.hub.is_at_rest();
        let told = (state, at_rest && state == ControllerState::Held);
        if inner.last_state.replace(told) != Some(told) {
            let fault = inner.fault.as_ref().map(|(words, _)| words.clone());
            drop(inner);
            self.send(
                None,
                &json!({ "event": "state", "state": state.name(), "at_rest": at_rest, "fault": fault }),
            );
        }
    }

    /// A job begins; `false` where a stop came while it was being made: it is not to begin. The loop that drives.
    #[must_use]
    pub fn begin(&self, mode: Mode) -> bool {
        let mut inner = self.lock();
        inner.order = None;
        if std::mem::take(&mut inner.aborting) {
            return false;
        }
        inner.mode = mode;
        drop(inner);
        self.begun();
        true
    }

    /// The drives are on their way to holding, whatever fault there was; `false` where an emergency stop came behind the request for
    /// it, of which there had been so many: they are not to be enabled. One that comes from here on acts on the way. The loop that
    /// drives.
    #[must_use]
    pub fn begin_enabling(&self, emergency_stops: u64) -> bool {
        let mut inner = self.lock();
        inner.order = None;
        inner.aborting = false;
        if inner.emergency_stops != emergency_stops {
            return false;
        }
        inner.fault = None;
        inner.mode = Mode::Enabling;
        // Clients ask for one under this lock: it is in force before this, and counted, or behind it.
        let stop = &self.hub.controls().emergency_stop;
        stop.store(false, Relaxed);
        drop(inner);
        self.begun();
        true
    }

    /// What was seen of the job before is over.
    fn begun(&self) {
        *self.seen() = Seen::default();
        self.hub.begin_job();
        self.tell_state();
    }

    /// What was ordered is not begun: lines that wait for it are not going to be driven, and a hold that it was to begin with is over.
    /// The loop that drives.
    pub fn give_up_order(&self, position: AxisVector) {
        let mut inner = self.lock();
        inner.order = None;
        self.forget_abort(&mut inner);
        drop(inner);
        self.hub.controls().hold.store(false, Relaxed);
        let dropped = lock(&self.lines).end_job(position, false, false, false);
        self.tell_driven(&dropped, false);
        self.tell_state();
    }

    /// A job is over, whose lines are settled and whose place is shown from here on; [`Dispatcher::close`] follows. The loop that drives.
    pub fn settle(&self, mode: Mode, outcome: &JobOutcome) {
        let whole = outcome.fault.is_none() && !outcome.aborted;
        // A jog that was let go has switched nothing off.
        let let_go = mode == Mode::Jog && outcome.fault.is_none() && !self.lock().aborting;
        let driven = lock(&self.lines).end_job(
            outcome.position,
            whole,
            whole && mode == Mode::Program,
            !whole && !let_go,
        );
        self.tell_driven(&driven, whole);
        let persistent = lock(&self.lines).standing().persistent_data();
        self.keep(persistent);
        self.persistence
            .record(Change::LastPosition(outcome.position));
        self.hub.stands_at(&outcome.position);
        self.path().drive(&outcome.position);
        self.send_scope(true);
        self.show_left(outcome);
    }

    /// What is on behind a job. The loop that drives.
    fn show_left(&self, outcome: &JobOutcome) {
        *self.seen() = Seen {
            switched: outcome.left.switched,
            ..Seen::default()
        };
    }

    /// An abort that came behind the end of the path has switched off what was on. The loop that drives.
    pub fn settle_late_abort(&self, outcome: &JobOutcome) {
        lock(&self.lines).set_switched_off();
        self.show_left(outcome);
    }

    /// The job is told, and the next one may begin; `false` where the operator has aborted it meanwhile and it has not been: nothing
    /// is told yet. The loop that drives.
    #[must_use]
    pub fn close(&self, mode: Mode, name: &str, outcome: &JobOutcome, unknown_axes: u32) -> bool {
        let fault = outcome.summary.fault.clone();
        let how = match (&fault, outcome.aborted) {
            (Some(_), _) if self.hub.controls().emergency_stop.load(Relaxed) => {
                Outcome::EmergencyStop
            }
            (Some(_), _) => Outcome::Fault,
            (None, true) => Outcome::Aborted,
            (None, false) => Outcome::Done,
        };
        let mut inner = self.lock();
        if how == Outcome::Done && inner.aborting && mode != Mode::Enabling {
            return false;
        }
        if let Some(words) = &fault {
            self.fault_in(&mut inner, words);
        }
        let ended = inner.history.end(outcome, how, self.now_unix_ms());
        // Before anybody can ask for the next jog: one that is asked for behind this is not to be forgotten, nor one that came when
        // this job looked for none any more.
        let late = if outcome.fault.is_none() {
            self.jogs.take_waiting()
        } else {
            vec![]
        };
        self.stands(&outcome.position, unknown_axes);
        inner.mode = Mode::Idle;
        inner.unknown_axes = unknown_axes;
        self.forget_abort(&mut inner);
        if self.ask_again(late) && inner.order.is_none() {
            inner.order = Some(Order::Jog);
        }
        inner.enabled = outcome.fault.is_none() && (mode != Mode::Enabling || !outcome.aborted);
        drop(inner);
        if let Some((id, end)) = ended {
            let end = Box::new(end);
            self.persistence.record(Change::JobEnded { id, end });
            let job = json!({
                "number": id, "job": mode.name(), "name": name, "outcome": how.word(), "fault": fault,
                "blocks": outcome.summary.blocks, "time_s": outcome.summary.motion_time_s, "stopped": outcome.summary.stopped,
            });
            self.send(None, &described::job_event(&self.machine, &job, outcome));
        }
        self.tell_state();
        true
    }

    /// Asks for jogs from where the machine stands now; whether any waits.
    fn ask_again(&self, jogs: Vec<Jog>) -> bool {
        for jog in jogs {
            if let Err(why) = self.jogs.ask(jog) {
                self.tell_refused("jogging", &why);
            }
        }
        !self.jogs.is_still()
    }

    /// Tells everybody that a job cannot begin.
    pub fn tell_refused(&self, job: &str, why: &str) {
        self.send(None, &json!({ "event": "refused", "job": job, "why": why }));
    }

    /// An abort that came too late for the job that is over is not one of the next job.
    fn forget_abort(&self, inner: &mut Inner) {
        inner.aborting = false;
        self.hub.controls().abort.store(false, Relaxed);
    }

    /// The machine stands at `position`, and takes jogs from there.
    pub fn stands(&self, position: &AxisVector, unknown_axes: u32) {
        self.hub.stands_at(position);
        self.jogs.disable(*position);
        self.jogs
            .enable(self.hub.shared_controls(), true, unknown_axes);
    }

    fn fault_in(&self, inner: &mut Inner, words: &str) {
        let emergency = self.hub.controls().emergency_stop.load(Relaxed);
        inner.fault = Some((words.to_string(), emergency));
        inner.enabled = false;
        let code = if emergency { "emergency-stop" } else { "fault" };
        let alarm = inner.history.raise(code, words, self.now_unix_ms());
        self.send(
            None,
            &json!({ "event": "alarm", "raised": alarm_shown(&alarm) }),
        );
        self.persistence.record(Change::Raised(Box::new(alarm)));
        self.hub.begin_fault(words);
    }

    /// A fault has come while nothing was driven, or the drives could not be enabled. The loop that drives.
    pub fn fault(&self, words: &str) {
        let mut inner = self.lock();
        inner.mode = Mode::Idle;
        self.forget_abort(&mut inner);
        let order = inner.order.take_if(|order| order.moves());
        self.fault_in(&mut inner, words);
        drop(inner);
        let dropped = lock(&self.lines).end_job(self.hub.position(), false, false, true);
        self.tell_driven(&dropped, false);
        // What was about to begin does not begin in a fault.
        if let Some(from) = order.and_then(|order| order.from()) {
            self.answer(from, Err(words.to_string()));
        }
        self.tell_state();
    }

    /// Tells clients that their lines are driven, or that they are not going to be.
    pub fn tell_driven(&self, lines: &[Judged], whole: bool) {
        for line in lines {
            let event = if whole { "driven" } else { "not-driven" };
            self.send(Some(line.client), &json!({ "event": event, "id": line.id }));
        }
    }
}
