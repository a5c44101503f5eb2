//! One block: speeding up, cruising, slowing down.

use tandem_sdk::{
    AxisVector, Block, BlockKind, BlockReport, LimitedBy, PlannerContext, Segment, SegmentFlags, SegmentSink
};

/// Planners stay this far inside the limits.
const WITHIN: f64 = 0.999;

/// A stretch of constant acceleration: duration, place and speed at its start.
#[derive(Clone, Copy, Default)]
struct Phase {
    duration_s: f64,
    start_mm: f64,
    speed_mm_per_s: f64,
    acceleration_mm_per_s2: f64,
}

/// A block on its way.
pub struct Drive {
    blank: Segment,
    start: AxisVector,
    end: AxisVector,
    direction: AxisVector,
    length_mm: f64,
    peak_mm_per_s: f64,
    feed_reached: bool,
    phases: [Phase; 3],
    reported: bool,
    phase: usize,
    /// Time gone in the phase, s.
    gone_s: f64,
}

impl Drive {
    pub fn new(block: &Block, context: &PlannerContext, acceleration_share: f64) -> Self {
        let mut blank = Segment::rest(&block.start, 0.0);
        (blank.block, blank.line, blank.feed_mm_per_s) = (block.index, block.line, block.command_feed_mm_per_s());
        blank.flags = SegmentFlags::BLOCK_BEGINS;
        let mut this = Self {
            blank,
            start: block.start,
            end: block.end,
            direction: AxisVector::ZERO,
            length_mm: block.length_mm,
            peak_mm_per_s: 0.0,
            feed_reached: true,
            phases: [Phase { duration_s: block.dwell_s, ..Phase::default() }, Phase::default(), Phase::default()],
            reported: false,
            phase: 0,
            gone_s: 0.0,
        };
        match block.kind {
            BlockKind::Dwell => this.blank.flags = this.blank.flags.with(SegmentFlags::DWELL),
            kind => this.plan(kind == BlockKind::Rapid, context, acceleration_share),
        }
        this
    }

    fn plan(&mut self, rapid: bool, context: &PlannerContext, acceleration_share: f64) {
        self.direction = (self.end - self.start) * (1.0 / self.length_mm);
        let limits = context.limits.along(&self.direction);
        let acceleration = WITHIN * acceleration_share * limits.acceleration_mm_per_s2;
        let most = WITHIN * if rapid { limits.rapid_mm_per_s } else { limits.feed_mm_per_s };
        let feed = (self.blank.feed_mm_per_s * context.max_feed_ratio).min(most);
        let reachable = (acceleration * self.length_mm).sqrt();
        self.peak_mm_per_s = feed.min(reachable);
        self.feed_reached = feed <= reachable;
        if rapid {
            self.blank.flags = self.blank.flags.with(SegmentFlags::RAPID);
        }
        self.blank.stop_deceleration_mm_per_s2 = acceleration;
        let peak = self.peak_mm_per_s;
        let (ramp_s, ramp_mm) = (peak / acceleration, peak * peak / (2.0 * acceleration));
        let cruise_s = ((self.length_mm - 2.0 * ramp_mm) / peak).max(0.0);
        let phase = |duration_s, start_mm, speed_mm_per_s, acceleration_mm_per_s2| Phase {
            duration_s,
            start_mm,
            speed_mm_per_s,
            acceleration_mm_per_s2,
        };
        self.phases = [
            phase(ramp_s, 0.0, 0.0, acceleration),
            phase(cruise_s, ramp_mm, peak, 0.0),
            phase(ramp_s, self.length_mm - ramp_mm, peak, -acceleration),
        ];
    }

    pub fn length_mm(&self) -> f64 {
        self.length_mm
    }

    pub fn is_over(&self) -> bool {
        self.phase > self.phases.len()
    }

    /// Emits the next segment, of at most `duration_s`; gives its duration.
    pub fn advance(&mut self, duration_s: f64, path_mm: f64, sink: &mut dyn SegmentSink) -> f64 {
        if !std::mem::replace(&mut self.reported, true) {
            sink.block(&self.report());
        }
        let Some(phase) = self.phases.get(self.phase) else { return self.rest(path_mm, sink) };
        let part_s = (phase.duration_s - self.gone_s).min(duration_s);
        if part_s > 0.0 {
            sink.segment(&self.segment(phase, part_s, path_mm));
            self.blank.flags = SegmentFlags(self.blank.flags.0 & !SegmentFlags::BLOCK_BEGINS.0);
        }
        self.gone_s += part_s;
        if self.gone_s >= phase.duration_s {
            (self.phase, self.gone_s) = (self.phase + 1, 0.0);
        }
        part_s
    }

    /// `part_s` of a phase from where it is.
    fn segment(&self, phase: &Phase, part_s: f64, path_mm: f64) -> Segment {
        let (t, half) = (self.gone_s, phase.acceleration_mm_per_s2 / 2.0);
        let speed = phase.speed_mm_per_s + 2.0 * half * t;
        let place_mm = phase.start_mm + t * (phase.speed_mm_per_s + half * t);
        let mut segment = self.blank;
        segment.duration_s = part_s;
        segment.path = [path_mm + place_mm, speed, half, 0.0, 0.0, 0.0];
        for (axis, coefficients) in segment.coefficients.iter_mut().enumerate() {
            let along = self.direction[axis];
            *coefficients = [self.start[axis] + along * place_mm, along * speed, along * half, 0.0, 0.0, 0.0];
        }
        segment
    }

    /// The programmed position itself.
    fn rest(&mut self, path_mm: f64, sink: &mut dyn SegmentSink) -> f64 {
        let mut rest = Segment::rest(&self.end, 0.0);
        (rest.block, rest.line, rest.feed_mm_per_s) = (self.blank.block, self.blank.line, self.blank.feed_mm_per_s);
        rest.flags = self.blank.flags.with(SegmentFlags::ENDS_AT_REST).with(SegmentFlags::BLOCK_ENDS);
        rest.path[0] = path_mm + self.length_mm;
        sink.segment(&rest);
        self.phase += 1;
        0.0
    }

    fn report(&self) -> BlockReport {
        BlockReport {
            limited_by: if self.feed_reached { LimitedBy::Feed } else { LimitedBy::Acceleration },
            block: self.blank.block,
            start_feed_mm_per_s: 0.0,
            peak_feed_mm_per_s: self.peak_mm_per_s,
            end_feed_mm_per_s: 0.0,
            time_s: self.phases.iter().map(|phase| phase.duration_s).sum(),
            time_constant_s: f64::NAN,
        }
    }
}
