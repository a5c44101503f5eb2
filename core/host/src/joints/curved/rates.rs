//! The fastest rates of program time at which joints and axes keep their limits along a plan.
//!
//! A planner that knows the axes alone has a plan x(τ). Driven at the rate σ(τ) ≤ 1 it stays on its path, and no speed is higher.
//! With w = σ² and u = dσ/dt = ½·dw/dτ each entry, an axis or a joint, accelerates by `bend·w + pace·u`, which is linear in
//! both, and a speed is a bound on w alone. So within an interval of constant u the limits are half planes in (w, u), and what
//! can be brought on from a place to the end within them is all w up to a highest one: (0, 0) is always among them. One pass
//! backward finds these, one pass forward takes as much of each as can be reached. Of all rates within the limits that is the
//! highest everywhere, so no other is sooner at the end. (Bobrow, Dubowsky and Gibson, 1985; Pham and Pham, 2018.)
//!
//! Because the plan itself is the fastest for the axes, to go no faster than it costs nothing: what keeps the limits of axes
//! and joints keeps those of the axes.

use super::point::Point;

/// Bounds on u from one side: two for each of two ends of an interval and each entry, and one for where w has to go.
const MAX_LINES: usize = 4 * tandem_sdk::MAX_AXES + 1;
/// A segment has the lead over the continuous velocity as a straight line in time. Where u is not 0 the lead is none, and its rate is
/// off by up to this many times `takeback·u` the program time of the segment.
const LEAD_SHARE: f64 = 1.5;
/// Speeds below this share of what the acceleration could be do not bound u.
const NO_PACE: f64 = 1e-9;
/// Most steps towards the highest w of an interval; each passes at least one line.
const STEPS: u32 = 40;

/// A stretch of the plan over which u is constant.
#[derive(Clone, Copy, Debug)]
pub struct Interval {
    pub start: Point,
    pub end: Point,
    /// Program time, s.
    pub duration_s: f64,
    /// Nothing moves: any rate is as good, and it passes at rate 1.
    pub rests: bool,
    /// Its segment tells the governor of no lead.
    pub without_lead: bool,
    /// The machine rests behind it, where the rate may become another one at once.
    pub ends_at_rest: bool,
}

/// u = offset + slope·w.
type Line = (f64, f64);

/// Lines of one side: how many, and which.
struct Lines {
    all: [Line; MAX_LINES],
    count: usize,
}

impl Lines {
    fn new() -> Self {
        Self {
            all: [(0.0, 0.0); MAX_LINES],
            count: 0,
        }
    }

    fn push(&mut self, line: Line) {
        self.all[self.count] = line;
        self.count += 1;
    }

    /// The extreme value at `w` in the direction `sign` (1 the least, −1 the greatest), and its slope.
    fn extreme(&self, w: f64, sign: f64) -> Line {
        let mut found = (sign * f64::INFINITY, 0.0);
        for (offset, slope) in &self.all[..self.count] {
            let value = offset + slope * w;
            if sign * value < sign * found.0 {
                found = (value, *slope);
            }
        }
        found
    }
}

/// The bounds on u as functions of w, and the highest w.
struct Bounds {
    above: Lines,
    below: Lines,
    highest: f64,
}

impl Bounds {
    /// Keeps `|bend·w + pace·u|` within `most`.
    fn keep(&mut self, bend: f64, pace: f64, most: f64) {
        if pace.abs() > NO_PACE * most {
            let (reach, slope) = (most / pace.abs(), -bend / pace);
            self.above.push((reach, slope));
            self.below.push((-reach, slope));
        } else if bend != 0.0 {
            self.highest = self.highest.min(most / bend.abs());
        }
    }
}

impl Interval {
    /// The bounds where w is at most `then` at the end.
    fn bounds(&self, then: f64) -> Bounds {
        let way = 2.0 * self.duration_s;
        let mut bounds = Bounds {
            above: Lines::new(),
            below: Lines::new(),
            highest: self.start.highest.min(1.0),
        };
        for entry in 0..tandem_sdk::MAX_AXES {
            let (start, end) = (&self.start, &self.end);
            let at_start = (start.bend[entry], start.pace[entry], start.most[entry]);
            let end_pace = end.pace[entry] + way * end.bend[entry];
            let at_end = (end.bend[entry], end_pace, end.most[entry]);
            let slack =
                LEAD_SHARE * self.duration_s * start.takeback[entry].max(end.takeback[entry]);
            for (bend, pace, most) in [at_start, at_end] {
                if most == f64::INFINITY {
                    continue;
                }
                bounds.keep(bend, pace + slack, most);
                if slack > 0.0 {
                    bounds.keep(bend, pace - slack, most);
                }
            }
        }
        bounds.above.push((then / way, -1.0 / way));
        bounds.below.push((0.0, -1.0 / way));
        bounds
    }

    /// The highest w at the end, where what follows asks for at most `then`.
    fn at_end(&self, then: f64) -> f64 {
        let then = if self.ends_at_rest { 1.0 } else { then };
        then.min(self.end.highest)
    }

    /// The highest w at the start from which the end is reached with at most `then`.
    pub fn highest(&self, then: f64) -> f64 {
        let then = self.at_end(then);
        let bounds = self.bounds(then);
        let mut w = bounds.highest;
        for _ in 0..STEPS {
            let (upper, upper_slope) = bounds.above.extreme(w, 1.0);
            let (lower, lower_slope) = bounds.below.extreme(w, -1.0);
            let gap = lower - upper;
            if gap <= 0.0 || w <= 0.0 {
                break;
            }
            // The gap is convex in w and not above 0 at 0: from the right its tangents never pass the root.
            let slope = lower_slope - upper_slope;
            if slope <= 0.0 {
                return 0.0;
            }
            let next = w - gap / slope;
            if next >= w {
                break;
            }
            w = next;
        }
        w.max(0.0)
    }

    /// The highest w at the end, up to `then`, from `w` at the start.
    pub fn reached(&self, w: f64, then: f64) -> f64 {
        let then = self.at_end(then);
        let bounds = self.bounds(then);
        let (upper, _) = bounds.above.extreme(w, 1.0);
        (w + 2.0 * self.duration_s * upper).clamp(0.0, then)
    }
}

/// Highest squares of the rate at the start of each of `intervals`, where it is `last` behind them.
pub fn highest<'a>(
    intervals: impl DoubleEndedIterator<Item = &'a Interval>,
    last: f64,
    squares: &mut Vec<f64>,
) {
    squares.clear();
    let mut then = last;
    for interval in intervals.rev() {
        then = if interval.rests {
            1.0
        } else {
            interval.highest(then)
        };
        squares.push(then);
    }
    squares.reverse();
}

/// How many of the first squares do not depend on what follows: those before the last place at which coming to rest at the end,
/// and not slowing down there at all, ask for the same.
pub fn settled(rests: &[f64], goes_on: &[f64]) -> usize {
    const SAME: f64 = 1e-9;
    let same = |(rests, goes_on): (&f64, &f64)| (rests - goes_on).abs() <= SAME * goes_on;
    rests.iter().zip(goes_on).rposition(same).unwrap_or(0)
}
