//! The planner itself: blocks in, segments out.

use tandem_sdk::{
    Accepted, Advanced, AxisVector, Block, BlockKind, BlockReport, LimitedBy, MAX_AXES, Planner, PlannerContext,
    PlannerDescription, PluginError, Segment, SegmentFlags, SegmentSink, size_of_contract,
};

use crate::buffer::Buffer;
use crate::drive::Drive;
use crate::geometry::Entry;
use crate::junction::Rule;
use crate::options::{Junction, Options};

/// The look-ahead planner.
#[derive(Debug)]
pub struct LookAhead {
    context: PlannerContext,
    options: Options,
    rule: Rule,
    feed_axis_mm_per_s: Vec<f64>,
    rapid_axis_mm_per_s: Vec<f64>,
    /// The block whose end junction is not known yet.
    pending: Option<Entry>,
    buffer: Buffer,
    driving: Option<Drive>,
    /// Rest still to be emitted for a dwell, s.
    dwell: Option<Segment>,
    path_mm: f64,
    finished: bool,
}

impl LookAhead {
    /// A planner at rest. Allocates its buffer for good.
    ///
    /// # Errors
    /// A buffer of fewer than two blocks.
    pub fn new(options: &Options, context: &PlannerContext) -> Result<Self, PluginError> {
        if options.buffer_blocks < 2 {
            return Err(PluginError::new(format!("buffer_blocks = {}: at least 2", options.buffer_blocks)));
        }
        let axes = context.limits.axes();
        Ok(Self {
            context: *context,
            rule: Rule::new(options.junction, axes, context.fine_period_s),
            feed_axis_mm_per_s: axes.iter().map(|a| a.feed_mm_per_s).collect(),
            rapid_axis_mm_per_s: axes.iter().map(|a| a.rapid_mm_per_s).collect(),
            pending: None,
            buffer: Buffer::new(options.buffer_blocks),
            driving: None,
            dwell: None,
            path_mm: 0.0,
            finished: false,
            options: options.clone(),
        })
    }

    /// Moves the pending block, whose end junction is known now, into the buffer.
    fn insert(&mut self, mut entry: Entry, end_mm_per_s: f64) {
        self.rule.limit(&mut entry, end_mm_per_s);
        self.buffer.push(&entry);
    }

    /// Takes the next block out of the buffer; `false` where there is none.
    fn start_block(&mut self, sink: &mut dyn SegmentSink) -> bool {
        let rule = self.options.junction;
        let Some((entry, start, end)) = self.buffer.pop() else { return false };
        if let Some(drive) = Drive::new(entry, (start, end), rule, self.path_mm) {
            sink.block(drive.report());
            self.driving = Some(drive);
        } else {
            sink.block(&dwell_report(entry));
            self.dwell = Some(dwell(entry, self.path_mm));
        }
        true
    }

    fn emit_dwell(&mut self, mut rest: Segment, duration_s: f64, sink: &mut dyn SegmentSink) -> f64 {
        let all_s = rest.duration_s;
        rest.duration_s = all_s.min(duration_s);
        let left_s = all_s - rest.duration_s;
        if left_s > 0.0 {
            self.dwell = Some(Segment { duration_s: left_s, flags: without_begin(rest.flags), ..rest });
        } else {
            rest.flags = rest.flags.with(SegmentFlags::BLOCK_ENDS);
        }
        sink.segment(&rest);
        rest.duration_s
    }

    fn emit(&mut self, duration_s: f64, sink: &mut dyn SegmentSink) -> Option<f64> {
        if let Some(rest) = self.dwell.take() {
            return Some(self.emit_dwell(rest, duration_s, sink));
        }
        if let Some(drive) = &mut self.driving {
            let (emitted_s, over) = drive.advance(duration_s, sink);
            if over {
                self.path_mm += drive.length_mm();
                self.driving = None;
            }
            return Some(emitted_s);
        }
        self.start_block(sink).then_some(0.0)
    }
}

impl Planner for LookAhead {
    fn describe(&self) -> PlannerDescription {
        let mut description = PlannerDescription::order_2();
        let axes = self.context.limits.axes();
        for (step, axis) in description.speed_difference_mm_per_s[..MAX_AXES].iter_mut().zip(axes) {
            *step = axis.speed_difference_mm_per_s;
        }
        description.breaks_limits = u32::from(self.options.junction == Junction::Tangent);
        description
    }

    fn check(&self, block: &Block) -> Result<(), PluginError> {
        if block.kind == BlockKind::Nurbs {
            return Err(PluginError::fixed(
                "the look-ahead planner drives lines and arcs; for NURBS use planner nurbs",
            ));
        }
        if block.kind == BlockKind::Dwell {
            let possible = block.dwell_s >= 0.0 && block.dwell_s.is_finite();
            return if possible { Ok(()) } else { Err(PluginError::fixed("a dwell needs a duration of zero or more")) };
        }
        let sound = block.start.is_finite() && block.end.is_finite() && block.length_mm > 0.0;
        let feed = block.command_feed_mm_per_s();
        if sound && feed > 0.0 {
            Ok(())
        } else {
            Err(PluginError::fixed("a block needs a length and a feed above zero"))
        }
    }

    fn accept(&mut self, block: &Block) -> Result<Accepted, PluginError> {
        if self.buffer.is_full() {
            return Ok(Accepted::Full);
        }
        self.check(block)?;
        self.finished = false;
        let rapid = block.kind == BlockKind::Rapid;
        let axes = if rapid { &self.rapid_axis_mm_per_s } else { &self.feed_axis_mm_per_s };
        let mut entry = Entry::new(block, self.context.max_feed_ratio, axes);
        if let Some(mut before) = self.pending.take() {
            self.rule.join(&mut before, &mut entry);
            self.insert(before, entry.junction_mm_per_s);
        }
        self.pending = Some(entry);
        Ok(Accepted::Accepted)
    }

    fn finish(&mut self) {
        if let Some(last) = self.pending.take() {
            self.insert(last, 0.0);
        }
        self.finished = true;
    }

    fn advance(&mut self, duration_s: f64, sink: &mut dyn SegmentSink) -> Result<Advanced, PluginError> {
        let mut emitted_s = 0.0;
        while emitted_s < duration_s {
            match self.emit(duration_s - emitted_s, sink) {
                Some(part_s) => emitted_s += part_s,
                None => break,
            }
        }
        let empty = self.buffer.len() == 0 && self.driving.is_none() && self.dwell.is_none();
        Ok(Advanced { duration_s: emitted_s, done: u32::from(empty && self.finished) })
    }

    fn reset(&mut self, position: &AxisVector) {
        self.context.position = *position;
        self.buffer.clear();
        (self.pending, self.driving, self.dwell) = (None, None, None);
        (self.path_mm, self.finished) = (0.0, false);
    }
}

fn without_begin(flags: SegmentFlags) -> SegmentFlags {
    SegmentFlags(flags.0 & !SegmentFlags::BLOCK_BEGINS.0)
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
        limited_by: LimitedBy::Feed,
        block: entry.index,
        start_feed_mm_per_s: 0.0,
        peak_feed_mm_per_s: 0.0,
        end_feed_mm_per_s: 0.0,
        time_s: entry.dwell_s,
        time_constant_s: f64::NAN,
    }
}
