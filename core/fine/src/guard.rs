//! The guard: the last word on every sample. It knows limits and nothing else.

use tandem_sdk::{AxisVector, MAX_AXES};

use crate::config::FineConfig;
use crate::fault::{Breach, FaultKind};

/// The one tolerance on velocity and acceleration, relative.
const TOLERANCE: f64 = 1e-6;
/// The one on jerk.
const JERK_TOLERANCE: f64 = 1e-2;
/// Samples whose third difference contains a sample that was sent with a relaxed jerk.
const RELAXED_SAMPLES: u32 = 4;

/// Beyond the end of the travel by no more than this, mm, is inside: the polynomials of a segment are fitted to an arc as closely,
/// and an arc may end, or turn round, at the very end.
const FITTED_MM: f64 = 1e-8;

/// Checks samples against the ones already sent.
#[derive(Debug)]
pub struct Guard {
    config: FineConfig,
    position: AxisVector,
    velocity: AxisVector,
    acceleration: AxisVector,
    /// Samples for which jerk is not judged.
    relaxed: u32,
    /// Per sign and axis: by how much the velocity has changed more than the acceleration limit explains, mm/s.
    buckets: [[f64; MAX_AXES]; 2],
}

/// A sample that passed, or was let pass, as the guard will remember it.
#[derive(Clone, Copy, Debug)]
pub struct Checked {
    velocity: AxisVector,
    acceleration: AxisVector,
    buckets: [[f64; MAX_AXES]; 2],
    /// Beyond the jerk limit, and not held against it.
    pub relaxed: bool,
    /// The first limit broken, if any.
    pub breach: Option<FaultKind>,
}

impl Guard {
    /// At rest at the configured position.
    pub fn new(config: &FineConfig) -> Self {
        let position = config.position;
        let (velocity, acceleration) = (AxisVector::ZERO, AxisVector::ZERO);
        Self { config: *config, position, velocity, acceleration, relaxed: 0, buckets: [[0.0; MAX_AXES]; 2] }
    }

    /// The last position sent.
    pub fn position(&self) -> &AxisVector {
        &self.position
    }

    /// The velocity of the last period, mm/s.
    pub fn velocity(&self) -> &AxisVector {
        &self.velocity
    }

    /// The acceleration of the last period, mm/s².
    pub fn acceleration(&self) -> &AxisVector {
        &self.acceleration
    }

    /// No rate is known that keeps the jerk limit with the next sample: where it does not, that is not held against it.
    pub fn relax_jerk(&mut self) {
        self.relaxed = RELAXED_SAMPLES;
    }

    /// Calls the place where the machine rests otherwise: `by` is added to the last position sent.
    pub fn correct(&mut self, by: &AxisVector) {
        self.position += *by;
    }

    /// Stands still at `position` from here on, wherever that is.
    pub fn place(&mut self, position: &AxisVector) {
        *self = Self::new(&FineConfig { position: *position, ..self.config });
    }

    /// Judges `next` as the sample after the last one sent; the travel of the axes `unhomed`, a bit each, does not count.
    pub fn check(&self, next: &AxisVector, unhomed: u32) -> Checked {
        let (velocity, acceleration) = (AxisVector::ZERO, AxisVector::ZERO);
        let mut checked = Checked { velocity, acceleration, buckets: self.buckets, relaxed: false, breach: None };
        for axis in 0..self.config.lane_count() {
            let travels = unhomed >> axis & 1 == 0;
            let breach = self.check_axis(axis, next[axis], travels, &mut checked);
            checked.breach = checked.breach.or(breach);
        }
        checked
    }

    /// Remembers that `next` was sent.
    pub fn sent(&mut self, next: &AxisVector, checked: &Checked) {
        self.position = *next;
        (self.velocity, self.acceleration) = (checked.velocity, checked.acceleration);
        self.relaxed = self.relaxed.saturating_sub(1);
        self.buckets = checked.buckets;
    }

    fn check_axis(&self, axis: usize, next: f64, travels: bool, checked: &mut Checked) -> Option<FaultKind> {
        let limits = &self.config.limits.axes[axis];
        let period_s = self.config.period_s;
        // Each velocity is a difference of two positions that are known to half a unit in the last place.
        let rounding = 4.0 * f64::EPSILON * next.abs().max(1.0) / period_s;
        let velocity = (next - self.position[axis]) / period_s;
        let change = velocity - self.velocity[axis];
        checked.velocity[axis] = velocity;
        let leak = limits.acceleration_mm_per_s2 * (1.0 + TOLERANCE) * period_s + rounding;
        let mut fullest = 0.0f64;
        for (sign, bucket) in [change, -change].into_iter().zip(&mut checked.buckets) {
            bucket[axis] = (bucket[axis] + sign - leak).max(0.0);
            fullest = fullest.max(bucket[axis]);
        }
        let breach = |breach, value, limit| Some(FaultKind::Guard { breach, axis, value, limit });
        if !next.is_finite() {
            return breach(Breach::NotFinite, next, 0.0);
        }
        // Who stands outside of the travel may go inward only.
        let (lowest, highest) = (limits.min_mm.min(self.position[axis]), limits.max_mm.max(self.position[axis]));
        let forgiven = FITTED_MM + rounding;
        if travels && (next < lowest - forgiven || next > highest + forgiven) {
            let nearest = if next < lowest { limits.min_mm } else { limits.max_mm };
            return breach(Breach::Position, next, nearest);
        }
        let fastest = limits.feed_mm_per_s.max(limits.rapid_mm_per_s);
        if velocity.abs() > fastest * (1.0 + TOLERANCE) + rounding {
            return breach(Breach::Velocity, velocity, fastest);
        }
        let allowed = self.config.speed_difference_mm_per_s[axis];
        if fullest > allowed * (1.0 + TOLERANCE) + rounding {
            return breach(Breach::Acceleration, change / period_s, limits.acceleration_mm_per_s2);
        }
        if self.config.order >= 3 { self.check_jerk(axis, change / period_s, rounding, checked) } else { None }
    }

    /// Jerk, where the planner keeps it.
    fn check_jerk(&self, axis: usize, acceleration: f64, rounding: f64, checked: &mut Checked) -> Option<FaultKind> {
        let (limit, period_s) = (self.config.limits.axes[axis].jerk_mm_per_s3, self.config.period_s);
        checked.acceleration[axis] = acceleration;
        let value = (acceleration - self.acceleration[axis]) / period_s;
        let beyond = value.abs() > limit * (1.0 + JERK_TOLERANCE) + 4.0 * rounding / (period_s * period_s);
        checked.relaxed |= beyond && self.relaxed > 0;
        (beyond && self.relaxed == 0).then_some(FaultKind::Guard { breach: Breach::Jerk, axis, value, limit })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    use tandem_sdk::{AxisLimits, Limits};

    /// A machine that may step by 2 mm/s, accelerate by 1000 mm/s², and moves at most 1 m.
    fn guard() -> Guard {
        let axis = AxisLimits {
            min_mm: -500.0,
            max_mm: 500.0,
            feed_mm_per_s: 100.0,
            rapid_mm_per_s: 100.0,
            acceleration_mm_per_s2: 1000.0,
            jerk_mm_per_s3: f64::INFINITY,
            speed_difference_mm_per_s: 2.0,
        };
        Guard::new(&FineConfig {
            speed_difference_mm_per_s: [2.0; MAX_AXES],
            enable_periods: 1,
            disable_periods: 1,
            ..FineConfig::new(0.001, Limits::new(&[axis; 3]).unwrap())
        })
    }

    /// The first breach over samples of `axis` with these velocities, mm/s.
    fn breach(axis: usize, velocities: &[f64]) -> Option<FaultKind> {
        let (mut guard, mut at) = (guard(), AxisVector::ZERO);
        for velocity in velocities {
            at[axis] += velocity * 0.001;
            let checked = guard.check(&at, 0);
            if checked.breach.is_some() {
                return checked.breach;
            }
            guard.sent(&at, &checked);
        }
        None
    }

    #[test]
    fn the_speed_difference_is_what_is_allowed_and_a_thousandth_more_is_not() {
        for axis in 0..3 {
            for sign in [1.0, -1.0] {
                // What the acceleration explains in a period, and the difference, at once.
                assert_eq!(breach(axis, &[sign * 3.0]), None);
                assert!(breach(axis, &[sign * 3.003]).is_some(), "axis {axis}");
                // The difference is there once in a window, however it is spread.
                assert_eq!(breach(axis, &[sign * 3.0, sign * 4.0, sign * 5.0]), None);
                assert!(breach(axis, &[sign * 3.0, sign * 4.0, sign * 5.003]).is_some(), "axis {axis}");
                // It leaks away by what is not used.
                assert_eq!(breach(axis, &[sign * 3.0, sign * 3.0, sign * 3.0, sign * 6.0]), None);
            }
        }
    }

    #[test]
    fn velocity_and_travel_are_kept_to_their_tolerance() {
        let mut up: Vec<f64> = (1..=100).map(f64::from).collect();
        assert_eq!(breach(1, &up), None);
        up.push(100.001);
        assert!(matches!(breach(1, &up), Some(FaultKind::Guard { breach: Breach::Velocity, axis: 1, .. })));
        let mut guard = guard();
        guard.position[2] = 500.0;
        let mut at = guard.position;
        assert!(guard.check(&at, 0).breach.is_none(), "the end of the travel is travel");
        at[2] += FITTED_MM;
        assert!(guard.check(&at, 0).breach.is_none(), "so closely an arc is fitted");
        at[2] += FITTED_MM;
        let found = guard.check(&at, 0).breach;
        assert!(matches!(found, Some(FaultKind::Guard { breach: Breach::Position, axis: 2, limit: 500.0, .. })));
        assert!(guard.check(&at, 0b100).breach.is_none(), "an axis that is not homed has no travel yet");
    }
}
