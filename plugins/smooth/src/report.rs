//! How blocks are driven.

use tandem_motion::blocks::{limited_by_feed, report};
use tandem_motion::tube::Lanes;
use tandem_sdk::{BlockReport, LimitedBy};

use crate::route::QueuedBlock;
use crate::window::{Bound, Window};

/// Path speed of a velocity.
pub fn path_speed<const L: usize>(counted: &Lanes<L>, velocity: &Lanes<L>) -> f64 {
    velocity
        .iter()
        .zip(counted)
        .map(|(v, c)| (v * c) * (v * c))
        .sum::<f64>()
        .sqrt()
}

/// The report of the block that is driven from `from_s` to `to_s` of `window`. Where it goes on beyond the window, its time is
/// estimated from the mean speed.
pub fn of_block<const L: usize>(
    window: &Window<L>,
    counted: &Lanes<L>,
    queued: &QueuedBlock,
    (from_s, to_s): (f64, f64),
) -> BlockReport {
    let first = window.piece_at(from_s);
    let speed = |n: usize, t: f64| {
        let piece = &window.pieces[n];
        path_speed(
            counted,
            &piece.velocity((t - piece.start_s).clamp(0.0, piece.duration_s)),
        )
    };
    let start = speed(first, from_s);
    let mut peak = start;
    // The speed where the last piece looked at is left, and when that is.
    let mut left = (first, f64::NAN, start);
    // Time by what binds.
    let mut bound_s = [0.0f64; 5];
    for (n, piece) in window.pieces.iter().enumerate().skip(first) {
        if piece.start_s >= to_s {
            break;
        }
        let until = piece.end_s().min(to_s);
        bound_s[piece.bound as usize] += until - piece.start_s.max(from_s);
        left = (n, until, speed(n, until));
        peak = peak.max(left.2);
    }
    let (last, until, end) = left;
    let end = if until == to_s {
        end
    } else {
        speed(last, to_s)
    };
    let driven = window.along(to_s) - queued.start.max(window.along(from_s));
    let whole = queued.end - queued.start;
    let time_s = if driven > 0.0 && queued.end > window.end() + 1e-9 {
        (to_s - from_s) * (whole / driven).max(1.0)
    } else {
        to_s - from_s
    };
    report(
        queued.block.index,
        limited_by(&bound_s, queued),
        [start, peak, end],
        time_s,
    )
}

fn limited_by(bound_s: &[f64; 5], queued: &QueuedBlock) -> LimitedBy {
    let most = (0..5).fold(
        0,
        |best, n| if bound_s[n] > bound_s[best] { n } else { best },
    );
    match most {
        n if n == Bound::Jerk as usize => LimitedBy::Jerk,
        n if n == Bound::Acceleration as usize => LimitedBy::Acceleration,
        n if n == Bound::Velocity as usize => LimitedBy::Velocity,
        n if n == Bound::Feed as usize => limited_by_feed(&queued.block),
        _ => LimitedBy::Tolerance,
    }
}

/// The polynomial of the path coordinate over a piece that begins at `from_mm`: its length and the speeds at its ends are
/// met, the accelerations where that leaves it growing. Gives its end.
pub fn path<const L: usize>(
    counted: &Lanes<L>,
    piece: &crate::window::Piece<L>,
    from_mm: f64,
    path: &mut [f64; 6],
) -> f64 {
    let t = piece.duration_s;
    let speed = |at: f64| path_speed(counted, &piece.velocity(at * t));
    let v0 = speed(0.0);
    let v1 = speed(1.0);
    // Simpson's rule on quarters.
    let length = t / 12.0 * (v0 + 4.0 * (speed(0.25) + speed(0.75)) + 2.0 * speed(0.5) + v1);
    let along = |v: &Lanes<L>, a: &Lanes<L>, speed: f64| {
        let product: f64 = (0..L).map(|l| counted[l] * v[l] * counted[l] * a[l]).sum();
        if speed > 1e-6 { product / speed } else { 0.0 }
    };
    let a0 = along(&piece.velocity(0.0), &piece.acceleration(0.0), v0);
    let a1 = along(&piece.velocity(t), &piece.acceleration(t), v1);
    *path = tandem_motion::hermite([from_mm, v0, a0], [from_mm + length, v1, a1], t);
    let rate = |t: f64| {
        path[1]
            + t * (2.0 * path[2] + t * (3.0 * path[3] + t * (4.0 * path[4] + t * 5.0 * path[5])))
    };
    if [0.125, 0.25, 0.5, 0.75, 0.875]
        .iter()
        .any(|share| rate(share * t) < 0.0)
    {
        *path = [from_mm, length / t, 0.0, 0.0, 0.0, 0.0];
    }
    from_mm + length
}
