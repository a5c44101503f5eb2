//! Drives a planner through a program as the rough loop does.

use tandem_sdk::{Accepted, Block, BlockReport, Planner, PluginError, Segment, SegmentSink};

use crate::heap;
use crate::machine::ROUGH_PERIOD_S;
use crate::random::Random;
use crate::timing::Timing;

/// What came out.
#[derive(Debug, Default)]
pub struct Driven {
    pub segments: Vec<Segment>,
    pub reports: Vec<BlockReport>,
    /// Uses of the heap in the planner's methods.
    pub heap_uses: u64,
}

/// Where a planner goes wrong while it is driven.
#[derive(Debug)]
pub struct Stuck {
    pub check: &'static str,
    pub words: String,
}

/// How long the methods took.
#[derive(Debug)]
pub struct Timings {
    pub check: Timing,
    pub accept: Timing,
    pub advance: Timing,
}

impl Default for Timings {
    fn default() -> Self {
        Self {
            check: Timing::new("check"),
            accept: Timing::new("accept"),
            advance: Timing::new("advance"),
        }
    }
}

/// Most segments that a program of `blocks` may become, and most calls that bring nothing.
const SEGMENTS_PER_BLOCK: usize = 20_000;
const IDLE_CALLS: u32 = 100;

impl Driven {
    /// Room for as much as `other` holds, so that the kit itself allocates nothing while it counts.
    pub fn with_room_for(other: &Self) -> Self {
        let room = |length: usize| length + 1;
        Self {
            segments: Vec::with_capacity(room(other.segments.len())),
            reports: Vec::with_capacity(room(other.reports.len())),
            heap_uses: 0,
        }
    }
}

impl SegmentSink for Driven {
    fn segment(&mut self, segment: &Segment) {
        self.segments.push(*segment);
    }

    fn block(&mut self, report: &BlockReport) {
        self.reports.push(*report);
    }
}

/// Feeds `blocks` and advances by rough periods until all is emitted, or until `stop_after` calls of `advance`.
pub fn drive(
    planner: &mut dyn Planner,
    blocks: &[Block],
    stop_after: usize,
    driven: &mut Driven,
    timings: &mut Timings,
) -> Result<(), Stuck> {
    let (mut next, mut finished, mut idle) = (0, false, 0);
    for _ in 0..stop_after {
        let uses = heap::uses();
        while next < blocks.len() {
            let accepted = timings.accept.of(|| planner.accept(&blocks[next], None));
            match accepted.map_err(|error| failed("accept", &blocks[next], &error))? {
                Accepted::Full => break,
                Accepted::Accepted => next += 1,
            }
        }
        if next == blocks.len() && !finished {
            planner.finish();
            finished = true;
        }
        let before = driven.segments.len();
        let advanced = timings
            .advance
            .of(|| planner.advance(ROUGH_PERIOD_S, driven));
        driven.heap_uses += heap::uses() - uses;
        let advanced = advanced
            .map_err(|error| failed("advance", &blocks[next.min(blocks.len() - 1)], &error))?;
        let emitted_s: f64 = driven.segments[before..]
            .iter()
            .map(|segment| segment.duration_s)
            .sum();
        idle = if emitted_s > 0.0 { 0 } else { idle + 1 };
        expect(advanced.done != 0, advanced.duration_s, emitted_s)?;
        if advanced.done != 0 && finished {
            return Ok(());
        }
        if idle > IDLE_CALLS || driven.segments.len() > blocks.len() * SEGMENTS_PER_BLOCK {
            return Err(Stuck {
                check: "progress",
                words: no_progress(next, blocks.len(), driven.segments.len()),
            });
        }
    }
    Ok(())
}

/// Feeds `blocks` a few at a time, as somebody sends them, and advances whether the planner is full or not. Where it emits nothing more
/// come, or they are late: then it is to plan to the end of those that it has.
pub fn drive_as_sent(
    planner: &mut dyn Planner,
    blocks: &[Block],
    random: &mut Random,
    driven: &mut Driven,
) -> Result<(), Stuck> {
    let (mut next, mut until, mut finished, mut idle) = (0, 0, false, 0);
    while idle <= IDLE_CALLS && driven.segments.len() <= blocks.len() * SEGMENTS_PER_BLOCK {
        while next < until {
            let accepted = planner
                .accept(&blocks[next], None)
                .map_err(|error| failed("accept", &blocks[next], &error))?;
            if accepted == Accepted::Full {
                break;
            }
            (next, finished) = (next + 1, false);
        }
        let before = driven.segments.len();
        let advanced = planner
            .advance(ROUGH_PERIOD_S, driven)
            .map_err(|error| failed("advance", &blocks[next.saturating_sub(1)], &error))?;
        let segments = driven.segments[before..].iter();
        let emitted_s: f64 = segments.map(|segment| segment.duration_s).sum();
        // It may have less than a period that does not depend on what follows.
        expect(true, advanced.duration_s, emitted_s)?;
        if advanced.done != 0 && !finished {
            return Err(Stuck {
                check: "progress",
                words: "it says that it is done before it was told that nothing follows".into(),
            });
        }
        if advanced.done != 0 && next == blocks.len() {
            return Ok(());
        }
        idle = if emitted_s > 0.0 { 0 } else { idle + 1 };
        if emitted_s == 0.0
            && next == until
            && !finished
            && (next == blocks.len() || random.once_in(5))
        {
            planner.finish();
            finished = true;
        } else if next == until && (!finished || advanced.done != 0) {
            until = blocks.len().min(until + random.between(0.0, 6.0) as usize);
        }
    }
    Err(Stuck {
        check: "progress",
        words: no_progress(next, blocks.len(), driven.segments.len()),
    })
}

/// What `advance` says must be what it did.
fn expect(done: bool, said_s: f64, emitted_s: f64) -> Result<(), Stuck> {
    let near = (said_s - emitted_s).abs() <= 1e-9 + 1e-9 * emitted_s.abs();
    let enough = done || emitted_s == 0.0 || emitted_s >= ROUGH_PERIOD_S - 1e-9;
    let words = match (near, enough) {
        (true, true) => return Ok(()),
        (false, _) => format!("advance says {said_s} s and emits {emitted_s} s"),
        (_, false) => {
            format!(
                "advance emits {emitted_s} s of the {ROUGH_PERIOD_S} s it was asked for, and is not done"
            )
        }
    };
    Err(Stuck {
        check: "progress",
        words,
    })
}

fn no_progress(taken: usize, blocks: usize, segments: usize) -> String {
    format!(
        "it has taken {taken} of {blocks} blocks, emitted {segments} segments, and does not come to an end"
    )
}

fn failed(method: &str, block: &Block, error: &PluginError) -> Stuck {
    let check = if error.is_panic() {
        "panics"
    } else {
        "lifecycle"
    };
    Stuck {
        check,
        words: format!("{method}, block {}: {error}", block.index),
    }
}
