//! Motion that is planned window by window: what planners with windows have in common.
//!
//! A window is a part of the path ahead, planned from the present state to a rest, so that what is planned can always be driven to
//! its end. Only its first part is driven; then the next window begins there. One state machine does it:
//!
//! ```text
//! at rest ── a dwell comes ─────▶ dwelling ── its time is over ───────────▶ at rest
//!    │
//!    └────── path comes: plan ──▶ driving ─── to the end of the window ───▶ at rest
//!                                 │     ▲
//!          the part is driven ────┘     │ the next window, from its start
//!                          └── plan ────┤
//!                                       └ no window was found: more of this one
//! ```
//!
//! What a window is, how it is planned, checked and drawn, is its planner's: it implements [`Windows`].

use tandem_sdk::{AxisVector, Block, BlockReport, PluginError, Segment, SegmentFlags, SegmentSink};

use crate::blocks::{BlockId, BlockWriter};

/// What comes next where the machine rests.
#[derive(Clone, Copy, Debug)]
#[allow(
    clippy::large_enum_variant,
    reason = "it is looked at and gone; boxing it would allocate"
)]
pub enum Next {
    /// Nothing is known.
    Nothing,
    /// A dwell, which was taken off the path; and the path coordinate of the rest, mm.
    Dwell(Block, f64),
    /// Path to be planned.
    Path,
    /// Something that took no time, which was taken off the path: ask again.
    Again,
}

/// Until when what is planned is driven, s from the start of its window.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Planned {
    /// Another window, from its start.
    NextWindow {
        /// Until then.
        commit_s: f64,
    },
    /// More of the present one.
    SameWindow {
        /// Until then.
        commit_s: f64,
    },
}

/// A piece of a window as it was emitted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Emitted {
    /// Until when the window is driven, s from its start.
    pub until_s: f64,
    /// Duration of what was emitted, s.
    pub duration_s: f64,
}

/// What a planner with windows plans and draws. Rough loop.
pub trait Windows {
    /// What comes next, at rest; the dwell, or what takes no time, is taken off.
    fn next(&mut self, blocks: &mut Blocks, sink: &mut dyn SegmentSink) -> Next;

    /// Plans a window from rest, and gives until when it is driven, s. `finished` says that nothing follows what is known.
    ///
    /// # Errors
    /// No motion keeps the limits.
    fn plan_from_rest(&mut self, finished: bool) -> Result<f64, PluginError>;

    /// Plans the window after the present one, of which `now_s` are driven.
    fn plan_on(&mut self, now_s: f64, finished: bool) -> Planned;

    /// Duration of the present window, s.
    fn duration_s(&self) -> f64;

    /// Emits the segment of the present window that begins at `from_s`: at most to `commit_s`, and about `left_s` long.
    fn emit(
        &mut self,
        from_s: f64,
        commit_s: f64,
        left_s: f64,
        blocks: &mut Blocks,
        sink: &mut dyn SegmentSink,
    ) -> Emitted;

    /// The present window is driven to its end: emits the rest there.
    fn rest(&mut self, blocks: &mut Blocks, sink: &mut dyn SegmentSink);
}

/// Which block moves, and what its segments say. Every block is reported once, before its first segment.
#[derive(Debug)]
pub struct Blocks {
    writer: BlockWriter,
    /// What segments of the present block say; the first of them begins it.
    pub blank: Segment,
    reported: Option<u64>,
}

impl Blocks {
    fn new(position: &AxisVector) -> Self {
        Self {
            writer: BlockWriter::new(3),
            blank: Segment::rest(position, 0.0),
            reported: None,
        }
    }

    /// Whether `block` was the last to be reported.
    pub fn is_reported(&self, block: &Block) -> bool {
        self.reported == Some(block.index)
    }

    /// Reports a block that takes no segment of its own.
    pub fn report(&mut self, report: &BlockReport, sink: &mut dyn SegmentSink) {
        self.reported = Some(report.block);
        sink.block(report);
    }

    /// Begins `block`, which is driven as `report` says: segments are its own from here on.
    pub fn begin(&mut self, block: &Block, report: &BlockReport, sink: &mut dyn SegmentSink) {
        self.report(report, sink);
        self.blank = self.writer.blank(block);
    }

    /// A segment of the present block was emitted: what follows does not begin it.
    pub fn has_begun(&mut self) {
        self.blank.flags = self.blank.flags.without(SegmentFlags::BLOCK_BEGINS);
    }

    /// The block that the present segments belong to.
    pub fn present(&self) -> BlockId {
        BlockId {
            index: self.blank.block,
            line: self.blank.line,
        }
    }

    /// Emits a rest at `position` in or at the end of a block.
    pub fn rest(
        &self,
        block: BlockId,
        position: &AxisVector,
        path_mm: f64,
        sink: &mut dyn SegmentSink,
    ) {
        sink.segment(&self.writer.rest(block, position, path_mm));
    }
}

/// How much of the present window is driven, and is to be driven, s.
#[derive(Clone, Copy, Debug)]
struct Driving {
    driven_s: f64,
    commit_s: f64,
}

/// The state machine. It allocates nothing.
#[derive(Debug)]
pub struct Stream {
    blocks: Blocks,
    /// None at rest.
    driving: Option<Driving>,
    finished: bool,
}

impl Stream {
    /// At rest at `position`.
    pub fn new(position: &AxisVector) -> Self {
        Self {
            blocks: Blocks::new(position),
            driving: None,
            finished: false,
        }
    }

    /// A block was taken: more may follow.
    pub fn accepted(&mut self) {
        self.finished = false;
    }

    /// No block follows for now: the last one ends at rest.
    pub fn finish(&mut self) {
        self.finished = true;
    }

    /// How much of the present window is driven, s; none at rest.
    pub fn driven_s(&self) -> Option<f64> {
        self.driving.map(|driving| driving.driven_s)
    }

    /// Whether all is emitted, where `empty` says that no path and no dwell is left.
    pub fn is_done(&self, empty: bool) -> bool {
        self.finished && empty && self.driving.is_none() && !self.blocks.writer.is_dwelling()
    }

    /// Emits the next piece of `windows`, about `left_s` long, and gives its duration, s; `None` where nothing can be emitted for
    /// now. A step without a segment takes no time.
    ///
    /// # Errors
    /// No motion from rest keeps the limits.
    pub fn emit<W: Windows>(
        &mut self,
        windows: &mut W,
        left_s: f64,
        sink: &mut dyn SegmentSink,
    ) -> Result<Option<f64>, PluginError> {
        let blocks = &mut self.blocks;
        if let Some(emitted_s) = blocks.writer.emit_dwell(left_s, sink) {
            return Ok(Some(emitted_s));
        }
        let Some(Driving { driven_s, commit_s }) = self.driving else {
            return self.begin(windows, sink);
        };
        if driven_s < commit_s {
            let emitted = windows.emit(driven_s, commit_s, left_s, blocks, sink);
            self.driving = Some(Driving {
                driven_s: emitted.until_s,
                commit_s,
            });
            return Ok(Some(emitted.duration_s));
        }
        if driven_s >= windows.duration_s() {
            windows.rest(blocks, sink);
            self.driving = None;
        } else {
            self.driving = Some(match windows.plan_on(driven_s, self.finished) {
                Planned::NextWindow { commit_s } => Driving {
                    driven_s: 0.0,
                    commit_s,
                },
                Planned::SameWindow { commit_s } => Driving { driven_s, commit_s },
            });
        }
        Ok(Some(0.0))
    }

    /// Begins what comes next, at rest.
    fn begin<W: Windows>(
        &mut self,
        windows: &mut W,
        sink: &mut dyn SegmentSink,
    ) -> Result<Option<f64>, PluginError> {
        match windows.next(&mut self.blocks, sink) {
            Next::Nothing => return Ok(None),
            Next::Again => {}
            Next::Dwell(block, path_mm) => {
                self.blocks.reported = Some(block.index);
                self.blocks.writer.begin_dwell(
                    BlockId::from(&block),
                    &block.end,
                    block.dwell_s,
                    path_mm,
                    sink,
                );
            }
            Next::Path => {
                let commit_s = windows.plan_from_rest(self.finished)?;
                self.driving = Some(Driving {
                    driven_s: 0.0,
                    commit_s,
                });
            }
        }
        Ok(Some(0.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tandem_sdk::{BlockKind, LimitedBy};

    /// Windows of two seconds in which one second is driven, until the last of them; what was asked is written down.
    struct Scripted {
        next: Vec<Next>,
        windows: u32,
        refused: u32,
        seen: Vec<String>,
    }

    impl Windows for Scripted {
        fn next(&mut self, _: &mut Blocks, _: &mut dyn SegmentSink) -> Next {
            self.next.pop().unwrap_or(Next::Nothing)
        }

        fn plan_from_rest(&mut self, finished: bool) -> Result<f64, PluginError> {
            self.seen.push(format!("from rest, finished {finished}"));
            if self.windows == 0 {
                Err(PluginError::fixed("no way"))
            } else {
                Ok(1.0)
            }
        }

        fn plan_on(&mut self, now_s: f64, _: bool) -> Planned {
            self.seen.push(format!("on from {now_s}"));
            if self.refused > 0 {
                self.refused -= 1;
                return Planned::SameWindow {
                    commit_s: now_s + 0.5,
                };
            }
            self.windows -= 1;
            Planned::NextWindow {
                commit_s: if self.windows == 0 { 2.0 } else { 1.0 },
            }
        }

        fn duration_s(&self) -> f64 {
            2.0
        }

        fn emit(
            &mut self,
            from_s: f64,
            commit_s: f64,
            left_s: f64,
            blocks: &mut Blocks,
            sink: &mut dyn SegmentSink,
        ) -> Emitted {
            let block = Block {
                kind: BlockKind::Line,
                index: 4,
                ..Block::at(AxisVector::ZERO)
            };
            if !blocks.is_reported(&block) {
                blocks.begin(
                    &block,
                    &crate::blocks::report(4, LimitedBy::Feed, [0.0; 3], 1.0),
                    sink,
                );
            }
            let until_s = commit_s.min(from_s + left_s);
            sink.segment(&Segment {
                duration_s: until_s - from_s,
                ..blocks.blank
            });
            blocks.has_begun();
            Emitted {
                until_s,
                duration_s: until_s - from_s,
            }
        }

        fn rest(&mut self, blocks: &mut Blocks, sink: &mut dyn SegmentSink) {
            self.seen.push("rest".to_string());
            blocks.rest(blocks.present(), &AxisVector::ZERO, 0.0, sink);
        }
    }

    #[derive(Default)]
    struct Counted {
        begins: u32,
        rests: u32,
        reports: u32,
    }

    impl SegmentSink for Counted {
        fn segment(&mut self, segment: &Segment) {
            self.begins += u32::from(segment.flags.contains(SegmentFlags::BLOCK_BEGINS));
            self.rests += u32::from(
                segment.flags.contains(SegmentFlags::ENDS_AT_REST) && segment.duration_s == 0.0,
            );
        }

        fn block(&mut self, _: &BlockReport) {
            self.reports += 1;
        }
    }

    #[test]
    fn windows_follow_each_other_to_a_rest_and_a_refused_one_is_driven_on() {
        let dwell = Block {
            dwell_s: 0.25,
            index: 3,
            ..Block::at(AxisVector::ZERO)
        };
        let next = vec![Next::Path, Next::Again, Next::Dwell(dwell, 7.0)];
        let mut windows = Scripted {
            next,
            windows: 2,
            refused: 1,
            seen: vec![],
        };
        let mut stream = Stream::new(&AxisVector::ZERO);
        let mut counted = Counted::default();
        stream.finish();
        let mut sum_s = 0.0;
        while let Some(emitted_s) = stream.emit(&mut windows, 0.4, &mut counted).unwrap() {
            assert!(!stream.is_done(true) || stream.driven_s().is_none());
            sum_s += emitted_s;
        }
        // The dwell; one second of the first window and half a second more; one of the second; all of the last.
        assert!((sum_s - (0.25 + 1.5 + 1.0 + 2.0)).abs() < 1e-12, "{sum_s}");
        assert_eq!(
            windows.seen,
            [
                "from rest, finished true",
                "on from 1",
                "on from 1.5",
                "on from 1",
                "rest"
            ]
        );
        assert_eq!((counted.begins, counted.rests, counted.reports), (2, 1, 2));
        assert!(stream.is_done(true) && !stream.is_done(false));
        stream.accepted();
        assert!(!stream.is_done(true));
    }

    #[test]
    fn where_no_motion_from_rest_is_found_the_error_is_the_planners() {
        let mut windows = Scripted {
            next: vec![Next::Path],
            windows: 0,
            refused: 0,
            seen: vec![],
        };
        let error = Stream::new(&AxisVector::ZERO)
            .emit(&mut windows, 1.0, &mut Counted::default())
            .unwrap_err();
        assert_eq!(error.message(), "no way");
    }
}
