//! The reference figures of times and of sampled accelerations and jerks, against what is driven and how it is measured.

use crate::common;

use common::measure::{BEST_S, Figures, figures};
use common::{canonical, context, curve_block, run};
use serde_json::Value;
use tandem_rig::case;

fn drive(form: &str, name: &str) -> Figures {
    let (data, length_mm) = canonical(name);
    let block = curve_block(data.clone(), length_mm, 250.0);
    let context = context(block.0.start);
    figures(
        &run(&format!("form = \"{form}\""), &context, &[block]),
        &data,
        &context,
    )
}

fn row<'a>(case: &'a Value, name: &str, method: &str) -> &'a Value {
    let rows = case["rows"].as_array().unwrap();
    rows.iter()
        .find(|row| row["curve"] == name && row["method"] == method)
        .unwrap()
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

#[test]
fn the_best_times_are_those_of_the_case() {
    let case = case("002_tref");
    for (name, along_s, axes_s) in BEST_S {
        assert_eq!(
            along_s,
            number(&case["T_ref_s"][format!("{name}_tan")]),
            "{name}"
        );
        assert_eq!(
            axes_s,
            number(&case["T_ref_s"][format!("{name}_axis")]),
            "{name}"
        );
        // Without a jerk limit nothing is faster: a rigorous bound under limits along the path.
        let rows = case["rows"].as_array().unwrap();
        let bound = rows
            .iter()
            .find(|row| row["curve"] == name && row["limits"] == "tan")
            .unwrap();
        assert!(
            drive("windowed", name).time_s > number(&bound["T2_accel_only_lower_bound"]),
            "{name}"
        );
        // Nor than the best known, but for what that is sure of.
        let scan_s = drive("scan", name).time_s;
        assert!(
            (0.995..1.02).contains(&(scan_s / axes_s)),
            "{name}: {}",
            scan_s / axes_s
        );
    }
}

#[test]
fn the_forms_are_the_published_methods() {
    let case = case("002_jerk");
    let accepted = |key: &str| number(&case["acceptance"][key]);
    for (name, ..) in BEST_S {
        let (adaptive, baseline) = (drive("adaptive", name), row(&case, name, "M0"));
        close(
            adaptive.time_s,
            number(&baseline["total_time_s"]),
            number(&case["tolerance"]["M0_time_rel"]),
            name,
        );
        close(
            adaptive.path[1],
            number(&baseline["max_abs_a_tan"]),
            0.01,
            name,
        );
        close(
            adaptive.path[2],
            number(&baseline["max_abs_j_tan"]),
            0.01,
            name,
        );
        let (windowed, published) = (drive("windowed", name), row(&case, name, "M2"));
        close(
            windowed.time_s,
            number(&published["total_time_s"]),
            number(&case["tolerance"]["M2_time_rel"]),
            name,
        );
        assert!(
            windowed.path[1] <= accepted("a_tan_max") && windowed.path[2] <= accepted("j_tan_max"),
            "{windowed:?}"
        );
        assert!(
            windowed.chord_um <= accepted("chord_err_um_max"),
            "{windowed:?}"
        );
        let published_ratio =
            number(&baseline["max_abs_j_tan"]) / number(&published["max_abs_j_tan"]);
        assert!(
            adaptive.path[2] / windowed.path[2] > 0.95 * published_ratio,
            "{name}: jerk {windowed:?}"
        );
    }
}
