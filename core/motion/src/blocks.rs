//! What every planner writes about blocks: whether it can drive them, the segments that begin, rest and dwell, and reports.

use tandem_sdk::{
    Axes, AxisVector, Block, BlockKind, BlockReport, LimitedBy, PluginError, Segment, SegmentFlags,
    SegmentSink,
};

/// The block that a segment belongs to.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct BlockId {
    /// Its number in the run.
    pub index: u64,
    /// Its line in the part program.
    pub line: u32,
}

impl From<&Block> for BlockId {
    fn from(block: &Block) -> Self {
        Self {
            index: block.index,
            line: block.line,
        }
    }
}

/// Checks what all planners ask of a block: finite ends, a length, a feed, a plane of axes that the machine has. What a planner
/// asks beyond that (kinds, curves, tolerances) it checks itself. Rough loop; allocates nothing.
///
/// # Errors
/// What is missing, in words for the operator.
#[inline]
pub fn check(block: &Block, axes: &Axes) -> Result<(), PluginError> {
    let refuse = |why| Err(PluginError::fixed(why));
    let has_ends = block.start.is_finite() & block.end.is_finite();
    match block.kind {
        BlockKind::Dwell if !(has_ends && block.dwell_s >= 0.0 && block.dwell_s.is_finite()) => {
            refuse("a dwell needs a place and a duration of zero or more")
        }
        BlockKind::Dwell => Ok(()),
        BlockKind::Arc
            if !block
                .arc
                .plane
                .iter()
                .all(|axis| (*axis as usize) < axes.count()) =>
        {
            refuse("an arc lies in a plane of axes that the machine lacks")
        }
        _ if !(has_ends && block.length_mm > 0.0 && block.length_mm.is_finite()) => {
            refuse("a block needs two ends and a length above zero")
        }
        // Both are looked at, because the smaller of a number and NaN is the number.
        _ if block.feed_mm_per_s > 0.0 && block.feed_cap_mm_per_s > 0.0 => Ok(()),
        _ => refuse("a block needs a feed above zero"),
    }
}

/// What limits a block that is driven at its feed: the program, or the cap that a policy laid on it.
pub fn limited_by_feed(block: &Block) -> LimitedBy {
    if block.feed_cap_mm_per_s < block.feed_mm_per_s {
        LimitedBy::Policy
    } else {
        LimitedBy::Feed
    }
}

/// The report of block number `block`: its feeds at the start, the highest and at the end, mm/s, and its duration, s. No time
/// constant is reported.
pub fn report(
    block: u64,
    limited_by: LimitedBy,
    feeds_mm_per_s: [f64; 3],
    time_s: f64,
) -> BlockReport {
    let [start_feed_mm_per_s, peak_feed_mm_per_s, end_feed_mm_per_s] = feeds_mm_per_s;
    BlockReport {
        limited_by,
        block,
        start_feed_mm_per_s,
        peak_feed_mm_per_s,
        end_feed_mm_per_s,
        time_s,
        time_constant_s: f64::NAN,
    }
}

/// Writes the segments of a planner that are no motion, and the blank of those that are. It holds the dwell that is under way.
/// Rough loop; allocates nothing.
#[derive(Debug)]
pub struct BlockWriter {
    /// Order of the limits that its segments of motion keep.
    order: u32,
    /// What is left of the dwell that is emitted.
    dwell: Option<Segment>,
}

impl BlockWriter {
    /// A writer for motion that keeps limits of `order`: 2 velocity and acceleration, 3 also jerk.
    pub fn new(order: u32) -> Self {
        Self { order, dwell: None }
    }

    /// What all segments of `block` say, as a rest at its start: the first of them begins the block.
    pub fn blank(&self, block: &Block) -> Segment {
        let mut blank = self.rest(BlockId::from(block), &block.start, 0.0);
        blank.flags = SegmentFlags::BLOCK_BEGINS;
        if block.kind == BlockKind::Rapid {
            blank.flags = blank.flags.with(SegmentFlags::RAPID);
        } else {
            blank.feed_mm_per_s = block.command_feed_mm_per_s();
        }
        blank
    }

    /// A rest at `position`, `path_mm` after the start of the run: the sample at which the machine stands still exactly there.
    pub fn rest(&self, block: BlockId, position: &AxisVector, path_mm: f64) -> Segment {
        let mut rest = Segment::rest(position, 0.0);
        rest.block = block.index;
        rest.line = block.line;
        rest.order = self.order;
        rest.path[0] = path_mm;
        rest
    }

    /// Begins a dwell of `duration_s` and reports it.
    pub fn begin_dwell(
        &mut self,
        block: BlockId,
        position: &AxisVector,
        duration_s: f64,
        path_mm: f64,
        sink: &mut dyn SegmentSink,
    ) {
        let mut dwell = self.rest(block, position, path_mm);
        dwell.order = 2;
        dwell.duration_s = duration_s;
        dwell.flags = dwell
            .flags
            .with(SegmentFlags::DWELL)
            .with(SegmentFlags::BLOCK_BEGINS);
        self.dwell = Some(dwell);
        sink.block(&report(block.index, LimitedBy::Feed, [0.0; 3], duration_s));
    }

    /// Whether a dwell is under way.
    pub fn is_dwelling(&self) -> bool {
        self.dwell.is_some()
    }

    /// Emits at most `left_s` of the dwell and returns how much that was, s; `None` where no dwell is under way.
    pub fn emit_dwell(&mut self, left_s: f64, sink: &mut dyn SegmentSink) -> Option<f64> {
        let dwell = self.dwell.as_mut()?;
        // The part is the smaller of two durations and no difference of them: a part that is lost in the rounding of a long
        // dwell would never end it.
        let part_s = dwell.duration_s.min(left_s);
        let later_s = dwell.duration_s - part_s;
        dwell.duration_s = part_s;
        if later_s <= 0.0 {
            dwell.flags = dwell.flags.with(SegmentFlags::BLOCK_ENDS);
        }
        sink.segment(dwell);
        if later_s > 0.0 {
            dwell.duration_s = later_s;
            dwell.flags = dwell.flags.without(SegmentFlags::BLOCK_BEGINS);
        } else {
            self.dwell = None;
        }
        Some(part_s)
    }

    /// Forgets the dwell.
    pub fn reset(&mut self) {
        self.dwell = None;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Default)]
    struct Kept(Vec<Segment>, Vec<BlockReport>);

    impl SegmentSink for Kept {
        fn segment(&mut self, segment: &Segment) {
            self.0.push(*segment);
        }

        fn block(&mut self, report: &BlockReport) {
            self.1.push(*report);
        }
    }

    #[test]
    fn a_dwell_in_parts_begins_once_and_ends_once_however_its_parts_round() {
        for parts in [[0.3, 0.4, 9.0], [1e-12, 1e-13, 9e9], [0.7, 0.6, 0.0]] {
            let mut writer = BlockWriter::new(3);
            let mut kept = Kept::default();
            let at = AxisVector::from_slice(&[1.0, 2.0]);
            let duration_s = if parts[2] > 1e9 { 1e6 } else { 1.0 };
            writer.begin_dwell(
                BlockId { index: 7, line: 9 },
                &at,
                duration_s,
                5.0,
                &mut kept,
            );
            let emitted: f64 = parts
                .iter()
                .map_while(|left_s| writer.emit_dwell(*left_s, &mut kept))
                .sum();
            assert!(
                (emitted - duration_s).abs() < 1e-9 && !writer.is_dwelling(),
                "{parts:?}: {emitted}"
            );
            let count = |flag| {
                kept.0
                    .iter()
                    .filter(|segment| segment.flags.contains(flag))
                    .count()
            };
            assert_eq!(
                (
                    count(SegmentFlags::BLOCK_BEGINS),
                    count(SegmentFlags::BLOCK_ENDS)
                ),
                (1, 1),
                "{parts:?}"
            );
            assert!(kept.0[0].flags.contains(SegmentFlags::BLOCK_BEGINS));
            assert!(
                kept.0
                    .iter()
                    .all(|segment| segment.flags.contains(SegmentFlags::DWELL)
                        && segment.duration_s > 0.0)
            );
            assert!(
                kept.0
                    .iter()
                    .all(|segment| (segment.block, segment.line, segment.path[0]) == (7, 9, 5.0))
            );
            assert_eq!(
                (kept.1.len(), kept.1[0].block, kept.1[0].time_s),
                (1, 7, duration_s)
            );
        }
    }

    #[test]
    fn a_block_that_lacks_something_is_refused_in_words() {
        let axes = Axes::new(&[('X', false), ('Y', false)]).unwrap();
        let line = Block {
            kind: BlockKind::Line,
            length_mm: 1.0,
            feed_mm_per_s: 1.0,
            ..Block::at(AxisVector::ZERO)
        };
        let arc = Block {
            kind: BlockKind::Arc,
            ..line
        };
        let says = |block: Block| {
            check(&block, &axes)
                .err()
                .map(|error| error.to_string())
                .unwrap_or_default()
        };
        assert_eq!(says(line), "");
        assert!(
            says(Block {
                length_mm: 0.0,
                ..line
            })
            .contains("length")
        );
        assert!(
            says(Block {
                end: AxisVector::ZERO * f64::NAN,
                ..line
            })
            .contains("ends")
        );
        assert!(
            says(Block {
                feed_mm_per_s: f64::NAN,
                ..line
            })
            .contains("feed")
        );
        assert!(
            says(Block {
                feed_cap_mm_per_s: f64::NAN,
                ..line
            })
            .contains("feed")
        );
        assert!(
            says(Block {
                feed_cap_mm_per_s: 0.0,
                ..line
            })
            .contains("feed")
        );
        assert!(
            says(Block {
                dwell_s: -1.0,
                ..Block::at(AxisVector::ZERO)
            })
            .contains("dwell")
        );
        assert!(
            says(Block {
                start: AxisVector::ZERO * f64::NAN,
                ..Block::at(AxisVector::ZERO)
            })
            .contains("place")
        );
        assert!(
            says(Block {
                arc: tandem_sdk::ArcGeometry {
                    plane: [0, 2],
                    ..arc.arc
                },
                ..arc
            })
            .contains("plane")
        );
    }

    #[test]
    fn a_block_is_refused_for_what_it_lacks() {
        let axes = Axes::new(&[('X', false), ('Y', false)]).unwrap();
        let arc = |plane| {
            let mut arc = Block {
                kind: BlockKind::Arc,
                length_mm: 1.0,
                feed_mm_per_s: 10.0,
                ..Block::at(AxisVector::ZERO)
            };
            arc.arc.plane = plane;
            arc
        };
        assert!(check(&arc([0, 1]), &axes).is_ok());
        let said = check(&arc([0, 2]), &axes).unwrap_err().to_string();
        assert!(said.contains("axes that the machine lacks"), "{said}");
        let mut long = arc([0, 1]);
        long.length_mm = f64::INFINITY;
        assert!(check(&long, &axes).is_err());
        let mut still = arc([0, 1]);
        still.feed_cap_mm_per_s = 0.0;
        assert!(check(&still, &axes).is_err());
        still.kind = BlockKind::Dwell;
        assert!(check(&still, &axes).is_ok());
        still.dwell_s = -1.0;
        assert!(check(&still, &axes).is_err());
    }

    #[test]
    fn a_cap_limits_a_block_only_where_it_is_below_the_feed() {
        for (cap, by) in [
            (9.0, LimitedBy::Policy),
            (10.0, LimitedBy::Feed),
            (11.0, LimitedBy::Feed),
        ] {
            let block = Block {
                feed_mm_per_s: 10.0,
                feed_cap_mm_per_s: cap,
                ..Block::at(AxisVector::ZERO)
            };
            assert_eq!(limited_by_feed(&block), by, "{cap} mm/s");
        }
    }

    #[test]
    fn a_writer_that_is_reset_forgets_its_dwell() {
        let mut writer = BlockWriter::new(3);
        let mut kept = Kept::default();
        let block = BlockId { index: 7, line: 9 };
        writer.begin_dwell(block, &AxisVector::ZERO, 1.0, 0.0, &mut kept);
        assert!(writer.is_dwelling());
        writer.reset();
        assert!(!writer.is_dwelling() && writer.emit_dwell(1.0, &mut kept).is_none());
    }

    #[test]
    fn the_blank_of_a_rapid_is_rapid_and_that_of_a_line_has_its_feed() {
        for (kind, rapid, feed) in [
            (BlockKind::Rapid, true, f64::INFINITY),
            (BlockKind::Line, false, 10.0),
        ] {
            let block = Block {
                kind,
                feed_mm_per_s: 10.0,
                ..Block::at(AxisVector::ZERO)
            };
            let blank = BlockWriter::new(3).blank(&block);
            assert_eq!(blank.flags.contains(SegmentFlags::RAPID), rapid);
            assert_eq!(blank.feed_mm_per_s, feed);
        }
    }
}
