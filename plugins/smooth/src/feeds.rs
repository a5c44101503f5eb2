//! The feeds along a window: what an interval may have before it is planned, and what a piece of motion has of it.

use tandem_motion::tube::{Lanes, Waypoint};

use crate::frame::{dot, minus};
use crate::route::Run;
use crate::verify::larger;
use crate::window::{Piece, Window};

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

/// The feeds of the chords that a piece touches.
pub struct Feeder<'a, const L: usize> {
    pub run: &'a Run<'a, L>,
    pub timer_at: usize,
    pub chord: usize,
}

impl<const L: usize> Feeder<'_, L> {
    /// The lowest and the highest.
    pub fn range(&mut self, window: &Window<L>, n: usize) -> (f64, f64) {
        let piece = &window.pieces[n];
        let marks = &window.marks;
        while self.timer_at + 2 < marks.len() && marks[self.timer_at + 1].t <= piece.start_s {
            self.timer_at += 1;
        }
        self.chord = self.run.chord_at(marks[self.timer_at].s, self.chord);
        let mut range = (
            self.run.chords[self.chord].feed,
            self.run.chords[self.chord].feed,
        );
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
    pub fn peak(&self, piece: &Piece<L>, counted: &Lanes<L>, period_s: f64, jerk: f64) -> f64 {
        let chords = self.run.chords;
        // What jerk can add to a speed between two looks.
        let between = jerk * (piece.duration_s / 16.0).powi(2) / 8.0;
        let mut most = 0.0;
        let mut i = self.chord;
        for n in 0..=16 {
            let t = f64::from(n) / 16.0 * piece.duration_s;
            let at = piece.position(t);
            let v = piece.velocity(t);
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
            most = larger(most, (squared.sqrt() + between) / feed);
        }
        most
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::order::tests::{lines, open};
    use crate::timing::Mark;

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

    /// A piece that ends where a chord begins does not touch that one.
    #[test]
    fn a_piece_has_the_feeds_of_the_chords_that_it_touches() {
        let mut chords = lines(&[[0.0, 0.0], [5.0, 0.0], [7.0, 0.0], [10.0, 0.0]]);
        for (chord, feed) in chords.iter_mut().zip([50.0, 20.0, 70.0]) {
            chord.feed = feed;
        }
        let run = open(&chords);
        let mut window = Window::<2>::new();
        let mut marks = vec![Mark { t: 0.0, s: 0.0 }];
        for (t, s) in [(1.0, 5.0), (2.0, 6.0), (3.0, 10.0)] {
            let rest = [[0.0; 2]; 3];
            window
                .pieces
                .push(Piece::between(&rest, &rest, t - 1.0, 1.0));
            marks.push(Mark { t, s });
        }
        window.marks = marks;
        let mut feeder = Feeder {
            run: &run,
            timer_at: 0,
            chord: 0,
        };
        let ranges = [0, 1, 2].map(|n| feeder.range(&window, n));
        assert_eq!(ranges, [(50.0, 50.0), (20.0, 20.0), (20.0, 70.0)]);
    }
}
