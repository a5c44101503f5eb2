//! Conversion and constants, the stability bound, and the guard on a sharp jump.

use std::f64::consts::TAU;

use tandem_force_control::conversion::force_per_torque_per_m;
use tandem_force_control::guard::Guard;
use tandem_force_control::law::Law;
use tandem_force_control::stability::LoopModel;

use crate::force::law;
use crate::rig::{J, K_CUT, KT, LEAD_MM, Setup, TOOTH_S, case, close, number, observer};

#[test]
fn force_and_torque() {
    let table = case("004_constants.json");
    let per_m = force_per_torque_per_m(LEAD_MM, 1.0);
    close("K_f", per_m, number(&table["Kf"]), 1e-6 * per_m);
    close("force", 0.1 * per_m, number(&table["F_at_0p1Nm_N"]), 1e-5);
    close(
        "efficiency",
        317.945 / per_m,
        number(&table["eta_implied_by_317p945"]),
        1e-6,
    );
    close("gain", observer(5e-3).gain(), number(&table["Ke"]), 1e-9);
    let least = -2.0 * J / 1e-3;
    close(
        "lowest gain",
        least,
        number(&table["Ke_stable_range"][0]),
        1e-9,
    );
    for row in table["circle"].as_array().unwrap() {
        let feed_mm_per_s = number(&row["feed_m_min"]) * 1000.0 / 60.0;
        let torque = J * TAU / LEAD_MM * feed_mm_per_s * feed_mm_per_s / 20.0;
        let expected = number(&row["inertia_torque_Nm"]);
        close(
            "torque of the acceleration",
            torque,
            expected,
            1e-6 * expected,
        );
        close(
            "resultant",
            0.1_f64.hypot(torque),
            number(&row["current_only_resultant_Nm"]),
            1e-6,
        );
    }
}

fn published_loop() -> LoopModel {
    LoopModel {
        fine_period_s: 1e-3,
        per_rough: 8,
        inertia_kg_m2: J,
        torque_constant_nm_per_a: KT,
        lead_mm: LEAD_MM,
        position_gain_per_s: 40.0,
        velocity_loop_hz: 50.0,
        velocity_integral_s: 0.02,
        observer_time_constant_s: 5e-3,
        mean_samples: 8.0,
        tooth_period_s: TOOTH_S,
        latency: 1,
        delay_periods: 0,
        led: false,
    }
}

/// Torque per feed, N·m per mm/s, at a depth.
fn torque_per_feed(depth_mm: f64) -> f64 {
    K_CUT * depth_mm * 60.0
}

fn proportional(gain_mm_per_min: f64) -> Law {
    Law::Proportional {
        gain: gain_mm_per_min / 60.0,
    }
}

#[test]
fn the_largest_stable_gains() {
    let table = case("004_stability.json");
    let model = published_loop();
    for row in table["full"].as_array().unwrap() {
        let (depth, expected) = (number(&row["b_mm"]), number(&row["Kc_max"]));
        let found =
            model.gain_margin(proportional(1000.0), torque_per_feed(depth), 0.1, 16.0) * 1000.0;
        println!("{depth} mm: {found:.0}, published {expected:.0}");
        close(
            &format!("largest gain at {depth} mm"),
            found,
            expected,
            0.01 * expected,
        );
        let growth = model.growth(proportional(1500.0), torque_per_feed(depth), 0.1);
        close(
            &format!("growth at {depth} mm"),
            growth,
            number(&row["rho_at_1500"]),
            0.01,
        );
        if let Some(expected) = row["Kc_max_latency0"].as_f64() {
            let direct = LoopModel {
                latency: 0,
                ..model
            };
            let found = direct.gain_margin(proportional(1000.0), torque_per_feed(depth), 0.1, 16.0)
                * 1000.0;
            close(
                &format!("largest gain without latency at {depth} mm"),
                found,
                expected,
                0.01 * expected,
            );
        }
    }
    let averaged = LoopModel {
        mean_samples: 32.0,
        ..model
    };
    let found =
        averaged.gain_margin(proportional(1000.0), torque_per_feed(4.5), 0.1, 16.0) * 1000.0;
    let expected = number(&table["Kc_max_b4p5_navg4"]);
    close(
        "largest gain with a mean over four rough periods",
        found,
        expected,
        0.01 * expected,
    );
}

#[test]
fn the_largest_stable_integral_gains() {
    let table = &case("004_stability.json")["PI"];
    let model = published_loop();
    let deep = torque_per_feed(4.5);
    let stable = |gain: f64, integral: f64| {
        model.growth(
            Law::Pi {
                gain: gain / 60.0,
                integral_gain: integral / 60.0,
            },
            deep,
            0.1,
        ) < 1.0
    };
    for (gain, key) in [(0.0, "Ki_max_b4p5_Kc0"), (1000.0, "Ki_max_b4p5_Kc1000")] {
        let most = number(&table[key]);
        assert!(
            stable(gain, 0.99 * most) && !stable(gain, 1.01 * most),
            "{key}: {most}"
        );
    }
    let alpha = number(&table["alpha_max"]);
    let ratio = |exponent: f64| model.growth(Law::Ratio { exponent }, deep, 0.1) < 1.0;
    assert!(ratio(0.99 * alpha) && !ratio(1.01 * alpha), "{alpha}");
    for row in table["rho_canonical_PI"].as_array().unwrap() {
        let law = law("PI").unwrap();
        let found = model.growth(law, torque_per_feed(number(&row["b_mm"])), 0.1);
        close(
            &format!("growth of {row}"),
            found,
            number(&row["rho"]),
            1e-3,
        );
    }
}

#[test]
fn time_shows_the_same_bound() {
    for row in case("004_stability.json")["confirm"].as_array().unwrap() {
        let gain = number(&row["Kc"]);
        let mut setup = Setup::new(Some(proportional(gain)), "steps = [[1.0, 4.0]]", 40.0);
        setup.feed_mm_per_min = 150.0;
        let ran = setup.run();
        let spread = |[from, to]: [f64; 2]| {
            let torques = || {
                ran.ticks
                    .iter()
                    .filter(|t| t.t_s >= from && t.t_s < to)
                    .map(|t| t.torque_nm)
            };
            torques().fold(0.0, f64::max) - torques().fold(1.0, f64::min)
        };
        let (early, late) = (spread([3.0, 4.0]), spread([9.0, 10.0]));
        println!("{row}: {early} {late}");
        assert_eq!(late < 0.5 * early, number(&row["factor"]) < 1.0);
    }
}

#[test]
fn the_guard_on_a_sharp_jump() {
    let table = case("004_guard.json");
    let tolerance = |key: &str| number(&table["tolerance"][key]);
    for row in table["rows"].as_array().unwrap() {
        let label = row["label"].as_str().unwrap();
        let name = label.split([' ', ',']).next().unwrap();
        let radius = if label.contains("R=5") { 5.0 } else { 0.0 };
        let workpiece =
            format!("steps = [[3.0, 1.0], [8.0, 7.0], [40.0, 0.0]]\nentry_radius_mm = {radius:?}");
        let mut setup = Setup::new(law(name), &workpiece, 20.0);
        let blocks = if label.contains("3 blocks") { 3 } else { 1 };
        setup.guard = (!label.contains("no guard")).then(|| Guard::new(0.2, blocks));
        setup.ripple = if label.contains("ripple") { 0.5 } else { 0.0 };
        let ran = setup.run();
        let above =
            |level: f64| ran.ticks.iter().filter(|t| t.torque_nm > level).count() as f64 * 1e-3;
        println!(
            "{label}: peak {:.4}, above {:.3} {:.3} s, {:?}",
            ran.peak_nm(),
            above(0.2),
            above(0.25),
            ran.tripped_s
        );
        let jump = ran
            .ticks
            .iter()
            .find(|t| t.s_mm >= if radius > 0.0 { 3.0 } else { 8.0 })
            .unwrap();
        close(
            label,
            ran.peak_nm(),
            number(&row["peak_torque"]),
            tolerance("torque_abs"),
        );
        close(
            label,
            above(0.2),
            number(&row["time_above_0p2_s"]),
            tolerance("time_abs_s"),
        );
        close(
            label,
            above(0.25),
            number(&row["time_above_0p25_s"]),
            tolerance("time_abs_s"),
        );
        assert_eq!(
            ran.tripped_s.is_some(),
            row["tripped"].as_bool().unwrap(),
            "{label}"
        );
        if let (Some(trip), Some(delay_ms)) = (ran.tripped_s, row["trip_delay_ms"].as_f64()) {
            close(
                label,
                (trip - jump.t_s) * 1e3,
                delay_ms,
                tolerance("delay_abs_ms"),
            );
            let travel = ran.ticks.last().unwrap().s_mm - jump.s_mm;
            close(
                label,
                travel,
                number(&row["travel_after_jump_mm"]),
                tolerance("travel_abs_mm"),
            );
        }
    }
}

#[test]
fn each_period_that_the_bus_is_late_costs_gain() {
    let margin = |delay_periods: usize| {
        let model = LoopModel {
            delay_periods,
            ..published_loop()
        };
        model.gain_margin(proportional(1000.0), torque_per_feed(4.5), 0.1, 16.0)
    };
    let margins = [0, 2, 6, 15].map(margin);
    println!("{margins:?}");
    assert!(
        margins.windows(2).all(|pair| pair[1] < 0.98 * pair[0]),
        "{margins:?}"
    );
}
