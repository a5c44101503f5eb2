//! The governor where jerk is not limited: σ changes linearly within a period.

use super::Governor;
use super::tuning::ORDER2_LIMIT_SHARE;
use crate::period_points::PeriodPoints;

impl Governor {
    /// The rate at the end of this period, as near to `target` as the limits let it come.
    pub fn choose(&self, target: f64, points: &PeriodPoints) -> f64 {
        self.choose_within(self.sigma, target, points, self.period_s)
    }

    /// The same from the rate `sigma`, within `time_s`.
    pub fn choose_within(
        &self,
        sigma: f64,
        target: f64,
        points: &PeriodPoints,
        time_s: f64,
    ) -> f64 {
        let direction = if target > sigma { 1.0 } else { -1.0 };
        let mut most = (target - sigma).abs();
        for point in points.iter() {
            for axis in 0..self.axes {
                let planned = (point.velocity[axis] / time_s, point.acceleration[axis]);
                most = most.min(reach(sigma, planned, self.acceleration[axis], direction));
            }
        }
        (sigma + direction * most).clamp(0.0, 1.0)
    }
}

/// How far σ may go from `sigma` in `direction` within a time T before an axis with the planned velocity, divided by T, and
/// acceleration meets its `limit`.
///
/// With σ going from σ₀ to σ₀ + d·t the axis accelerates by `σ²·q″ + d·t/T·q′`: at the start of the time linear in t, at its
/// end quadratic. Where it is within the limit at both ends, it is so in between.
fn reach(
    sigma: f64,
    (velocity_per_s, acceleration): (f64, f64),
    limit: f64,
    direction: f64,
) -> f64 {
    let planned = sigma * sigma * acceleration;
    let most = (ORDER2_LIMIT_SHARE * limit).max(planned.abs());
    let turned = direction * velocity_per_s;
    let slope = turned + 2.0 * direction * sigma * acceleration;
    let up =
        crossing(most - planned, turned, 0.0).min(crossing(most - planned, slope, acceleration));
    let down =
        crossing(most + planned, -turned, 0.0).min(crossing(most + planned, -slope, -acceleration));
    up.min(down)
}

/// The first t ≥ 0 at which `slope·t + curve·t²` rises through `gap ≥ 0`; infinite where it never does.
fn crossing(gap: f64, slope: f64, curve: f64) -> f64 {
    let discriminant = slope * slope + 4.0 * curve * gap;
    if discriminant < 0.0 {
        return f64::INFINITY;
    }
    let root = discriminant.sqrt();
    // In each case the form that does not cancel.
    if slope > 0.0 {
        2.0 * gap / (slope + root)
    } else if curve > 0.0 {
        (root - slope) / (2.0 * curve)
    } else {
        f64::INFINITY
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use tandem_sdk::{AxisLimits, MAX_AXES};

    #[test]
    fn every_axis_bounds_the_rate_and_not_only_the_first_and_the_last() {
        let axis = AxisLimits {
            min_mm: -1.0,
            max_mm: 1.0,
            feed_mm_per_s: 100.0,
            rapid_mm_per_s: 100.0,
            acceleration_mm_per_s2: 1000.0,
            jerk_mm_per_s3: f64::INFINITY,
            speed_difference_mm_per_s: 0.0,
        };
        let limits = [axis; MAX_AXES];
        for moving in 0..3 {
            let mut segment = tandem_sdk::Segment::rest(&tandem_sdk::AxisVector::ZERO, 1.0);
            segment.coefficients[moving][1] = 50.0;
            let mut points = PeriodPoints::new(&limits, 3);
            points.add(&segment, 0.0, 0.001);
            // 1000 mm/s² take 1 mm/s of 50 in a period.
            let sigma = Governor::new(&limits, 3, 0.001).choose(0.0, &points);
            assert!(
                (sigma - (1.0 - ORDER2_LIMIT_SHARE / 50.0)).abs() < 1e-9,
                "axis {moving}: {sigma}"
            );
        }
    }

    /// The share of its limit that an axis reaches where σ has gone by `change` from `sigma`: at the start and at the end of the time.
    fn reached(sigma: f64, [velocity_per_s, acceleration]: [f64; 2], change: f64) -> [f64; 2] {
        [sigma, sigma + change]
            .map(|sigma| (sigma * sigma * acceleration + change * velocity_per_s).abs())
    }

    /// At the limit already, and about to rise beyond it: there is no room, though nothing changes yet.
    #[test]
    fn a_rise_from_the_limit_crosses_it_at_once() {
        assert_eq!(crossing(0.0, 0.0, 1.0), 0.0);
        assert_eq!(crossing(0.0, 1.0, 0.0), 0.0);
        assert_eq!(crossing(0.0, 0.0, 0.0), f64::INFINITY);
        assert_eq!(crossing(0.0, 0.0, -1.0), f64::INFINITY);
    }

    proptest! {
        /// Up and down σ goes just so far that the axis comes to its limit, or to what the plan itself takes where that is more, at one end
        /// of the time, and at no change before that.
        #[test]
        fn the_rate_goes_as_far_as_brings_an_axis_to_its_limit(
            sigma in 0.0..1.0f64, velocity_per_s in -1e4..1e4f64, acceleration in -1500.0..1500.0f64, rises in proptest::bool::ANY,
        ) {
            const LIMIT: f64 = 1000.0;
            let direction = if rises { 1.0 } else { -1.0 };
            let planned = [velocity_per_s, acceleration];
            let most = (ORDER2_LIMIT_SHARE * LIMIT).max(sigma * sigma * acceleration.abs());
            let far = reach(sigma, planned.into(), LIMIT, direction);
            for step in 0..=100 {
                let change = direction * far.min(10.0) * f64::from(step) / 100.0;
                let [start, end] = reached(sigma, planned, change);
                prop_assert!(start.max(end) <= most * (1.0 + 1e-9), "{start} and {end} of {most} at {change} of {far}");
            }
            if far.is_finite() {
                let [start, end] = reached(sigma, planned, direction * far);
                prop_assert!(start.max(end) >= most * (1.0 - 1e-6), "{start} and {end} of {most} at {far}");
            }
        }

        #[test]
        fn the_crossing_is_the_first(gap in 0.0..10.0f64, slope in -5.0..5.0f64, curve in -5.0..5.0f64) {
            let at = |t: f64| slope * t + curve * t * t;
            let t = crossing(gap, slope, curve);
            let until = if t.is_finite() { t } else { 1e3 };
            for step in 0..100 {
                let earlier = until * f64::from(step) / 100.0;
                prop_assert!(at(earlier) <= gap + 1e-6 * (1.0 + gap), "{t}: {} at {earlier}", at(earlier));
            }
            prop_assert!(t.is_infinite() || (at(t) - gap).abs() <= 1e-6 * (1.0 + gap));
        }
    }
}
