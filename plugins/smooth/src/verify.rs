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
use crate::order::{Order, REACH};
use crate::peaks::{bound, derivatives, highest, positions, turning};
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
    /// Where the path comes close to itself: how near each sample of the window is to its place on it, as a share of the tolerance.
    /// What lies between samples is left of it for those of another phase.
    nearness: Vec<f64>,
    order: Order,
}

impl<const L: usize> Default for Checker<L> {
    fn default() -> Self {
        Self {
            samples: Vec::new(),
            bends: Vec::new(),
            jerks: Vec::new(),
            nearness: Vec::new(),
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
        let is_close = is_close(run, (start.s, window.end()));
        checked.deviation = self.motion_off(run, window, frame.period_s, (before, is_close));
        if checked.deviation <= 1.0 {
            let near = run.chord_at(window.marks[0].s, 0);
            let nearness = &self.nearness;
            if !self
                .order
                .walk(run, (&self.samples, nearness), before, (near, window.end()))
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
        let mut last: Option<Beside<L>> = None;
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
            let here = beside(run, near, sample);
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
                let among = self.order.around(chord.s, &mut passed);
                let near = (t / period_s) as usize + start.before.len();
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

#[inline(always)]
pub fn larger(a: f64, b: f64) -> f64 {
    // Where either is no number, neither is the result.
    if b > a || b.is_nan() { b } else { a }
}

#[inline(always)]
fn smaller(a: f64, b: f64) -> f64 {
    if b < a { b } else { a }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::order::tests::{lines, open};
    use crate::route::Chord;
    use crate::timing::Mark;
    use crate::window::{Piece, State};
    use tandem_rig::Random;

    const TOLERANCE: f64 = 0.1;
    const PERIOD_S: f64 = 0.001;

    /// Chords of this feed through `points`.
    fn path(points: &[[f64; 2]], feed: f64) -> Vec<Chord<2>> {
        let mut chords = lines(points);
        for chord in &mut chords {
            (chord.feed, chord.pace) = (feed, feed);
            chord.tolerance = TOLERANCE;
            chord.speed = feed;
        }
        chords
    }

    /// 100 mm/s in feed motion and 200 mm/s in rapids, 1000 mm/s² and 20 000 mm/s³.
    fn frame() -> Frame<2> {
        let axis = tandem_sdk::AxisLimits {
            feed_mm_per_s: 100.0,
            rapid_mm_per_s: 200.0,
            jerk_mm_per_s3: 20_000.0,
            ..tandem_rig::axis(1000.0)
        };
        Frame::new(&tandem_rig::context(&[axis; 2], PERIOD_S))
    }

    /// One quintic from rest to rest.
    fn rest_to_rest(from: [f64; 2], to: [f64; 2], duration_s: f64, end: f64) -> Window<2> {
        let rest = |at: [f64; 2]| [at, [0.0; 2], [0.0; 2]];
        let mut window = Window::new();
        let piece = Piece::between(&rest(from), &rest(to), 0.0, duration_s);
        window.pieces.push(piece);
        window.marks = vec![
            Mark { t: 0.0, s: 0.0 },
            Mark {
                t: duration_s,
                s: end,
            },
        ];
        window
    }

    fn start(state: State<2>) -> Start<'static, 2> {
        Start {
            state,
            s: 0.0,
            resting: true,
            before: &[],
            end: 10.0,
            window_s: 1.0,
            old: None,
        }
    }

    fn check(run: &Run<'_, 2>, window: &mut Window<2>, travel: Option<&Travel<2>>) -> Checked {
        let state = window.pieces[0].state(0.0);
        Checker::default().check(run, &frame(), &[1.0; 2], &start(state), (window, travel))
    }

    fn assert_near(value: f64, expected: f64) {
        let most = 2e-4 * expected.abs().max(1e-3);
        assert!((value - expected).abs() < most, "{value}, not {expected}");
    }

    /// From rest to rest over 10 mm in T a quintic reaches 15/8·10/T, 10/√3·10/T² and, at its ends, 60·10/T³.
    #[test]
    fn what_is_checked_are_the_shares_of_all_limits() {
        let mut chords = path(&[[0.0, 0.0], [5.0, 0.0], [10.0, 0.0]], 50.0);
        for (t, off) in [(0.2_f64, 0.02), (0.15, 0.0)] {
            let mut window = rest_to_rest([0.0, off], [10.0, off], t, 10.0);
            let checked = check(&open(&chords), &mut window, None);
            assert_near(checked.speed, 18.75 / t / 50.0);
            let acceleration = 100.0 / 3.0_f64.sqrt() / (t * t);
            assert_near(checked.acceleration, acceleration / (1000.0 * ACCELERATION));
            assert_near(checked.jerk, 600.0 / t.powi(3) / (20_000.0 * JERK));
            // Between samples it may stand off by what the hull of its acceleration can do in a period.
            let bulge = 200.0 / (t * t) * PERIOD_S * PERIOD_S / 8.0;
            assert_near(checked.deviation, (off + bulge) / (ALLOWED * TOLERANCE));
            assert!(!checked.passes(), "{checked:?}");
        }
        // What is slow enough is known not to be above its limits, and no more than that.
        let mut window = rest_to_rest([0.0, 0.05], [10.0, 0.05], 1.0, 10.0);
        let checked = check(&open(&chords), &mut window, None);
        assert!(
            checked.passes() && checked.speed >= 18.75 / 50.0,
            "{checked:?}"
        );
        let mut window = rest_to_rest([0.0, 0.2], [10.0, 0.2], 1.0, 10.0);
        assert!(!check(&open(&chords), &mut window, None).passes());
        // A rapid has no feed, and the limits of rapids.
        for chord in &mut chords {
            chord.feed = f64::INFINITY;
        }
        let rapid = Run {
            rapid: true,
            ..open(&chords)
        };
        let mut window = rest_to_rest([0.0; 2], [10.0, 0.0], 0.08, 10.0);
        let speed = 18.75 / 0.08;
        assert_near(check(&rapid, &mut window, None).speed, speed / 200.0);
        assert_near(
            check(&open(&chords), &mut window, None).speed,
            speed / 100.0,
        );
    }

    /// Faster than the feed of the second half: the motion is judged beside each chord, in sixteen places.
    #[test]
    fn a_piece_over_two_feeds_keeps_each_where_it_is() {
        let mut chords = path(&[[0.0, 0.0], [5.0, 0.0], [10.0, 0.0]], 50.0);
        chords[1].feed = 20.0;
        let t = 0.6_f64;
        let mut window = rest_to_rest([0.0; 2], [10.0, 0.0], t, 10.0);
        let checked = check(&open(&chords), &mut window, None);
        // Just behind the vertex, nine sixteenths of the way, with what jerk can add between two places.
        let share = 9.0_f64 / 16.0;
        let speed = 30.0 * (share * (1.0 - share)).powi(2) * 10.0 / t;
        // The hull of a parabola from 1 to −1/2 and back is twice as high as it is.
        let jerk = 2.0 * 600.0 / t.powi(3) * 2.0_f64.sqrt();
        let between = jerk * (t / 16.0).powi(2) / 8.0;
        assert_near(checked.speed, (speed + between) / 20.0);
        // The other way round the slow half is behind it.
        chords.swap(0, 1);
        chords[0] = Chord {
            start: [0.0; 2],
            s: 0.0,
            ..chords[0]
        };
        chords[1] = Chord {
            start: [5.0, 0.0],
            s: 5.0,
            ..chords[1]
        };
        let checked = check(&open(&chords), &mut window, None);
        // At seven sixteenths, just before the vertex; the vertex itself is within half a period of the faster one.
        assert_near(checked.speed, (speed + between) / 20.0);
    }

    #[test]
    fn a_motion_beyond_the_travel_is_beyond_it_by_as_much() {
        let chords = path(&[[0.0, 0.0], [10.0, 0.0]], 50.0);
        let axis = |max_mm: f64| tandem_sdk::AxisLimits {
            max_mm,
            ..tandem_rig::axis(1000.0)
        };
        let machine = tandem_rig::context(&[axis(9.9), axis(100.0)], PERIOD_S);
        let travel = Travel::new(&machine, &[1.0; 2]);
        let mut window = rest_to_rest([0.0; 2], [10.0, 0.0], 1.0, 10.0);
        let checked = check(&open(&chords), &mut window, Some(&travel));
        assert_near(checked.travel, 0.1);
        assert!(!checked.passes());
        let mut shorter = rest_to_rest([0.0; 2], [9.9, 0.0], 1.0, 9.9);
        let checked = check(&open(&chords), &mut shorter, Some(&travel));
        assert!(checked.passes(), "{checked:?}");
    }

    #[test]
    fn what_is_too_large_alone_or_no_number_does_not_pass() {
        let kept = Checked {
            speed: 1.0,
            acceleration: 1.0,
            jerk: 1.0,
            deviation: 1.0,
            bulge: 0.0,
            travel: 0.0,
        };
        assert!(kept.passes());
        let set: [fn(&mut Checked, f64); 5] = [
            |checked, value| checked.speed = value,
            |checked, value| checked.acceleration = value,
            |checked, value| checked.jerk = value,
            |checked, value| checked.deviation = value,
            |checked, value| checked.travel = value,
        ];
        for set in set {
            for value in [1.0 + 1e-9, f64::INFINITY, f64::NAN] {
                let mut checked = kept;
                set(&mut checked, value);
                assert!(!checked.passes(), "{checked:?}");
                assert_eq!(checked.is_finite(), value.is_finite(), "{checked:?}");
            }
        }
        let chords = path(&[[0.0, 0.0], [10.0, 0.0]], 50.0);
        let mut window = rest_to_rest([0.0; 2], [10.0, 0.0], 1.0, 10.0);
        window.pieces[0].c[3][1] = f64::NAN;
        assert!(!check(&open(&chords), &mut window, None).passes());
        assert!(larger(1.0, f64::NAN).is_nan() && larger(f64::NAN, 1.0).is_nan());
        assert_eq!((larger(1.0, 2.0), larger(2.0, 1.0)), (2.0, 2.0));
        assert_eq!((smaller(1.0, 2.0), smaller(2.0, 1.0)), (1.0, 1.0));
    }

    /// From rest to rest on three lines that cut off the corner of [0, 5] and [5, 0].
    fn over_a_corner(cut: f64) -> Window<2> {
        let rest = |at: [f64; 2]| [at, [0.0; 2], [0.0; 2]];
        let corners = [[0.0, 0.0], [5.0 - cut, 0.0], [5.0, cut], [5.0, 5.0]];
        let places = [0.0, 5.0 - cut, 5.0 + cut, 10.0];
        let mut window = Window::new();
        for (n, pair) in (0_u32..).zip(corners.windows(2)) {
            let piece = Piece::between(&rest(pair[0]), &rest(pair[1]), f64::from(n), 1.0);
            window.pieces.push(piece);
        }
        window.marks = (0_u32..)
            .zip(places)
            .map(|(n, s)| Mark { t: n.into(), s })
            .collect();
        window
    }

    /// The vertex stands off the diagonal between the places before and behind it.
    #[test]
    fn a_vertex_that_is_cut_off_counts_as_far_as_it_stands_off() {
        let chords = path(&[[0.0, 0.0], [5.0, 0.0], [5.0, 5.0]], 50.0);
        let run = open(&chords);
        for cut in [0.05, 0.1, 0.13, 0.15] {
            let mut window = over_a_corner(cut);
            let start = start(window.pieces[0].state(0.0));
            let mut checker = Checker::default();
            let found = (&mut window, None);
            let checked = checker.check(&run, &frame(), &[1.0; 2], &start, found);
            let allowed = ALLOWED * TOLERANCE;
            if checked.deviation <= 1.0 {
                let (off, bulge) = checker.vertices_off(&run, &start, &window, PERIOD_S);
                let vertex = cut / 2.0_f64.sqrt() / allowed;
                assert!(
                    (vertex - 1e-9..vertex + 1e-3).contains(&off),
                    "{vertex}: {off}"
                );
                assert_eq!(bulge, 0.0);
            }
            // In the middle the motion stands half of the cut off both lines, and the vertex off the line between these two feet.
            let between = (cut / 2.0 + cut / 8.0_f64.sqrt()) / allowed;
            assert!(
                between > 1.0 || (checked.deviation - between).abs() < 1e-3,
                "{between}: {checked:?}"
            );
            assert_eq!(checked.passes(), cut < 0.14, "{cut}: {checked:?}");
        }
    }

    #[test]
    fn the_nearest_sample_is_looked_for_around_the_place_and_farther_while_it_is_too_far() {
        // Chords along X at these distances from the vertex; what leads from one to the next is far away.
        let nearest = |distances: &[f64], near: usize, among: (usize, usize)| {
            let samples = distances.iter().enumerate().flat_map(|(n, off)| {
                let far = if n % 2 == 0 { 1e3 } else { -1e3 };
                [[-far, *off], [far, *off]]
            });
            let checker = Checker::<2> {
                samples: samples.collect(),
                ..Checker::default()
            };
            let among = (2 * among.0, 2 * among.1);
            checker.nearest_sample(2 * near, among, &[0.0; 2], 1.0)
        };
        let row = |middle: f64, next: f64, others: f64| {
            let mut row = [others; 9];
            row[3..6].copy_from_slice(&[next, middle, next]);
            row
        };
        // Near enough at once; then not, and the next one is nearer.
        assert_near(nearest(&row(0.3, 0.1, 0.1), 4, (0, 8)), 0.3);
        assert_near(nearest(&row(0.6, 0.4, 2.0), 4, (0, 8)), 0.4);
        // Within what is allowed nothing farther is looked for, beyond it is.
        assert_near(nearest(&row(0.94, 0.96, 0.5), 4, (0, 8)), 0.94);
        assert_near(nearest(&row(2.0, 2.0, 0.5), 4, (0, 8)), 0.5);
        // What is not among them does not count.
        assert_near(nearest(&row(0.1, 0.6, 2.0), 4, (5, 8)), 0.6);
        assert_near(nearest(&row(0.1, 0.6, 2.0), 4, (0, 3)), 0.6);
    }

    /// A brute search over the same samples never finds a nearer one where what was found is too far.
    #[test]
    fn no_nearer_sample_is_overlooked_where_it_matters() {
        let mut random = Random::from_the_clock();
        for _ in 0..2000 {
            let samples: Vec<[f64; 2]> = (0..20)
                .map(|n| [f64::from(n), random.between(-1.5, 1.5)])
                .collect();
            let first = random.below(10) as usize;
            let last = first + random.below(10) as usize;
            let near = random.below(20) as usize;
            let vertex = [random.between(0.0, 19.0), random.between(-1.5, 1.5)];
            let checker = Checker::<2> {
                samples,
                ..Checker::default()
            };
            let found = checker.nearest_sample(near, (first, last), &vertex, 1.0);
            let off = |n: usize| to_chord(&vertex, &checker.samples[n], &checker.samples[n + 1]);
            let least = |from: usize, to: usize| (from..=to).map(off).fold(f64::INFINITY, f64::min);
            let best = least(first, last.min(18)).sqrt();
            assert!(found >= best);
            assert!(
                found <= DEVIATION || found == best,
                "{found}, {best}: {near} in {first} to {last}"
            );
            // Three places on each side are looked at in any case, unless one is near enough.
            let at = near.clamp(first, last.min(18));
            let around = least(at.saturating_sub(3).max(first), (at + 3).min(last.min(18)));
            assert!(found <= around.sqrt() || found < NEAR_ENOUGH);
        }
    }

    /// From rest to rest in two samples, beside a line by a hundredth of its length: all of the acceleration is along it, but for as much.
    #[test]
    fn a_motion_that_brakes_within_a_sample_turns_no_more_than_it_does() {
        for off in [0.0, 0.01] {
            let mut window = rest_to_rest([0.0; 2], [1.0, 0.0], 2.0 * PERIOD_S, 1.0);
            // As far aside at its middle.
            let rest = [[0.0; 2]; 3];
            let aside = Piece::between(&rest, &[[0.0, off], [0.0; 2], [0.0; 2]], 0.0, PERIOD_S);
            let back = Piece::between(&rest, &[[0.0, -off], [0.0; 2], [0.0; 2]], 0.0, PERIOD_S);
            let middle = window.pieces[0].state(PERIOD_S);
            let end = window.pieces[0].state(2.0 * PERIOD_S);
            let halves = [([[0.0; 2]; 3], middle, aside), (middle, end, back)];
            window.pieces.clear();
            for (n, (from, to, across)) in (0_u32..).zip(halves) {
                let mut piece = Piece::between(&from, &to, f64::from(n) * PERIOD_S, PERIOD_S);
                for (c, of_across) in piece.c.iter_mut().zip(&across.c) {
                    c[1] += of_across[1];
                }
                piece.c[0][1] += f64::from(n) * off;
                window.pieces.push(piece);
            }
            let size = |t: f64| {
                let a = window.state(t)[2];
                dot(&a, &a).sqrt()
            };
            let bend = (0..=200)
                .map(|n| size(f64::from(n) * 1e-5))
                .fold(0.0, larger);
            let checker = Checker::<2> {
                bends: vec![bend; 2],
                jerks: vec![1e12; 2],
                ..Checker::default()
            };
            let bulge = checker.bulge_around(&window, 0, PERIOD_S, PERIOD_S);
            let most = bend * PERIOD_S * PERIOD_S / 8.0;
            assert!(bulge <= 30.0 * off * most + 1e-12, "{bulge} of {most}");
            assert!(bulge >= 0.5 * off * most, "{bulge} of {most}");
        }
    }

    /// At 10 mm/s with 30 mm/s² along the motion and 40 across it, beside pieces of 100 mm/s² and a jerk of 2000.
    #[test]
    fn between_two_samples_counts_what_turns_the_motion() {
        let state = |v: f64, a: [f64; 2]| {
            let mut window = Window::<2>::new();
            for n in 0..4 {
                let mut piece = Piece::between(&[[0.0; 2]; 3], &[[0.0; 2]; 3], f64::from(n), 1.0);
                // Half a second on in piece 1 it has this state.
                piece.c[1] = if n == 1 {
                    [v - 0.5 * a[0], -0.5 * a[1]]
                } else {
                    [1e3; 2]
                };
                piece.c[2] = if n == 1 {
                    [a[0] / 2.0, a[1] / 2.0]
                } else {
                    [1e3; 2]
                };
                window.pieces.push(piece);
            }
            window
        };
        let checker = Checker::<2> {
            bends: vec![60.0, 50.0, 100.0, 1e6],
            jerks: vec![1e6, 2000.0, 1e6, 1e6],
            ..Checker::default()
        };
        let bulge = |v: f64, a: [f64; 2]| {
            checker.bulge_around(&state(v, a), 1, 1.5, PERIOD_S) / (1e-6 / 8.0)
        };
        // 40 across, 2 by the jerk of a period, and a turn of 0.01 of 100 mm/s².
        assert_near(bulge(10.0, [30.0, 40.0]), 43.0);
        assert_near(bulge(10.0, [-30.0, -40.0]), 43.0);
        assert_near(bulge(10.0, [30.0, 0.0]), 3.0);
        // Never more than all there is; at rest the direction is not known.
        assert_near(bulge(10.0, [0.0, 150.0]), 100.0);
        assert_near(bulge(1e-12, [1.0, 1.0]), 100.0);
        assert_near(bulge(0.5, [0.0, 1.0]), 1.0 + 2.0 + 20.0);
    }
}
