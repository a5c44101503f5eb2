//! Ramping out: to rest from the last samples sent, at the limits. Leaves the path; asks no plugin.
//!
//! Every axis goes by its own limits. Where joints are sums of axes they go together instead: one law for the whole vector
//! of velocities, so that every sum of axes goes by it too, and lasts as long as the joint or axis that needs most. Along a line
//! that is the law of a single axis, which goes no farther than a plan that brakes already, as towards the end of the travel.

use tandem_sdk::{AxisVector, MAX_AXES};

use crate::config::{FineConfig, Joints};
use crate::guard::Guard;
use crate::law::to_rest;

/// Share of the jerk with which an axis comes to rest: a plan that brakes towards the end of its travel may use all of it, and a
/// ramp with less would go beyond.
const SHARE: f64 = 1.0;

/// Share of the jerk limit that is seen of what counts as rounding: the one tolerance on jerk covers it.
const ROUNDED_JERK_SHARE: f64 = 1e-3;

/// A ramp to rest.
#[derive(Clone, Copy, Debug)]
pub struct Ramp {
    position: AxisVector,
    velocity: AxisVector,
    acceleration: AxisVector,
    most: [f64; MAX_AXES],
    /// Infinite where the planner keeps no jerk limit.
    jerk: [f64; MAX_AXES],
    period_s: f64,
    together: Option<Together>,
    /// Entries that move.
    axes: usize,
}

impl Ramp {
    /// From the last samples sent.
    pub fn new(config: &FineConfig, sent: &Guard) -> Self {
        let smooth = config.order >= 3;
        let mut ramp = Self {
            position: *sent.position(),
            velocity: *sent.velocity(),
            acceleration: *sent.acceleration(),
            most: config.limits.axes.map(|l| l.acceleration_mm_per_s2),
            jerk: config.limits.axes.map(|l| {
                if smooth {
                    l.jerk_mm_per_s3
                } else {
                    f64::INFINITY
                }
            }),
            period_s: config.period_s,
            together: None,
            axes: if matches!(config.joints, Joints::Curved { .. }) {
                config.axis_count()
            } else {
                MAX_AXES
            },
        };
        if matches!(config.joints, Joints::Sums(_)) {
            ramp.together = Some(Together::new(&ramp, config.lane_count()));
        }
        ramp
    }

    /// The next sample. Each axis slows by its limits, whatever lies ahead: the travel too.
    pub fn next(&mut self) -> AxisVector {
        if let Some(together) = &mut self.together {
            self.velocity = together.next(self.period_s);
        } else {
            (0..self.axes).for_each(|axis| self.slow(axis));
        }
        self.position += self.velocity * self.period_s;
        self.position
    }

    /// Whether every axis rests.
    pub fn is_over(&self) -> bool {
        self.velocity.0[..self.axes].iter().all(|v| *v == 0.0)
    }

    fn slow(&mut self, axis: usize) {
        let mut lane = Lane {
            velocity: self.velocity[axis],
            acceleration: self.acceleration[axis],
            most: self.most[axis],
            jerk: self.jerk[axis],
        };
        lane.slow(self.period_s);
        (self.velocity[axis], self.acceleration[axis]) = (lane.velocity, lane.acceleration);
    }
}

/// A coordinate by itself, and what it comes to rest with.
#[derive(Clone, Copy, Debug)]
struct Lane {
    velocity: f64,
    acceleration: f64,
    most: f64,
    /// Infinite where there is no jerk limit.
    jerk: f64,
}

impl Lane {
    /// Goes on for a period.
    fn slow(&mut self, period_s: f64) {
        if self.jerk.is_finite() {
            self.slow_smoothly(period_s);
        } else {
            let v = self.velocity;
            self.velocity = v.signum() * (v.abs() - self.most * period_s).max(0.0);
        }
    }

    /// The change of acceleration that leads to rest soonest. In samples `v ← v + T·a` follows `a ← a + T·j`: the law's
    /// form in `v − T·a`.
    fn slow_smoothly(&mut self, period_s: f64) {
        let (limit, velocity, acceleration) = (self.jerk, self.velocity, self.acceleration);
        let jerk = to_rest(
            velocity - period_s * acceleration,
            acceleration,
            SHARE * limit,
            limit,
            period_s,
        );
        let kept = acceleration.abs().max(self.most);
        let next = (acceleration + period_s * jerk).clamp(-kept, kept);
        let step = limit * period_s;
        // What is left is rounding of the jerk; where it is much beside the acceleration, that takes it in a period more.
        let left = (velocity + period_s * next).abs();
        let arrives = left < ROUNDED_JERK_SHARE * step * period_s
            && next.abs() < step
            && velocity.abs() <= kept * period_s;
        (self.velocity, self.acceleration) = if arrives {
            (0.0, 0.0)
        } else {
            (velocity + period_s * next, next)
        };
    }
}

/// All entries to rest together.
#[derive(Clone, Copy, Debug)]
enum Together {
    /// They go along one line: by the law of a single coordinate.
    Line(Line),
    Curve(RunOut),
}

impl Together {
    /// From the state of `ramp`, within the limits of its first `count` entries.
    fn new(ramp: &Ramp, count: usize) -> Self {
        Line::new(ramp, count).map_or_else(|| Self::Curve(RunOut::new(ramp, count)), Self::Line)
    }

    /// The velocity in the next period.
    fn next(&mut self, period_s: f64) -> AxisVector {
        match self {
            Self::Line(line) => line.next(period_s),
            Self::Curve(run_out) => run_out.next(period_s),
        }
    }
}

/// Motion along one line with a jerk limit.
#[derive(Clone, Copy, Debug)]
struct Line {
    /// The entries at a velocity of 1 of the lane.
    direction: AxisVector,
    lane: Lane,
}

impl Line {
    /// That of `ramp`; `None` where velocity and acceleration are off one line by more than rounding, or without a jerk limit.
    fn new(ramp: &Ramp, count: usize) -> Option<Self> {
        let (velocity, change) = (ramp.velocity, ramp.acceleration * ramp.period_s);
        let dot = |a: &AxisVector, b: &AxisVector| -> f64 { (0..count).map(|i| a[i] * b[i]).sum() };
        // Of a motion that begins or ends the acceleration tells the direction better.
        let direction = if dot(&velocity, &velocity) >= dot(&change, &change) {
            velocity
        } else {
            change
        };
        let squared = dot(&direction, &direction);
        if squared < f64::MIN_POSITIVE {
            return None;
        }
        let [along, changed] = [velocity, change].map(|of| dot(&of, &direction) / squared);
        let is_straight = (0..count).all(|i| {
            let off = (velocity[i] - direction[i] * along).abs()
                + (change[i] - direction[i] * changed).abs();
            let rounding_mm = 4.0 * f64::EPSILON * ramp.position[i].abs().max(1.0);
            let seen_mm = ROUNDED_JERK_SHARE * ramp.jerk[i] * ramp.period_s.powi(3);
            off * ramp.period_s <= seen_mm.max(rounding_mm)
        });
        let least = |of: &[f64; MAX_AXES]| {
            (0..count)
                .map(|i| of[i] / direction[i].abs())
                .fold(f64::INFINITY, f64::min)
        };
        let lane = Lane {
            velocity: along,
            acceleration: changed / ramp.period_s,
            most: least(&ramp.most),
            jerk: least(&ramp.jerk),
        };
        (is_straight && lane.jerk.is_finite()).then_some(Self { direction, lane })
    }

    fn next(&mut self, period_s: f64) -> AxisVector {
        self.lane.slow(period_s);
        self.direction * self.lane.velocity
    }
}

/// All entries to rest by one law of time: first the acceleration runs out, then the velocity falls.
#[derive(Clone, Copy, Debug)]
struct RunOut {
    velocity: AxisVector,
    acceleration: AxisVector,
    /// What is left of the velocity when the acceleration has run out.
    steady: AxisVector,
    /// How long it takes to run out at the jerk limit, in periods.
    runs_out: f64,
    /// Periods until then, and from then until rest; whole ones where there is a jerk limit.
    periods: [f64; 2],
    /// The velocity falls with `1 − 3τ² + 2τ³` where there is a jerk limit, else with `1 − τ`.
    smooth: bool,
    passed: f64,
}

impl RunOut {
    /// From the state of `ramp`, within the limits of its first `count` entries.
    fn new(ramp: &Ramp, count: usize) -> Self {
        let (period_s, velocity, acceleration) = (ramp.period_s, ramp.velocity, ramp.acceleration);
        let longest = |of: &dyn Fn(usize) -> f64| (0..count).map(of).fold(0.0, f64::max);
        let smooth = ramp.jerk[..count].iter().any(|jerk| jerk.is_finite());
        let runs_out = longest(&|i| acceleration[i].abs() / ramp.jerk[i]) / period_s;
        let out = runs_out.ceil();
        let steady = velocity + acceleration * (gained(out, runs_out) * period_s);
        // The falling law has its greatest slope 1.5 in the middle, its greatest bend 6 at the ends.
        let fall_s = longest(&|i| {
            let v = steady[i].abs();
            if smooth {
                (1.5 * v / ramp.most[i]).max((6.0 * v / ramp.jerk[i]).sqrt())
            } else {
                v / ramp.most[i]
            }
        });
        // Without a jerk limit the last period slows by what is left: to last whole periods would go farther than a plan that
        // brakes already.
        let fall = fall_s / period_s;
        let fall = if smooth { fall.ceil().max(1.0) } else { fall };
        Self {
            velocity,
            acceleration,
            steady,
            runs_out,
            periods: [out, fall],
            smooth,
            passed: 0.0,
        }
    }

    /// The velocity in the next period.
    fn next(&mut self, period_s: f64) -> AxisVector {
        self.passed += 1.0;
        let [out, fall] = self.periods;
        if self.passed <= out {
            return self.velocity
                + self.acceleration * (gained(self.passed, self.runs_out) * period_s);
        }
        let passed = self.passed - out;
        if passed >= fall {
            return AxisVector::ZERO;
        }
        let share = passed / fall;
        self.steady
            * if self.smooth {
                1.0 - share * share * (3.0 - 2.0 * share)
            } else {
                1.0 - share
            }
    }
}

/// How many periods of an acceleration are gained in the first `periods` periods of its running out, a period's share of
/// `1/runs_out` after the other: never more than the plan would gain, so that no speed gets beyond what was planned.
fn gained(periods: f64, runs_out: f64) -> f64 {
    let periods = periods.min(runs_out.floor());
    if periods > 0.0 {
        periods - periods * (periods + 1.0) / (2.0 * runs_out)
    } else {
        0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn ramp(velocity: [f64; 2], acceleration: [f64; 2], jerk: f64) -> Ramp {
        let lanes = |[x, y]: [f64; 2]| AxisVector::from_slice(&[x, y, x + y, x - y]);
        let mut ramp = Ramp {
            position: AxisVector::ZERO,
            velocity: lanes(velocity),
            acceleration: lanes(acceleration),
            most: [1000.0, 800.0, 900.0, 900.0, 0.0, 0.0, 0.0, 0.0],
            jerk: [jerk; MAX_AXES],
            period_s: 0.001,
            together: None,
            axes: MAX_AXES,
        };
        ramp.together = Some(Together::new(&ramp, 4));
        ramp
    }

    /// An axis by itself comes to a rest that is exactly one, in the time of a ramp of its acceleration to its limit and back.
    #[test]
    fn an_axis_by_itself_comes_to_rest_and_not_only_near_it() {
        for velocity in [150.0, 20.0, 0.5, 1e-3, -1e-3, -70.0] {
            let mut ramp = Ramp {
                together: None,
                ..ramp([velocity, 0.0], [0.0; 2], 20_000.0)
            };
            let periods = (1..1000).find(|_| {
                ramp.next();
                ramp.is_over()
            });
            let (most, jerk): (f64, f64) = (800.0, 20_000.0);
            let peak = most.min((velocity.abs() * jerk).sqrt());
            let longest = 1.2 * (velocity.abs() / peak + peak / jerk) / ramp.period_s + 5.0;
            assert!(
                periods.is_some_and(|periods| f64::from(periods) <= longest),
                "{velocity} mm/s: {periods:?} periods, {longest} at most"
            );
        }
    }

    /// A double far from zero is as coarse as its last digit: what that makes of a straight line is one, and the same near zero is none.
    #[test]
    fn what_rounding_makes_of_a_line_far_from_zero_is_a_line() {
        const FAR_MM: f64 = 1000.0;
        let is_line = |position_mm: f64| {
            let mut ramp = ramp([100.0, 50.0], [-10.0, -5.0], 0.01);
            ramp.acceleration[1] += 2.0 * f64::EPSILON * FAR_MM / ramp.period_s.powi(2);
            ramp.position = AxisVector([position_mm; MAX_AXES]);
            Line::new(&ramp, 2).is_some()
        };
        assert!(is_line(FAR_MM));
        assert!(!is_line(1.0));
    }

    proptest! {
        /// From any state within the limits, every entry keeps them, and a sum of axes stays their sum.
        #[test]
        fn together_within_all_limits(
            v in proptest::array::uniform2(-150.0..150.0f64), a in proptest::array::uniform2(-440.0..440.0f64),
            jerk in prop_oneof![Just(f64::INFINITY), 5_000.0..50_000.0f64],
        ) {
            let mut ramp = ramp(v, if jerk.is_finite() { a } else { [0.0; 2] }, jerk);
            let start = ramp;
            let (mut velocity, mut acceleration) = (ramp.velocity, ramp.acceleration);
            for _ in 0..20_000 {
                if ramp.is_over() { break; }
                let at = ramp.next();
                prop_assert!((at[2] - at[0] - at[1]).abs() < 1e-9 && (at[3] - at[0] + at[1]).abs() < 1e-9);
                let next = (ramp.velocity - velocity) * 1e3;
                let change = (next - acceleration) * 1e3;
                // What the entry that needs longest gains while its acceleration runs out at its jerk limit.
                let longest_s = (0..4).fold(0.0, |most: f64, i| most.max(start.acceleration[i].abs() / jerk));
                for i in 0..4 {
                    let gain = 0.5 * start.acceleration[i].abs() * longest_s;
                    prop_assert!(ramp.velocity[i].abs() <= start.velocity[i].abs() + gain + 1e-9, "{i}");
                    prop_assert!(next[i].abs() <= ramp.most[i] * (1.0 + 1e-6), "{i}: {}", next[i]);
                    prop_assert!(change[i].abs() <= jerk * 1.01, "{i}: {}", change[i]);
                }
                (velocity, acceleration) = (ramp.velocity, next);
            }
            prop_assert!(ramp.is_over());
        }

        /// Also where the jerk reaches the whole acceleration within a part of a period: what is left of a stop as rounding of the one
        /// is more than the other allows.
        #[test]
        fn a_lane_keeps_its_acceleration_to_its_last_sample(
            speed in 0.1..200.0f64, most in 1.0..5000.0f64, decades in -2.5..1.3f64, period_s in 1e-4..2e-3f64,
        ) {
            let jerk = most / (10f64.powf(decades) * period_s);
            let mut lane = Lane { velocity: speed, acceleration: 0.0, most, jerk };
            let mut before = speed;
            for _ in 0..2_000_000 {
                lane.slow(period_s);
                let acceleration = (lane.velocity - before) / period_s;
                prop_assert!(acceleration.abs() <= most * (1.0 + 1e-9), "{acceleration} of {most}");
                before = lane.velocity;
                if lane.velocity == 0.0 { break; }
            }
            prop_assert!(lane.velocity == 0.0);
        }

        /// What a period can bring to rest within the jerk limit is at rest behind it, of velocity and of acceleration: no rounding is left.
        #[test]
        fn a_lane_that_can_come_to_rest_in_a_period_is_exactly_at_rest_behind_it(
            left in -0.999..0.999f64, change in -0.999..0.999f64, jerk in 100.0..100_000.0f64, period_s in 1e-4..2e-3f64,
        ) {
            let step = jerk * period_s;
            let velocity = left * step * period_s;
            let acceleration = change * step - velocity / period_s;
            let mut lane = Lane { velocity, acceleration, most: 3.0 * step, jerk };
            lane.slow(period_s);
            prop_assert_eq!((lane.velocity, lane.acceleration), (0.0, 0.0));
        }

        /// A plan brakes to rest with all that the axis has, as towards the end of its travel, and is given up on the way.
        #[test]
        fn goes_no_farther_than_a_plan_that_brakes_already(
            speed in 1.0..200.0f64, most in 100.0..5000.0f64, building_s in 0.003..0.1f64, period_s in 1e-4..1e-3f64,
            phase in 0.0..1.0f64, at in 0.0..1.0f64, direction in 0.0..6.3f64, together in proptest::bool::ANY,
        ) {
            let jerk = most / building_s;
            let ramp_s = building_s.min((speed / jerk).sqrt());
            let held_s = speed / (jerk * ramp_s) - ramp_s;
            let pieces = [(-jerk, ramp_s), (0.0, held_s), (jerk, ramp_s)];
            let plan = |time_s: f64| {
                let (mut left_s, mut x, mut v, mut a) = (time_s, 0.0, speed, 0.0);
                for (j, piece_s) in pieces {
                    let t = f64::min(left_s, piece_s).max(0.0);
                    x += t * (v + t * (a / 2.0 + t * j / 6.0));
                    (v, a) = (v + t * (a + t * j / 2.0), a + t * j);
                    left_s -= piece_s;
                }
                x
            };
            // Before the plan brakes it goes straight on.
            let plan = |time_s: f64| if time_s < 0.0 { speed * time_s } else { plan(time_s) };
            let time_s = 2.0 * ramp_s + held_s;
            let samples = (time_s / period_s).floor();
            let sample = |k: f64| plan((k + phase) * period_s);
            let k = (at * samples).floor();
            let velocity = (sample(k) - sample(k - 1.0)) / period_s;
            let before = (sample(k - 1.0) - sample(k - 2.0)) / period_s;
            // Along a line of two axes whose sum and difference are joints, or one axis by itself.
            let (x, y) = (direction.cos(), direction.sin());
            let shares = if together { [x, y, x + y, x - y] } else { [1.0, 0.0, 0.0, 0.0] };
            let all = |of: f64| AxisVector::from_slice(&shares.map(|share| of * share));
            let limits = |of: f64| std::array::from_fn(|i| of * shares.get(i).map_or(1.0, |share: &f64| share.abs().max(1e-9)));
            let mut ramp = Ramp {
                position: all(sample(k)),
                velocity: all(velocity),
                acceleration: all((velocity - before) / period_s),
                most: limits(most),
                jerk: limits(jerk),
                period_s,
                together: None,
                axes: if together { MAX_AXES } else { 1 },
            };
            if together {
                ramp.together = Some(Together::new(&ramp, 4));
            }
            let (mut velocity, mut acceleration, mut last) = (ramp.velocity, ramp.acceleration, ramp.position);
            for _ in 0..100_000 {
                if ramp.is_over() { break; }
                last = ramp.next();
                let next = (ramp.velocity - velocity) * (1.0 / period_s);
                for i in (0..4).filter(|i| shares[*i].abs() > 1e-6) {
                    let change = (next - acceleration)[i] / period_s;
                    prop_assert!(next[i].abs() <= ramp.most[i] * (1.0 + 1e-6), "{} of {most}", next[i]);
                    prop_assert!(change.abs() <= ramp.jerk[i] * 1.01, "{change} of {jerk}");
                }
                (velocity, acceleration) = (ramp.velocity, next);
            }
            prop_assert!(ramp.is_over());
            let (end, grain) = (plan(time_s), jerk * period_s.powi(3));
            let gone = (0..4).map(|i| last[i] * shares[i]).sum::<f64>() / shares.map(|share| share * share).iter().sum::<f64>();
            prop_assert!(gone <= end + grain, "{} grains beyond", (gone - end) / grain);
        }

        /// The same without a jerk limit, where joints are sums of axes.
        #[test]
        fn together_no_farther_than_a_plan_that_brakes_at_the_limit(
            speed in 0.01..200.0f64, most in 5.0..5000.0f64, period_s in 1e-4..2e-3f64, direction in 0.0..6.3f64,
        ) {
            let (x, y) = (direction.cos(), direction.sin());
            let shares = [x, y, x + y, x - y];
            let mut ramp = ramp([speed * x, speed * y], [0.0; 2], f64::INFINITY);
            ramp.most = std::array::from_fn(|i| most * shares.get(i).map_or(1.0, |share| share.abs().max(1e-9)));
            ramp.period_s = period_s;
            ramp.together = Some(Together::new(&ramp, 4));
            while !ramp.is_over() {
                ramp.next();
            }
            // The velocity of the last samples is that in the middle of their period.
            let now = (speed - most * period_s / 2.0).max(0.0);
            let (gone, end) = (ramp.position[0] * x + ramp.position[1] * y, now * now / (2.0 * most));
            prop_assert!(gone <= end * (1.0 + 1e-9) + 1e-12, "{gone} of {end}");
        }
    }

    /// Without a jerk limit a coordinate slows by what its acceleration takes in a period, and its last sample stands.
    #[test]
    fn a_lane_without_a_jerk_limit_slows_by_its_acceleration() {
        for sign in [-1.0, 1.0] {
            let mut lane = Lane {
                velocity: sign * 2.5,
                acceleration: 0.0,
                most: 1000.0,
                jerk: f64::INFINITY,
            };
            for speed in [1.5, 0.5, 0.0, 0.0] {
                lane.slow(0.001);
                assert_eq!(lane.velocity, sign * speed);
            }
        }
    }
}
