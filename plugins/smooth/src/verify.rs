//! The guarantee: every limit on the motion as it is emitted, from its start to its rest.
//!
//! Differences of samples are means of derivatives, so what holds for every instant of the quintics holds for samples at
//! any phase, and across windows, since position, velocity and acceleration are continuous. Distances are taken at
//! samples a fine period apart.

use tandem_motion::tube::{Lanes, each};

use crate::frame::{Frame, dot, largest, minus, smallest};
use crate::plan::Start;
use crate::route::Run;
use crate::sites::Timer;
use crate::window::{Bound, Piece, Stop, Window};

/// Share of a limit that the motion may reach at an instant.
const SPEED: f64 = 1.0;
const ACCELERATION: f64 = 0.9995;
const JERK: f64 = 1.003;
/// Share of an acceleration limit from which on a piece is looked at between its quarters.
const NEAR_ACCELERATION: f64 = 0.9;
/// Share of the tolerance that samples at this phase may reach: at others it is a little more.
const DEVIATION: f64 = 0.985;
/// Below this share of the tolerance nothing nearer is looked for.
const NEAR_ENOUGH: f64 = 0.35;
/// Chords searched on each side.
const SEARCHED: usize = 400;

/// The largest of each, as a share of what is allowed.
#[derive(Clone, Copy, Debug, Default)]
pub struct Checked {
    pub speed: f64,
    pub acceleration: f64,
    pub jerk: f64,
    pub deviation: f64,
}

impl Checked {
    /// Whether all is kept.
    pub fn passes(&self) -> bool {
        // A comparison with NaN is false.
        self.speed <= 1.0 && self.acceleration <= 1.0 && self.jerk <= 1.0 && self.deviation <= 1.0
    }

    pub fn is_finite(&self) -> bool {
        (self.speed + self.acceleration + self.jerk + self.deviation).is_finite()
    }
}

/// Memory of samples.
#[derive(Debug)]
pub struct Checker<const L: usize> {
    samples: Vec<Lanes<L>>,
}

impl<const L: usize> Default for Checker<L> {
    fn default() -> Self {
        Self { samples: Vec::new() }
    }
}

impl<const L: usize> Checker<L> {
    /// Checks `window`, and notes what it leaves for a stop and what binds its pieces.
    pub fn check(
        &mut self,
        run: &Run<'_, L>,
        frame: &Frame<L>,
        counted: &Lanes<L>,
        start: &Start<'_, L>,
        window: &mut Window<L>,
    ) -> Checked {
        let mut checked = Checked::default();
        window.stop = Stop::default();
        let mut feeder = Feeder { run, timer_at: 0, chord: run.chord_at(start.s, 0) };
        let speed = &frame.speed[usize::from(run.rapid)];
        for n in 0..window.pieces.len() {
            let (least, feed) = feeder.range(window, n);
            let mut shares = derivatives(&window.pieces[n], frame, speed, counted, feed, &mut window.stop);
            if least < feed && shares.feed * feed > least {
                shares.feed = larger(shares.feed, feeder.peak(&window.pieces[n], counted, frame.period_s));
            }
            window.pieces[n].bound = bound(&shares);
            checked.speed = larger(checked.speed, larger(shares.feed, shares.speed) / SPEED);
            checked.acceleration = larger(checked.acceleration, shares.acceleration / ACCELERATION);
            checked.jerk = larger(checked.jerk, shares.jerk / JERK);
        }
        let finite = checked.is_finite() && window.duration_s().is_finite();
        if !finite {
            return Checked { jerk: f64::NAN, ..checked };
        }
        self.sample(start, window, frame.period_s);
        let before = start.before.len();
        checked.deviation = self.samples_off(run, window, frame.period_s, before);
        checked.deviation = checked.deviation.max(self.vertices_off(run, start, window, frame.period_s));
        checked
    }

    fn sample(&mut self, start: &Start<'_, L>, window: &Window<L>, period_s: f64) {
        self.samples.clear();
        self.samples.extend_from_slice(start.before);
        let mut t = 0.0;
        for piece in &window.pieces {
            let end_s = piece.end_s();
            while t < end_s {
                self.samples.push(piece.position(t - piece.start_s));
                t += period_s;
            }
        }
        if let Some(last) = window.pieces.last() {
            self.samples.push(last.position(last.duration_s));
        }
    }

    /// The largest distance of a sample from the path, as a share of what is allowed.
    fn samples_off(&self, run: &Run<'_, L>, window: &Window<L>, period_s: f64, before: usize) -> f64 {
        let (mut worst, mut mark) = (0.0f64, 0);
        let mut near = run.chord_at(window.marks[0].s, 0);
        for (n, sample) in self.samples[before..].iter().enumerate() {
            let t = n as f64 * period_s;
            while mark + 2 < window.marks.len() && window.marks[mark + 1].t <= t {
                mark += 1;
            }
            let (a, b) = (window.marks[mark], window.marks[mark + 1]);
            let s = a.s + (b.s - a.s) * ((t - a.t) / (b.t - a.t).max(1e-12)).clamp(0.0, 1.0);
            near = run.chord_at(s, near);
            worst = larger(worst, nearest_chord(run, near, sample));
        }
        worst
    }

    /// The largest distance of a vertex from the chain of samples.
    fn vertices_off(&self, run: &Run<'_, L>, start: &Start<'_, L>, window: &Window<L>, period_s: f64) -> f64 {
        let (from, to) = (start.s - AROUND, window.end());
        let mut timer = Timer { marks: &window.marks, at: 0 };
        let mut worst = 0.0f64;
        let mut i = run.chord_at(from, 0).max(1);
        while i < run.chords.len() && run.chords[i].s < to {
            let chord = &run.chords[i];
            let near = if chord.s <= start.s { 0.0 } else { timer.time(chord.s) / period_s };
            let tolerance = chord.tolerance.max(run.chords[i - 1].tolerance);
            if chord.s > from {
                let off = self.nearest_sample(near as usize + start.before.len(), &chord.start, tolerance);
                worst = larger(worst, off);
            }
            i += 1;
        }
        worst
    }

    fn nearest_sample(&self, near: usize, vertex: &Lanes<L>, tolerance: f64) -> f64 {
        let last = self.samples.len() - 2;
        let near = near.min(last);
        let enough = (NEAR_ENOUGH * tolerance).powi(2);
        let allowed = DEVIATION * tolerance;
        let mut best = f64::INFINITY;
        for step in 0..SEARCHED {
            let (below, above) = (near.checked_sub(step), near + step);
            if let Some(below) = below {
                best = smaller(best, to_chord(vertex, &self.samples[below], &self.samples[below + 1]));
            }
            if above <= last && step > 0 {
                best = smaller(best, to_chord(vertex, &self.samples[above], &self.samples[above + 1]));
            }
            // A few around, and then only as long as it is too far.
            if best < enough || step >= 3 && best <= allowed * allowed {
                break;
            }
            if below.is_none() && above > last {
                break;
            }
        }
        best.sqrt() / allowed
    }
}

/// Way before the start in which vertices are looked at again: the samples behind the start are new.
const AROUND: f64 = 0.05;

/// The distance of `point` from the path around chord `near`, as a share of what is allowed.
fn nearest_chord<const L: usize>(run: &Run<'_, L>, near: usize, point: &Lanes<L>) -> f64 {
    let chords = run.chords;
    let share = |i: usize| {
        let chord = &chords[i];
        let way = minus(point, &chord.start);
        let along = dot(&way, &chord.direction).clamp(0.0, chord.length);
        let across: Lanes<L> = each(|l| way[l] - along * chord.direction[l]);
        dot(&across, &across) / (chord.tolerance * chord.tolerance)
    };
    let mut best = share(near);
    for step in 1..SEARCHED {
        if best < NEAR_ENOUGH * NEAR_ENOUGH || step > 3 && best <= DEVIATION * DEVIATION {
            break;
        }
        if near + step < chords.len() {
            best = smaller(best, share(near + step));
        }
        if near >= step {
            best = smaller(best, share(near - step));
        }
    }
    best.sqrt() / DEVIATION
}

fn to_chord<const L: usize>(point: &Lanes<L>, a: &Lanes<L>, b: &Lanes<L>) -> f64 {
    let (chord, way) = (minus(b, a), minus(point, a));
    let squared = dot(&chord, &chord);
    let along = if squared > 0.0 { (dot(&way, &chord) / squared).clamp(0.0, 1.0) } else { 0.0 };
    let across: Lanes<L> = each(|l| way[l] - along * chord[l]);
    dot(&across, &across)
}

/// What a piece reaches, as shares of limits.
#[derive(Clone, Copy, Debug, Default)]
struct Reached {
    feed: f64,
    speed: f64,
    acceleration: f64,
    jerk: f64,
}

fn bound(reached: &Reached) -> Bound {
    if reached.feed > 0.99 {
        Bound::Feed
    } else if reached.speed > 0.985 {
        Bound::Velocity
    } else if reached.acceleration > 0.95 {
        Bound::Acceleration
    } else if reached.jerk > 0.9 {
        Bound::Jerk
    } else {
        Bound::Tolerance
    }
}

/// The largest derivatives of a piece: jerk at its ends, middle and peak, the others at its ends and quarters.
fn derivatives<const L: usize>(
    piece: &Piece<L>,
    frame: &Frame<L>,
    speed: &Lanes<L>,
    counted: &Lanes<L>,
    feed: f64,
    stop: &mut Stop,
) -> Reached {
    let mut reached = Reached::default();
    let t = piece.duration_s;
    for l in 0..L {
        let (c3, c4, c5) = (6.0 * piece.c[3][l], 24.0 * piece.c[4][l], 60.0 * piece.c[5][l]);
        let mut most = larger(c3.abs(), (c3 + t * (c4 + t * c5)).abs());
        let peak = -c4 / (2.0 * c5);
        if peak > 0.0 && peak < t {
            most = larger(most, (c3 + peak * (c4 + peak * c5)).abs());
        }
        reached.jerk = larger(reached.jerk, most / frame.jerk[l]);
    }
    for part in [0.25, 0.5, 0.75, 1.0] {
        let (v, a) = (piece.velocity(part * t), piece.acceleration(part * t));
        let mut squared = 0.0;
        for l in 0..L {
            squared += (counted[l] * v[l]).powi(2);
            reached.speed = larger(reached.speed, v[l].abs() / speed[l]);
            reached.acceleration = larger(reached.acceleration, a[l].abs() / frame.acceleration[l]);
        }
        reached.feed = larger(reached.feed, squared.sqrt() / feed);
        if part == 1.0 {
            leave(stop, frame, &v, &a, squared.sqrt());
        }
    }
    if reached.acceleration > NEAR_ACCELERATION {
        reached.acceleration = larger(reached.acceleration, peak_acceleration(piece, frame));
    }
    // What jerk can add to a speed between quarters.
    let jerk = reached.jerk * largest(&frame.jerk);
    let between = jerk * (t / 4.0).powi(2) / 8.0;
    if reached.feed + between / feed > 1.0 || reached.speed + between / smallest(speed) > 1.0 {
        (reached.feed, reached.speed) = peak_speeds(piece, counted, (feed, speed), jerk);
    }
    reached
}

/// The highest acceleration inside a piece, as a share of the limit: where the jerk of a lane is zero.
fn peak_acceleration<const L: usize>(piece: &Piece<L>, frame: &Frame<L>) -> f64 {
    let mut most = 0.0;
    for l in 0..L {
        let (a, half_b, c) = (60.0 * piece.c[5][l], 12.0 * piece.c[4][l], 6.0 * piece.c[3][l]);
        let root = half_b * half_b - a * c;
        if root < 0.0 {
            continue;
        }
        // Of the two the one that loses no digits, and the other from the product of both.
        let sum = -(half_b + root.sqrt().copysign(half_b));
        for t in [sum / a, c / sum].into_iter().filter(|t| *t > 0.0 && *t < piece.duration_s) {
            most = larger(most, piece.acceleration(t)[l].abs() / frame.acceleration[l]);
        }
    }
    most
}

/// The highest path speed of a piece as a share of its feed, and the highest of a lane as a share of its limit: at
/// sixteenths, and what jerk can add between them.
fn peak_speeds<const L: usize>(
    piece: &Piece<L>,
    counted: &Lanes<L>,
    (feed, speed): (f64, &Lanes<L>),
    jerk: f64,
) -> (f64, f64) {
    let step_s = piece.duration_s / 16.0;
    let between = jerk * step_s * step_s / 8.0;
    let mut most = (0.0, 0.0);
    for n in 0..=16 {
        let v = piece.velocity(f64::from(n) * step_s);
        most.0 = larger(most.0, (0..L).map(|l| (counted[l] * v[l]).powi(2)).sum());
        most.1 = (0..L).fold(most.1, |most, l| larger(most, (v[l].abs() + between) / speed[l]));
    }
    ((most.0.sqrt() + between) / feed, most.1)
}

/// Share of an acceleration limit that counts as left at least, for the moment that turning takes all of it.
const LEAST_LEFT: f64 = 0.02;

/// Notes what is left for a stop: with d the direction and n what turns, `A − max(0, −sign(d)·n)` over |d|.
fn leave<const L: usize>(stop: &mut Stop, frame: &Frame<L>, v: &Lanes<L>, a: &Lanes<L>, speed: f64) {
    if speed < 1e-3 {
        return;
    }
    let squared = dot(v, v);
    let along = dot(v, a) / squared;
    stop.speed = stop.speed.max(speed);
    for l in 0..L {
        let d = v[l] / speed;
        let turning = (a[l] - along * v[l]) * d.signum();
        let left = (frame.acceleration[l] + turning.min(0.0)).max(0.0);
        stop.time_s = stop.time_s.max(speed * d.abs() / left.max(LEAST_LEFT * frame.acceleration[l]));
        stop.jerk = stop.jerk.min(frame.jerk[l] / d.abs().max(1e-9));
    }
}

/// The feeds of the chords that a piece touches.
struct Feeder<'a, const L: usize> {
    run: &'a Run<'a, L>,
    timer_at: usize,
    chord: usize,
}

impl<const L: usize> Feeder<'_, L> {
    /// The lowest and the highest.
    fn range(&mut self, window: &Window<L>, n: usize) -> (f64, f64) {
        let piece = &window.pieces[n];
        let marks = &window.marks;
        while self.timer_at + 2 < marks.len() && marks[self.timer_at + 1].t <= piece.start_s {
            self.timer_at += 1;
        }
        self.chord = self.run.chord_at(marks[self.timer_at].s, self.chord);
        let mut range = (self.run.chords[self.chord].feed, self.run.chords[self.chord].feed);
        let mut mark = self.timer_at;
        while mark + 1 < marks.len() && marks[mark].t < piece.end_s() {
            mark += 1;
        }
        let mut i = self.chord;
        while i + 1 < self.run.chords.len() && self.run.chords[i + 1].s < marks[mark].s {
            i += 1;
            let feed = self.run.chords[i].feed;
            range = (range.0.min(feed), range.1.max(feed));
        }
        range
    }

    /// The highest path speed of a piece as a share of the feed where it is: that of the chord beside it, or of one that is
    /// reached within half a fine period.
    fn peak(&self, piece: &Piece<L>, counted: &Lanes<L>, period_s: f64) -> f64 {
        let chords = self.run.chords;
        let (mut most, mut i) = (0.0, self.chord);
        for n in 0..=16 {
            let t = f64::from(n) / 16.0 * piece.duration_s;
            let (at, v) = (piece.position(t), piece.velocity(t));
            let passed = |i: usize| dot(&minus(&at, &chords[i].start), &chords[i].direction);
            while i + 1 < chords.len() && passed(i + 1) > 0.0 {
                i += 1;
            }
            let soon = dot(&v, &v).sqrt() * period_s / 2.0;
            let mut feed = chords[i].feed;
            if i > 0 && passed(i) < soon {
                feed = feed.max(chords[i - 1].feed);
            }
            if i + 1 < chords.len() && passed(i) > chords[i].length - soon {
                feed = feed.max(chords[i + 1].feed);
            }
            let squared: f64 = (0..L).map(|l| (counted[l] * v[l]).powi(2)).sum();
            most = larger(most, squared.sqrt() / feed);
        }
        most
    }
}

#[inline(always)]
fn larger(a: f64, b: f64) -> f64 {
    // Where either is no number, neither is the result.
    if b > a || b.is_nan() { b } else { a }
}

#[inline(always)]
fn smaller(a: f64, b: f64) -> f64 {
    if b < a { b } else { a }
}
