//! What keys, script and command share; it outlives faults.

use std::io::{Write, stderr, stdout};
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use tandem_rings::Sample;
use tandem_sdk::{Axes, AxisVector};
use tandem_session::jog::{JogController, JogEnd, JogRest};
use tandem_session::operator::{OperatorHub, Position};

use crate::operator::{Operator, Stops, tell};

/// What keys, script and command share.
pub struct Shared {
    /// Keys are taken from the terminal.
    pub keys: bool,
    axes: Axes,
    refused: AtomicBool,
    /// The operator wants to go on after a fault.
    pub reset: AtomicBool,
    /// The operator ends the session.
    pub quit: AtomicBool,
    inner: Mutex<Inner>,
}

struct Inner {
    position: AxisVector,
    hub: Option<Arc<OperatorHub>>,
    stops: Stops,
    /// What the terminal was told last: a key that repeats is told once.
    said: String,
}

impl Shared {
    /// Nothing said yet, at `position`.
    pub fn new(keys: bool, axes: Axes, position: AxisVector) -> Self {
        let inner = Inner {
            position,
            hub: None,
            stops: Stops::default(),
            said: String::new(),
        };
        Self {
            keys,
            axes,
            refused: AtomicBool::new(false),
            reset: AtomicBool::new(false),
            quit: AtomicBool::new(false),
            inner: Mutex::new(inner),
        }
    }

    /// From now on commands go to this operator's hub.
    pub fn follow(&self, operator: &Operator) {
        let mut inner = self.inner();
        inner.hub = Some(Arc::clone(operator.hub()));
        inner.stops = operator.stops().unwrap_or_default();
    }

    /// The hub of the run, and how it is stopped.
    pub fn hub(&self) -> Option<(Arc<OperatorHub>, Stops)> {
        let inner = self.inner();
        inner.hub.clone().map(|hub| (hub, inner.stops.clone()))
    }

    /// Whether a client has taken back the fault that the session stands in.
    pub fn is_reset_by_client(&self) -> bool {
        self.inner().hub.as_ref().is_some_and(|hub| hub.is_reset())
    }

    /// Whether the session is to end.
    pub fn is_over(&self) -> bool {
        self.quit.load(Relaxed) || self.inner().stops.are_asked()
    }

    /// Something was refused, in words.
    pub fn refuse(&self, why: &str) {
        self.refused.store(true, Relaxed);
        self.say(why);
    }

    /// Whether anything was refused.
    pub fn has_refused(&self) -> bool {
        self.refused.load(Relaxed)
    }

    /// Words for the operator.
    pub fn say(&self, words: &str) {
        if !self.keys {
            say!("{words}");
        } else if std::mem::replace(&mut self.inner().said, words.to_string()) != words {
            tell(words);
        }
    }

    /// A jog is over.
    pub fn rested(&self, jogs: &JogController, rest: &JogRest) {
        self.inner().position = rest.position;
        let name = jogs.name(rest.axis);
        match rest.end {
            JogEnd::AtLimit => {
                let limit = jogs.shown(rest.axis, rest.position[rest.axis]);
                self.say(&format!("{name} is at its travel limit, {limit}"));
            }
            // A key that is let go says no more than that.
            JogEnd::Late if !self.keys => {
                self.say(&format!("{name} stopped: the keep-alive was late"));
            }
            _ => self.inner().said.clear(),
        }
        if !self.keys {
            self.tell_position();
        }
    }

    /// Where the machine is, as a line of standard output.
    pub fn tell_position(&self) {
        // A reader that has gone away is no reason to stop.
        let _ = writeln!(stdout(), "{}", self.position(4));
    }

    /// A sample was sent.
    pub fn sample(&self, sample: &Sample) {
        self.inner().position = sample.command;
        if self.keys && sample.tick.is_multiple_of(100) {
            let feed = sample.feed_mm_per_s * 60.0;
            // A terminal that has gone away ends the session with its signal.
            let _ = write!(
                stderr(),
                "\r\x1b[K{}  {}  F{feed:.0}",
                sample.state.name(),
                self.position(3)
            );
            let _ = stderr().flush();
        }
    }

    fn position(&self, digits: usize) -> String {
        let position = Position::new(&self.axes, &self.inner().position);
        let each = position
            .values()
            .iter()
            .map(|(name, value)| format!("{name} {value:.digits$}"));
        each.collect::<Vec<_>>().join("  ")
    }

    fn inner(&self) -> MutexGuard<'_, Inner> {
        self.inner.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
