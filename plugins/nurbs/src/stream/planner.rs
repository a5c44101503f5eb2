//! Blocks in, segments out.

use std::collections::VecDeque;

use tandem_motion::blocks::{BlockId, BlockWriter, limited_by_feed, report};
use tandem_sdk::{
    AxisVector, Block, BlockReport, LimitedBy, PlannerContext, PluginError, Segment, SegmentFlags, SegmentSink,
};

use super::draw::{Drawn, Pen, draw};
use super::queue::{Item, Queue};
use super::{Bounds, Cursor, Driven, Job, Leg, Motion, Planning, Route, Start, State, Window, stop_s};
use crate::course::Course;

/// Share of the jerk limits on which a stop counts: the plan takes the rest.
const STOP_JERK: f64 = 0.5;
/// Stops before the end of a window that are left to the next one.
const STOPS: f64 = 1.5;
/// A window shorter than this that ends where the known path ends is driven to its end, s.
const SHORT_S: f64 = 0.15;

/// A form with windows. Rough loop: blocks allocate when they are accepted, windows where one is longer than any before.
#[derive(Debug)]
pub struct Streamer<P: Planning> {
    bounds: Bounds,
    queue: Queue,
    planning: P,
    window: Window<P::Motion>,
    next: Window<P::Motion>,
    /// Driven and committed time of the window; none at rest.
    driving: Option<(f64, f64)>,
    writer: BlockWriter,
    /// What segments of the present block say.
    blank: Segment,
    /// Path coordinate and position at rest. Path coordinates of the queue and of windows begin where the last motion from rest
    /// does, `from_mm` behind the start of the program: so long a path rounds none of them.
    at_mm: f64,
    from_mm: f64,
    position: AxisVector,
    /// The last segments, of three fine periods; and where the last one ends.
    recent: VecDeque<Segment>,
    at: AxisVector,
    finished: bool,
}

impl<P: Planning> Streamer<P> {
    /// At rest.
    pub fn new(context: &PlannerContext, chord_error_mm: f64) -> Self {
        Self {
            bounds: Bounds { context: *context, chord_error_mm },
            queue: Queue::default(),
            planning: P::default(),
            window: Window::default(),
            next: Window::default(),
            driving: None,
            writer: BlockWriter::new(3),
            blank: Segment::rest(&context.position, 0.0),
            at_mm: 0.0,
            from_mm: 0.0,
            position: context.position,
            recent: VecDeque::new(),
            at: context.position,
            finished: false,
        }
    }

    /// Number of blocks that have not ended.
    pub fn blocks(&self) -> usize {
        let ends = |item: &&Item| matches!(item, Item::Dwell(_)) || matches!(item, Item::Leg(leg) if leg.ends);
        self.queue.items.iter().filter(ends).count()
    }

    /// Takes a block. Allocates.
    pub fn accept(&mut self, block: &Block, course: Option<Course>) {
        self.queue.push(block, course, &self.bounds);
        self.finished = false;
    }

    /// No block follows for now.
    pub fn finish(&mut self) {
        self.finished = true;
    }

    /// Whether all is emitted.
    pub fn is_done(&self) -> bool {
        self.finished && self.queue.items.is_empty() && self.driving.is_none() && !self.writer.is_dwelling()
    }

    /// Forgets everything.
    pub fn reset(&mut self, position: &AxisVector) {
        let Bounds { context, chord_error_mm } = self.bounds;
        self.queue = Queue::default();
        self.driving = None;
        self.writer.reset();
        self.finished = false;
        self.at_mm = 0.0;
        self.from_mm = 0.0;
        self.position = *position;
        self.bounds = Bounds { context: PlannerContext { position: *position, ..context }, chord_error_mm };
        self.blank = Segment::rest(position, 0.0);
    }

    /// Emits the next piece, at most `left_s` long; none where there is nothing.
    pub fn emit(&mut self, left_s: f64, sink: &mut dyn SegmentSink) -> Result<Option<f64>, PluginError> {
        if let Some(emitted_s) = self.writer.emit_dwell(left_s, sink) {
            return Ok(Some(emitted_s));
        }
        let Some((driven_s, committed_s)) = self.driving else { return self.begin(sink) };
        if driven_s < committed_s {
            return Ok(Some(self.emit_motion((driven_s, committed_s), sink)));
        }
        if driven_s >= self.window.duration_s() {
            self.rest(sink);
        } else {
            self.go_on(driven_s);
        }
        Ok(Some(0.0))
    }

    fn begin(&mut self, sink: &mut dyn SegmentSink) -> Result<Option<f64>, PluginError> {
        let behind_mm = self.queue.begin_at_zero();
        self.at_mm -= behind_mm;
        self.from_mm += behind_mm;
        match self.queue.items.front() {
            None => return Ok(None),
            Some(Item::Dwell(block)) => {
                self.position = block.end;
                let path_mm = self.at_mm + self.from_mm;
                self.writer.begin_dwell(BlockId::from(block), &block.end, block.dwell_s, path_mm, sink);
                self.queue.items.pop_front();
            }
            Some(Item::Leg(leg)) => {
                let route = Route::new(leg, &self.queue.items);
                let state = State { s_mm: self.at_mm, ..State::default() };
                let first_tick_s = self.bounds.context.fine_period_s;
                let start = Start { state, history: [self.position; 3], first_tick_s };
                let (end_mm, closed) = self.queue.run_end(self.finished);
                self.at = self.position;
                self.recent.clear();
                let mut rest = Segment::rest(&self.position, 3.0 * first_tick_s);
                rest.path[0] = self.at_mm;
                self.recent.push_back(rest);
                let driven = Driven { segments: &self.recent, at: self.at };
                let job = Job { route: &route, bounds: &self.bounds, start, driven, end_mm, before: None };
                if !self.planning.plan(&job, &mut self.window) {
                    return Err(self.no_way());
                }
                self.driving = Some((0.0, self.commit_s(closed)));
            }
        }
        Ok(Some(0.0))
    }

    fn no_way(&self) -> PluginError {
        let line = self.queue.front().map_or(0, |leg| leg.block.line);
        PluginError::new(format!(
            "line {line}: no motion from rest at path coordinate {:.6} mm keeps velocity, acceleration, jerk and chord \
             error; the path turns too sharply there",
            self.from_mm + self.at_mm
        ))
    }

    /// The next window, from the state in motion; where none keeps the limits, this one to its end.
    fn go_on(&mut self, now_s: f64) {
        let Some(route) = self.queue.route() else {
            self.driving = Some((now_s, self.window.duration_s()));
            return;
        };
        let window = &self.window;
        let period_s = self.bounds.context.fine_period_s;
        let ticks = ((now_s - window.first_tick_s) / period_s).floor();
        let count = (ticks + 1.0).max(0.0) as usize;
        let history = [0, 1, 2].map(|n| window.samples[count + n]);
        let first_tick_s = window.first_tick_s + count as f64 * period_s - now_s;
        let start = Start { state: window.at(now_s), history, first_tick_s };
        let (end_mm, closed) = self.queue.run_end(self.finished);
        let before = Some((&self.window, now_s));
        let driven = Driven { segments: &self.recent, at: self.at };
        let job = Job { route: &route, bounds: &self.bounds, start, driven, end_mm, before };
        if self.planning.plan(&job, &mut self.next) {
            std::mem::swap(&mut self.window, &mut self.next);
            self.driving = Some((0.0, self.commit_s(closed)));
        } else {
            self.driving = Some((now_s, self.window.motion.later_s(&self.window.times, now_s)));
        }
    }

    /// Until when the window is driven: it ends at rest, and what it slows down for that is left to the next one.
    fn commit_s(&self, closed: bool) -> f64 {
        let window = &self.window;
        let whole_s = window.duration_s();
        if window.whole && (closed || whole_s < SHORT_S) {
            return whole_s;
        }
        let stop_s = self.queue.route().map_or(0.0, |route| stop_s(&route, window.most_mm_per_s));
        let latest_s = whole_s - STOPS * stop_s;
        window.motion.commit_s(&window.times, latest_s.max(0.5 * whole_s))
    }

    /// The next segment of the window, which begins before `to_s`.
    fn emit_motion(&mut self, (from_s, to_s): (f64, f64), sink: &mut dyn SegmentSink) -> f64 {
        let Some(route) = self.queue.route() else {
            let end_s = self.window.duration_s();
            self.driving = Some((end_s, end_s));
            return 0.0;
        };
        let leg = route.front();
        let begins = leg.begins && self.blank.flags.contains(SegmentFlags::BLOCK_ENDS);
        if begins || from_s == 0.0 && self.is_new(leg) {
            sink.block(&self.block_report(leg, from_s));
            // A blank that was made of a leg has a duration; the one at the beginning has none.
            self.blank = Segment { duration_s: 1.0, ..self.writer.blank(&leg.block) };
        }
        let mut segment = self.blank;
        let pen = Pen { from_s, at: &self.at };
        let Drawn { until_s, leg_over } = draw(&route, &self.bounds, &self.window, &pen, &mut segment);
        if segment.duration_s > 0.0 {
            self.remember(&segment);
        }
        self.declare((from_s, until_s), &mut segment);
        if leg_over {
            self.leg_over(&mut segment);
        }
        self.driving = Some((until_s, to_s));
        if segment.duration_s > 0.0 {
            self.send(&segment, sink);
            self.blank.flags = self.blank.flags.without(SegmentFlags::BLOCK_BEGINS);
        }
        segment.duration_s
    }

    /// Hands a segment over, by the path coordinate of the program.
    fn send(&self, segment: &Segment, sink: &mut dyn SegmentSink) {
        let mut sent = *segment;
        sent.path[0] += self.from_mm;
        sink.segment(&sent);
    }

    /// Keeps the last three fine periods.
    fn remember(&mut self, segment: &Segment) {
        self.at = segment.position(segment.duration_s);
        self.recent.push_back(*segment);
        let mut behind_s: f64 = self.recent.iter().skip(1).map(|recent| recent.duration_s).sum();
        while behind_s >= 3.0 * self.bounds.context.fine_period_s {
            self.recent.pop_front();
            behind_s -= self.recent.front().map_or(f64::INFINITY, |first| first.duration_s);
        }
    }

    fn is_new(&self, leg: &Leg) -> bool {
        self.blank.block != leg.block.index || self.blank.line != leg.block.line || self.blank.duration_s == 0.0
    }

    fn leg_over(&mut self, segment: &mut Segment) {
        if let Some(Item::Leg(leg)) = self.queue.items.pop_front() {
            self.position = if leg.ends { *leg.course.end() } else { segment.position(segment.duration_s) };
            self.at_mm = leg.end_mm;
            if leg.ends {
                segment.flags = segment.flags.with(SegmentFlags::BLOCK_ENDS);
                self.blank.flags = self.blank.flags.with(SegmentFlags::BLOCK_ENDS);
            }
        }
    }

    /// What the window leaves for a stop there.
    fn declare(&self, (from_s, until_s): (f64, f64), segment: &mut Segment) {
        let reserve = self.window.reserve((from_s, until_s), self.bounds.context.fine_period_s);
        let a = reserve.stop_mm_per_s2;
        let j = STOP_JERK * reserve.stop_mm_per_s3;
        let speeds = [from_s, until_s].map(|t_s| self.window.at(t_s).speed_mm_per_s);
        let v = speeds[0].max(speeds[1]).max(1e-9);
        segment.stop_deceleration_mm_per_s2 = a;
        segment.max_sigma_rate_per_s = a / v;
        segment.max_sigma_acceleration_per_s2 = j / v;
    }

    /// Rest where the window ends: exactly at the end of the block, where that is there.
    fn rest(&mut self, sink: &mut dyn SegmentSink) {
        let end_mm = self.window.motion.end_mm();
        // The last segment may have gone over more legs than one, where those before the last take next to no time.
        while let Some(leg) = self.queue.front().filter(|leg| leg.end_mm <= end_mm + leg.same_mm()) {
            if leg.begins {
                sink.block(&self.block_report(leg, self.window.duration_s()));
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
        let id = BlockId { index: self.blank.block, line: self.blank.line };
        self.driving = None;
        self.send(&self.writer.rest(id, &self.position, self.at_mm), sink);
    }

    /// How the block is driven that begins at `from_s`. Where it ends beyond the window, the rest of its time is estimated
    /// from the highest speed of the window.
    fn block_report(&self, leg: &Leg, from_s: f64) -> BlockReport {
        let window = &self.window;
        let end_mm = leg.start_mm + leg.block_length_mm();
        let whole_s = window.duration_s();
        let state = window.at(from_s);
        let last = window.at(whole_s);
        let until_s = if last.s_mm > end_mm + 1e-9 { window.time_at(end_mm, (from_s, whole_s)) } else { whole_s };
        let speeds = window.times.iter().filter(|t| **t >= from_s && **t <= until_s).map(|t| window.at(*t));
        let peak = speeds.fold(state.speed_mm_per_s, |most, at| most.max(at.speed_mm_per_s));
        let end = window.at(until_s);
        let beyond_mm = (end_mm - end.s_mm).max(0.0);
        // The way to the rest at the end of the window is not how it will be driven.
        let time_s = until_s - from_s + beyond_mm / window.most_mm_per_s.max(peak);
        let limited_by = match window.bound((from_s, until_s), self.bounds.context.fine_period_s) {
            Some(LimitedBy::Feed) => limited_by_feed(&leg.block),
            bound => bound.unwrap_or(LimitedBy::Jerk),
        };
        report(leg.block.index, limited_by, [state.speed_mm_per_s, peak, end.speed_mm_per_s], time_s)
    }
}

impl Leg {
    fn block_length_mm(&self) -> f64 {
        self.course.stretches().iter().map(|stretch| stretch.length_mm).sum()
    }
}
