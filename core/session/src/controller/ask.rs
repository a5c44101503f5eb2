//! What clients ask for: judged by the state of the machine, and done or ordered of the loop that drives.
//!
//! Nothing is locked while a disk is waited for, so that whoever stops the machine, or looks at it, waits for no disk of another's.

use std::sync::{MutexGuard, PoisonError};

use serde_json::{Value, json};
use tandem_host::Command;

use super::described;
use super::dispatcher::{Answered, Dispatcher, Inner, Loaded, Mode, Order, RequestId, StateWrite};
use super::lines::{TakenLine, lock};
use super::persistence::HELD;
use super::programs::{Upload, discard};
use super::request::Asked;
use super::states::{ControllerState, judge};
use super::words::word_of;
use crate::jog::{JogMessage, ReachMessage};

/// Why what came before a stop is not begun behind it.
pub const STOPPED: &str = "the machine was stopped before this was begun: ask again";

impl Dispatcher {
    /// Whether an answer waits for a disk.
    pub fn waits_for_disk(&self, asked: &Asked) -> bool {
        match asked.name() {
            "mdi" => asked
                .text("line")
                .is_ok_and(|line| lock(&self.lines).calls(line)),
            name => [
                "list",
                "upload",
                "acknowledge",
                "load",
                "check",
                "touch-off",
                "set-offset",
                "set-tool",
                "set-parameter",
            ]
            .contains(&name),
        }
    }

    /// So many stops were asked for.
    pub fn stops(&self) -> u64 {
        self.lock().stops
    }

    /// Judges a request by the state of the machine, and does it or orders it. May wait for a disk, where
    /// [`Dispatcher::waits_for_disk`] says so.
    pub fn ask(&self, from: RequestId, asked: &Asked) -> Answered {
        self.ask_since(from, asked, self.stops())
    }

    /// The same for a request that came when so many stops had been asked for: behind a later one it moves nothing.
    pub fn ask_since(&self, from: RequestId, asked: &Asked, stops: u64) -> Answered {
        let name = asked.name();
        let done = match name {
            "list" | "upload" | "acknowledge" => {
                fits(self.state(), asked, name).and_then(|()| match name {
                    "list" => self.list(),
                    "upload" => self.upload(from, asked, &mut self.pending()),
                    _ => self.acknowledge(asked),
                })
            }
            "touch-off" | "set-offset" | "set-tool" | "set-parameter" => {
                self.change(asked, name, stops)
            }
            "mdi" if self.waits_for_disk(asked) => self.call(from, asked, stops),
            "load" | "check" => {
                let read = fits(self.state(), asked, name).and_then(|()| self.program_of(asked));
                return match read {
                    Ok(program) => self.ask_now(from, asked, stops, Some(program)),
                    Err(why) => Some(Err(why)),
                };
            }
            _ => return self.ask_now(from, asked, stops, None),
        };
        Some(done)
    }

    /// What waits for nothing.
    fn ask_now(
        &self,
        from: RequestId,
        asked: &Asked,
        stops: u64,
        program: Option<Loaded>,
    ) -> Answered {
        let name = asked.name();
        let mut inner = self.lock();
        if let Err(why) = self.may(&inner, asked, name, stops) {
            return Some(Err(why));
        }
        let order = match self.act(from, asked, name, program, &mut inner) {
            Ok(Acted::Done(value)) => return Some(Ok(value)),
            Err(why) => return Some(Err(why)),
            Ok(Acted::Begins(order, value)) => (order, Some(Ok(value))),
            Ok(Acted::Ordered(order)) => (order, None),
        };
        inner.order = Some(order.0);
        order.1
    }

    /// Whether a request can be granted now.
    fn may(&self, inner: &Inner, asked: &Asked, name: &str, stops: u64) -> Result<(), String> {
        fits(self.state_of(inner), asked, name)?;
        if inner.stops != stops && moves(name) {
            return Err(STOPPED.to_string());
        }
        let joins = matches!(
            (&inner.order, name),
            (Some(Order::Mdi), "mdi") | (Some(Order::Jog), "jog" | "jog-stop")
        );
        if (inner.state_write == StateWrite::UnderWay || inner.order.is_some() && !joins)
            && begins_or_sets(name)
        {
            return Err("another request is being begun: wait for its answer".to_string());
        }
        Ok(())
    }

    /// Changes what lasts, while nothing else is begun.
    fn change(&self, asked: &Asked, name: &str, stops: u64) -> Result<Value, String> {
        let mut inner = self.lock();
        self.may(&inner, asked, name, stops)?;
        inner.state_write = StateWrite::UnderWay;
        drop(inner);
        let set = self.set(asked, name);
        self.lock().state_write = StateWrite::Idle;
        set
    }

    /// Judges a line that calls a subroutine, and takes it. Where something has come meanwhile it is judged once more behind that.
    fn call(&self, from: RequestId, asked: &Asked, stops: u64) -> Result<Value, String> {
        let text = asked.text("line")?;
        let files = lock(&self.lines).files();
        loop {
            let inner = self.lock();
            self.may(&inner, asked, "mdi", stops)?;
            let begun = lock(&self.lines).begin_call();
            drop(inner);
            let call = begun.map_err(|why| why.to_string())?;
            let judged = call.judge(&files, text).map_err(|why| why.to_string())?;
            let mut inner = self.lock();
            self.may(&inner, asked, "mdi", stops)?;
            let taken = lock(&self.lines).end_call((from.client, from.id), &call, judged);
            let Some(taken) = taken else { continue };
            let taken = taken.map_err(|why| why.to_string())?;
            if Self::begins_lines(&inner, taken) {
                inner.order = Some(Order::Mdi);
            }
            return Ok(json!({ "judged": true }));
        }
    }

    /// Whether a job is to be ordered for a line that was taken.
    fn begins_lines(inner: &Inner, taken: TakenLine) -> bool {
        inner.mode != Mode::Mdi && inner.order.is_none() && taken.begins
    }

    /// A client is gone, and what it was bringing with it. May wait for a disk.
    pub fn forget_upload(&self, client: u64) {
        let mut pending = self.pending();
        if pending.as_ref().is_some_and(|upload| upload.is_by(client)) {
            discard(&mut pending);
        }
    }

    /// The program that is on its way into the folder.
    fn pending(&self) -> MutexGuard<'_, Option<Upload>> {
        self.upload.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Does or orders a request that was granted.
    fn act(
        &self,
        from: RequestId,
        asked: &Asked,
        name: &str,
        program: Option<Loaded>,
        inner: &mut Inner,
    ) -> Result<Acted, String> {
        match name {
            "status" => Ok(Acted::Done(self.status_of(inner))),
            "history" => Ok(Acted::Done(show_history(asked, inner))),
            "alarms" => Ok(Acted::Done(
                json!({ "alarms": inner.history.open_alarms() }),
            )),
            "machine" => Ok(Acted::Done(described::machine(&self.machine))),
            "tables" => Ok(Acted::Done(self.show_tables())),
            "path" => Ok(Acted::Done(self.show_path(asked))),
            "text" => Ok(Acted::Done(show_text(asked, inner))),
            "scope" => self.scope().watch(from.client, asked).map(Acted::Done),
            "capture" => self.scope().arm(from.client, asked).map(Acted::Done),
            "captured" => self.show_captured(from, asked).map(Acted::Done),
            "policy-parameters" => Ok(Acted::Done(
                json!({ "parameters": inner.policy_parameters, "declared": inner.declared_parameters }),
            )),
            "set-policy-parameter" => set_policy_parameter(from, asked).map(Acted::Ordered),
            "hold" => self.give(Command::Hold),
            "resume" => self.give(Command::Resume),
            "emergency-stop" => self.stop_in_emergency(inner),
            "abort" => self.abort(inner),
            "feed-override" => self.give(Command::FeedOverride(ratio(asked)?)),
            "rapid-override" => self.give(Command::RapidOverride(ratio(asked)?)),
            "single-block" => self.give(Command::SingleBlock(asked.on()?)),
            "optional-stop" => self.give(Command::OptionalStop(asked.on()?)),
            "block-delete" => {
                inner.block_delete = asked.on()?;
                Ok(Acted::Done(json!({ "block_delete": inner.block_delete })))
            }
            "load" | "check" => check(from, program, name == "load").map(Acted::Ordered),
            "start" => start(from, inner).map(Acted::Ordered),
            "mdi" => self.manual_line(from, asked, inner),
            "jog-stop" => {
                self.jogs.let_go();
                Ok(Acted::Done(json!({ "jog": "stop" })))
            }
            "jog" => self.jog(asked, inner),
            "home" => self.home(from, asked).map(Acted::Ordered),
            "reset" | "enable" => Ok(Acted::Ordered(Order::Enable {
                from,
                resets: name == "reset",
                emergency_stops: inner.emergency_stops,
            })),
            "disable" => Ok(Acted::Ordered(Order::Disable { from })),
            other => Err(format!("{other} is not done here")),
        }
    }

    /// Gives the fine loop a command; the answer is the tick at which it came.
    fn give(&self, command: Command) -> Result<Acted, String> {
        let tick = self.hub.give(command)?;
        Ok(Acted::Done(json!({ "tick": tick })))
    }

    fn show_tables(&self) -> Value {
        let persistent = lock(&self.lines).standing().persistent_data();
        described::tables(&self.machine, &persistent)
    }

    fn show_path(&self, asked: &Asked) -> Value {
        let number = |key: &str| asked.whole_if_any(key).unwrap_or(0);
        let from = number("from");
        let driven_from = number("driven_from");
        if asked.is_on("packed") {
            self.path().show_packed(from, driven_from)
        } else {
            self.path().show(from, driven_from)
        }
    }

    fn show_captured(&self, from: RequestId, asked: &Asked) -> Result<Value, String> {
        let first = asked.whole_if_any("from").unwrap_or(0) as usize;
        self.scope().captured(from.client, first)
    }

    fn stop_in_emergency(&self, inner: &mut Inner) -> Result<Acted, String> {
        inner.stops += 1;
        inner.emergency_stops += 1;
        self.give(Command::EmergencyStop)
    }

    fn abort(&self, inner: &mut Inner) -> Result<Acted, String> {
        let done = if inner.is_about_to_move() {
            Acted::Done(json!({ "tick": self.hub.now() }))
        } else {
            self.give(Command::Abort)?
        };
        inner.aborting = true;
        inner.stops += 1;
        self.jogs.forget();
        Ok(done)
    }

    /// Judges a line that waits for no disk, and takes it.
    fn manual_line(&self, from: RequestId, asked: &Asked, inner: &Inner) -> Result<Acted, String> {
        let taken = lock(&self.lines)
            .judge(from.client, from.id, asked.text("line")?)
            .map_err(|why| why.to_string())?;
        let judged = json!({ "judged": true });
        Ok(if Self::begins_lines(inner, taken) {
            Acted::Begins(Order::Mdi, judged)
        } else {
            Acted::Done(judged)
        })
    }

    fn jog(&self, asked: &Asked, inner: &Inner) -> Result<Acted, String> {
        let jog = jog_of(asked)?.on(&self.machine.axes)?;
        let done = json!({ "jog": asked.with.get("axis") });
        if asked.is_on("again") {
            self.jogs.keep_alive(jog)?;
            return Ok(Acted::Done(done));
        }
        self.jogs.ask(jog)?;
        let waits = inner.mode == Mode::Jog || inner.order.is_some();
        Ok(if waits {
            Acted::Done(done)
        } else {
            Acted::Begins(Order::Jog, done)
        })
    }

    fn home(&self, from: RequestId, asked: &Asked) -> Result<Order, String> {
        let axis = asked.text_if_any("axis").map(|axis| self.axis(axis));
        Ok(Order::Home {
            from,
            axis: axis.transpose()?,
        })
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

/// Whether something may move behind it, that a stop was to prevent.
fn moves(name: &str) -> bool {
    ["start", "mdi", "jog", "home", "resume", "reset", "enable"].contains(&name)
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

fn show_history(asked: &Asked, inner: &Inner) -> Value {
    let count = asked.whole_if_any("count").unwrap_or(HELD as u64);
    inner.history.show(count as usize)
}

/// Lines of the program that is loaded.
fn show_text(asked: &Asked, inner: &Inner) -> Value {
    let first = asked.whole_if_any("from").unwrap_or(1);
    let count = asked.whole_if_any("lines").unwrap_or(u64::MAX);
    inner.loaded.as_ref().map_or_else(
        || json!({ "program": null, "lines": [], "count": 0 }),
        |program| program.show(first, count),
    )
}

fn set_policy_parameter(from: RequestId, asked: &Asked) -> Result<Order, String> {
    Ok(Order::SetPolicyParameter {
        from,
        name: asked.text("name")?.to_string(),
        value: asked.number("value")?,
    })
}

fn check(from: RequestId, program: Option<Loaded>, load: bool) -> Result<Order, String> {
    Ok(Order::Check {
        from,
        program: program.ok_or("the program was not read")?,
        load,
    })
}

fn start(from: RequestId, inner: &Inner) -> Result<Order, String> {
    if inner.loaded.is_none() {
        return Err("no program is loaded: \"load\" loads one".to_string());
    }
    Ok(Order::Start { from })
}

/// The ratio that an override is set to.
fn ratio(asked: &Asked) -> Result<f64, String> {
    let value = asked.number("ratio")?;
    if value.is_finite() && value >= 0.0 {
        Ok(value)
    } else {
        Err(format!("{value} is not a number of zero or more"))
    }
}

/// A jog as clients ask for it.
fn jog_of(asked: &Asked) -> Result<JogMessage, String> {
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
