//! Rests that end an epoch: what was planned behind them is forgotten, and planning goes on from where the machine stands.

use tandem_gcode::Item;
use tandem_rings::{Rest, RestCause};
use tandem_sdk::{BlockKind, Edge};

use crate::Observer;
use crate::rough::{RoughError, RoughLoop};

impl RoughLoop {
    /// Takes the rests that the fine loop has reported. A rough period begins with it.
    ///
    /// # Errors
    /// The program cannot go on from a rest.
    pub fn take_rests(&mut self, observer: &mut dyn Observer) -> Result<(), RoughError> {
        while let Some(rest) = self.queue.take_rest() {
            self.planner.reset(&rest.position);
            self.queue.restart(&rest);
            self.forget(&rest);
            if rest.cause == RestCause::Attached {
                self.awaits_drives = false;
            } else {
                observer.rest(&rest);
            }
            if let Some(cause) = refusal(&rest) {
                return Err(RoughError::Stop {
                    line: rest.line,
                    cause,
                });
            }
            self.dry = !self.source.provide_rest(&rest) || self.dry;
        }
        Ok(())
    }

    /// After an abort nothing counts that has been read; behind an edge what is left of the line does, at the new place.
    fn forget(&mut self, rest: &Rest) {
        (
            self.finished,
            self.stretch_over,
            self.done,
            self.edge_awaited,
        ) = (false, false, false, false);
        self.gathering.restart();
        if rest.cause == RestCause::Abort {
            (self.waiting, self.waited_s) = (None, 0.0);
            self.next = self.items.len();
        }
        for item in &mut self.items[self.next..] {
            if let Item::Block(block, _) = item
                && block.kind == BlockKind::Dwell
            {
                (block.start, block.end) = (rest.position, rest.position);
            }
        }
    }
}

/// Why the run cannot go on from `rest`.
fn refusal(rest: &Rest) -> Option<String> {
    let input = rest.stop_on.input;
    let done = if rest.stop_on.edge == Edge::Rising {
        "tripped"
    } else {
        "released"
    };
    match rest.cause {
        RestCause::Already => Some(format!(
            "input {input} was already {done} when the motion began"
        )),
        RestCause::Missed if rest.stop_on.miss_is_fault != 0 => Some(format!(
            "input {input} was not {done} before the motion ended"
        )),
        _ => None,
    }
}
