//! The feeds along a window: what an interval may have before it is planned, and what a piece of motion has of it.

use tandem_motion::tube::{Lanes, Waypoint, each};

use crate::frame::{dot, larger, minus};
use crate::route::Run;
use crate::window::{Piece, Start, Window};

/// The pace of intervals, asked for in order: the lowest of the chords whose waypoints lie in or next to one. A vertex has both
/// of its chords: speed at the end of an interval is what the next one allows.
pub struct Feeds<'a, const L: usize> {
    pub run: &'a Run<'a, L>,
    /// Path coordinates and chords of the waypoints.
    pub along: &'a [(f64, u32)],
    pub waypoints: &'a [Waypoint<L>],
    pub at: usize,
}

impl<const L: usize> Feeds<'_, L> {
    /// The pace of interval `k`.
    #[inline(always)]
    pub fn of(&mut self, k: usize) -> f64 {
        while self.at + 1 < self.waypoints.len()
            && (self.waypoints[self.at + 1].interval as usize) < k
        {
            self.at += 1;
        }
        let mut feed = f64::INFINITY;
        let mut n = self.at;
        while n < self.waypoints.len() {
            let s = self.along[n].0;
            let chord = self.along[n].1 as usize;
            feed = feed.min(self.run.chords[chord].pace);
            if chord > 0 && s <= self.run.chords[chord].s {
                feed = feed.min(self.run.chords[chord - 1].pace);
            }
            if (self.waypoints[n].interval as usize) > k {
                break;
            }
            n += 1;
        }
        if feed.is_infinite() && self.waypoints.is_empty() {
            feed = self
                .run
                .chords
                .iter()
                .fold(f64::INFINITY, |least, chord| least.min(chord.pace));
        }
        feed
    }
}

/// Parts of a piece at whose ends its speed is looked at first.
const PARTS: usize = 8;
/// Halvings of a part at most: a motion that brakes into a lower feed is then known to a few nanoseconds.
const HALVINGS: u32 = 16;
/// Speed, lane units per s, below which rounding says where the motion goes: it stands, and the marks say which chord it is on.
const STANDS: f64 = 1e-6;

/// The speed of a motion beside the feeds of the chords that it is on.
///
/// What a sample shows of the speed is its way from the sample before, over the period, and it may have the highest feed of the
/// chords which that way touches. Of samples of every phase this is a function of the time in the middle of the way, and its bound is
/// exact: between two looks that are `h` apart the way is off a line from one to the other by no more than jerk adds, which is
/// J·h²/8 of the speed, and touches at least what lies between where the later look begins and where the earlier one ends. Where that
/// does not decide it, the time between them is halved.
pub struct Feeder<'a, const L: usize> {
    run: &'a Run<'a, L>,
    counted: &'a Lanes<L>,
    period_s: f64,
    /// The window that goes on in the one that is judged, and when.
    old: Option<(&'a Window<L>, f64)>,
    /// The feed of all chords that the window comes near, where it is one.
    even: Option<f64>,
    /// Where chords were looked up last.
    chord: usize,
}

/// The way of a sample of which `t` is in the middle.
#[derive(Clone, Copy)]
struct Look {
    t: f64,
    speed: f64,
    /// The chords on which it begins and ends.
    chords: [usize; 2],
}

impl<'a, const L: usize> Feeder<'a, L> {
    pub fn new(
        run: &'a Run<'a, L>,
        counted: &'a Lanes<L>,
        period_s: f64,
        start: &Start<'a, L>,
        window: &Window<L>,
    ) -> Self {
        let mut feeder = Self {
            run,
            counted,
            period_s,
            old: start.old,
            even: None,
            chord: run.chord_at(start.s, 0),
        };
        let first = feeder.chord_at(window, -period_s / 2.0);
        let last = feeder.chord_at(window, window.duration_s());
        let (least, most) = feeder.feeds(first, last);
        feeder.even = (least >= most).then_some(most);
        feeder.chord = first;
        feeder
    }

    /// The lowest and the highest feed of the chords which the ways of samples touch that have their middle in piece `n`.
    pub fn range(&mut self, window: &Window<L>, n: usize) -> (f64, f64) {
        if let Some(feed) = self.even {
            return (feed, feed);
        }
        let piece = &window.pieces[n];
        let [from, to] = self.touched(window, [piece.start_s, piece.end_s()]);
        self.chord = from;
        self.feeds(from, to)
    }

    /// The highest share of its feed that a sample has whose way has its middle in piece `n`, where no jerk is larger than `jerk`:
    /// a bound of it where that is at most 1.
    pub fn peak(&self, window: &Window<L>, n: usize, jerk: f64) -> f64 {
        let piece = &window.pieces[n];
        let part_s = piece.duration_s / PARTS as f64;
        let looks: [Look; PARTS + 1] =
            std::array::from_fn(|part| self.look(window, piece.start_s + part as f64 * part_s));
        let most = looks
            .iter()
            .fold(0.0, |most, look| larger(most, self.share(look)));
        if most > 1.0 || most.is_nan() {
            return most;
        }
        looks.windows(2).fold(0.0, |most, pair| {
            larger(
                most,
                self.between(window, [&pair[0], &pair[1]], jerk, HALVINGS),
            )
        })
    }

    fn between(&self, window: &Window<L>, [a, b]: [&Look; 2], jerk: f64, left: u32) -> f64 {
        let apart_s = b.t - a.t;
        let speed = larger(a.speed, b.speed) + jerk * apart_s * apart_s / 8.0;
        let (first, last) = (b.chords[0], a.chords[1]);
        let (least, most) = self.feeds(first, last);
        // Where they are more than a period apart, a way between them may touch any one of the chords between.
        let share = speed / if first <= last { most } else { least };
        if share <= 1.0 || left == 0 || share.is_nan() {
            return share;
        }
        let middle = self.look(window, f64::midpoint(a.t, b.t));
        let here = self.share(&middle);
        if here > 1.0 {
            return here;
        }
        larger(
            self.between(window, [a, &middle], jerk, left - 1),
            self.between(window, [&middle, b], jerk, left - 1),
        )
    }

    fn look(&self, window: &Window<L>, t: f64) -> Look {
        let ends = [t - self.period_s / 2.0, t + self.period_s / 2.0];
        let [from, to] = ends.map(|t| self.position(window, t));
        let way: Lanes<L> = each(|l| self.counted[l] * (to[l] - from[l]));
        Look {
            t,
            speed: dot(&way, &way).sqrt() / self.period_s,
            chords: self.touched(window, [t, t]),
        }
    }

    /// The share that a sample has of the highest feed of its way.
    fn share(&self, look: &Look) -> f64 {
        look.speed / self.feeds(look.chords[0], look.chords[1]).1
    }

    /// The lowest and the highest feed between two chords.
    fn feeds(&self, a: usize, b: usize) -> (f64, f64) {
        let chords = &self.run.chords[a.min(b)..=a.max(b)];
        let none = (f64::INFINITY, 0.0);
        chords.iter().fold(none, |(least, most), chord| {
            (chord.feed.min(least), chord.feed.max(most))
        })
    }

    /// The chords on which the ways of samples begin and end whose middles are between two times.
    fn touched(&self, window: &Window<L>, [from_s, to_s]: [f64; 2]) -> [usize; 2] {
        [
            self.chord_at(window, from_s - self.period_s / 2.0),
            self.chord_at(window, to_s + self.period_s / 2.0),
        ]
    }

    fn position(&self, window: &Window<L>, t: f64) -> Lanes<L> {
        let (piece, t) = self.piece_at(window, t);
        piece.position(t)
    }

    /// The piece in which the motion is, and the time in it.
    fn piece_at<'w>(&self, window: &'w Window<L>, t: f64) -> (&'w Piece<L>, f64)
    where
        'a: 'w,
    {
        let (window, t) = match self.old {
            Some((old, now_s)) if t < 0.0 => (old, now_s + t),
            _ => (window, t),
        };
        let piece = &window.pieces[window.piece_at(t)];
        (piece, (t - piece.start_s).clamp(0.0, piece.duration_s))
    }

    /// The chord that the motion is on: the marks know it to a few periods, and from there on it goes by the planes that halve the
    /// angles at vertices, on either side of which one of the two chords is the nearer one. Where the path turns back, both are near on
    /// either side, and a motion that cuts the corner may never pass the plane: it is on the second when it moves away from the vertex. At the
    /// rest that a window ends in it moves nowhere.
    fn chord_at(&self, window: &Window<L>, t: f64) -> usize {
        let chords = self.run.chords;
        let (piece, piece_t) = self.piece_at(window, t);
        let at = piece.position(piece_t);
        let marked = self.run.chord_at(window.along(t), self.chord);
        let is_passed = |vertex: usize| {
            let [before, behind] = [&chords[vertex - 1], &chords[vertex]];
            let way = minus(&at, &behind.start);
            if before.turns_back_to(behind) {
                let velocity = piece.velocity(piece_t);
                let stands = dot(&velocity, &velocity) <= STANDS * STANDS;
                return if stands {
                    vertex <= marked
                } else {
                    dot(&way, &velocity) > 0.0
                };
            }
            dot(&way, &before.direction) + dot(&way, &behind.direction) > 0.0
        };
        let mut i = marked;
        while i > 0 && !is_passed(i) {
            i -= 1;
        }
        while i >= marked && i + 1 < chords.len() && is_passed(i + 1) {
            i += 1;
        }
        i
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::order::tests::{lines, open};
    use crate::route::Chord;
    use crate::timing::Mark;
    use crate::window::Piece;

    /// Chords of 1 mm each with these feeds, and waypoints at these places in these intervals.
    fn asked(feeds: &[f64], waypoints: &[(f64, u32)], intervals: usize) -> Vec<f64> {
        let points: Vec<_> = (0_u32..)
            .take(feeds.len() + 1)
            .map(|n| [f64::from(n), 0.0])
            .collect();
        let mut chords = lines(&points);
        for (chord, feed) in chords.iter_mut().zip(feeds) {
            (chord.feed, chord.pace) = (*feed, *feed);
        }
        let run = open(&chords);
        let along: Vec<_> = waypoints
            .iter()
            .map(|(s, _)| (*s, run.chord_at(*s, 0) as u32))
            .collect();
        let waypoints: Vec<_> = waypoints
            .iter()
            .map(|(_, interval)| Waypoint {
                interval: *interval,
                z: 0.5,
                point: [0.0; 2],
                half: [1.0; 2],
            })
            .collect();
        let mut feeds = Feeds {
            run: &run,
            along: &along,
            waypoints: &waypoints,
            at: 0,
        };
        (0..intervals).map(|k| feeds.of(k)).collect()
    }

    #[test]
    fn an_interval_has_the_lowest_feed_of_its_waypoints_and_of_one_on_either_side() {
        let feeds = [50.0, 20.0, 70.0, 90.0];
        // A waypoint in each: the one before counts, and the one behind.
        let each = [(0.5, 0), (1.5, 1), (2.5, 2), (3.5, 3)];
        assert_eq!(asked(&feeds, &each, 4), [20.0, 20.0, 20.0, 70.0]);
        // Two in one interval, and none in others.
        let some = [(0.5, 0), (0.7, 2), (2.5, 2), (3.2, 5), (3.6, 6)];
        assert_eq!(
            asked(&feeds, &some, 7),
            [50.0, 50.0, 50.0, 70.0, 70.0, 70.0, 90.0]
        );
        // One on a vertex has the feeds of both of its chords; one just behind it has not.
        assert_eq!(asked(&feeds, &[(3.0, 0), (3.5, 1)], 2), [70.0, 70.0]);
        assert_eq!(asked(&feeds, &[(3.1, 0), (3.5, 1)], 2), [90.0, 90.0]);
        // Without waypoints the lowest of all counts.
        assert_eq!(asked(&feeds, &[], 2), [20.0, 20.0]);
    }

    fn rest_at_start() -> Start<'static, 2> {
        Start {
            state: [[0.0; 2]; 3],
            s: 0.0,
            resting: true,
            before: &[],
            end: 10.0,
            window_s: 1.0,
            old: None,
        }
    }

    /// Pieces of 1 s from one of these places on X to the next, each at its mean speed.
    fn level(places: &[f64]) -> Window<2> {
        let mut window = Window::<2>::new();
        for (n, ends) in places.windows(2).enumerate() {
            let state = |x: f64| [[x, 0.0], [ends[1] - ends[0], 0.0], [0.0; 2]];
            let piece = Piece::between(&state(ends[0]), &state(ends[1]), n as f64, 1.0);
            window.pieces.push(piece);
        }
        window.marks = places
            .iter()
            .enumerate()
            .map(|(n, s)| Mark { t: n as f64, s: *s })
            .collect();
        window
    }

    /// Lines on X from one of these places to the next with feeds of their own.
    fn fed(places: &[f64], feeds: &[f64]) -> Vec<Chord<2>> {
        let points: Vec<_> = places.iter().map(|x| [*x, 0.0]).collect();
        let mut chords = lines(&points);
        for (chord, feed) in chords.iter_mut().zip(feeds) {
            chord.feed = *feed;
        }
        chords
    }

    /// Where the motion is counts, and not where the marks say that it is.
    #[test]
    fn a_piece_has_the_feeds_of_the_chords_that_its_samples_touch() {
        let chords = fed(&[0.0, 5.0, 7.0, 10.0], &[50.0, 20.0, 70.0]);
        let run = open(&chords);
        for late in [0.0, 0.9, -0.9] {
            let mut window = level(&[0.0, 4.9, 6.0, 10.0]);
            for mark in &mut window.marks[1..3] {
                mark.s += late;
            }
            let mut feeder = Feeder::new(&run, &[1.0; 2], 1e-3, &rest_at_start(), &window);
            let ranges = [0, 1, 2].map(|n| feeder.range(&window, n));
            assert_eq!(ranges, [(50.0, 50.0), (20.0, 50.0), (20.0, 70.0)], "{late}");
            // A period of samples that is so long touches the chords beside a piece too.
            let mut feeder = Feeder::new(&run, &[1.0; 2], 0.5, &rest_at_start(), &window);
            assert_eq!(feeder.range(&window, 0), (20.0, 50.0), "{late}");
        }
    }

    /// A motion brakes evenly over the place where the feed falls from 10 to 5 mm/s, and with 4 mm/s² comes to 5 mm/s there, `late_s`
    /// behind it or as long before it.
    fn share_of_feed(late_s: f64) -> f64 {
        const BRAKING: f64 = 4.0;
        let at = 5.0;
        let chords = fed(&[0.0, at, 20.0], &[10.0, 5.0]);
        let run = open(&chords);
        let state = |t: f64| {
            let slower = t - 1.0 - late_s;
            // Where the lower feed begins after 1 s.
            let way = |t: f64| (5.0 + BRAKING * late_s) * t - BRAKING * t * t / 2.0;
            [
                [at + way(t - 1.0), 0.0],
                [5.0 - BRAKING * slower, 0.0],
                [-BRAKING, 0.0],
            ]
        };
        let mut window = Window::<2>::new();
        window
            .pieces
            .push(Piece::between(&state(0.0), &state(1.6), 0.0, 1.6));
        window.marks = vec![
            Mark { t: 0.0, s: 0.2 },
            Mark {
                t: 1.6,
                s: state(1.6)[0][0],
            },
        ];
        let feeder = Feeder::new(&run, &[1.0; 2], PERIOD_S, &rest_at_start(), &window);
        feeder.peak(&window, 0, 1e-3)
    }

    const PERIOD_S: f64 = 2e-3;

    /// The first sample that is wholly behind the place has its middle half a period behind it.
    #[test]
    fn a_motion_is_judged_where_its_first_sample_is_wholly_behind_a_higher_feed() {
        for (late_s, passes) in [
            (-PERIOD_S, true),
            (0.49 * PERIOD_S, true),
            (0.51 * PERIOD_S, false),
            (2.0 * PERIOD_S, false),
        ] {
            let share = share_of_feed(late_s);
            assert_eq!(share <= 1.0, passes, "{share} where it is {late_s} s late");
        }
    }

    /// The path comes back beside itself, nearly along the chord before. The motion turns 0.1 mm before the vertex, and never passes the
    /// plane between both chords, wherever the marks have it.
    #[test]
    fn a_motion_that_turns_back_is_on_the_second_chord_as_soon_as_it_has_turned() {
        let mut chords = lines(&[[0.0, 0.0], [5.0, 0.0], [0.0, 0.02]]);
        (chords[0].feed, chords[1].feed) = (50.0, 20.0);
        let run = open(&chords);
        let mut window = Window::<2>::new();
        for (n, ends) in [[[1.0, 0.0], [4.9, -0.1]], [[4.9, -0.1], [3.0, -0.05]]]
            .iter()
            .enumerate()
        {
            let state = |at: [f64; 2]| [at, [ends[1][0] - ends[0][0], 0.0], [0.0; 2]];
            let piece = Piece::between(&state(ends[0]), &state(ends[1]), n as f64, 1.0);
            window.pieces.push(piece);
        }
        for late in [-1.0, 0.0, 1.0] {
            window.marks = vec![
                Mark { t: 0.0, s: 1.0 },
                Mark {
                    t: 1.0,
                    s: 5.0 - late,
                },
                Mark { t: 2.0, s: 7.0 },
            ];
            let mut feeder = Feeder::new(&run, &[1.0; 2], 1e-3, &rest_at_start(), &window);
            let ranges = [0, 1].map(|n| feeder.range(&window, n));
            assert_eq!(ranges, [(20.0, 50.0), (20.0, 50.0)], "{late}");
            let chords = [0.9, 1.1, 1.5].map(|t| feeder.chord_at(&window, t));
            assert_eq!(chords, [0, 1, 1], "{late}");
        }
    }

    #[test]
    fn a_window_that_rests_behind_a_turn_back_has_the_feeds_of_both_chords() {
        let mut chords = lines(&[[0.0, 0.0], [5.0, 0.0], [0.0, 0.02]]);
        (chords[0].feed, chords[1].feed) = (50.0, 20.0);
        let run = open(&chords);
        let mut window = Window::<2>::new();
        let rest = |x: f64| [[x, 0.0], [0.0; 2], [0.0; 2]];
        for (n, [from, to]) in [[1.0, 4.9], [4.9, 3.0]].into_iter().enumerate() {
            let piece = Piece::between(&rest(from), &rest(to), n as f64, 1.0);
            window.pieces.push(piece);
        }
        window.marks = [(0.0, 1.0), (1.0, 5.0), (2.0, 7.0)]
            .map(|(t, s)| Mark { t, s })
            .to_vec();
        let mut feeder = Feeder::new(&run, &[1.0; 2], 1e-3, &rest_at_start(), &window);
        assert_eq!(feeder.chord_at(&window, 2.0), 1);
        assert_eq!(feeder.range(&window, 1), (20.0, 50.0));
        // On the way back it is 1.8 times as fast in its middle as in the mean.
        assert!(feeder.peak(&window, 1, 1e3) < 1.0);
        chords[1].feed = 3.0;
        let run = open(&chords);
        let feeder = Feeder::new(&run, &[1.0; 2], 1e-3, &rest_at_start(), &window);
        assert!(feeder.peak(&window, 1, 1e3) > 1.1);
    }
}
