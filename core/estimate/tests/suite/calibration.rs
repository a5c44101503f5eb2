//! Calibration on the planners of this workspace, on made-up controls, and on the published measurements.

use tandem_estimate::diagnose::{Evidence, Fitted, MIN_R2, fit_all, linear};
use tandem_estimate::experiment::Experiment;
use tandem_estimate::polygon::{Polygon, Timed};
use tandem_estimate::{Choice, Rule};
use tandem_host::Clock;

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
            };
            Timed {
                polygon,
                feed_mm_per_s: 5000.0 / 60.0,
                time_s,
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
