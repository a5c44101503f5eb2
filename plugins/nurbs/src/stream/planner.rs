//! Blocks in, segments out.

use std::collections::VecDeque;

use tandem_motion::blocks::{limited_by_feed, report};
use tandem_motion::stream::{Blocks, Emitted, Next, Planned, Stream, Windows};
use tandem_sdk::{
    AxisVector, Block, BlockReport, LimitedBy, PlannerContext, PluginError, Segment, SegmentFlags,
    SegmentSink,
};

use super::draw::{Drawn, Pen, draw};
use super::queue::{Item, Queue};
use super::{Bounds, Cursor, Driven, Job, Leg, Motion, Planning, Start, State, Window, stop_s};
use crate::course::Course;

/// Share of the jerk limits on which a stop counts: the plan takes the rest.
const STOP_JERK: f64 = 0.5;
/// Stops before the end of a window that are left to the next one.
const STOPS: f64 = 1.5;
/// A window shorter than this that ends where the known path ends is driven to its end, s.
const SHORT_S: f64 = 0.15;
/// How often the way from rest to rest is halved where no motion is found on it.
const SHORTER: usize = 32;

/// A form with windows. Rough loop: blocks allocate when they are accepted, windows where one is longer than any before.
#[derive(Debug)]
pub struct Streamer<P: Planning> {
    stream: Stream,
    ahead: PathAhead<P>,
}

/// The path ahead, and the window that is driven on it.
#[derive(Debug)]
struct PathAhead<P: Planning> {
    bounds: Bounds,
    queue: Queue,
    planning: P,
    window: Window<P::Motion>,
    next: Window<P::Motion>,
    /// Path coordinate and position at rest. Path coordinates of the queue and of windows begin where the last motion from rest
    /// does, `from_mm` behind the start of the program: so long a path rounds none of them.
    at_mm: f64,
    from_mm: f64,
    position: AxisVector,
    /// The last segments, of three fine periods; and where the last one ends.
    recent: VecDeque<Segment>,
    at: AxisVector,
}

impl<P: Planning> Streamer<P> {
    /// At rest.
    pub fn new(context: &PlannerContext, chord_error_mm: f64) -> Self {
        let ahead = PathAhead {
            bounds: Bounds {
                context: *context,
                chord_error_mm,
            },
            queue: Queue::default(),
            planning: P::default(),
            window: Window::default(),
            next: Window::default(),
            at_mm: 0.0,
            from_mm: 0.0,
            position: context.position,
            recent: VecDeque::new(),
            at: context.position,
        };
        Self {
            stream: Stream::new(&context.position),
            ahead,
        }
    }

    /// Number of blocks that have not ended.
    pub fn blocks(&self) -> usize {
        let ends = |item: &&Item| {
            matches!(item, Item::Dwell(_)) || matches!(item, Item::Leg(leg) if leg.ends)
        };
        self.ahead.queue.items.iter().filter(ends).count()
    }

    /// Takes a block. Allocates.
    pub fn accept(&mut self, block: &Block, course: Option<Course>) {
        self.ahead.queue.push(block, course, &self.ahead.bounds);
        self.stream.accepted();
    }

    /// No block follows for now.
    pub fn finish(&mut self) {
        self.stream.finish();
    }

    /// Whether all is emitted.
    pub fn is_done(&self) -> bool {
        self.stream.is_done(self.ahead.queue.items.is_empty())
    }

    /// Forgets everything.
    pub fn reset(&mut self, position: &AxisVector) {
        self.stream = Stream::new(position);
        let ahead = &mut self.ahead;
        ahead.queue = Queue::default();
        ahead.at_mm = 0.0;
        ahead.from_mm = 0.0;
        ahead.position = *position;
        ahead.bounds.context.position = *position;
    }

    /// Emits the next piece, at most `left_s` long; none where there is nothing.
    pub fn emit(
        &mut self,
        left_s: f64,
        sink: &mut dyn SegmentSink,
    ) -> Result<Option<f64>, PluginError> {
        self.stream.emit(&mut self.ahead, left_s, sink)
    }
}

impl<P: Planning> Windows for PathAhead<P> {
    fn next(&mut self, _blocks: &mut Blocks, _sink: &mut dyn SegmentSink) -> Next {
        let behind_mm = self.queue.begin_at_zero();
        self.at_mm -= behind_mm;
        self.from_mm += behind_mm;
        match self.queue.items.front() {
            None => Next::Nothing,
            Some(Item::Dwell(block)) => {
                let block = *block;
                self.position = block.end;
                self.queue.items.pop_front();
                Next::Dwell(block, self.at_mm + self.from_mm)
            }
            Some(Item::Leg(_)) => Next::Path,
        }
    }

    fn plan_from_rest(&mut self, finished: bool) -> Result<f64, PluginError> {
        let Some(route) = self.queue.route() else {
            return Err(self.no_way());
        };
        let state = State {
            s_mm: self.at_mm,
            ..State::default()
        };
        let first_tick_s = self.bounds.context.fine_period_s;
        let start = Start {
            state,
            history: [self.position; 3],
            first_tick_s,
        };
        let (run_end_mm, closed) = self.queue.run_end(finished);
        self.at = self.position;
        self.recent.clear();
        let mut rest = Segment::rest(&self.position, 3.0 * first_tick_s);
        rest.path[0] = self.at_mm;
        self.recent.push_back(rest);
        let driven = Driven {
            segments: &self.recent,
            at: self.at,
        };
        let mut end_mm = run_end_mm;
        for _ in 0..SHORTER {
            let job = Job {
                route: &route,
                bounds: &self.bounds,
                start,
                driven,
                end_mm,
                before: None,
            };
            if self.planning.plan(&job, &mut self.window) {
                return Ok(self.commit_s(closed && end_mm == run_end_mm));
            }
            // What no try keeps on the whole way may lie anywhere on it: a shorter way to a rest has less of it.
            let tried_mm = self.window.motion.end_mm();
            let is_shorter = tried_mm > self.at_mm && tried_mm < end_mm;
            end_mm = f64::midpoint(self.at_mm, if is_shorter { tried_mm } else { end_mm });
        }
        Err(self.no_way())
    }

    /// The next window, from the state in motion; where none keeps the limits, this one to its end.
    fn plan_on(&mut self, now_s: f64, finished: bool) -> Planned {
        let Some(route) = self.queue.route() else {
            return Planned::SameWindow {
                commit_s: self.window.duration_s(),
            };
        };
        let window = &self.window;
        let period_s = self.bounds.context.fine_period_s;
        let ticks = ((now_s - window.first_tick_s) / period_s).floor();
        let count = (ticks + 1.0).max(0.0) as usize;
        let history = [0, 1, 2].map(|n| window.samples[count + n]);
        let first_tick_s = window.first_tick_s + count as f64 * period_s - now_s;
        let start = Start {
            state: window.at(now_s),
            history,
            first_tick_s,
        };
        let (end_mm, closed) = self.queue.run_end(finished);
        let before = Some((&self.window, now_s));
        let driven = Driven {
            segments: &self.recent,
            at: self.at,
        };
        let job = Job {
            route: &route,
            bounds: &self.bounds,
            start,
            driven,
            end_mm,
            before,
        };
        if self.planning.plan(&job, &mut self.next) {
            std::mem::swap(&mut self.window, &mut self.next);
            Planned::NextWindow {
                commit_s: self.commit_s(closed),
            }
        } else {
            Planned::SameWindow {
                commit_s: self.window.motion.later_s(&self.window.times, now_s),
            }
        }
    }

    fn duration_s(&self) -> f64 {
        self.window.duration_s()
    }

    fn emit(
        &mut self,
        from_s: f64,
        _commit_s: f64,
        _left_s: f64,
        blocks: &mut Blocks,
        sink: &mut dyn SegmentSink,
    ) -> Emitted {
        let Some(route) = self.queue.route() else {
            return Emitted {
                until_s: self.window.duration_s(),
                duration_s: 0.0,
            };
        };
        let leg = route.front();
        if !blocks.is_reported(&leg.block) {
            blocks.begin(&leg.block, &self.block_report(leg, from_s), sink);
        }
        let mut segment = blocks.blank;
        let pen = Pen {
            from_s,
            at: &self.at,
        };
        let Drawn { until_s, leg_over } =
            draw(&route, &self.bounds, &self.window, &pen, &mut segment);
        if segment.duration_s > 0.0 {
            self.remember(&segment);
        }
        self.declare((from_s, until_s), &mut segment);
        if leg_over {
            self.leg_over(&mut segment);
        }
        if segment.duration_s > 0.0 {
            sink.segment(&self.by_program(&segment));
            blocks.has_begun();
        }
        Emitted {
            until_s,
            duration_s: segment.duration_s,
        }
    }

    /// Rest where the window ends: exactly at the end of the block, where that is there.
    fn rest(&mut self, blocks: &mut Blocks, sink: &mut dyn SegmentSink) {
        let end_mm = self.window.motion.end_mm();
        // The last segment may have gone over more legs than one, where those before the last take next to no time.
        while let Some(leg) = self
            .queue
            .front()
            .filter(|leg| leg.end_mm <= end_mm + leg.same_mm())
        {
            if !blocks.is_reported(&leg.block) {
                blocks.report(&self.block_report(leg, self.window.duration_s()), sink);
            }
            self.leg_over(&mut Segment::rest(&self.at, 0.0));
        }
        // The end of a window is that of its leg but for rounding: then the position is that of the leg already.
        if let Some(route) = self.queue.route()
            && end_mm > (self.at_mm + route.front().same_mm()).max(route.front().start_mm)
        {
            self.position = route.at(end_mm, &mut Cursor::default()).0.position;
            self.at_mm = end_mm;
        }
        blocks.rest(
            blocks.present(),
            &self.position,
            self.at_mm + self.from_mm,
            sink,
        );
    }
}

impl<P: Planning> PathAhead<P> {
    fn no_way(&self) -> PluginError {
        let line = self.queue.front().map_or(0, |leg| leg.block.line);
        PluginError::new(format!(
            "line {line}: no motion from rest at path coordinate {:.6} mm keeps velocity, acceleration, jerk and chord \
             error; the path turns too sharply there",
            self.from_mm + self.at_mm
        ))
    }

    /// Until when the window is driven: it ends at rest, and what it slows down for that is left to the next one.
    fn commit_s(&self, closed: bool) -> f64 {
        let window = &self.window;
        let whole_s = window.duration_s();
        if window.whole && (closed || whole_s < SHORT_S) {
            return whole_s;
        }
        let stop_s = self
            .queue
            .route()
            .map_or(0.0, |route| stop_s(&route, window.max_mm_per_s));
        let latest_s = whole_s - STOPS * stop_s;
        window
            .motion
            .commit_s(&window.times, latest_s.max(0.5 * whole_s))
    }

    /// A segment by the path coordinate of the program.
    fn by_program(&self, segment: &Segment) -> Segment {
        let mut sent = *segment;
        sent.path[0] += self.from_mm;
        sent
    }

    /// Keeps the last three fine periods.
    fn remember(&mut self, segment: &Segment) {
        self.at = segment.position(segment.duration_s);
        self.recent.push_back(*segment);
        let mut behind_s: f64 = self
            .recent
            .iter()
            .skip(1)
            .map(|recent| recent.duration_s)
            .sum();
        while behind_s >= 3.0 * self.bounds.context.fine_period_s {
            self.recent.pop_front();
            behind_s -= self
                .recent
                .front()
                .map_or(f64::INFINITY, |first| first.duration_s);
        }
    }

    fn leg_over(&mut self, segment: &mut Segment) {
        if let Some(Item::Leg(leg)) = self.queue.items.pop_front() {
            self.position = if leg.ends {
                *leg.course.end()
            } else {
                segment.position(segment.duration_s)
            };
            self.at_mm = leg.end_mm;
            if leg.ends {
                segment.flags = segment.flags.with(SegmentFlags::BLOCK_ENDS);
            }
        }
    }

    /// What the window leaves for a stop there.
    fn declare(&self, (from_s, until_s): (f64, f64), segment: &mut Segment) {
        let reserve = self
            .window
            .reserve((from_s, until_s), self.bounds.context.fine_period_s);
        let a = reserve.stop_mm_per_s2;
        let j = STOP_JERK * reserve.stop_mm_per_s3;
        let speeds = [from_s, until_s].map(|t_s| self.window.at(t_s).speed_mm_per_s);
        let v = speeds[0].max(speeds[1]).max(1e-9);
        segment.stop_deceleration_mm_per_s2 = a;
        segment.max_sigma_rate_per_s = a / v;
        segment.max_sigma_acceleration_per_s2 = j / v;
    }

    /// How the block is driven that begins at `from_s`. Where it ends beyond the window, the rest of its time is estimated
    /// from the highest speed of the window.
    fn block_report(&self, leg: &Leg, from_s: f64) -> BlockReport {
        let window = &self.window;
        let end_mm = leg.start_mm + leg.block_length_mm();
        let whole_s = window.duration_s();
        let state = window.at(from_s);
        let last = window.at(whole_s);
        let until_s = if last.s_mm > end_mm + 1e-9 {
            window.time_at(end_mm, (from_s, whole_s))
        } else {
            whole_s
        };
        let speeds = window
            .times
            .iter()
            .filter(|t| **t >= from_s && **t <= until_s)
            .map(|t| window.at(*t));
        let peak = speeds.fold(state.speed_mm_per_s, |most, at| most.max(at.speed_mm_per_s));
        let end = window.at(until_s);
        let beyond_mm = (end_mm - end.s_mm).max(0.0);
        // The way to the rest at the end of the window is not how it will be driven.
        let time_s = until_s - from_s + beyond_mm / window.max_mm_per_s.max(peak);
        let limited_by = match window.bound((from_s, until_s), self.bounds.context.fine_period_s) {
            Some(LimitedBy::Feed) => limited_by_feed(&leg.block),
            bound => bound.unwrap_or(LimitedBy::Jerk),
        };
        report(
            leg.block.index,
            limited_by,
            [state.speed_mm_per_s, peak, end.speed_mm_per_s],
            time_s,
        )
    }
}

impl Leg {
    fn block_length_mm(&self) -> f64 {
        self.course
            .stretches()
            .iter()
            .map(|stretch| stretch.length_mm)
            .sum()
    }
}
