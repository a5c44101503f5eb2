//! A planned window: quintics over time, from a state to rest.

use std::cell::Cell;

use tandem_motion::hermite;
use tandem_motion::tube::{Lanes, each};

use crate::route::Run;
use crate::timing::Mark;
use crate::waypoints::{INTERVALS, MAX_WAYPOINTS, Timer};

/// Most marks of a window: its waypoints, and its two ends.
const MAX_MARKS: usize = MAX_WAYPOINTS + 2;

/// Position, velocity and acceleration.
pub type State<const L: usize> = [Lanes<L>; 3];

/// What binds a piece of motion.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Bound {
    #[default]
    Jerk,
    Acceleration,
    Velocity,
    Feed,
    Tolerance,
}

/// A polynomial of time in every lane.
#[derive(Clone, Copy, Debug)]
pub struct Piece<const L: usize> {
    /// Coefficients, lowest power first.
    pub c: [Lanes<L>; 6],
    /// When it starts, s from the start of the window, and how long it takes.
    pub start_s: f64,
    pub duration_s: f64,
    pub bound: Bound,
}

impl<const L: usize> Piece<L> {
    /// The quintic from one state to another.
    #[inline(always)]
    pub fn between(from: &State<L>, to: &State<L>, start_s: f64, duration_s: f64) -> Self {
        let mut c = [[0.0; L]; 6];
        for l in 0..L {
            let ends = [from, to].map(|s| [s[0][l], s[1][l], s[2][l]]);
            let lane = hermite(ends[0], ends[1], duration_s);
            for n in 0..6 {
                c[n][l] = lane[n];
            }
        }
        Self {
            c,
            start_s,
            duration_s,
            bound: Bound::default(),
        }
    }

    /// When it ends.
    pub fn end_s(&self) -> f64 {
        self.start_s + self.duration_s
    }

    /// Position at local time `t`.
    #[inline(always)]
    pub fn position(&self, t: f64) -> Lanes<L> {
        let c = &self.c;
        each(|l| {
            c[0][l] + t * (c[1][l] + t * (c[2][l] + t * (c[3][l] + t * (c[4][l] + t * c[5][l]))))
        })
    }

    /// Velocity at local time `t`.
    #[inline(always)]
    pub fn velocity(&self, t: f64) -> Lanes<L> {
        let c = &self.c;
        each(|l| {
            c[1][l]
                + t * (2.0 * c[2][l]
                    + t * (3.0 * c[3][l] + t * (4.0 * c[4][l] + t * 5.0 * c[5][l])))
        })
    }

    /// Acceleration at local time `t`.
    #[inline(always)]
    pub fn acceleration(&self, t: f64) -> Lanes<L> {
        let c = &self.c;
        each(|l| 2.0 * c[2][l] + t * (6.0 * c[3][l] + t * (12.0 * c[4][l] + t * 20.0 * c[5][l])))
    }

    /// All three at local time `t`.
    pub fn state(&self, t: f64) -> State<L> {
        [self.position(t), self.velocity(t), self.acceleration(t)]
    }
}

/// A window.
#[derive(Debug)]
pub struct Window<const L: usize> {
    pub pieces: Vec<Piece<L>>,
    /// Time and path coordinate, both growing.
    pub marks: Vec<Mark>,
    /// It ends where the run ends, and the run is closed.
    pub whole: bool,
    /// What it leaves for a stop.
    pub stop: Stop,
    /// Where marks were last looked for: the next question is about a place near it.
    near: Cell<usize>,
    /// The piece that was last found: the next question is mostly about it, or the one behind it.
    found: Cell<usize>,
}

/// Marks that are looked at beside the last ones before all are searched.
const NEAR: usize = 8;

/// From where a window is planned, and how far.
#[derive(Clone, Copy, Debug)]
pub struct Start<'a, const L: usize> {
    pub state: State<L>,
    pub s: f64,
    pub resting: bool,
    /// Positions before, a fine period apart.
    pub before: &'a [Lanes<L>],
    /// Path coordinate that it may go to at most.
    pub end: f64,
    pub window_s: f64,
    /// The window that it goes on from, and when.
    pub old: Option<(&'a Window<L>, f64)>,
}

impl<const L: usize> Start<'_, L> {
    /// The least tolerance of the path that the window may drive.
    pub fn least_tolerance(&self, run: &Run<'_, L>) -> f64 {
        let mut way_s = 0.0;
        let mut tolerance = f64::INFINITY;
        for chord in &run.chords[run.chord_at(self.s, 0)..] {
            if chord.s > self.end || way_s > self.window_s {
                break;
            }
            tolerance = chord.tolerance.min(tolerance);
            way_s += chord.length / chord.speed.max(1e-9);
        }
        tolerance
    }
}

/// What a window leaves for a stop, as path speed counts.
#[derive(Clone, Copy, Debug)]
pub struct Stop {
    /// The longest time that a stop takes at the deceleration left where it begins, s. Where the path turns sharply little
    /// is left, but speed is low there.
    pub time_s: f64,
    /// Least jerk of a lane over its speed there, 1/s²: where a rotary axis turns much on little path, path speed is low.
    pub jerk_per_speed: f64,
    /// Highest path speed.
    pub speed: f64,
}

impl Stop {
    /// The deceleration that is left everywhere, in proportion to speed.
    pub fn deceleration(&self) -> f64 {
        if self.time_s > 0.0 {
            self.speed / self.time_s
        } else {
            f64::INFINITY
        }
    }
}

impl Default for Stop {
    fn default() -> Self {
        Self {
            time_s: 0.0,
            jerk_per_speed: f64::INFINITY,
            speed: 0.0,
        }
    }
}

impl<const L: usize> Window<L> {
    /// Room for the largest window there can be, so that it never grows: windows take turns, and each may be the larger one.
    pub fn new() -> Self {
        Self {
            pieces: Vec::with_capacity(INTERVALS.1),
            marks: Vec::with_capacity(MAX_MARKS),
            whole: false,
            stop: Stop::default(),
            near: Cell::new(0),
            found: Cell::new(0),
        }
    }

    /// How many marks are `before` a place, from the first one on.
    fn marks_before(&self, before: impl Fn(&Mark) -> bool) -> usize {
        let marks = &self.marks;
        let near = self.near.get().min(marks.len());
        let last = (near + NEAR).min(marks.len());
        let mut count = near;
        while count < last && before(&marks[count]) {
            count += 1;
        }
        let first = near.saturating_sub(NEAR);
        while count > first && !before(&marks[count - 1]) {
            count -= 1;
        }
        let ends = (count == last && count < marks.len()) || (count == first && count > 0);
        if ends {
            count = marks.partition_point(before);
        }
        self.near.set(count);
        count
    }

    /// How long it takes to its end.
    pub fn duration_s(&self) -> f64 {
        self.pieces.last().map_or(0.0, Piece::end_s)
    }

    /// The piece at `t`: the later one at a border.
    pub fn piece_at(&self, t: f64) -> usize {
        let begun = |k: usize| self.pieces.get(k).is_some_and(|piece| piece.start_s <= t);
        let last = self.found.get();
        let near = if begun(last + 1) { last + 1 } else { last };
        if !begun(near) || begun(near + 1) {
            let all_begun = self.pieces.partition_point(|piece| piece.start_s <= t);
            self.found.set(all_begun.max(1) - 1);
        } else {
            self.found.set(near);
        }
        self.found.get()
    }

    /// Position, velocity and acceleration at `t`.
    pub fn state(&self, t: f64) -> State<L> {
        let piece = &self.pieces[self.piece_at(t)];
        piece.state((t - piece.start_s).clamp(0.0, piece.duration_s))
    }

    /// When the motion passes `s`.
    pub fn time_of(&self, s: f64) -> f64 {
        let at = self.marks_before(|mark| mark.s <= s).max(1) - 1;
        Timer {
            marks: &self.marks,
            at: at.min(self.marks.len().saturating_sub(2)),
        }
        .time(s)
    }

    /// Path coordinate at `t`.
    pub fn along(&self, t: f64) -> f64 {
        let at = self
            .marks_before(|mark| mark.t <= t)
            .clamp(1, self.marks.len() - 1);
        let a = self.marks[at - 1];
        let b = self.marks[at];
        let time = b.t - a.t;
        if time > 0.0 {
            a.s + (b.s - a.s) * ((t - a.t) / time).clamp(0.0, 1.0)
        } else {
            b.s
        }
    }

    /// Path coordinate of its end.
    pub fn end(&self) -> f64 {
        self.marks.last().map_or(0.0, |mark| mark.s)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn marks_are_found_from_wherever_they_were_looked_for_last() {
        let mut window = Window::<2>::new();
        window.marks = (0..50)
            .map(|n| Mark {
                t: f64::from(n / 2),
                s: f64::from(n / 3),
            })
            .collect();
        for near in 0..55 {
            for place in -1..27 {
                let place = f64::from(place);
                window.near.set(near);
                let found = window.marks_before(|mark| mark.t <= place);
                assert_eq!(
                    found,
                    window.marks.partition_point(|mark| mark.t <= place),
                    "{near} {place}"
                );
            }
        }
    }

    #[test]
    fn a_piece_is_found_from_whichever_was_found_last() {
        let mut window = Window::<2>::new();
        let rest = [[0.0; 2]; 3];
        window.pieces = (0..20)
            .map(|n| Piece::between(&rest, &rest, f64::from(n / 2), 1.0))
            .collect();
        for last in 0..25 {
            for half in -2..24 {
                let t = f64::from(half) / 2.0;
                window.found.set(last);
                let begun = window.pieces.iter().filter(|piece| piece.start_s <= t);
                assert_eq!(window.piece_at(t), begun.count().max(1) - 1, "{last} {t}");
            }
        }
    }
}
