//! The limits of the axes: a correct run passes, and each way to break it is found as what it is.

use crate::common;

use common::{
    Profile, assert_finds, assert_passes, at, machine, polyline, smooth_machine, trace, verdict,
};
use tandem_oracle::{Check, Kind, Options, Outcome, Position, judge};

const LINE: &str = "G1 X40 F3000\nM2\n";

fn line_run(speed: f64, acceleration: f64) -> Vec<Position> {
    Profile::rest_to_rest(speed, 40.0, acceleration)
        .samples(polyline(vec![at(0.0, 0.0, 0.0), at(40.0, 0.0, 0.0)]))
}

#[test]
fn a_trapezoid_on_a_line_passes() {
    let verdict = verdict(&line_run(50.0, 1000.0), LINE);
    assert_passes(&verdict);
    let x = &verdict.maxima.axes[0];
    assert!(
        (x.velocity_mm_per_s - 50.0).abs() < 1e-6
            && (x.acceleration_mm_per_s2 - 1000.0).abs() < 1e-3
    );
    assert!(verdict.maxima.sample_deviation_mm < 1e-12 && verdict.maxima.end_error_mm == 0.0);
}

#[test]
fn one_percent_more_acceleration_is_found() {
    let verdict = verdict(&line_run(50.0, 1010.0), LINE);
    assert_finds(&verdict, &[Kind::Acceleration]);
    let first = &verdict.findings[0];
    assert_eq!(
        (first.sample, first.axis, first.limit),
        (4, Some(0), 1000.0)
    );
    assert!((first.value - 1010.0).abs() < 1e-3, "{verdict}");
}

#[test]
fn one_percent_more_speed_is_above_the_feed() {
    let verdict = verdict(&line_run(50.5, 990.0), LINE);
    assert_finds(&verdict, &[Kind::Feed]);
    assert!((verdict.maxima.feed_ratio - 1.01).abs() < 1e-9, "{verdict}");
    let options = Options {
        max_ratio: 1.01,
        ..Options::default()
    };
    assert_passes(&judge(
        &trace(&line_run(50.5, 990.0)),
        LINE,
        &smooth_machine(),
        &options,
    ));
}

#[test]
fn one_percent_more_than_the_axis_speed_is_found() {
    let mut machine = smooth_machine();
    (
        machine.axes[0].max_feed_mm_per_s,
        machine.axes[0].max_rapid_mm_per_s,
    ) = (49.5, 40.0);
    let verdict = judge(
        &trace(&line_run(50.0, 1000.0)),
        LINE,
        &machine,
        &Options::default(),
    );
    assert_finds(&verdict, &[Kind::Velocity]);
    machine.axes[0].max_rapid_mm_per_s = 50.0;
    assert_passes(&judge(
        &trace(&line_run(50.0, 1000.0)),
        LINE,
        &machine,
        &Options::default(),
    ));
}

#[test]
fn a_rapid_keeps_the_rapid_speed_of_each_axis() {
    let program = "G0 X40\nM2\n";
    let mut machine = smooth_machine();
    machine.axes[0].max_rapid_mm_per_s = 49.5;
    let options = Options::default();
    assert_finds(
        &judge(&trace(&line_run(50.0, 1000.0)), program, &machine, &options),
        &[Kind::Feed],
    );
    assert_passes(&judge(
        &trace(&line_run(49.5, 1000.0)),
        program,
        &machine,
        &options,
    ));
}

#[test]
fn travel_is_judged_to_the_last_bit() {
    let mut machine = smooth_machine();
    machine.axes[0].travel_mm = [0.0, 40.0];
    let options = Options::default();
    assert_passes(&judge(
        &trace(&line_run(50.0, 1000.0)),
        LINE,
        &machine,
        &options,
    ));
    machine.axes[0].travel_mm = [0.0, 39.999_999];
    let verdict = judge(&trace(&line_run(50.0, 1000.0)), LINE, &machine, &options);
    assert_finds(&verdict, &[Kind::Travel]);
    assert_eq!(verdict.findings[0].axis, Some(0));
}

#[test]
fn a_run_that_does_not_end_at_rest_is_found() {
    let samples = line_run(50.0, 1000.0);
    let verdict = judge(
        &trace(&samples[..200]),
        LINE,
        &smooth_machine(),
        &Options::only(&[Check::Acceleration]),
    );
    assert_finds(&verdict, &[Kind::Acceleration]);
    assert_eq!(verdict.findings[0].sample, 199);
}

#[test]
fn a_run_that_does_not_start_at_rest_is_found() {
    let samples = line_run(50.0, 1000.0);
    let verdict = judge(
        &trace(&samples[100..]),
        LINE,
        &smooth_machine(),
        &Options::default(),
    );
    assert_finds(&verdict, &[Kind::StartPoint, Kind::Acceleration]);
    assert_eq!(verdict.findings[1].sample, 1);
}

#[test]
fn the_bucket_allows_a_step_but_not_two_in_a_row() {
    let only = Options::only(&[Check::Acceleration]);
    // Speed steps of 2.6 mm/s each 1 ms: 1 from the acceleration, 1.6 of the allowed 1.667.
    let run = |steps: u32| {
        let mut samples = vec![at(0.0, 0.0, 0.0)];
        let mut speed = 0.0;
        for _ in 0..steps {
            speed += 2.6;
            samples.push(at(
                samples[samples.len() - 1][0] + speed * common::PERIOD_S,
                0.0,
                0.0,
            ));
        }
        let mut left = speed;
        while left > 0.0 {
            left -= 1.0_f64.min(left);
            samples.push(at(
                samples[samples.len() - 1][0] + left * common::PERIOD_S,
                0.0,
                0.0,
            ));
        }
        samples
    };
    assert_passes(&judge(&trace(&run(1)), "", &machine(), &only));
    let two = judge(&trace(&run(2)), "", &machine(), &only);
    assert_finds(&two, &[Kind::SpeedStep]);
    assert_eq!(two.findings[0].sample, 2);
    assert!((two.findings[0].value - 3.2).abs() < 1e-3, "{two}");
    assert_finds(
        &judge(&trace(&run(1)), "", &smooth_machine(), &only),
        &[Kind::Acceleration],
    );
}

#[test]
fn one_percent_more_acceleration_overflows_the_bucket_of_a_long_ramp() {
    let run = |acceleration| {
        Profile::rest_to_rest(250.0, 200.0, acceleration)
            .samples(polyline(vec![at(0.0, 0.0, 0.0), at(200.0, 0.0, 0.0)]))
    };
    let program = "G1 X200 F15000\n";
    assert_passes(&judge(
        &trace(&run(1000.0)),
        program,
        &machine(),
        &Options::default(),
    ));
    let verdict = judge(
        &trace(&run(1010.0)),
        program,
        &machine(),
        &Options::default(),
    );
    assert_finds(&verdict, &[Kind::SpeedStep]);
}

#[test]
fn jerk_is_judged_where_it_is_asked_for() {
    // s = J t³/6 up and down again: four equal phases of jerk.
    let cubic = |jerk: f64| {
        let mut samples = vec![[0.0; 9]; 4];
        let (mut position, mut speed, mut acceleration) = (0.0, 0.0, 0.0);
        let period_s = common::PERIOD_S;
        for tick in 0..160 {
            let sign = if (40..120).contains(&tick) { -1.0 } else { 1.0 };
            let jerk = sign * jerk;
            position += speed * period_s
                + acceleration * period_s.powi(2) / 2.0
                + jerk * period_s.powi(3) / 6.0;
            speed += acceleration * period_s + jerk * period_s.powi(2) / 2.0;
            acceleration += jerk * period_s;
            samples.push(at(position, 0.0, 0.0));
        }
        samples
    };
    let options = Options {
        checks: vec![Check::Acceleration, Check::Jerk],
        ..Options::default()
    };
    let mut machine = smooth_machine();
    let unlimited = judge(&trace(&cubic(2e4)), "", &machine, &options);
    assert!(
        matches!(&unlimited.outcome, Outcome::NotJudged { reason } if reason.contains("axis A")),
        "{unlimited}"
    );
    machine.axes.retain(|axis| !axis.rotary);
    let trace =
        |jerk| tandem_oracle::Trace::from_samples(&[0, 1, 2], common::PERIOD_S, &cubic(jerk));
    assert_passes(&judge(&trace(2e4), "", &machine, &options));
    assert_passes(&judge(&trace(2.01e4), "", &machine, &options));
    assert_finds(
        &judge(&trace(2.03e4), "", &machine, &options),
        &[Kind::Jerk],
    );
}

#[test]
fn a_dropped_row_and_a_number_that_is_none_are_found() {
    let whole = trace(&line_run(50.0, 1000.0));
    let mut dropped = whole.clone();
    dropped.rows.remove(300);
    let verdict = judge(&dropped, LINE, &smooth_machine(), &Options::default());
    assert_finds(&verdict, &[Kind::Period, Kind::Acceleration, Kind::Feed]);
    assert!(
        verdict
            .findings
            .iter()
            .all(|finding| (300..=302).contains(&finding.sample)),
        "{verdict}"
    );
    let mut broken = whole;
    broken.rows[7].command[1] = f64::NAN;
    let verdict = judge(&broken, LINE, &smooth_machine(), &Options::default());
    assert_finds(&verdict, &[Kind::NotFinite]);
    assert_eq!(
        (verdict.findings[0].sample, verdict.findings[0].axis),
        (7, Some(1))
    );
}

#[test]
fn a_record_begins_at_zero_or_behind_homing() {
    let begin = |line: u32, ticks: f64| {
        let mut samples = trace(&line_run(50.0, 1000.0));
        for row in &mut samples.rows {
            row.t_s += ticks * common::PERIOD_S;
        }
        samples.rows[0].line = line;
        judge(&samples, LINE, &smooth_machine(), &Options::default())
    };
    assert_passes(&begin(0, 7000.0));
    assert_finds(&begin(1, 7000.0), &[Kind::Period]);
    assert_finds(&begin(0, 7000.5), &[Kind::Period]);
}
