//! A planner on a machine whose joints are no linear function of its axes: an arm, a delta.
//!
//! What a joint may do bounds the path differently at every place, and a planner knows the axes. So it plans for the axes, and its
//! plan is driven more slowly where joints ask for that, by no more than they ask for ([`rates`] says why nothing is lost). The
//! segments carry the joints behind the axes, so that the governor keeps their limits under a hold or an override as it keeps
//! those of the axes; the guard goes on asking the kinematics themselves.
//!
//! How fast a place may be driven depends on what follows it. The plan is therefore taken from the planner a while ahead, and what
//! goes out is what does not depend any more on what is still to come.

mod draw;
mod point;
mod rates;

use std::collections::VecDeque;
use std::sync::Arc;

use tandem_machine::Machine;
use tandem_sdk::{
    Accepted, Advanced, Axes, AxisVector, Block, BlockReport, Curve, Planner, PlannerDescription,
    PluginError, Segment, SegmentFlags, SegmentSink,
};

use super::space::JointSpace;
use super::travel::Travel;
use draw::Stretch;
use point::{Point, Steps};
use rates::Interval;

/// Longest program time over which the rate changes evenly, s. Twice as long, an arm takes 1.4 % more time on a chain of chords, where
/// the rate rises and falls within each, and a run takes a third fewer instructions; half as long, it gains 0.5 % more.
const INTERVAL_S: f64 = 0.001;
/// Program time that is looked at ahead, s, and the most where that does not settle anything.
const AHEAD_S: f64 = 1.5;
const MAX_AHEAD_S: f64 = 12.0;
/// A block that lasts as long is long, however much longer it lasts.
const LONG_BLOCK_S: f64 = 0.1;
/// Rates that differ from 1 by less are 1.
const WHOLE: f64 = 1.0 - 1e-12;
/// The lowest rate: where a step cannot be driven at any, the guard says so.
const LEAST: f64 = 1e-3;

/// What the planner has given and what has not gone out yet.
enum Held {
    Report(BlockReport),
    /// A segment, in so many intervals.
    Segment(Box<Segment>, usize),
}

/// The plan ahead.
#[derive(Default)]
struct Ahead {
    /// Segments of a block of which it is not known yet how long it lasts, and how long it has lasted so far, s.
    waiting: Vec<Segment>,
    block_s: f64,
    held: VecDeque<Held>,
    intervals: VecDeque<Interval>,
    /// Program time in `intervals`, s.
    duration_s: f64,
}

/// Plans for the joints behind a planner that plans for the axes.
pub struct CurvedJoints {
    planner: Box<dyn Planner>,
    space: Arc<JointSpace>,
    travel: Travel,
    axes: Axes,
    /// The planner bounds velocity and acceleration: then its plan can be driven at rates that step in their change.
    retimes: bool,
    ahead: Ahead,
    /// The planner has given all that it was given.
    done: bool,
    /// Square of the rate where `ahead` begins; none where the machine rests there.
    square: Option<f64>,
    /// Highest squares at the starts of the first intervals ahead, and behind the last of those: what is settled.
    settled: VecDeque<f64>,
    rests: Vec<f64>,
    goes_on: Vec<f64>,
    /// Program time that is looked at ahead, s.
    look_s: f64,
    /// Most program time asked of the planner at once, s.
    part_s: f64,
}

impl CurvedJoints {
    /// `planner`, whose plans then keep the limits of `space`. Host; allocates.
    pub fn around(planner: Box<dyn Planner>, space: &Arc<JointSpace>, machine: &Machine) -> Self {
        let described = planner.describe();
        Self {
            planner,
            space: Arc::clone(space),
            travel: Travel::new(Arc::clone(space), machine.axes),
            axes: machine.axes,
            retimes: described.order == 2 && described.breaks_limits == 0,
            ahead: Ahead::default(),
            done: false,
            square: None,
            settled: VecDeque::new(),
            rests: Vec::new(),
            goes_on: Vec::new(),
            look_s: AHEAD_S,
            part_s: machine.fine_period_s * f64::from(machine.fine_periods_per_rough),
        }
    }

    /// Takes more of the plan; gives how much program time came, s.
    fn take(&mut self) -> Result<f64, PluginError> {
        let mut taking = Taking {
            ahead: &mut self.ahead,
            space: &self.space,
            axes: &self.axes,
        };
        let advanced = self.planner.advance(self.part_s, &mut taking)?;
        self.done = advanced.done != 0;
        if self.done || advanced.duration_s <= 0.0 {
            // Nothing more comes for now, so the block is taken to be as long as it is.
            taking.release();
        }
        Ok(advanced.duration_s)
    }

    /// Settles rates ahead, as far as they depend on nothing that is still to come, for whole segments. Gives whether there are any.
    fn settle(&mut self) -> Result<bool, PluginError> {
        let mut more = true;
        while self.settled.is_empty() {
            while more && !self.done && self.ahead.duration_s < self.look_s {
                more = self.take()? > 0.0;
            }
            let enough = self.ahead.duration_s >= self.look_s;
            rates::highest(self.ahead.intervals.iter(), 1.0, &mut self.goes_on);
            let settled = if self.done {
                self.rests.clone_from(&self.goes_on);
                self.rests.push(1.0);
                self.ahead.intervals.len()
            } else {
                rates::highest(self.ahead.intervals.iter(), 0.0, &mut self.rests);
                self.whole_segments(rates::settled(&self.rests, &self.goes_on))
            };
            if settled > 0 {
                self.settled.extend(&self.rests[..=settled]);
            } else if self.done || !enough {
                return Ok(false);
            } else if more && self.look_s < MAX_AHEAD_S {
                self.look_s *= 2.0;
            } else {
                // A stop takes longer than what is looked at. The plan has one ready, and goes on with it for a while.
                self.look_s = (2.0 * self.look_s).min(MAX_AHEAD_S);
                let first = self.whole_segments(self.rests.len() / 2);
                self.settled.extend(&self.rests[..=first]);
                return Ok(first > 0);
            }
        }
        Ok(true)
    }

    /// How many of the first `intervals` make whole segments.
    fn whole_segments(&self, intervals: usize) -> usize {
        let mut whole = 0;
        for held in &self.ahead.held {
            if let Held::Segment(_, count) = held {
                if whole + count > intervals {
                    break;
                }
                whole += count;
            }
        }
        whole
    }

    /// Sends reports and segments that take no time, up to the next that does.
    fn pass(&mut self, sink: &mut dyn SegmentSink) {
        loop {
            match self.ahead.held.front() {
                Some(Held::Report(report)) => sink.block(report),
                Some(Held::Segment(segment, 0)) => {
                    draw::as_planned(segment, &[], &self.space, &self.axes, sink);
                    self.square = None;
                }
                _ => return,
            }
            self.ahead.held.pop_front();
        }
    }

    /// Sends the next segment that takes time, all of it; gives how long it takes, s.
    fn drive(&mut self, sink: &mut dyn SegmentSink) -> f64 {
        let Some(Held::Segment(segment, count)) = self.ahead.held.pop_front() else {
            return 0.0;
        };
        let intervals: Vec<Interval> = self.ahead.intervals.drain(..count).collect();
        let highest: Vec<f64> = self.settled.drain(..count).collect();
        self.ahead.duration_s -= segment.duration_s;
        if intervals[0].rests {
            draw::as_planned(&segment, &[], &self.space, &self.axes, sink);
            self.square = None;
            return segment.duration_s;
        }
        let mut squares = vec![self.square.unwrap_or(highest[0]).min(highest[0])];
        for (i, interval) in intervals.iter().enumerate() {
            let then = highest.get(i + 1).or(self.settled.front()).copied();
            squares.push(interval.reached(squares[i], then.unwrap_or(0.0)));
        }
        self.square = squares.last().copied();
        let rates: Vec<f64> = squares.iter().map(|w| w.sqrt().max(LEAST)).collect();
        if rates.iter().all(|rate| *rate >= WHOLE) {
            draw::as_planned(&segment, &intervals, &self.space, &self.axes, sink);
            return segment.duration_s;
        }
        let mut begins_s = 0.0;
        let mut took_s = 0.0;
        for (i, interval) in intervals.iter().enumerate() {
            let stretch = Stretch {
                from: &segment,
                begins_s,
                interval,
                rates: [rates[i], rates[i + 1]],
                first: i == 0,
                last: i + 1 == count,
            };
            took_s += draw::stretch(&stretch, &self.space, &self.axes, sink);
            begins_s += interval.duration_s;
        }
        took_s
    }
}

impl Planner for CurvedJoints {
    fn describe(&self) -> PlannerDescription {
        self.planner.describe()
    }

    fn check(&self, block: &Block, curve: Option<Curve<'_>>) -> Result<(), PluginError> {
        self.planner.check(block, curve)?;
        self.travel.check(block, curve)
    }

    fn accept(&mut self, block: &Block, curve: Option<Curve<'_>>) -> Result<Accepted, PluginError> {
        self.done = false;
        loop {
            let accepted = self.planner.accept(block, curve)?;
            // There is room for what the planner has to give away first, as long as that is not looked at yet.
            let sees_enough = !self.retimes || self.ahead.duration_s >= self.look_s;
            if accepted == Accepted::Accepted || sees_enough || self.take()? <= 0.0 {
                return Ok(accepted);
            }
        }
    }

    fn finish(&mut self) {
        self.planner.finish();
    }

    fn advance(
        &mut self,
        duration_s: f64,
        sink: &mut dyn SegmentSink,
    ) -> Result<Advanced, PluginError> {
        if !self.retimes {
            return self.planner.advance(duration_s, sink);
        }
        let mut emitted_s = 0.0;
        self.pass(sink);
        while emitted_s < duration_s && self.settle()? {
            self.pass(sink);
            emitted_s += self.drive(sink);
            if self.settled.len() < 2 {
                self.settled.clear();
            }
            self.pass(sink);
        }
        // Behind the last motion there may be what takes no time.
        self.pass(sink);
        Ok(Advanced {
            duration_s: emitted_s,
            done: u32::from(self.done && self.ahead.held.is_empty()),
        })
    }

    fn reset(&mut self, position: &AxisVector) {
        self.planner.reset(position);
        self.ahead = Ahead::default();
        self.settled.clear();
        self.square = None;
        self.done = false;
    }
}

/// Takes what the planner emits.
struct Taking<'a> {
    ahead: &'a mut Ahead,
    space: &'a JointSpace,
    axes: &'a Axes,
}

impl Taking<'_> {
    /// What has waited is as long as is known now.
    fn release(&mut self) {
        let entries = self.axes.count() + self.space.count();
        let steps = Steps::of(self.ahead.block_s, self.space, entries);
        for segment in std::mem::take(&mut self.ahead.waiting) {
            self.add(&segment, steps);
        }
    }

    fn add(&mut self, segment: &Segment, steps: Steps) {
        let moves = |c: &[f64; 6]| c[1..].iter().any(|c| *c != 0.0);
        let rests = segment.flags.contains(SegmentFlags::DWELL)
            || !segment.coefficients[..self.axes.count()].iter().any(moves);
        let parts = if segment.duration_s == 0.0 {
            0.0
        } else if rests {
            1.0
        } else {
            (segment.duration_s / INTERVAL_S).ceil()
        };
        let h = segment.duration_s / parts;
        let begins = segment.flags.contains(SegmentFlags::BLOCK_BEGINS);
        let ends = segment.flags.contains(SegmentFlags::BLOCK_ENDS);
        let point = |part: f64| {
            let junction = (part == 0.0 && begins) || (part == parts && ends);
            Point::of(segment, (h * part, junction), steps, self.space, self.axes)
        };
        let mut start = (parts > 0.0).then(|| point(0.0));
        for part in 1..=parts as usize {
            let (Some(from), end) = (start, point(part as f64)) else {
                break;
            };
            self.ahead.intervals.push_back(Interval {
                start: from,
                end,
                duration_s: h,
                rests,
                without_lead: steps != Steps::Lead,
                ends_at_rest: false,
            });
            start = Some(end);
        }
        let at_rest = segment.flags.contains(SegmentFlags::ENDS_AT_REST);
        if let Some(before) = self.ahead.intervals.back_mut().filter(|_| at_rest) {
            before.ends_at_rest = true;
        }
        self.ahead.duration_s += segment.duration_s;
        let held = Held::Segment(Box::new(*segment), parts as usize);
        self.ahead.held.push_back(held);
    }
}

impl SegmentSink for Taking<'_> {
    fn segment(&mut self, segment: &Segment) {
        let ahead = &mut *self.ahead;
        ahead.block_s += segment.duration_s;
        ahead.waiting.push(*segment);
        let ends =
            SegmentFlags::BLOCK_ENDS.0 | SegmentFlags::ENDS_AT_REST.0 | SegmentFlags::DWELL.0;
        let over = segment.flags.0 & ends != 0;
        if over || ahead.block_s >= LONG_BLOCK_S {
            self.release();
        }
        if over {
            self.ahead.block_s = 0.0;
        }
    }

    fn block(&mut self, report: &BlockReport) {
        self.release();
        self.ahead.block_s = 0.0;
        self.ahead.held.push_back(Held::Report(*report));
    }
}
