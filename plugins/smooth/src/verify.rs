//! The guarantee: every limit on the motion as it is emitted, from its start to its rest.
//!
//! Differences of samples are means of derivatives, so what holds for every instant of the quintics holds for samples at
//! any phase, and across windows, since position, velocity and acceleration are continuous. Derivatives, and positions near
//! the ends of the travel, are judged by bounds of the polynomials ([`crate::peaks`]). Distances are taken at samples a fine
//! period apart, with what the motion and the path can do between.

use tandem_motion::in_wide_instructions;
use tandem_motion::tube::{Lanes, each};

use crate::beside::{
    ALLOWED, Beside, DEVIATION, HALVINGS, NEAR_ENOUGH, SEARCHED, beside, closer, stretch, to_chord,
};
use crate::feeds::Feeder;
use crate::frame::{Frame, dot};
use crate::order::Order;
use crate::peaks::{bound, derivatives, highest, positions};
use crate::plan::Start;
use crate::route::Run;
use crate::travel::Travel;
use crate::waypoints::Timer;
use crate::window::{Stop, Window};

/// Share of a limit that the motion may reach at an instant.
pub const SPEED: f64 = 1.0;
pub const ACCELERATION: f64 = 0.9995;
pub const JERK: f64 = 1.003;
/// Share of the tolerance beyond which it does not matter how much it is: the boxes of the next try are as narrow as they get.
pub const FAR: f64 = 1.4;

/// The largest of each, as a share of what is allowed.
#[derive(Clone, Copy, Debug, Default)]
pub struct Checked {
    pub speed: f64,
    pub acceleration: f64,
    pub jerk: f64,
    pub deviation: f64,
    /// What lies between two samples, as a share of the tolerance, where it makes the deviation too large.
    pub bulge: f64,
    /// How far the motion is beyond an end of the travel, in lane units.
    pub travel: f64,
}

impl Checked {
    /// Whether all is kept.
    pub fn passes(&self) -> bool {
        // A comparison with NaN is false.
        self.speed <= 1.0
            && self.acceleration <= 1.0
            && self.jerk <= 1.0
            && self.deviation <= 1.0
            && self.travel <= 0.0
    }

    pub fn is_finite(&self) -> bool {
        (self.speed + self.acceleration + self.jerk + self.deviation + self.travel).is_finite()
    }
}

/// Memory of samples.
#[derive(Debug)]
pub struct Checker<const L: usize> {
    samples: Vec<Lanes<L>>,
    /// Bounds of the size of acceleration and jerk of every piece.
    bends: Vec<f64>,
    jerks: Vec<f64>,
    order: Order,
}

impl<const L: usize> Default for Checker<L> {
    fn default() -> Self {
        Self {
            samples: Vec::new(),
            bends: Vec::new(),
            jerks: Vec::new(),
            order: Order::default(),
        }
    }
}

impl<const L: usize> Checker<L> {
    in_wide_instructions! {
        /// Checks `window`, and notes what it leaves for a stop and what binds its pieces.
        pub fn check = check_any, check_wide(
            &mut self,
            run: &Run<'_, L>,
            frame: &Frame<L>,
            counted: &Lanes<L>,
            start: &Start<'_, L>,
            found: (&mut Window<L>, Option<&Travel<L>>),
        ) -> Checked;
    }

    #[inline(always)]
    fn check_any(
        &mut self,
        run: &Run<'_, L>,
        frame: &Frame<L>,
        counted: &Lanes<L>,
        start: &Start<'_, L>,
        (window, travel): (&mut Window<L>, Option<&Travel<L>>),
    ) -> Checked {
        let mut checked = Checked::default();
        window.stop = Stop::default();
        self.bends.clear();
        self.jerks.clear();
        let size_of_jerk = dot(&frame.jerk, &frame.jerk).sqrt();
        let mut feeder = Feeder {
            run,
            timer_at: 0,
            chord: run.chord_at(start.s, 0),
        };
        let speed = &frame.speed[usize::from(run.rapid)];
        for n in 0..window.pieces.len() {
            let (least, feed) = feeder.range(window, n);
            let mut shares = derivatives(
                &window.pieces[n],
                frame,
                speed,
                counted,
                feed,
                &mut window.stop,
            );
            if least < feed && shares.feed * feed > least {
                let counted_jerk: Lanes<L> = each(|l| counted[l] * frame.jerk[l]);
                let jerk = shares.jerk * dot(&counted_jerk, &counted_jerk).sqrt();
                shares.feed = larger(
                    shares.feed,
                    feeder.peak(&window.pieces[n], counted, frame.period_s, jerk),
                );
            }
            window.pieces[n].bound = bound(&shares);
            checked.speed = larger(checked.speed, larger(shares.feed, shares.speed) / SPEED);
            checked.acceleration = larger(checked.acceleration, shares.acceleration / ACCELERATION);
            checked.jerk = larger(checked.jerk, shares.jerk / JERK);
            if let Some(travel) = travel {
                let beyond = highest(&positions(&window.pieces[n]), 0.0, &|at| travel.beyond(at));
                checked.travel = larger(checked.travel, beyond);
            }
            self.bends.push(shares.bend);
            self.jerks.push(shares.jerk * size_of_jerk);
        }
        let finite = checked.is_finite() && window.duration_s().is_finite();
        if !finite {
            return Checked {
                jerk: f64::NAN,
                ..checked
            };
        }
        self.sample(start, window, frame.period_s);
        let before = start.before.len();
        checked.deviation = self.motion_off(run, window, frame.period_s, before);
        if checked.deviation <= 1.0 {
            let near = run.chord_at(window.marks[0].s, 0);
            if !self
                .order
                .walk(run, &self.samples, before, (near, window.end()))
            {
                return Checked {
                    deviation: FAR,
                    ..checked
                };
            }
            let (off, bulge) = self.vertices_off(run, start, window, frame.period_s);
            checked.deviation = checked.deviation.max(off);
            checked.bulge = bulge;
        }
        checked
    }

    #[inline(always)]
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

    /// A bound of the distance of the motion from the path, as a share of what is allowed, at samples of any phase: what lies
    /// between two of this one is looked at again where it matters.
    #[inline(always)]
    fn motion_off(
        &self,
        run: &Run<'_, L>,
        window: &Window<L>,
        period_s: f64,
        before: usize,
    ) -> f64 {
        let mut worst = 0.0f64;
        let mut mark = 0;
        let mut piece = 0;
        let mut near = run.chord_at(window.marks[0].s, 0);
        let mut last: Option<Beside<L>> = None;
        for (n, sample) in self.samples[before..].iter().enumerate() {
            let t = n as f64 * period_s;
            while mark + 2 < window.marks.len() && window.marks[mark + 1].t <= t {
                mark += 1;
            }
            let a = window.marks[mark];
            let b = window.marks[mark + 1];
            let s = a.s + (b.s - a.s) * ((t - a.t) / (b.t - a.t).max(1e-12)).clamp(0.0, 1.0);
            near = run.chord_at(s, near);
            let here = beside(run, near, sample);
            let Some(last) = last.replace(here) else {
                worst = here.share;
                continue;
            };
            let mut bend = self.bends[piece];
            while piece + 1 < window.pieces.len() && window.pieces[piece].end_s() < t {
                piece += 1;
                bend = larger(bend, self.bends[piece]);
            }
            let bulge = bend * period_s * period_s / 8.0;
            let mut between = stretch(run, &last, &here, bulge);
            if between > 1.0 {
                let ends = [t - period_s, t.min(window.duration_s())];
                between = closer(run, window, ends, (&last, &here), bulge, HALVINGS);
            }
            worst = larger(worst, between);
            if worst > FAR || worst.is_nan() {
                break;
            }
        }
        worst
    }

    /// A bound of the distance of a vertex from the chain of samples, as a share of what is allowed, at any phase, and of what
    /// lies between samples of that, as a share of the tolerance.
    #[inline(always)]
    fn vertices_off(
        &self,
        run: &Run<'_, L>,
        start: &Start<'_, L>,
        window: &Window<L>,
        period_s: f64,
    ) -> (f64, f64) {
        let from = start.s - AROUND;
        let to = window.end();
        let mut timer = Timer {
            marks: &window.marks,
            at: 0,
        };
        let mut worst = 0.0f64;
        let mut max_bulge = 0.0f64;
        let mut piece = 0;
        let mut passed = [0; 2];
        let mut i = run.chord_at(from, 0).max(1);
        while i < run.chords.len() && run.chords[i].s < to {
            let chord = &run.chords[i];
            let t = if chord.s <= start.s {
                0.0
            } else {
                timer.time(chord.s)
            };
            let tolerance = chord.tolerance.max(run.chords[i - 1].tolerance);
            while piece + 1 < window.pieces.len() && window.pieces[piece].end_s() < t {
                piece += 1;
            }
            if chord.s > from {
                let before = start.before.len();
                let (first, last) = self.order.around(chord.s, &mut passed);
                // Where the window begins the samples before it count too.
                let among = (if first == 0 { 0 } else { before + first }, before + last);
                let near = (t / period_s) as usize + before;
                let off = self.nearest_sample(near, among, &chord.start, tolerance);
                let mut bulge = self.bends[piece] * period_s * period_s / 8.0;
                if off + bulge > ALLOWED * tolerance {
                    bulge = self.bulge_around(window, piece, t, period_s);
                    max_bulge = larger(max_bulge, bulge / tolerance);
                }
                worst = larger(worst, (off + bulge) / (ALLOWED * tolerance));
                if worst > FAR || worst.is_nan() {
                    break;
                }
            }
            i += 1;
        }
        (worst, max_bulge)
    }

    /// How far the motion stands off the chain of samples around `t`: what turns it counts alone, as far as its direction is
    /// known for a period.
    fn bulge_around(&self, window: &Window<L>, near: usize, t: f64, period_s: f64) -> f64 {
        let around = near.saturating_sub(1)..(near + 2).min(self.bends.len());
        let bend = self.bends[around]
            .iter()
            .fold(0.0, |most, bend| larger(most, *bend));
        let piece = &window.pieces[near];
        let local = (t - piece.start_s).clamp(0.0, piece.duration_s);
        let v = piece.velocity(local);
        let a = piece.acceleration(local);
        let squared = dot(&v, &v);
        let along = dot(&v, &a);
        let across = (dot(&a, &a) - along * along / squared.max(1e-12))
            .max(0.0)
            .sqrt();
        let change = self.jerks[near] * period_s;
        let turned = (bend * period_s / squared.sqrt().max(1e-9)).min(1.0);
        (across + change + turned * bend).min(bend) * period_s * period_s / 8.0
    }

    /// The distance of `vertex` from the chain of those samples that may pass it, `among` which sample `near` is sought first.
    #[inline(always)]
    fn nearest_sample(
        &self,
        near: usize,
        (first, last): (usize, usize),
        vertex: &Lanes<L>,
        tolerance: f64,
    ) -> f64 {
        let last = last.min(self.samples.len() - 2);
        let first = first.min(last);
        let near = near.clamp(first, last);
        let enough = (NEAR_ENOUGH * tolerance).powi(2);
        let allowed = DEVIATION * tolerance;
        let mut best = f64::INFINITY;
        for step in 0..SEARCHED {
            let below = near.checked_sub(step).filter(|n| *n >= first);
            let above = near + step;
            if let Some(below) = below {
                best = smaller(
                    best,
                    to_chord(vertex, &self.samples[below], &self.samples[below + 1]),
                );
            }
            if above <= last && step > 0 {
                best = smaller(
                    best,
                    to_chord(vertex, &self.samples[above], &self.samples[above + 1]),
                );
            }
            // A few around, and then only as long as it is too far.
            if best < enough || step >= 3 && best <= allowed * allowed {
                break;
            }
            if below.is_none() && above > last {
                break;
            }
        }
        best.sqrt()
    }
}

/// Way before the start in which vertices are looked at again: the samples behind the start are new.
const AROUND: f64 = 0.05;

#[inline(always)]
pub fn larger(a: f64, b: f64) -> f64 {
    // Where either is no number, neither is the result.
    if b > a || b.is_nan() { b } else { a }
}

#[inline(always)]
fn smaller(a: f64, b: f64) -> f64 {
    if b < a { b } else { a }
}
