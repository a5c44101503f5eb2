//! Force control on the published specimens.

use serde_json::Value;
use tandem_force_control::friction::FrictionModel;
use tandem_force_control::law::Law;

use crate::rig::{Ran, Setup, case, close, model_of, number, plant_friction, rms};

pub const STEP: &str = "steps = [[8.0, 2.0], [18.0, 3.0], [28.0, 4.0], [38.0, 2.0], [48.0, 0.0]]\nentry_radius_mm = 5.0";
pub const ROOF: &str = "slopes = [[3.0, 1.5], [23.0, 4.5], [43.0, 1.5]]";

/// The published gains.
pub fn law(name: &str) -> Option<Law> {
    match name {
        "const" => None,
        "P" => Some(Law::Proportional {
            gain: 1500.0 / 60.0,
        }),
        "PI" => Some(Law::Pi {
            gain: 1000.0 / 60.0,
            integral_gain: 50.0 / 60.0,
        }),
        "MULT" => Some(Law::Ratio { exponent: 0.05 }),
        name => panic!("no law {name}"),
    }
}

fn specimen(name: &str, law: Option<Law>) -> (Setup, [f64; 2]) {
    match name {
        "step" => (Setup::new(law, STEP, 50.0), [10.0, 42.0]),
        "roof" => (Setup::new(law, ROOF, 45.0), [5.0, 41.0]),
        name => panic!("no specimen {name}"),
    }
}

/// The run of a row of the table. Whether it has noise, which no other generator repeats.
fn run(row: &Value) -> (Ran, [f64; 2], bool) {
    let label = row["label"].as_str().unwrap();
    let (mut setup, window) = specimen(
        row["specimen"].as_str().unwrap(),
        law(row["law"].as_str().unwrap()),
    );
    if let Some(rest) = label.strip_prefix("const safe ") {
        setup.feed_mm_per_min = rest.trim_end_matches(" mm/min").parse().unwrap();
    }
    for set in ["robot", "machine", "machine_stribeck"] {
        if label.contains(&format!("friction {set}")) {
            setup.servo.friction = plant_friction(set);
            let exact = label.contains("exact parameters") || label.contains("+ CV");
            setup.compensated = exact.then(|| model_of(&setup.servo.friction));
        }
    }
    let fitted =
        |coulomb_nm, viscous_nm_s_per_rad, stribeck_nm, stribeck_speed_rad_per_s| FrictionModel {
            coulomb_nm,
            viscous_nm_s_per_rad,
            stribeck_nm,
            stribeck_speed_rad_per_s,
            constant_nm: 0.0,
        };
    if label.contains("CV fit") {
        setup.compensated = Some(fitted(0.063_383_663_7, 0.000_446_398_223, 0.0, 0.0));
    }
    if label.contains("Stribeck fit") {
        setup.compensated = Some(fitted(
            0.059_969_604_8,
            0.000_604_584_471,
            0.019_351_218_6,
            0.414_042_455,
        ));
    }
    if label.contains("Jn=") {
        setup.servo.tuned_inertia_kg_m2 = Some(1.8053e-4);
        setup.observer =
            tandem_force_control::observer::Observer::new(1.8053e-4, 0.378, 1e-3, 5e-3);
    }
    if label.contains("encoder 8192") {
        setup.servo.encoder_counts = 8192;
        setup.servo.current_noise_ma = 5.0;
    }
    if label.contains("ripple") {
        setup.ripple = 0.5;
    }
    if label.contains("4-block") {
        setup.mean_samples = 32.0;
    }
    let noisy = label.contains("encoder");
    (setup.run(), window, noisy)
}

#[test]
fn every_row_of_the_table() {
    let table = case("004_force.json");
    let tolerance = |key: &str| number(&table["tolerance"][key]);
    for row in table["rows"].as_array().unwrap() {
        let (ran, window, noisy) = run(row);
        let label = format!("{} {} {}", row["specimen"], row["law"], row["label"]);
        let cut = ran.window(window);
        let torques = || cut.iter().map(|tick| tick.torque_nm);
        let time_rel = if noisy {
            tolerance("noisy_rows_rel")
        } else {
            tolerance("time_rel")
        };
        let expected = |key: &str| number(&row[key]);
        let torque_abs = |value: f64| {
            if noisy {
                tolerance("noisy_rows_rel") * value
            } else {
                tolerance("torque_abs")
            }
        };
        let check = |what: &str, found: f64, tolerance: f64| {
            close(
                &format!("{label}: {what}"),
                found,
                expected(what),
                tolerance,
            );
        };
        println!("{label}: {:.3} s, peak {:.4}", ran.time_s(), ran.peak_nm());
        check("time_s", ran.time_s(), time_rel * expected("time_s"));
        check(
            "cut_time_s",
            cut.len() as f64 * 1e-3,
            time_rel * expected("cut_time_s"),
        );
        check(
            "peak_torque",
            ran.peak_nm(),
            torque_abs(expected("peak_torque")),
        );
        check(
            "mean_torque",
            torques().sum::<f64>() / cut.len() as f64,
            torque_abs(expected("mean_torque")),
        );
        let rms_error = rms(torques().map(|torque| torque - 0.1));
        check("rms_err_vs_Tref", rms_error, tolerance("rms_abs"));
        if !noisy {
            check(
                "max_torque",
                torques().fold(0.0, f64::max),
                tolerance("torque_abs"),
            );
            check(
                "min_torque",
                torques().fold(1.0, f64::min),
                tolerance("torque_abs"),
            );
            let feeds = || cut.iter().map(|tick| tick.feed_mm_per_min);
            check("feed_max", feeds().fold(0.0, f64::max), 0.5);
            check("feed_min", feeds().fold(1e9, f64::min), 0.5);
        }
    }
}

#[test]
fn every_rough_period_of_the_traces() {
    for (specimen_name, law_name) in [
        ("step", "P"),
        ("step", "PI"),
        ("step", "MULT"),
        ("roof", "P"),
        ("roof", "PI"),
        ("roof", "MULT"),
    ] {
        let trace = case(&format!("004_trace_{specimen_name}_{law_name}.json"));
        let ran = specimen(specimen_name, law(law_name)).0.run();
        let list = |key: &str| {
            trace[key]
                .as_array()
                .unwrap()
                .iter()
                .map(number)
                .collect::<Vec<_>>()
        };
        let (times, torques, feeds, places) = (list("t_s"), list("Tbar"), list("F"), list("s_mm"));
        for (index, time) in times.iter().enumerate() {
            let at = format!("{specimen_name} {law_name} at {time} s");
            let block = ran
                .blocks
                .iter()
                .find(|block| (block.t_s - time).abs() < 1e-6);
            let block = block.unwrap_or_else(|| panic!("{at}: the run is over"));
            close(
                &format!("{at}: torque"),
                block.mean_nm,
                torques[index],
                2e-6,
            );
            close(
                &format!("{at}: feed"),
                block.asked_mm_per_min,
                feeds[index],
                0.01,
            );
            close(&format!("{at}: place"), block.s_mm, places[index], 1e-4);
        }
    }
}
