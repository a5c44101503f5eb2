//! The published model against its reference cases.

use tandem_estimate::fit::{Goodness, least_squares};
use tandem_estimate::{
    CORRECTED_LONG, Coefficients, PRINTED_CUBE, Regression, Switch, drive, long_terms,
};

use crate::common::{
    MM_PER_MIN, array, assert_near, case, elements, limits, number, numbers, points, spent,
};

#[test]
fn four_cases() {
    let file = case("003_four_cases");
    let a = number(&file["a_mm_min2"]);
    for case in file["cases"].as_array().unwrap() {
        let arguments = ["d_mm", "F", "f0", "f1"].map(|key| number(&case[key]));
        let driven = drive(arguments[0], arguments[1], arguments[2], arguments[3], a);
        let (expect, note) = (&case["expect"], case["note"].as_str().unwrap());
        assert_eq!(
            driven.case as u64,
            expect["case"].as_u64().unwrap(),
            "{note}"
        );
        assert_near(driven.time * 60_000.0, number(&expect["t_ms"]), 1e-6, note);
        assert_near(driven.peak, number(&expect["F_peak"]), 1e-6, note);
        assert_near(driven.end, number(&expect["f1_used"]), 1e-6, note);
    }
}

#[test]
fn a_program_with_the_printed_coefficients() {
    let file = case("003_program");
    let points = points(&file["input"]["points_mm"]);
    let coefficients = Coefficients::default();
    assert_eq!(coefficients.short, array(&file["input"]["p9"]));
    assert_eq!(coefficients.long, array(&file["input"]["p11"]));
    for case in file["cases"].as_array().unwrap() {
        let elements = elements(&points, number(&case["F"]), &limits(1e9));
        for (pair, feed) in elements.windows(2).zip(numbers(&case["fm_regression"])) {
            let end = coefficients.end_mm_per_s(&pair[0], pair[0].turn_rad(&pair[1]), &pair[1]);
            assert_near(end * MM_PER_MIN, feed, 1e-6, "feed at the end");
        }
        let all = spent(&mut Regression::new(coefficients.clone()), &elements);
        for (spent, ms) in all.iter().zip(numbers(&case["block_ms"])) {
            assert_near(spent.time_s * 1e3, ms, 1e-6, "block time");
        }
        assert_near(
            all.iter().map(|s| s.time_s).sum(),
            number(&case["total_s"]),
            1e-9,
            "total",
        );
        for (name, count) in case["counts"].as_object().unwrap() {
            let counted = all
                .iter()
                .filter(|s| (s.case.unwrap() as u8).to_string() == *name)
                .count();
            assert_eq!(counted as u64, count.as_u64().unwrap(), "case {name}");
        }
    }
}

/// Half sides, turns and minimum feeds of table 1, from its times: equations (7) and (8).
fn table_1(printed: bool) -> (Vec<[f64; 3]>, Vec<f64>) {
    let file = case("003_table1");
    let a = number(&file["a_mm_min2"]);
    let mut terms = vec![];
    let mut feeds = vec![];
    for row in file["rows"].as_array().unwrap() {
        let [n, turns, total_s, half] =
            ["n", "iterations", "T_s", "d_a_mm"].map(|key| number(&row[key]));
        let ramp_min = total_s / MM_PER_MIN / (2.0 * n * turns);
        let feed = half / ramp_min - a * ramp_min / 2.0;
        assert_near(feed, number(&row["Fm"]), 1e-9, "equation (8)");
        // One cell of the table is a misprint: 672 for 720.
        let misprint = n == 4.0 && half == 0.21;
        assert!(
            misprint || (feed - number(&row["Fm_printed"])).abs() <= 1.0,
            "{row}"
        );
        terms.push([1.0, half, std::f64::consts::TAU / n]);
        feeds.push(if printed && !misprint {
            number(&row["Fm_printed"])
        } else {
            feed.round()
        });
    }
    (terms, feeds)
}

#[test]
fn table_1_refitted_gives_equation_9() {
    let file = case("003_eq9");
    let (terms, feeds) = table_1(true);
    let fitted = least_squares(&terms, &feeds).unwrap();
    let expect: [f64; 3] = array(&file["expect_refit_corrected"]);
    for (index, (name, tolerance)) in [("alpha", 0.01), ("beta", 0.05), ("gamma", 0.01)]
        .into_iter()
        .enumerate()
    {
        assert_near(fitted[index], expect[index], tolerance, name);
    }
    let model = Coefficients {
        short: fitted,
        ..Coefficients::default()
    };
    let pairs: Vec<_> = terms
        .iter()
        .zip(&feeds)
        .map(|(t, f)| (model.short_mm_per_min(t[1], t[2]), *f))
        .collect();
    let (goodness, stats) = (
        Goodness::of(&pairs),
        &file["results"]["corrected table (720)"]["refit_stats"],
    );
    assert!(goodness.r2 > 0.999);
    assert_near(goodness.r2, number(&stats["R2"]), 1e-9, "R2");
    assert_near(goodness.rms, number(&stats["rms"]), 1e-6, "rms");
}

/// Turns in rad, feeds and minimum feeds of table 2, without the row of 100°, which is that of 80°.
fn table_2() -> Vec<(f64, f64, f64)> {
    let file = case("003_table2_eq11");
    let (angles, feeds) = (numbers(&file["angle_deg"]), numbers(&file["F_mm_min"]));
    let rows = angles
        .iter()
        .zip(file["table"].as_array().unwrap())
        .filter(|(angle, _)| **angle <= 90.0);
    let cells = rows.flat_map(|(angle, row)| {
        feeds
            .iter()
            .zip(numbers(row))
            .map(|(feed, least)| (angle.to_radians(), *feed, least))
            .collect::<Vec<_>>()
    });
    cells.collect()
}

#[test]
fn table_2_refitted_and_equation_11_as_printed_and_corrected() {
    let file = case("003_table2_eq11");
    let cells = table_2();
    let rows: Vec<_> = cells
        .iter()
        .map(|(turn, feed, _)| long_terms(*turn, *feed))
        .collect();
    let least: Vec<_> = cells.iter().map(|(_, _, least)| *least).collect();
    let fitted = least_squares(&rows, &least).unwrap();
    for (k, expect) in fitted.iter().zip(numbers(&file["refit13"])) {
        assert_near(*k, expect, 1e-6 * expect.abs(), "coefficient");
    }
    let goodness = |long: [f64; 13]| {
        let model = Coefficients {
            long,
            ..Coefficients::default()
        };
        let pair =
            |(turn, feed, least): &(f64, f64, f64)| (model.long_mm_per_min(*turn, *feed), *least);
        Goodness::of(&cells.iter().map(pair).collect::<Vec<_>>())
    };
    assert_near(
        goodness(fitted).r2,
        number(&file["refit13_stats"]["R2"]),
        1e-9,
        "R2 of the refit",
    );
    let mut printed = CORRECTED_LONG;
    printed[12] = PRINTED_CUBE;
    assert_eq!(printed.to_vec(), numbers(&file["printed"]));
    assert!(
        (goodness(printed).rms - 24.0).abs() < 0.1
            && (goodness(CORRECTED_LONG).rms - 8.77).abs() < 0.01
    );
}

#[test]
fn equation_11_at_single_points() {
    let file = case("003_table2_eq11");
    let corrected = Coefficients::default();
    let mut printed = Coefficients::default();
    printed.long[12] = PRINTED_CUBE;
    let spots = file
        .as_object()
        .unwrap()
        .values()
        .filter_map(|v| v.as_array());
    let spots: Vec<_> = spots
        .flatten()
        .filter(|v| v.get("eq11_fixed").is_some())
        .collect();
    assert!(spots.len() > 10);
    for spot in spots {
        let (turn, feed) = (number(&spot["theta_deg"]).to_radians(), number(&spot["F"]));
        assert_near(
            corrected.long_mm_per_min(turn, feed),
            number(&spot["eq11_fixed"]),
            1e-6,
            "corrected",
        );
        assert_near(
            printed.long_mm_per_min(turn, feed),
            number(&spot["eq11_printed"]),
            1e-6,
            "printed",
        );
    }
}

#[test]
fn table_3_is_sound_but_for_one_ratio() {
    for row in case("003_table3")["rows"].as_array().unwrap() {
        let [nominal, actual, estimated] = ["N", "A", "E"].map(|key| number(&row[key]));
        assert_near(actual / nominal, number(&row["A_over_N"]), 1e-9, "ratio");
        assert_near(
            estimated / actual - 1.0,
            number(&row["E_err"]),
            1e-9,
            "error",
        );
        let [short, long] = ["S", "L"].map(|key| number(&row[key]));
        assert_near(
            short / (short + long),
            number(&row["S_ratio"]),
            1e-9,
            "share of short blocks",
        );
    }
}

#[test]
fn the_moving_switch_keeps_the_short_form_up_to_the_feed_times_the_block_time() {
    let moving = Coefficients {
        switch: Switch::Moving(0.03),
        ..Coefficients::default()
    };
    let fixed = Coefficients::default();
    let end = |model: &Coefficients, length_mm: f64| {
        let line =
            |angle: f64| tandem_estimate::Element::line(length_mm, angle, 5000.0 / MM_PER_MIN);
        model.end_mm_per_s(&line(0.0), 0.1, &line(0.1)) * MM_PER_MIN
    };
    let short = |half: f64| fixed.short_mm_per_min(half, 0.1);
    assert_near(end(&fixed, 1.0), short(0.5), 1e-9, "fixed, below");
    assert_near(end(&moving, 1.2), short(0.6), 1e-9, "moving, below 2.5 mm");
    assert!((end(&fixed, 1.2) - fixed.long_mm_per_min(0.1, 5000.0)).abs() < 1e-9);
    assert!((end(&moving, 2.6) - fixed.long_mm_per_min(0.1, 5000.0)).abs() < 1e-9);
}
