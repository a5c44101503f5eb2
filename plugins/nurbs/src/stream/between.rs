//! Between the samples: the governor looks at single points of a fine period and slows a plan that exceeds a limit there,
//! and once program time does not pass at its own rate the samples are others.

use tandem_motion::nurbs::AlongPath;
use tandem_sdk::{AxisVector, BlockKind, MAX_AXES};

use super::check::{Worst, differences};
use super::{Bounds, Cursor, Leg, Motion, PAST_MM, Route, State, Window};

/// Share of a limit that a point may reach: segments follow the path to a little less than this.
const AIM: f64 = 0.9997;
/// Share of the acceleration beyond which turning is to blame, whose acceleration goes with the square of the speed.
const TURNING: f64 = 0.85;
/// Looks in a period, evenly; the last one is the sample.
const PHASES: usize = 2;
/// Looks between two of them at most: a sharp feature of the path has some hundred parts.
const LOOKS: usize = 400;

/// Accelerations of the axes at a time, as shares of their limits.
type Shares = [f64; MAX_AXES];

/// A motion on its path, looked at.
#[derive(Debug)]
pub struct Between<'a, M> {
    pub route: &'a Route<'a>,
    pub bounds: &'a Bounds,
    pub window: &'a Window<M>,
}

/// What was seen before.
#[derive(Clone, Debug)]
pub struct Seen {
    /// Per phase the last positions, and how many of them there are.
    phases: [([AxisVector; 4], usize); PHASES],
    /// Jerk of the last third differences, as shares of the limits, and how many of them there are.
    jerks: ([Shares; 3], usize),
    /// The last even looks, and how many of them had none between them.
    shares: [Shares; 3],
    even: usize,
}

impl Seen {
    /// At rest at a position, or in motion, where nothing was seen yet.
    pub fn new(rest: Option<AxisVector>) -> Self {
        let phase = rest.map_or(([AxisVector::ZERO; 4], 0), |position| ([position; 4], 4));
        let none = [[0.0; MAX_AXES]; 3];
        Self { phases: [phase; PHASES], jerks: (none, 0), shares: none, even: 0 }
    }
}

impl<M: Motion> Between<'_, M> {
    /// The worst of the period that ends at `tick_s`: velocity and acceleration of the axes at points, and the differences
    /// of samples with another phase. Looks at the middle, on both sides of knots, and where the path has features closer
    /// to each other, at each of them. What lies before the window or behind its end is not looked at.
    pub fn worst(&self, tick_s: f64, seen: &mut Seen, cursor: &mut Cursor) -> Worst {
        let (mut worst, period_s) = (Worst::default(), self.bounds.context.fine_period_s);
        let mut from_s = (tick_s - period_s).max(0.0);
        for n in 1..=PHASES {
            let to_s = tick_s - period_s * (PHASES - n) as f64 / PHASES as f64;
            if to_s <= 0.0 {
                continue;
            }
            let to_s = to_s.min(self.window.duration_s());
            if from_s < to_s {
                self.approach([from_s, to_s], seen, cursor, &mut worst);
            }
            let (at, leg) = self.route.at(self.window.at(to_s).s_mm, cursor);
            let (positions, count) = &mut seen.phases[n - 1];
            *positions = [positions[1], positions[2], positions[3], at.position];
            *count += 1;
            if *count >= positions.len() {
                worst.join(&differences(self.bounds, positions, leg.block.kind == BlockKind::Rapid));
                let (jerks, count) = &mut seen.jerks;
                *jerks = [jerks[1], jerks[2], jerk_shares(self.bounds, positions)];
                *count += 1;
                // What it comes to at phases between.
                worst.jerk = worst.jerk.max(if *count >= jerks.len() { peak(jerks) / AIM } else { 0.0 });
            }
            from_s = to_s;
        }
        worst
    }

    /// From one even look to the next.
    fn approach(&self, [from_s, to_s]: [f64; 2], seen: &mut Seen, cursor: &mut Cursor, worst: &mut Worst) {
        let (mut before, mut t_s) = (self.window.at(from_s), from_s);
        for look in 0..LOOKS {
            let smooth_s = self.smooth_for_s(&before, cursor);
            let last = look + 1 == LOOKS || smooth_s >= to_s - t_s;
            t_s = if last { to_s } else { t_s + smooth_s };
            let state = self.window.at(t_s);
            self.look_at_knots([&before, &state], worst);
            let (at, leg) = self.route.at(state.s_mm, cursor);
            let shares = judge(self.bounds, leg, &state, &at, worst);
            if last {
                seen.even = if look == 0 { seen.even + 1 } else { 0 };
                seen.shares = [seen.shares[1], seen.shares[2], shares];
                break;
            }
            before = state;
        }
        if seen.even > seen.shares.len() {
            worst.acceleration = worst.acceleration.max(peak(&seen.shares) / AIM);
        }
    }

    /// How long the path goes on from a state without a feature of its own, s.
    fn smooth_for_s(&self, state: &State, cursor: &mut Cursor) -> f64 {
        let way_mm = self.route.smooth_for_mm(state.s_mm, cursor);
        let (v, a) = (state.speed_mm_per_s.abs(), state.acceleration_mm_per_s2.abs());
        if way_mm.is_finite() { way_mm / (v + (way_mm * a).sqrt()) } else { f64::INFINITY }
    }

    /// Both sides of the knots between two states; what the motion does there lies between them. Where the direction steps,
    /// samples show that as acceleration of one period beside what it is there.
    fn look_at_knots(&self, [from, to]: [&State; 2], worst: &mut Worst) {
        let (mut cursor, mut from_mm, way_mm) = (Cursor::default(), from.s_mm, to.s_mm - from.s_mm);
        while let Some((knot_mm, sides)) = self.route.knot([from_mm, to.s_mm], &mut cursor) {
            from_mm = knot_mm + PAST_MM;
            let share = (knot_mm - from.s_mm) / way_mm;
            let mix = |a: f64, b: f64| a + share * (b - a);
            let speed_mm_per_s = mix(from.speed_mm_per_s, to.speed_mm_per_s);
            let acceleration_mm_per_s2 = mix(from.acceleration_mm_per_s2, to.acceleration_mm_per_s2);
            let state = State { s_mm: knot_mm, speed_mm_per_s, acceleration_mm_per_s2 };
            let leg = self.route.find(knot_mm, &mut cursor);
            let turn = sides[1].direction - sides[0].direction;
            for at in &sides {
                let shares = judge(self.bounds, leg, &state, at, worst);
                for (axis, limits) in
                    self.bounds.context.limits.axes().iter().enumerate().filter(|(n, _)| turn[*n] != 0.0)
                {
                    let step = turn[axis].abs() * speed_mm_per_s / self.bounds.context.fine_period_s;
                    let share = shares[axis].abs() + step / limits.acceleration_mm_per_s2;
                    worst.acceleration = worst.acceleration.max(share / AIM);
                }
            }
        }
    }
}

/// Velocity and acceleration of the axes in a state on the path. The acceleration is that of [`Worst::acceleration`], or
/// where turning takes the most of it, of [`Worst::speed`].
fn judge(bounds: &Bounds, leg: &Leg, state: &State, at: &AlongPath, worst: &mut Worst) -> Shares {
    let (v, a, mut shares) = (state.speed_mm_per_s, state.acceleration_mm_per_s2, [0.0; MAX_AXES]);
    let rapid = leg.block.kind == BlockKind::Rapid;
    for (axis, limits) in bounds.context.limits.axes().iter().enumerate() {
        let most = if rapid { limits.rapid_mm_per_s } else { limits.feed_mm_per_s };
        worst.speed = worst.speed.max((at.direction[axis] * v).abs() / most);
        let turning = at.curvature[axis] * v * v / limits.acceleration_mm_per_s2;
        let share = at.direction[axis] * a / limits.acceleration_mm_per_s2 + turning;
        if turning.abs() > TURNING {
            worst.speed = worst.speed.max((share.abs() / AIM).sqrt());
        } else {
            worst.acceleration = worst.acceleration.max(share.abs() / AIM);
        }
        shares[axis] = share;
    }
    shares
}

/// Third differences of four samples as shares of the jerk limits.
fn jerk_shares(bounds: &Bounds, [p0, p1, p2, p3]: &[AxisVector; 4]) -> Shares {
    let (cube, mut shares) = (bounds.context.fine_period_s.powi(3), [0.0; MAX_AXES]);
    for (axis, limits) in bounds.context.limits.axes().iter().enumerate() {
        let difference = p3[axis] - p0[axis] - 3.0 * (p2[axis] - p1[axis]);
        shares[axis] = difference / (cube * limits.jerk_mm_per_s3);
    }
    shares
}

/// The largest value of the parabolas through three looks, the same time apart, where it lies inside.
fn peak([first, middle, last]: &[Shares; 3]) -> f64 {
    let peaks = (0..MAX_AXES).map(|axis| {
        let (slope, bend) = ((last[axis] - first[axis]) / 2.0, f64::midpoint(first[axis], last[axis]) - middle[axis]);
        if slope.abs() < 2.0 * bend.abs() { (middle[axis] - slope * slope / (4.0 * bend)).abs() } else { 0.0 }
    });
    peaks.fold(0.0, f64::max)
}
