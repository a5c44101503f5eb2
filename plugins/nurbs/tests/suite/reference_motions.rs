//! Near-optimal motions of somebody else (path coordinates at 2 ms): our curves judged by them, and our motions beside them.

use crate::common;

use common::measure::{BEST_S, chord_error_mm, differences, realised_mm, xy};
use common::{canonical, context, curve_block, run};
use serde_json::Value;
use tandem_motion::nurbs::{ArcLength, Nurbs, Place};
use tandem_rig::{case, numbers};

const PERIOD_S: f64 = 0.002;

/// Path coordinates of the motion under limits `along` the path (`M4t`) or of the axes (`M4a`).
fn reference(name: &str, method: &str) -> Vec<f64> {
    numbers(&case(&format!("002_traj_{name}_{method}"))["s_mm"])
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap()
}

fn close(got: f64, expected: f64, relative: f64, what: &str) {
    assert!(
        (got - expected).abs() <= relative * expected.abs(),
        "{what}: {got} not {expected}"
    );
}

/// What the samples at 2 ms have at most, mm/s² and mm/s³.
fn accelerations(values: Vec<f64>) -> [f64; 2] {
    let [_, acceleration, jerk] = differences(values, PERIOD_S);
    [acceleration, jerk]
}

fn summed(steps: &[f64]) -> Vec<f64> {
    let sums = steps
        .iter()
        .scan(0.0, |sum, step| Some(std::mem::replace(sum, *sum + step)));
    sums.chain([steps.iter().sum()]).collect()
}

/// Driven along our curves by arc length, they measure as published and keep the limits that they were made for.
#[test]
fn they_measure_as_published_on_our_curves() {
    let rows = case("002_jerk")["rows"].take();
    for ((name, ..), method) in BEST_S
        .into_iter()
        .flat_map(|curve| [(curve, "M4t"), (curve, "M4a")])
    {
        let what = format!("{name} {method}");
        let is_row = |row: &&Value| row["curve"] == name && row["method"] == method;
        let published = rows.as_array().unwrap().iter().find(is_row).unwrap();
        let curve = Nurbs::new(&canonical(name).0, &xy()).unwrap();
        let table = ArcLength::new(&curve);
        let along = reference(name, method);
        let mut place = Place::default();
        let positions: Vec<_> = along
            .iter()
            .map(|s| table.position(&curve, *s, &mut place))
            .collect();

        let path = accelerations(summed(&realised_mm(&curve, positions.iter().copied())));
        close(path[0], number(&published["max_abs_a_tan"]), 0.002, &what);
        close(path[1], number(&published["max_abs_j_tan"]), 0.002, &what);
        let axes = [0, 1].map(|axis| accelerations(positions.iter().map(|p| p[axis]).collect()));
        for (axis, [acceleration, jerk]) in axes.into_iter().enumerate() {
            close(
                acceleration,
                number(&published["max_axis_a"][axis]),
                0.002,
                &what,
            );
            close(jerk, number(&published["max_axis_j"][axis]), 0.002, &what);
        }
        let limited = if method == "M4t" {
            vec![path]
        } else {
            axes.to_vec()
        };
        assert!(
            limited
                .iter()
                .all(|[a, j]| *a <= 1.01 * 5000.0 && *j <= 1.01 * 4e5),
            "{what}: {limited:?}"
        );

        let chords = along
            .windows(2)
            .map(|pair| 1e3 * chord_error_mm(&curve, &table, pair[0], pair[1]));
        let chord_um = chords.fold(0.0, f64::max);
        close(
            chord_um,
            number(&published["max_chord_err_um"]),
            0.005,
            &what,
        );
        assert!(chord_um <= 1.01, "{what}: {chord_um} µm");
    }
}

/// A motion by its path coordinates at equal times.
struct Motion {
    along_mm: Vec<f64>,
    period_s: f64,
}

impl Motion {
    fn reference(name: &str, method: &str) -> Self {
        Self {
            along_mm: reference(name, method),
            period_s: PERIOD_S,
        }
    }

    fn ours(form: &str, name: &str) -> Self {
        let (data, length_mm) = canonical(name);
        let block = curve_block(data, length_mm, 250.0);
        let collected = run(
            &format!("form = \"{form}\""),
            &context(block.0.start),
            &[block],
        );
        let period_s = 1e-4;
        let mut along_mm: Vec<f64> = collected
            .path_samples(period_s)
            .iter()
            .map(|sample| sample.1)
            .collect();
        along_mm.pop();
        Self { along_mm, period_s }
    }

    /// When the place is reached, s, and how fast it is passed, mm/s.
    fn at(&self, place_mm: f64) -> (f64, f64) {
        let all = &self.along_mm;
        let n = all
            .partition_point(|s| *s < place_mm)
            .clamp(1, all.len() - 1);
        let step_mm = all[n] - all[n - 1];
        (
            (n as f64 - 1.0 + (place_mm - all[n - 1]) / step_mm) * self.period_s,
            step_mm / self.period_s,
        )
    }

    fn places(&self) -> impl Iterator<Item = f64> {
        let length_mm = self.along_mm[self.along_mm.len() - 1];
        (1..10_000).map(move |n| length_mm * f64::from(n) / 1e4)
    }
}

/// The corners of a curve, mm, and the speed to which the chord error confines them, mm/s.
fn corners(name: &str) -> Vec<(f64, f64)> {
    let rows = case("002_corners")["corners"][name].take();
    rows.as_array()
        .unwrap()
        .iter()
        .map(|row| (number(&row["s_mm"]), number(&row["v_mm_s"])))
        .collect()
}

/// Corners are passed at their speed. The ramps of `windowed` are slower than the fastest motion under the same limits: no
/// place is reached earlier, and no way from corner to corner takes less time.
#[test]
fn windowed_is_nowhere_ahead_of_the_fastest_motion_along_the_path() {
    for (name, ..) in BEST_S {
        let (ours, fastest) = (
            Motion::ours("windowed", name),
            Motion::reference(name, "M4t"),
        );
        for place_mm in ours.places() {
            let (ours_s, fastest_s) = (ours.at(place_mm).0, fastest.at(place_mm).0);
            assert!(
                ours_s >= fastest_s - 1e-4,
                "{name} at {place_mm} mm: {ours_s} s, the fastest {fastest_s} s"
            );
        }
        let mut before_s = (0.0, 0.0);
        for (corner_mm, most) in corners(name) {
            let ((ours_s, feed), (fastest_s, _)) = (ours.at(corner_mm), fastest.at(corner_mm));
            assert!(
                feed <= most && feed >= 0.4 * most,
                "{name} at {corner_mm} mm: {feed} of {most} mm/s"
            );
            let way_s = (ours_s - before_s.0, fastest_s - before_s.1);
            assert!(way_s.0 >= way_s.1, "{name} to {corner_mm} mm: {way_s:?} s");
            before_s = (ours_s, fastest_s);
        }
    }
}

/// `scan` drives what the near-optimal motion under limits of the axes drives: feeds over the path differ by 2 mm/s on the
/// average and by 20 mm/s at most, of 250, and nothing is reached more than a fine period earlier.
#[test]
fn scan_follows_the_fastest_motion_of_the_axes() {
    for (name, ..) in BEST_S {
        let (ours, fastest) = (Motion::ours("scan", name), Motion::reference(name, "M4a"));
        let (mut most, mut sum, mut earliest_s) = (0.0f64, 0.0, 0.0f64);
        for place_mm in ours.places() {
            let ((ours_s, feed), (fastest_s, best)) = (ours.at(place_mm), fastest.at(place_mm));
            earliest_s = earliest_s.max(fastest_s - ours_s);
            most = most.max((feed - best).abs());
            sum += (feed - best).abs();
        }
        let mean = sum / ours.places().count() as f64;
        println!(
            "{name}: feeds differ by {most:.2} mm/s, {mean:.2} on the average; earlier by {earliest_s:.5} s"
        );
        assert!(
            most <= 20.0 && mean <= 2.0 && earliest_s <= PERIOD_S,
            "{name}: {most}, {mean} mm/s, {earliest_s} s"
        );
        for (corner_mm, limit) in corners(name) {
            let feed = ours.at(corner_mm).1;
            assert!(
                feed <= limit,
                "{name} at {corner_mm} mm: {feed} of {limit} mm/s"
            );
        }
    }
}
