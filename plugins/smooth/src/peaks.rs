//! What a piece of motion reaches at its highest, and what it leaves for a stop.

use tandem_motion::tube::Lanes;

use crate::frame::{Frame, dot, largest, smallest};
use crate::verify::larger;
use crate::window::{Bound, Piece, Stop};

/// Share of an acceleration limit from which on a piece is looked at between its quarters.
const NEAR_ACCELERATION: f64 = 0.9;

/// What a piece reaches, as shares of limits.
#[derive(Clone, Copy, Debug, Default)]
pub struct Reached {
    pub feed: f64,
    pub speed: f64,
    pub acceleration: f64,
    pub jerk: f64,
}

/// What binds it.
pub fn bound(reached: &Reached) -> Bound {
    if reached.feed > 0.99 {
        Bound::Feed
    } else if reached.speed > 0.985 {
        Bound::Velocity
    } else if reached.acceleration > 0.95 {
        Bound::Acceleration
    } else if reached.jerk > 0.9 {
        Bound::Jerk
    } else {
        Bound::Tolerance
    }
}

/// The largest derivatives of a piece: jerk at its ends, middle and peak, the others at its ends and quarters.
pub fn derivatives<const L: usize>(
    piece: &Piece<L>,
    frame: &Frame<L>,
    speed: &Lanes<L>,
    counted: &Lanes<L>,
    feed: f64,
    stop: &mut Stop,
) -> Reached {
    let mut reached = Reached::default();
    let t = piece.duration_s;
    for l in 0..L {
        let (c3, c4, c5) = (6.0 * piece.c[3][l], 24.0 * piece.c[4][l], 60.0 * piece.c[5][l]);
        let mut most = larger(c3.abs(), (c3 + t * (c4 + t * c5)).abs());
        let peak = -c4 / (2.0 * c5);
        if peak > 0.0 && peak < t {
            most = larger(most, (c3 + peak * (c4 + peak * c5)).abs());
        }
        reached.jerk = larger(reached.jerk, most / frame.jerk[l]);
    }
    for part in [0.25, 0.5, 0.75, 1.0] {
        let (v, a) = (piece.velocity(part * t), piece.acceleration(part * t));
        let mut squared = 0.0;
        for l in 0..L {
            squared += (counted[l] * v[l]).powi(2);
            reached.speed = larger(reached.speed, v[l].abs() / speed[l]);
            reached.acceleration = larger(reached.acceleration, a[l].abs() / frame.acceleration[l]);
        }
        reached.feed = larger(reached.feed, squared.sqrt() / feed);
        if part == 1.0 {
            leave(stop, frame, &v, &a, squared.sqrt());
        }
    }
    if reached.acceleration > NEAR_ACCELERATION {
        reached.acceleration = larger(reached.acceleration, peak_acceleration(piece, frame));
    }
    // What jerk can add to a speed between quarters.
    let jerk = reached.jerk * largest(&frame.jerk);
    let between = jerk * (t / 4.0).powi(2) / 8.0;
    if reached.feed + between / feed > 1.0 || reached.speed + between / smallest(speed) > 1.0 {
        (reached.feed, reached.speed) = peak_speeds(piece, counted, (feed, speed), jerk);
    }
    reached
}

/// The highest acceleration inside a piece, as a share of the limit: where the jerk of a lane is zero.
fn peak_acceleration<const L: usize>(piece: &Piece<L>, frame: &Frame<L>) -> f64 {
    let mut most = 0.0;
    for l in 0..L {
        let (a, half_b, c) = (60.0 * piece.c[5][l], 12.0 * piece.c[4][l], 6.0 * piece.c[3][l]);
        let root = half_b * half_b - a * c;
        if root < 0.0 {
            continue;
        }
        // Of the two the one that loses no digits, and the other from the product of both.
        let sum = -(half_b + root.sqrt().copysign(half_b));
        for t in [sum / a, c / sum].into_iter().filter(|t| *t > 0.0 && *t < piece.duration_s) {
            most = larger(most, piece.acceleration(t)[l].abs() / frame.acceleration[l]);
        }
    }
    most
}

/// The highest path speed of a piece as a share of its feed, and the highest of a lane as a share of its limit: at
/// sixteenths, and what jerk can add between them.
fn peak_speeds<const L: usize>(
    piece: &Piece<L>,
    counted: &Lanes<L>,
    (feed, speed): (f64, &Lanes<L>),
    jerk: f64,
) -> (f64, f64) {
    let step_s = piece.duration_s / 16.0;
    let between = jerk * step_s * step_s / 8.0;
    let mut most = (0.0, 0.0);
    for n in 0..=16 {
        let v = piece.velocity(f64::from(n) * step_s);
        most.0 = larger(most.0, (0..L).map(|l| (counted[l] * v[l]).powi(2)).sum());
        most.1 = (0..L).fold(most.1, |most, l| larger(most, (v[l].abs() + between) / speed[l]));
    }
    ((most.0.sqrt() + between) / feed, most.1)
}

/// Share of an acceleration limit that counts as left at least, for the moment that turning takes all of it.
const LEAST_LEFT: f64 = 0.02;

/// Notes what is left for a stop: with d the direction and n what turns, `A − max(0, −sign(d)·n)` over |d|.
fn leave<const L: usize>(stop: &mut Stop, frame: &Frame<L>, v: &Lanes<L>, a: &Lanes<L>, speed: f64) {
    if speed < 1e-3 {
        return;
    }
    let squared = dot(v, v);
    let along = dot(v, a) / squared;
    stop.speed = stop.speed.max(speed);
    for l in 0..L {
        let d = v[l] / speed;
        let turning = (a[l] - along * v[l]) * d.signum();
        let left = (frame.acceleration[l] + turning.min(0.0)).max(0.0);
        stop.time_s = stop.time_s.max(speed * d.abs() / left.max(LEAST_LEFT * frame.acceleration[l]));
        stop.jerk = stop.jerk.min(frame.jerk[l] / d.abs().max(1e-9));
    }
}
