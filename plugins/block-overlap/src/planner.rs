//! The planner itself: blocks in, segments out.

use tandem_sdk::{
    Accepted, Advanced, AxisVector, Block, BlockKind, BlockReport, Planner, PlannerContext, PlannerDescription,
    PluginError, Segment, SegmentFlags, SegmentSink, size_of_contract,
};

use crate::buffer::{Buffer, Taken};
use crate::drive::Drive;
use crate::entry::Entry;
use crate::mover::Mover;
use crate::options::{CornerControl, LimitMode, Options};
use crate::reason::limited_by;
use crate::rules::Rules;

/// Largest buffer, blocks: about a gigabyte.
const MOST_BUFFER_BLOCKS: usize = 1_000_000;

/// Program time that is nothing, s.
const NOTHING_S: f64 = 1e-12;

/// The block-overlap planner.
#[derive(Debug)]
pub struct BlockOverlap {
    context: PlannerContext,
    options: Options,
    rules: Rules,
    buffer: Buffer,
    drive: Drive,
    /// The dwell that is emitted, and what is left of it.
    dwell: Option<Segment>,
    /// Speed along the path at the start of the next block, mm/s.
    start_mm_per_s: f64,
    /// Time constant of the last block with motion, s: the next one speeds up with it.
    last_tau_s: f64,
    /// The time constant last stated, and the same on a tick, s.
    stated_s: f64,
    on_tick_s: f64,
    finished: bool,
}

impl BlockOverlap {
    /// A planner at rest. Allocates its buffer for good.
    ///
    /// # Errors
    /// A buffer of fewer than four blocks, or beyond reason; no time constant.
    pub fn new(options: &Options, context: &PlannerContext) -> Result<Self, PluginError> {
        if !(4..=MOST_BUFFER_BLOCKS).contains(&options.buffer_blocks) {
            let (asked, most) = (options.buffer_blocks, MOST_BUFFER_BLOCKS);
            return Err(PluginError::new(format!("buffer_blocks = {asked}: from 4 to {most}")));
        }
        if !(context.time_constant_s > 0.0 && context.time_constant_s.is_finite()) {
            return Err(PluginError::fixed("block-overlap needs motion.time_constant_ms above zero"));
        }
        let rules = Rules::new(options, context);
        let tau_s = rules.on_tick_s(context.time_constant_s);
        Ok(Self {
            context: *context,
            options: options.clone(),
            buffer: Buffer::new(options.buffer_blocks, tau_s),
            drive: Drive::new(rules.axes),
            rules,
            dwell: None,
            start_mm_per_s: 0.0,
            last_tau_s: tau_s,
            stated_s: context.time_constant_s,
            on_tick_s: tau_s,
            finished: false,
        })
    }

    /// The time constant of a block, on a tick, s. Most blocks state the one of the block before.
    fn tau_s(&mut self, block: &Block) -> f64 {
        let stated = block.time_constant_s;
        let stated_s = if stated.is_nan() { self.context.time_constant_s } else { stated };
        if stated_s != self.stated_s {
            (self.stated_s, self.on_tick_s) = (stated_s, self.rules.on_tick_s(stated_s));
        }
        self.on_tick_s
    }

    /// Takes the next block out of the buffer; `false` where there is none.
    fn begin(&mut self, sink: &mut dyn SegmentSink) -> bool {
        let Some(taken) = self.buffer.pop(&self.rules) else { return false };
        let entry = self.buffer.ring().numbered(taken.number);
        let Some(mover) = Mover::new(&self.rules, entry, &taken) else {
            sink.block(&dwell_report(entry));
            self.dwell = Some(dwell(entry, self.drive.path_mm()));
            return true;
        };
        let time_s = mover.end() * self.rules.tick_s - taken.join.overlap_s;
        let end_mm_per_s = passing(taken.next_feed_mm_per_s, taken.join.overlap_s, taken.join.up_s);
        sink.block(&BlockReport {
            size: size_of_contract::<BlockReport>(),
            limited_by: limited_by(&self.rules, entry, self.buffer.ring().numbered(taken.number + 1), &taken),
            block: entry.index,
            start_feed_mm_per_s: self.start_mm_per_s,
            peak_feed_mm_per_s: taken.feed_mm_per_s,
            end_feed_mm_per_s: end_mm_per_s,
            time_s,
            time_constant_s: constant_s(&taken),
        });
        self.start_mm_per_s = passing(taken.feed_mm_per_s, taken.join.overlap_s, taken.join.down_s);
        self.drive.start(mover, &taken);
        true
    }

    /// Emits the next piece, at most `left_s` long; `None` where nothing can be emitted for now.
    fn emit(&mut self, left_s: f64, sink: &mut dyn SegmentSink) -> Option<f64> {
        if let Some(rest) = self.dwell.take() {
            return Some(self.emit_dwell(rest, left_s, sink));
        }
        if self.drive.wants_next() {
            return self.begin(sink).then_some(0.0);
        }
        Some(self.drive.step(self.buffer.ring(), left_s / self.rules.tick_s, sink) * self.rules.tick_s)
    }

    fn emit_dwell(&mut self, mut rest: Segment, left_s: f64, sink: &mut dyn SegmentSink) -> f64 {
        let later_s = (rest.duration_s - left_s).max(0.0);
        rest.duration_s -= later_s;
        if later_s > 0.0 {
            let flags = SegmentFlags(rest.flags.0 & !SegmentFlags::BLOCK_BEGINS.0);
            self.dwell = Some(Segment { duration_s: later_s, flags, ..rest });
        } else {
            rest.flags = rest.flags.with(SegmentFlags::BLOCK_ENDS);
        }
        sink.segment(&rest);
        rest.duration_s
    }
}

impl Planner for BlockOverlap {
    fn describe(&self) -> PlannerDescription {
        PlannerDescription {
            breaks_limits: u32::from(self.options.limits == LimitMode::Off),
            leaves_path: u32::from(self.options.corner_control == CornerControl::Off),
            uses_time_constants: 1,
            ..PlannerDescription::order_2()
        }
    }

    fn check(&self, block: &Block) -> Result<(), PluginError> {
        let refuse = |why| Err(PluginError::fixed(why));
        let axes = self.context.axes.count() as u32;
        let sound = is_finite(&block.start) & is_finite(&block.end);
        match block.kind {
            BlockKind::Nurbs => refuse("block-overlap drives lines and arcs; for NURBS use planner nurbs"),
            BlockKind::Dwell if !(sound && block.dwell_s >= 0.0 && block.dwell_s.is_finite()) => {
                refuse("a dwell needs a place and a duration of zero or more")
            }
            BlockKind::Dwell => Ok(()),
            BlockKind::Arc if !block.arc.plane.iter().all(|axis| *axis < axes) => {
                refuse("an arc lies in a plane of axes that the machine lacks")
            }
            _ if !(sound && block.length_mm > 0.0 && block.length_mm.is_finite()) => {
                refuse("a block needs two ends and a length above zero")
            }
            _ if block.time_constant_s <= 0.0 || block.time_constant_s.is_infinite() => {
                refuse("a time constant is above zero")
            }
            // Both asked, because the smaller of a number and NaN is the number.
            _ if block.feed_mm_per_s > 0.0 && block.feed_cap_mm_per_s > 0.0 => Ok(()),
            _ => refuse("a block needs a feed above zero"),
        }
    }

    fn accept(&mut self, block: &Block) -> Result<Accepted, PluginError> {
        if self.buffer.is_full() {
            return Ok(Accepted::Full);
        }
        self.check(block)?;
        self.finished = false;
        let taus_s = [self.last_tau_s, self.tau_s(block)];
        let rules = &self.rules;
        self.buffer.push(rules, |entry| entry.set(block, rules, taus_s));
        if block.kind != BlockKind::Dwell {
            self.last_tau_s = taus_s[1];
        }
        Ok(Accepted::Accepted)
    }

    fn finish(&mut self) {
        self.buffer.finish();
        self.finished = true;
    }

    fn advance(&mut self, duration_s: f64, sink: &mut dyn SegmentSink) -> Result<Advanced, PluginError> {
        let mut emitted_s = 0.0;
        while duration_s - emitted_s > NOTHING_S {
            match self.emit(duration_s - emitted_s, sink) {
                Some(part_s) => emitted_s += part_s,
                None => break,
            }
        }
        let empty = self.buffer.is_empty() && !self.drive.is_moving() && self.dwell.is_none();
        Ok(Advanced { duration_s: emitted_s, done: u32::from(empty && self.finished) })
    }

    fn reset(&mut self, position: &AxisVector) {
        self.context.position = *position;
        self.last_tau_s = self.rules.on_tick_s(self.context.time_constant_s);
        self.buffer.clear(self.last_tau_s);
        self.drive.reset();
        (self.dwell, self.start_mm_per_s, self.finished) = (None, 0.0, false);
    }
}

/// Whether all entries are finite, without a branch for each: nothing times a finite number is nothing.
fn is_finite(vector: &AxisVector) -> bool {
    let [a, b, c, d, e, f, g, h] = vector.0.map(|v| v * 0.0);
    ((a + e) + (b + f)) + ((c + g) + (d + h)) == 0.0
}

/// Speed of a block at the edge of an overlap inside its ramp, mm/s.
fn passing(feed_mm_per_s: f64, overlap_s: f64, ramp_s: f64) -> f64 {
    if ramp_s > 0.0 { feed_mm_per_s * overlap_s / ramp_s } else { 0.0 }
}

/// The time constant as it is reported: how long the block overlaps the next one, or its ramp where it ends at rest, s.
fn constant_s(taken: &Taken) -> f64 {
    if taken.join.overlap_s > 0.0 { taken.join.overlap_s } else { taken.join.down_s }
}

fn dwell(entry: &Entry, path_mm: f64) -> Segment {
    let mut rest = Segment::rest(&entry.end, entry.dwell_s);
    (rest.block, rest.line) = (entry.index, entry.line);
    rest.path[0] = path_mm;
    rest.flags = rest.flags.with(SegmentFlags::DWELL).with(SegmentFlags::BLOCK_BEGINS);
    rest
}

fn dwell_report(entry: &Entry) -> BlockReport {
    BlockReport {
        size: size_of_contract::<BlockReport>(),
        limited_by: tandem_sdk::LimitedBy::Feed,
        block: entry.index,
        start_feed_mm_per_s: 0.0,
        peak_feed_mm_per_s: 0.0,
        end_feed_mm_per_s: 0.0,
        time_s: entry.dwell_s,
        time_constant_s: f64::NAN,
    }
}
