//! Planning one window: smoothing and retiming take turns.

use tandem_motion::in_wide_instructions;
use tandem_motion::retime::{Asked, End, Factors, Point, Retimer};
use tandem_motion::tube::{Lanes, Smoother, Spline, each};

use crate::feeds::Feeds;
use crate::frame::Frame;
use crate::route::Run;
use crate::shares::{FirstTry, LEFT, NO_ROOM, Room, Shares, WIDE, take_back};
use crate::timing::{FINE_S, Mark, Reach, Timing};
use crate::travel::Travel;
use crate::tuning::{COMMIT, MAX_STEPS, Tuning};
use crate::verify::Checker;
use crate::waypoints::{Grid, INTERVALS, Keep, Timer, Waypoints};
use crate::window::{Bound, Piece, Start, State, Window};

/// Gain of the last round that asks for another, and how many there may be. On 17 pairs of programs and limits, each on some
/// machines beside each other, half of the gain takes 9 % more intervals for 0.02 % less time, twice as much 8 % fewer for 0.1 % more.
/// On the machines of [`WINDOW_RAMPS`](crate::tuning::WINDOW_RAMPS) two rounds more take 0.03 % longer than three, and four the same;
/// where long lines meet chords of arcs and windows are short for the machine, two take 0.8 % longer and four 0.4 % less.
const MUCH: f64 = 0.02;
const EXTRA: usize = 3;
/// Violation of a row, as a share of its limit, beyond which there is no rate.
const INFEASIBLE: f64 = 0.004;
/// Intervals behind a start in motion over which the shares of the limits come down to what they are in the rest of the window. At
/// the start the rate is given, and only its bend is free: what the new grid takes more than the old one did cannot be slowed there.
/// With half as many the same programs take 0.06 % longer, with twice as many 0.02 %.
const BEGINNING: f64 = 12.0;
/// Largest rate squared.
const MAX_RATE_SQUARED: f64 = 16.0;
/// Least rate squared: a round makes a motion ten times slower at most.
const MIN_RATE_SQUARED: f64 = 0.01;
/// Groups of rows of an interval: jerk at three places, acceleration at its start.
const RETIMED: usize = 4;
/// Mean complementarity asked of the last round, and of those before.
const GAP: f64 = 1e-5;
const LOOSE: f64 = 3e-3;
/// What is asked of the rate of the last round, and of those before, of which only the timing counts.
const EXACT: Asked = Asked {
    gap: GAP,
    violation: INFEASIBLE,
    iterations: 25,
    min_rate_squared: MIN_RATE_SQUARED,
};
const ROUGH: Asked = Asked {
    gap: LOOSE,
    violation: 0.05,
    ..EXACT
};
/// Gain of a round, as a share of the time, that is worth another.
const GAIN: f64 = 2e-3;

/// Largest factor on the step in the rounds before the last of a window in motion: of these nothing but the timing is left, and most of
/// that is of the window before. From rest there is more to be found, and a coarse grid misses it. These rounds have a tenth fewer
/// intervals than on the fine grid (`rounds_before_the_last_take_a_coarser_grid_except_where_it_is_short`); with half or twice of what it
/// is beyond 1 the programs take 0.04 % longer, and more intervals in all: what a coarser grid misses is found in further rounds.
const COARSEST: f64 = 1.4;
/// Step that is not made longer, s: where it is so short, the motion changes more within a step than the grid can follow as it is.
const SHORT_S: f64 = 2.2e-3;

/// Part of what is left of the window before whose timing is taken over. With less, its braking for its rest is not reached, but more of
/// the timing is a first one: with half of it the programs take 0.1 % longer, for 10 % more intervals. To its end, which is less than
/// twice as much, they take 10 % longer.
const WARM: f64 = 0.7;

/// Counts of what was done.
#[derive(Clone, Copy, Debug, Default)]
pub struct Effort {
    /// Windows planned, refused ones too.
    pub windows: u64,
    /// Windows refused.
    pub rejected: u64,
    /// Rests where the program asks for none.
    pub stops: u64,
    /// Rounds that a refusal of the check made necessary.
    pub repairs: u64,
    /// Intervals of all rounds.
    pub intervals: u64,
    /// Iterations of smoothing.
    pub smooth_iterations: u64,
    /// Iterations of pacing.
    pub retime_iterations: u64,
    /// Turns of smoothing and retiming.
    pub rounds: u64,
}

/// The planning of windows; keeps its memory.
#[derive(Debug)]
pub struct Planning<const L: usize> {
    pub tuning: Tuning,
    pub effort: Effort,
    timing: Timing,
    waypoints: Waypoints<L>,
    spline: Spline<L>,
    smoother: Smoother<L>,
    retimer: Retimer<L, RETIMED>,
    marks: Vec<Mark>,
    times: Vec<f64>,
    /// The timing that was taken over from the window before.
    handed: Vec<Mark>,
    checker: Checker<L>,
    /// The last round found no rate that keeps all rows.
    infeasible: bool,
    first_try: FirstTry,
    /// Step of the grid of the present window, s, and the share of its boxes that is used at first.
    step_s: f64,
    box_share: f64,
}

impl<const L: usize> Planning<L> {
    /// Nothing planned yet.
    pub fn new(tuning: Tuning) -> Self {
        Self {
            tuning,
            effort: Effort::default(),
            timing: Timing::default(),
            waypoints: Waypoints::default(),
            spline: Spline::default(),
            smoother: Smoother::default(),
            retimer: Retimer::default(),
            marks: Vec::new(),
            times: Vec::new(),
            handed: Vec::new(),
            checker: Checker::default(),
            infeasible: false,
            first_try: FirstTry::NOMINAL,
            step_s: tuning.step_s,
            box_share: tuning.box_share,
        }
    }

    /// Path coordinate where the last window planned ends.
    pub fn end(&self) -> f64 {
        self.marks.last().map_or(0.0, |mark| mark.s)
    }

    in_wide_instructions! {
        /// Plans into `window`; false where what was found does not pass.
        pub fn plan = plan_any, plan_wide(
            &mut self,
            run: &Run<'_, L>,
            frame: &Frame<L>,
            start: &Start<'_, L>,
            window: &mut Window<L>,
        ) -> bool;
    }

    #[inline(always)]
    fn plan_any(
        &mut self,
        run: &Run<'_, L>,
        frame: &Frame<L>,
        start: &Start<'_, L>,
        window: &mut Window<L>,
    ) -> bool {
        self.effort.windows += 1;
        let counted = frame.counted(run.rotary);
        let tolerance = start.least_tolerance(run);
        self.step_s = self.tuning.step_s(frame, tolerance);
        self.box_share = self.tuning.share(frame, tolerance);
        let reach = self.take_over(start);
        self.timing
            .make(run, frame, &counted, &reach, &mut self.marks);
        if self.marks.len() < 2 {
            // There is no path between the start and the end.
            self.effort.rejected += 1;
            return false;
        }
        let end = self.marks[self.marks.len() - 1].s;
        self.waypoints.gather(run, start.s, end);
        let travel = frame.travel.around(run, (start.s, end), &start.state[0]);
        let rests = resting(run, start, end);
        if start.old.is_none() {
            self.first_try = FirstTry::NOMINAL;
        }
        let mut shares = self.first_try.shares(self.box_share);
        let mut before_s = self.marks[self.marks.len() - 1].t;
        let rounds = if self.is_at_feed(start) {
            1
        } else {
            self.rounds(start)
        };
        let mut round = 1;
        let mut repairs = 0;
        let mut settled = false;
        loop {
            let last = settled || round >= rounds;
            self.effort.rounds += 1;
            if !self.round(run, frame, start, (&shares, travel, rests), &counted, last) {
                self.effort.rejected += 1;
                return false;
            }
            let now_s = self.marks[self.marks.len() - 1].t;
            let gained = (before_s - now_s) / now_s;
            before_s = now_s;
            // Where a round still gains much, another is worth its time.
            let promising =
                last && !settled && !self.infeasible && gained > MUCH && round < rounds + EXTRA;
            if !last || promising {
                settled = gained.abs() < GAIN;
                round += 1;
                continue;
            }
            // What no rate was found for would be driven where it passes by luck, as slow as the solver left it.
            let lost = self.infeasible && !start.resting && repairs == 0;
            if lost && round < rounds + EXTRA {
                self.time_loosely(run, frame, start, (&shares, rests), &counted);
                before_s = self.marks[self.marks.len() - 1].t;
                round += 1;
                continue;
            }
            self.build(&rests, &start.state[0], window);
            let checked =
                self.checker
                    .check(run, frame, &counted, start, (window, travel.as_ref()));
            if checked.passes() {
                self.first_try = FirstTry::after(&shares, repairs > 0);
                window.whole = run.closed && end >= run.end() - 1e-9;
                return true;
            }
            if repairs == self.tuning.repairs || !checked.is_finite() {
                self.effort.rejected += 1;
                return false;
            }
            if self.infeasible && !start.resting {
                self.time_loosely(run, frame, start, (&shares, rests), &counted);
                if repairs > 0 {
                    self.hand_over();
                }
            } else {
                shares = take_back(shares, &checked);
            }
            repairs += 1;
            round = rounds;
            self.effort.repairs += 1;
        }
    }

    /// Rounds that a window has at least. Without the timing of a window before there is more to be found; on a fine grid a round
    /// changes less.
    fn rounds(&self, start: &Start<'_, L>) -> usize {
        let rounds = self.tuning.rounds + usize::from(self.step_s < FINE_S);
        if start.old.is_none() {
            2 * rounds
        } else {
            rounds
        }
    }

    /// Whether a window in motion goes at its feed as far as it is driven at most: a round that looks for its timing has nothing to gain
    /// but in the braking behind that. On the spiral of the examples it takes a seventh less to plan, and the same time.
    fn is_at_feed(&self, start: &Start<'_, L>) -> bool {
        let Some((old, now_s)) = start.old else {
            return false;
        };
        let handed_s = self.handed[self.handed.len() - 1].t;
        let whole_s = self.marks[self.marks.len() - 1].t;
        let mut handed = old.pieces[old.piece_at(now_s)..]
            .iter()
            .take_while(|piece| piece.start_s < now_s + handed_s);
        handed.all(|piece| piece.bound == Bound::Feed)
            && self.timing.is_at_feed(COMMIT.1 * whole_s - handed_s)
    }

    /// Begins the marks with the timing of the window before; gives what is to be timed behind them.
    fn take_over(&mut self, start: &Start<'_, L>) -> Reach {
        self.marks.clear();
        self.marks.push(Mark { t: 0.0, s: start.s });
        let size = |v: &Lanes<L>| v.iter().map(|v| v * v).sum::<f64>().sqrt();
        let mut reach = Reach {
            s: start.s,
            speed: size(&start.state[1]),
            window_s: start.window_s.min(MAX_STEPS * self.step_s),
            end: start.end,
            step_s: self.step_s,
        };
        if let Some((old, now_s)) = start.old {
            let until_s = now_s + WARM * (old.duration_s() - now_s);
            let known = old
                .marks
                .iter()
                .filter(|mark| mark.t > now_s && mark.t <= until_s && mark.s > start.s);
            self.marks.extend(known.map(|mark| Mark {
                t: mark.t - now_s,
                s: mark.s,
            }));
            let last = self.marks[self.marks.len() - 1];
            reach.s = last.s;
            reach.speed = size(&old.state(now_s + last.t)[1]);
            reach.window_s -= last.t;
        }
        self.handed.clone_from(&self.marks);
        reach
    }

    /// The timing of the same motion where its start may take more than the limits.
    #[inline(always)]
    fn time_loosely(
        &mut self,
        run: &Run<'_, L>,
        frame: &Frame<L>,
        start: &Start<'_, L>,
        (shares, rests): (&Shares, [bool; L]),
        counted: &Lanes<L>,
    ) {
        self.fill_retimer(run, frame, (shares, &WIDE), counted, &rests);
        let retimed = self.retimer.solve((End::Moving, End::Rest), &ROUGH);
        self.effort.retime_iterations += retimed.iterations as u64;
        self.lay_marks(start.s);
    }

    /// Goes back to the timing of the window before as far as it was taken over, and leaves that of what follows: the motion of the
    /// window before kept its limits there, a faster one from the same state may not.
    fn hand_over(&mut self) {
        let last = self.handed[self.handed.len() - 1];
        let passed_s = Timer {
            marks: &self.marks,
            at: 0,
        }
        .time(last.s);
        let known = self.handed.len();
        let behind = self.marks.iter().filter(|mark| mark.s > last.s);
        self.handed.extend(behind.map(|mark| Mark {
            t: mark.t - passed_s + last.t,
            s: mark.s,
        }));
        self.marks.clone_from(&self.handed);
        self.handed.truncate(known);
    }

    /// One turn; the marks are then those of the faster timing. False where it has none.
    #[inline(always)]
    fn round(
        &mut self,
        run: &Run<'_, L>,
        frame: &Frame<L>,
        start: &Start<'_, L>,
        (shares, travel, rests): (&Shares, Option<Travel<L>>, [bool; L]),
        counted: &Lanes<L>,
        last: bool,
    ) -> bool {
        let total_s = self.marks[self.marks.len() - 1].t;
        let coarser = if last || start.old.is_none() {
            1.0
        } else {
            (self.step_s / SHORT_S).clamp(1.0, COARSEST)
        };
        let step_s = coarser * self.step_s;
        let intervals = ((total_s / step_s).ceil() as usize).clamp(INTERVALS.0, INTERVALS.1);
        let grid = Grid {
            intervals,
            step_s: total_s / intervals as f64,
            lanes: frame.count,
        };
        self.lay_spline(run, start, &grid);
        let ends = (start.s, self.marks[self.marks.len() - 1].s);
        let keep = Keep {
            share: shares.boxes,
            begin: if start.resting {
                shares.boxes
            } else {
                shares.boxes.max(self.box_share)
            },
            travel,
            margin: shares.margin,
            rests,
            ends,
        };
        self.waypoints.choose(run, &self.marks, grid, &keep);
        let smoothed = self
            .smoother
            .smooth(&mut self.spline, &self.waypoints.chosen, &frame.jerk);
        let (asked, room) = if last {
            (&EXACT, &LEFT)
        } else {
            (&ROUGH, &WIDE)
        };
        let room = if start.resting { &NO_ROOM } else { room };
        self.fill_retimer(run, frame, (shares, room), counted, &rests);
        let begin = if start.resting {
            End::Rest
        } else {
            End::Moving
        };
        let retimed = self.retimer.solve((begin, End::Rest), asked);
        self.infeasible = retimed.violation > INFEASIBLE;
        self.effort.intervals += intervals as u64;
        self.effort.smooth_iterations += smoothed.iterations as u64;
        self.effort.retime_iterations += retimed.iterations as u64;
        self.lay_marks(start.s)
    }

    /// The spline's first guess: the path at the Greville places of its control points.
    #[inline(always)]
    fn lay_spline(&mut self, run: &Run<'_, L>, start: &Start<'_, L>, grid: &Grid) {
        let marks = &self.marks;
        let h = grid.step_s;
        self.spline.step_s = h;
        self.spline.points.clear();
        let mut at = 0;
        let mut chord = run.chord_at(start.s, 0);
        for index in 0..grid.intervals + 3 {
            let t = (index as f64 - 1.0) * h;
            while at + 2 < marks.len() && marks[at + 1].t < t {
                at += 1;
            }
            let a = marks[at];
            let b = marks[at + 1];
            let s = a.s + (b.s - a.s) * ((t - a.t) / (b.t - a.t)).clamp(0.0, 1.0);
            chord = run.chord_at(s, chord);
            self.spline.points.push(run.chords[chord].at(s));
        }
        let end = marks[marks.len() - 1].s;
        let last = run.chord_at(end - 1e-9, chord);
        self.spline.begin(&start.state);
        self.spline.end(&run.chords[last].at(end));
    }

    #[inline(always)]
    fn fill_retimer(
        &mut self,
        run: &Run<'_, L>,
        frame: &Frame<L>,
        (shares, room): (&Shares, &Room),
        counted: &Lanes<L>,
        rests: &[bool; L],
    ) {
        let speed = &frame.speed[usize::from(run.rapid)];
        let per_speed: Lanes<L> = speed.map(|v| 1.0 / (0.9995 * v));
        let factors = Factors {
            per_jerk: frame.jerk.map(|j| 1.0 / (shares.jerk * j)),
            per_acceleration: frame.acceleration.map(|a| 1.0 / (shares.acceleration * a)),
        };
        let mut feeds = Feeds {
            run,
            along: &self.waypoints.along,
            waypoints: &self.waypoints.chosen,
            at: 0,
        };
        let point = |[_, first, second, third]: &[Lanes<L>; 4], feed: f64, place: f64| {
            let begun = (1.0 - place / BEGINNING).max(0.0);
            let mut squared = 0.0;
            let mut axis = 0.0f64;
            for l in 0..L {
                squared += (counted[l] * first[l]).powi(2);
                let share = (first[l] * per_speed[l]).abs();
                axis = if share > axis { share } else { axis };
            }
            let most = (shares.feed * feed).powi(2) / squared.max(1e-12);
            let most = most
                .min(1.0 / (axis * axis).max(1e-12))
                .min(MAX_RATE_SQUARED);
            Point {
                first: *first,
                second: *second,
                third: *third,
                most,
                jerk_share: 1.0 + begun * room.jerk,
                acceleration_share: 1.0 + begun * room.acceleration,
            }
        };
        let moving = std::array::from_fn(|l| l < frame.count && !rests[l]);
        self.retimer
            .begin(self.spline.intervals(), self.spline.step_s, &moving);
        let mut ends = self.spline.at(0, 0.0);
        for k in 0..self.spline.intervals() {
            let feed = feeds.of(k);
            let middle = self.spline.at(k, 0.5);
            let start = [ends[0], ends[1], ends[2], middle[3]];
            ends = self.spline.at(k, 1.0);
            let place = k as f64;
            let points = [
                point(&start, feed, place),
                point(&middle, feed, place + 0.5),
                point(&ends, feed, place + 1.0),
            ];
            self.retimer.push(&points, &factors);
        }
    }

    /// The times of the knots, and the marks: when the motion passes the waypoints.
    #[inline(always)]
    fn lay_marks(&mut self, from: f64) -> bool {
        let rate = &self.retimer.rate;
        let h = self.spline.step_s;
        self.times.clear();
        self.times.push(0.0);
        let mut t = 0.0;
        for k in 0..rate.intervals() {
            t += rate.time_s(k, 1.0, h);
            self.times.push(t);
        }
        let end = self.marks[self.marks.len() - 1].s;
        self.marks.clear();
        self.marks.push(Mark { t: 0.0, s: from });
        for (waypoint, (s, _)) in self.waypoints.chosen.iter().zip(&self.waypoints.along) {
            let k = waypoint.interval as usize;
            let time = self.times[k] + rate.time_s(k, waypoint.z, h);
            self.marks.push(Mark { t: time, s: *s });
        }
        self.marks.push(Mark { t, s: end });
        t.is_finite()
    }

    /// The quintics between the knots. A lane that `rests` stays exactly `at` its place: with the spline's rounding it would count as
    /// one that moves in the next window, and swing within the tolerance, at a speed that no feed limits where it is not counted.
    #[inline(always)]
    fn build(&mut self, rests: &[bool; L], at: &Lanes<L>, window: &mut Window<L>) {
        let h = self.spline.step_s;
        window.pieces.clear();
        window.pieces.reserve(self.spline.intervals());
        window.marks.clone_from(&self.marks);
        let state = |k: usize, z: f64| -> State<L> {
            let [x, x1, x2, _] = self.spline.at(k, z);
            let [b, slope, _] = self.retimer.rate.at(k, z, h);
            let rate = b.max(1e-9).sqrt();
            let moving = |l: usize, value: f64| if rests[l] { 0.0 } else { value };
            [
                each(|l| if rests[l] { at[l] } else { x[l] }),
                each(|l| moving(l, x1[l] * rate)),
                each(|l| moving(l, x2[l] * b + x1[l] * (slope / 2.0))),
            ]
        };
        let mut from = state(0, 0.0);
        for k in 0..self.spline.intervals() {
            let to = state(k, 1.0);
            let start_s = self.times[k];
            let end_s = self.times[k + 1];
            window
                .pieces
                .push(Piece::between(&from, &to, start_s, end_s - start_s));
            from = to;
        }
    }
}

/// The lanes that rest at the start, and in which the path does not go anywhere up to `end`.
fn resting<const L: usize>(run: &Run<'_, L>, start: &Start<'_, L>, end: f64) -> [bool; L] {
    let [at, velocity, acceleration] = &start.state;
    let first = run.chord_at(start.s, 0);
    std::array::from_fn(|l| {
        velocity[l] == 0.0
            && acceleration[l] == 0.0
            && at[l] == run.chords[first].start[l]
            && run.chords[first..]
                .iter()
                .take_while(|chord| chord.s < end)
                .all(|chord| chord.direction[l] == 0.0)
    })
}
