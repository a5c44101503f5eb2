//! The mechanics of one simulated joint.

/// Motor current per acceleration of a second-order joint, A per mm/s² (per rad/s² for a rotary joint): 1 A at 1000 mm/s².
pub const CURRENT_A_PER_MM_PER_S2: f64 = 1e-3;

/// Where a joint is and how fast it moves, mm and mm/s (rad and rad/s).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Motion {
    pub position: f64,
    pub speed: f64,
}

impl Motion {
    /// One period of braking at `deceleration` without looking at any setpoint, exactly integrated. Fine loop.
    pub fn brake(&mut self, deceleration: f64, period_s: f64) {
        let change = deceleration * period_s;
        if self.speed.abs() <= change {
            self.position += self.speed * self.speed.abs() / (2.0 * deceleration);
            self.speed = 0.0;
        } else {
            let change = change.copysign(self.speed);
            self.position += (self.speed - change / 2.0) * period_s;
            self.speed -= change;
        }
    }
}

/// A servo x″ = ω²·(r − x) − 2ζω·x′ over one fine period, in closed form: exact and stable for every ω, ζ and period.
///
/// The drive interpolates linearly between two setpoints, as interpolating drives do. At the end of the period it is
/// compared with the setpoint it was heading for, so that ω → ∞ is the ideal drive, and at constant velocity v the
/// following error is exactly 2ζv/ω.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Servo {
    /// Transition of (x, x′) towards a setpoint of zero over one period: the matrix exponential.
    transition: [[f64; 2]; 2],
    /// Lag behind a ramp, s: 2ζ/ω.
    lag_s: f64,
    period_s: f64,
}

impl Servo {
    /// The servo with undamped natural frequency `omega` (rad/s) and damping ratio `zeta`.
    pub fn new(omega: f64, zeta: f64, period_s: f64) -> Self {
        let (even, odd) = decaying_pair(omega, zeta, period_s);
        let damping = zeta * omega * odd;
        let transition = [
            [even + damping, odd],
            [-omega * omega * odd, even - damping],
        ];
        Self {
            transition,
            lag_s: 2.0 * zeta / omega,
            period_s,
        }
    }

    /// One period in which the setpoint runs from `from` to `to`. Fine loop; does not allocate.
    pub fn follow(&self, motion: &mut Motion, from: f64, to: f64) {
        // Steady motion along this ramp is one solution; what deviates from it obeys the equation without setpoint.
        let slope = (to - from) / self.period_s;
        let lag = slope * self.lag_s;
        let [x, v] = [motion.position - (from - lag), motion.speed - slope];
        let [[xx, xv], [vx, vv]] = self.transition;
        motion.position = to - lag + xx * x + xv * v;
        motion.speed = slope + vx * x + vv * v;
    }
}

/// `e^(−ζωt)·cos(ω′t)` and `e^(−ζωt)·sin(ω′t)/ω′` with `ω′ = ω√(1−ζ²)`; hyperbolic functions where ζ > 1.
fn decaying_pair(omega: f64, zeta: f64, t: f64) -> (f64, f64) {
    let decay = zeta * omega;
    let split = omega * ((1.0 - zeta) * (1.0 + zeta)).abs().sqrt();
    if split == 0.0 {
        let e = (-decay * t).exp();
        (e, e * t)
    } else if zeta < 1.0 {
        let (sin, cos) = (split * t).sin_cos();
        let e = (-decay * t).exp();
        (e * cos, e * sin / split)
    } else {
        // The slow root −ζω + ω′ as −ω²/(ζω + ω′): cosh, sinh and that difference would overflow and cancel.
        let slow = (-omega * omega / (decay + split) * t).exp();
        let gap = (-2.0 * split * t).exp_m1();
        (slow * (2.0 + gap) / 2.0, slow * -gap / (2.0 * split))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::f64::consts::{PI, TAU};

    /// Classical Runge-Kutta with many small steps: an independent integration of the same equation.
    fn runge_kutta(start: Motion, omega: f64, zeta: f64, ramp: (f64, f64), period: f64) -> Motion {
        let steps = 2000;
        let h = period / f64::from(steps);
        let rate = |t: f64, [x, v]: [f64; 2]| {
            let r = ramp.0 + (ramp.1 - ramp.0) * t / period;
            [v, omega * omega * (r - x) - 2.0 * zeta * omega * v]
        };
        let go = |[x, v]: [f64; 2], [dx, dv]: [f64; 2], h: f64| [x + h * dx, v + h * dv];
        let mut s = [start.position, start.speed];
        for step in 0..steps {
            let t = f64::from(step) * h;
            let a = rate(t, s);
            let b = rate(t + h / 2.0, go(s, a, h / 2.0));
            let c = rate(t + h / 2.0, go(s, b, h / 2.0));
            let d = rate(t + h, go(s, c, h));
            s = go(
                s,
                std::array::from_fn(|i| (a[i] + 2.0 * b[i] + 2.0 * c[i] + d[i]) / 6.0),
                h,
            );
        }
        Motion {
            position: s[0],
            speed: s[1],
        }
    }

    #[test]
    fn closed_form_agrees_with_runge_kutta() {
        for zeta in [0.05, 0.7, 0.999_999_999, 1.0, 1.000_000_001, 1.4, 8.0] {
            let start = Motion {
                position: 3.0,
                speed: -40.0,
            };
            let mut motion = start;
            Servo::new(190.0, zeta, 0.004).follow(&mut motion, 2.0, 2.5);
            let expected = runge_kutta(start, 190.0, zeta, (2.0, 2.5), 0.004);
            assert!(
                (motion.position - expected.position).abs() < 1e-9,
                "ζ {zeta}: {motion:?} {expected:?}"
            );
            assert!(
                (motion.speed - expected.speed).abs() < 1e-7,
                "ζ {zeta}: {motion:?} {expected:?}"
            );
        }
    }

    #[test]
    fn step_response_overshoots_by_the_formula() {
        for zeta in [0.2_f64, 0.5, 0.7] {
            let servo = Servo::new(TAU * 30.0, zeta, 1e-5);
            let mut motion = Motion::default();
            let highest = (0..20_000).fold(0.0_f64, |highest, _| {
                servo.follow(&mut motion, 1.0, 1.0);
                highest.max(motion.position)
            });
            let formula = 1.0 + (-PI * zeta / (1.0 - zeta * zeta).sqrt()).exp();
            assert!(
                (highest - formula).abs() < 1e-6,
                "ζ {zeta}: {highest} {formula}"
            );
        }
    }

    #[test]
    fn braking_ends_at_the_formula() {
        let mut motion = Motion {
            position: 10.0,
            speed: -100.0,
        };
        let periods = (0..1000).take_while(|_| {
            motion.brake(5000.0, 0.0011);
            motion.speed != 0.0
        });
        assert_eq!(
            periods.count(),
            18,
            "100 / 5000 s are 18.2 periods of 1.1 ms"
        );
        assert!(
            (motion.position - 9.0).abs() < 1e-12,
            "10 − 100²/(2·5000) mm, not {}",
            motion.position
        );
    }

    proptest! {
        #[test]
        fn settles_whatever_the_options(hz in 1e-3..1e5_f64, zeta in 1e-3..1e3_f64, period in 1e-5..0.01_f64) {
            let servo = Servo::new(TAU * hz, zeta, period);
            // Energy relative to the setpoint never grows: the transition is a contraction in that norm.
            let omega = TAU * hz;
            let energy = |m: &Motion| (m.position - 5.0).powi(2) + (m.speed / omega).powi(2);
            let mut motion = Motion { position: -3.0, speed: 70.0 };
            for _ in 0..50 {
                let before = energy(&motion);
                servo.follow(&mut motion, 5.0, 5.0);
                prop_assert!(energy(&motion) <= before * (1.0 + 1e-9) + 1e-24, "{motion:?}");
            }
        }

        #[test]
        fn following_error_at_constant_velocity(hz in 5.0..200.0_f64, zeta in 0.3..3.0_f64, v in -500.0..500.0_f64) {
            let servo = Servo::new(TAU * hz, zeta, 0.001);
            let mut motion = Motion::default();
            let setpoint = |tick: i32| f64::from(tick) * 0.001 * v;
            for tick in 0..10_000 {
                servo.follow(&mut motion, setpoint(tick), setpoint(tick + 1));
            }
            let error = setpoint(10_000) - motion.position;
            prop_assert!((error - v * 2.0 * zeta / (TAU * hz)).abs() < 1e-9 * v.abs().max(1.0));
            prop_assert!((motion.speed - v).abs() < 1e-6);
        }
    }
}
