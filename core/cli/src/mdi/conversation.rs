//! What is typed and what is answered.

use std::io::{Write, stdout};
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread;

use tandem_sdk::{Axes, AxisVector};
use tandem_session::operator::{OperatorHub, Position};
use tandem_session::{MdiInput, NextLine};

use super::RESET;
use super::input::Input;
use crate::operator::{Keyboard, LOOK, Operator, Stops};

/// What the conversation shares with the command: it outlives faults.
pub struct Shared {
    real_time: bool,
    /// Lines are typed at a terminal: it is prompted, and gives keys during motion.
    keys: bool,
    refused: AtomicBool,
    fault: AtomicBool,
    inner: Mutex<Inner>,
}

#[derive(Default)]
struct Inner {
    input: Input,
    hub: Option<Arc<OperatorHub>>,
    stops: Option<Stops>,
    keyboard: Option<Keyboard>,
}

impl Shared {
    /// Nothing said yet.
    pub fn new(real_time: bool, keys: bool) -> Self {
        if keys {
            super::explain();
        }
        Self {
            real_time,
            keys,
            refused: AtomicBool::new(false),
            fault: AtomicBool::new(false),
            inner: Mutex::new(Inner {
                input: Input::new(keys),
                ..Inner::default()
            }),
        }
    }

    /// Keys of the next motion go to this operator's hub.
    pub fn follow(&self, operator: &Operator) {
        let mut inner = self.inner();
        (inner.hub, inner.stops) = (Some(Arc::clone(operator.hub())), operator.stops());
    }

    /// Gives the terminal back to lines.
    pub fn take_keys(&self) {
        let keyboard = self.inner().keyboard.take();
        drop(keyboard);
    }

    /// After a fault: waits for the word that takes it back, typed or from a client; `false` where it does not come.
    pub fn is_reset(&self) -> bool {
        self.fault.store(true, Relaxed);
        loop {
            let mut inner = self.inner();
            let next = inner.input.next(false);
            let is_reset = inner.hub.as_ref().is_some_and(|hub| hub.is_reset());
            drop(inner);
            if is_reset {
                self.fault.store(false, Relaxed);
                return true;
            }
            match next {
                NextLine::Line(line) if is_farewell(&line) => return false,
                NextLine::Line(line) if line.trim() == RESET => {
                    self.fault.store(false, Relaxed);
                    return true;
                }
                NextLine::Line(line) if line.trim().is_empty() => {}
                NextLine::Line(_) => {
                    self.refuse(&format!(
                        "the machine is in fault; {RESET} goes on, quit ends the session"
                    ));
                }
                NextLine::Later => thread::sleep(LOOK),
                NextLine::Over => return false,
            }
        }
    }

    /// Whether the last run ended in a fault that nobody took back.
    pub fn ended_in_fault(&self) -> bool {
        self.fault.load(Relaxed)
    }

    /// Whether any line was refused.
    pub fn has_refused(&self) -> bool {
        self.refused.load(Relaxed)
    }

    fn refuse(&self, why: &str) {
        self.refused.store(true, Relaxed);
        say!("{why}");
    }

    fn inner(&self) -> MutexGuard<'_, Inner> {
        self.inner.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Whether a line is a word that ends a session.
pub fn is_farewell(line: &str) -> bool {
    let word = line.trim();
    word.eq_ignore_ascii_case("quit") || word.eq_ignore_ascii_case("exit")
}

/// The dialogue of a session.
pub struct Conversation {
    shared: Arc<Shared>,
    axes: Axes,
}

impl Conversation {
    /// A dialogue on standard input and output.
    pub fn new(shared: Arc<Shared>, axes: Axes) -> Self {
        Self { shared, axes }
    }
}

impl MdiInput for Conversation {
    fn next_line(&mut self) -> NextLine {
        let mut inner = self.shared.inner();
        if inner.stops.as_ref().is_some_and(Stops::are_asked) {
            return NextLine::Over;
        }
        let next = inner.input.next(!self.shared.real_time);
        match next {
            NextLine::Line(line) if is_farewell(&line) => NextLine::Over,
            NextLine::Line(line) if line.trim() == RESET => {
                drop(inner);
                self.shared.refuse("there is no fault to reset");
                NextLine::Later
            }
            other => other,
        }
    }

    fn refused(&mut self, why: &str) {
        self.shared.refuse(why);
    }

    fn begins(&mut self) {
        let mut inner = self.shared.inner();
        if let (true, Some(hub), Some(stops)) = (self.shared.keys, &inner.hub, &inner.stops) {
            // Without keys the line is driven all the same.
            inner.keyboard = Keyboard::begin(hub.clone(), stops.clone()).ok();
        }
    }

    fn done(&mut self, position: &AxisVector) {
        self.shared.take_keys();
        let text: Vec<String> = Position::new(&self.axes, position)
            .values()
            .iter()
            .map(|(name, value)| format!("{name} {value:.4}"))
            .collect();
        // A reader that has gone away is no reason to stop.
        let _ = writeln!(stdout(), "{}", text.join("  "));
    }
}
