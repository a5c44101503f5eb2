//! Laws of motion along one coordinate whose second derivative is bounded: how to come to rest in the shortest time.

/// The second derivative, within `±most`, that brings a double integrator to `x = 0, rate = 0`, coming in with `coming_in`.
///
/// The discrete time-optimal law of Han, "From PID to Active Disturbance Rejection Control", IEEE Trans. Ind. Electron.
/// 56(3), 2009, equation (5), for `x ← x + h·rate, rate ← rate + h·u`: it reaches rest without chatter. Here the curve on
/// which it comes in is drawn with `coming_in ≤ most`, so that there is room to get back onto it when what `most` may be
/// changes on the way. A sampled motion with u constant within each period has this form in `x − h·rate/2`, which the
/// caller passes.
pub fn to_rest(x: f64, rate: f64, coming_in: f64, most: f64, period_s: f64) -> f64 {
    let step = coming_in * period_s * period_s;
    if step <= 0.0 {
        return 0.0;
    }
    let ahead = period_s * rate;
    let y = x + ahead;
    let far = (step * (step + 8.0 * y.abs())).sqrt();
    let off = if y.abs() < step {
        ahead + y
    } else {
        ahead + y.signum() * (far - step) / 2.0
    };
    (-off / (period_s * period_s)).clamp(-most, most)
}

/// The shortest time in which a coordinate with `rate` and `change` of it comes to rest, s: `|change| ≤ most` where it is not
/// more already, and the change of that within `±jerk`.
pub fn stop_s(rate: f64, change: f64, most: f64, jerk: f64) -> f64 {
    // Seen so that the rate is to be brought down after the change has come to nothing.
    let down = if rate + change * change.abs() / (2.0 * jerk) < 0.0 {
        -1.0
    } else {
        1.0
    };
    let (rate, change) = (down * rate, down * change);
    let peak = (jerk * rate + change * change / 2.0).max(0.0).sqrt();
    let held = peak.min(most.max(-change));
    let left = if peak > held {
        (rate + change * change / (2.0 * jerk) - held * held / jerk) / held
    } else {
        0.0
    };
    (change + 2.0 * held) / jerk + left
}

/// State along the path and what it may be changed with.
#[derive(Clone, Copy, Debug)]
pub struct Along {
    /// Path speed, mm/s.
    pub speed_mm_per_s: f64,
    /// Path acceleration, mm/s².
    pub acceleration_mm_per_s2: f64,
    /// Deceleration that may be used, mm/s².
    pub max_mm_per_s2: f64,
    /// Jerk that may be used, mm/s³; infinite where it is not limited.
    pub jerk_mm_per_s3: f64,
}

impl Along {
    /// The highest speed at the end of a period from which `end_mm_per_s` is met within `left_mm`, mm/s; never less than
    /// that. Jerk is not limited.
    ///
    /// Speed is linear within periods, so braking is laid out in whole ones. With u the speeds above the end speed `v_e`, u₀
    /// now and u at the end of this period, s = a·T the change in a period and n periods of braking behind this one, the way
    /// in units of T is `(u₀ + u)/2 + v_e` in this period and `(n − ½)·u − s·n(n − 1)/2 + n·v_e` behind it. With
    /// `D = left/T − (v₀ + v_e)/2` that is `n·u = D − n·v_e + s·n(n − 1)/2`, and n is the largest number with which u is not
    /// below the `(n − 1)·s` that take n periods. The next period finds n − 1 and u − s: braking is even, the end speed is
    /// met and not gone below, and rest is met at the place itself.
    pub fn speed_towards(&self, left_mm: f64, end_mm_per_s: f64, period_s: f64) -> f64 {
        let step = self.max_mm_per_s2 * period_s;
        let way = left_mm / period_s - f64::midpoint(self.speed_mm_per_s, end_mm_per_s);
        if step.is_infinite() {
            // Nothing that is queued moves.
            return f64::INFINITY;
        }
        if way < end_mm_per_s || step <= 0.0 {
            return end_mm_per_s;
        }
        let slope = end_mm_per_s - step / 2.0;
        let root = (slope * slope + 2.0 * step * way).sqrt();
        // In each case the form that does not cancel.
        let periods = if slope > 0.0 {
            2.0 * way / (slope + root)
        } else {
            (root - slope) / step
        };
        let periods = periods.floor().max(1.0);
        let above =
            (way / periods - end_mm_per_s + step * (periods - 1.0) / 2.0).min(periods * step);
        end_mm_per_s + above.max(0.0)
    }

    /// Way until the speed has come down to `end_mm_per_s`, mm: acceleration to zero, deceleration up, held, and down.
    pub fn way_to_mm(&self, end_mm_per_s: f64) -> f64 {
        let (a, j) = (self.max_mm_per_s2, self.jerk_mm_per_s3);
        let (mut v, mut way_mm) = (self.speed_mm_per_s, 0.0);
        let mut braking = -self.acceleration_mm_per_s2;
        if braking < 0.0 {
            let t = -braking / j;
            way_mm += t * (v + t * j * t / 3.0);
            v += -braking * t / 2.0;
            braking = 0.0;
        }
        let drop = v - end_mm_per_s;
        let ending = braking * braking / (2.0 * j);
        if drop <= ending {
            // What is already under way is more than enough.
            return way_mm + drop.max(0.0) * v / braking.max(f64::MIN_POSITIVE);
        }
        let peak = (j * drop + braking * braking / 2.0)
            .sqrt()
            .min(a.max(braking));
        let rise_s = (peak - braking) / j;
        let fall_s = peak / j;
        let held_s = ((drop - (peak * peak - braking * braking / 2.0) / j) / peak).max(0.0);
        way_mm += rise_s * (v - rise_s * (braking / 2.0 + j * rise_s / 6.0));
        v -= rise_s * (braking + peak) / 2.0;
        way_mm += held_s * (v - peak * held_s / 2.0);
        v -= peak * held_s;
        way_mm + fall_s * (v - fall_s * (peak / 2.0 - j * fall_s / 6.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn along(speed_mm_per_s: f64, max_mm_per_s2: f64) -> Along {
        Along {
            speed_mm_per_s,
            acceleration_mm_per_s2: 0.0,
            max_mm_per_s2,
            jerk_mm_per_s3: f64::INFINITY,
        }
    }

    /// The speeds at the ends of the periods behind it fall by a step each, the last one by what is left, and use up the way.
    #[test]
    fn the_speed_towards_a_place_is_the_highest_of_which_whole_periods_of_braking_use_up_the_way() {
        let (period_s, step) = (0.001, 0.5);
        for end in [0.0, 0.1, 3.0, 40.0] {
            for number in 1..400 {
                let way = f64::from(number * number) * 0.01 + 2.0 * end + 5.0;
                let from = end + 7.0;
                let next =
                    along(from, step / period_s).speed_towards(way * period_s, end, period_s);
                let above = next - end;
                let periods = (above / step - 1e-9).ceil().max(1.0);
                let used = f64::midpoint(from, next) + (periods - 0.5) * above + periods * end
                    - step * periods * (periods - 1.0) / 2.0;
                let last = above - (periods - 1.0) * step;
                assert!(
                    last > -1e-9 && last < step * (1.0 + 1e-9),
                    "{way} to {end}: {next}"
                );
                let slack = way - used;
                // Where it ends faster than it can stop in a period, the end speed is kept until the place is there.
                assert!(
                    slack > -1e-9 && slack < (end + step) * (1.0 + 1e-9),
                    "{way} to {end}: {next}, {slack} left"
                );
                assert!(end > 0.0 || slack < 1e-9, "{way}: {next}, {slack} left");
            }
        }
    }

    #[test]
    fn a_braking_under_way_that_is_more_than_enough_counts_as_if_it_went_on_as_it_is() {
        let enough = Along {
            speed_mm_per_s: 10.0,
            acceleration_mm_per_s2: -1000.0,
            max_mm_per_s2: 2000.0,
            jerk_mm_per_s3: 10_000.0,
        };
        assert_eq!(enough.way_to_mm(5.0), 5.0 * 10.0 / 1000.0);
        assert_eq!(enough.way_to_mm(20.0), 0.0);
    }

    #[test]
    fn the_sampled_law_reaches_rest_in_the_shortest_time_and_stays_there() {
        let h = 0.001;
        for (from, coming_in, most) in [(1.0, 50.0, 50.0), (-0.3, 20.0, 60.0), (0.002, 30.0, 30.0)]
        {
            let (mut x, mut rate, mut periods) = (from, 0.0, 0);
            let peak = (2.0 * f64::abs(from) / (1.0 / most + 1.0 / coming_in)).sqrt();
            let shortest_s = peak / most + peak / coming_in;
            while f64::abs(x) > 1e-9 || f64::abs(rate) > 1e-9 {
                let change = to_rest(x - h * rate / 2.0, rate, coming_in, most, h);
                assert!(change.abs() <= most);
                x += h * (rate + h * change / 2.0);
                rate += h * change;
                periods += 1;
                assert!(x * from > -2.0 * coming_in * h * h, "it goes beyond: {x}");
                assert!(
                    f64::from(periods) * h < 1.02 * shortest_s + 5.0 * h,
                    "{from}: {x}, {rate}"
                );
            }
            assert!(f64::from(periods) * h > 0.98 * shortest_s);
            assert_eq!(to_rest(0.0, 0.0, coming_in, most, h), 0.0);
        }
        assert_eq!(to_rest(1.0, 0.0, 0.0, 1.0, h), 0.0);
    }

    proptest! {
        /// Without a limit of the change the shortest stop is the jerk one way and then the other: of one of the two orders the time that is
        /// given brings both to nothing, whichever way the rate goes and however near its own ramp brings it to that.
        #[test]
        fn the_time_of_a_stop_is_that_of_the_jerk_one_way_and_then_the_other(
            rate_digits in -3.0..3.0f64, of_ramp in -2.0..2.0f64, change in -100.0..100.0f64, jerk in 0.1..1000.0f64,
            is_near in proptest::bool::ANY, is_rising in proptest::bool::ANY,
        ) {
            // Some rates are near those which the change alone brings to nothing.
            let rate = if is_near {
                of_ramp * change * change / (2.0 * jerk)
            } else {
                10f64.powf(rate_digits) * if is_rising { 1.0 } else { -1.0 }
            };
            let time_s = stop_s(rate, change, f64::INFINITY, jerk);
            let most = rate.abs() + change * change / jerk;
            let left = [-jerk, jerk].map(|first| {
                let begins_s = (time_s - change / first) / 2.0;
                let ends_s = time_s - begins_s;
                let reached = change + first * begins_s;
                let left = rate + f64::midpoint(change, reached) * begins_s + reached / 2.0 * ends_s;
                if begins_s.min(ends_s) < -1e-9 * time_s { f64::INFINITY } else { left.abs() }
            });
            prop_assert!(left[0].min(left[1]) <= 1e-9 * most, "{left:?} of {most} left after {time_s} s");
        }

        /// Whatever the deceleration, the feeds and the period are: the end speed is met at the place, never gone below on the
        /// way, and no period brakes harder than it may.
        #[test]
        fn the_end_speed_is_met_and_not_gone_below(
            acceleration in -1.0..5.0f64, from in -2.0..2.5f64, share in 0.0..1.0f64, period in -4.0..-2.7f64,
            way in 1.0..3.0f64, phase in 0.0..1.0f64, rests in proptest::bool::ANY,
        ) {
            let (a, v, period_s) = (10f64.powf(acceleration), 10f64.powf(from), 10f64.powf(period));
            let end = if rests { 0.0 } else { share * v };
            // Enough to brake in whole periods, and one more.
            let enough = (v * v - end * end) / (2.0 * a) * way + (3.0 + phase) * v * period_s + a * period_s * period_s;
            let (mut left, mut speed) = (enough, v);
            let periods = (4.0 * enough / (v + end) / period_s) as u64 + (v / (a * period_s)) as u64 + 10;
            prop_assume!(periods < 200_000);
            for _ in 0..8 * periods {
                let next = along(speed, a).speed_towards(left, end, period_s).min(v);
                prop_assert!(next >= end, "{next} below {end}");
                prop_assert!(speed - next <= a * period_s * (1.0 + 1e-6) + 1e-9 * v, "{speed} to {next}");
                let before = left;
                left -= f64::midpoint(speed, next) * period_s;
                speed = next;
                if left <= 1e-9 * enough || (left < end * period_s && speed <= end * (1.0 + 1e-9)) {
                    let still_mm = (speed * speed - end * end) / (2.0 * a);
                    prop_assert!(still_mm <= left.max(0.0) + 1e-8 * enough, "arrives with {speed} for {end}");
                    prop_assert!(left > -1e-6 * enough - end * period_s, "passed by {}", -left);
                    return Ok(());
                }
                prop_assert!(left < before, "stands still {left} mm before the place");
            }
            prop_assert!(false, "does not arrive: {left} of {enough} left at {speed}");
        }
    }

    /// With a jerk of 1 and a change of 2 at most: a rate of 10 takes 2 to the full change and back, and 5 at the mean of it.
    #[test]
    fn a_stop_takes_as_long_as_its_ramps_and_what_is_held_between_them() {
        for (rate, change, expected_s) in [
            (10.0, 0.0, 7.0),
            (-10.0, 0.0, 7.0),
            // Rising: first that is brought to nothing, by when the rate is 10.5.
            (10.0, 1.0, 1.0 + 7.25),
            // Falling already: a second of that stop is over.
            (10.0, -1.0, 7.25 - 1.0),
            // So low that the full change is not reached.
            (1.0, 0.0, 2.0),
            // Falling so fast that it goes below nothing, to 1.9, and comes back.
            (0.1, -2.0, 2.0 + 2.0 * 1.9f64.sqrt()),
        ] {
            // The same in a time that passes three times as fast.
            for faster in [1.0, 3.0] {
                let found_s = stop_s(rate, faster * change, faster * 2.0, faster * faster);
                assert!(
                    (found_s - expected_s / faster).abs() < 1e-12,
                    "{rate} {change}: {found_s} s, {faster} times as fast"
                );
            }
        }
    }

    /// A stop falls as it rises, so that its way is its time at the mean of both speeds.
    #[test]
    fn the_way_to_a_speed_is_that_of_its_ramps_and_what_is_held_between_them() {
        let low = 2.1f64;
        for (speed, acceleration, end_mm_per_s, expected_mm) in [
            (10.0, 0.0, 0.0, 7.0 * 5.0),
            (10.0, 0.0, 4.0, 5.0 * 7.0),
            // A second in which it still gets faster, to 10.5 mm/s.
            (10.0, 1.0, 0.0, 10.0 + 1.0 / 2.0 - 1.0 / 6.0 + 7.25 * 5.25),
            // Two seconds of that, to 2.1 mm/s, from which the full change is not reached.
            (0.1, 2.0, 0.0, 0.2 + 4.0 - 8.0 / 6.0 + low.sqrt() * low),
            // That stop from 10.5 mm/s, less its first second.
            (10.0, -1.0, 0.0, 7.25 * 5.25 - (10.5 - 1.0 / 6.0)),
        ] {
            // The same way where time passes three times as fast.
            for faster in [1.0, 3.0f64] {
                let way_mm = Along {
                    speed_mm_per_s: faster * speed,
                    acceleration_mm_per_s2: faster.powi(2) * acceleration,
                    max_mm_per_s2: faster.powi(2) * 2.0,
                    jerk_mm_per_s3: faster.powi(3),
                }
                .way_to_mm(faster * end_mm_per_s);
                assert!(
                    (way_mm - expected_mm).abs() < 1e-9,
                    "{speed} {acceleration} to {end_mm_per_s}: {way_mm} mm, {faster} times as fast"
                );
            }
        }
    }

    #[test]
    fn what_leaves_nothing_to_brake_with_asks_for_the_end_speed_and_what_does_not_move_for_none() {
        assert_eq!(along(5.0, 0.0).speed_towards(1.0, 2.0, 1e-3), 2.0);
        assert_eq!(
            along(0.0, f64::INFINITY).speed_towards(1.0, 2.0, 1e-3),
            f64::INFINITY
        );
    }

    /// Braking already, but with less than what brings the speed down in the end: it brakes a little more before it eases.
    #[test]
    fn a_way_with_a_little_more_braking_than_there_is_takes_its_time() {
        let along = Along {
            speed_mm_per_s: 10.0,
            acceleration_mm_per_s2: -1.0,
            max_mm_per_s2: 2.0,
            jerk_mm_per_s3: 10.0,
        };
        // To ease from 1 mm/s² alone takes 0.05 mm/s: the 0.06 need √1.1 mm/s² first.
        let time_s = (2.0 * 1.1f64.sqrt() - 1.0) / 10.0;
        let mean = along.way_to_mm(9.94) / time_s;
        assert!((9.94..10.0).contains(&mean), "{mean} mm/s");
    }
}
