//! What a planner emitted.

use tandem_sdk::{AxisVector, BlockReport, Segment, SegmentSink};

use crate::MM_PER_MIN;

/// Segments and reports, in order.
#[derive(Debug, Default)]
pub struct Collected {
    /// The motion.
    pub segments: Vec<Segment>,
    /// The blocks as they are planned.
    pub reports: Vec<BlockReport>,
}

impl SegmentSink for Collected {
    /// # Panics
    /// Its block is not reported yet.
    fn segment(&mut self, segment: &Segment) {
        let known = self
            .reports
            .iter()
            .rev()
            .any(|report| report.block == segment.block);
        assert!(known, "block {} moves before it is reported", segment.block);
        self.segments.push(*segment);
    }

    fn block(&mut self, report: &BlockReport) {
        self.reports.push(*report);
    }
}

impl Collected {
    /// Of all segments, s.
    pub fn duration_s(&self) -> f64 {
        self.segments.iter().map(|segment| segment.duration_s).sum()
    }

    /// Where the motion ends.
    ///
    /// # Panics
    /// Nothing has moved, as in all that follow.
    pub fn end(&self) -> AxisVector {
        let last = self.segments.last().unwrap();
        last.position(last.duration_s)
    }

    /// Every segment with its start time, s.
    pub fn timed(&self) -> impl Iterator<Item = (f64, &Segment)> {
        let start = |clock_s: &mut f64, segment: &Segment| {
            Some(std::mem::replace(clock_s, *clock_s + segment.duration_s))
        };
        let starts = self.segments.iter().scan(0.0, start);
        starts.zip(&self.segments)
    }

    /// The segment of program time `t_s`, and the time since its start, s: of two that meet there, the first; at last the
    /// end.
    pub fn place(&self, t_s: f64) -> (&Segment, f64) {
        let inside = self
            .timed()
            .find(|(start_s, segment)| t_s <= start_s + segment.duration_s);
        let last = self.segments.last().unwrap();
        inside.map_or((last, last.duration_s), |(start_s, segment)| {
            (segment, t_s - start_s)
        })
    }

    /// Position and velocity at program time `t_s`.
    pub fn at(&self, t_s: f64) -> (AxisVector, AxisVector) {
        let (segment, since_s) = self.place(t_s);
        (segment.position(since_s), segment.velocity(since_s))
    }

    /// Positions every `period_s`, from the start to two periods of rest.
    pub fn samples(&self, period_s: f64) -> Vec<AxisVector> {
        let (mut index, mut start_s) = (0, 0.0);
        let mut at = |tick: usize| {
            let t_s = tick as f64 * period_s;
            while index + 1 < self.segments.len() && t_s > start_s + self.segments[index].duration_s
            {
                start_s += self.segments[index].duration_s;
                index += 1;
            }
            self.segments[index].position((t_s - start_s).min(self.segments[index].duration_s))
        };
        let count = (self.duration_s() / period_s).ceil() as usize + 3;
        (0..count).map(&mut at).collect()
    }

    /// Positions and path coordinates, mm, at multiples of `period_s`, and at the end.
    pub fn path_samples(&self, period_s: f64) -> Vec<(AxisVector, f64)> {
        let mut samples = Vec::new();
        for (start_s, segment) in self.timed() {
            while samples.len() as f64 * period_s < start_s + segment.duration_s {
                let t_s = samples.len() as f64 * period_s - start_s;
                samples.push((segment.position(t_s), segment.path_mm(t_s)));
            }
        }
        let (last, end_s) = self.place(f64::INFINITY);
        samples.push((last.position(end_s), last.path_mm(end_s)));
        samples
    }

    /// Program times at which the blocks start, s.
    pub fn starts_s(&self) -> Vec<f64> {
        let sum =
            |at: &mut f64, report: &BlockReport| Some(std::mem::replace(at, *at + report.time_s));
        self.reports.iter().scan(0.0, sum).collect()
    }

    /// Start feeds of all blocks and the end feed of the last, mm/min.
    pub fn junction_feeds(&self) -> Vec<f64> {
        let starts = self
            .reports
            .iter()
            .map(|r| r.start_feed_mm_per_s * MM_PER_MIN);
        starts
            .chain(
                self.reports
                    .last()
                    .map(|r| r.end_feed_mm_per_s * MM_PER_MIN),
            )
            .collect()
    }
}
