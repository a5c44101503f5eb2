//! Drives a planner through a program as the rough loop does.

use tandem_sdk::{Accepted, Block, BlockReport, Planner, PluginError, Segment, SegmentSink};

use crate::heap;
use crate::machine::ROUGH_PERIOD_S;
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
