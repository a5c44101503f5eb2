//! The published curves: evaluation, length, fluctuation of the feed under several parameter updates.

use serde_json::Value;
use tandem_motion::nurbs::{ArcLength, Nurbs, Place};
use tandem_rig::{case, curve as data, numbers};

use crate::common::{canonical, curve, distance};

fn assert_near(got: &[f64], expected: &[f64], relative: f64, what: &str) {
    let scale = expected.iter().map(|v| v.abs()).fold(1.0, f64::max);
    for (g, e) in got.iter().zip(expected) {
        assert!(
            (g - e).abs() <= relative * scale,
            "{what}: {g} instead of {e}"
        );
    }
}

#[test]
fn evaluation() {
    let case = case("002_nurbs_eval");
    for entry in case["curves"].as_array().unwrap() {
        let curve = curve(&data(entry));
        let table = ArcLength::new(&curve);
        assert!((table.length().mm - entry["length_mm"].as_f64().unwrap()).abs() < 1e-8);
        assert!((curve.length().mm - table.length().mm).abs() < 1e-10);
        assert!(table.length().error_mm < 1e-8);
        for sample in entry["samples"].as_array().unwrap() {
            let u = sample["u"].as_f64().unwrap();
            let at = curve.derivatives(u);
            let what = format!("{} at {u}", entry["name"]);
            let position = numbers(&sample["C"]);
            assert!(
                (0..2).all(|i| (at.position[i] - position[i]).abs() < 1e-9),
                "{what}"
            );
            assert_near(&at.first.0[..2], &numbers(&sample["C1"]), 1e-9, &what);
            assert_near(&at.second.0[..2], &numbers(&sample["C2"]), 1e-8, &what);
            assert_near(&at.third.0[..2], &numbers(&sample["C3"]), 1e-7, &what);
            let kappa = sample["kappa"].as_f64().unwrap();
            assert!(
                (curve.curvature(&at).unwrap() - kappa).abs() <= 1e-8 * kappa.max(1e-3),
                "{what}"
            );
            assert!(
                (table.length_at(&curve, u) - sample["s"].as_f64().unwrap()).abs() < 1e-8,
                "{what}"
            );
        }
    }
}

/// The feed of a run: constant, or slowed for a chord error of 1 µm at 2 ms.
fn feed(curve: &Nurbs, adaptive: bool, constant: f64, u: f64) -> f64 {
    if !adaptive {
        return constant;
    }
    let radius = 1.0 / curve.curvature(&curve.derivatives(u)).unwrap();
    let chord_error = 0.001f64.min(radius);
    let chord_feed = 2.0 / 0.002 * (2.0 * radius * chord_error - chord_error * chord_error).sqrt();
    if radius.is_finite() {
        chord_feed.min(250.0)
    } else {
        250.0
    }
}

/// Runs the exact parameter update; the parameters and the largest relative error of a step along the arc.
fn march(curve: &Nurbs, adaptive: bool, constant: f64, period_s: f64) -> (Vec<f64>, f64) {
    let table = ArcLength::new(curve);
    let mut place = Place::default();
    let (mut us, mut s, mut worst) = (vec![curve.range().0], 0.0, 0.0f64);
    loop {
        let u = *us.last().unwrap();
        let step = feed(curve, adaptive, constant, u) * period_s;
        if s + step >= table.length().mm {
            return (us, worst);
        }
        s += step;
        us.push(table.parameter(s, &mut place).0);
        let realised = table.length_at(curve, us[us.len() - 1]) - table.length_at(curve, u);
        worst = worst.max((realised - step).abs() / step);
    }
}

fn chord_fluctuation_pct(curve: &Nurbs, us: &[f64], value: &Value) -> f64 {
    let constant = value["feed"]
        .as_str()
        .unwrap()
        .split(' ')
        .next_back()
        .unwrap()
        .parse()
        .unwrap_or(0.0);
    let (adaptive, period_s) = (constant == 0.0, value["Ts_s"].as_f64().unwrap());
    let error = |pair: &[f64]| {
        let commanded = feed(curve, adaptive, constant, pair[0]);
        distance(&curve.position(pair[1]), &curve.position(pair[0])) / period_s / commanded - 1.0
    };
    us.windows(2)
        .map(|pair| 100.0 * error(pair).abs())
        .fold(0.0, f64::max)
}

#[test]
fn feed_fluctuation_of_the_exact_update() {
    let case = case("002_fluctuation");
    let rows = case["results"]
        .as_array()
        .unwrap()
        .iter()
        .filter(|row| row["method"] == "ARC");
    let mut count = 0;
    for row in rows {
        let curve = canonical(row["curve"].as_str().unwrap());
        let constant: f64 = row["feed"]
            .as_str()
            .unwrap()
            .trim_start_matches("constant ")
            .parse()
            .unwrap_or(0.0);
        let (us, worst) = march(
            &curve,
            constant == 0.0,
            constant,
            row["Ts_s"].as_f64().unwrap(),
        );
        assert!(worst < 1e-5, "{row}: {worst:e} along the arc");
        assert!(
            us.len().abs_diff(row["steps"].as_u64().unwrap() as usize) <= 1,
            "{row}: {}",
            us.len()
        );
        for (got, expected) in us.iter().zip(numbers(&row["u_first10"])) {
            assert!((got - expected).abs() < 1e-9, "{row}: {got}");
        }
        let expected = row["max_abs_chord_pct"].as_f64().unwrap();
        let got = chord_fluctuation_pct(&curve, &us, row);
        assert!((got - expected).abs() <= 0.05 * expected, "{row}: {got}");
        count += 1;
    }
    assert_eq!(count, 9);
}

/// The lowest feed at which fluctuation is promised: 1 mm/s at 1 ms.
#[test]
fn a_crawl_keeps_its_feed() {
    for name in ["butterfly", "trident"] {
        let curve = canonical(name);
        let table = ArcLength::new(&curve);
        let (mut place, mut worst) = (Place::default(), 0.0f64);
        // A step of 1 µm each 0.5 mm, and across every border of the parts of the table.
        for step in 0..(table.length().mm * 2.0) as usize {
            let s = step as f64 * 0.5;
            let mut ends = [s, s + 1e-3].map(|s| table.parameter(s, &mut place).0);
            ends.sort_by(f64::total_cmp);
            let span = curve.span(ends[0]);
            if curve.knots()[span + 1] > ends[1] {
                worst = worst.max((curve.length_in(span, ends[0], ends[1]).mm - 1e-3).abs() / 1e-3);
            }
        }
        assert!(worst < 1e-5, "{name}: {worst:e}");
    }
}
