//! Limits of the axes, as finite differences of the samples.

use crate::{Axis, AxisMaxima, Check, Joint, Joints, Kind, Machine, Options, Row, judge::Report};

/// Relative tolerance of speed and acceleration, and of jerk.
const TOLERANCE: f64 = 1e-6;
const JERK_TOLERANCE: f64 = 1e-2;
/// A sample is rounded once when it is computed and once when it is taken from the drive's frame; a few more units in
/// the last place cover the evaluation of the path.
const ROUNDED_ULPS: f64 = 4.0;

/// Judges period, travel, speed, acceleration and jerk of every axis.
pub fn judge_limits(rows: &[Row], machine: &Machine, options: &Options, report: &mut Report) {
    if options.asks(Check::Period) {
        judge_period(rows, machine.fine_period_s, report);
    }
    for axis in &machine.axes {
        let positions: Vec<f64> = rows.iter().map(|row| row.command[axis.index]).collect();
        if options.asks(Check::Travel) {
            judge_travel(axis, &positions, report);
        }
        let differences =
            AxisJudge::new(axis, machine, options, &positions).judge(&positions, options, report);
        report.maxima.axes.push(differences);
    }
    let Joints::Known(joints) = &machine.joints else {
        return;
    };
    for joint in joints {
        judge_joint(rows, joint, machine, options, report);
    }
}

/// The same of a joint, whose positions follow from those of the axes.
fn judge_joint(
    rows: &[Row],
    joint: &Joint,
    machine: &Machine,
    options: &Options,
    report: &mut Report,
) {
    let positions: Vec<f64> = rows
        .iter()
        .map(|row| joint.position(&row.command))
        .collect();
    report.joint = Some(joint.name.clone());
    if options.asks(Check::Travel) {
        judge_travel(&joint.limits, &positions, report);
    }
    let mut judge = AxisJudge::new(&joint.limits, machine, options, &positions);
    // It is as rounded as what it follows from.
    let sums = rows.iter().map(|row| joint.magnitude(&row.command));
    judge.rounding_mm_per_s = 2.0 * speed_rounding(sums.fold(0.0, f64::max), machine.fine_period_s);
    let differences = judge.judge(&positions, options, report);
    report.maxima.joints.push((joint.name.clone(), differences));
    report.joint = None;
}

/// What rounding of positions up to a magnitude makes of a speed, mm/s.
pub fn speed_rounding(magnitude_mm: f64, period_s: f64) -> f64 {
    ROUNDED_ULPS * f64::EPSILON * magnitude_mm / period_s
}

fn judge_period(rows: &[Row], period_s: f64, report: &mut Report) {
    let off =
        |difference_s: f64, wanted_s: f64| (difference_s - wanted_s).abs() > TOLERANCE * period_s;
    let whole_s = (rows[0].t_s / period_s).round() * period_s;
    // Homing moves no line of the program: a record behind it begins later, at a rest that no line has led to.
    let homed = rows[0].line == 0 && !off(rows[0].t_s, whole_s);
    if off(rows[0].t_s, 0.0) && !homed {
        report.add(Kind::Period, 0, None, rows[0].t_s, 0.0);
    }
    for (index, pair) in rows.windows(2).enumerate() {
        let difference_s = pair[1].t_s - pair[0].t_s;
        if off(difference_s, period_s) {
            report.add(Kind::Period, index + 1, None, difference_s, period_s);
        }
    }
}

fn judge_travel(axis: &Axis, positions: &[f64], report: &mut Report) {
    let [low, high] = axis.travel_mm;
    // The end of travel itself may be programmed, also where it is zero: a position is as rounded as the greatest one that
    // it may be computed from.
    let magnitude_mm = positions
        .iter()
        .fold(0.0_f64, |most, position| most.max(position.abs()));
    let rounding = ROUNDED_ULPS * f64::EPSILON * magnitude_mm;
    for (index, &position) in positions.iter().enumerate() {
        if position < low - rounding {
            report.add(Kind::Travel, index, Some(axis.index), position, low);
        } else if position > high + rounding {
            report.add(Kind::Travel, index, Some(axis.index), position, high);
        }
    }
}

/// The limits of one axis in the units of the differences.
struct AxisJudge<'a> {
    axis: &'a Axis,
    period_s: f64,
    step_mm_per_s: f64,
    rounding_mm_per_s: f64,
    /// Speed change beyond the acceleration limit, upwards and downwards, mm/s.
    buckets: [f64; 2],
    maxima: AxisMaxima,
}

impl<'a> AxisJudge<'a> {
    fn new(axis: &'a Axis, machine: &Machine, options: &Options, positions: &[f64]) -> Self {
        let magnitude_mm = positions
            .iter()
            .fold(0.0_f64, |most, position| most.max(position.abs()));
        Self {
            axis,
            period_s: machine.fine_period_s,
            step_mm_per_s: options.speed_difference(machine, axis.rotary),
            rounding_mm_per_s: speed_rounding(magnitude_mm, machine.fine_period_s),
            buckets: [0.0; 2],
            maxima: AxisMaxima {
                axis: axis.index,
                ..AxisMaxima::default()
            },
        }
    }

    /// Runs through all differences, from rest before the first sample to rest after the last.
    fn judge(mut self, positions: &[f64], options: &Options, report: &mut Report) -> AxisMaxima {
        let last = positions.len() - 1;
        let position = |index: usize| positions[index.min(last)];
        let (mut speed_before, mut change_before) = (0.0, 0.0);
        for index in 1..=last + 2 {
            let sample = index.min(last);
            let speed = (position(index) - position(index - 1)) / self.period_s;
            let change = speed - speed_before;
            if options.asks(Check::Velocity) {
                self.judge_speed(sample, speed, report);
            }
            if options.asks(Check::Acceleration) {
                self.judge_change(sample, change, report);
            }
            let jerk = (change - change_before) / self.period_s.powi(2);
            if options.asks(Check::Jerk) {
                self.judge_jerk(sample, jerk, report);
            }
            self.note(speed, change, jerk);
            (speed_before, change_before) = (speed, change);
        }
        self.maxima
    }

    fn note(&mut self, speed: f64, change: f64, jerk: f64) {
        let most = |value: &mut f64, candidate: f64| *value = value.max(candidate.abs());
        most(&mut self.maxima.velocity_mm_per_s, speed);
        most(
            &mut self.maxima.acceleration_mm_per_s2,
            change / self.period_s,
        );
        most(&mut self.maxima.jerk_mm_per_s3, jerk);
    }

    fn judge_speed(&self, sample: usize, speed: f64, report: &mut Report) {
        let limit = self.axis.max_speed_mm_per_s();
        if speed.abs() > limit * (1.0 + TOLERANCE) + self.rounding_mm_per_s {
            report.add(Kind::Velocity, sample, Some(self.axis.index), speed, limit);
        }
    }

    /// A leaky bucket for each sign: over any window the speed changes by no more than what acceleration gives in
    /// that time and one allowed step.
    fn judge_change(&mut self, sample: usize, change: f64, report: &mut Report) {
        let leak = self.axis.max_acceleration_mm_per_s2 * self.period_s * (1.0 + TOLERANCE);
        let allowed = self.step_mm_per_s * (1.0 + TOLERANCE) + 2.0 * self.rounding_mm_per_s;
        for (bucket, signed) in [(0, change), (1, -change)] {
            let level = (self.buckets[bucket] + signed - leak).max(0.0);
            self.maxima.speed_step_mm_per_s = self.maxima.speed_step_mm_per_s.max(level);
            self.buckets[bucket] = level;
            if level > allowed {
                self.report_change(sample, level, change, report);
                // What is reported once is not held against the samples that follow.
                self.buckets[bucket] = self.step_mm_per_s;
            }
        }
    }

    fn report_change(&self, sample: usize, level: f64, change: f64, report: &mut Report) {
        let axis = Some(self.axis.index);
        if self.step_mm_per_s > 0.0 {
            report.add(Kind::SpeedStep, sample, axis, level, self.step_mm_per_s);
        } else {
            let acceleration = change / self.period_s;
            report.add(
                Kind::Acceleration,
                sample,
                axis,
                acceleration,
                self.axis.max_acceleration_mm_per_s2,
            );
        }
    }

    fn judge_jerk(&self, sample: usize, jerk: f64, report: &mut Report) {
        let Some(limit) = self.axis.max_jerk_mm_per_s3 else {
            return;
        };
        let rounding = 4.0 * self.rounding_mm_per_s / self.period_s.powi(2);
        if jerk.abs() > limit * (1.0 + JERK_TOLERANCE) + rounding {
            report.add(Kind::Jerk, sample, Some(self.axis.index), jerk, limit);
        }
    }
}
