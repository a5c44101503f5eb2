//! Lines of G-code that come one after the other: from an operator, each from where the machine stands, or out of a pipe, each
//! planned through into those that come in time.
//!
//! `tandem mdi` and `tandem run -` are runs whose source is a `tandem_session::MdiSession`. The rough loop asks a source whether
//! it may go on (`tandem_rough::Source::may_go_on`) and says whether everything before is driven; for an operator the session
//! answers yes only at rest. A line goes through a copy of the interpreter, which takes the place of the original once every
//! block is judged. A fault ends the run, and the session enables a new one from there.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use tandem_gcode::{Interpreter, Item, ProbeResult};
use tandem_host::{
    HostError, Left, Registry, Run, Switches, as_dry_run, interpreter_config, moves_metal, planner,
    with_user_commands,
};
use tandem_machine::Machine;
use tandem_rings::{Rest, RestCause, Switched};
use tandem_rough::Source;
use tandem_sdk::AxisVector;

use crate::judge::LineJudge;
use crate::standstill::Standstill;

/// What the operator says next.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum NextLine {
    /// A line, without its end.
    Line(String),
    /// Nothing yet.
    Later,
    /// Nothing more.
    Over,
}

/// When a line is taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pace {
    /// Where the machine stands: an operator sees what each line has done. One that is wrong changes nothing.
    AtRest,
    /// As it comes. The end of the program ends the run; so does a line that is wrong, at rest at the end of those before it.
    Streams,
}

/// Who says the lines. Called on the soft side; on the virtual clock it may wait, and machine time stands still meanwhile.
pub trait MdiInput: Send {
    /// What is said next.
    fn next_line(&mut self) -> NextLine;

    /// A line is refused, in words with its place: nothing has changed. Not told of lines that stream.
    fn refused(&mut self, _why: &str) {}

    /// A line is taken: motion may begin.
    fn begins(&mut self) {}

    /// The last line is done and the machine stands at `position`, mm or rad. Not told of lines that stream.
    fn done(&mut self, _position: &AxisVector) {}
}

/// Lines on one machine. Modal state, offsets and parameters stay between lines, and through faults.
pub struct MdiSession<'a> {
    machine: Machine,
    registry: &'a Registry,
    switches: Switches,
    pace: Pace,
    /// What the last run has left on.
    switched: Switched,
    manual: Arc<Mutex<Manual>>,
}

impl<'a> MdiSession<'a> {
    /// A session that nothing has been said in. Host.
    ///
    /// # Errors
    /// The planner refuses.
    pub fn new(
        machine: Machine,
        registry: &'a Registry,
        switches: Switches,
        pace: Pace,
        input: Box<dyn MdiInput>,
    ) -> Result<Self, HostError> {
        let simulated = !moves_metal(&machine, registry);
        let mut interpreter = Interpreter::new(interpreter_config(&machine, simulated, switches));
        interpreter.set_file("input");
        let judge = LineJudge::new(machine.clone(), planner(&machine, registry)?);
        let manual = Manual {
            judge,
            interpreter,
            pace,
            input,
            failure: None,
            lines: 0,
            standing: Standstill::default(),
            busy: false,
        };
        Ok(Self {
            machine,
            registry,
            switches,
            pace,
            switched: Switched::default(),
            manual: Arc::new(Mutex::new(manual)),
        })
    }

    /// Enables the machine where it stands: a run that takes lines until there are no more, or a fault ends it.
    ///
    /// # Errors
    /// The plugins refuse, or do not go together.
    pub fn enable(&self) -> Result<Run, HostError> {
        let lines = Box::new(Lines(Arc::clone(&self.manual)));
        let lines = as_dry_run(&self.machine, self.switches, lines);
        let source = with_user_commands(&self.machine, self.registry, self.switches, lines);
        let name = match self.pace {
            Pace::AtRest => "manual input".to_string(),
            Pace::Streams => "standard input".to_string(),
        };
        let mut run = Run::of_source(
            self.machine.clone(),
            self.registry,
            name,
            source,
            self.switches,
        )?;
        run.begin_switched(&self.switched);
        Ok(run)
    }

    /// The operator acknowledges the fault that ended the last run: the next one resets its drives.
    pub fn reset_drives(&mut self) {
        self.switches.reset = true;
    }

    /// The machine has come to rest at `position` after a fault, and `left` is on still: the next run goes on from there.
    pub fn stands_at(&mut self, position: AxisVector, left: &Left) {
        self.machine.start = position;
        self.switched = left.switched;
        let mut manual = lock(&self.manual);
        manual.interpreter.set_position(position);
        manual.interpreter.set_switched_off();
        manual.busy = false;
        manual.standing.moves();
    }
}

struct Manual {
    judge: LineJudge,
    interpreter: Interpreter,
    pace: Pace,
    input: Box<dyn MdiInput>,
    /// What is wrong with a line that streams, and ends the run.
    failure: Option<String>,
    lines: u32,
    standing: Standstill,
    /// A line is being driven.
    busy: bool,
}

impl Manual {
    /// Takes a line whose every block can be driven; where it is refused nothing has changed. Whether it ends a program.
    fn interpret(&mut self, text: &str, items: &mut Vec<Item>) -> Result<bool, String> {
        self.lines += 1;
        let judged = self
            .judge
            .judge(&self.interpreter, self.lines, text)
            .map_err(|why| why.to_string())?;
        items.extend(judged.items);
        self.interpreter = judged.behind;
        Ok(judged.ends)
    }

    /// What still runs is switched off, as at the end of a program.
    fn finish(&self, items: &mut Vec<Item>) -> Result<bool, String> {
        let mut interpreter = self.interpreter.clone();
        interpreter.finish(items).map_err(|e| e.to_string())?;
        Ok(false)
    }

    /// The next lines that drive or switch anything; `false` where the program is over. What is wrong is told when those before it
    /// are driven.
    fn stream(&mut self, items: &mut Vec<Item>) -> Result<bool, String> {
        if let Some(failure) = &self.failure {
            return Err(failure.clone());
        }
        let more = self.next_lines(items);
        if more.is_err() {
            self.standing.moves();
            self.failure = more.as_ref().err().cloned();
        }
        Ok(more.unwrap_or(true))
    }

    fn next_lines(&mut self, items: &mut Vec<Item>) -> Result<bool, String> {
        while items.is_empty() {
            let text = match self.input.next_line() {
                NextLine::Line(text) => text,
                NextLine::Later => return Ok(true),
                NextLine::Over => return self.finish(items),
            };
            if self.interpret(&text, items)? {
                items.push(Item::End);
            }
        }
        Ok(true)
    }
}

/// The session as the rough loop pulls it.
struct Lines(Arc<Mutex<Manual>>);

impl Source for Lines {
    fn streams(&self) -> bool {
        let manual = lock(&self.0);
        manual.pace == Pace::Streams && manual.failure.is_none()
    }

    fn may_go_on(&mut self, driven: bool) -> bool {
        let mut manual = lock(&self.0);
        manual.standing.look(driven);
        if manual.pace == Pace::Streams {
            return manual.failure.is_none() || manual.standing.is_still();
        }
        if !manual.standing.is_still() {
            return false;
        }
        if manual.busy {
            manual.busy = false;
            let position = manual.interpreter.position();
            manual.input.done(&position);
        }
        true
    }

    fn next_items(&mut self, items: &mut Vec<Item>) -> Result<bool, String> {
        let mut manual = lock(&self.0);
        if manual.pace == Pace::Streams {
            return manual.stream(items);
        }
        loop {
            let text = match manual.input.next_line() {
                NextLine::Line(text) => text,
                NextLine::Later => return Ok(true),
                NextLine::Over => return manual.finish(items),
            };
            if let Err(why) = manual.interpret(&text, items) {
                manual.input.refused(&why);
                continue;
            }
            manual.busy = true;
            manual.standing.moves();
            manual.input.begins();
            return Ok(true);
        }
    }

    fn provide_input(&mut self, value: f64) {
        lock(&self.0).interpreter.provide_input(value);
    }

    /// Also after an abort an operator's session goes on, from where the machine stands; lines of a pipe were meant for the path.
    fn provide_rest(&mut self, rest: &Rest) -> bool {
        let mut manual = lock(&self.0);
        match rest.cause {
            RestCause::Abort | RestCause::Corrected | RestCause::Attached => {
                manual.interpreter.set_position(rest.position);
                if rest.cause == RestCause::Abort {
                    manual.interpreter.set_switched_off();
                }
            }
            RestCause::Edge | RestCause::Missed | RestCause::Already => {
                manual.interpreter.provide_probe(&ProbeResult {
                    touched: rest.latch,
                    rest: rest.position,
                });
            }
        }
        manual.standing.moves();
        rest.cause != RestCause::Abort || manual.pace == Pace::AtRest
    }
}

fn lock(manual: &Mutex<Manual>) -> MutexGuard<'_, Manual> {
    // A panic in the input leaves the interpreter as it was before the line.
    manual.lock().unwrap_or_else(PoisonError::into_inner)
}
