//! Where items come from.

use tandem_gcode::{Item, ProbeResult, Stream};
use tandem_rings::{Rest, RestCause};

/// A stream of program items, pulled on demand.
pub trait Source {
    /// Appends the next items; `false` where the program is over. Nothing appended and `true`: there is nothing for now,
    /// and the machine comes to rest.
    ///
    /// # Errors
    /// What is wrong with the program, with its place.
    fn next_items(&mut self, items: &mut Vec<Item>) -> Result<bool, String>;

    /// Whether the next items may be asked for; `driven` says that everything before is driven and the machine stands.
    /// A program goes on at once; lines given by hand wait for the one before.
    fn may_go_on(&mut self, _driven: bool) -> bool {
        true
    }

    /// Whether more may come in time, from somebody who sends as it is driven: then the machine is not told to come to rest at the
    /// end of what is there before the queue has become as short as a stop asks.
    fn streams(&self) -> bool {
        false
    }

    /// A rough period begins. Soft side; for sources that follow machine time.
    fn period(&mut self) {}

    /// Whether the source waits for machine time to pass: nothing moving is then no sign of a run that hangs.
    fn is_waiting(&self) -> bool {
        false
    }

    /// Answers an [`Item::Wait`]: 1, 0, or −1 for none in time.
    fn provide_input(&mut self, value: f64);

    /// The machine rests at `rest.position`, before the end of what was planned: behind an edge that a block waited for
    /// ([`tandem_sdk::Block::stop_on`], after which nothing is asked for until this), after the operator's abort, or after
    /// a jog that was let go; or it is called otherwise (homing); or the joints are enabled there, before anything moves. The
    /// next block starts there. Whether the stream goes on; where not, the program is over.
    fn provide_rest(&mut self, rest: &Rest) -> bool;
}

/// A source on the heap is that source: every method is passed on.
impl<S: Source + ?Sized> Source for Box<S> {
    fn next_items(&mut self, items: &mut Vec<Item>) -> Result<bool, String> {
        (**self).next_items(items)
    }

    fn may_go_on(&mut self, driven: bool) -> bool {
        (**self).may_go_on(driven)
    }

    fn streams(&self) -> bool {
        (**self).streams()
    }

    fn period(&mut self) {
        (**self).period();
    }

    fn is_waiting(&self) -> bool {
        (**self).is_waiting()
    }

    fn provide_input(&mut self, value: f64) {
        (**self).provide_input(value);
    }

    fn provide_rest(&mut self, rest: &Rest) -> bool {
        (**self).provide_rest(rest)
    }
}

impl Source for Stream {
    fn next_items(&mut self, items: &mut Vec<Item>) -> Result<bool, String> {
        Stream::next_items(self, items).map_err(|e| e.to_string())
    }

    fn provide_input(&mut self, value: f64) {
        Stream::provide_input(self, value);
    }

    fn provide_rest(&mut self, rest: &Rest) -> bool {
        match rest.cause {
            RestCause::Abort | RestCause::Corrected | RestCause::Attached => {
                self.set_position(rest.position);
            }
            RestCause::Edge | RestCause::Missed | RestCause::Already => {
                self.provide_probe(&ProbeResult {
                    touched: rest.latch,
                    rest: rest.position,
                });
            }
        }
        rest.cause != RestCause::Abort
    }
}
