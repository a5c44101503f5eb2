//! What a piece of motion reaches at its highest, and what it leaves for a stop.
//!
//! A polynomial lies within the hull of its control points (Bernstein's form), and a convex measure of it is largest at one of
//! them: the largest share of a limit in any lane, path speed, what is beyond the travel. The halves of a polynomial have
//! hulls of their own, which close in on it with the square of their length. So nothing is left between places looked at:
//! what passes is proven.

use tandem_motion::tube::{Lanes, each};

use crate::frame::{Frame, dot, larger};
use crate::window::{Bound, Piece, Stop};

/// Share of a limit that the motion may reach at an instant.
pub const SPEED: f64 = 1.0;
pub const ACCELERATION: f64 = 0.9995;
pub const JERK: f64 = 1.003;

/// Share of its feed from which on a piece is bound by it, and a window that is there all the way is planned in one round. At 0.98 and
/// 0.995 the example programs take the same time; at 0.995 one of them takes a hundredth more instructions.
pub const AT_FEED: f64 = 0.99;

/// Halvings at most: the hull of a part of a piece of 6 ms is then beyond its jerk by less than a ten-thousandth of a limit.
const DEPTH: u32 = 8;
/// A hull that is beyond its ends by no more than this share is as good as they are.
const CLOSE: f64 = 1e-7;

/// What a piece reaches, as shares of limits; the last in lane units per s².
#[derive(Clone, Copy, Debug, Default)]
pub struct Reached {
    pub feed: f64,
    pub speed: f64,
    pub acceleration: f64,
    pub jerk: f64,
    /// The size of the acceleration of all lanes.
    pub bend: f64,
}

/// What binds it.
pub fn bound(reached: &Reached) -> Bound {
    if reached.feed > AT_FEED {
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

/// A bound of the largest convex `measure` of the polynomial with these control points. Where it is above `enough` it is near
/// the largest.
#[inline(always)]
pub fn highest<const L: usize, const N: usize>(
    control: &[Lanes<L>; N],
    enough: f64,
    measure: &impl Fn(&Lanes<L>) -> f64,
) -> f64 {
    let most = hull(control, measure);
    if most <= enough || most.is_nan() {
        most
    } else {
        close_in(control, enough, measure, DEPTH)
    }
}

#[inline(always)]
fn hull<const L: usize, const N: usize>(
    control: &[Lanes<L>; N],
    measure: &impl Fn(&Lanes<L>) -> f64,
) -> f64 {
    let mut most = f64::NEG_INFINITY;
    for point in control {
        most = larger(most, measure(point));
    }
    most
}

fn close_in<const L: usize, const N: usize>(
    control: &[Lanes<L>; N],
    enough: f64,
    measure: &impl Fn(&Lanes<L>) -> f64,
    depth: u32,
) -> f64 {
    let most = hull(control, measure);
    let ends = larger(measure(&control[0]), measure(&control[N - 1]));
    if most <= enough || most - ends <= CLOSE * most.abs() || depth == 0 || most.is_nan() {
        return most;
    }
    let [left, right] = halves(control);
    let first = close_in(&left, enough, measure, depth - 1);
    // What lies below that of one half does not matter in the other.
    larger(
        first,
        close_in(&right, larger(enough, first), measure, depth - 1),
    )
}

/// The control points of both halves (de Casteljau).
fn halves<const L: usize, const N: usize>(control: &[Lanes<L>; N]) -> [[Lanes<L>; N]; 2] {
    let mut left = *control;
    let mut right = *control;
    for level in 1..N {
        for n in 0..N - level {
            right[n] = each(|l| f64::midpoint(right[n][l], right[n + 1][l]));
        }
        left[level] = right[0];
    }
    [left, right]
}

/// The control points of the derivatives of a piece.
struct Derivatives<const L: usize> {
    velocity: [Lanes<L>; 5],
    acceleration: [Lanes<L>; 4],
    jerk: [Lanes<L>; 3],
}

#[inline(always)]
fn control_of<const L: usize>(piece: &Piece<L>) -> Derivatives<L> {
    let c = &piece.c;
    let t = piece.duration_s;
    let t2 = t * t;
    let t3 = t * t * t;
    let t4 = t * t * t * t;
    let [p0, p1]: [Lanes<L>; 2] = [c[1], each(|l| 2.0 * t * c[2][l])];
    let [p2, p3]: [Lanes<L>; 2] = [each(|l| 3.0 * t2 * c[3][l]), each(|l| 4.0 * t3 * c[4][l])];
    let velocity = [
        p0,
        each(|l| p0[l] + p1[l] / 4.0),
        each(|l| p0[l] + p1[l] / 2.0 + p2[l] / 6.0),
        each(|l| p0[l] + 0.75 * p1[l] + p2[l] / 2.0 + p3[l] / 4.0),
        each(|l| p0[l] + p1[l] + p2[l] + p3[l] + 5.0 * t4 * c[5][l]),
    ];
    let [q0, q1]: [Lanes<L>; 2] = [each(|l| 2.0 * c[2][l]), each(|l| 6.0 * t * c[3][l])];
    let [q2, q3]: [Lanes<L>; 2] = [each(|l| 12.0 * t2 * c[4][l]), each(|l| 20.0 * t3 * c[5][l])];
    let acceleration = [
        q0,
        each(|l| q0[l] + q1[l] / 3.0),
        each(|l| q0[l] + (2.0 * q1[l] + q2[l]) / 3.0),
        each(|l| q0[l] + q1[l] + q2[l] + q3[l]),
    ];
    let jerk = [
        each(|l| 6.0 * c[3][l]),
        each(|l| 6.0 * c[3][l] + 12.0 * t * c[4][l]),
        each(|l| 6.0 * c[3][l] + 24.0 * t * c[4][l] + 60.0 * t2 * c[5][l]),
    ];
    Derivatives {
        velocity,
        acceleration,
        jerk,
    }
}

/// The control points of the velocity of a piece.
#[inline(always)]
pub fn velocities<const L: usize>(piece: &Piece<L>) -> [Lanes<L>; 5] {
    control_of(piece).velocity
}

/// The control points of the position of a piece.
pub fn positions<const L: usize>(piece: &Piece<L>) -> [Lanes<L>; 6] {
    const BINOMIAL: [[f64; 6]; 6] = [
        [1.0, 0.0, 0.0, 0.0, 0.0, 0.0],
        [1.0, 0.2, 0.0, 0.0, 0.0, 0.0],
        [1.0, 0.4, 0.1, 0.0, 0.0, 0.0],
        [1.0, 0.6, 0.3, 0.1, 0.0, 0.0],
        [1.0, 0.8, 0.6, 0.4, 0.2, 0.0],
        [1.0, 1.0, 1.0, 1.0, 1.0, 1.0],
    ];
    let mut power = [1.0; 6];
    for n in 1..6 {
        power[n] = power[n - 1] * piece.duration_s;
    }
    // The place itself comes last, so that what is added to it is not rounded to it.
    BINOMIAL.map(|row| {
        each(|l| {
            (1..6)
                .map(|n| row[n] * power[n] * piece.c[n][l])
                .sum::<f64>()
                + piece.c[0][l]
        })
    })
}

/// The largest share of `limit` in a lane.
#[inline(always)]
fn share_of<const L: usize>(limit: &Lanes<L>) -> impl Fn(&Lanes<L>) -> f64 {
    let per: Lanes<L> = each(|l| 1.0 / limit[l]);
    move |value| {
        let mut most = 0.0;
        for l in 0..L {
            most = larger(most, (value[l] * per[l]).abs());
        }
        most
    }
}

/// The largest derivatives of a piece.
#[inline(always)]
pub fn derivatives<const L: usize>(
    piece: &Piece<L>,
    frame: &Frame<L>,
    speed: &Lanes<L>,
    counted: &Lanes<L>,
    feed: f64,
    stop: &mut Stop,
) -> Reached {
    let Derivatives {
        velocity,
        acceleration,
        jerk,
    } = control_of(piece);
    let squared = |v: &Lanes<L>| {
        let counted: Lanes<L> = each(|l| counted[l] * v[l]);
        dot(&counted, &counted)
    };
    let per_feed = 1.0 / (feed * feed);
    let reached = Reached {
        feed: highest(&velocity, SPEED * SPEED, &|v| squared(v) * per_feed).sqrt(),
        speed: highest(&velocity, SPEED, &share_of(speed)),
        acceleration: highest(&acceleration, ACCELERATION, &share_of(&frame.acceleration)),
        jerk: highest(&jerk, JERK, &share_of(&frame.jerk)),
        bend: hull(&acceleration, &|a| dot(a, a)).sqrt(),
    };
    let v = &velocity[4];
    let a = &acceleration[3];
    leave(stop, frame, v, a, squared(v).sqrt());
    reached
}

/// How far pieces one after the other turn from the way between their ends: the largest acceleration across it, and the largest velocity
/// across it as a share of that along it; infinite where they go back. Velocities lie in the cone of their control points.
pub fn turning<const L: usize>(pieces: &[Piece<L>]) -> (f64, f64) {
    let (Some(first), Some(last)) = (pieces.first(), pieces.last()) else {
        return (0.0, 0.0);
    };
    let way: Lanes<L> = {
        let end = last.position(last.duration_s);
        each(|l| end[l] - first.c[0][l])
    };
    let size = dot(&way, &way).sqrt().max(f64::MIN_POSITIVE);
    let direction = way.map(|v| v / size);
    // Along the way and across it.
    let parts = |value: &Lanes<L>| {
        let along = dot(value, &direction);
        let across: Lanes<L> = each(|l| value[l] - along * direction[l]);
        (along, dot(&across, &across).sqrt())
    };
    let controls = || pieces.iter().map(control_of);
    let fastest = controls()
        .flat_map(|control| control.velocity)
        .fold(0.0, |most, v| larger(most, dot(&v, &v).sqrt()));
    let across = controls()
        .flat_map(|control| control.acceleration)
        .fold(0.0, |most, a| larger(most, parts(&a).1));
    let share = controls()
        .flat_map(|control| control.velocity)
        .fold(0.0, |most, v| {
            let (along, across) = parts(&v);
            if along.abs() + across <= STANDS * fastest {
                most
            } else if along > 0.0 {
                larger(most, across / along)
            } else {
                f64::INFINITY
            }
        });
    (across, share)
}

/// Share of the highest velocity below which one is the rounding of a rest.
const STANDS: f64 = 1e-6;

/// Share of an acceleration limit that counts as left at least, for the moment that turning takes all of it.
const MIN_LEFT: f64 = 0.02;

/// Notes what is left for a stop: with d the direction and n what turns, `A − max(0, −sign(d)·n)` over |d|.
#[inline(always)]
fn leave<const L: usize>(
    stop: &mut Stop,
    frame: &Frame<L>,
    v: &Lanes<L>,
    a: &Lanes<L>,
    speed: f64,
) {
    let squared = dot(v, v);
    if squared < f64::MIN_POSITIVE {
        return;
    }
    let along = dot(v, a) / squared;
    stop.speed = stop.speed.max(speed);
    for l in 0..L {
        let turning = (a[l] - along * v[l]) * v[l].signum();
        let left = (frame.acceleration[l] + turning.min(0.0)).max(0.0);
        stop.time_s = stop
            .time_s
            .max(v[l].abs() / left.max(MIN_LEFT * frame.acceleration[l]));
        stop.jerk_per_speed = stop
            .jerk_per_speed
            .min(frame.jerk[l] / v[l].abs().max(1e-9));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tandem_rig::Random;

    /// A piece between random states, rough enough for peaks between its ends.
    fn piece(random: &mut Random) -> Piece<2> {
        let duration_s = random.length(5e-5, 0.05);
        let mut state = || {
            let scale = [1.0, 1.0 / duration_s, 1.0 / (duration_s * duration_s)];
            scale.map(|scale| [(); 2].map(|()| scale * random.between(-1.0, 1.0)))
        };
        Piece::between(&state(), &state(), 0.0, duration_s)
    }

    #[test]
    fn what_binds_a_piece_is_the_first_limit_that_is_next_to_reached() {
        let reached = |feed: f64, speed: f64, acceleration: f64, jerk: f64| {
            bound(&Reached {
                feed,
                speed,
                acceleration,
                jerk,
                bend: 0.0,
            })
        };
        assert_eq!(reached(1.0, 1.0, 1.0, 1.0), Bound::Feed);
        assert_eq!(reached(0.98, 0.99, 1.0, 1.0), Bound::Velocity);
        assert_eq!(reached(0.98, 0.98, 0.96, 1.0), Bound::Acceleration);
        assert_eq!(reached(0.98, 0.98, 0.94, 0.91), Bound::Jerk);
        assert_eq!(reached(0.98, 0.98, 0.94, 0.89), Bound::Tolerance);
    }

    #[test]
    fn a_slow_motion_needs_time_for_its_stop_too() {
        let axis = tandem_sdk::AxisLimits {
            min_mm: -1.0,
            max_mm: 1.0,
            feed_mm_per_s: 1.0,
            rapid_mm_per_s: 1.0,
            acceleration_mm_per_s2: 1e-3,
            jerk_mm_per_s3: 1e-2,
            speed_difference_mm_per_s: 0.0,
        };
        let frame = Frame::<2>::new(&tandem_rig::context(&[axis; 2], 1e-3));
        let mut stop = Stop::default();
        let v = [5e-4, 0.0];
        leave(&mut stop, &frame, &v, &[0.0; 2], v[0]);
        assert!(
            (stop.time_s - 0.5).abs() < 1e-9 && (stop.jerk_per_speed - 20.0).abs() < 1e-9,
            "{stop:?}"
        );
    }

    /// On a diagonal that bends: what turning takes of an axis is not left for its stop, and never more than all of it.
    #[test]
    fn what_turning_takes_of_an_axis_is_not_left_for_its_stop() {
        let axis = tandem_sdk::AxisLimits {
            min_mm: -1.0,
            max_mm: 1.0,
            feed_mm_per_s: 10.0,
            rapid_mm_per_s: 10.0,
            acceleration_mm_per_s2: 100.0,
            jerk_mm_per_s3: 1000.0,
            speed_difference_mm_per_s: 0.0,
        };
        let frame = Frame::<2>::new(&tandem_rig::context(&[axis; 2], 1e-3));
        let stops = |v: &Lanes<2>, a: &Lanes<2>| {
            let mut stop = Stop::default();
            leave(&mut stop, &frame, v, a, dot(v, v).sqrt());
            stop.time_s
        };
        // Along the path nothing is taken, across it from the axis that it slows down: it stops with what is left.
        for (a, left) in [
            ([0.0, 0.0], 100.0),
            ([30.0, 30.0], 100.0),
            ([30.0, -30.0], 70.0),
            ([-30.0, 30.0], 70.0),
            ([60.0, 0.0], 70.0),
            ([300.0, -300.0], 2.0),
        ] {
            for sign in [1.0, -1.0] {
                let time_s = stops(&[5.0 * sign, 5.0 * sign], &a.map(|a| a * sign));
                assert!((time_s - 5.0 / left).abs() < 1e-9, "{a:?}: {time_s} s");
            }
        }
    }

    #[test]
    fn a_piece_turns_from_its_way_by_no_more_than_is_said() {
        let mut random = Random::new(1);
        let mut finite = 0;
        for _ in 0..500 {
            let duration_s = random.length(1e-3, 0.05);
            let mut state = |x: f64| {
                let [y, v, a] = [0.1, 0.5, 2.0].map(|most| random.between(-most, most));
                [
                    [x, y],
                    [1.0 / duration_s, v / duration_s],
                    [0.0, a / duration_s / duration_s],
                ]
            };
            let piece = Piece::between(&state(0.0), &state(1.0), 0.0, duration_s);
            let (across, share) = turning(&[piece]);
            finite += u32::from(share.is_finite());
            let end = piece.position(duration_s);
            let way: Lanes<2> = each(|l| end[l] - piece.c[0][l]);
            let size = dot(&way, &way).sqrt();
            let normal = [-way[1] / size, way[0] / size];
            for n in 0..=1000 {
                let t = f64::from(n) / 1000.0 * duration_s;
                let (v, a) = (piece.velocity(t), piece.acceleration(t));
                assert!(dot(&a, &normal).abs() <= across * (1.0 + 1e-9));
                let along = dot(&v, &way) / size;
                assert!(
                    share.is_infinite()
                        || along > 0.0 && dot(&v, &normal).abs() <= share * along * (1.0 + 1e-9)
                );
            }
        }
        assert!(finite > 100, "{finite} go forward");
        // One that goes back has no way, and one that stands has none to turn from.
        let rest = |x: f64| [[x, 0.0], [0.0; 2], [0.0; 2]];
        let back = [
            Piece::between(&rest(0.0), &rest(3.0), 0.0, 1.0),
            Piece::between(&rest(3.0), &rest(1.0), 1.0, 1.0),
        ];
        assert_eq!(turning(&back).1, f64::INFINITY);
        assert_eq!(
            turning(&[Piece::between(&rest(1.0), &rest(1.0), 0.0, 1.0)]),
            (0.0, 0.0)
        );
    }

    #[test]
    fn nothing_that_a_piece_reaches_is_above_what_is_said_of_it() {
        let mut random = Random::new(1);
        for _ in 0..500 {
            let piece = piece(&mut random);
            let t = |n: u32| f64::from(n) / 4000.0 * piece.duration_s;
            let Derivatives {
                velocity,
                acceleration,
                ..
            } = control_of(&piece);
            let largest = |of: &dyn Fn(f64) -> Lanes<2>| {
                (0..=4000)
                    .flat_map(|n| of(t(n)))
                    .fold(0.0, |most: f64, value| most.max(value.abs()))
            };
            let one = share_of(&[1.0; 2]);
            let said = [
                highest(&positions(&piece), 0.0, &one),
                highest(&velocity, 0.0, &one),
                highest(&acceleration, 0.0, &one),
            ];
            let reached = [
                largest(&|t| piece.position(t)),
                largest(&|t| piece.velocity(t)),
                largest(&|t| piece.acceleration(t)),
            ];
            for (said, reached) in said.into_iter().zip(reached) {
                assert!(
                    said >= reached * (1.0 - 1e-12),
                    "{said} is said, {reached} is reached"
                );
                assert!(
                    said <= reached * (1.0 + 1e-4),
                    "{said} is said, and no more than {reached} is reached"
                );
            }
        }
    }
}
