//! Where all requests come together: what is done at once is done here, the rest is ordered of the loop that drives.

use std::collections::VecDeque;
use std::fmt::Write as _;
use std::io::Write as _;
use std::os::unix::net::UnixStream;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;
use std::sync::atomic::Ordering::{Acquire, Relaxed, Release};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use serde_json::{Value, json};
use tandem_gcode::{Lasting, Tool, system_code};
use tandem_host::{Command, JobOutcome};
use tandem_machine::Machine;
use tandem_rings::{MachineState, Status};
use tandem_sdk::AxisVector;

use super::described;
use super::lines::{Judged, SharedLines, lock};
use super::request::Asked;
use super::states::{ControllerState, judge};
use crate::jog::{JogController, JogMessage, ReachMessage};
use crate::operator::{OperatorHub, Position};

/// Jobs and alarms that are remembered.
const REMEMBERED: usize = 100;
/// Longest program, bytes.
pub const MAX_PROGRAM_BYTES: u64 = 64 << 20;

/// Keeps what lasts where a killed process does not lose it.
pub trait Keeper: Send + Sync {
    /// Keeps `lasting`, which a client has asked for: it is safe when this returns.
    ///
    /// # Errors
    /// Why it is not, in words.
    fn commit(&self, lasting: &Lasting) -> Result<(), String>;

    /// Keeps `lasting`, which the path has made true; nobody waits for it.
    fn record(&self, lasting: &Lasting);
}

/// Keeps nothing: what lasts ends with the process.
pub struct NoKeeper;

impl Keeper for NoKeeper {
    fn commit(&self, _lasting: &Lasting) -> Result<(), String> {
        Ok(())
    }

    fn record(&self, _lasting: &Lasting) {}
}

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
}

/// A program that can be started.
#[derive(Clone, Debug)]
pub struct Loaded {
    pub name: String,
    pub text: Arc<[u8]>,
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
    pub history: VecDeque<Value>,
    pub alarms: VecDeque<Value>,
    last_state: Option<ControllerState>,
}

/// The desk.
pub struct Desk {
    pub machine: Machine,
    pub hub: Arc<OperatorHub>,
    status: Arc<Status>,
    pub lines: SharedLines,
    pub jogs: Arc<JogController>,
    pub keeper: Box<dyn Keeper>,
    programs: Option<PathBuf>,
    inner: Mutex<Inner>,
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
            history: VecDeque::new(),
            alarms: VecDeque::new(),
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
            post: Mutex::default(),
            bell,
            over: AtomicBool::new(false),
        })
    }

    pub fn lock(&self) -> MutexGuard<'_, Inner> {
        // What lies in it is whole after every statement.
        self.inner.lock().unwrap_or_else(PoisonError::into_inner)
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
        // Where it rings already, it rings.
        let _ = (&self.bell.1).write(&[1]);
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

    fn state_of(&self, inner: &Inner) -> ControllerState {
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
        let mut inner = self.lock();
        let name = if asked.request == "jog" && asked.with.contains_key("stop") {
            "jog-stop"
        } else {
            &asked.request
        };
        if let Err(why) = judge(self.state_of(&inner), name) {
            return Some(Err(why.to_string()));
        }
        let seen = [
            "status",
            "subscribe",
            "history",
            "lease",
            "list",
            "machine",
            "tables",
            "emergency-stop",
            "hold",
            "abort",
        ];
        let is_switch = [
            "feed-override",
            "rapid-override",
            "single-block",
            "optional-stop",
            "block-delete",
        ];
        let joins = matches!(
            (&inner.order, name),
            (Some(Order::Mdi), "mdi") | (Some(Order::Jog), "jog" | "jog-stop")
        );
        if inner.order.is_some() && !joins && !seen.contains(&name) && !is_switch.contains(&name) {
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
        let plain = |command: Command| asked.only(&[]).and_then(|()| give(command));
        match name {
            "status" => asked.only(&[]).map(|()| Acted::Done(self.status_of(inner))),
            "history" => Ok(Acted::Done(
                json!({ "jobs": inner.history, "alarms": inner.alarms }),
            )),
            "list" => self.list().map(Acted::Done),
            "machine" => asked
                .only(&[])
                .map(|()| Acted::Done(described::machine(&self.machine))),
            "tables" => asked.only(&[]).map(|()| {
                let lasting = lock(&self.lines).standing().lasting();
                Acted::Done(described::tables(&self.machine, &lasting))
            }),
            "hold" => plain(Command::Hold),
            "resume" => plain(Command::Resume),
            "emergency-stop" => plain(Command::EmergencyStop),
            "abort" => {
                let done = plain(Command::Abort)?;
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
                asked.only(&[])?;
                let missing = "no program is loaded: \"load\" loads one";
                inner
                    .loaded
                    .as_ref()
                    .map(|_| Acted::Ordered(Order::Start { from }))
                    .ok_or_else(|| missing.to_string())
            }
            "mdi" => {
                asked.only(&["line"])?;
                let begins = lock(&self.lines).judge(from.client, from.id, asked.text("line")?)?;
                let judged = json!({ "judged": true });
                let waits = inner.mode == Mode::Mdi || inner.order.is_some() || !begins;
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
                if asked.with.get("again") == Some(&json!(true)) {
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
                asked.only(&["axis"])?;
                let axis = if asked.with.contains_key("axis") {
                    Some(self.axis(asked.text("axis")?)?)
                } else {
                    None
                };
                Ok(Acted::Ordered(Order::Home { from, axis }))
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

    /// Changes what lasts; it is on disk when this returns.
    fn set(&self, asked: &Asked, name: &str) -> Result<Value, String> {
        let mut lines = lock(&self.lines);
        let axes = &self.machine.axes;
        // Axis words in mm and deg, as keys such as x_mm and a_deg.
        let mut words = String::new();
        for axis in 0..axes.count() {
            let letter = axes.letter(axis);
            let unit = if axes.is_rotary(axis) { "deg" } else { "mm" };
            if let Some(value) =
                asked.number_if_any(&format!("{}_{unit}", letter.to_ascii_lowercase()))?
            {
                // A string takes whatever is written to it.
                let _ = write!(words, " {letter}[{value:.9}]");
            }
        }
        let lasting = match name {
            "touch-off" | "set-offset" => {
                let system = match asked.with.get("system") {
                    None => 0,
                    Some(name) => (0..tandem_gcode::WORK_SYSTEMS)
                        .find(|i| Some(system_code(*i).as_str()) == name.as_str())
                        .map(|i| i + 1)
                        .ok_or_else(|| {
                            format!(
                                "{name} is no work coordinate system: G54 to G59, G59.1 to G59.3"
                            )
                        })?,
                };
                if words.is_empty() {
                    return Err(format!(
                        "{name} needs the coordinate of at least one axis, as in \"x_mm\""
                    ));
                }
                let number = if name == "touch-off" { 20 } else { 2 };
                lines.lasting_behind(&format!("G10 L{number} P{system}{words}"))?
            }
            "set-parameter" => {
                let (number, value) = (asked.number("number")?, asked.number("value")?);
                if !(31.0..=5000.0).contains(&number) || number.fract() != 0.0 {
                    return Err("a parameter that lasts has a number from 31 to 5000".to_string());
                }
                let mut lasting = lines.standing().lasting();
                lasting.parameters.insert(number as u32, value);
                lasting
            }
            _ => self.with_tool(lines.standing().lasting(), asked)?,
        };
        self.keeper.commit(&lasting)?;
        lines.set_lasting(&lasting);
        Ok(json!({ "set": name }))
    }

    fn with_tool(&self, mut lasting: Lasting, asked: &Asked) -> Result<Lasting, String> {
        let number = asked.number("number")?;
        if !(0.0..=99_999.0).contains(&number) || number.fract() != 0.0 {
            return Err("a tool has a number from 1 to 99999; 0 is the empty spindle".to_string());
        }
        let number = number as u32;
        if asked.with.get("in_spindle").and_then(Value::as_bool) == Some(true) {
            lasting.tool_in_spindle = number;
        }
        let at = lasting.tools.iter().position(|tool| tool.number == number);
        let mut tool = at.map_or(
            Tool {
                number,
                pocket: None,
                offset: AxisVector::ZERO,
                diameter_mm: 0.0,
            },
            |at| lasting.tools[at],
        );
        for axis in 0..self.machine.axes.count() {
            let letter = self.machine.axes.letter(axis).to_ascii_lowercase();
            if let Some(mm) = asked.number_if_any(&format!("{letter}_mm"))? {
                tool.offset[axis] = mm;
            }
        }
        if let Some(mm) = asked.number_if_any("diameter_mm")? {
            tool.diameter_mm = mm;
        }
        match at {
            _ if number == 0 => {}
            Some(at) => lasting.tools[at] = tool,
            None => lasting.tools.push(tool),
        }
        Ok(lasting)
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

    /// A program, as text or as a file of the programs folder.
    fn program_of(&self, asked: &Asked) -> Result<Loaded, String> {
        asked.only(&["path", "text", "name"])?;
        if asked.with.contains_key("text") {
            let name = asked
                .with
                .get("name")
                .and_then(Value::as_str)
                .unwrap_or("program.ngc")
                .to_string();
            return Ok(Loaded {
                name,
                text: asked.text("text")?.as_bytes().into(),
            });
        }
        let path = asked.text("path")?;
        let folder = self.folder()?;
        let safe = Path::new(path)
            .components()
            .all(|part| matches!(part, std::path::Component::Normal(_)));
        if !safe {
            return Err(format!(
                "{path}: a program is named by its path within the programs folder"
            ));
        }
        let file = folder.join(path);
        let size = std::fs::metadata(&file)
            .map_err(|e| format!("{}: {e}", file.display()))?
            .len();
        if size > MAX_PROGRAM_BYTES {
            return Err(format!(
                "{path}: it has {size} bytes, {MAX_PROGRAM_BYTES} are allowed"
            ));
        }
        let text = std::fs::read(&file).map_err(|e| format!("{}: {e}", file.display()))?;
        Ok(Loaded {
            name: path.to_string(),
            text: text.into(),
        })
    }

    fn folder(&self) -> Result<&Path, String> {
        let missing = "there is no programs folder: tandem serve --programs FOLDER names one";
        self.programs.as_deref().ok_or_else(|| missing.to_string())
    }

    fn list(&self) -> Result<Value, String> {
        let folder = self.folder()?;
        let entries =
            std::fs::read_dir(folder).map_err(|e| format!("{}: {e}", folder.display()))?;
        let files = entries
            .filter_map(Result::ok)
            .filter(|entry| entry.path().is_file());
        let mut names: Vec<String> = files
            .map(|entry| entry.file_name().to_string_lossy().into_owned())
            .collect();
        names.sort();
        Ok(json!({ "programs": names }))
    }

    /// Everything that can be seen. Allocates.
    pub fn status(&self) -> Value {
        self.status_of(&self.lock())
    }

    fn status_of(&self, inner: &Inner) -> Value {
        let mut status = serde_json::to_value(self.hub.status()).unwrap_or_default();
        let lines = lock(&self.lines);
        let standing = lines.standing();
        let lasting = standing.lasting();
        let axes = &self.machine.axes;
        let place = self.hub.position();
        let shown = |vector: &AxisVector| {
            serde_json::to_value(Position::new(axes, vector)).unwrap_or_default()
        };
        let letters = |mask: u32| -> Vec<String> {
            let of = (0..axes.count()).filter(|axis| mask >> axis & 1 == 1);
            of.map(|axis| axes.letter(axis).to_ascii_lowercase().to_string())
                .collect()
        };
        let more = json!({
            "state": self.state_of(inner).name(),
            "loop_state": status["state"],
            "job": (inner.mode != Mode::Idle).then(|| inner.mode.name()),
            "program": inner.loaded.as_ref().map(|program| program.name.clone()),
            "work_position": shown(&standing.to_program(&place)),
            "not_homed": letters(inner.unknown_axes),
            "modal": standing.modal_words(),
            "system": system_code(lasting.active_system),
            "offset": shown(&lasting.origins[lasting.active_system]),
            "g92": shown(&lasting.g92),
            "tool": lasting.tool_in_spindle,
            "tool_offset": shown(&lasting.tool_offset),
            "spindle_rpm": self.status.spindle.told_rad_per_s.load() * 30.0 / std::f64::consts::PI,
            "spindle_turns_rpm": self.status.spindle.turns_rad_per_s.load() * 30.0 / std::f64::consts::PI,
            "block_delete": inner.block_delete,
            "fault": inner.fault.as_ref().map(|(words, _)| words.clone()),
            "alarms": inner.alarms.len(),
        });
        if let (Value::Object(all), Value::Object(more)) = (&mut status, more) {
            all.extend(more);
        }
        status
    }

    /// A job begins. The loop that drives.
    pub fn begin(&self, mode: Mode) {
        let mut inner = self.lock();
        (inner.mode, inner.order, inner.aborting) = (mode, None, false);
        drop(inner);
        self.hub.begin_job();
        self.tell_state();
    }

    /// A job is over. The loop that drives.
    pub fn finish(&self, mode: Mode, name: &str, outcome: &JobOutcome, unknown_axes: u32) {
        let whole = outcome.fault.is_none() && !outcome.aborted;
        let driven = lock(&self.lines).end_job(
            outcome.position,
            whole,
            whole && mode == Mode::Program,
            !whole,
        );
        self.tell_driven(&driven, whole);
        self.keeper.record(&lock(&self.lines).standing().lasting());
        self.hub.stands_at(&outcome.position);
        let fault = outcome.summary.fault.clone();
        let how = match (&fault, outcome.aborted) {
            (Some(_), _) => "fault",
            (None, true) => "aborted",
            (None, false) => "done",
        };
        let job = json!({
            "job": mode.name(), "name": name, "outcome": how, "fault": fault,
            "blocks": outcome.summary.blocks, "time_s": outcome.summary.motion_time_s, "stopped": outcome.summary.stopped,
        });
        let mut inner = self.lock();
        if mode != Mode::Enabling {
            remember(&mut inner.history, job.clone());
        }
        if let Some(words) = fault {
            self.fault_in(&mut inner, &words);
        }
        (inner.mode, inner.unknown_axes, inner.aborting) = (Mode::Idle, unknown_axes, false);
        inner.enabled = outcome.fault.is_none() && (mode != Mode::Enabling || !outcome.aborted);
        drop(inner);
        if mode != Mode::Enabling {
            self.send(None, &json!({ "event": "job", "job": job }));
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
        remember(&mut inner.alarms, json!({ "fault": words }));
        self.hub.begin_fault(words);
    }

    /// A fault has come while nothing was driven.
    pub fn fault(&self, words: &str) {
        self.fault_in(&mut self.lock(), words);
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

fn remember(all: &mut VecDeque<Value>, one: Value) {
    all.push_back(one);
    if all.len() > REMEMBERED {
        all.pop_front();
    }
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
    asked.only(&[
        "axis",
        "distance_mm",
        "distance_deg",
        "direction",
        "again",
        "feed_mm_per_min",
        "feed_deg_per_min",
    ])?;
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
