//! What stands in the place of planners and programs in the tests of the rough loop.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex};

use tandem_gcode::Item;
use tandem_rings::{Rest, RestCause};
use tandem_sdk::{
    Accepted, Advanced, AxisVector, Block, BlockKind, BlockReport, Curve, Edge, LimitedBy,
    MAX_AXES, Planner, PlannerDescription, PluginError, SegmentSink, StopOn,
};

use crate::Source;

pub const ROUGH_PERIOD_S: f64 = 0.01;

/// What a planner does in a test.
pub trait Plans: Send {
    fn accept(&mut self, _block: &Block) -> Accepted {
        Accepted::Accepted
    }

    fn finish(&mut self) {}

    /// Emits; the program time that it says it has emitted, s, and whether it is done.
    fn advance(&mut self, duration_s: f64, sink: &mut dyn SegmentSink) -> (f64, bool);

    fn reset(&mut self, _position: &AxisVector) {}
}

/// The planner that does so.
pub struct Fake<P>(pub P);

impl<P: Plans> Planner for Fake<P> {
    fn describe(&self) -> PlannerDescription {
        PlannerDescription::order_2()
    }

    fn check(&self, _block: &Block, _curve: Option<Curve<'_>>) -> Result<(), PluginError> {
        Ok(())
    }

    fn accept(
        &mut self,
        block: &Block,
        _curve: Option<Curve<'_>>,
    ) -> Result<Accepted, PluginError> {
        Ok(self.0.accept(block))
    }

    fn finish(&mut self) {
        self.0.finish();
    }

    fn advance(
        &mut self,
        duration_s: f64,
        sink: &mut dyn SegmentSink,
    ) -> Result<Advanced, PluginError> {
        let (duration_s, done) = self.0.advance(duration_s, sink);
        Ok(Advanced {
            duration_s,
            done: u32::from(done),
        })
    }

    fn reset(&mut self, position: &AxisVector) {
        self.0.reset(position);
    }
}

/// What a program was told: an input's answer, or a rest.
#[derive(Clone, Debug, PartialEq)]
#[allow(clippy::large_enum_variant)] // a handful in a test
pub enum Answer {
    Input(f64),
    Rest(Rest),
}

/// A program that hands out what it was given, a list at a time.
pub struct Script {
    lists: VecDeque<Result<Vec<Item>, String>>,
    /// It goes on after a rest.
    pub goes_on: bool,
    /// It asks for everything before to be driven.
    pub waits_for_rest: bool,
    pub told: Arc<Mutex<Vec<Answer>>>,
}

impl Script {
    pub fn of(lists: Vec<Result<Vec<Item>, String>>) -> Self {
        Self {
            lists: lists.into(),
            goes_on: true,
            waits_for_rest: false,
            told: Arc::default(),
        }
    }
}

impl Source for Script {
    fn next_items(&mut self, items: &mut Vec<Item>) -> Result<bool, String> {
        match self.lists.pop_front() {
            Some(Ok(more)) => items.extend(more),
            Some(Err(error)) => return Err(error),
            None => return Ok(false),
        }
        Ok(true)
    }

    fn may_go_on(&mut self, driven: bool) -> bool {
        driven || !self.waits_for_rest
    }

    fn provide_input(&mut self, value: f64) {
        self.told.lock().unwrap().push(Answer::Input(value));
    }

    fn provide_rest(&mut self, rest: &Rest) -> bool {
        self.told.lock().unwrap().push(Answer::Rest(*rest));
        self.goes_on
    }
}

/// A source that differs from what a source does by default in every method.
#[derive(Default)]
pub struct Waits {
    periods: u32,
    input: f64,
}

impl Source for Waits {
    fn next_items(&mut self, _items: &mut Vec<Item>) -> Result<bool, String> {
        Ok(true)
    }
    fn may_go_on(&mut self, driven: bool) -> bool {
        driven
    }
    fn streams(&self) -> bool {
        true
    }
    fn period(&mut self) {
        self.periods += 1;
    }
    fn is_waiting(&self) -> bool {
        self.periods > 0
    }
    fn provide_input(&mut self, value: f64) {
        self.input = value;
    }
    fn provide_rest(&mut self, _rest: &Rest) -> bool {
        self.input > 0.0
    }
}

/// A block of a line of its own.
pub fn block_of(index: u64) -> Block {
    Block {
        kind: BlockKind::Line,
        index,
        line: 1,
        ..Block::at(AxisVector::ZERO)
    }
}

pub fn block(index: u64) -> Item {
    Item::Block(block_of(index), None)
}

pub fn probe(index: u64) -> Item {
    let stop_on = StopOn {
        edge: Edge::Rising,
        ..StopOn::default()
    };
    Item::Block(
        Block {
            stop_on,
            ..block_of(index)
        },
        None,
    )
}

/// The report of a block that the feed limits.
pub fn report(block: u64) -> BlockReport {
    BlockReport {
        limited_by: LimitedBy::Feed,
        block,
        start_feed_mm_per_s: 0.0,
        peak_feed_mm_per_s: 1.0,
        end_feed_mm_per_s: 0.0,
        time_s: 1.0,
        time_constant_s: 0.0,
    }
}

/// A rest away from where motion began.
pub fn rest(cause: RestCause) -> Rest {
    Rest {
        epoch: 0,
        cause,
        tick: 7,
        block: 1,
        line: 3,
        stop_on: StopOn::default(),
        position: AxisVector([1.5; MAX_AXES]),
        latch: None,
        program_time_s: 0.25,
        path_mm: 40.0,
    }
}
