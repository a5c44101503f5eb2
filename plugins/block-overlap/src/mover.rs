//! One block in motion: its trapezoid of speed, in ticks.

use tandem_motion::SpeedPiece;

use crate::buffer::Taken;
use crate::entry::Entry;
use crate::rules::{Rules, greater, lesser};

/// Times that differ by less, in ticks, are the same.
pub const SAME_TICKS: f64 = 1e-9;

/// A block that moves.
#[derive(Clone, Debug)]
pub struct Mover {
    /// Running number, by which the buffer has it.
    pub number: usize,
    /// Time since its start, ticks.
    pub at: f64,
    /// The knot that comes next; 3 at the end.
    phase: usize,
    /// Path deceleration that is left while nothing else moves, mm/s².
    pub stop_mm_per_s2: f64,
    length_mm: f64,
    feed_mm_per_s: f64,
    /// End of speeding up, start of slowing down, and end, ticks.
    knots: [f64; 3],
    accelerations: [f64; 2],
    tick_s: f64,
}

impl Mover {
    /// The block `entry`, driven as `taken` says; `None` for a dwell.
    pub fn new(rules: &Rules, entry: &Entry, taken: &Taken) -> Option<Self> {
        if entry.is_dwell() {
            return None;
        }
        let feed = taken.feed_mm_per_s;
        let tick_s = rules.tick_s;
        let per_tick = 1.0 / tick_s;
        let [up, down] = [taken.up_s, taken.join.down_s].map(|s| round(s * per_tick, rules.grid));
        let cruise = round(
            entry.length_mm / feed * per_tick + (up - down) / 2.0,
            rules.grid,
        );
        let slow_from = greater(up, cruise);
        let slope = entry.slope_s2_per_mm;
        // A block without a ramp begins behind its first knot.
        let phase = usize::from(up <= 0.0) + usize::from(slow_from <= 0.0);
        let knots = [up, slow_from, slow_from + down];
        Some(Self {
            at: 0.0,
            phase,
            stop_mm_per_s2: if slope > 0.0 {
                1.0 / slope
            } else {
                rules.weakest_mm_per_s2
            },
            number: taken.number,
            length_mm: entry.length_mm,
            feed_mm_per_s: feed,
            knots,
            accelerations: [feed / (up * tick_s), -feed / (down * tick_s)],
            tick_s,
        })
    }

    /// When it has come to rest, ticks after its start.
    pub fn end(&self) -> f64 {
        self.knots[2]
    }

    /// When the next block starts that overlaps this one for `overlap_s`, ticks after this one's start.
    pub fn next_at(&self, overlap_s: f64) -> f64 {
        let [_, slow_from, end] = self.knots;
        // A full overlap starts with the deceleration, to the last bit: else one block would speed up alone.
        let before_end = overlap_s / self.tick_s;
        if (end - before_end - slow_from).abs() < SAME_TICKS {
            slow_from
        } else {
            end - before_end
        }
    }

    /// Length, mm.
    pub fn length_mm(&self) -> f64 {
        self.length_mm
    }

    /// Whether it has come to its end.
    pub fn is_over(&self) -> bool {
        self.phase == 3
    }

    /// Ticks to where its acceleration next changes.
    #[inline]
    pub fn left(&self) -> f64 {
        self.knots
            .get(self.phase)
            .map_or(0.0, |knot| knot - self.at)
    }

    /// The longest piece from here, at most `most`, that one polynomial fits, ticks.
    #[inline]
    pub fn fitted(&self, entry: &Entry, most: f64) -> f64 {
        let Some(arc) = &entry.arc else { return most };
        lesser(
            most,
            arc.fit.longest_s(&arc.path, &self.piece(most)) / self.tick_s,
        )
    }

    /// Moves on; a knot is met exactly.
    #[inline]
    pub fn advance(&mut self, ticks: f64) {
        self.at += ticks;
        while self.phase < 3 && self.knots[self.phase] - self.at < SAME_TICKS {
            self.at = self.knots[self.phase];
            self.phase += 1;
        }
    }

    /// The motion from here on for `ticks`, up to the next knot.
    pub fn piece(&self, ticks: f64) -> SpeedPiece {
        let at = self.at;
        let tick_s = self.tick_s;
        let feed = self.feed_mm_per_s;
        let [up, _, end] = self.knots;
        let duration_s = ticks * tick_s;
        if self.phase == 0 {
            let speed = self.accelerations[0] * at * tick_s;
            let start_mm = speed * at * tick_s / 2.0;
            SpeedPiece {
                start_mm,
                speed_mm_per_s: speed,
                acceleration_mm_per_s2: self.accelerations[0],
                duration_s,
            }
        } else if self.phase == 1 {
            let start_mm = feed * tick_s * (at - up / 2.0);
            SpeedPiece {
                start_mm,
                speed_mm_per_s: feed,
                acceleration_mm_per_s2: 0.0,
                duration_s,
            }
        } else {
            let left = end - at;
            let speed = -self.accelerations[1] * left * tick_s;
            let start_mm = self.length_mm - speed * left * tick_s / 2.0;
            SpeedPiece {
                start_mm,
                speed_mm_per_s: speed,
                acceleration_mm_per_s2: self.accelerations[1],
                duration_s,
            }
        }
    }
}

/// A number of ticks, without the rounding of seconds where it is whole.
#[inline]
fn round(ticks: f64, grid: bool) -> f64 {
    // Rounding is a call of its own on plain x86-64.
    if !grid {
        return ticks;
    }
    let whole = ticks.round();
    if (ticks - whole).abs() < 1e-7 {
        whole
    } else {
        ticks
    }
}
