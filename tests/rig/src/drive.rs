//! A planner driven as the rough loop drives it.

use std::hint::black_box;
use std::sync::Arc;
use std::time::Duration;

use tandem_sdk::{
    Accepted, Block, BlockReport, NurbsData, Planner, PluginError, Segment, SegmentSink,
};

/// A block and its curve, where it is a NURBS.
pub type Given = (Block, Option<Arc<NurbsData>>);

/// What is given to a planner.
pub trait Offer {
    /// Gives it.
    ///
    /// # Errors
    /// The planner's.
    fn offer(&self, planner: &mut dyn Planner) -> Result<Accepted, PluginError>;
}

impl Offer for Block {
    fn offer(&self, planner: &mut dyn Planner) -> Result<Accepted, PluginError> {
        planner.accept(self, None)
    }
}

impl Offer for Given {
    fn offer(&self, planner: &mut dyn Planner) -> Result<Accepted, PluginError> {
        planner.accept(&self.0, self.1.as_deref().map(NurbsData::curve))
    }
}

/// Counts segments and keeps nothing: for benches.
#[derive(Debug, Default)]
pub struct Away {
    /// Segments so far.
    pub segments: usize,
    /// Their duration, s.
    pub duration_s: f64,
}

impl SegmentSink for Away {
    fn segment(&mut self, segment: &Segment) {
        self.duration_s += black_box(segment).duration_s;
        self.segments += 1;
    }

    fn block(&mut self, report: &BlockReport) {
        black_box(report);
    }
}

/// Gives all `blocks` and takes as little motion as that needs, by steps of 8 ms: the planner need not come to an end.
///
/// # Panics
/// The planner refuses a block.
pub fn feed(planner: &mut dyn Planner, blocks: &[impl Offer]) {
    let mut away = Away::default();
    for block in blocks {
        while block.offer(planner).unwrap() == Accepted::Full {
            planner.advance(0.008, &mut away).unwrap();
        }
    }
}

/// Processor time of this thread, in steps of milliseconds: what else the computer does is not counted.
///
/// # Panics
/// The system does not tell it.
pub fn processor_time() -> Duration {
    time_of("thread-self").expect("Linux tells the time of a thread")
}

/// The same of the first thread of another process; nothing where that is gone.
pub fn processor_time_of(process: u32) -> Option<Duration> {
    time_of(&process.to_string())
}

fn time_of(thread: &str) -> Option<Duration> {
    let text = std::fs::read_to_string(format!("/proc/{thread}/schedstat")).ok()?;
    let running = text.split_whitespace().next()?.parse().ok()?;
    Some(Duration::from_nanos(running))
}

/// More calls of `advance` than any program needs.
const MAX_CALLS: usize = 1_000_000;

/// Gives `blocks` to the planner, as many at a time as it takes, and asks for `step_s` of motion, to the end.
///
/// # Panics
/// The planner refuses a block or does not come to an end.
pub fn stream(
    planner: &mut dyn Planner,
    blocks: &[impl Offer],
    step_s: f64,
    sink: &mut dyn SegmentSink,
) {
    let mut waiting = blocks.iter().peekable();
    for _ in 0..MAX_CALLS {
        while waiting
            .next_if(|block| block.offer(planner).unwrap() == Accepted::Accepted)
            .is_some()
        {}
        if waiting.peek().is_none() {
            planner.finish();
        }
        if planner.advance(step_s, sink).unwrap().done != 0 {
            return;
        }
    }
    panic!("the planner does not come to an end");
}

/// All that the planner makes of `blocks`, as [`stream`].
///
/// # Panics
/// As [`stream`].
pub fn drive(planner: &mut dyn Planner, blocks: &[impl Offer], step_s: f64) -> crate::Collected {
    let mut collected = crate::Collected::default();
    stream(planner, blocks, step_s, &mut collected);
    collected
}
