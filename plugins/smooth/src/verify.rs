//! The guarantee: every limit on the motion as it is emitted, from its start to its rest.
//!
//! Differences of samples are means of derivatives, so what holds for every instant of the quintics holds for samples at
//! any phase, and across windows, since position, velocity and acceleration are continuous. Distances are taken at
//! samples a fine period apart.

use tandem_motion::tube::{Lanes, each};

use crate::frame::{Frame, dot, minus};
use crate::peaks::{bound, derivatives};
use crate::plan::Start;
use crate::route::Run;
use crate::sites::Timer;
use crate::window::{Piece, Stop, Window};

/// Share of a limit that the motion may reach at an instant.
const SPEED: f64 = 1.0;
const ACCELERATION: f64 = 0.9995;
const JERK: f64 = 1.003;
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
pub fn larger(a: f64, b: f64) -> f64 {
    // Where either is no number, neither is the result.
    if b > a || b.is_nan() { b } else { a }
}

#[inline(always)]
fn smaller(a: f64, b: f64) -> f64 {
    if b < a { b } else { a }
}
