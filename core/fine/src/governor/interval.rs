//! What the limits of an axis leave of σ̈ in a period: its acceleration and its jerk are linear in it.

use tandem_rings::MIN_JERK_SHARE;

/// The rate of program time at a point of a period, were σ̈ zero.
#[derive(Clone, Copy, Debug)]
pub(super) struct RateAt {
    pub(super) sigma: f64,
    pub(super) rate_per_s: f64,
    /// Share of the period that has passed there: for as long as that σ̈ acts.
    pub(super) part: f64,
    pub(super) period_s: f64,
}

/// An interval of σ̈.
#[derive(Clone, Copy, Debug)]
pub(super) struct Interval {
    pub(super) low: f64,
    pub(super) high: f64,
}

impl Interval {
    pub(super) const ALL: Self = Self {
        low: f64::NEG_INFINITY,
        high: f64::INFINITY,
    };

    /// Keeps `|constant + slope·x| ≤ most`.
    pub(super) fn keep(&mut self, constant: f64, slope: f64, most: f64) {
        // A constant beyond the limit that nothing can change leaves no interval; rounding is not such a case.
        if slope.abs() < f64::MIN_POSITIVE {
            return;
        }
        let (a, b) = ((-most - constant) / slope, (most - constant) / slope);
        if a.is_nan() || b.is_nan() {
            return;
        }
        if a < b {
            self.narrow(a, b);
        } else {
            self.narrow(b, a);
        }
    }

    /// Keeps what lies between two numbers: an instruction each, where `f64::max` also looks for what is none.
    pub(super) fn narrow(&mut self, low: f64, high: f64) {
        self.low = if low > self.low { low } else { self.low };
        self.high = if high < self.high { high } else { self.high };
    }

    /// Keeps the acceleration `q″σ² + q′σ̇` of an axis within `left`, or what the plan itself takes of it there. `motion` is its
    /// velocity and acceleration in the plan. Without σ̈ the rate may come to more than 1, where σ̈ is to bring it down.
    #[inline]
    pub(super) fn keep_acceleration(&mut self, motion: [f64; 2], at: &RateAt, left: f64) {
        let [velocity, acceleration] = motion;
        let planned = at.sigma * at.sigma * acceleration;
        let rate = at.sigma.min(1.0);
        // σ̈ acts on σ̇ and, where a period is long beside the change of the acceleration, on σ² as well.
        let passed_s = at.part * at.period_s;
        self.keep(
            planned + velocity * at.rate_per_s,
            (velocity + at.sigma * acceleration * passed_s) * passed_s,
            left.max((rate * rate * acceleration).abs()),
        );
    }

    /// Keeps the jerk `q‴σ³ + 3q″σσ̇ + q′σ̈` of an axis within `left`, or a little more than the plan itself takes of it there; and
    /// `beyond` more than that, mm/s³. `motion` is its velocity, acceleration and jerk in the plan.
    #[inline]
    pub(super) fn keep_jerk(
        &mut self,
        motion: [f64; 3],
        at: &RateAt,
        (left, limit): (f64, f64),
        beyond: f64,
    ) {
        let [velocity, acceleration, jerk] = motion;
        let planned = at.sigma * at.sigma * at.sigma * jerk;
        let turning = 3.0 * acceleration * at.sigma;
        let most = left.max(planned.abs() + MIN_JERK_SHARE * limit) + beyond;
        self.keep(
            planned + turning * at.rate_per_s,
            velocity + turning * at.part * at.period_s,
            most,
        );
    }

    pub(super) fn is_empty(&self) -> bool {
        self.low > self.high
    }

    pub(super) fn contains(&self, value: f64) -> bool {
        self.low <= value && value <= self.high
    }

    /// The value nearest to `wanted`; of an empty interval its middle.
    pub(super) fn nearest(&self, wanted: f64) -> f64 {
        if self.is_empty() {
            f64::midpoint(self.low, self.high)
        } else {
            wanted.clamp(self.low, self.high)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The rate falls so fast within a period that σ²q″ changes by more than the margin.
    #[test]
    fn acceleration_is_kept_where_the_rate_changes_much_within_a_period() {
        let (velocity, acceleration, most) = (5.0, 250.0, 300.0);
        let at = RateAt {
            sigma: 0.9,
            rate_per_s: -30.0,
            part: 1.0,
            period_s: 0.0013,
        };
        let mut interval = Interval::ALL;
        interval.keep_acceleration([velocity, acceleration], &at, most);
        for change in [interval.low, interval.high] {
            let sigma = at.sigma + change * at.period_s * at.period_s / 2.0;
            let rate = at.rate_per_s + change * at.period_s;
            let driven = sigma * sigma * acceleration + rate * velocity;
            let off = (driven.abs() - most).abs() / most;
            assert!(off < 2e-3, "{driven} mm/s² of {most}");
        }
    }

    /// The rate would go beyond 1 within the period and is brought down to less than it was: what it would have been there is no part of what
    /// is driven.
    #[test]
    fn acceleration_is_kept_where_a_rise_beyond_the_end_of_the_range_is_turned_round() {
        let (velocity, acceleration, most) = (626.0, -191_900.0, 191_700.0_f64);
        let (sigma, rate_per_s, period_s) = (0.9917, 19.9, 0.0016);
        let at = RateAt {
            sigma: sigma + rate_per_s * period_s,
            rate_per_s,
            part: 1.0,
            period_s,
        };
        let mut interval = Interval::ALL;
        interval.keep_acceleration([velocity, acceleration], &at, most);
        let end = at.sigma + interval.low * period_s * period_s / 2.0;
        let rate = rate_per_s + interval.low * period_s;
        let driven = end * end * acceleration + rate * velocity;
        assert!(driven > -1.005 * most, "{driven} mm/s² of {most}");
    }

    /// The jerk of an axis at the ends of the interval is what is left of the limit, or a little more than the plan itself takes, and
    /// `beyond` more than that.
    #[test]
    fn jerk_is_kept_to_what_is_left_or_to_what_the_plan_takes_and_no_further() {
        let (sigma, limit) = (0.8, 1000.0);
        for (planned_jerk, beyond) in [(300.0, 0.0), (1900.0, 0.0), (-1900.0, 0.0), (300.0, 70.0)] {
            for (velocity, acceleration, rate_per_s) in [(5.0, 0.0, 0.0), (-5.0, 40.0, 0.3)] {
                let at = RateAt {
                    sigma,
                    rate_per_s,
                    part: 0.5,
                    period_s: 0.002,
                };
                let mut interval = Interval::ALL;
                let motion = [velocity, acceleration, planned_jerk];
                interval.keep_jerk(motion, &at, (900.0, limit), beyond);
                let of_plan = sigma.powi(3) * planned_jerk;
                let allowed = f64::max(900.0, of_plan.abs() + MIN_JERK_SHARE * limit) + beyond;
                for change in [interval.low, interval.high] {
                    let rate = rate_per_s + 0.5 * 0.002 * change;
                    let driven = of_plan + 3.0 * acceleration * sigma * rate + velocity * change;
                    assert!(
                        (driven.abs() - allowed).abs() < 1e-6,
                        "{driven} mm/s³ of {allowed}"
                    );
                }
                assert!(interval.low < interval.high);
            }
        }
    }

    #[test]
    fn an_interval_has_its_ends_and_what_is_between_them_and_an_empty_one_is_met_in_its_middle() {
        let interval = Interval {
            low: -2.0,
            high: 3.0,
        };
        for (value, is_in) in [
            (-2.1, false),
            (-2.0, true),
            (0.0, true),
            (3.0, true),
            (3.1, false),
        ] {
            assert_eq!(interval.contains(value), is_in, "{value}");
            assert_eq!(interval.nearest(value), value.clamp(-2.0, 3.0));
        }
        let empty = Interval {
            low: 3.0,
            high: -2.0,
        };
        assert!(empty.is_empty() && !interval.is_empty() && !Interval::ALL.is_empty());
        assert_eq!(empty.nearest(7.0), 0.5);
    }
}
