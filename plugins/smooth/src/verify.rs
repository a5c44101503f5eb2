//! The guarantee: every limit on the motion as it is emitted, from its start to its rest.
//!
//! Differences of samples are means of derivatives, so what holds for every instant of the quintics holds for samples at
//! any phase, and across windows, since position, velocity and acceleration are continuous. Derivatives, and positions near
//! the ends of the travel, are judged by bounds of the polynomials ([`crate::peaks`]). Distances are taken at samples a fine
//! period apart, with what the motion and the path can do between.

use tandem_motion::in_wide_instructions;
use tandem_motion::tube::Lanes;

use crate::chain::Chain;
use crate::feeds::Feeder;
use crate::frame::{Frame, dot, larger, minus, to_chord};
use crate::order::{Order, REACH};
use crate::path_distance::{
    ALLOWED, DEVIATION, FAR, HALVINGS, NEAR_ENOUGH, PathDistance, SEARCHED, closer, distance_bound,
    path_distance,
};
use crate::peaks::{
    ACCELERATION, JERK, Reached, SPEED, bound, derivatives, highest, positions, turning,
};
use crate::route::Run;
use crate::travel::Travel;
use crate::turns::Turns;
use crate::waypoints::Timer;
use crate::window::{Start, Stop, Window};

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
    /// Pieces that touch chords of several feeds, and are faster than the lowest of them.
    uneven: Vec<(usize, Reached)>,
    /// Where the path comes close to itself: how near each sample of the window is to its place on it, as a share of the tolerance.
    /// What lies between samples is left of it for those of another phase.
    nearness: Vec<f64>,
    order: Order,
    turns: Turns<L>,
    /// Of the samples with the places between them at which the motion turns.
    turned: Order,
}

impl<const L: usize> Default for Checker<L> {
    fn default() -> Self {
        Self {
            samples: Vec::new(),
            bends: Vec::new(),
            jerks: Vec::new(),
            uneven: Vec::new(),
            nearness: Vec::new(),
            order: Order::default(),
            turns: Turns::default(),
            turned: Order::default(),
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
        self.uneven.clear();
        let mut feeder = Feeder::new(run, counted, frame.period_s, start, window);
        let speed = &frame.speed[usize::from(run.rapid)];
        for n in 0..window.pieces.len() {
            let (least, feed) = feeder.range(window, n);
            let shares = derivatives(
                &window.pieces[n],
                frame,
                speed,
                counted,
                feed,
                &mut window.stop,
            );
            if least < feed && shares.feed * feed > least {
                self.uneven.push((n, shares));
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
        for (n, shares) in &self.uneven {
            let jerk = self.jerk_around(window, *n, frame.period_s, start, size_of_jerk);
            let feed = feeder.peak(window, *n, jerk);
            window.pieces[*n].bound = bound(&Reached { feed, ..*shares });
            checked.speed = larger(checked.speed, feed / SPEED);
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
        let is_close = is_close(run, (start.s, window.end()));
        checked.deviation = self.motion_off(run, window, frame.period_s, (before, is_close));
        if checked.deviation <= 1.0 {
            if !self.is_in_order(run, window, frame.period_s, before) {
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

    /// Whether the motion follows the path from its start to its end, at samples of any phase: those of this one have places in their
    /// order, and so have they with the places between them at which it turns.
    #[inline(always)]
    fn is_in_order(
        &mut self,
        run: &Run<'_, L>,
        window: &Window<L>,
        period_s: f64,
        before: usize,
    ) -> bool {
        let near = run.chord_at(window.marks[0].s, 0);
        let ends = (near, window.end());
        let samples = &self.samples;
        self.order
            .walk(run, (samples, &self.nearness), before, ends)
            && self
                .turns
                .among(run, window, &samples[before..], period_s)
                .is_none_or(|places| self.turned.walk(run, (places, &[]), 0, ends))
    }

    /// A bound of the jerk of samples whose way has its middle in piece `n`.
    fn jerk_around(
        &self,
        window: &Window<L>,
        n: usize,
        period_s: f64,
        start: &Start<'_, L>,
        limit: f64,
    ) -> f64 {
        let pieces = &window.pieces;
        let from_s = pieces[n].start_s - period_s / 2.0;
        let to_s = pieces[n].end_s() + period_s / 2.0;
        let first = pieces.partition_point(|piece| piece.end_s() <= from_s);
        let behind = pieces.partition_point(|piece| piece.start_s < to_s);
        let before = if from_s < 0.0 && !start.resting {
            JERK * limit
        } else {
            0.0
        };
        self.jerks[first..behind]
            .iter()
            .copied()
            .fold(before, larger)
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
    /// between two of this one is looked at again where it matters. Where the path `is_close` to itself, how near each sample is to be
    /// is noted.
    #[inline(always)]
    fn motion_off(
        &mut self,
        run: &Run<'_, L>,
        window: &Window<L>,
        period_s: f64,
        (before, is_close): (usize, bool),
    ) -> f64 {
        let mut worst = 0.0f64;
        let mut mark = 0;
        let mut piece = 0;
        let mut near = run.chord_at(window.marks[0].s, 0);
        let mut last: Option<PathDistance<L>> = None;
        let mut left_before = ALLOWED;
        self.nearness.clear();
        for (n, sample) in self.samples[before..].iter().enumerate() {
            let t = n as f64 * period_s;
            while mark + 2 < window.marks.len() && window.marks[mark + 1].t <= t {
                mark += 1;
            }
            let a = window.marks[mark];
            let b = window.marks[mark + 1];
            let s = a.s + (b.s - a.s) * ((t - a.t) / (b.t - a.t).max(1e-12)).clamp(0.0, 1.0);
            near = run.chord_at(s, near);
            let here = path_distance(run, near, sample);
            let Some(last) = last.replace(here) else {
                if is_close {
                    self.nearness.push(ALLOWED * here.share);
                }
                worst = here.share;
                continue;
            };
            let mut bend = self.bends[piece];
            while piece + 1 < window.pieces.len() && window.pieces[piece].end_s() < t {
                piece += 1;
                bend = larger(bend, self.bends[piece]);
            }
            let bulge = bend * period_s * period_s / 8.0;
            if is_close {
                let left = ALLOWED - bulge / run.chords[here.chord()].tolerance;
                self.nearness[n - 1] = larger(self.nearness[n - 1], left_before.min(left));
                self.nearness.push(ALLOWED * here.share);
                left_before = left;
            }
            let mut between = distance_bound(run, &last, &here, bulge);
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
        let mut worst = 0.0f64;
        let mut max_bulge = 0.0f64;
        let mut passed = [0; 2];
        let mut last_link = 0;
        let mut is_in_order = true;
        for Passing { chord: i, t, piece } in passings(run, start, window) {
            let chord = &run.chords[i];
            let tolerance = vertex_tolerance(run, i);
            let among = self.order.around(chord.s, &mut passed);
            let near = (t / period_s) as usize + start.before.len();
            let (off, link) = self.nearest_sample(near, among, &chord.start, tolerance);
            let mut bulge = self.bends[piece] * period_s * period_s / 8.0;
            if off + bulge > ALLOWED * tolerance {
                bulge = self.bulge_around(window, piece, t, period_s);
                max_bulge = larger(max_bulge, bulge / tolerance);
            }
            worst = larger(worst, (off + bulge) / (ALLOWED * tolerance));
            if worst > FAR || worst.is_nan() {
                break;
            }
            is_in_order &= link > last_link
                || link == last_link && self.goes_along(link, &run.chords[i - 1].direction);
            last_link = link;
        }
        if worst <= 1.0 && !is_in_order && !self.meets_in_order(run, start, window, period_s) {
            worst = FAR;
        }
        (worst, max_bulge)
    }

    /// Whether the motion goes in `direction` behind sample `link`, and not against it.
    #[inline(always)]
    fn goes_along(&self, link: usize, direction: &Lanes<L>) -> bool {
        dot(
            &minus(&self.samples[link + 1], &self.samples[link]),
            direction,
        ) >= 0.0
    }

    /// Whether the motion meets the vertices one behind the other: each at the first place that is near enough, behind that of the vertex
    /// before. Each by itself may be near a place that is passed at another time: where the path turns back and comes by again, a
    /// motion that goes straight on passes both ends of the fold, in the wrong order.
    fn meets_in_order(
        &self,
        run: &Run<'_, L>,
        start: &Start<'_, L>,
        window: &Window<L>,
        period_s: f64,
    ) -> bool {
        let mut passed = [0; 2];
        let mut chain = Chain::new(&self.samples);
        passings(run, start, window).all(|Passing { chord, t, piece }| {
            let bulge = self.bends[piece] * period_s * period_s / 8.0;
            let bulge = smaller(bulge, self.bulge_around(window, piece, t, period_s));
            let reach = ALLOWED * vertex_tolerance(run, chord) - bulge;
            let chord = &run.chords[chord];
            let among = self.order.around(chord.s, &mut passed);
            chain.goes_on(&chord.start, among, reach)
        })
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
        let local = (across + change + turned * bend).min(bend);
        // Where it brakes hard within a sample neither its speed nor its acceleration there says how far it turns.
        let pieces = &window.pieces;
        let first = pieces.partition_point(|piece| piece.end_s() < t - period_s);
        let last = pieces.partition_point(|piece| piece.start_s < t + period_s);
        let among = first.min(near)..last.max(near + 1);
        let (across, turned) = turning(&pieces[among.clone()]);
        let bend = self.bends[among]
            .iter()
            .fold(bend, |most, bend| larger(most, *bend));
        local.min(across + turned * bend) * period_s * period_s / 8.0
    }

    /// The distance of `vertex` from the chain of those samples that may pass it, among which sample `near` is sought first, and behind
    /// which of them it is that near.
    #[inline(always)]
    fn nearest_sample(
        &self,
        near: usize,
        (first, last): (usize, usize),
        vertex: &Lanes<L>,
        tolerance: f64,
    ) -> (f64, usize) {
        let last = last.min(self.samples.len() - 2);
        let first = first.min(last);
        let near = near.clamp(first, last);
        let enough = (NEAR_ENOUGH * tolerance).powi(2);
        let allowed = DEVIATION * tolerance;
        let mut best = (f64::INFINITY, near);
        for step in 0..SEARCHED {
            let below = near.checked_sub(step).filter(|n| *n >= first);
            let above = near + step;
            let sides = [below, Some(above).filter(|n| *n <= last && step > 0)];
            for link in sides.into_iter().flatten() {
                let off = to_chord(vertex, &self.samples[link], &self.samples[link + 1]);
                best = if off < best.0 { (off, link) } else { best };
            }
            // A few around, and then only as long as it is too far.
            if best.0 < enough || step >= 3 && best.0 <= allowed * allowed {
                break;
            }
            if below.is_none() && above > last {
                break;
            }
        }
        (best.0.sqrt(), best.1)
    }
}

/// Whether the path turns, and turns again, within a few tolerances somewhere between two path coordinates: of two vertices that are so
/// near each other a sample may be beside either.
#[inline(always)]
fn is_close<const L: usize>(run: &Run<'_, L>, (from, to): (f64, f64)) -> bool {
    let chords = &run.chords[run.chord_at(from, 0)..];
    chords
        .iter()
        .take_while(|chord| chord.s < to)
        .any(|chord| chord.length < REACH * chord.tolerance && chord.turn > TURNS)
}

/// A turn by more than this is one by which the path may come close to itself.
const TURNS: f64 = 0.1;

/// Way before the start, mm, in which vertices are looked at again: the samples behind the start are new.
const AROUND: f64 = 0.05;

/// A vertex that the motion passes: the chord that it is the start of, when it is to be passed, and the piece of that time.
struct Passing {
    chord: usize,
    t: f64,
    piece: usize,
}

/// The vertices of a window, in their order.
#[inline(always)]
fn passings<const L: usize>(
    run: &Run<'_, L>,
    start: &Start<'_, L>,
    window: &Window<L>,
) -> impl Iterator<Item = Passing> {
    let from = start.s - AROUND;
    let to = window.end();
    let mut timer = Timer {
        marks: &window.marks,
        at: 0,
    };
    let mut piece = 0;
    let first = run.chord_at(from, 0).max(1);
    let chords = run.chords[first.min(run.chords.len())..].iter();
    let among = (first..)
        .zip(chords)
        .take_while(move |(_, chord)| chord.s < to);
    among
        .filter(move |(_, chord)| chord.s > from)
        .map(move |(n, chord)| {
            let t = if chord.s <= start.s {
                0.0
            } else {
                timer.time(chord.s)
            };
            while piece + 1 < window.pieces.len() && window.pieces[piece].end_s() < t {
                piece += 1;
            }
            Passing { chord: n, t, piece }
        })
}

/// How far the vertex at the start of chord `i` may be passed.
#[inline(always)]
fn vertex_tolerance<const L: usize>(run: &Run<'_, L>, i: usize) -> f64 {
    run.chords[i].tolerance.max(run.chords[i - 1].tolerance)
}

#[inline(always)]
fn smaller(a: f64, b: f64) -> f64 {
    if b < a { b } else { a }
}

#[cfg(test)]
#[path = "verify_tests.rs"]
mod tests;
