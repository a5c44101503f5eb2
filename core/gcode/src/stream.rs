//! The second pass: items on demand.

use std::sync::Arc;

use tandem_sdk::AxisVector;

use crate::config::Config;
use crate::flow::{Execution, Step};
use crate::item::{Item, ProbeResult};
use crate::persistent::{StateTag, StateTags};
use crate::program::lines::Pass;
use crate::program::{Program, ProgramError};

/// A checked program, read again through the same file and handed out as far as it is asked for. Each chunk of text is
/// compared with what the first pass read before a line of it is interpreted.
pub struct Stream {
    program: Program,
    execution: Execution,
    waiting: Option<Waiting>,
    /// Who is told what lines change, and how things were behind the last line that was told.
    state_tags: Option<StateTags>,
    told: Option<StateTag>,
}

/// What must be provided before the next item.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Waiting {
    Input,
    Probe,
}

impl Stream {
    /// The items of `program`, from the first line.
    ///
    /// # Errors
    /// The program has not gone through [`crate::check`], or cannot be read.
    pub fn new(mut program: Program, config: &Config) -> Result<Self, ProgramError> {
        if program.chunks.is_none() {
            return Err(ProgramError::Unchecked(Arc::clone(&program.name)));
        }
        let execution = Execution::new(&mut program, config, Pass::Second);
        Ok(Self {
            program,
            execution,
            waiting: None,
            state_tags: None,
            told: None,
        })
    }

    /// Tells `state_tags` what every line changes, with the block at which the path reaches it. Before the first item.
    pub fn tell(&mut self, state_tags: StateTags) {
        self.execution.interpreter.keep_state_tags();
        self.state_tags = Some(state_tags);
    }

    fn tell_of_line(&mut self, first_block: u64) {
        let Some(state_tags) = &self.state_tags else {
            return;
        };
        if let Some(tag) = self.execution.interpreter.state_tag_since(&mut self.told) {
            state_tags.push(first_block, tag);
        }
    }

    /// Appends the items of the next line that has any; false when the program is over. The last item is
    /// [`Item::End`]. After [`Item::Wait`], [`Stream::provide_input`] must come first, after a probe
    /// [`Stream::provide_probe`].
    ///
    /// # Errors
    /// The file has changed or cannot be read, a line is wrong (which after a check only the answer of M66 or of a
    /// probe can cause),
    /// or an answer has not been provided.
    pub fn next_items(&mut self, out: &mut Vec<Item>) -> Result<bool, ProgramError> {
        match self.waiting {
            Some(Waiting::Input) => {
                return Err(ProgramError::WaitsForInput(Arc::clone(&self.program.name)));
            }
            Some(Waiting::Probe) => {
                return Err(ProgramError::WaitsForProbe(Arc::clone(&self.program.name)));
            }
            None => {}
        }
        let before = out.len();
        while out.len() == before {
            if self.execution.interpreter.ended() {
                return Ok(false);
            }
            let first_block = self.execution.interpreter.next_block();
            let step = self.execution.step(&mut self.program, out)?;
            self.tell_of_line(first_block);
            match step {
                Step::Line => {}
                Step::End => self.execution.interpreter.finish(out)?,
                Step::Wrong(diagnostic) | Step::Stuck(diagnostic) | Step::Open(diagnostic) => {
                    return Err(diagnostic.into());
                }
            }
        }
        self.waiting = out[before..].iter().find_map(|item| match item {
            Item::Wait(_) => Some(Waiting::Input),
            item => item.is_probe().then_some(Waiting::Probe),
        });
        Ok(true)
    }

    /// The answer to [`Item::Wait`]: 1 or 0, or −1 after the time-out.
    pub fn provide_input(&mut self, value: f64) {
        self.execution.interpreter.provide_input(value);
        self.waiting = None;
    }

    /// What became of the probe that was handed out last.
    pub fn provide_probe(&mut self, result: &ProbeResult) {
        self.execution.interpreter.provide_probe(result);
        self.waiting = None;
    }

    /// Tells where the machine really stands after an abort or a jog, machine coordinates, mm or rad.
    pub fn set_position(&mut self, position: AxisVector) {
        self.execution.interpreter.set_position(position);
    }
}
