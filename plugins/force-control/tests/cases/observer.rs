//! The observer beside what the current alone says.

use std::f64::consts::TAU;

use serde_json::Value;
use tandem_force_control::observer::Observer;
use tandem_sim::servo::{PLANT_STEP_S, ServoOptions};

use crate::motion::{Known, Watched};
use crate::rig::{
    J, KT, LEAD_MM, PERIOD_S, TURNS, case, close, cutting, number, observer, plant, servo,
};

#[test]
fn the_published_coefficients_and_the_step_response() {
    let unit = &case("004_observer.json")["unit"];
    let mut found = observer(5e-3);
    close("K_e", found.gain(), number(&unit["Ke"]), 1e-10);
    let (mut speed, mut last_a) = (0.0, 0.0);
    for (k, expected) in unit["xh"].as_array().unwrap().iter().enumerate() {
        close(
            &format!("x2h({k})"),
            found.step(speed, last_a),
            number(expected),
            1e-9,
        );
        last_a = 0.02 * (0.3 * k as f64).sin();
        speed += PERIOD_S / J * (KT * last_a - 0.1);
    }
    assert!(-0.3684 < found.gain() && found.gain() < 0.0);
}

/// A ramp to `feed`, a cut from 0.6 s to 0.8 s, a ramp down: what is known in each tick.
fn ramp_cut(
    options: ServoOptions,
    observer: Observer,
    feed_mm_per_min: f64,
    ramp_s: f64,
) -> Vec<Known> {
    let mut watched = Watched::new(options, observer, 0.0, 3);
    let top = feed_mm_per_min / 60.0 * TURNS;
    let mut angle = 0.0;
    let tick = |k: u32| {
        let t = f64::from(k) * PERIOD_S;
        let speed = top * (t / ramp_s).min(1.0).min((1.5 - t) / ramp_s).max(0.0);
        angle += speed * PERIOD_S;
        let cut = (600..800).contains(&k);
        watched.tick(angle, speed, if cut { 0.1 } else { 0.0 })
    };
    (0..2000).map(tick).collect()
}

#[test]
fn acceleration_is_no_phantom_torque_for_the_observer() {
    for row in case("004_observer.json")["linear"].as_array().unwrap() {
        let known = ramp_cut(
            servo(row["friction"].as_str().unwrap()),
            observer(5e-3),
            number(&row["feed_mm_min"]),
            number(&row["t_acc_s"]),
        );
        let air: Vec<&Known> = known[..600].iter().chain(&known[831..]).collect();
        let most =
            |of: fn(&Known) -> f64| air.iter().map(|known| of(known).abs()).fold(0.0, f64::max);
        let mean = |of: fn(&Known) -> f64| known[631..800].iter().map(of).sum::<f64>() / 169.0;
        let check = |key: &str, found: f64| {
            close(&format!("{key} of {row}"), found, number(&row[key]), 1e-4);
        };
        check("current_only_max_err_accdec", most(|k| k.current_nm));
        check("current_only_mean_cut", mean(|k| k.current_nm));
        check("observer_max_err_accdec", most(|k| k.estimate_nm));
        check("observer_mean_cut", mean(|k| k.estimate_nm));
    }
}

#[test]
fn a_wrong_inertia_leaves_its_share_of_the_acceleration() {
    let expected = number(&case("004_observer.json")["mismatch"]["max_phantom"]);
    let options = ServoOptions {
        tuned_inertia_kg_m2: Some(1.8053e-4),
        ..servo("none")
    };
    let known = ramp_cut(
        options,
        Observer::new(1.8053e-4, KT, PERIOD_S, 5e-3),
        10_000.0,
        0.1,
    );
    let most = known[..550]
        .iter()
        .map(|k| k.estimate_nm.abs())
        .fold(0.0, f64::max);
    close("phantom torque", most, expected, 2e-6);
}

#[test]
fn encoder_noise_by_time_constant() {
    let table = case("004_observer.json");
    for row in table["noise"].as_array().unwrap() {
        let options = ServoOptions {
            encoder_counts: number(&row["cpr"]) as u32,
            current_noise_ma: 5.0,
            ..servo("robot")
        };
        let mut watched = Watched::new(options, observer(number(&row["tau_s"])), 0.0, 9);
        let speed = 150.0 / 60.0 * TURNS;
        let known: Vec<Known> = (0..8000_u32)
            .map(|k| watched.tick(f64::from(k + 1) * PERIOD_S * speed, speed, 0.1))
            .collect();
        let estimates: Vec<f64> = known[2000..].iter().map(|k| k.estimate_nm).collect();
        let means: Vec<f64> = estimates
            .chunks(8)
            .map(|c| c.iter().sum::<f64>() / 8.0)
            .collect();
        let (mean, std_1ms) = mean_and_deviation(&estimates);
        let (_, std_8ms) = mean_and_deviation(&means);
        let tolerance = number(&table["tolerance"]["noise_rel"]);
        for (key, found) in [("std_1ms", std_1ms), ("std_8ms", std_8ms)] {
            close(
                &format!("{key} of {row}"),
                found,
                number(&row[key]),
                tolerance * number(&row[key]),
            );
        }
        close("mean", mean, 0.11, 2e-4);
    }
}

pub fn mean_and_deviation(values: &[f64]) -> (f64, f64) {
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / values.len() as f64;
    (mean, variance.sqrt())
}

#[test]
fn the_circle_beside_the_current_alone() {
    for row in case("004_circle.json")["rows"].as_array().unwrap() {
        let found = circle(number(&row["feed_mm_min"]), &servo("none"), None);
        check_circle(row, &found, |key| 1e-4_f64.max(5e-3 * number(&row[key])));
    }
}

/// Compares the errors on a circle with a row of a table.
pub fn check_circle(row: &Value, found: &CircleErrors, tolerance: impl Fn(&str) -> f64) {
    let pairs = [
        ("axis_rms_err_current", found.axis_rms_current),
        ("axis_rms_err_observer", found.axis_rms_observer),
        ("resultant_mean_current", found.mean_current),
        ("resultant_mean_observer", found.mean_observer),
        ("resultant_max_err_observer", found.max_observer),
        ("resultant_rms_err_observer", found.rms_observer),
    ];
    for (key, found) in pairs {
        close(
            &format!("{key} of {row}"),
            found,
            number(&row[key]),
            tolerance(key),
        );
    }
}

#[test]
fn at_10_m_per_min_the_current_alone_is_28_percent_off() {
    let errors = circle(10_000.0, &servo("none"), None);
    let (current, observed) = (
        errors.mean_current / 0.1 - 1.0,
        errors.mean_observer / 0.1 - 1.0,
    );
    println!(
        "current alone {:+.1} %, observer {:+.2} %",
        100.0 * current,
        100.0 * observed
    );
    assert!((0.27..0.29).contains(&current) && observed.abs() < 1e-3);
}

#[test]
fn figures_6_and_7() {
    for row in case("004_observer.json")["fig67"].as_array().unwrap() {
        let roof = row["case"].as_str().unwrap().contains("roof");
        let workpiece = if roof {
            "slopes = [[2.0, 0.5], [12.0, 3.5]]"
        } else {
            "steps = [[0.0, 3.0]]"
        };
        let mut watched = Watched::new(
            servo(row["friction"].as_str().unwrap()),
            observer(5e-3),
            0.0,
            1,
        );
        let mut cutting = cutting(workpiece);
        let (mut t_s, mut command_mm, mut rows) = (0.0, 0.0, vec![]);
        while watched.axis.angle_rad / TURNS < 15.0 {
            let s_mm = watched.axis.angle_rad / TURNS;
            let feed_mm_per_s = if roof {
                200.0
            } else if s_mm < 7.5 {
                100.0
            } else {
                50.0
            } / 60.0;
            command_mm += feed_mm_per_s * PERIOD_S;
            let known = watched.begin(command_mm * TURNS, feed_mm_per_s * TURNS);
            let (torque_nm, _) = plant(&mut watched.axis, &mut cutting, 0.0, t_s);
            rows.push((s_mm, torque_nm / 0.02 * TAU, known.estimate_nm));
            t_s += PERIOD_S;
        }
        let mean = |from: f64, to: f64, of: fn(&(f64, f64, f64)) -> f64| {
            let within: Vec<f64> = rows
                .iter()
                .filter(|r| r.0 >= from && r.0 < to)
                .map(of)
                .collect();
            within.iter().sum::<f64>() / within.len() as f64
        };
        let check = |key: &str, found: f64| {
            close(
                &format!("{key} of {row}"),
                found,
                number(&row[key]),
                1e-3 * number(&row[key]) + 2e-5,
            );
        };
        check("est_3_6mm", mean(3.0, 6.0, |r| r.2));
        check("est_8_11mm", mean(8.0, 11.0, |r| r.2));
        if row["friction"] == "none" {
            let measured = mean(3.0, 11.0, |r| r.1) / mean(3.0, 11.0, |r| r.2);
            close("K_f from means", measured, number(&row["Kf_measured"]), 1.5);
        }
    }
}

/// Errors on a circle of 20 mm radius under a tangential cutting torque of 0.1 N·m.
#[derive(Debug, Default)]
pub struct CircleErrors {
    pub axis_rms_current: f64,
    pub axis_rms_observer: f64,
    pub mean_current: f64,
    pub mean_observer: f64,
    pub max_observer: f64,
    pub rms_observer: f64,
}

pub fn circle(
    feed_mm_per_min: f64,
    options: &ServoOptions,
    compensated: Option<(
        tandem_force_control::friction::FrictionModel,
        crate::motion::Where,
    )>,
) -> CircleErrors {
    let radius = 20.0 * TAU / LEAD_MM;
    let turn = feed_mm_per_min / 60.0 / 20.0;
    let mut axes = [0, 1].map(|i| {
        let start = if i == 0 { radius } else { 0.0 };
        let options = ServoOptions {
            velocity_feed_forward: 1.0,
            ..*options
        };
        let mut watched = Watched::new(options, observer(5e-3), start, 1 + i);
        watched.compensated = compensated;
        watched
    });
    let ticks = (TAU / turn / PERIOD_S) as u32 + 1;
    let total = if ticks > 4000 {
        ticks + 2000
    } else {
        2 * ticks + 2000
    };
    let (mut errors, mut count) = (CircleErrors::default(), 0.0);
    for k in 1..=total {
        let phase = turn * f64::from(k) * PERIOD_S;
        let (sin, cos) = phase.sin_cos();
        let place = [radius * cos, radius * sin];
        let speed = [-radius * turn * sin, radius * turn * cos];
        let tangential = |axes: &[Watched; 2]| {
            let moves = [0, 1].map(|i| axes[i].axis.speed_rad_per_s);
            moves.map(|speed| 0.1 * speed / moves[0].hypot(moves[1]).max(1e-9))
        };
        let load = tangential(&axes);
        let known = [0, 1].map(|i| axes[i].begin(place[i], speed[i]));
        for _ in 0..10 {
            (0..2).for_each(|i| axes[i].axis.step(load[i], PLANT_STEP_S));
        }
        if k <= total - ticks {
            continue;
        }
        count += 1.0;
        let resultant = |of: fn(&Known) -> f64| of(&known[0]).hypot(of(&known[1]));
        for (known, load) in known.iter().zip(load) {
            errors.axis_rms_current += (known.current_nm - load).powi(2) / 2.0;
            errors.axis_rms_observer += (known.estimate_nm - load).powi(2) / 2.0;
        }
        let observed = resultant(|k| k.estimate_nm);
        errors.mean_current += resultant(|k| k.current_nm);
        errors.mean_observer += observed;
        errors.max_observer = errors.max_observer.max((observed - 0.1).abs());
        errors.rms_observer += (observed - 0.1).powi(2);
    }
    errors.axis_rms_current = (errors.axis_rms_current / count).sqrt();
    errors.axis_rms_observer = (errors.axis_rms_observer / count).sqrt();
    errors.rms_observer = (errors.rms_observer / count).sqrt();
    errors.mean_current /= count;
    errors.mean_observer /= count;
    errors
}
