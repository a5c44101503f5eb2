//! Retiming against closed forms, and against the limits as differences of samples.

mod along;

use along::{Along, retimed};
use proptest::prelude::*;
use tandem_motion::retime::{AnyRetimer, AxisLimits, Between, End, PLACES, Point, Status, Task};

const FEED: f64 = 250.0;

fn limits(count: usize) -> AxisLimits {
    AxisLimits {
        count,
        acceleration_mm_per_s2: [5000.0; 8],
        jerk_mm_per_s3: [4e5; 8],
    }
}

/// Whether all rows are kept.
fn is_feasible(status: &Status) -> bool {
    status.violation < 2e-3
}

/// A straight line of `length` in the first axis.
fn line(length: f64) -> Along {
    Along {
        length,
        lanes: 1,
        feed: FEED,
        derivatives: Box::new(|_| [[1.0, 0.0], [0.0; 2], [0.0; 2]]),
    }
}

/// Three quarters of a circle.
fn circle(radius: f64, feed: f64) -> Along {
    let derivatives = move |s: f64| {
        let (sin, cos) = (s / radius).sin_cos();
        [
            [-sin, cos],
            [-cos / radius, -sin / radius],
            [sin / (radius * radius), -cos / (radius * radius)],
        ]
    };
    Along {
        length: 1.5 * std::f64::consts::PI * radius,
        lanes: 2,
        feed,
        derivatives: Box::new(derivatives),
    }
}

#[test]
fn a_line_takes_the_time_of_the_s_curve() {
    // Rest to rest with 250 mm/s, 5000 mm/s², 4e5 mm/s³: with a cruise, and with a peak below the feed.
    for (length, closed_form_s) in [(50.0, 0.2625), (5.0, 0.076_968_984_8)] {
        let done = retimed(&line(length), &limits(1), 1e-3, 4);
        println!(
            "{length} mm: {} s, {closed_form_s} s, {:?}",
            done.time_s, done.status
        );
        assert!(is_feasible(&done.status));
        let ratio = done.time_s / closed_form_s;
        assert!((0.999..1.03).contains(&ratio), "{ratio}");
    }
}

#[test]
fn the_bound_on_the_rate_is_the_feed() {
    let done = retimed(&line(50.0), &limits(1), 1e-3, 3);
    let top = done.speeds().into_iter().fold(0.0, f64::max);
    assert!(top <= FEED * (1.0 + 1e-3) && top > 0.999 * FEED, "{top}");
}

#[test]
fn a_tight_turn_uses_the_jerk_that_there_is() {
    // On a circle at constant speed an axis accelerates with v²/r and jerks with v³/r²; where both axes share the turn, more.
    let done = retimed(&circle(1.0, FEED), &limits(2), 1e-3, 3);
    let steady = (4e5f64).cbrt().min(5000.0f64.sqrt());
    let speeds = done.speeds();
    let middle = speeds[speeds.len() / 2];
    assert!(
        middle <= 2f64.sqrt() * steady && middle > 0.9 * steady,
        "{middle} {steady}"
    );
}

/// Rows of an axis at rest would be kept by any rate, and cost as much as others.
#[test]
fn an_axis_that_rests_is_no_part_of_what_is_solved() {
    let done = |count| retimed(&line(50.0), &limits(count), 1e-3, 1);
    let (alone, among) = (done(1), done(3));
    assert_eq!(alone.status, among.status);
    assert_eq!(alone.time_s.to_bits(), among.time_s.to_bits());
}

/// What is asked for between the places of the grid is kept there, and changes nothing far from it.
#[test]
fn places_between_those_of_the_grid_count() {
    let mut steady = Point {
        most: 1.5,
        ..Point::default()
    };
    steady.first[0] = 100.0;
    let points = vec![[steady; PLACES]; 80];
    let ends = (End::Moving, End::Moving);
    let mut retimer = AnyRetimer::default();
    let mut solve = |between: &[Between]| {
        let task = Task {
            points: &points,
            between,
            limits: limits(1),
            step_s: 2e-3,
            ends,
        };
        let status = retimer.solve(&task);
        assert!(is_feasible(&status), "{status:?}");
        [0.2, 0.5, 0.9].map(|z| retimer.rate.at(40, z, 2e-3)[0])
    };
    let free = solve(&[]);
    assert!(free.iter().all(|b| *b > 1.45), "{free:?}");
    let slow = Point {
        most: 0.8,
        ..steady
    };
    let held = solve(&[Between {
        interval: 40,
        z: [0.2, 0.5, 0.9],
        points: [slow; PLACES],
    }]);
    assert!(
        held.iter().all(|b| *b < 0.8 * 1.002 && *b > 0.78),
        "{held:?}"
    );
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]
    #[test]
    fn samples_keep_the_limits(radius in 0.2..40.0f64, feed in 20.0..250.0f64, grid in 0.8e-3..3e-3f64) {
        let along = circle(radius, feed);
        let done = retimed(&along, &limits(2), grid, 2);
        prop_assert!(is_feasible(&done.status), "{:?}", done.status);
        let [acceleration, jerk] = done.peaks(&along);
        prop_assert!(acceleration < 5000.0 * 1.001, "{acceleration}");
        prop_assert!(jerk < 4e5 * 1.01, "{jerk}");
    }
}

#[test]
fn a_motion_that_is_none_ends_the_iteration_at_once() {
    let points = vec![
        [Point {
            first: [f64::INFINITY; 8],
            ..Point::default()
        }; PLACES];
        40
    ];
    let ends = (End::Rest, End::Rest);
    let task = Task {
        points: &points,
        between: &[],
        limits: limits(1),
        step_s: f64::INFINITY,
        ends,
    };
    let status = AnyRetimer::default().solve(&task);
    assert!(status.iterations <= 1 && status.gap.is_nan(), "{status:?}");
}
