//! The axis rule: over every window of samples an axis changes its velocity by at most A·Δt + V.

use crate::common;

use common::{context, run};
use proptest::prelude::*;
use proptest::test_runner::{Config, TestRunner};
use tandem_look_ahead::Options;
use tandem_rig::{Collected, lines};
use tandem_sdk::{AxisVector, Block, BlockKind, PlannerContext};

const PERIOD_S: f64 = 1e-3;

/// By how much the worst window exceeds `A·Δt + V`, mm/s; negative where none does.
fn worst_excess(collected: &Collected, context: &PlannerContext) -> f64 {
    let total_s = collected.duration_s();
    let count = (total_s / PERIOD_S).ceil() as usize + 3;
    let samples = sample(collected, count);
    let mut worst = f64::NEG_INFINITY;
    for (axis, limits) in context.limits.axes().iter().enumerate() {
        for sign in [1.0, -1.0] {
            let (mut bucket, mut velocity) = (0.0f64, 0.0);
            for pair in samples.windows(2) {
                let next = (pair[1][axis] - pair[0][axis]) / PERIOD_S;
                let change = sign * (next - velocity) - limits.acceleration_mm_per_s2 * PERIOD_S;
                bucket = (bucket + change).max(0.0);
                worst = worst.max(bucket - limits.speed_difference_mm_per_s);
                velocity = next;
            }
        }
    }
    worst
}

fn sample(collected: &Collected, count: usize) -> Vec<AxisVector> {
    let mut samples = vec![];
    let (mut index, mut start_s) = (0, 0.0);
    for tick in 0..count {
        let t_s = tick as f64 * PERIOD_S;
        while index + 1 < collected.segments.len()
            && t_s > start_s + collected.segments[index].duration_s
        {
            start_s += collected.segments[index].duration_s;
            index += 1;
        }
        let segment = &collected.segments[index];
        samples.push(segment.position((t_s - start_s).min(segment.duration_s)));
    }
    samples
}

fn feed_respected(collected: &Collected, blocks: &[Block]) -> bool {
    let feeds = collected.reports.iter().zip(blocks);
    collected.reports.len() == blocks.len()
        && feeds
            .into_iter()
            .all(|(r, b)| r.peak_feed_mm_per_s <= b.feed_mm_per_s * (1.0 + 1e-12))
}

/// Steps of a walk: mixtures of long moves, chords, noise, reversals and collinear pieces.
fn walk() -> impl Strategy<Value = Vec<(AxisVector, f64)>> {
    let step = (
        0..6u8,
        -1.0..1.0f64,
        -1.0..1.0f64,
        -1.0..1.0f64,
        200.0..12000.0f64,
    )
        .prop_map(|(kind, x, y, z, feed)| {
            let scale = [20.0, 1.0, 0.05, 0.01, 0.3, 3.0][kind as usize];
            let bend = if kind == 3 {
                [1.0, 0.01 * y, 0.0]
            } else {
                [x, y, z]
            };
            (AxisVector::from_slice(&bend) * scale, feed)
        });
    proptest::collection::vec(step, 1..120)
}

fn blocks(steps: &[(AxisVector, f64)]) -> Vec<Block> {
    let mut points = vec![AxisVector::ZERO];
    for (step, _) in steps.iter().filter(|(s, _)| *s != AxisVector::ZERO) {
        points.push(*points.last().unwrap() + *step);
    }
    lines(&points, |index| steps[index].1)
}

#[test]
fn random_walks_keep_the_limits() {
    let mut runner = TestRunner::new(Config {
        cases: 400,
        failure_persistence: None,
        ..Config::default()
    });
    runner
        .run(
            &(walk(), 0.0..400.0f64, 2..200usize),
            |(steps, allowed, buffer)| {
                let context = context(&[1000.0, 700.0, 300.0], allowed, PERIOD_S);
                let blocks = blocks(&steps);
                let options = Options {
                    buffer_blocks: buffer,
                    ..Options::default()
                };
                let collected = run(&context, &options, &blocks, 0.008);
                let excess = worst_excess(&collected, &context);
                prop_assert!(excess < 1e-6, "exceeds by {excess} mm/s");
                prop_assert!(feed_respected(&collected, &blocks));
                let last = collected.segments.last().unwrap();
                prop_assert_eq!(last.position(last.duration_s), blocks.last().unwrap().end);
                Ok(())
            },
        )
        .unwrap();
}

fn circle_chords(radius_mm: f64, chord_mm: f64) -> Vec<AxisVector> {
    let count = (std::f64::consts::TAU * radius_mm / chord_mm).ceil();
    let angle = |i: f64| std::f64::consts::TAU * i / count;
    let at =
        |i: f64| AxisVector::from_slice(&[radius_mm * angle(i).cos(), radius_mm * angle(i).sin()]);
    (0..=count as u32).map(|i| at(f64::from(i))).collect()
}

#[test]
fn a_circle_of_fine_chords_is_driven_at_its_centripetal_speed() {
    let context = context(&[1000.0, 1000.0, 1000.0], 100.0, PERIOD_S);
    let blocks = lines(&circle_chords(2.0, 0.01), |_| 5000.0);
    let collected = run(&context, &Options::default(), &blocks, 0.008);
    assert!(worst_excess(&collected, &context) < 1e-6);
    let peak = collected
        .reports
        .iter()
        .map(|r| r.peak_feed_mm_per_s)
        .fold(0.0, f64::max);
    // Turning takes 0.8 of each axis: at 45° both share it, and the circle is √√2 times as fast as at the quadrants.
    let slow = (0.8 * 999.0 * 2.0f64).sqrt();
    let fast = slow * 2.0f64.powf(0.25);
    assert!(
        (0.95 * fast..=1.001 * fast).contains(&peak),
        "{peak} against {fast}"
    );
    let mean = std::f64::consts::TAU * 2.0 / collected.duration_s();
    assert!(mean > 0.9 * slow, "{mean} against {slow}");
}

/// The way of a line that moves a linear axis is in mm and that of a turn alone in rad: where one follows the other, the turn's direction
/// steps by nearly 1, which a feed in mm/s makes dear.
#[test]
fn a_line_between_slow_turns_is_not_driven_as_slowly_as_they_are() {
    let context = context(&[50.0, 50.0, 50.0, 0.0024], 0.08, PERIOD_S);
    let points = [
        [0.0, 0.0, 0.0, 0.0],
        [0.0, 0.0, 0.0, 0.0035],
        [0.4, 0.0, 0.0, 0.00357],
        [0.4, 0.0, 0.0, 0.0059],
    ]
    .map(|p| AxisVector::from_slice(&p));
    let collected = run(
        &context,
        &Options::default(),
        &lines(&points, |_| 252.0),
        0.008,
    );
    assert!(worst_excess(&collected, &context) < 1e-6);
    // By itself the line takes a little more than its 0.4 mm at half of a speed that the turns' acceleration leaves it, 0.6 mm/s.
    let line_s = collected.reports[1].time_s;
    assert!(line_s < 2.0, "{line_s}");
    assert!(
        collected.junction_feeds()[1] > 0.0,
        "the line is entered in motion"
    );
}

#[test]
fn a_reversal_and_a_right_angle_step_by_the_allowed_difference() {
    let context = context(&[1000.0, 1000.0], 100.0, PERIOD_S);
    let points =
        [[0.0, 0.0], [20.0, 0.0], [0.0, 0.0], [0.0, 20.0]].map(|p| AxisVector::from_slice(&p));
    let collected = run(
        &context,
        &Options::default(),
        &lines(&points, |_| 5000.0),
        0.008,
    );
    assert!(worst_excess(&collected, &context) < 1e-6);
    let feeds = collected.junction_feeds();
    assert!(
        (feeds[1] - 49.95).abs() < 1e-9 && (feeds[2] - 99.9).abs() < 1e-9,
        "{feeds:?}"
    );
}

fn arc(from: &Block, radius_mm: f64) -> Block {
    let mut block = Block::at(from.end);
    block.kind = BlockKind::Arc;
    block.index = from.index + 1;
    block.end = from.end + AxisVector::from_slice(&[0.0, 2.0 * radius_mm]);
    block.length_mm = std::f64::consts::PI * radius_mm;
    block.feed_mm_per_s = from.feed_mm_per_s;
    block.arc.plane = [0, 1];
    block.arc.center_mm = [from.end[0], from.end[1] + radius_mm];
    block.arc.radius_mm = radius_mm;
    block.arc.start_angle_rad = -std::f64::consts::FRAC_PI_2;
    block.arc.sweep_rad = std::f64::consts::PI;
    block
}

#[test]
fn an_arc_entered_at_speed_keeps_the_limits() {
    let context = context(&[1000.0, 1000.0], 100.0, PERIOD_S);
    let first = lines(
        &[AxisVector::ZERO, AxisVector::from_slice(&[40.0, 0.0])],
        |_| 6000.0,
    )[0];
    let second = arc(&first, 5.0);
    let collected = run(&context, &Options::default(), &[first, second], 0.008);
    assert!(worst_excess(&collected, &context) < 1e-6);
    let entered = collected.reports[1].start_feed_mm_per_s;
    assert!(
        (entered - (0.8 * 999.0 * 5.0f64).sqrt()).abs() < 1e-9,
        "{entered}"
    );
}

#[test]
fn a_planner_one_percent_too_fast_is_noticed() {
    // The bucket forgives V: an acceleration 1 % too high shows once it has lasted for V/(0.01·A).
    let honest = context(&[1000.0, 1000.0], 10.0, PERIOD_S);
    let optimist = context(&[1010.0, 1010.0], 10.0, PERIOD_S);
    let points = [[0.0, 0.0], [40.0, 0.0]].map(|p| AxisVector::from_slice(&p));
    let excess = |planned| {
        worst_excess(
            &run(
                planned,
                &Options::default(),
                &lines(&points, |_| 12000.0),
                0.008,
            ),
            &honest,
        )
    };
    assert!(excess(&honest) < 1e-6 && excess(&optimist) > 0.1);
}
