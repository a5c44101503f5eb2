//! The filtered motion between two rests: time, the signal behind it and the segments that come out.

use tandem_motion::Path;
use tandem_sdk::{AxisVector, PlannerContext, Segment, SegmentFlags};

use crate::feeds::Feeds;
use crate::filter::{Filter, Knot};
use crate::options::Options;
use crate::piece::{Piece, RESOLUTION_S};
use crate::signal::Signal;

/// Largest angle of an arc in one piece, rad: the fit of a quintic is then within 3e-11 of the radius.
const MAX_TURN_RAD: f64 = 0.1;

/// Kinks so near to the end of a piece do not get one of their own, s: over this no acceleration changes a velocity much. With half
/// and with twice as much no test of this crate had another result.
const NEAR_S: f64 = 1e-8;

/// The block that moves.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Driving {
    /// What all its segments have in common.
    blank: Segment,
    /// Where it ends, settling counted, s.
    end_s: f64,
    stops: bool,
    goal: AxisVector,
}

/// The machine on its filtered way.
#[derive(Debug)]
pub(crate) struct Motion {
    context: PlannerContext,
    filter: Filter,
    signal: Signal,
    feeds: Feeds,
    driving: Option<Driving>,
    /// Time since the last rest, s, and the motion there.
    now_s: f64,
    knot: Knot,
    path_mm: f64,
}

impl Motion {
    /// At rest. Allocates.
    pub fn new(options: &Options, context: &PlannerContext) -> Self {
        Self {
            context: *context,
            filter: Filter::new(options, context.limits.axes()),
            signal: Signal::new(&context.position),
            feeds: Feeds::new(),
            driving: None,
            now_s: 0.0,
            knot: Knot::rest(&context.position),
            path_mm: 0.0,
        }
    }

    /// Forgets everything: at rest at `position`, with no path behind.
    pub fn reset(&mut self, position: &AxisVector) {
        self.driving = None;
        self.path_mm = 0.0;
        self.rest_at(position);
    }

    /// Whether a block moves.
    pub fn is_driving(&self) -> bool {
        self.driving.is_some()
    }

    /// Time constant of the filter, s.
    pub fn time_constant_s(&self) -> f64 {
        self.filter.time_constant_s()
    }

    /// Path driven so far, mm.
    pub fn path_mm(&self) -> f64 {
        self.path_mm
    }

    /// Spans of the signal held.
    pub fn held(&self) -> usize {
        self.signal.len()
    }

    /// Begins a block that is driven at `feed_mm_per_s`; its segments are made from `blank`. Gives its duration, s, the
    /// settling after it counted where it `stops`.
    pub fn begin(&mut self, blank: &Segment, path: &Path, feed_mm_per_s: f64, stops: bool) -> f64 {
        let begin_s = self.signal.end_s();
        self.signal.push_path(path, feed_mm_per_s);
        let moves_until_s = self.signal.end_s() + self.filter.settle_s();
        let axes = &self.context.axes;
        let moved = path.max_direction();
        let linear = (0..axes.count()).any(|axis| !axes.is_rotary(axis) && moved[axis] != 0.0);
        self.feeds.push(blank.feed_mm_per_s, moves_until_s, linear);
        if stops {
            self.signal.push_rest(path.end(), self.filter.settle_s());
        }
        let end_s = self.signal.end_s();
        self.driving = Some(Driving {
            blank: *blank,
            end_s,
            stops,
            goal: *path.end(),
        });
        end_s - begin_s
    }

    /// The next piece, at most `left_s` long; `None` where no block moves. Does not allocate.
    pub fn emit(&mut self, left_s: f64) -> Option<Segment> {
        let driving = self.driving?;
        let end_s = self.piece_end_s(left_s);
        let over = end_s >= driving.end_s;
        let (mut segment, knot) = self.segment(&driving, end_s, over && driving.stops);
        if over {
            segment.flags = segment.flags.with(SegmentFlags::BLOCK_ENDS);
        }
        self.path_mm = segment.path_mm(segment.duration_s);
        self.knot = knot;
        self.now_s = end_s;
        self.move_on(driving, over);
        Some(segment)
    }

    /// Where the piece that begins now ends: at the latest with the block, after `left_s` and after a fine period, and
    /// wherever a kink of the programmed motion comes out of the filter.
    fn piece_end_s(&self, left_s: f64) -> f64 {
        let head_s = self.signal.span_at(self.now_s).end_s();
        let mut longest_s = self.context.fine_period_s.min(self.filter.longest_s());
        let mut kink_s = f64::INFINITY;
        for delay in self.filter.delays() {
            let delay_s = delay * self.filter.time_constant_s();
            // A kink that comes at once counts as lying at the start of this piece.
            let span = self.signal.span_at(self.now_s + NEAR_S - delay_s);
            kink_s = kink_s.min(span.end_s() + delay_s);
            longest_s = longest_s.min(MAX_TURN_RAD / span.turn_rad_per_s());
        }
        let mut end_s = self.now_s + longest_s;
        if head_s - end_s < NEAR_S {
            end_s = head_s;
        }
        if kink_s < end_s - NEAR_S {
            end_s = kink_s;
        }
        // Less than the resolution of the clock would not pass at all.
        end_s.min(self.now_s + left_s.max(RESOLUTION_S))
    }

    /// The segment from now to `end_s`, at rest on the goal there if `at_goal`, and the knot at its end.
    fn segment(&mut self, driving: &Driving, end_s: f64, at_goal: bool) -> (Segment, Knot) {
        let now_s = self.now_s;
        let filter = &self.filter;
        let signal = &self.signal;
        let middle_s = f64::midpoint(now_s, end_s);
        let from = self.knot;
        let settled = Knot::rest(&driving.goal);
        let to = if at_goal {
            settled
        } else {
            filter.knot(signal, end_s, end_s - now_s, &from)
        };
        let piece = Piece {
            duration_s: end_s - now_s,
            from,
            to,
            from_acceleration: filter.acceleration(signal, now_s, middle_s, &from.velocity),
            to_acceleration: filter.acceleration(signal, end_s, middle_s, &to.velocity),
        };
        let mut segment = Segment {
            duration_s: piece.duration_s,
            ..driving.blank
        };
        segment.coefficients = piece.coefficients();
        let feeds = &self.feeds;
        let axes = &self.context.axes;
        segment.path = piece.path(&segment, self.path_mm, |velocity| {
            feeds.counted(velocity, axes, middle_s)
        });
        segment.feed_mm_per_s = self.feeds.highest_mm_per_s(middle_s);
        if at_goal {
            segment.flags = segment.flags.with(SegmentFlags::ENDS_AT_REST);
        }
        (segment, to)
    }

    fn move_on(&mut self, mut driving: Driving, over: bool) {
        if over && driving.stops {
            self.rest_at(&driving.goal);
        } else {
            self.signal.drop_before(self.now_s - self.filter.memory_s());
        }
        driving.blank.flags = driving.blank.flags.without(SegmentFlags::BLOCK_BEGINS);
        self.driving = (!over).then_some(driving);
    }

    /// At rest the past is of no more use, and time starts anew.
    fn rest_at(&mut self, position: &AxisVector) {
        self.signal.restart(position);
        self.feeds.clear();
        self.now_s = 0.0;
        self.knot = Knot::rest(position);
    }
}
