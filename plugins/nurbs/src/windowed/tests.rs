//! The published method against its reference cases.

use serde_json::Value;
use tandem_motion::nurbs::{ArcLength, Nurbs, Place};
use tandem_sdk::{Axes, AxisVector, NurbsData};

use super::corners::{Limit, SECTIONS, Spot, Survey};
use super::grade::Grade;
use super::plan::CARE;
use super::ramp::{Ramp, Tangential, cubic};
use super::ramps::Rounds;
use super::ripple::{Corner, propagate, ramps};
use crate::limit::chord_feed_mm_per_s;

const LIMITS: Tangential = Tangential {
    acceleration_mm_per_s2: 5000.0,
    jerk_mm_per_s3: 4e5,
};
const FEED: f64 = 250.0;

fn case(name: &str) -> Value {
    let path = format!(
        "{}/../../tests/fixtures/cases/{name}.json",
        env!("CARGO_MANIFEST_DIR")
    );
    serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

fn list(value: &Value) -> &[Value] {
    value.as_array().unwrap()
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap()
}

fn numbers(value: &Value) -> Vec<f64> {
    list(value).iter().map(number).collect()
}

fn close(a: f64, b: f64, relative: f64, absolute: f64) {
    assert!(
        (a - b).abs() <= relative * b.abs() + absolute,
        "{a} not {b}"
    );
}

fn canonical(name: &str) -> (Nurbs, ArcLength) {
    let case = case("002_nurbs_eval");
    let curve = list(&case["curves"])
        .iter()
        .find(|c| c["name"] == name)
        .unwrap();
    let data = NurbsData {
        degree: curve["degree"].as_u64().unwrap() as usize,
        control_points: list(&curve["control_points"])
            .iter()
            .map(|p| AxisVector::from_slice(&numbers(p)))
            .collect(),
        weights: numbers(&curve["weights"]),
        knots: numbers(&curve["knots"]),
    };
    let curve = Nurbs::new(&data, &Axes::new(&[('X', false), ('Y', false)]).unwrap()).unwrap();
    let table = ArcLength::new(&curve);
    (curve, table)
}

/// Curvature at `s_mm`, 1/mm.
fn curvature(curve: &Nurbs, table: &ArcLength, s_mm: f64) -> f64 {
    let (u, span) = table.parameter(s_mm, &mut Place::default());
    curve.curvature(&curve.derivatives_in(span, u)).unwrap()
}

fn spot(curve: &Nurbs, table: &ArcLength, s_mm: f64) -> Spot {
    let bend = curvature(curve, table, s_mm);
    let speed_mm_per_s = FEED.min(chord_feed_mm_per_s(bend, 0.001, 0.002));
    Spot {
        speed_mm_per_s,
        tangential: LIMITS,
        is_straight: false,
        step_mm: (0.03 / bend).clamp(3e-4, 0.05),
        knot_mm: f64::INFINITY,
    }
}

fn survey(curve: &Nurbs, table: &ArcLength) -> Survey {
    let mut survey = Survey::default();
    survey.sections = SECTIONS;
    let start = Corner {
        at_mm: 0.0,
        speed_mm_per_s: 0.0,
    };
    assert!(
        survey.make(start, table.length().mm, 100.0, &mut |s_mm| spot(
            curve, table, s_mm
        ))
    );
    survey
}

#[test]
fn cubics_meet_their_ends() {
    let case = case("002_cubic");
    for row in list(&case["coefficients"]) {
        let get = |key: &str| number(&row[key]);
        let duration_s = get("T");
        let speeds = [get("v0"), get("vf")];
        let accelerations = [get("a0"), get("af")];
        let speed = cubic(speeds, accelerations, duration_s);
        // The case states twelve digits; d of a window that needs none is their rounding.
        for (value, (key, scale)) in
            speed
                .iter()
                .zip([("a", 1.0), ("b", 1.0), ("c", 1e3), ("d", 1e5)])
        {
            close(*value, get(key), 1e-9, 1e-7 * scale);
        }
        let ramp = Ramp {
            start_mm: 0.0,
            duration_s,
            speed,
        };
        let [way_mm, end, acceleration, _] = ramp.at(duration_s);
        close(way_mm, get("distance_mm"), 1e-9, 0.0);
        close(end, speeds[1], 1e-9, 0.0);
        close(acceleration, accelerations[1], 1e-9, 1e-6);
        let at = |n: u32, which: usize| ramp.at(duration_s * f64::from(n) / 1e4)[which].abs();
        for (which, key) in [(2, "max_abs_accel"), (3, "max_abs_jerk")] {
            close(
                (0..=10_000).map(|n| at(n, which)).fold(0.0, f64::max),
                get(key),
                1e-6,
                0.0,
            );
        }
    }
    for row in list(&case["ramps"]) {
        let change = number(&row["dv"]);
        close(
            LIMITS.duration_s(change),
            number(&row["T_cubic"]),
            1e-8,
            0.0,
        );
        close(
            LIMITS.way_mm(0.0, change),
            number(&row["L_cubic_from_rest"]),
            1e-8,
            0.0,
        );
    }
}

#[test]
fn a_corner_lowers_those_before_it() {
    for row in list(&case("002_ripple")["cases"]) {
        let inner = list(&row["corners"])
            .iter()
            .map(|c| (number(&c["s"]), number(&c["v"])));
        let ends = [(0.0, 0.0), (number(&row["L_mm"]), 0.0)];
        let all = std::iter::once(ends[0]).chain(inner).chain([ends[1]]);
        let mut corners: Vec<Corner> = all
            .map(|(at_mm, speed)| Corner {
                at_mm,
                speed_mm_per_s: speed,
            })
            .collect();
        let limits = vec![[LIMITS; 2]; corners.len()];
        propagate(&mut corners, &limits);
        let expected = &row["ripple_aware"];
        for (corner, speed) in corners[1..].iter().zip(numbers(&expected["v_after"])) {
            close(corner.speed_mm_per_s, speed, 1e-6, 0.0);
        }
        let pairs: Vec<_> = corners
            .windows(2)
            .map(|pair| ramps(&pair[0], &pair[1], FEED, &[LIMITS; 2]))
            .collect();
        for (parts, peak) in pairs.iter().zip(numbers(&expected["peaks"])) {
            close(parts[1].speed[0], peak, 1e-6, 0.0);
        }
        let time_s: f64 = pairs.iter().flatten().map(|ramp| ramp.duration_s).sum();
        close(time_s, number(&expected["total_time_s"]), 1e-6, 0.0);
    }
}

#[test]
fn corners_are_found() {
    let case = case("002_corners");
    for (name, rows) in case["corners"].as_object().unwrap() {
        let (curve, table) = canonical(name);
        let found = survey(&curve, &table).corners;
        assert_eq!(found.len() - 2, list(rows).len(), "{name}");
        for (corner, row) in found[1..].iter().zip(list(rows)) {
            let (u, _) = table.parameter(corner.at_mm, &mut Place::default());
            close(u, number(&row["u"]), 0.0, 2e-6);
            close(corner.at_mm, number(&row["s_mm"]), 0.0, 0.002);
            close(
                1.0 / curvature(&curve, &table, corner.at_mm),
                number(&row["rho_mm"]),
                1e-4,
                0.0,
            );
            close(corner.speed_mm_per_s, number(&row["v_mm_s"]), 1e-4, 0.0);
        }
    }
}

/// The published windows are such ramps, and the plan takes as long as theirs.
#[test]
fn windows_are_as_published() {
    for name in ["butterfly", "trident", "infinity"] {
        let case = case(&format!("002_windows_{name}"));
        let rows = list(&case["windows"]);
        let mut published_s = 0.0;
        for (n, row) in rows.iter().enumerate() {
            let duration_s = number(&row["T_s"]);
            let speed = numbers(&row["abcd"]);
            let known = Ramp {
                start_mm: number(&row["s0_mm"]),
                duration_s,
                speed: speed.clone().try_into().unwrap(),
            };
            let [end_mm, end, ..] = known.at(duration_s);
            let ramp = Ramp::new(known.start_mm, [speed[0], end], duration_s);
            let half = [ramp, known].map(|ramp| ramp.at(duration_s / 2.0));
            // Sites are stated to 1e-9 mm and speeds to 1e-8 mm/s; a short level window keeps their rounding.
            for (value, expected) in half[0].iter().zip(half[1]) {
                close(*value, expected, 1e-5, 1.0);
            }
            assert!(
                LIMITS.duration_s(end - speed[0])
                    <= duration_s.max(super::ramp::MIN_S) * (1.0 + 1e-5),
                "{row}"
            );
            if let Some(next) = rows.get(n + 1) {
                close(end_mm, number(&next["s0_mm"]), 0.0, 1e-5);
            }
            published_s += duration_s;
        }
        let (curve, table) = canonical(name);
        let mut found = survey(&curve, &table);
        let mut plan = Vec::new();
        Rounds::default().make(
            &mut found.corners,
            FEED,
            &Grade::even(LIMITS),
            &mut Limit::new(&found.places),
            &CARE,
            &mut plan,
        );
        close(
            plan.iter().map(|ramp| ramp.duration_s).sum(),
            published_s,
            0.02,
            0.0,
        );
        for pair in plan.windows(2) {
            let [end_mm, end, acceleration, _] = pair[0].at(pair[0].duration_s);
            let [start_mm, start, next, _] = pair[1].at(0.0);
            close(end_mm, start_mm, 0.0, 1e-8);
            close(end, start, 0.0, 1e-6);
            // What the jerk limit leaves for a border is J·T = 800 mm/s²; these have none.
            close(acceleration, next, 0.0, 1e-3);
        }
        for ramp in &plan {
            for n in 0..=20 {
                let [at_mm, speed, acceleration, jerk] =
                    ramp.at(ramp.duration_s * f64::from(n) / 20.0);
                assert!(
                    speed <= spot(&curve, &table, at_mm).speed_mm_per_s * (1.0 + 1e-3),
                    "{name} at {at_mm}"
                );
                assert!(
                    acceleration.abs() <= 5000.0 * (1.0 + 1e-9) && jerk.abs() <= 4e5 * (1.0 + 1e-9),
                    "{name}"
                );
            }
        }
    }
}

/// Where a block of a higher feed begins, ramps begin with it: what is reached within one look does not show the lower limit before.
#[test]
fn no_ramp_rises_before_the_end_of_a_block_of_a_lower_feed() {
    const LIMITS: Tangential = Tangential {
        acceleration_mm_per_s2: 3e5,
        jerk_mm_per_s3: 4e7,
    };
    const LOW: f64 = 0.1;
    const END_MM: f64 = 0.028;
    let mut look = |at_mm: f64| {
        let low = at_mm <= END_MM;
        Spot {
            speed_mm_per_s: if low { LOW } else { 400.0 },
            tangential: LIMITS,
            is_straight: false,
            step_mm: 0.01,
            knot_mm: if low && at_mm < END_MM {
                END_MM - at_mm
            } else {
                f64::INFINITY
            },
        }
    };
    let start = Corner {
        at_mm: 0.0,
        speed_mm_per_s: 0.0,
    };
    let mut survey = Survey::default();
    survey.make(start, 0.06, 1.0, &mut look);
    let mut plan = Vec::new();
    Rounds::default().make(
        &mut survey.corners,
        survey.feed_mm_per_s,
        &Grade::even(LIMITS),
        &mut Limit::new(&survey.places),
        &CARE,
        &mut plan,
    );
    let last = plan.iter().rfind(|ramp| ramp.start_mm <= END_MM).unwrap();
    let [_, speed, ..] = last.at(last.time_at(END_MM, [0.0, last.duration_s]));
    close(speed, LOW, 1e-3, 0.0);
    assert!(plan.iter().any(|ramp| ramp.speed[0] > 100.0 * LOW));
}

/// Hardly a place of a curve counts as one where a block of a higher feed begins; the end of a block whose feed is a seventh
/// lower does.
#[test]
fn a_higher_feed_is_a_step_of_the_limit_and_a_curve_hardly_ever_is() {
    for name in ["butterfly", "trident", "infinity"] {
        let (curve, table) = canonical(name);
        let places = survey(&curve, &table).places;
        let steps = Limit::new(&places).between(0.0, f64::INFINITY).count();
        assert!(
            100 * steps <= places.len(),
            "{name}: {steps} of {}",
            places.len()
        );
    }
    let places: Vec<Corner> = (0..10)
        .map(|n| Corner {
            at_mm: f64::from(n),
            speed_mm_per_s: if n > 5 { 80.0 } else { 70.0 },
        })
        .collect();
    let limit = Limit::new(&places);
    let steps: Vec<f64> = limit.between(0.0, 9.0).map(|place| place.at_mm).collect();
    assert_eq!(steps, [5.0]);
}
