//! The feeds along a window: what an interval may have before it is planned, and what a piece of motion has of it.

use tandem_motion::tube::{Lanes, Waypoint};

use crate::frame::{dot, minus};
use crate::route::Run;
use crate::verify::larger;
use crate::window::{Piece, Window};

/// The feed of intervals, asked for in order: the lowest of the chords whose waypoints lie in or next to one. A vertex has both
/// of its chords: speed at the end of an interval is what the next one allows.
pub struct Feeds<'a, const L: usize> {
    pub run: &'a Run<'a, L>,
    /// Path coordinates and chords of the waypoints.
    pub along: &'a [(f64, u32)],
    pub waypoints: &'a [Waypoint<L>],
    pub at: usize,
}

impl<const L: usize> Feeds<'_, L> {
    /// The feed of interval `k`.
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
            feed = feed.min(self.run.chords[chord].feed);
            if chord > 0 && s <= self.run.chords[chord].s {
                feed = feed.min(self.run.chords[chord - 1].feed);
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
                .fold(f64::INFINITY, |least, chord| least.min(chord.feed));
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
