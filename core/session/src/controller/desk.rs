//! Where all requests come together: what is done at once is done here, the rest is ordered of the loop that drives.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::io::Write as _;
use std::os::unix::net::UnixStream;
use std::path::PathBuf;
use std::sync::atomic::Ordering::{Acquire, Relaxed, Release};
use std::sync::atomic::{AtomicBool, AtomicI64};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::SystemTime;

use serde_json::{Value, json};
use sha2::{Digest, Sha256};
use tandem_gcode::Lasting;
use tandem_host::{Command, JobOutcome};
use tandem_machine::Machine;
use tandem_rings::{MachineState, Status, Switched};
use tandem_sdk::AxisVector;
use tandem_state::{Change, Outcome};

use super::described;
use super::history::{HELD, History, alarm_shown};
use super::keeper::Keeper;
use super::lines::{Judged, SharedLines, lock};
use super::path::DrawnPath;
use super::programs::{Upload, discard};
use super::request::Asked;
use super::scope::Scope;
use super::states::{ControllerState, judge};
use super::words::word_of;
use crate::jog::{JogController, JogMessage, ReachMessage};
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
pub struct From {
    pub client: u64,
    pub id: u64,
}

/// What the loop that drives is to do next.
#[derive(Clone, Debug)]
pub enum Order {
    /// Checks a program, and keeps it for a start where that is asked for.
    Check {
        from: From,
        program: Loaded,
        load: bool,
    },
    Start {
        from: From,
    },
    Mdi,
    /// Lines that are jogs.
    JogLines,
    Jog,
    Home {
        from: From,
        axis: Option<usize>,
    },
    Enable {
        from: From,
        resets: bool,
    },
    Disable {
        from: From,
    },
    SetPolicyParameter {
        from: From,
        name: String,
        value: f64,
    },
}

/// A program that can be started.
#[derive(Clone, Debug)]
pub struct Loaded {
    pub name: String,
    pub text: Arc<[u8]>,
    /// SHA-256 of the text, as `sha256sum` prints it.
    pub hash: String,
}

impl Loaded {
    /// A program, and its hash.
    pub fn new(name: String, text: Arc<[u8]>) -> Self {
        let mut hash = String::new();
        for byte in Sha256::digest(&text) {
            let _ = write!(hash, "{byte:02x}");
        }
        Self { name, text, hash }
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
    pub history: History,
    /// Parameters of the policy script, as the next job has them.
    pub policy_parameters: BTreeMap<String, f64>,
    last_state: Option<ControllerState>,
}

/// The desk.
pub struct Desk {
    pub machine: Machine,
    pub hub: Arc<OperatorHub>,
    pub status: Arc<Status>,
    pub lines: SharedLines,
    pub jogs: Arc<JogController>,
    pub keeper: Box<dyn Keeper>,
    pub programs: Option<PathBuf>,
    inner: Mutex<Inner>,
    upload: Mutex<Option<Upload>>,
    path: Mutex<DrawnPath>,
    scope: Mutex<Scope>,
    seen: Mutex<Seen>,
    frames: Mutex<Vec<(u64, String)>>,
    /// What lasts, as it was given to the keeper last.
    kept: Mutex<Option<Lasting>>,
    /// On the virtual clock the time, ms; below zero where the computer's clock says.
    replay_ms: AtomicI64,
    post: Mutex<Vec<(Option<u64>, String)>>,
    bell: (UnixStream, UnixStream),
    over: AtomicBool,
}

/// The answer to a request: at once, or once the loop that drives has looked at it.
pub type Answered = Option<Result<Value, String>>;

impl Desk {
    #[allow(clippy::too_many_arguments)] // the parts of a controller, each once
    pub fn new(
        machine: &Machine,
        hub: Arc<OperatorHub>,
        status: Arc<Status>,
        lines: SharedLines,
        jogs: Arc<JogController>,
        keeper: Box<dyn Keeper>,
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
            history: History::of(&keeper.remembered()),
            policy_parameters: BTreeMap::new(),
            last_state: None,
        };
        Ok(Self {
            machine: machine.clone(),
            hub,
            status,
            lines,
            jogs,
            keeper,
            programs,
            inner: Mutex::new(inner),
            upload: Mutex::default(),
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
            let lasting = lines.standing().lasting();
            drop(lines);
            self.keep(lasting);
        }
    }

    /// Keeps what lasts, where it is otherwise than before.
    pub fn keep(&self, lasting: Lasting) {
        let mut kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        if kept.as_ref() != Some(&lasting) {
            self.keeper
                .record(Change::Program(Arc::new(lasting.clone())));
            *kept = Some(lasting);
        }
    }

    /// A client is gone.
    pub fn forget(&self, client: u64) {
        self.scope().forget(client);
        let mut pending = self.pending();
        if pending.as_ref().is_some_and(|upload| upload.is_by(client)) {
            discard(&mut pending);
        }
    }

    /// The machine is to come to rest and its drives are to let go, for good.
    pub fn end(&self) {
        self.over.store(true, Release);
    }

    pub fn is_over(&self) -> bool {
        self.over.load(Acquire)
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
    fn ring(&self) {
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
    pub fn answer(&self, from: From, answer: Result<Value, String>) {
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
        match inner.mode {
            Mode::Enabling => ControllerState::Stopping,
            Mode::Idle if !inner.enabled => ControllerState::Disabled,
            Mode::Idle if homing_needed => ControllerState::HomingNeeded,
            Mode::Idle => ControllerState::Ready,
            _ if stops || ramps || inner.aborting => ControllerState::Stopping,
            _ if held => ControllerState::Held,
            Mode::Program | Mode::Homing => ControllerState::Running,
            Mode::Mdi => ControllerState::Mdi,
            Mode::Jog => ControllerState::Manual,
        }
    }

    /// Tells everybody where the state is another one than last.
    pub fn tell_state(&self) {
        let mut inner = self.lock();
        let state = self.state_of(&inner);
        if inner.last_state.replace(state) != Some(state) {
            let fault = inner.fault.as_ref().map(|(words, _)| words.clone());
            drop(inner);
            self.send(
                None,
                &json!({ "event": "state", "state": state.name(), "fault": fault }),
            );
        }
    }

    /// Judges a request by the state of the machine, and does it or orders it.
    pub fn ask(&self, from: From, asked: &Asked) -> Answered {
        let name = if asked.request == "jog" && asked.with.contains_key("stop") {
            "jog-stop"
        } else {
            &asked.request
        };
        if let Some(answer) = self.ask_disk(from, asked, name) {
            return Some(answer);
        }
        let mut inner = self.lock();
        if let Err(why) = fits(self.state_of(&inner), asked, name) {
            return Some(Err(why));
        }
        let joins = matches!(
            (&inner.order, name),
            (Some(Order::Mdi), "mdi") | (Some(Order::Jog), "jog" | "jog-stop")
        );
        if inner.order.is_some() && !joins && begins_or_sets(name) {
            return Some(Err(
                "another request is being begun: wait for its answer".to_string()
            ));
        }
        let order = match self.act(from, asked, name, &mut inner) {
            Ok(Acted::Done(value)) => return Some(Ok(value)),
            Err(why) => return Some(Err(why)),
            Ok(Acted::Begins(order, value)) => (order, Some(Ok(value))),
            Ok(Acted::Ordered(order)) => (order, None),
        };
        inner.order = Some(order.0);
        order.1
    }

    /// What waits for a disk while a job may be driven: the loop that drives never waits for that.
    fn ask_disk(&self, from: From, asked: &Asked, name: &str) -> Option<Result<Value, String>> {
        if !["list", "upload", "acknowledge"].contains(&name) {
            return None;
        }
        Some(fits(self.state(), asked, name).and_then(|()| match name {
            "list" => self.list(),
            "upload" => self.upload(from, asked, &mut self.pending()),
            _ => self.acknowledge(asked),
        }))
    }

    /// The program that is on its way into the folder.
    fn pending(&self) -> MutexGuard<'_, Option<Upload>> {
        self.upload.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn act(
        &self,
        from: From,
        asked: &Asked,
        name: &str,
        inner: &mut Inner,
    ) -> Result<Acted, String> {
        let give = |command: Command| {
            self.hub
                .give(command)
                .map(|tick| Acted::Done(json!({ "tick": tick })))
        };
        match name {
            "status" => Ok(Acted::Done(self.status_of(inner))),
            "history" => {
                let count = asked.whole_if_any("count").unwrap_or(HELD as u64);
                Ok(Acted::Done(inner.history.show(count as usize)))
            }
            "alarms" => Ok(Acted::Done(
                json!({ "alarms": inner.history.open_alarms() }),
            )),
            "machine" => Ok(Acted::Done(described::machine(&self.machine))),
            "tables" => {
                let lasting = lock(&self.lines).standing().lasting();
                Ok(Acted::Done(described::tables(&self.machine, &lasting)))
            }
            "path" => {
                let from = |key: &str| asked.whole_if_any(key).unwrap_or(0);
                Ok(Acted::Done(
                    self.path().show(from("from"), from("driven_from")),
                ))
            }
            "scope" => self.scope().watch(from.client, asked).map(Acted::Done),
            "capture" => self.scope().arm(from.client, asked).map(Acted::Done),
            "captured" => {
                let first = asked.whole_if_any("from").unwrap_or(0) as usize;
                self.scope().captured(from.client, first).map(Acted::Done)
            }
            "policy-parameters" => Ok(Acted::Done(
                json!({ "parameters": inner.policy_parameters }),
            )),
            "set-policy-parameter" => Ok(Acted::Ordered(Order::SetPolicyParameter {
                from,
                name: asked.text("name")?.to_string(),
                value: asked.number("value")?,
            })),
            "hold" => give(Command::Hold),
            "resume" => give(Command::Resume),
            "emergency-stop" => give(Command::EmergencyStop),
            "abort" => {
                let done = give(Command::Abort)?;
                inner.aborting = true;
                self.jogs.forget();
                Ok(done)
            }
            "feed-override" => asked
                .number("ratio")
                .and_then(ratio)
                .and_then(|r| give(Command::FeedOverride(r))),
            "rapid-override" => asked
                .number("ratio")
                .and_then(ratio)
                .and_then(|r| give(Command::RapidOverride(r))),
            "single-block" => give(Command::SingleBlock(asked.on()?)),
            "optional-stop" => give(Command::OptionalStop(asked.on()?)),
            "block-delete" => {
                inner.block_delete = asked.on()?;
                Ok(Acted::Done(json!({ "block_delete": inner.block_delete })))
            }
            "load" | "check" => {
                let program = self.program_of(asked)?;
                Ok(Acted::Ordered(Order::Check {
                    from,
                    program,
                    load: name == "load",
                }))
            }
            "start" => {
                let missing = "no program is loaded: \"load\" loads one";
                inner
                    .loaded
                    .as_ref()
                    .map(|_| Acted::Ordered(Order::Start { from }))
                    .ok_or_else(|| missing.to_string())
            }
            "mdi" => {
                let taken = lock(&self.lines)
                    .judge(from.client, from.id, asked.text("line")?)
                    .map_err(|why| why.to_string())?;
                let judged = json!({ "judged": true });
                let waits = inner.mode == Mode::Mdi || inner.order.is_some() || !taken.begins;
                Ok(if waits {
                    Acted::Done(judged)
                } else {
                    Acted::Begins(Order::Mdi, judged)
                })
            }
            "jog-stop" => {
                self.jogs.let_go();
                Ok(Acted::Done(json!({ "jog": "stop" })))
            }
            "jog" => {
                let jog = jog(asked)?.on(&self.machine.axes)?;
                if asked.is_on("again") {
                    self.jogs.keep_alive(jog)?;
                    return Ok(Acted::Done(json!({ "jog": asked.with.get("axis") })));
                }
                self.jogs.ask(jog)?;
                let done = json!({ "jog": asked.with.get("axis") });
                let waits = inner.mode == Mode::Jog || inner.order.is_some();
                Ok(if waits {
                    Acted::Done(done)
                } else {
                    Acted::Begins(Order::Jog, done)
                })
            }
            "home" => {
                let axis = asked.text_if_any("axis").map(|axis| self.axis(axis));
                Ok(Acted::Ordered(Order::Home {
                    from,
                    axis: axis.transpose()?,
                }))
            }
            "reset" => Ok(Acted::Ordered(Order::Enable { from, resets: true })),
            "enable" => Ok(Acted::Ordered(Order::Enable {
                from,
                resets: false,
            })),
            "disable" => Ok(Acted::Ordered(Order::Disable { from })),
            "touch-off" | "set-offset" | "set-tool" | "set-parameter" => {
                self.set(asked, name).map(Acted::Done)
            }
            other => Err(format!("{other} is not done here")),
        }
    }

    fn axis(&self, letter: &str) -> Result<usize, String> {
        let mut letters = letter.chars();
        let one = letters
            .next()
            .filter(|_| letters.next().is_none())
            .map(|letter| letter.to_ascii_uppercase());
        one.and_then(|one| self.machine.axes.index(one))
            .ok_or_else(|| format!("the machine has no axis {letter}"))
    }

    /// A job begins. The loop that drives.
    pub fn begin(&self, mode: Mode) {
        let mut inner = self.lock();
        (inner.mode, inner.order, inner.aborting) = (mode, None, false);
        drop(inner);
        *self.seen() = Seen::default();
        self.hub.begin_job();
        self.tell_state();
    }

    /// A job is over. The loop that drives.
    pub fn finish(&self, mode: Mode, name: &str, outcome: &JobOutcome, unknown_axes: u32) {
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
        let lasting = lock(&self.lines).standing().lasting();
        self.keep(lasting);
        self.keeper.record(Change::LastPosition(outcome.position));
        self.hub.stands_at(&outcome.position);
        self.path().drive(&outcome.position);
        self.send_scope(true);
        *self.seen() = Seen {
            switched: outcome.left.switched,
            ..Seen::default()
        };
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
        if let Some(words) = &fault {
            self.fault_in(&mut inner, words);
        }
        let ended = inner.history.end(outcome, how, self.now_unix_ms());
        (inner.mode, inner.unknown_axes, inner.aborting) = (Mode::Idle, unknown_axes, false);
        inner.enabled = outcome.fault.is_none() && (mode != Mode::Enabling || !outcome.aborted);
        drop(inner);
        if let Some((id, end)) = ended {
            let end = Box::new(end);
            self.keeper.record(Change::JobEnded { id, end });
            let job = json!({
                "number": id, "job": mode.name(), "name": name, "outcome": how.word(), "fault": fault,
                "blocks": outcome.summary.blocks, "time_s": outcome.summary.motion_time_s, "stopped": outcome.summary.stopped,
            });
            self.send(None, &described::job_event(&self.machine, &job, outcome));
        }
        self.stands(&outcome.position, unknown_axes);
        self.tell_state();
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
        self.keeper.record(Change::Raised(Box::new(alarm)));
        self.hub.begin_fault(words);
    }

    /// A fault has come while nothing was driven, or the drives could not be enabled. The loop that drives.
    pub fn fault(&self, words: &str) {
        let mut inner = self.lock();
        (inner.mode, inner.aborting) = (Mode::Idle, false);
        self.fault_in(&mut inner, words);
        drop(inner);
        lock(&self.lines).end_job(self.hub.position(), false, false, true);
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

/// What became of a request that was granted.
enum Acted {
    /// Done, with the answer.
    Done(Value),
    /// Done, and a job begins for it.
    Begins(Order, Value),
    /// The loop that drives answers.
    Ordered(Order),
}

/// Whether a request fits the state, and has the keys that its word asks for.
fn fits(state: ControllerState, asked: &Asked, name: &str) -> Result<(), String> {
    judge(state, name)?;
    word_of(name).map_or(Ok(()), |word| word.check(&asked.with))
}

/// Whether a request begins a job or changes what one begins with: one at a time.
fn begins_or_sets(name: &str) -> bool {
    [
        "load",
        "check",
        "start",
        "mdi",
        "jog",
        "home",
        "reset",
        "enable",
        "disable",
        "touch-off",
        "set-offset",
        "set-tool",
        "set-parameter",
        "set-policy-parameter",
        "resume",
    ]
    .contains(&name)
}

fn ratio(value: f64) -> Result<f64, String> {
    if value.is_finite() && value >= 0.0 {
        Ok(value)
    } else {
        Err(format!("{value} is not a number of zero or more"))
    }
}

/// A jog as clients ask for it.
fn jog(asked: &Asked) -> Result<JogMessage, String> {
    let axis = asked
        .text("axis")?
        .chars()
        .next()
        .ok_or("jog needs an axis")?;
    let degrees = asked.with.contains_key("feed_deg_per_min");
    let unit = if degrees { "deg" } else { "mm" };
    let feed_per_min = asked.number(&format!("feed_{unit}_per_min"))?;
    let distance = asked.number_if_any(&format!("distance_{unit}"))?;
    let reach = match (distance, asked.number_if_any("direction")?) {
        (Some(distance), None) => ReachMessage::By(distance),
        (None, Some(direction)) if direction.abs() == 1.0 => ReachMessage::On {
            positive: direction > 0.0,
        },
        _ => return Err("jog needs one of distance and direction (1 or -1)".to_string()),
    };
    Ok(JogMessage {
        axis,
        reach,
        feed_per_min,
        degrees: Some(degrees),
    })
}
