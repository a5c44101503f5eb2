//! The published cases of the two-step look-ahead, run through the planner as the rough loop runs it.

use crate::common;

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

/// Junction feeds of the published insertion with a buffer of `count` blocks, mm/s: when a block starts, its end is as fast as
/// its start, its junction and the rest at the end of the buffer allow.
fn of_published_insertion(caps: &[f64], lengths_mm: &[f64], a: f64, count: usize) -> Vec<f64> {
    let mut feeds = vec![0.0_f64];
    for block in 0..lengths_mm.len() {
        let last = (block + count).min(lengths_mm.len());
        let mut reach = 0.0_f64;
        for junction in (block + 1..last).rev() {
            let square = (reach * reach + 2.0 * a * lengths_mm[junction]).sqrt();
            reach = if junction == last {
                0.0
            } else {
                square.min(caps[junction])
            };
        }
        let forward = (feeds[block].powi(2) + 2.0 * a * lengths_mm[block]).sqrt();
        feeds.push(reach.min(forward));
    }
    feeds
}

#[test]
fn small_buffers_of_blocks_shorter_than_a_fine_period_are_the_published_insertion() {
    let mut random = tandem_rig::Random::from_the_clock();
    let (fine_s, a) = (1e-3, 355.0);
    for case in 0..24 {
        let buffer = random.pick(&[2, 3, 10]);
        let (mut at, mut heading) = ([0.0_f64; 2], 0.0_f64);
        let mut points = vec![AxisVector::ZERO];
        for _ in 0..120 {
            // At 83 mm/s a fine period is 0.083 mm.
            let length_mm = if random.below(10) == 0 {
                random.between(0.1, 5.0)
            } else {
                random.between(0.004, 0.07)
            };
            heading += random.between(-0.2, 0.2);
            at = [
                at[0] + length_mm * heading.cos(),
                at[1] + length_mm * heading.sin(),
            ];
            points.push(AxisVector::from_slice(&at));
        }
        let blocks = lines(&points, |_| 5000.0);
        let context = context(&[a, a], 100.0, fine_s);
        let collected = run(
            &context,
            &tangent(buffer),
            &blocks,
            random.pick(&[8e-3, 1e-3, 25e-3]),
        );
        let lengths_mm: Vec<f64> = blocks.iter().map(|block| block.length_mm).collect();
        let roomy = run(&context, &tangent(1000), &blocks, 8e-3);
        let caps: Vec<f64> = (0..blocks.len())
            .map(|junction| {
                let turn = |i: usize| {
                    let step = points[i + 1] - points[i];
                    step[1].atan2(step[0])
                };
                if junction == 0 {
                    return 0.0;
                }
                let drop = 2.0 * ((turn(junction) - turn(junction - 1)) / 2.0).sin().powi(2);
                (a * fine_s / drop).clamp(100.0 / 60.0, 5000.0 / 60.0)
            })
            .collect();
        let expected = of_published_insertion(&caps, &lengths_mm, a, buffer);
        let ends: Vec<f64> = collected
            .reports
            .iter()
            .map(|r| r.end_feed_mm_per_s)
            .collect();
        for (block, (found, expected)) in ends.iter().zip(&expected[1..]).enumerate() {
            // Behind the last block nothing is waited for: it is known while the buffer before it is still full.
            let knows_more = block + buffer + 1 >= blocks.len() && *found > *expected;
            assert!(
                knows_more || (found - expected).abs() < 1e-6,
                "case {case}, buffer {buffer}, block {block}: {found}, and not {expected} mm/s"
            );
        }
        assert!(collected.duration_s() >= roomy.duration_s() - 1e-9);
    }
}
