//! The published cases of the two-step look-ahead, run through the planner as the rough loop runs it.

mod common;

use common::{context, run, tangent};
use serde_json::Value;
use tandem_rig::{Collected, assert_close, case, lines, numbers, points};
use tandem_sdk::AxisVector;

const STEP_S: f64 = 1e-4;

fn run_case(input: &Value, count: usize, buffer: usize) -> Collected {
    let points = points(&input["points_mm"]);
    let feeds = &input["feed_mm_min"];
    let feed = |index: usize| {
        feeds
            .as_f64()
            .unwrap_or_else(|| feeds[index].as_f64().unwrap())
    };
    let accelerations = numbers(&input["axis_acc_mm_s2"]);
    let allowed = input["V_allow_mm_min"].as_f64().unwrap();
    let context = context(&accelerations, allowed, input["Ts_s"].as_f64().unwrap());
    run(
        &context,
        &tangent(buffer),
        &lines(&points[..=count], feed),
        STEP_S,
    )
}

/// Position and feed, mm/s, at program time `t_s`.
fn at(collected: &Collected, t_s: f64) -> (AxisVector, f64) {
    let (segment, since_s) = collected.place(t_s);
    (
        segment.position(since_s),
        segment.path_speed_mm_per_s(since_s),
    )
}

fn times(collected: &Collected) -> Vec<f64> {
    collected.reports.iter().map(|r| r.time_s).collect()
}

#[test]
fn square() {
    let case = case("000_square");
    let collected = run_case(&case["input"], 4, 100);
    assert_close(
        &collected.junction_feeds(),
        &numbers(&case["expect"]["junction_feed_mm_min"]),
        1e-6,
    );
    assert!((collected.duration_s() - 1.871_079_812_206_572_6).abs() < 1e-9);
    for (report, phases) in collected
        .reports
        .iter()
        .zip(case["expect"]["phases_s"].as_array().unwrap())
    {
        assert!(
            (report.peak_feed_mm_per_s * 60.0 - phases["peak_mm_min"].as_f64().unwrap()).abs()
                < 1e-6
        );
        let total: f64 = ["t_acc", "t_cruise", "t_dec"]
            .iter()
            .map(|p| phases[p].as_f64().unwrap())
            .sum();
        assert!((report.time_s - total).abs() < 1e-9);
    }
    for sample in case["expect"]["samples"].as_array().unwrap() {
        let (position, feed) = at(&collected, sample["t_s"].as_f64().unwrap());
        assert_close(&position.0[..2], &numbers(&sample["pos_mm"]), 1e-6);
        assert!((feed * 60.0 - sample["feed_mm_min"].as_f64().unwrap()).abs() < 1e-6);
    }
}

#[test]
fn arcs_of_chords_after_every_insertion() {
    for name in ["000_arcs80", "000_arcs80_tangent"] {
        let case = case(name);
        for (count, feeds) in case["expect"]["junction_feed_mm_min_after_inserting"]
            .as_object()
            .unwrap()
        {
            let collected = run_case(&case["input"], count.parse().unwrap(), 100);
            assert_close(&collected.junction_feeds(), &numbers(feeds), 1e-6);
        }
        let whole = run_case(&case["input"], 80, 100);
        assert!(
            (whole.duration_s() - case["expect"]["total_time_s"].as_f64().unwrap()).abs() < 1e-9
        );
        assert_close(
            &times(&whole),
            &numbers(&case["expect"]["block_time_s"]),
            1e-9,
        );
        let ten = run_case(&case["input"], 10, 100);
        let peak = ten.reports[2..]
            .iter()
            .map(|r| r.peak_feed_mm_per_s * 60.0)
            .fold(0.0, f64::max);
        assert!((peak - case["expect"]["first10_peak_mm_min"].as_f64().unwrap()).abs() < 1e-6);
    }
}

#[test]
fn a_finite_buffer_freezes_what_has_started() {
    let arcs = case("000_arcs80");
    for case in case("000_buffer")["cases"].as_array().unwrap() {
        let buffer = case["buffer"].as_u64().unwrap() as usize;
        let collected = run_case(&arcs["input"], 80, buffer);
        assert_close(
            &collected.junction_feeds(),
            &numbers(&case["junction_feed_mm_min"]),
            1e-6,
        );
        assert!((collected.duration_s() - case["total_time_s"].as_f64().unwrap()).abs() < 1e-9);
    }
}

#[test]
fn a_short_block_between_long_ones() {
    let file = case("000_long_short_long");
    for case in file["cases"].as_array().unwrap() {
        let mut input = file["input"].clone();
        input["points_mm"] = case["points_mm"].clone();
        let collected = run_case(&input, 4, 100);
        assert_close(&collected.junction_feeds(), &numbers(&case["opt"]), 1e-6);
        assert!((collected.duration_s() - case["opt_T"].as_f64().unwrap()).abs() < 1e-9);
    }
}

#[test]
fn mixed_feeds_and_random_paths() {
    let mixed = case("000_mixed_feed");
    let random = case("000_random3d");
    let all = random["cases"]
        .as_array()
        .unwrap()
        .iter()
        .map(|c| (c, &c["expect"], 1e-8));
    for (input, expect, time_s) in all.chain([(&mixed["input"], &mixed["expect"], 1e-9)]) {
        let count = input["points_mm"].as_array().unwrap().len() - 1;
        let collected = run_case(input, count, 100);
        assert_close(
            &collected.junction_feeds(),
            &numbers(&expect["junction_feed_mm_min"]),
            1e-6,
        );
        assert_close(
            &times(&collected),
            &numbers(&expect["block_time_s"]),
            time_s,
        );
        assert!((collected.duration_s() - expect["total_time_s"].as_f64().unwrap()).abs() < time_s);
    }
}

#[test]
fn rough_records_and_fine_increments() {
    let case = case("000_two_step");
    let collected = run_case(&tandem_rig::case("000_square")["input"], 4, 100);
    let (rough_s, fine_s) = (0.005, 0.0005);
    let records = (collected.duration_s() / rough_s).ceil() as u64;
    assert_eq!(records, case["expect"]["n_rough"].as_u64().unwrap());
    for record in case["expect"]["rough"].as_array().unwrap() {
        let from_s = record["index"].as_f64().unwrap() * rough_s;
        let (from, start_feed) = at(&collected, from_s);
        let (to, end_feed) = at(&collected, from_s + rough_s);
        assert_close(&(to - from).0[..2], &numbers(&record["dx_mm"]), 1e-9);
        let feeds = [
            record["fs_mm_min"].as_f64().unwrap(),
            record["fe_mm_min"].as_f64().unwrap(),
        ];
        assert_close(&[start_feed * 60.0, end_feed * 60.0], &feeds, 1e-6);
    }
    for (index, increment) in case["expect"]["fine_first_records_mm"]
        .as_array()
        .unwrap()
        .iter()
        .enumerate()
    {
        let from = collected.at(index as f64 * fine_s).0;
        let to = collected.at((index + 1) as f64 * fine_s).0;
        assert_close(&(to - from).0[..2], &numbers(increment), 1e-9);
    }
    let end = collected.segments.last().unwrap();
    assert_eq!(
        end.position(end.duration_s),
        *points(&tandem_rig::case("000_square")["input"]["points_mm"])
            .last()
            .unwrap()
    );
}
