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
    /// a jog that was let go; or the position of an axis is set anew there (homing); or the joints are enabled there, before anything moves. The
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::doubles::{Waits, rest};
    use tandem_gcode::{Config, ProbeInput, Program, check};
    use tandem_sdk::Axes;

    fn stream(text: &'static [u8]) -> Stream {
        let mut config = Config::new(Axes::new(&[('X', false)]).unwrap());
        config.probe = Some(ProbeInput {
            input: 0,
            inverted: false,
        });
        let mut program = Program::spool("part.ngc", text).unwrap();
        let report = check(&mut program, &config, &mut |_block, _curve| Ok(())).unwrap();
        assert!(report.is_ok());
        Stream::new(program, &config).unwrap()
    }

    fn is_block(item: &Item) -> bool {
        matches!(item, Item::Block(..))
    }

    /// The next block of a source.
    fn next_block(source: &mut impl Source) -> tandem_sdk::Block {
        let mut items = vec![];
        for _ in 0..100 {
            source.next_items(&mut items).unwrap();
            if let Some(Item::Block(block, _)) = items.drain(..).find(is_block) {
                return block;
            }
        }
        panic!("no block comes");
    }

    #[test]
    fn a_program_is_over_at_an_abort_and_goes_on_from_every_other_rest() {
        for (cause, goes_on) in [
            (RestCause::Abort, false),
            (RestCause::Corrected, true),
            (RestCause::Attached, true),
        ] {
            let mut stream = stream(b"G1 F600 X10\nG1 X20\nM2\n");
            assert_eq!(next_block(&mut stream).end[0], 10.0);
            assert_eq!(stream.provide_rest(&rest(cause)), goes_on, "{cause:?}");
            assert_eq!(next_block(&mut stream).start[0], 1.5, "{cause:?}");
        }
        let mut stream = stream(b"G31 F600 X10\nG1 X20\nM2\n");
        assert_eq!(next_block(&mut stream).end[0], 10.0);
        assert!(stream.provide_rest(&rest(RestCause::Edge)));
        assert_eq!(next_block(&mut stream).start[0], 1.5);
    }

    #[test]
    fn a_source_on_the_heap_is_asked_everything() {
        fn ask(source: &mut impl Source) {
            assert!(source.streams() && !source.is_waiting());
            source.period();
            assert!(source.is_waiting());
            assert!(source.may_go_on(true) && !source.may_go_on(false));
            assert!(!source.provide_rest(&rest(RestCause::Abort)));
            source.provide_input(1.0);
            assert!(source.provide_rest(&rest(RestCause::Abort)));
            assert_eq!(source.next_items(&mut vec![]), Ok(true));
        }
        ask(&mut Waits::default());
        let mut on_heap: Box<dyn Source> = Box::<Waits>::default();
        ask(&mut on_heap);
    }
}
