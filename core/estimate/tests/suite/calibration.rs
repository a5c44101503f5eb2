//! Calibration on the planners of this workspace, on made-up controls, and on the published measurements.

use std::fmt::Write as _;

use tandem_estimate::diagnose::{Evidence, Fitted, MIN_R2, fit_all, linear};
use tandem_estimate::experiment::Experiment;
use tandem_estimate::measurements::parse_log;
use tandem_estimate::polygon::{CORNERS, PlaneAxis, Polygon, SIDES_MM, Timed};
use tandem_estimate::{Choice, Rule};
use tandem_host::Clock;
use tandem_rig::Random;
use tandem_sdk::MAX_AXES;

use crate::common::{assert_near, case, number};
use crate::tie::{LOOK_AHEAD, OVERLAP, TANGENT, mill, registry};

fn best(timed: &[Timed]) -> Fitted {
    let all = fit_all(timed, None);
    for fitted in &all {
        println!(
            "{}: R2 {:.6} rms {:.5}, {}",
            fitted.choice.name(),
            fitted.feeds.r2,
            fitted.rms,
            fitted.constants()
        );
    }
    all.into_iter()
        .min_by(|a, b| a.rms.total_cmp(&b.rms))
        .unwrap()
}

#[test]
fn the_published_table_is_that_of_an_overlap_control() {
    let rows = case("003_table1")["rows"].clone();
    let timed: Vec<_> = rows
        .as_array()
        .unwrap()
        .iter()
        .map(|row| {
            let [n, rounds, time_s, half] =
                ["n", "iterations", "T_s", "d_a_mm"].map(|key| number(&row[key]));
            let polygon = Polygon {
                corners: n as u32,
                side_mm: 2.0 * half,
                rounds: rounds as u32,
                along: PlaneAxis::X,
                feed_mm_per_s: 5000.0 / 60.0,
                exact_stop: false,
            };
            Timed {
                polygon,
                time_s,
                reading_error_s: 0.0,
            }
        })
        .collect();
    let fitted = best(&timed);
    let Choice::Overlap(constants) = &fitted.choice else {
        panic!("{fitted:?}")
    };
    assert_near(constants.time_constant_s, 0.0302, 1e-4, "time constant");
    assert!(fitted.is_good() && Evidence::of(&timed).is_constant_time());
    let regression = linear(&timed, &[], Some(constants.time_constant_s)).unwrap();
    assert!(regression.short.r2 > 0.999);
}

#[test]
fn the_experiment_finds_what_kind_of_control_it_is() {
    for (overrides, constant_time) in [(LOOK_AHEAD, false), (TANGENT, false), (OVERLAP, true)] {
        let machine = mill(overrides);
        let measured = Experiment::new(&machine, 200)
            .unwrap()
            .run(&machine, &registry(), Clock::Virtual)
            .unwrap();
        let fitted = best(&measured.timed);
        let evidence = Evidence::of(&measured.timed);
        println!("{evidence:?}");
        assert!(fitted.is_good(), "{fitted:?}");
        assert_eq!(evidence.is_constant_time(), constant_time);
        match (&fitted.choice, overrides) {
            (Choice::Overlap(constants), OVERLAP) => {
                assert_near(constants.time_constant_s, 0.03, 1e-4, "time constant");
            }
            (
                Choice::LookAhead(
                    Rule::Tangent {
                        acceleration_mm_per_s2: Some(a),
                        period_s,
                        speed_difference_mm_per_s,
                    },
                    _,
                ),
                TANGENT,
            ) => {
                assert_near(*a, 1000.0, 20.0, "acceleration");
                assert_near(a * period_s * 60.0, 60.0, 0.5, "tangent feed");
                assert_near(
                    speed_difference_mm_per_s * 60.0,
                    100.0,
                    0.5,
                    "speed difference",
                );
            }
            (
                Choice::LookAhead(
                    Rule::Axis {
                        acceleration_mm_per_s2: a,
                        speed_difference_mm_per_s: v,
                    },
                    _,
                ),
                LOOK_AHEAD,
            ) => {
                assert_near(a[0], 999.0, 20.0, "acceleration");
                assert_near(v[0] * 60.0, 99.9, 0.5, "speed difference");
            }
            _ => panic!("{overrides:?} taken for {fitted:?}"),
        }
        let regression = linear(
            &measured.timed,
            &measured.corners,
            constant_time.then_some(0.03),
        )
        .unwrap();
        println!("{regression:?}");
        assert_eq!(regression.short.r2 >= MIN_R2, constant_time);
    }
}

#[test]
fn a_control_whose_axes_are_unequal_is_found_from_noisy_readings() {
    let mut random = Random::from_the_clock();
    for _ in 0..2 {
        let noise = random.between(0.005, 0.02);
        let (slow, fast) = (random.between(150.0, 500.0), random.between(700.0, 2000.0));
        let [x, y] = random.pick(&[[slow, fast], [fast, slow]]);
        let mut acceleration_mm_per_s2 = [slow; MAX_AXES];
        (acceleration_mm_per_s2[0], acceleration_mm_per_s2[1]) = (x, y);
        let rule = Rule::Axis {
            acceleration_mm_per_s2,
            speed_difference_mm_per_s: [random.between(0.5, 4.0); MAX_AXES],
        };
        let control = Choice::LookAhead(rule, None);
        let time_s = |choice: &Choice, corners: u32, side_mm: f64| {
            let timed = Timed {
                polygon: Polygon {
                    corners,
                    side_mm,
                    rounds: 2000 / corners,
                    along: PlaneAxis::X,
                    feed_mm_per_s: 5000.0 / 60.0,
                    exact_stop: false,
                },
                time_s: 1.0,
                reading_error_s: 0.0,
            };
            let time_s = timed.under(choice.model().unwrap().as_mut());
            Timed { time_s, ..timed }
        };
        let timed: Vec<Timed> = CORNERS
            .iter()
            .flat_map(|corners| SIDES_MM.map(|side_mm| (*corners, side_mm)))
            .map(|(corners, side_mm)| {
                let exact = time_s(&control, corners, side_mm);
                Timed {
                    time_s: exact.time_s * (1.0 + noise * random.between(-1.0, 1.0)),
                    ..exact
                }
            })
            .collect();
        let fitted = best(&timed);
        assert!(fitted.is_good(), "{x} and {y}, {noise}: {fitted:?}");
        // Polygons that were not timed.
        for (corners, side_mm) in [(7, 0.3), (10, 3.0), (48, 0.7), (100, 1.5)] {
            let (real, estimate) = (
                time_s(&control, corners, side_mm).time_s,
                time_s(&fitted.choice, corners, side_mm).time_s,
            );
            assert_near(
                estimate,
                real,
                0.01 * real,
                &format!("{x} and {y}, {corners} x {side_mm}"),
            );
        }
    }
}

/// The line of the comment before the first stroke.
fn line_before_strokes(experiment: &Experiment) -> u32 {
    let text = experiment.program(true);
    let at = text
        .lines()
        .position(|line| line.contains("there and back"));
    at.unwrap() as u32 + 1
}

#[test]
fn a_log_of_lines_gives_the_times_of_the_polygons_without_what_lies_between_them() {
    let experiment = Experiment::new(&mill(&[]), 20).unwrap();
    let (mut t_s, mut log) = (3.0, "t_s,line,state\n# a log\n".to_string());
    let mut sides = 0_usize;
    for (line, text) in experiment.program(true).lines().enumerate() {
        // A string takes whatever is written to it.
        let _ = writeln!(log, "{t_s},{},running", line + 1);
        // Rapids, dwells and operators take long.
        t_s += if text.starts_with("G1") {
            sides += 1;
            0.01
        } else {
            7.0
        };
    }
    let rows = parse_log("log.csv", log.as_bytes()).unwrap();
    let timed = experiment.timed(&rows).unwrap();
    assert_eq!(timed.len(), experiment.polygons.len());
    let blocks: u32 = timed.iter().map(|timed| timed.polygon.blocks()).sum();
    assert_eq!(blocks as usize, sides);
    for timed in &timed {
        let expected = 0.01 * f64::from(timed.polygon.blocks());
        let what = format!("{:?}", timed.polygon);
        assert_near(timed.time_s, expected, 1e-6, &what);
    }
    // A program that was written before there were strokes ends where they begin now.
    let first_stroke = line_before_strokes(&experiment);
    let before = rows.partition_point(|row| row.line <= first_stroke);
    let round = experiment.timed(&rows[..before]).unwrap();
    assert_eq!(round.len(), CORNERS.len() * SIDES_MM.len());
    assert_eq!(round[..], timed[..round.len()]);
    let half = &rows[..rows.len() / 2];
    let refused = experiment.timed(half).unwrap_err();
    assert!(refused.contains("polygons are in the log"), "{refused}");
    for (text, words) in [
        (
            "t_s,line\n1,5\n0.5,6\n",
            "log.csv:3: t_s: 0.5 comes after 1",
        ),
        ("t_s,line\n1,5\n2,4\n", "log.csv:3: line: 4 comes after 5"),
        ("t_s,line\n1,five\n", "log.csv:2: line: "),
    ] {
        let refused = parse_log("log.csv", text.as_bytes()).unwrap_err();
        assert!(refused.contains(words), "{refused}");
    }
}
