//! Signals of every fine period for clients: as they come, decimated, and a capture of every one around a trigger.

use std::collections::VecDeque;

use serde::Serialize;
use serde_json::{Value, json};
use tandem_machine::Machine;
use tandem_recorder::rpm;
use tandem_rings::Sample;

use super::request::Asked;

/// Clients that may look at once, and signals that each may have.
const MAX_WATCHERS: usize = 32;
const MAX_SIGNALS: usize = 16;
/// Numbers of a frame: one is sent when there are as many, or when it is as old as [`FRAME_PERIODS`].
const FRAME_NUMBERS: usize = 512;
/// Rough periods after which a frame is sent that is not full.
const FRAME_PERIODS: u32 = 6;
/// Numbers that all captures together may hold: 8 signals over four minutes at 1 kHz.
const MAX_NUMBERS: usize = 1_920_000;
/// Numbers in one answer.
const MAX_ANSWER_NUMBERS: usize = 4000;

/// Where a signal comes from.
#[derive(Clone, Debug, PartialEq)]
enum Signal {
    Command(usize),
    Feedback(usize),
    Speed(usize),
    Following(usize),
    Current(usize),
    Feed,
    Sigma,
    Ratio,
    Line,
    Block,
    State,
    SpindleSet,
    Spindle,
    Input(u32),
    Output(u32),
    /// A signal of the feed strategy, or an analog input, and its place among those of the job.
    Of(String, Option<usize>),
}

impl Signal {
    fn find(machine: &Machine, name: &str) -> Option<Self> {
        let axes = &machine.axes;
        for axis in 0..axes.count() {
            let letter = axes.letter(axis).to_ascii_lowercase();
            let unit = if axes.is_rotary(axis) { "deg" } else { "mm" };
            for (word, signal) in [
                (format!("{letter}_cmd_{unit}"), Self::Command(axis)),
                (format!("{letter}_fb_{unit}"), Self::Feedback(axis)),
                (format!("{letter}_fb_{unit}_s"), Self::Speed(axis)),
                (format!("{letter}_following_{unit}"), Self::Following(axis)),
            ] {
                if word == name {
                    return Some(signal);
                }
            }
        }
        if let Some(joint) = name.strip_suffix("_current_a") {
            return joint_of(machine, joint).map(Self::Current);
        }
        let number = |text: &str| text.parse().ok().filter(|number| *number <= 63_u32);
        if let Some(input) = name.strip_prefix("input_") {
            let named = machine.inputs.iter().find(|of| of.name == input);
            return named
                .map_or_else(|| number(input), |of| Some(of.input))
                .map(Self::Input);
        }
        if let Some(output) = name.strip_prefix("output_") {
            let named = machine.outputs.iter().find(|of| of.name == output);
            return named
                .map_or_else(|| number(output), |of| Some(of.output))
                .map(Self::Output);
        }
        if let Some(of) = name.strip_prefix("sig_") {
            return Some(Self::Of(of.to_string(), None));
        }
        Some(match name {
            "feed_mm_s" => Self::Feed,
            "sigma" => Self::Sigma,
            "ratio" => Self::Ratio,
            "line" => Self::Line,
            "block" => Self::Block,
            "state" => Self::State,
            "spindle_set_rpm" => Self::SpindleSet,
            "spindle_rpm" => Self::Spindle,
            _ => return None,
        })
    }

    /// Its value; no number where the job has no such signal.
    fn value(&self, machine: &Machine, sample: &Sample, signals: &[f64]) -> f64 {
        let shown = |axis: usize, value: f64| {
            if machine.axes.is_rotary(axis) {
                value.to_degrees()
            } else {
                value
            }
        };
        match self {
            Self::Command(axis) => shown(*axis, sample.command[*axis]),
            Self::Feedback(axis) => shown(*axis, sample.feedback[*axis]),
            Self::Speed(axis) => shown(*axis, sample.speed[*axis]),
            Self::Following(axis) => shown(*axis, sample.command[*axis] - sample.feedback[*axis]),
            Self::Current(joint) => sample.current_a[*joint],
            Self::Feed => sample.feed_mm_per_s,
            Self::Sigma => sample.sigma,
            Self::Ratio => sample.ratio,
            Self::Line => f64::from(sample.line),
            Self::Block => sample.block as f64,
            Self::State => f64::from(sample.state as u32),
            Self::SpindleSet => rpm(sample.switched.spindle_rad_per_s),
            Self::Spindle => rpm(sample.spindle_rad_per_s),
            Self::Input(input) => (sample.inputs >> input & 1) as f64,
            Self::Output(output) => f64::from(u8::from(sample.switched.is_on(*output))),
            Self::Of(_, at) => at
                .and_then(|at| signals.get(at))
                .copied()
                .unwrap_or(f64::NAN),
        }
    }
}

/// The joint of this name; where joints have none of their own, that of the axis with this letter.
fn joint_of(machine: &Machine, name: &str) -> Option<usize> {
    let named = machine.joints.iter().position(|joint| joint.name == name);
    let of_axis = || {
        let mut letters = name.chars();
        let letter = letters.next().filter(|_| letters.next().is_none())?;
        machine.axes.index(letter.to_ascii_uppercase())
    };
    named.or_else(of_axis)
}

/// Signals that a client has named.
fn signals_of(machine: &Machine, asked: &Asked) -> Result<Vec<Signal>, String> {
    let names = asked.texts("signals");
    if names.len() > MAX_SIGNALS {
        return Err(format!(
            "{} signals are too many: {MAX_SIGNALS} at once",
            names.len()
        ));
    }
    let find = |name: &&str| {
        Signal::find(machine, name)
            .ok_or_else(|| format!("there is no signal {name}; docs/controller.md lists them"))
    };
    names.iter().map(find).collect()
}

/// What a client sees as it comes.
struct Live {
    client: u64,
    signals: Vec<Signal>,
    every: u64,
    /// Tick of the first row that waits to be sent.
    tick: u64,
    rows: Vec<f64>,
    age: u32,
}

/// The value of a signal that begins a capture.
struct Trigger {
    signal: Signal,
    level: f64,
    above: bool,
    /// It was beyond the level in the sample before.
    was: bool,
}

/// Where a capture stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stage {
    Armed,
    /// So many rows are still to come.
    Triggered(usize),
    Done,
}

/// Every sample around an instant.
struct Capture {
    client: u64,
    names: Vec<String>,
    signals: Vec<Signal>,
    trigger: Option<Trigger>,
    before: usize,
    after: usize,
    stage: Stage,
    rows: VecDeque<f64>,
    /// Tick of the last row, and the row of the trigger.
    tick: u64,
    trigger_row: usize,
}

/// Who looks at which signals.
pub struct Scope {
    machine: Machine,
    live: Vec<Live>,
    captures: Vec<Capture>,
}

/// A frame for a client; the text behind the number of those that were lost before it.
pub struct Frame {
    pub client: u64,
    pub text: String,
}

/// What a frame says.
#[derive(Serialize)]
struct Said<'a> {
    tick: u64,
    every: u64,
    rows: Vec<&'a [f64]>,
}

impl Scope {
    /// Nobody looks.
    pub fn new(machine: &Machine) -> Self {
        Self {
            machine: machine.clone(),
            live: vec![],
            captures: vec![],
        }
    }

    /// `scope`: these signals from now on.
    ///
    /// # Errors
    /// A signal that is none, too many.
    pub fn watch(&mut self, client: u64, asked: &Asked) -> Result<Value, String> {
        let signals = signals_of(&self.machine, asked)?;
        let every = asked.whole_if_any("every").unwrap_or(1).max(1);
        self.live.retain(|live| live.client != client);
        if signals.is_empty() {
            return Ok(json!({ "signals": [] }));
        }
        if self.live.len() >= MAX_WATCHERS {
            return Err(format!("{MAX_WATCHERS} clients look already"));
        }
        self.live.push(Live {
            client,
            signals,
            every,
            tick: 0,
            rows: vec![],
            age: 0,
        });
        Ok(json!({
            "signals": asked.with["signals"], "every": every, "period_s": self.machine.fine_period_s,
        }))
    }

    /// `capture`: arms one; the one before is forgotten.
    ///
    /// # Errors
    /// A signal that is none, too much.
    pub fn arm(&mut self, client: u64, asked: &Asked) -> Result<Value, String> {
        let signals = signals_of(&self.machine, asked)?;
        self.captures.retain(|capture| capture.client != client);
        if signals.is_empty() {
            return Ok(json!({ "rows": 0 }));
        }
        let rows = |key: &str| -> Result<usize, String> {
            let seconds = asked.number_if_any(key)?.unwrap_or(0.0);
            if seconds >= 0.0 {
                Ok((seconds / self.machine.fine_period_s).round() as usize)
            } else {
                Err(format!("\"{key}\" is {seconds}: a time is 0 or more"))
            }
        };
        let (before, after) = (rows("before_s")?, rows("after_s")?.max(1));
        let trigger = self.trigger(asked)?;
        if trigger.is_none() && before > 0 {
            return Err("\"before_s\" goes with \"when\": nothing is kept before now".to_string());
        }
        let taken: usize = self.captures.iter().map(Capture::most).sum();
        let most = before.saturating_add(after).saturating_mul(signals.len());
        if taken.saturating_add(most) > MAX_NUMBERS {
            return Err(format!(
                "{most} numbers are too many: {} have room with the captures of others",
                MAX_NUMBERS - taken
            ));
        }
        self.captures.push(Capture {
            client,
            names: asked
                .texts("signals")
                .iter()
                .map(ToString::to_string)
                .collect(),
            signals,
            stage: if trigger.is_some() {
                Stage::Armed
            } else {
                Stage::Triggered(after)
            },
            trigger,
            before,
            after,
            rows: VecDeque::new(),
            tick: 0,
            trigger_row: 0,
        });
        Ok(json!({ "rows": before + after, "period_s": self.machine.fine_period_s }))
    }

    fn trigger(&self, asked: &Asked) -> Result<Option<Trigger>, String> {
        let (above, below) = (asked.number_if_any("above")?, asked.number_if_any("below")?);
        let Some(name) = asked.text_if_any("when") else {
            return match above.or(below) {
                None => Ok(None),
                Some(_) => {
                    Err("a level goes with \"when\", the signal that is to pass it".to_string())
                }
            };
        };
        let signal = Signal::find(&self.machine, name)
            .ok_or_else(|| format!("there is no signal {name}"))?;
        let (level, above) = match (above, below) {
            (Some(level), None) => (level, true),
            (None, Some(level)) => (level, false),
            _ => return Err("\"when\" needs one of \"above\" and \"below\"".to_string()),
        };
        Ok(Some(Trigger {
            signal,
            level,
            above,
            was: true,
        }))
    }

    /// `captured`: the rows of this client's capture from a number on.
    ///
    /// # Errors
    /// There is none, or it is not done.
    pub fn captured(&self, client: u64, from: usize) -> Result<Value, String> {
        let capture = self
            .captures
            .iter()
            .find(|capture| capture.client == client)
            .ok_or("nothing was captured: \"capture\" arms one")?;
        match capture.stage {
            Stage::Armed => return Err("the capture waits for its trigger".to_string()),
            Stage::Triggered(_) => return Err("the capture is not done yet".to_string()),
            Stage::Done => {}
        }
        let width = capture.signals.len();
        let numbers = capture.rows.iter().skip(from.saturating_mul(width));
        let numbers: Vec<f64> = numbers
            .take(MAX_ANSWER_NUMBERS / width * width)
            .copied()
            .collect();
        let mut answer = capture.brief(self.machine.fine_period_s);
        answer["from"] = json!(from);
        answer["rows"] = json!(numbers.chunks(width).collect::<Vec<_>>());
        Ok(answer)
    }

    /// A client is gone.
    pub fn forget(&mut self, client: u64) {
        self.live.retain(|live| live.client != client);
        self.captures.retain(|capture| capture.client != client);
    }

    /// A job begins that has these signals of its own.
    pub fn begin_job(&mut self, own: &[String]) {
        let live = self.live.iter_mut().flat_map(|live| &mut live.signals);
        let captures = self.captures.iter_mut().flat_map(|capture| {
            let trigger = capture
                .trigger
                .iter_mut()
                .map(|trigger| &mut trigger.signal);
            capture.signals.iter_mut().chain(trigger)
        });
        for signal in live.chain(captures) {
            if let Signal::Of(name, at) = signal {
                *at = own.iter().position(|of| of == name);
            }
        }
    }

    /// A sample was sent. Soft side; allocates only where somebody looks.
    pub fn sample(&mut self, sample: &Sample, signals: &[f64]) {
        let Self {
            machine,
            live,
            captures,
        } = self;
        for live in live {
            if !sample.tick.is_multiple_of(live.every) {
                continue;
            }
            if live.rows.is_empty() {
                live.tick = sample.tick;
            }
            let values = live
                .signals
                .iter()
                .map(|of| of.value(machine, sample, signals));
            live.rows.extend(values);
        }
        for capture in captures {
            capture.sample(machine, sample, signals);
        }
    }

    /// What is to be sent now: frames that are full or old, and word of captures that are done. With `all`, the job is over.
    pub fn take(&mut self, all: bool) -> (Vec<Frame>, Vec<(u64, Value)>) {
        let mut frames = vec![];
        for live in &mut self.live {
            live.age += 1;
            let due = all || live.rows.len() >= FRAME_NUMBERS || live.age >= FRAME_PERIODS;
            if !due || live.rows.is_empty() {
                continue;
            }
            live.age = 0;
            let rows: Vec<_> = live.rows.chunks(live.signals.len()).collect();
            let frame = Said {
                tick: live.tick,
                every: live.every,
                rows,
            };
            let text = serde_json::to_string(&frame).unwrap_or_default();
            frames.push(Frame {
                client: live.client,
                // Behind the brace: the number of lost frames comes before it.
                text: text.get(1..).unwrap_or_default().to_string(),
            });
            live.rows.clear();
        }
        let period_s = self.machine.fine_period_s;
        let mut done = vec![];
        for capture in &mut self.captures {
            let short =
                all && matches!(capture.stage, Stage::Triggered(_)) && !capture.rows.is_empty();
            if capture.stage == Stage::Triggered(0) || short {
                capture.stage = Stage::Done;
                let mut event = capture.brief(period_s);
                event["event"] = json!("captured");
                done.push((capture.client, event));
            }
        }
        (frames, done)
    }
}

impl Capture {
    /// Numbers that it may hold.
    fn most(&self) -> usize {
        (self.before + self.after) * self.signals.len()
    }

    fn sample(&mut self, machine: &Machine, sample: &Sample, signals: &[f64]) {
        if let (Stage::Armed, Some(trigger)) = (self.stage, &mut self.trigger) {
            let value = trigger.signal.value(machine, sample, signals);
            let beyond = if trigger.above {
                value > trigger.level
            } else {
                value < trigger.level
            };
            if beyond && !trigger.was {
                self.stage = Stage::Triggered(self.after);
                self.trigger_row = self.rows.len() / self.signals.len();
            }
            trigger.was = beyond;
        }
        let values = self
            .signals
            .iter()
            .map(|of| of.value(machine, sample, signals));
        match &mut self.stage {
            Stage::Armed => {
                self.rows.extend(values);
                while self.rows.len() > self.before * self.signals.len() {
                    self.rows.pop_front();
                }
            }
            Stage::Triggered(0) | Stage::Done => {}
            Stage::Triggered(left) => {
                *left -= 1;
                self.rows.extend(values);
                self.tick = sample.tick;
            }
        }
    }

    fn brief(&self, period_s: f64) -> Value {
        let count = self.rows.len() / self.signals.len();
        json!({
            "signals": self.names, "count": count, "trigger_row": self.trigger_row,
            "last_tick": self.tick, "period_s": period_s,
        })
    }
}
