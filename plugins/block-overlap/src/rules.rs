//! What options and machine make of the rules, once for a run.

use tandem_sdk::{AxisVector, JointLanes, MAX_AXES, PlannerContext};

use crate::options::{CornerControl, LimitMode, Options};

/// Planners aim at this share of a limit.
const AIM: f64 = 0.999;

/// Turning may take this share of the acceleration; the rest is left to come to a stop with. With twice as much the axes are not kept to
/// their limits (`random_programs_keep_every_promise`); with half of it the spiral and the serpentine of the examples take 3 and 4 %
/// longer.
pub const TURN_SHARE: f64 = 0.8;

/// On an arc the path acceleration that goes with [`TURN_SHARE`] of centripetal acceleration: 0.6² + 0.8² = 1.
pub const ARC_SHARE: f64 = 0.6;

/// While two blocks overlap, an arc among them asks for this much more than its centripetal acceleration: half of it
/// comes from the change of direction under its own ramp.
pub const ARC_OVERLAP: f64 = 1.5;

/// The rules of a run.
#[derive(Clone, Debug)]
pub struct Rules {
    /// Corner errors are bounded.
    pub controlled: bool,
    /// What keeps the axis limits.
    pub limits: LimitMode,
    /// Short blocks shorten the time constant instead of being slowed by it.
    pub shorten: bool,
    /// Knots lie on ticks: the published rounding.
    pub grid: bool,
    /// Number of axes, and of joints that are limited behind them.
    pub axes: usize,
    /// Per axis 1/acceleration, s²/mm; zero where limits are off.
    pub per_acceleration: AxisVector,
    /// The ends of the travel per entry of `axes`, mm; infinite for joints.
    pub travel_mm: [AxisVector; 2],
    /// Highest axis speeds in feed and in rapid motion, mm/s.
    pub axis_mm_per_s: [AxisVector; 2],
    /// Per axis what a unit counts in path deviation: mm as they are, rotary axes in degrees, joints not at all.
    pub metric: AxisVector,
    /// Bit per linear axis.
    pub linear: u32,
    /// Fine period, s.
    pub tick_s: f64,
    /// By how much the chord between two samples may lie inside a rounded corner, mm.
    pub sag_mm: f64,
    /// Acceleration of the weakest axis, mm/s².
    pub weakest_mm_per_s2: f64,
    /// Tolerance where a block states none, mm.
    pub tolerance_mm: f64,
    /// The programmed feed is planned at this multiple.
    pub feed_ratio: f64,
    /// The joints that are sums of axes, where there are any.
    pub joint_lanes: Option<&'static JointLanes>,
}

impl Rules {
    /// The rules of a machine.
    pub fn new(options: &Options, context: &PlannerContext) -> Self {
        let axes = context.limits.axes();
        let each = |of: &dyn Fn(usize) -> f64, other: f64| {
            AxisVector(std::array::from_fn(|i| {
                if i < axes.len() { of(i) } else { other }
            }))
        };
        let count = context.axes.count();
        let acceleration = |i: usize| AIM * axes[i].acceleration_mm_per_s2;
        let unlimited = options.limits == LimitMode::Off;
        let controlled = options.corner_control == CornerControl::On;
        let metric = each(
            &|i| match i {
                joint if joint >= context.axes.count() => 0.0,
                axis if context.axes.is_rotary(axis) => 1f64.to_degrees(),
                _ => 1.0,
            },
            0.0,
        );
        let is_linear = |axis: &usize| !context.axes.is_rotary(*axis);
        let linear = (0..context.axes.count()).filter(is_linear);
        let linear = linear.fold(0, |bits, axis| bits | 1 << axis);
        let squares = (0..axes.len().min(MAX_AXES)).map(|i| (acceleration(i) * metric[i]).powi(2));
        let tick_s = context.fine_period_s;
        Self {
            controlled,
            axes: axes.len().min(MAX_AXES),
            limits: options.limits,
            shorten: controlled && !unlimited,
            grid: !controlled || unlimited,
            per_acceleration: if unlimited {
                AxisVector::ZERO
            } else {
                each(&|i| 1.0 / acceleration(i), 0.0)
            },
            travel_mm: [
                each(
                    &|i| {
                        if i < count {
                            axes[i].min_mm
                        } else {
                            f64::NEG_INFINITY
                        }
                    },
                    f64::NEG_INFINITY,
                ),
                each(
                    &|i| {
                        if i < count {
                            axes[i].max_mm
                        } else {
                            f64::INFINITY
                        }
                    },
                    f64::INFINITY,
                ),
            ],
            axis_mm_per_s: [
                each(&|i| axes[i].feed_mm_per_s, 0.0),
                each(&|i| axes[i].rapid_mm_per_s, 0.0),
            ],
            metric,
            linear,
            tick_s,
            sag_mm: squares.sum::<f64>().sqrt() * tick_s * tick_s / 8.0,
            weakest_mm_per_s2: (0..axes.len())
                .map(acceleration)
                .fold(f64::INFINITY, f64::min),
            tolerance_mm: context.path_tolerance_mm,
            feed_ratio: context.max_feed_ratio,
            joint_lanes: context.joint_lanes,
        }
    }

    /// Between two directions: the largest |Δu|/acceleration of an axis, s²/mm, and |Δu|² in the metric of deviations. Over
    /// the axes that there are: one after the other they are added up, and each costs its time.
    #[inline]
    pub fn turn(&self, from: &AxisVector, to: &AxisVector) -> (f64, f64) {
        let mut most = 0.0;
        let mut squares = 0.0;
        for axis in 0..self.axes.min(MAX_AXES) {
            let step = to[axis] - from[axis];
            most = greater(most, (step * self.per_acceleration[axis]).abs());
            let off = step * self.metric[axis];
            squares += off * off;
        }
        (most, squares)
    }

    /// The largest |v|/acceleration of an axis.
    #[inline]
    pub fn largest(&self, vector: &AxisVector) -> f64 {
        let shares = vector
            .0
            .iter()
            .zip(&self.per_acceleration.0)
            .take(self.axes);
        shares.fold(0.0, |most, (v, w)| greater(most, (v * w).abs()))
    }

    /// The nearest whole number of ticks, at least one, s.
    pub fn on_tick_s(&self, tau_s: f64) -> f64 {
        (tau_s / self.tick_s + 0.5).floor().max(1.0) * self.tick_s
    }
}

/// The smaller of two numbers that are not NaN; unlike `f64::min` a single instruction.
#[inline]
pub fn lesser(a: f64, b: f64) -> f64 {
    if a < b { a } else { b }
}

/// The greater of two numbers that are not NaN.
#[inline]
pub fn greater(a: f64, b: f64) -> f64 {
    if a > b { a } else { b }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tandem_sdk::Limits;

    /// X, Y, Z and the rotary A with a joint behind them that is a sum of axes: it has limits of motion and no place.
    #[test]
    fn the_rules_of_a_machine_are_those_of_its_axes() {
        let accelerations = [1000.0, 2000.0, 500.0, 3000.0, 800.0];
        let limits = accelerations.map(tandem_rig::axis);
        let machine = PlannerContext {
            limits: Limits::new(&limits).unwrap(),
            ..tandem_rig::context(&limits[..4], 0.001)
        };
        let rules = Rules::new(&Options::default(), &machine);
        assert_eq!(rules.linear, 0b0111);
        assert_eq!(rules.axes, 5);
        let lows = [-1e6, -1e6, -1e6, -1e6, f64::NEG_INFINITY];
        assert_eq!(rules.travel_mm[0].0[..5], lows);
        assert_eq!(rules.travel_mm[1].0[..5], lows.map(|low| -low));
        assert_eq!(
            rules.metric.0[..5],
            [1.0, 1.0, 1.0, 180.0 / std::f64::consts::PI, 0.0]
        );
        for (axis, acceleration) in accelerations.into_iter().enumerate() {
            let expected = 1.0 / (AIM * acceleration);
            assert!((rules.per_acceleration[axis] / expected - 1.0).abs() < 1e-12);
        }
        // A chord between two ticks sags by a·t²/8 in every axis, in degrees in a rotary one.
        let all = (1e6 + 4e6 + 0.25e6 + 9e6 * (180.0 / std::f64::consts::PI).powi(2)).sqrt();
        assert!((rules.sag_mm / (AIM * all * 1e-6 / 8.0) - 1.0).abs() < 1e-12);
        assert!((rules.weakest_mm_per_s2 - AIM * 500.0).abs() < 1e-9);
        assert!((rules.on_tick_s(0.0123) - 0.012).abs() < 1e-12);
        assert!((rules.on_tick_s(1e-6) - 0.001).abs() < 1e-12);
    }
}
