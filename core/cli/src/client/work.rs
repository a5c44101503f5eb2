//! A client at work: it follows a job to its end, with keys and signals to stop it.

use std::io::IsTerminal;
use std::sync::Arc;
use std::time::Duration;

use serde_json::{Value, json};
use tandem_host::Command;

use super::connection::{Connection, Trouble};
use super::panel::RemotePanel;
use crate::operator::{Keyboard, Signals, Stops, is_on_terminal, tell};
use crate::{FAULT, REFUSED};

/// How often signals are looked after while nothing is said.
const LOOK: Duration = Duration::from_millis(20);
/// Rate of the status that keys and the terminal's line are fed from, Hz.
const STATUS_HZ: f64 = 10.0;

/// What became of a job.
pub struct JobEnd {
    told: Value,
}

impl JobEnd {
    /// As the controller tells it.
    pub fn of(told: &Value) -> Self {
        Self { told: told.clone() }
    }

    /// The run as numbers.
    pub fn summary(&self) -> &Value {
        &self.told["summary"]
    }

    /// Where the machine stands.
    pub fn position(&self) -> String {
        shown_position(&self.told["position"], 4)
    }

    /// Whether the job came to its end.
    pub fn is_done(&self) -> bool {
        self.told["job"]["outcome"] == "done"
    }

    /// The fault that ended it.
    pub fn fault(&self) -> Option<&str> {
        self.told["job"]["fault"].as_str()
    }

    /// Says what ended it before its end.
    pub fn tell(&self) {
        if let Some(fault) = self.fault() {
            tell(&format!("fault: {fault}"));
        } else if let Some(stopped) = self.told["job"]["stopped"].as_str() {
            tell(stopped);
        } else if !self.is_done() {
            tell("the controller has aborted it");
        }
    }

    /// The exit status of a command that drove nothing else.
    pub fn status(&self) -> u8 {
        if self.is_done() { 0 } else { FAULT }
    }
}

/// A client that commands the machine.
pub struct Work {
    pub connection: Connection,
    pub panel: Arc<RemotePanel>,
    signals: Signals,
    /// Keys are taken from the terminal.
    pub keys: bool,
}

impl Work {
    /// From now on signals stop what this client drives.
    ///
    /// # Errors
    /// The system's words.
    pub fn begin(connection: Connection) -> Result<Self, String> {
        let panel = Arc::new(RemotePanel::new(connection.requests.clone()));
        Ok(Self {
            signals: Signals::catch(panel.clone())?,
            panel,
            connection,
            keys: is_on_terminal(),
        })
    }

    /// How often a stop was asked for.
    pub fn stops(&self) -> Stops {
        self.signals.stops()
    }

    /// Asks for what moves the machine; no more once a stop was asked for. One that comes meanwhile may reach the controller before
    /// anything is driven, which refuses it then: it is said once more behind what it is to stop.
    ///
    /// # Errors
    /// The controller refuses, or is gone; or a stop was asked for.
    pub fn ask_to_move(&mut self, request: &str, with: Value) -> Result<Value, Trouble> {
        let stops = self.stops();
        if stops.are_asked() {
            return Err(Trouble::Stopped);
        }
        let done = self.connection.ask(request, with)?;
        if stops.are_asked() {
            self.connection
                .requests
                .say(Command::Abort.name(), json!({}))?;
        }
        Ok(done)
    }

    /// Feeds the keys with the status of the machine.
    ///
    /// # Errors
    /// The controller refuses, or is gone.
    pub fn subscribe(&mut self) -> Result<(), Trouble> {
        if self.keys || std::io::stderr().is_terminal() {
            self.connection
                .ask("subscribe", json!({ "rate_hz": STATUS_HZ }))?;
        }
        Ok(())
    }

    /// Takes the keys of the terminal, where it is one.
    pub fn take_keys(&self) -> Option<Keyboard> {
        // Without keys the job is driven all the same.
        self.keys
            .then(|| Keyboard::begin(self.panel.clone(), self.stops()).ok())
            .flatten()
    }

    /// Resets a fault in which the machine stands, and homes all axes, where either is asked for.
    ///
    /// # Errors
    /// The controller refuses, or is gone; a homing that did not come to its end is one.
    pub fn prepare(&mut self, resets: bool, homes: bool) -> Result<(), Trouble> {
        self.connection.take_lease()?;
        let status = self.connection.ask("status", json!({}))?;
        if resets
            && ["fault", "emergency-stop"]
                .iter()
                .any(|state| status["state"] == *state)
        {
            self.ask_to_move("reset", json!({}))?;
        }
        if homes {
            self.ask_to_move("home", json!({}))?;
            let end = self.follow("home", &mut |_| ())?;
            if !end.is_done() {
                end.tell();
                return Err(Trouble::Gone("the machine is not homed".to_string()));
            }
        }
        Ok(())
    }

    /// What comes next; signals and refused commands of keys are seen to. None where nothing has come for a little while.
    ///
    /// # Errors
    /// The controller is gone, or ends.
    pub fn hear(&mut self) -> Result<Option<Value>, Trouble> {
        let Some(told) = self.connection.hear(LOOK)? else {
            return Ok(None);
        };
        match told["event"].as_str() {
            Some("end") => {
                return Err(Trouble::Gone(
                    "the controller ends: it brings the machine to rest and lets the drives go"
                        .to_string(),
                ));
            }
            Some("status") => self.panel.follow(&told["status"]),
            Some("waits") => tell(&format!(
                "line {}: the program waits; {} goes on",
                told["line"],
                if self.keys {
                    "Enter"
                } else {
                    "the request resume"
                }
            )),
            Some("lease") if told["lost_to"].is_u64() => {
                self.connection.lost_lease();
                tell(&format!(
                    "client {} has taken the control over",
                    told["lost_to"]
                ));
            }
            Some("refused") => tell(told["why"].as_str().unwrap_or_default()),
            None => {
                if let Some(why) = told["error"]["why"].as_str() {
                    tell(why);
                }
            }
            Some(_) => {}
        }
        Ok(Some(told))
    }

    /// Follows the job `job` to its end.
    ///
    /// # Errors
    /// The controller is gone.
    pub fn follow(&mut self, job: &str, see: &mut dyn FnMut(&Value)) -> Result<JobEnd, Trouble> {
        loop {
            let Some(told) = self.hear()? else { continue };
            see(&told);
            if told["event"] == "job" && told["job"]["job"] == job {
                return Ok(JobEnd::of(&told));
            }
        }
    }
}

/// Says what went wrong; the exit status is that of a refusal, or of a controller that is gone: what the machine does then is
/// not known here.
pub fn tell_trouble(trouble: &Trouble) -> u8 {
    tell(trouble.words());
    match trouble {
        Trouble::Refused(_) => REFUSED,
        Trouble::Gone(_) | Trouble::Stopped => FAULT,
    }
}

/// The exit status of a conversation that came to its end as `done` says; what went wrong is told.
pub fn exit_status(done: Result<(), Trouble>, has_faulted: bool, was_refused: bool) -> u8 {
    match done {
        Err(trouble) => tell_trouble(&trouble),
        Ok(()) if has_faulted => FAULT,
        Ok(()) => u8::from(was_refused) * REFUSED,
    }
}

/// Coordinates as the controller tells them, in the order in which axes are named.
pub fn in_order(position: &Value) -> impl Iterator<Item = (&str, f64)> {
    let all = position.as_object().into_iter().flatten();
    let mut all: Vec<(&str, f64)> = all
        .map(|(name, value)| (name.as_str(), value.as_f64().unwrap_or_default()))
        .collect();
    all.sort_by_key(|(name, _)| "xyzabcuvw".find(&name[..1.min(name.len())]));
    all.into_iter()
}

/// Coordinates as commands print them.
pub fn shown_position(position: &Value, digits: usize) -> String {
    let each = in_order(position).map(|(name, value)| format!("{name} {value:.digits$}"));
    each.collect::<Vec<_>>().join("  ")
}
