//! How long a stop takes to begin where the plan itself uses the jerk that braking needs.
//!
//! A circle that is driven as fast as the jerk allows leaves none of it to brake with. But what a plan uses shrinks with the cube of
//! the rate σ of program time: what little slower the machine is leaves a little jerk, and with that it gets slower yet. With δ = 1 − σ,
//! g the σ̈ that the whole jerk limit is worth there and r the share of it that is left at σ = 1, for small δ
//!
//! ```text
//! δ̈ = g·(r + 3δ), so δ = r/3·(cosh(√(3g)·t) − 1)
//! ```
//!
//! Once δ is 0.2 the plan uses half of the jerk, and the stop goes on as any other. With r = 1 that takes no longer than any other stop,
//! so what counts is the difference to it. Where r + 3δ is less than [`MIN_JERK_SHARE`], the fine loop begins with that share. So r counts
//! as half of that at least: with all of it the beginning would be counted twice, and a stop would be expected a tenth too early.

use tandem_rings::MIN_JERK_SHARE;
use tandem_sdk::{MAX_AXES, Segment, derivatives};

/// By how much the rate has fallen when the plan uses half of the jerk: 1 − 0.8³ is half. On circles that use up the jerk half of it takes
/// a stop to begin a sixth too early, and twice of it up to a fifth too late
/// (`a_stop_begins_as_late_as_one_that_is_laid_out_step_by_step`).
pub const EASED: f64 = 0.2;

/// The jerk limits that a stop goes by.
#[derive(Clone, Copy, Debug)]
pub struct Easing {
    /// mm/s³; infinite where none is kept.
    jerk_mm_per_s3: [f64; MAX_AXES],
    /// No axis from this one on keeps any.
    lanes: usize,
}

/// How a segment moves along its path where stops in it are looked at: at its beginning, in its middle and at its end.
#[derive(Clone, Copy, Debug)]
pub struct PathMotion {
    /// Local time of the middle and the end, s.
    times_s: [f64; 2],
    /// Path speeds, mm/s.
    pub speeds_mm_per_s: [f64; 3],
    /// Third derivatives of the path coordinate, mm/s³.
    jerks_mm_per_s3: [f64; 3],
}

impl PathMotion {
    /// At `segment`.
    #[inline]
    pub fn at(segment: &Segment) -> Self {
        let [middle_s, end_s] = [0.5 * segment.duration_s, segment.duration_s];
        let path = &segment.path;
        let [middle, _, middle_jerk] = derivatives(path, middle_s);
        let [end, _, end_jerk] = derivatives(path, end_s);
        Self {
            times_s: [middle_s, end_s],
            // At the start they are coefficients.
            speeds_mm_per_s: [path[1], middle, end],
            jerks_mm_per_s3: [6.0 * path[3], middle_jerk, end_jerk],
        }
    }
}

impl Easing {
    /// No limits: a stop begins at once.
    pub const NONE: Self = Self {
        jerk_mm_per_s3: [f64::INFINITY; MAX_AXES],
        lanes: 0,
    };

    /// Makes a stop keep the jerk limit of `axis`, mm/s³. Host.
    pub fn count(&mut self, axis: usize, jerk_mm_per_s3: f64) {
        self.jerk_mm_per_s3[axis] = jerk_mm_per_s3;
        self.lanes = self.lanes.max(axis + 1);
    }

    /// Longest time in which a stop in `segment`, which moves so `along` its path, begins, beyond what any stop takes, s. Zero for plans
    /// that keep no jerk limit. Rough loop; does not allocate.
    pub fn longest_s(&self, segment: &Segment, along: &PathMotion) -> f64 {
        if segment.order < 3 {
            return 0.0;
        }
        let [mut whole, mut left] = [[f64::INFINITY; 3]; 2];
        let lanes = segment.coefficients[..self.lanes].iter();
        for (c, limit) in lanes.zip(&self.jerk_mm_per_s3) {
            if !limit.is_finite() || c[1..] == [0.0; 5] {
                continue;
            }
            let mut look = |n: usize, [velocity, _, jerk]: [f64; 3]| {
                if velocity != 0.0 {
                    whole[n] = smaller(whole[n], limit / velocity.abs());
                    let rest = limit + 1.0_f64.copysign(velocity) * jerk;
                    left[n] = smaller(left[n], rest / velocity.abs());
                }
            };
            // At the start they are coefficients.
            look(0, [c[1], 2.0 * c[2], 6.0 * c[3]]);
            look(1, derivatives(c, along.times_s[0]));
            look(2, derivatives(c, along.times_s[1]));
        }
        let at = |n: usize| {
            let [speed, jerk] = [along.speeds_mm_per_s[n], along.jerks_mm_per_s3[n]];
            begins_s(speed, jerk, left[n], whole[n])
        };
        [0, 1, 2].map(at).into_iter().fold(0.0, f64::max)
    }
}

/// How long a stop takes to begin where the path coordinate has this `speed`, mm/s, and `path_jerk`, mm/s³, beyond what any stop takes,
/// s, where the jerk limits are worth `whole` of the rate's second derivative, 1/s², and the plan leaves `left` of it. What the plan
/// itself brakes with along the path need not be left.
fn begins_s(speed: f64, path_jerk: f64, left: f64, whole: f64) -> f64 {
    // Nothing of the limits is used against the motion, or nothing moves.
    if left >= whole || speed <= 0.0 {
        return 0.0;
    }
    let brakes = (-path_jerk / speed).max(0.0);
    easing_s((left + brakes) / whole, whole)
}

/// The smaller one; the first where the second is no number.
fn smaller(least: f64, value: f64) -> f64 {
    if value < least { value } else { least }
}

/// Time in which a stop begins beyond what any stop takes, s, where the plan leaves the share `left` of the jerk limits, which are
/// worth `whole_per_s2` of the rate's second derivative. Either loop; does not allocate.
pub fn easing_s(left: f64, whole_per_s2: f64) -> f64 {
    if left >= 1.0 {
        return 0.0;
    }
    let eased = |share: f64| (1.0 + 3.0 * EASED / share).acosh();
    (eased(left.max(MIN_JERK_SHARE / 2.0)) - eased(1.0)) / (3.0 * whole_per_s2).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use tandem_sdk::{AxisVector, SegmentFlags};

    /// The limit of both axes, mm/s³.
    const JERK: f64 = 20_000.0;

    fn longest_s(easing: Easing, segment: &Segment) -> f64 {
        easing.longest_s(segment, &PathMotion::at(segment))
    }

    fn limits() -> Easing {
        let mut easing = Easing::NONE;
        easing.count(0, JERK);
        easing.count(1, JERK);
        easing
    }

    /// A piece of 1 ms of a circle of `radius` at `speed` that begins in the direction of the first axis.
    fn turn(radius: f64, speed: f64) -> Segment {
        let mut segment = Segment::rest(&AxisVector::ZERO, 0.001);
        (segment.order, segment.flags) = (3, SegmentFlags::default());
        segment.path[1] = speed;
        segment.coefficients[0][1] = speed;
        segment.coefficients[0][3] = -speed.powi(3) / (radius * radius) / 6.0;
        segment.coefficients[1][2] = speed * speed / radius / 2.0;
        segment
    }

    /// Time in which σ falls until the plan uses half of its jerk, at σ³ = 0.512, with all of the jerk that a plan leaves which uses the share `used` of it at σ = 1, s.
    fn to_eased_s(used: f64, whole: f64) -> f64 {
        let (step_s, mut time_s, mut sigma, mut rate) = (1e-6, 0.0, 1.0, 0.0);
        while f64::powi(sigma, 3) > 0.512 {
            let left = (1.0 - used * f64::powi(sigma, 3)).max(MIN_JERK_SHARE);
            rate -= step_s * whole * left;
            sigma += step_s * rate;
            time_s += step_s;
        }
        time_s
    }

    #[test]
    fn a_stop_begins_as_late_as_one_that_is_laid_out_step_by_step() {
        for (radius, speed) in [(0.65, 20.0), (0.7, 20.0), (0.9, 20.0), (5.0, 80.0)] {
            let (whole, used) = (JERK / speed, speed.powi(3) / (radius * radius) / JERK);
            let expected = to_eased_s(used.min(1.0), whole) - to_eased_s(0.0, whole);
            let easing = longest_s(limits(), &turn(radius, speed));
            assert!(
                (0.96..1.05).contains(&(easing / expected)),
                "{radius} mm at {speed} mm/s: {easing} s, not {expected} s"
            );
        }
    }

    #[test]
    fn a_plan_that_goes_straight_on_or_brakes_itself_puts_no_stop_off() {
        let straight = turn(1e9, 20.0);
        assert!(longest_s(limits(), &straight) < 1e-6);
        let mut brakes = straight;
        for c in [&mut brakes.coefficients[0], &mut brakes.path] {
            c[3] = -JERK / 6.0;
        }
        assert_eq!(longest_s(limits(), &brakes), 0.0);
        let circle = Segment {
            order: 2,
            ..turn(0.6, 20.0)
        };
        assert_eq!(longest_s(limits(), &circle), 0.0, "no jerk limit is kept");
        assert_eq!(longest_s(Easing::NONE, &turn(0.6, 20.0)), 0.0);
    }
}
