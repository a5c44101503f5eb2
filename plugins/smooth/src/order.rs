//! Places of the samples along the path, in their order: what is near a place that the path passes at another time is not
//! there, and a motion that leaves out a loop, or turns back, does not follow the path.

use tandem_motion::tube::Lanes;

use crate::frame::{dot, minus, to_chord};
use crate::path_distance::{ALLOWED, path_distance};
use crate::route::{Chord, Run};

/// How far a vertex may be from the samples between which it is passed, in tolerances: a place is the first that a sample may
/// have, and lags behind it.
pub const REACH: f64 = 4.0;

/// What is as far as a chord is within that distance of it, whatever rounding says.
const ROUNDED: f64 = 1.0 + 1e-9;

/// Path coordinates of samples; keeps its memory.
#[derive(Debug, Default)]
pub struct Order {
    /// The first place that each sample of the window may have; it never goes back.
    first: Vec<f64>,
    /// The last place that each sample may have, of those before the window too; nor does it.
    last: Vec<f64>,
}

impl Order {
    /// Finds the places of `samples` in a motion to `end` that follows the path: each within tolerance of the path, none before
    /// that of the sample before, from the start to the end; false where there are none. Samples before `begin` are those of another
    /// window, which has looked at them; where it is left the path is near chord `near`. `nearness` says how much of the tolerance each of
    /// the others may use; where it says nothing, or there are no places that near, all of it counts.
    #[inline(always)]
    pub fn walk<const L: usize>(
        &mut self,
        run: &Run<'_, L>,
        (samples, nearness): (&[Lanes<L>], &[f64]),
        begin: usize,
        (near, end): (usize, f64),
    ) -> bool {
        let start = path_distance(run, near, &samples[begin]).path_coordinate(run);
        let tolerance = run.chords[run.chord_at(start, near)].tolerance;
        let start = (start - 2.0 * tolerance).max(run.chords[0].s);
        let share = |n: usize| {
            nearness
                .get(n.wrapping_sub(begin))
                .map_or(ALLOWED, |share| share * ROUNDED)
        };
        !nearness.is_empty() && self.places(run, samples, begin, (start, near, end), share)
            || self.places(run, samples, begin, (start, near, end), |_| ALLOWED)
    }

    /// The same with the share of the tolerance that each sample may use, from the path coordinate `start` on.
    #[inline(always)]
    fn places<const L: usize>(
        &mut self,
        run: &Run<'_, L>,
        samples: &[Lanes<L>],
        begin: usize,
        (start, near, end): (f64, usize, f64),
        share: impl Fn(usize) -> f64,
    ) -> bool {
        let mut walker = Walker::begin(run, start);
        self.first.clear();
        self.last.clear();
        for n in begin..samples.len() {
            let before = &samples[n - usize::from(n > begin)];
            if !walker.goes_on(before, &samples[n], share(n)) {
                return false;
            }
            self.first.push(walker.s());
        }
        // Where the path goes round twice, a motion that goes round once has places on the way there as well as on the way back.
        let mut is_whole =
            walker.is_near_all(run.chord_at(end, walker.chord), &samples[samples.len() - 1]);
        let mut walker = Walker::begin(run, end);
        for n in (0..samples.len()).rev() {
            let behind = &samples[(n + 1).min(samples.len() - 1)];
            if walker.goes_back(behind, &samples[n], share(n)) {
                self.last.push(walker.s());
                is_whole |= n == begin && walker.is_near_all(near, &samples[n]);
            } else if n >= begin {
                return false;
            } else {
                // On a part of the path that is known no more.
                self.last.resize(samples.len(), f64::NEG_INFINITY);
                break;
            }
        }
        self.last.reverse();
        is_whole
    }

    /// Between which samples a vertex at `s` may be passed: where the path comes by again, those before the window are none that pass it
    /// behind its start. Vertices are asked for in their order: how many samples lie before one is what was `passed` so far, or more.
    #[inline(always)]
    pub fn around(&self, s: f64, passed: &mut [usize; 2]) -> (usize, usize) {
        let [first, behind] = passed;
        while self.last.get(*first).is_some_and(|place| *place < s) {
            *first += 1;
        }
        while self.first.get(*behind).is_some_and(|place| *place <= s) {
            *behind += 1;
        }
        let before = self.last.len() - self.first.len();
        (first.saturating_sub(1), before + behind.saturating_sub(1))
    }
}

/// A place on the path that goes with the samples.
struct Walker<'a, const L: usize> {
    chords: &'a [Chord<L>],
    chord: usize,
    along: f64,
}

impl<'a, const L: usize> Walker<'a, L> {
    fn begin(run: &Run<'a, L>, s: f64) -> Self {
        let chord = run.chord_at(s, 0);
        Self {
            chords: run.chords,
            chord,
            along: (s - run.chords[chord].s).clamp(0.0, run.chords[chord].length),
        }
    }

    fn s(&self) -> f64 {
        self.chords[self.chord].s + self.along
    }

    /// Goes on to the first place that is within this share of the tolerance of `sample`. Vertices on the way have to be near the way from the
    /// sample before.
    #[inline(always)]
    fn goes_on(&mut self, before: &Lanes<L>, sample: &Lanes<L>, share: f64) -> bool {
        loop {
            if let Some([first, _]) = within(
                &self.chords[self.chord],
                [self.along, f64::INFINITY],
                sample,
                share,
            ) {
                self.along = first;
                return true;
            }
            let next = self.chord + 1;
            if next == self.chords.len() || !self.is_near(next, before, sample) {
                return false;
            }
            self.chord = next;
            self.along = 0.0;
        }
    }

    /// Goes back to the last place that is within tolerance of `sample`, in the same way.
    #[inline(always)]
    fn goes_back(&mut self, behind: &Lanes<L>, sample: &Lanes<L>, share: f64) -> bool {
        loop {
            if let Some([_, last]) =
                within(&self.chords[self.chord], [0.0, self.along], sample, share)
            {
                self.along = last;
                return true;
            }
            if self.chord == 0 || !self.is_near(self.chord, behind, sample) {
                return false;
            }
            self.chord -= 1;
            self.along = self.chords[self.chord].length;
        }
    }

    /// Whether all vertices from here to chord `other` are near `sample`.
    fn is_near_all(&self, other: usize, sample: &Lanes<L>) -> bool {
        let first = self.chord.min(other) + 1;
        let last = self.chord.max(other);
        (first..=last).all(|vertex| self.is_near(vertex, sample, sample))
    }

    /// Whether the vertex at the start of chord `vertex` is near the way from one sample to another.
    #[inline(always)]
    fn is_near(&self, vertex: usize, from: &Lanes<L>, to: &Lanes<L>) -> bool {
        let reach = REACH
            * self.chords[vertex]
                .tolerance
                .max(self.chords[vertex - 1].tolerance);
        to_chord(&self.chords[vertex].start, from, to) <= reach * reach
    }
}

/// The first and the last place on `chord` between `low` and `high` that are within this share of the tolerance of `sample`.
#[inline(always)]
fn within<const L: usize>(
    chord: &Chord<L>,
    [low, high]: [f64; 2],
    sample: &Lanes<L>,
    share: f64,
) -> Option<[f64; 2]> {
    let most = share * chord.tolerance;
    let way = minus(sample, &chord.start);
    let foot = dot(&way, &chord.direction);
    let across = minus(&way, &chord.direction.map(|d| foot * d));
    let half = (most * most - dot(&across, &across)).sqrt();
    let first = low.max(foot - half);
    let last = high.min(foot + half).min(chord.length);
    // Where it is too far on the whole chord, half is no number.
    (half >= 0.0 && first <= last).then_some([first, last])
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    const TOLERANCE: f64 = 0.01;

    /// Lines through `points`.
    pub fn lines(points: &[[f64; 2]]) -> Vec<Chord<2>> {
        let mut s = 0.0;
        let chord = |pair: &[[f64; 2]]| {
            let way = minus(&pair[1], &pair[0]);
            let length = dot(&way, &way).sqrt();
            let direction = way.map(|v| v / length);
            s += length;
            Chord {
                start: pair[0],
                direction,
                s: s - length,
                length,
                feed: 1.0,
                pace: 1.0,
                tolerance: TOLERANCE,
                speed: 1.0,
                turn_s: 1.0,
                turn: 0.0,
            }
        };
        points.windows(2).map(chord).collect()
    }

    /// A run that may go on behind these chords.
    pub fn open(chords: &[Chord<2>]) -> Run<'_, 2> {
        Run {
            chords,
            closed: false,
            rotary: false,
            rapid: false,
        }
    }

    /// Whether samples at these points have places in order on the path.
    fn in_order(path: &[[f64; 2]], samples: &[[f64; 2]]) -> bool {
        let chords = lines(path);
        let run = open(&chords);
        Order::default().walk(&run, (samples, &[]), 0, (0, run.end()))
    }

    #[test]
    fn a_motion_along_the_path_has_places_in_order() {
        assert!(in_order(
            &[[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]],
            &[[0.0, 0.0], [0.5, 0.005], [0.995, 0.0], [1.0, 1.0]]
        ));
    }

    #[test]
    fn a_motion_that_turns_back_on_a_line_has_none() {
        assert!(!in_order(
            &[[0.0, 0.0], [1.0, 0.0]],
            &[[0.0, 0.0], [0.5, 0.0], [0.45, 0.0], [1.0, 0.0]]
        ));
    }

    #[test]
    fn a_motion_that_leaves_out_a_loop_has_none() {
        let path = [
            [0.0, 0.0],
            [1.0, 0.0],
            [1.0, 0.3],
            [0.7, 0.3],
            [1.0, 0.0],
            [1.0, -1.0],
        ];
        assert!(!in_order(
            &path,
            &[[0.0, 0.0], [0.5, 0.0], [1.0, 0.0], [1.0, -0.5], [1.0, -1.0]]
        ));
    }

    /// On the way there the first round is driven, on the way back the last.
    #[test]
    fn a_motion_that_goes_round_once_where_the_path_does_twice_has_none() {
        let round = [[1.0, 0.0], [1.0, 0.3], [0.7, 0.3], [1.0, 0.0]];
        let twice = [&[[0.0, 0.0]][..], &round, &round[1..]].concat();
        let once = [&[[0.0, 0.0]][..], &round].concat();
        assert!(in_order(&twice, &twice));
        assert!(!in_order(&twice, &once));
        assert!(in_order(&once, &once));
    }

    /// A sample has a place where it is as near to the path as is said of it, or within tolerance.
    #[test]
    fn a_sample_that_is_farther_off_than_is_said_of_it_has_no_place() {
        let chords = lines(&[[0.0, 0.0], [1.0, 0.0]]);
        let run = open(&chords);
        for (off, follows) in [(0.8, true), (1.5, false)] {
            let samples = [[0.0, 0.0], [0.5, off * TOLERANCE], [1.0, 0.0]];
            let nearness = [0.1, 0.9, 0.1];
            let found = Order::default().walk(&run, (&samples, &nearness), 0, (0, run.end()));
            assert_eq!(found, follows, "{off}");
        }
    }

    /// Where the path turns back and comes by again, the samples before a window are not those that pass the vertices in it.
    #[test]
    fn samples_before_a_window_pass_no_vertex_behind_its_start() {
        let chords = lines(&[[0.0, 0.0], [1.0, 0.0], [0.5, 0.005], [2.0, 0.0]]);
        let run = open(&chords);
        // The window begins on the way back.
        let samples = [0.3, 0.5, 0.7, 0.9, 1.0, 0.9, 0.7, 0.5, 0.7, 2.0].map(|x| [x, 0.003]);
        let mut order = Order::default();
        assert!(order.walk(&run, (&samples, &[]), 6, (1, run.end())));
        let tip = chords[2].s;
        assert_eq!(order.around(tip, &mut [0; 2]), (6, 7));
        // The corner before was passed by them.
        let (first, last) = order.around(chords[1].s, &mut [0; 2]);
        assert!(first <= 4 && last >= 4, "{first} to {last}");
        // What lies before the known path has no place on it.
        let far = [[-5.0, 0.0], [0.7, 0.003], [2.0, 0.0]];
        assert!(order.walk(&run, (&far, &[]), 1, (2, run.end())));
    }

    /// A vertex is passed between the last sample that is before it at all events, and the first that is behind it.
    #[test]
    fn a_vertex_is_passed_between_the_samples_around_it() {
        let chords = lines(&[[0.0, 0.0], [10.0, 0.0]]);
        let samples: Vec<_> = (0..=10_u32).map(|n| [f64::from(n), 0.0]).collect();
        let mut order = Order::default();
        assert!(order.walk(&open(&chords), (&samples, &[]), 0, (0, 10.0)));
        let mut passed = [0; 2];
        for (s, among) in [(0.5, (0, 0)), (4.5, (4, 4)), (5.0, (4, 5)), (9.5, (9, 9))] {
            assert_eq!(order.around(s, &mut passed), among, "{s}");
        }
    }

    /// From a line of little tolerance to one of much the corner may be cut as far as the larger allows.
    #[test]
    fn a_corner_is_near_by_the_larger_tolerance_of_its_lines() {
        let samples = [[0.0, 0.0], [0.9, 0.0], [1.0, 0.1], [1.0, 1.0]];
        for (tolerances, follows) in [
            ([0.01, 0.1], true),
            ([0.1, 0.01], true),
            ([0.01, 0.01], false),
        ] {
            let mut chords = lines(&[[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]]);
            for (chord, tolerance) in chords.iter_mut().zip(tolerances) {
                chord.tolerance = tolerance;
            }
            let run = open(&chords);
            let found = Order::default().walk(&run, (&samples, &[]), 0, (0, run.end()));
            assert_eq!(found, follows, "{tolerances:?}");
        }
    }
}
