//! Random programs: what holds for every filter, time constant and path. A failing program is printed, reduced.

use crate::common;

use common::{FILTERS, context, drive, line, norm, open};
use proptest::prelude::*;
use proptest::test_runner::FileFailurePersistence;
use tandem_motion::Path;
use tandem_rig::{Collected, arc, numbered};
use tandem_sdk::{AxisVector, Block, PathMode};

/// Lines and arcs of very different length, feed and direction, some with an exact stop.
fn programs() -> impl Strategy<Value = Vec<Block>> {
    let step = (
        [-20.0..20.0_f64, -20.0..20.0, -5.0..5.0],
        -3.0..1.0_f64,
        5.0..150.0_f64,
        -6.0..6.0_f64,
        0..8_u32,
    );
    proptest::collection::vec(step, 1..12).prop_map(|steps| {
        let mut at = AxisVector::ZERO;
        let mut blocks = Vec::new();
        for ([x, y, z], decade, feed, sweep, kind) in steps {
            let [x, y, z] = [x, y, z].map(|v| v * 10_f64.powf(decade));
            let mut block = match kind {
                0..3 if sweep.abs() > 0.1 && x.hypot(y) > 0.01 => {
                    arc(&at, [at[0] + x, at[1] + y], sweep, feed)
                }
                _ => line(&at, &[at[0] + x, at[1] + y, at[2] + z], feed),
            };
            if kind == 7 {
                block.path_mode = PathMode::ExactStop;
            }
            at = block.end;
            blocks.push(block);
        }
        blocks.retain(|block| block.length_mm > 1e-6);
        numbered(blocks)
    })
}

fn recorded(filter: &str, tau_ms: f64, blocks: &[Block]) -> Collected {
    recorded_at(0.001, filter, tau_ms, blocks)
}

fn recorded_at(fine_period_s: f64, filter: &str, tau_ms: f64, blocks: &[Block]) -> Collected {
    let mut machine = context(fine_period_s);
    machine.position = blocks.first().map_or(AxisVector::ZERO, |block| block.start);
    drive(&mut *open(filter, tau_ms, &machine), blocks)
}

/// Position at time `t_s` of the blocks driven as steps of feed, without any stop.
fn commanded(blocks: &[Block], t_s: f64) -> AxisVector {
    let mut left_s = t_s;
    for block in blocks {
        let time_s = block.length_mm / block.feed_mm_per_s;
        if left_s < time_s {
            return Path::new(block)
                .unwrap()
                .position(left_s * block.feed_mm_per_s);
        }
        left_s -= time_s;
    }
    blocks[blocks.len() - 1].end
}

/// The filters as difference equations on a grid of step `h`: nothing in common with the planner's closed forms.
fn filtered(filter: &str, tau_s: f64, h: f64, blocks: &[Block], count: usize) -> Vec<AxisVector> {
    let start = blocks[0].start;
    let raw: Vec<_> = (0..count)
        .map(|k| commanded(blocks, k as f64 * h))
        .collect();
    let average = |input: &[AxisVector], width: usize| -> Vec<AxisVector> {
        let at = |k: usize, age: usize| if k >= age { input[k - age] } else { start };
        // Trapezoids under the window, one added and one dropped at each step.
        let mut sum = start * width as f64;
        let next = |k: usize| {
            sum += (at(k, 0) + at(k, 1) - at(k, width) - at(k, width + 1)) * 0.5;
            sum * (1.0 / width as f64)
        };
        (0..count).map(next).collect()
    };
    let width = (tau_s / h).round() as usize;
    match filter {
        "linear" => average(&raw, width),
        "bell" => average(&average(&raw, width), width / 2),
        _ => {
            let kept = (-h / tau_s).exp();
            let follow = |y: &mut AxisVector, k: usize| {
                let middle = (raw[k] + raw[k.saturating_sub(1)]) * 0.5;
                *y = middle + (*y - middle) * kept;
                Some(*y)
            };
            (0..count).scan(start, |y, k| follow(y, k)).collect()
        }
    }
}

/// Seeds of programs that failed are printed and kept beside this file.
fn config() -> ProptestConfig {
    let seeds = FileFailurePersistence::WithSource("regressions");
    ProptestConfig {
        cases: 48,
        failure_persistence: Some(Box::new(seeds)),
        ..ProptestConfig::default()
    }
}

proptest! {
    #![proptest_config(config())]

    #[test]
    fn motion_is_continuous_and_ends_where_it_should(
        blocks in programs(), kind in 0..3_usize, tau_ms in 1.0..120.0_f64,
    ) {
        prop_assume!(!blocks.is_empty());
        let recorder = recorded(FILTERS[kind], tau_ms, &blocks);
        prop_assert!(norm(&(recorder.end() - blocks[blocks.len() - 1].end)) < 1e-9);
        let reported: f64 = recorder.reports.iter().map(|report| report.time_s).sum();
        prop_assert!((recorder.duration_s() - reported).abs() < 1e-9);
        for pair in recorder.segments.windows(2) {
            let (before, after) = (&pair[0], &pair[1]);
            let t = before.duration_s;
            prop_assert!(t > 0.0 && t <= 0.001 + 2e-8, "a piece of {} s", t);
            prop_assert!(norm(&(after.position(0.0) - before.position(t))) < 1e-9);
            prop_assert!((after.path_mm(0.0) - before.path_mm(t)).abs() < 1e-9);
            prop_assert!(before.path_mm(t) >= before.path_mm(0.0));
            // An exponential filter is cut off where its lag is below 1e-9 mm, so its last velocity is 1e-9/T at most.
            prop_assert!(norm(&(after.velocity(0.0) - before.velocity(t))) < 2e-6, "{before:?} {after:?}");
        }
    }

    #[test]
    fn path_speed_is_the_speed_and_within_the_feed(
        blocks in programs(), kind in 0..3_usize, tau_ms in 1.0..120.0_f64,
    ) {
        prop_assume!(!blocks.is_empty());
        for segment in recorded(FILTERS[kind], tau_ms, &blocks).segments.iter().filter(|s| s.duration_s > 1e-5) {
            // The speed may pass the feed by what a kink just after the start of a piece is worth.
            for share in [0.0, 0.5, 1.0] {
                let t = share * segment.duration_s;
                let (speed, path) = (norm(&segment.velocity(t)), segment.path_speed_mm_per_s(t));
                prop_assert!(speed <= segment.feed_mm_per_s * (1.0 + 1e-6) + 1e-3, "{speed} {segment:?}");
                // Exact at the ends; between, a reversal bends the speed too sharply for one polynomial.
                let ends = share != 0.5;
                prop_assert!((speed - path).abs() < if ends { 1e-5 } else { 0.05 * segment.feed_mm_per_s }, "{speed} {path}");
            }
        }
    }

    #[test]
    fn it_is_the_filter_that_it_says(mut blocks in programs(), kind in 0..3_usize, half_tau in 5..40_u32) {
        for block in &mut blocks {
            block.path_mode = PathMode::Continuous;
        }
        let mut nominal_s = 0.0;
        blocks.retain(|block| {
            // All blocks up to the first that would make the test slow.
            nominal_s += block.length_mm / block.feed_mm_per_s;
            nominal_s < 1.5
        });
        prop_assume!(!blocks.is_empty());
        let (h, tau_s) = (1e-4, f64::from(half_tau) * 1e-3);
        let recorder = recorded(FILTERS[kind], tau_s * 1e3, &blocks);
        let count = ((nominal_s + 2.0 * tau_s) / h) as usize;
        let expected = filtered(FILTERS[kind], tau_s, h, &blocks, count);
        let mut segments = recorder.timed();
        let mut current = segments.next();
        for (k, wanted) in expected.iter().enumerate() {
            let t = k as f64 * h;
            while let Some((start, segment)) = current && t > start + segment.duration_s + 1e-12 {
                current = segments.next();
            }
            let Some((start, segment)) = current else { break };
            let off = norm(&(segment.position(t - start) - *wanted));
            // A kink between two grid points costs the difference equation up to about F·h/2 · h/τ.
            prop_assert!(off < 2e-4, "{off} mm at {t} s");
        }
    }

    #[test]
    fn between_its_ends_a_segment_stays_on_the_filtered_path(
        blocks in programs(), kind in 0..3_usize, tau_ms in 10.0..120.0_f64,
    ) {
        prop_assume!(!blocks.is_empty());
        let coarse = recorded_at(0.001, FILTERS[kind], tau_ms, &blocks);
        let fine = recorded_at(0.000_13, FILTERS[kind], tau_ms, &blocks);
        let mut segments = coarse.timed().peekable();
        for (t, knot) in fine.timed() {
            while segments.peek().is_some_and(|(start, segment)| t > start + segment.duration_s) {
                segments.next();
            }
            let Some((start, segment)) = segments.peek() else { break };
            let off = norm(&(segment.position(t - start) - knot.position(0.0)));
            prop_assert!(off < 1e-6, "{off} mm at {t} s: {segment:?}");
        }
    }
}
