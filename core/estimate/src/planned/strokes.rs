//! What lines there and back say by themselves. Each moves one axis, from rest to rest, and so it has a closed form, of which the best
//! constants are found wherever they are: an acceleration that no line reaches at some jerk has no gradient for a search to follow.

use super::{Planned, PlannerKind};
use crate::polygon::{PlaneAxis, Timed};

/// Places at which a range is looked at, how much narrower the next range is around the best of them, and how many ranges there are: the last
/// places lie closer than a thousandth, and readings are not that good.
const PLACES: u32 = 40;
const NARROWER: f64 = 8.0;
const RANGES: u32 = 4;
/// A constant is looked for from a little below what the shortest time asks for if it bounded alone, to so many times that.
const BELOW: f64 = 0.7;
const WIDEST: f64 = 1e3;
/// Time constants that are tried, s, and what one may leave of the squares beside the best to be a start.
const TIME_CONSTANTS_S: [f64; 12] = [
    0.002, 0.003, 0.0045, 0.007, 0.01, 0.015, 0.022, 0.033, 0.05, 0.075, 0.11, 0.17,
];
const AS_WELL: f64 = 4.0;
/// Lines tell a jerk limit where the acceleration is built up for so many fine periods, and where without it their times are off by so many
/// times the squares. Two controls without one left 2.7 and 3.1 times the squares, with 1.5 in place of 5 both were searched for minutes.
/// With one that takes 13 ms to be reached, next to the shortest that fits are tried with, times 2 % off leave 16 times as much or more.
const TELLING_PERIODS: f64 = 4.0;
const TELLING: f64 = 5.0;

/// Where a search for the constants of a planner begins.
pub struct Starts {
    pub all: Vec<Planned>,
    /// Whether lines tell the jerk. Where they are driven as well without one, the control is not this planner, and planning with a jerk
    /// so high takes minutes.
    pub tell_jerk: bool,
}

/// Where to begin: `planned` with the acceleration of each axis of the plane, and its jerk or the time constant, that fit `strokes`. A time
/// constant that is shorter than the acceleration asks ramps to be shows in none of them, so that others fit about as well.
pub fn starts(planned: &Planned, strokes: &[Timed], period_s: f64) -> Starts {
    let axes = [PlaneAxis::X, PlaneAxis::Y].map(|axis| {
        let along = strokes.iter().filter(|timed| timed.polygon.along == axis);
        Strokes {
            kind: planned.kind,
            all: along.copied().collect(),
        }
    });
    match planned.kind {
        PlannerKind::Smooth => {
            let mut start = planned.clone();
            let mut squares = 0.0;
            let mut without_jerk = 0.0;
            let mut build_s = f64::INFINITY;
            for (axis, strokes) in axes.iter().enumerate() {
                let range = strokes.range(|side_mm, s| 32.0 * side_mm / s.powi(3));
                let square = |log: f64| strokes.acceleration(log.exp()).1;
                let (log, least) = lowest(range, square);
                squares += least;
                without_jerk += square(range[1]);
                start.jerk_mm_per_s3[axis] = log.exp();
                start.acceleration_mm_per_s2[axis] = strokes.acceleration(log.exp()).0;
                build_s =
                    build_s.min(start.acceleration_mm_per_s2[axis] / start.jerk_mm_per_s3[axis]);
            }
            Starts {
                all: vec![start],
                tell_jerk: without_jerk > TELLING * squares && build_s > TELLING_PERIODS * period_s,
            }
        }
        PlannerKind::BlockOverlap => {
            let square = |constant_s: f64| -> f64 {
                let squares = axes.iter().map(|axis| axis.acceleration(constant_s).1);
                squares.sum()
            };
            let all = TIME_CONSTANTS_S.map(|constant_s| (square(constant_s), constant_s));
            let best = all
                .iter()
                .fold(f64::INFINITY, |best, (square, _)| best.min(*square));
            let fitting = all.iter().filter(|(square, _)| *square <= AS_WELL * best);
            let start = |(_, constant_s): &(f64, f64)| {
                let mut start = planned.clone();
                start.time_constant_s = *constant_s;
                for (axis, strokes) in axes.iter().enumerate() {
                    start.acceleration_mm_per_s2[axis] = strokes.acceleration(*constant_s).0;
                }
                start
            };
            Starts {
                all: fitting.map(start).collect(),
                tell_jerk: true,
            }
        }
    }
}

/// Those along one axis.
struct Strokes {
    kind: PlannerKind,
    all: Vec<Timed>,
}

impl Strokes {
    /// Where to look for a constant, of which a side that it bounds alone asks for `least` in a time, as logarithms.
    fn range(&self, least: impl Fn(f64, f64) -> f64) -> [f64; 2] {
        let asked = |timed: &Timed| least(timed.polygon.side_mm, timed.block_s());
        let asked = self.all.iter().map(asked).fold(0.0, f64::max);
        [(BELOW * asked).ln(), (WIDEST * asked).ln()]
    }

    /// The acceleration that fits best beside `other`, a jerk or a time constant, and the squares that it leaves.
    fn acceleration(&self, other: f64) -> (f64, f64) {
        let range = self.range(|side_mm, s| 4.0 * side_mm / (s * s));
        let (log, square) = lowest(range, |log| self.square(log.exp(), other));
        (log.exp(), square)
    }

    fn square(&self, acceleration: f64, other: f64) -> f64 {
        let residuals = self.all.iter().map(|timed| {
            let (length_mm, feed) = (timed.polygon.side_mm, timed.polygon.feed_mm_per_s);
            let side_s = match self.kind {
                PlannerKind::Smooth => jerk_limited_s(length_mm, feed, acceleration, other),
                PlannerKind::BlockOverlap => overlapped_s(length_mm, feed, acceleration, other),
            };
            (side_s / timed.block_s()).ln() * timed.weight()
        });
        residuals.map(|r| r * r).sum()
    }
}

/// The least of `square` in a range, and where that is: the first of equal ones.
fn lowest([mut from, mut to]: [f64; 2], square: impl Fn(f64) -> f64) -> (f64, f64) {
    let mut best = (from, f64::INFINITY);
    for _ in 0..RANGES {
        let step = (to - from) / f64::from(PLACES);
        for place in 0..=PLACES {
            let at = from + f64::from(place) * step;
            let there = square(at);
            if there < best.1 {
                best = (at, there);
            }
        }
        let half = (to - from) / (2.0 * NARROWER);
        (from, to) = (best.0 - half, best.0 + half);
    }
    best
}

/// The fastest motion from rest to rest below a feed, an acceleration and a jerk, s.
fn jerk_limited_s(length_mm: f64, feed: f64, acceleration: f64, jerk: f64) -> f64 {
    // Time of a ramp from rest to a speed.
    let ramp_s = |speed: f64| {
        if speed * jerk > acceleration * acceleration {
            speed / acceleration + acceleration / jerk
        } else {
            2.0 * (speed / jerk).sqrt()
        }
    };
    if feed * ramp_s(feed) <= length_mm {
        return length_mm / feed + ramp_s(feed);
    }
    // Two ramps meet at a speed that is held for no time.
    let without_hold = (jerk * length_mm * length_mm / 4.0).cbrt();
    let build_s = acceleration / jerk;
    let with_hold = acceleration / 2.0
        * ((build_s * build_s + 4.0 * length_mm / acceleration).sqrt() - build_s);
    let peak = if without_hold * jerk > acceleration * acceleration {
        with_hold
    } else {
        without_hold
    };
    2.0 * ramp_s(peak)
}

/// A block of the planner `block-overlap` between two rests, s: ramps take the time constant, or less in short blocks, and as long as the
/// acceleration asks for.
fn overlapped_s(length_mm: f64, feed: f64, acceleration: f64, time_constant_s: f64) -> f64 {
    let feed = feed.min((acceleration * length_mm).sqrt());
    let ramp_s = time_constant_s
        .min(length_mm / feed)
        .max(feed / acceleration);
    length_mm / feed + ramp_s
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::polygon::Polygon;
    use tandem_sdk::MAX_AXES;

    #[test]
    fn a_motion_from_rest_to_rest_takes_what_its_phases_do() {
        // Acceleration is built up for 0.1 s to 50 mm/s², and held for 0.2 s: 15 mm/s, after 3 mm. So 10 mm have 4 mm at that speed.
        let s = |length_mm, feed| jerk_limited_s(length_mm, feed, 50.0, 500.0);
        assert!((s(10.0, 15.0) - (2.0 * 0.4 + 4.0 / 15.0)).abs() < 1e-12);
        // The same ramps without anything between.
        assert!((s(6.0, 15.0) - 0.8).abs() < 1e-12 && (s(6.0, 1e9) - 0.8).abs() < 1e-12);
        // Jerk alone: 32·L = j·T³.
        assert!((s(0.125, 1e9) - 0.2).abs() < 1e-12);
    }

    /// Lines along both axes, a hundred times there and back, on a control with 1000 mm/s² and this jerk.
    fn tell_jerk(jerk: f64) -> bool {
        let timed = |(side_mm, along)| {
            let polygon = Polygon {
                corners: 2,
                side_mm,
                rounds: 100,
                along,
                feed_mm_per_s: 80.0,
                exact_stop: true,
            };
            Timed {
                polygon,
                time_s: f64::from(polygon.blocks()) * jerk_limited_s(side_mm, 80.0, 1000.0, jerk),
                reading_error_s: 0.0,
            }
        };
        let sides = [0.3, 1.0, 3.0, 10.0];
        let all: Vec<_> = sides
            .iter()
            .flat_map(|side_mm| [(*side_mm, PlaneAxis::X), (*side_mm, PlaneAxis::Y)])
            .map(timed)
            .collect();
        let planned = Planned {
            kind: PlannerKind::Smooth,
            acceleration_mm_per_s2: [1.0; MAX_AXES],
            jerk_mm_per_s3: [1.0; MAX_AXES],
            path_tolerance_mm: 0.01,
            time_constant_s: 0.0,
        };
        starts(&planned, &all, 0.001).tell_jerk
    }

    #[test]
    fn lines_tell_a_jerk_that_takes_more_than_a_few_periods_to_reach_the_acceleration() {
        assert!(tell_jerk(1000.0 / 0.1));
        assert!(tell_jerk(1000.0 / 0.012));
        assert!(!tell_jerk(1000.0 / 0.002));
        assert!(!tell_jerk(1e9));
    }
}
