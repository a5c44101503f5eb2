//! The published cases of the block overlap, run through the planner as the rough loop runs it.

use crate::common;

use common::{context, published, run};
use serde_json::Value;
use tandem_block_overlap::{Options, corner_error_mm, tau_for_tolerance_s};
use tandem_rig::{Collected, assert_close, case, lines, numbers};
use tandem_sdk::{AxisVector, Block};

const TICK_S: f64 = 1e-3;

/// The blocks of a program that has nothing but X, Y, F and TA words.
fn program(case: &Value) -> Vec<Block> {
    let mut points = vec![AxisVector::from_slice(&numbers(&case["input"]["start_mm"]))];
    let (mut feeds, mut taus) = (vec![], vec![]);
    for text in case["input"]["program"].as_array().unwrap() {
        let mut at = *points.last().unwrap();
        let (mut feed, mut tau) = (
            feeds.last().copied().unwrap_or(0.0),
            taus.last().copied().unwrap_or(f64::NAN),
        );
        for word in text.as_str().unwrap().split_whitespace() {
            let number = |text: &str| text.trim_end_matches('.').parse::<f64>().unwrap();
            match word.split_at(1) {
                ("X", value) => at[0] = number(value),
                ("Y", value) => at[1] = number(value),
                ("F", value) => feed = number(value),
                ("T", value) => tau = number(&value[1..]) / 1e3,
                _ => {}
            }
        }
        points.push(at);
        feeds.push(feed);
        taus.push(tau);
    }
    let mut blocks = lines(&points, |index| feeds[index]);
    blocks
        .iter_mut()
        .zip(&taus)
        .for_each(|(block, tau)| block.time_constant_s = *tau);
    blocks
}

fn run_case(case: &Value, options: &Options) -> Collected {
    let mut context = context(&[1000.0; 3], case["input"]["Ts_s"].as_f64().unwrap());
    context.time_constant_s = case["input"]["TA0_ms"].as_f64().unwrap() / 1e3;
    run(&context, options, &program(case), 0.008)
}

fn near(actual: f64, expected: &Value, tolerance: f64, what: &str) {
    let expected = expected.as_f64().unwrap();
    assert!(
        (actual - expected).abs() <= tolerance,
        "{what}: {actual} instead of {expected}"
    );
}

#[test]
fn programs_take_the_published_ticks() {
    for name in [
        "fig5",
        "fig7",
        "fig7_const50",
        "fig8",
        "fig8_const50",
        "fig9_S0",
        "fig9_S1",
        "fig9_S2",
        "fig9_S3",
    ] {
        let case = case(&format!("001_{name}"));
        let expect = &case["expect"];
        let collected = run_case(&case, &published());
        near(
            collected.duration_s() / TICK_S,
            &expect["total_ticks"],
            1e-6,
            name,
        );
        let blocks = expect["blocks"].as_array().unwrap();
        assert_eq!(collected.reports.len(), blocks.len());
        for ((report, start_s), block) in collected
            .reports
            .iter()
            .zip(collected.starts_s())
            .zip(blocks)
        {
            near(start_s / TICK_S, &block["start_tick"], 1e-6, "start");
            near(
                report.peak_feed_mm_per_s * 60.0,
                &block["F1_mm_min"],
                1e-6,
                "feed",
            );
            near(
                report.time_constant_s / TICK_S,
                &block["tau_d_ticks"],
                1e-9,
                "time constant",
            );
        }
        for pair in blocks.windows(2).zip(&collected.reports) {
            near(pair.1.time_s / TICK_S, &pair.0[0]["N_ticks"], 1e-6, "N");
        }
        for sample in expect["samples"].as_array().unwrap() {
            let (position, velocity) = collected.at(sample["tick"].as_f64().unwrap() * TICK_S);
            assert_close(&position.0[..2], &numbers(&sample["pos_mm"]), 1e-9);
            assert_close(&velocity.0[..2], &numbers(&sample["vel_mm_s"]), 1e-8);
        }
        let last = collected.segments.last().unwrap();
        assert_eq!(
            last.position(last.duration_s),
            program(&case).last().unwrap().end,
            "{name}"
        );
    }
}

/// Smallest value of a function that falls and then rises over the overlap from `from_s` for `tau_s`.
fn least(from_s: f64, tau_s: f64, value: impl Fn(f64) -> f64) -> f64 {
    let (mut low, mut high) = (from_s, from_s + tau_s);
    for _ in 0..60 {
        let third = (high - low) / 3.0;
        if value(low + third) < value(high - third) {
            high -= third;
        } else {
            low += third;
        }
    }
    value(low)
}

fn length(v: AxisVector) -> f64 {
    v.0.iter().map(|d| d * d).sum::<f64>().sqrt()
}

#[test]
fn corners_lose_what_the_closed_form_says() {
    for name in [
        "fig5",
        "fig7",
        "fig7_const50",
        "fig8",
        "fig8_const50",
        "fig9_S0",
        "fig9_S1",
        "fig9_S2",
        "fig9_S3",
    ] {
        let case = case(&format!("001_{name}"));
        let (collected, blocks) = (run_case(&case, &published()), program(&case));
        let starts_s = collected.starts_s();
        for corner in case["expect"]["corners"].as_array().unwrap() {
            let after = corner["after"].as_u64().unwrap() as usize;
            let tau_s = corner["tau_ms"].as_f64().unwrap() / 1e3;
            let vertex = blocks[after].start;
            let error_mm = least(starts_s[after], tau_s, |t| {
                length(collected.at(t).0 - vertex)
            });
            near(error_mm, &corner["err_mm"], 1e-6, name);
            let feed_mm_per_s = least(starts_s[after], tau_s, |t| length(collected.at(t).1));
            near(feed_mm_per_s * 60.0, &corner["min_feed_mm_min"], 1e-5, name);
        }
    }
}

#[test]
fn the_closed_form_gives_the_corner_errors() {
    for case in case("001_corner_error")["cases"].as_array().unwrap() {
        let number = |key: &str| case[key].as_f64().unwrap();
        let (before, after) = (number("F1_mm_min") / 60.0, number("F2_mm_min") / 60.0);
        let (tau_s, turn) = (number("tau_ms") / 1e3, number("theta_deg").to_radians());
        let error_mm = corner_error_mm(before, after, tau_s, turn);
        assert!(
            (error_mm - number("err_mm")).abs() < 1e-9,
            "{case}: {error_mm}"
        );
        if before == after {
            assert!((tau_for_tolerance_s(error_mm, before, turn) - tau_s).abs() < 1e-12);
        }
    }
}

#[test]
fn single_blocks_are_driven_as_the_corrected_rule_says() {
    for case in case("001_single_blocks")["cases"].as_array().unwrap() {
        let number = |key: &str| case[key].as_f64().unwrap();
        let mut context = context(&[1000.0; 3], TICK_S);
        context.time_constant_s = number("tau_a_ms") / 1e3;
        let points = [AxisVector::ZERO, AxisVector::from_slice(&[number("l_mm")])];
        let mut blocks = lines(&points, |_| number("F_mm_min"));
        blocks[0].time_constant_s = number("tau_d_ms") / 1e3;
        let collected = run(&context, &published(), &blocks, 0.008);
        let expect = &case["expect"];
        near(
            collected.duration_s() / TICK_S,
            &expect["block_ticks"],
            1e-6,
            "ticks",
        );
        near(
            collected.reports[0].peak_feed_mm_per_s * 60.0,
            &expect["F1_mm_min"],
            1e-6,
            "feed",
        );
        let [first, last] =
            [0, collected.segments.len() - 2].map(|i| collected.segments[i].acceleration(0.0)[0]);
        near(first, &expect["A_acc_mm_s2"], 1e-6, "acceleration");
        near(-last, &expect["A_dec_mm_s2"], 1e-6, "deceleration");
    }
}

/// The largest corner errors that a run leaves at sharp corners (above 30°) and at the others, mm.
fn largest_errors_mm(name: &str) -> [f64; 2] {
    let case = case(&format!("001_fig9_{name}"));
    let (collected, blocks) = (run_case(&case, &published()), program(&case));
    let starts_s = collected.starts_s();
    let mut largest = [0.0f64; 2];
    for corner in case["expect"]["corners"].as_array().unwrap() {
        let after = corner["after"].as_u64().unwrap() as usize;
        let tau_s = corner["tau_ms"].as_f64().unwrap() / 1e3;
        let error_mm = least(starts_s[after], tau_s, |t| {
            length(collected.at(t).0 - blocks[after].start)
        });
        let gentle = usize::from(corner["theta_deg"].as_f64().unwrap() <= 30.0);
        largest[gentle] = largest[gentle].max(error_mm);
    }
    largest
}

#[test]
fn shorter_constants_at_sharp_corners_lose_less_there_and_nothing_elsewhere() {
    let summary = case("001_fig9_summary");
    let errors = ["S0", "S1", "S2", "S3"].map(|name| {
        let [sharp_mm, gentle_mm] = largest_errors_mm(name);
        near(
            sharp_mm,
            &summary["expect"][name]["sharp_err_mm"],
            1e-6,
            name,
        );
        near(
            gentle_mm,
            &summary["expect"][name]["gentle_err_mm"],
            1e-6,
            name,
        );
        sharp_mm
    });
    for sharp_mm in &errors[1..] {
        assert!(
            (sharp_mm / errors[0] - 0.4).abs() < 1e-6,
            "{sharp_mm} of {}",
            errors[0]
        );
    }
}

#[test]
fn the_claim_of_the_paper() {
    let summary = case("001_fig9_summary");
    let ticks = |name: &str| {
        run_case(&case(&format!("001_fig9_{name}")), &published()).duration_s() / TICK_S
    };
    for name in ["S0", "S1", "S2", "S3"] {
        near(
            ticks(name),
            &summary["expect"][name]["total_ticks"],
            1e-6,
            name,
        );
    }
    assert!(
        (ticks("S1") - ticks("S0")).abs() < 1e-6,
        "shorter constants at sharp corners cost no time"
    );
    assert!(
        (ticks("S2") / ticks("S0") - 0.524).abs() < 0.001,
        "shorter ones on short blocks save 47.6 %"
    );
    assert!(
        ticks("S3") > 1.4 * ticks("S0"),
        "longer ones there cost time"
    );
}
