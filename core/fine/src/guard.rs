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
    bounds: [AxisBounds; MAX_AXES],
    position: AxisVector,
    /// The motion with the sample that was sent last, and with the one judged last; which is which changes with each that is
    /// sent, so that nothing is copied.
    last_motions: [LastMotion; 2],
    /// Index of the motion with the one that was sent last.
    sent: usize,
    /// Samples for which jerk is not judged.
    relaxed: u32,
}

/// The limits of an axis or joint with their tolerances: computed once.
#[derive(Clone, Copy, Debug)]
struct AxisBounds {
    min_mm: f64,
    max_mm: f64,
    /// Change of velocity that the acceleration limit explains in a period, mm/s.
    leak_mm_per_s: f64,
    fastest_mm_per_s: f64,
    /// Change of velocity beyond that.
    allowed_mm_per_s: f64,
    most_jerk_mm_per_s3: f64,
}

/// Velocity and acceleration with which a sample was reached, as the differences of samples show it.
#[derive(Clone, Copy, Debug)]
struct LastMotion {
    velocity: AxisVector,
    /// Zero where jerk is not judged.
    acceleration: AxisVector,
    /// Per sign and axis: by how much the velocity has changed more than the acceleration limit explains, mm/s.
    buckets: [[f64; MAX_AXES]; 2],
}

impl LastMotion {
    const REST: Self = Self {
        velocity: AxisVector::ZERO,
        acceleration: AxisVector::ZERO,
        buckets: [[0.0; MAX_AXES]; 2],
    };

    /// Whether `axis` stood in this period and the one before, and no earlier change of its velocity still counts.
    #[inline]
    fn rests(&self, axis: usize) -> bool {
        let [up, down] = &self.buckets;
        self.velocity[axis] == 0.0
            && self.acceleration[axis] == 0.0
            && up[axis] == 0.0
            && down[axis] == 0.0
    }

    /// It stands once more.
    #[inline]
    fn rest(&mut self, axis: usize) {
        self.velocity[axis] = 0.0;
        self.acceleration[axis] = 0.0;
        for bucket in &mut self.buckets {
            bucket[axis] = 0.0;
        }
    }
}

/// What was found of a sample.
#[derive(Clone, Copy, Debug)]
pub struct Checked {
    /// Beyond the jerk limit, and not held against it.
    pub relaxed: bool,
    /// The first limit broken, if any.
    pub breach: Option<FaultKind>,
}

impl Guard {
    /// At rest at the configured position.
    pub fn new(config: &FineConfig) -> Self {
        let bounds = std::array::from_fn(|axis| {
            let limits = &config.limits.axes[axis];
            AxisBounds {
                min_mm: limits.min_mm,
                max_mm: limits.max_mm,
                leak_mm_per_s: limits.acceleration_mm_per_s2 * (1.0 + TOLERANCE) * config.period_s,
                fastest_mm_per_s: limits.feed_mm_per_s.max(limits.rapid_mm_per_s)
                    * (1.0 + TOLERANCE),
                allowed_mm_per_s: config.speed_difference_mm_per_s[axis] * (1.0 + TOLERANCE),
                most_jerk_mm_per_s3: config.limits.axes[axis].jerk_mm_per_s3
                    * (1.0 + JERK_TOLERANCE),
            }
        });
        Self {
            config: *config,
            bounds,
            position: config.position,
            last_motions: [LastMotion::REST; 2],
            sent: 0,
            relaxed: 0,
        }
    }

    /// The last position sent.
    pub fn position(&self) -> &AxisVector {
        &self.position
    }

    /// The velocity of the last period, mm/s.
    pub fn velocity(&self) -> &AxisVector {
        &self.last_motions[self.sent].velocity
    }

    /// The acceleration of the last period, mm/s².
    pub fn acceleration(&self) -> &AxisVector {
        &self.last_motions[self.sent].acceleration
    }

    /// No rate is known that keeps the jerk limit with the next sample: where it does not, that is not held against it.
    pub fn relax_jerk(&mut self) {
        self.relaxed = RELAXED_SAMPLES;
    }

    /// The position at which the machine rests is set anew: `by` is added to the last one sent.
    pub fn correct(&mut self, by: &AxisVector) {
        self.position += *by;
    }

    /// Stands still at `position` from here on, wherever that is.
    pub fn place(&mut self, position: &AxisVector) {
        *self = Self::new(&FineConfig {
            position: *position,
            ..self.config
        });
    }

    /// Judges `next` as the sample after the last one sent; the travel of the axes `unhomed`, a bit each, does not count.
    pub fn check(&mut self, next: &AxisVector, unhomed: u32) -> Checked {
        let [first, second] = &mut self.last_motions;
        let (last, now) = if self.sent == 0 {
            (&*first, second)
        } else {
            (&*second, first)
        };
        let mut judge = Judge {
            config: &self.config,
            bounds: &self.bounds,
            position: &self.position,
            last,
            now,
            relaxes: self.relaxed > 0,
        };
        let mut checked = Checked {
            relaxed: false,
            breach: None,
        };
        // No more than there are, and the compiler sees it.
        for axis in 0..self.config.lane_count().min(MAX_AXES) {
            let travels = unhomed >> axis & 1 == 0;
            let breach = judge.check_axis(axis, next[axis], travels, &mut checked.relaxed);
            if checked.breach.is_none() && breach.is_some() {
                checked.breach = breach;
            }
        }
        checked
    }

    /// Remembers that `next` was sent, which was judged last.
    pub fn sent(&mut self, next: &AxisVector) {
        self.position = *next;
        self.sent = 1 - self.sent;
        self.relaxed = self.relaxed.saturating_sub(1);
    }
}

/// A sample that is judged, against the one sent last.
struct Judge<'a> {
    config: &'a FineConfig,
    bounds: &'a [AxisBounds; MAX_AXES],
    /// The last position sent.
    position: &'a AxisVector,
    last: &'a LastMotion,
    /// The motion with the sample.
    now: &'a mut LastMotion,
    /// Jerk beyond its limit is not held against it.
    relaxes: bool,
}

impl Judge<'_> {
    #[inline]
    fn check_axis(
        &mut self,
        axis: usize,
        next: f64,
        travels: bool,
        relaxed: &mut bool,
    ) -> Option<FaultKind> {
        let bounds = &self.bounds[axis];
        let period_s = self.config.period_s;
        let at = self.position[axis];
        let last = self.last;
        let now = &mut *self.now;
        // What stands where it stood breaks nothing, and leaves nothing behind.
        if next == at && last.rests(axis) {
            now.rest(axis);
            return None;
        }
        // Each velocity is a difference of two positions that are known to half a unit in the last place.
        let rounding = rounding(next, period_s);
        let velocity = (next - at) / period_s;
        let change = velocity - last.velocity[axis];
        let leak = bounds.leak_mm_per_s + rounding;
        let up = larger(last.buckets[0][axis] + change - leak, 0.0);
        let down = larger(last.buckets[1][axis] - change - leak, 0.0);
        (now.velocity[axis], now.acceleration[axis]) = (velocity, 0.0);
        (now.buckets[0][axis], now.buckets[1][axis]) = (up, down);
        // What is true nearly always is looked at first; what is no number is within nothing.
        let forgiven = FITTED_MM + rounding;
        let within = next >= bounds.min_mm - forgiven && next <= bounds.max_mm + forgiven;
        let slow = velocity.abs() <= bounds.fastest_mm_per_s + rounding;
        let even = larger(up, down) <= bounds.allowed_mm_per_s + rounding;
        if !(next.abs() < f64::INFINITY && within && slow && even)
            && let Some(breach) = self.breach_of(axis, next, travels, velocity, change)
        {
            return Some(breach);
        }
        if self.config.order >= 3 {
            self.check_jerk(axis, change / period_s, rounding, relaxed)
        } else {
            None
        }
    }

    /// The limit that `next` breaks, where it does.
    #[cold]
    #[inline(never)]
    fn breach_of(
        &self,
        axis: usize,
        next: f64,
        travels: bool,
        velocity: f64,
        change: f64,
    ) -> Option<FaultKind> {
        let limits = &self.config.limits.axes[axis];
        let bounds = &self.bounds[axis];
        let period_s = self.config.period_s;
        let rounding = rounding(next, period_s);
        let breach = |breach, value, limit| {
            Some(FaultKind::Guard {
                breach,
                axis,
                value,
                limit,
            })
        };
        if !next.is_finite() {
            return breach(Breach::NotFinite, next, 0.0);
        }
        // Who stands outside of the travel may go inward only.
        let lowest = bounds.min_mm.min(self.position[axis]);
        let highest = bounds.max_mm.max(self.position[axis]);
        let forgiven = FITTED_MM + rounding;
        if travels && (next < lowest - forgiven || next > highest + forgiven) {
            let nearest = if next < lowest {
                bounds.min_mm
            } else {
                bounds.max_mm
            };
            return breach(Breach::Position, next, nearest);
        }
        if velocity.abs() > bounds.fastest_mm_per_s + rounding {
            return breach(
                Breach::Velocity,
                velocity,
                limits.feed_mm_per_s.max(limits.rapid_mm_per_s),
            );
        }
        let buckets = &self.now.buckets;
        if larger(buckets[0][axis], buckets[1][axis]) > bounds.allowed_mm_per_s + rounding {
            return breach(
                Breach::Acceleration,
                change / period_s,
                limits.acceleration_mm_per_s2,
            );
        }
        None
    }

    /// Jerk, where the planner keeps it.
    #[inline]
    fn check_jerk(
        &mut self,
        axis: usize,
        acceleration: f64,
        rounding: f64,
        relaxed: &mut bool,
    ) -> Option<FaultKind> {
        let period_s = self.config.period_s;
        self.now.acceleration[axis] = acceleration;
        let value = (acceleration - self.last.acceleration[axis]) / period_s;
        let most = self.bounds[axis].most_jerk_mm_per_s3;
        let beyond = value.abs() > most + 4.0 * rounding / (period_s * period_s);
        *relaxed |= beyond && self.relaxes;
        (beyond && !self.relaxes).then(|| FaultKind::Guard {
            breach: Breach::Jerk,
            axis,
            value,
            limit: self.config.limits.axes[axis].jerk_mm_per_s3,
        })
    }
}

/// By how much a velocity at the position `next`, mm, may be off, mm/s.
fn rounding(next: f64, period_s: f64) -> f64 {
    4.0 * f64::EPSILON * larger(next.abs(), 1.0) / period_s
}

/// The larger of two numbers of which the second is one: one instruction, where `f64::max` also looks for NaN there.
fn larger(value: f64, least: f64) -> f64 {
    if value > least { value } else { least }
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
            guard.sent(&at);
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
                assert!(
                    breach(axis, &[sign * 3.0, sign * 4.0, sign * 5.003]).is_some(),
                    "axis {axis}"
                );
                // It leaks away by what is not used.
                assert_eq!(
                    breach(axis, &[sign * 3.0, sign * 3.0, sign * 3.0, sign * 6.0]),
                    None
                );
            }
        }
    }

    /// What an axis has changed its speed by counts while it stands, and less with each period.
    #[test]
    fn an_axis_that_stands_has_its_steps_back_after_a_while() {
        for axis in 0..3 {
            assert!(breach(axis, &[3.0, 0.0, 0.0, -3.0]).is_some());
            assert_eq!(breach(axis, &[3.0, 0.0, 0.0, 0.0, -3.0]), None);
            assert_eq!(breach(axis, &[0.0, 0.0, 3.0]), None);
            assert!(breach(axis, &[0.0, 0.0, 3.003]).is_some());
        }
    }

    #[test]
    fn velocity_and_travel_are_kept_to_their_tolerance() {
        let mut low = guard();
        low.position[2] = -500.0;
        let mut at = low.position;
        at[2] -= FITTED_MM;
        assert!(low.check(&at, 0).breach.is_none());
        at[2] -= FITTED_MM;
        assert!(low.check(&at, 0).breach.is_some());
        let mut up: Vec<f64> = (1..=100).map(f64::from).collect();
        assert_eq!(breach(1, &up), None);
        up.push(100.001);
        assert!(matches!(
            breach(1, &up),
            Some(FaultKind::Guard {
                breach: Breach::Velocity,
                axis: 1,
                ..
            })
        ));
        let mut guard = guard();
        guard.position[2] = 500.0;
        let mut at = guard.position;
        assert!(
            guard.check(&at, 0).breach.is_none(),
            "the end of the travel is travel"
        );
        at[2] += FITTED_MM;
        assert!(
            guard.check(&at, 0).breach.is_none(),
            "so closely an arc is fitted"
        );
        at[2] += FITTED_MM;
        let found = guard.check(&at, 0).breach;
        assert!(matches!(
            found,
            Some(FaultKind::Guard {
                breach: Breach::Position,
                axis: 2,
                limit: 500.0,
                ..
            })
        ));
        assert!(
            guard.check(&at, 0b100).breach.is_none(),
            "an axis that is not homed has no travel yet"
        );
    }

    /// A guard at this place of the first axis, with this jerk limit.
    fn jerk_guard(at_mm: f64, jerk_mm_per_s3: f64) -> Guard {
        let mut config = guard().config;
        config.order = 3;
        config.position[0] = at_mm;
        for axis in &mut config.limits.axes {
            axis.jerk_mm_per_s3 = jerk_mm_per_s3;
        }
        Guard::new(&config)
    }

    #[test]
    fn jerk_beyond_the_limit_is_counted_while_it_is_relaxed_and_a_breach_afterwards() {
        let relaxed = |before: u32| {
            let mut guard = jerk_guard(0.0, 1000.0);
            guard.relax_jerk();
            let mut at = AxisVector::ZERO;
            for _ in 0..before {
                assert!(guard.check(&at, 0).breach.is_none());
                guard.sent(&at);
            }
            // From rest to 0.1 mm/s in a period: 100 mm/s² at once, a hundred times the jerk.
            at[0] += 1e-4;
            guard.check(&at, 0)
        };
        for before in 0..RELAXED_SAMPLES {
            let checked = relaxed(before);
            assert!(checked.relaxed && checked.breach.is_none(), "{before}");
        }
        let checked = relaxed(RELAXED_SAMPLES);
        assert!(!checked.relaxed);
        assert!(matches!(
            checked.breach,
            Some(FaultKind::Guard {
                breach: Breach::Jerk,
                axis: 0,
                limit: 1000.0,
                ..
            })
        ));
    }

    /// Far from the origin the last bit of a position is more jerk than a slow machine may have.
    #[test]
    fn the_rounding_of_a_place_is_no_jerk() {
        let at_mm = 400.0f64;
        let mut guard = jerk_guard(at_mm, 1e-5);
        for period in 0..40 {
            let place = [at_mm, at_mm.next_up()][usize::from(period % 3 == 0)];
            let at = AxisVector::from_slice(&[place]);
            assert!(guard.check(&at, 0).breach.is_none(), "{period}");
            guard.sent(&at);
        }
        let at = AxisVector::from_slice(&[at_mm + 1e-9]);
        assert!(guard.check(&at, 0).breach.is_some());
    }

    #[test]
    fn a_sample_that_is_refused_leaves_nothing_behind() {
        let (mut plain, mut tempted) = (guard(), guard());
        (plain.config.order, tempted.config.order) = (3, 3);
        let (mut at, mut refused) = (AxisVector::ZERO, 0);
        for period in 0..40 {
            let wild = at + AxisVector([f64::from(period - 20) * 0.01; MAX_AXES]);
            refused += u32::from(tempted.check(&wild, 0).breach.is_some());
            // Up to 8 mm/s and down again, the steps now and then as large as the buckets are full.
            at[0] += 0.001
                * f64::from(if period < 20 {
                    period / 3
                } else {
                    (40 - period) / 2
                });
            let (expected, found) = (plain.check(&at, 0), tempted.check(&at, 0));
            assert_eq!(expected.breach, found.breach, "{period}");
            plain.sent(&at);
            tempted.sent(&at);
            assert_eq!(
                (plain.velocity(), plain.acceleration()),
                (tempted.velocity(), tempted.acceleration())
            );
            assert_eq!(
                plain.last_motions[plain.sent].buckets,
                tempted.last_motions[tempted.sent].buckets
            );
        }
        assert!(refused > 30, "{refused}");
    }

    /// A sample at the very end of the travel is inside: what it breaks beside that is what is named.
    #[test]
    fn at_the_end_of_the_travel_another_limit_is_named() {
        for end_mm in [-500.0, 500.0] {
            let mut config = guard().config;
            config.position[0] = end_mm * (1.0 - 4e-4);
            let mut guard = Guard::new(&config);
            let breach = guard.check(&AxisVector::from_slice(&[end_mm]), 0).breach;
            assert!(matches!(
                breach,
                Some(FaultKind::Guard {
                    breach: Breach::Velocity,
                    axis: 0,
                    ..
                })
            ));
        }
    }
}
