//! A straight piece of path from rest to rest: the shortest motion within speed, acceleration and jerk, in closed form.

use tandem_motion::tube::Lanes;

use crate::frame::{Frame, along};
use crate::route::{Chord, Run};
use crate::timing::{Mark, feed};
use crate::window::{Bound, Piece, Stop, Window};

/// Share of the limits that is used.
const SHARE: f64 = 0.999;

/// Limits along the path.
#[derive(Clone, Copy, Debug)]
struct Along {
    speed: f64,
    acceleration: f64,
    jerk: f64,
}

impl Along {
    /// Times of rising, of constant and of falling acceleration from rest to `v`: the rises are equal.
    fn ramp(&self, v: f64) -> (f64, f64) {
        let build_up = self.acceleration / self.jerk;
        if v >= self.acceleration * build_up {
            (build_up, v / self.acceleration - build_up)
        } else {
            ((v / self.jerk).sqrt(), 0.0)
        }
    }

    /// The highest speed on a way of `length` from rest to rest.
    fn peak(&self, length: f64) -> f64 {
        let a = self.acceleration;
        let j = self.jerk;
        let rise = a / j;
        // With constant acceleration: v²/a + v·a/j = length; without: 2·v·√(v/j) = length.
        let long = a / 2.0 * ((rise * rise + 4.0 * length / a).sqrt() - rise);
        let v = if long >= a * rise {
            long
        } else {
            (length * length / 4.0 * j).cbrt()
        };
        v.min(self.speed)
    }
}

/// Drives from the start of `chord`, or from `from` on it, to `to`, from rest to rest.
pub fn drive<const L: usize>(
    run: &Run<'_, L>,
    frame: &Frame<L>,
    counted: &Lanes<L>,
    chord: &Chord<L>,
    (from, to): (f64, f64),
    window: &mut Window<L>,
) {
    let direction = &chord.direction;
    let speed = feed(chord, counted).min(along(&frame.speed[usize::from(run.rapid)], direction));
    let limits = Along {
        speed: SHARE * speed,
        acceleration: SHARE * along(&frame.acceleration, direction),
        jerk: SHARE * along(&frame.jerk, direction),
    };
    let length = to - from;
    let peak = limits.peak(length);
    let (rise, constant) = limits.ramp(peak);
    let cruise = ((length - peak * (2.0 * rise + constant)) / peak).max(0.0);
    let jerk = if rise > 0.0 {
        peak / (rise * (rise + constant))
    } else {
        0.0
    };
    let phases = [
        (rise, jerk),
        (constant, 0.0),
        (rise, -jerk),
        (cruise, 0.0),
        (rise, -jerk),
        (constant, 0.0),
        (rise, jerk),
    ];
    window.pieces.clear();
    window.marks.clear();
    window.marks.push(Mark { t: 0.0, s: from });
    let bound = if peak >= limits.speed {
        Bound::Feed
    } else {
        Bound::Jerk
    };
    let mut t = 0.0;
    let mut way = 0.0;
    let mut v = 0.0;
    let mut a = 0.0;
    for (time, j) in phases.into_iter().filter(|(time, _)| *time > 1e-12) {
        let start = chord.at(from + way);
        let c = [
            start,
            direction.map(|d| d * v),
            direction.map(|d| d * a / 2.0),
            direction.map(|d| d * j / 6.0),
        ];
        let zero = [0.0; L];
        let c = [c[0], c[1], c[2], c[3], zero, zero];
        window.pieces.push(Piece {
            c,
            start_s: t,
            duration_s: time,
            bound,
        });
        way += time * (v + time * (a / 2.0 + time * j / 6.0));
        v += time * (a + time * j / 2.0);
        a += time * j;
        t += time;
        window.marks.push(Mark {
            t,
            s: from + way.min(length),
        });
    }
    if let Some(last) = window.marks.last_mut() {
        last.s = to;
    }
    window.stop = stop(frame, counted, direction, peak);
    window.whole = true;
}

/// What is left for a stop on a straight path: all of the limits.
fn stop<const L: usize>(
    frame: &Frame<L>,
    counted: &Lanes<L>,
    direction: &Lanes<L>,
    peak: f64,
) -> Stop {
    let per = (0..L)
        .map(|l| (counted[l] * direction[l]).powi(2))
        .sum::<f64>()
        .sqrt()
        .max(1e-12);
    Stop {
        time_s: peak / along(&frame.acceleration, direction),
        jerk_per_speed: along(&frame.jerk, direction) / peak,
        speed: per * peak,
    }
}
