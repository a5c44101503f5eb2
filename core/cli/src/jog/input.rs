//! The session's hand: the lines of a pipe, one after the other; or none, where keys ask.

use std::sync::atomic::Ordering::Relaxed;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::Duration;

use tandem_session::NextLine;
use tandem_session::jog::{JogController, JogInput, JogMessage, JogRest, ReachMessage};

use super::line::{Line, parse};
use super::shared::Shared;
use crate::mdi::input::Input;

/// How often keys are looked after while the machine is in fault.
const LOOK: Duration = Duration::from_millis(20);

/// Lines of standard input.
pub struct Script {
    shared: Arc<Shared>,
    input: Input,
    /// Reading a line may wait for it: machine time stands still meanwhile.
    may_wait: bool,
    lines: u32,
    wait: Wait,
}

/// What the next line waits for.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Wait {
    Nothing,
    /// This fine period.
    Until(u64),
    /// The machine at rest.
    Rest,
}

impl Script {
    /// Nothing read yet.
    pub fn new(shared: Arc<Shared>, may_wait: bool) -> Self {
        Self {
            shared,
            input: Input::default(),
            may_wait,
            lines: 0,
            wait: Wait::Nothing,
        }
    }

    /// After a fault: waits for the word that takes it back; `false` where it does not come.
    fn is_reset(&mut self) -> bool {
        self.wait = Wait::Nothing;
        loop {
            let text = match self.input.next(false) {
                NextLine::Line(text) => text,
                NextLine::Over => return false,
                NextLine::Later if self.shared.is_reset_by_client() => return true,
                NextLine::Later => {
                    thread::sleep(LOOK);
                    continue;
                }
            };
            self.lines += 1;
            match parse(&text) {
                Ok(Line::Reset) => return true,
                Ok(Line::Quit) => return false,
                Ok(Line::Nothing) => {}
                _ => self.refuse(
                    1,
                    &format!("the machine is in fault; {} goes on", super::RESET),
                ),
            }
        }
    }

    fn is_due(&self, jogs: &JogController) -> bool {
        match self.wait {
            Wait::Nothing => true,
            Wait::Until(tick) => self.now() >= tick,
            Wait::Rest => jogs.is_still(),
        }
    }

    fn now(&self) -> u64 {
        self.shared.hub().map_or(0, |(hub, _)| hub.now())
    }

    fn take(&mut self, text: &str, jogs: &JogController) {
        self.lines += 1;
        match parse(text) {
            Ok(line) => {
                let column = text.len() - text.trim_start().len() + 1;
                self.carry_out(&line, jogs)
                    .unwrap_or_else(|why| self.refuse(column, &why));
            }
            Err(wrong) => self.refuse(wrong.column, &wrong.why),
        }
    }

    fn carry_out(&mut self, line: &Line, jogs: &JogController) -> Result<(), String> {
        match line {
            Line::Jog(words) => {
                jogs.ask(words.on(&jogs.machine().axes)?)?;
                self.wait = if is_step(words) {
                    Wait::Rest
                } else {
                    Wait::Nothing
                };
            }
            Line::Stop => {
                jogs.let_go();
                self.wait = Wait::Rest;
            }
            Line::Wait(seconds) => {
                let ticks = (seconds / jogs.machine().fine_period_s).round() as u64;
                self.wait = Wait::Until(self.now() + ticks);
            }
            Line::Where => self.shared.tell_position(),
            Line::Reset => return Err("there is no fault to reset".to_string()),
            Line::Quit => self.shared.quit.store(true, Relaxed),
            Line::Command(command) => {
                if let Some((hub, _)) = self.shared.hub() {
                    hub.give(*command)?;
                }
            }
            Line::Nothing => {}
        }
        Ok(())
    }

    fn refuse(&self, column: usize, why: &str) {
        self.shared
            .refuse(&format!("input:{}:{column}: error: {why}", self.lines));
    }
}

fn is_step(words: &JogMessage) -> bool {
    matches!(words.reach, ReachMessage::By(_))
}

/// What asks for jogs.
#[derive(Clone)]
pub struct Inputs {
    shared: Arc<Shared>,
    /// None where keys ask.
    script: Arc<Mutex<Option<Script>>>,
}

impl Inputs {
    /// Nothing asked yet.
    pub fn new(shared: Arc<Shared>, script: Option<Script>) -> Self {
        Self {
            shared,
            script: Arc::new(Mutex::new(script)),
        }
    }

    /// After a fault: waits for the operator's word; `false` where the session is over.
    pub fn is_reset(&self) -> bool {
        if let Some(script) = &mut *self.script() {
            return script.is_reset();
        }
        self.shared.reset.store(false, Relaxed);
        while !self.shared.reset.load(Relaxed) && !self.shared.is_reset_by_client() {
            if self.shared.is_over() {
                return false;
            }
            thread::sleep(LOOK);
        }
        true
    }

    fn script(&self) -> MutexGuard<'_, Option<Script>> {
        self.script.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl JogInput for Inputs {
    fn period(&mut self, jogs: &JogController) {
        if self.shared.is_over() {
            jogs.end();
            return;
        }
        let mut script = self.script();
        let Some(script) = script.as_mut().filter(|_| jogs.is_ready()) else {
            return;
        };
        // What follows the word that ends the session is nobody's line.
        while script.is_due(jogs) && !self.shared.is_over() {
            script.wait = Wait::Nothing;
            match script.input.next(script.may_wait) {
                NextLine::Line(text) => script.take(&text, jogs),
                NextLine::Later => return,
                NextLine::Over => return jogs.end(),
            }
        }
    }

    fn is_waiting(&self) -> bool {
        self.script()
            .as_ref()
            .is_some_and(|script| matches!(script.wait, Wait::Until(_)))
    }

    fn rested(&mut self, jogs: &JogController, rest: &JogRest) {
        self.shared.rested(jogs, rest);
    }

    fn refused(&mut self, why: &str) {
        self.shared.refuse(why);
    }
}
