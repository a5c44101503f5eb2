//! What always holds: axis limits over every window of samples, end points, continuity, at most two blocks in motion, the
//! command feed, overlaps no longer than `TA`. Judged by the emitted motion and the program, not by what the planner says of
//! itself. Over random programs with random time constants; a failure prints the seed of its program.

use crate::common;

use common::{context, published, run};
use tandem_block_overlap::{CornerControl, LimitMode, Options};
use tandem_rig::{Collected, Random, lines};
use tandem_sdk::{AxisVector, Block, BlockKind, PathMode, PlannerContext, Segment, SegmentFlags};

const PERIOD_S: f64 = 1e-3;

/// A walk of long moves, chords, noise and reversals, with feeds, time constants, tolerances, stops and rapids at random.
fn program(seed: u64) -> Vec<Block> {
    let mut random = Random::new(seed);
    let mut points = vec![AxisVector::ZERO];
    let count = 20 + (random.unit() * 80.0) as usize;
    let (mut scale, mut heading) = (1.0, 0.0);
    for _ in 0..count {
        if random.unit() < 0.2 {
            scale = random.pick(&[20.0, 5.0, 1.0, 0.3, 0.05, 0.01]);
        }
        heading += random.pick(&[0.01, 0.1, 0.1, 1.0, 3.0]) * random.between(-1.0, 1.0);
        let length = scale * random.between(0.2, 1.0);
        let step = [
            length * f64::cos(heading),
            length * f64::sin(heading),
            0.1 * length * random.between(-1.0, 1.0),
        ];
        points.push(*points.last().unwrap() + AxisVector::from_slice(&step));
    }
    let mut blocks = lines(&points, |_| 0.0);
    let (mut feed, mut tau, mut tolerance) = (3000.0, f64::NAN, f64::NAN);
    for block in &mut blocks {
        if random.unit() < 0.1 {
            feed = random.between(50.0, 15000.0);
        }
        if random.unit() < 0.2 {
            tau = random.pick(&[1.0, 3.4, 10.0, 20.0, 50.0, 80.0, 200.0]) / 1e3;
        }
        if random.unit() < 0.05 {
            tolerance = random.pick(&[f64::NAN, 0.002, 0.05, 0.5]);
        }
        (
            block.feed_mm_per_s,
            block.time_constant_s,
            block.path_tolerance_mm,
        ) = (feed / 60.0, tau, tolerance);
        let kind = random.unit();
        if kind < 0.03 {
            block.path_mode = PathMode::ExactStop;
        } else if kind < 0.06 {
            (block.kind, block.feed_mm_per_s) = (BlockKind::Rapid, f64::INFINITY);
        }
    }
    blocks
}

/// By how much the worst window of samples exceeds the acceleration, mm/s; negative where none does.
fn worst_excess(collected: &Collected, context: &PlannerContext) -> f64 {
    let samples = collected.samples(PERIOD_S);
    let mut worst = f64::NEG_INFINITY;
    for (axis, limits) in context.limits.axes().iter().enumerate() {
        for sign in [1.0, -1.0] {
            let (mut bucket, mut velocity) = (0.0f64, 0.0);
            for pair in samples.windows(2) {
                let next = (pair[1][axis] - pair[0][axis]) / PERIOD_S;
                bucket = (bucket + sign * (next - velocity)
                    - limits.acceleration_mm_per_s2 * PERIOD_S)
                    .max(0.0);
                worst = worst.max(bucket);
                velocity = next;
            }
        }
    }
    worst
}

fn length(v: AxisVector) -> f64 {
    v.0.iter().map(|d| d * d).sum::<f64>().sqrt()
}

fn dot(a: AxisVector, b: AxisVector) -> f64 {
    a.0.iter().zip(&b.0).map(|(x, y)| x * y).sum()
}

/// Continuity of position, velocity and path, path speed not below the true one, ends in order.
fn assert_continuous(collected: &Collected, blocks: &[Block], seed: u64) {
    let mut before = (blocks[0].start, AxisVector::ZERO, 0.0);
    let mut rest = true;
    for segment in &collected.segments {
        let slack = if rest { 1e-9 } else { 1e-6 };
        assert!(
            length(segment.position(0.0) - before.0) < 1e-8,
            "seed {seed}: the position jumps"
        );
        assert!(
            length(segment.velocity(0.0) - before.1) < slack,
            "seed {seed}: the velocity steps"
        );
        assert!(
            (segment.path_mm(0.0) - before.2).abs() < 1e-7,
            "seed {seed}: the path jumps"
        );
        for t in [0.0, segment.duration_s] {
            let speed = segment.path_speed_mm_per_s(t);
            assert!(
                length(segment.velocity(t)) <= speed + 1e-7,
                "seed {seed}: faster than the path speed"
            );
        }
        assert!(
            segment.stop_deceleration_mm_per_s2 > 50.0,
            "seed {seed}: {}",
            segment.stop_deceleration_mm_per_s2
        );
        let end = segment.duration_s;
        before = (
            segment.position(end),
            segment.velocity(end),
            segment.path_mm(end),
        );
        rest = segment.flags.contains(SegmentFlags::ENDS_AT_REST);
    }
    assert_eq!(
        before.0,
        blocks.last().unwrap().end,
        "seed {seed}: the end point"
    );
    assert_eq!(before.1, AxisVector::ZERO, "seed {seed}");
}

/// The emitted motion taken apart: what of it is the block of the segment, and what the block before.
struct Parts {
    /// Shares of the block before and of the block itself; none where the two are in line.
    shares: Option<[f64; 2]>,
    /// What is left over: anything else that moves.
    rest: f64,
}

fn parts(of: AxisVector, before: Option<AxisVector>, block: AxisVector) -> Parts {
    let along = dot(of, block);
    let off = of - block * along;
    let Some(before) = before else {
        return Parts {
            shares: Some([0.0, along]),
            rest: length(off),
        };
    };
    let (cosine, aside) = (dot(before, block), before - block * dot(before, block));
    let sine = length(aside);
    if sine < 1e-9 {
        return Parts {
            shares: None,
            rest: length(off),
        };
    }
    let across = aside * (1.0 / sine);
    let first = dot(off, across) / sine;
    Parts {
        shares: (sine > 1e-2).then_some([first, along - cosine * first]),
        rest: length(off - across * dot(off, across)),
    }
}

/// Each moment shows at most two neighbours in motion, forward, neither above the feed of the program, and none of the
/// first where the program asks for rest. Gives the longest overlap before each block, s.
fn assert_two_at_a_time(collected: &Collected, blocks: &[Block], seed: u64) -> Vec<f64> {
    let directions: Vec<AxisVector> = blocks
        .iter()
        .map(|b| (b.end - b.start) * (1.0 / b.length_mm))
        .collect();
    let mut overlaps_s = vec![0.0; blocks.len()];
    for segment in collected
        .segments
        .iter()
        .filter(|segment| segment.duration_s > 0.0)
    {
        let index = segment.block as usize;
        let block = &blocks[index];
        let stops = index == 0 || block.starts_at_rest() || blocks[index - 1].ends_at_rest();
        let before = (!stops).then(|| directions[index - 1]);
        let feeds = [
            if stops {
                0.0
            } else {
                blocks[index - 1].feed_mm_per_s
            },
            block.feed_mm_per_s,
        ];
        for t in [0.0, 0.4, 1.0].map(|share| share * segment.duration_s) {
            let place = parts(segment.position(t) - block.start, before, directions[index]);
            let speed = parts(segment.velocity(t), before, directions[index]);
            assert!(
                place.rest < 1e-7 && speed.rest < 1e-6,
                "seed {seed}: more than blocks {index} and before move"
            );
            let fastest = feeds[0].max(feeds[1]) * (1.0 + 1e-9);
            assert!(
                segment.path_speed_mm_per_s(t) <= fastest,
                "seed {seed}: block {index} is above the feed"
            );
            for (share, feed) in speed
                .shares
                .into_iter()
                .flat_map(|shares| shares.into_iter().zip(feeds))
            {
                assert!(
                    share > -1e-6,
                    "seed {seed}: block {index} or the one before goes back, {share} mm/s"
                );
                assert!(
                    share <= feed * (1.0 + 1e-9) + 1e-6,
                    "seed {seed}: block {index}: {share} above {feed} mm/s"
                );
            }
            for axis in segment.velocity(t).0 {
                assert!(axis.abs() <= 250.0 + 1e-6, "seed {seed}: {axis} mm/s");
            }
        }
        let middle = parts(
            segment.velocity(segment.duration_s / 2.0),
            before,
            directions[index],
        );
        if middle.shares.is_some_and(|shares| shares[0] > 1e-6) {
            overlaps_s[index] += segment.duration_s;
        }
    }
    overlaps_s
}

/// No overlap is longer than the time constant of the program there, on a tick.
fn assert_overlaps_as_stated(overlaps_s: &[f64], blocks: &[Block], seed: u64) {
    for (index, pair) in blocks.windows(2).enumerate() {
        let stated = pair[0].time_constant_s;
        let stated_s = if stated.is_nan() { 0.05 } else { stated };
        let max_s = (stated_s / PERIOD_S).round().max(1.0) * PERIOD_S;
        let overlap_s = overlaps_s[index + 1];
        assert!(
            overlap_s <= max_s + 1e-9,
            "seed {seed}: {overlap_s} s after block {index} with TA {max_s} s"
        );
    }
}

/// Largest distance of a vertex from the motion around it, beyond the tolerance, mm.
fn worst_corner_mm(collected: &Collected, blocks: &[Block]) -> f64 {
    let tolerance = |block: &Block| {
        if block.path_tolerance_mm.is_nan() {
            0.01
        } else {
            block.path_tolerance_mm
        }
    };
    let mut nearest = vec![f64::INFINITY; blocks.len()];
    for segment in &collected.segments {
        let index = segment.block as usize;
        for vertex in [index, index + 1]
            .into_iter()
            .filter(|vertex| *vertex < blocks.len())
        {
            nearest[vertex] = nearest[vertex].min(distance_mm(segment, blocks[vertex].start));
        }
    }
    let beyond = |(i, pair): (usize, &[Block])| {
        nearest[i + 1] - tolerance(&pair[0]).min(tolerance(&pair[1]))
    };
    blocks
        .windows(2)
        .enumerate()
        .map(beyond)
        .fold(f64::NEG_INFINITY, f64::max)
}

/// Distance of a point from a segment, mm: the best of nine places, and the best near it.
fn distance_mm(segment: &Segment, point: AxisVector) -> f64 {
    let at = |t: f64| length(segment.position(t) - point);
    let step_s = segment.duration_s / 8.0;
    let best = (0..=8)
        .map(|k| f64::from(k) * step_s)
        .min_by(|a, b| at(*a).total_cmp(&at(*b)))
        .unwrap();
    let (mut low, mut high) = (
        (best - step_s).max(0.0),
        (best + step_s).min(segment.duration_s),
    );
    for _ in 0..40 {
        let third = (high - low) / 3.0;
        *(if at(low + third) < at(high - third) {
            &mut high
        } else {
            &mut low
        }) = if at(low + third) < at(high - third) {
            high - third
        } else {
            low + third
        };
    }
    at(low).min(at(best))
}

fn seeds(count: u64) -> Vec<u64> {
    match std::env::var("TANDEM_SEED") {
        Ok(seed) => vec![seed.parse().unwrap()],
        Err(_) => (1..=count).collect(),
    }
}

#[test]
fn random_programs_keep_every_promise() {
    let modes = [
        (CornerControl::On, LimitMode::Slow),
        (CornerControl::On, LimitMode::Stretch),
    ];
    let loose = [
        (CornerControl::Off, LimitMode::Slow),
        (CornerControl::Off, LimitMode::Stretch),
    ];
    let (mut count, mut overlapped_s) = (0, 0.0);
    for seed in seeds(400) {
        println!("seed {seed}");
        let blocks = program(seed);
        count += blocks.len();
        let context = context(&[1000.0, 700.0, 300.0], PERIOD_S);
        let (corner_control, limits) = modes
            .iter()
            .chain(&loose)
            .copied()
            .nth(seed as usize % 4)
            .unwrap();
        let options = Options {
            corner_control,
            limits,
            buffer_blocks: 4 + (seed as usize * 7) % 90,
        };
        let collected = run(&context, &options, &blocks, 0.008);
        let excess = worst_excess(&collected, &context);
        assert!(excess < 1e-6, "seed {seed}: exceeds by {excess} mm/s");
        assert_continuous(&collected, &blocks, seed);
        let overlaps_s = assert_two_at_a_time(&collected, &blocks, seed);
        if limits == LimitMode::Slow {
            assert_overlaps_as_stated(&overlaps_s, &blocks, seed);
        }
        overlapped_s += overlaps_s.iter().sum::<f64>();
        if corner_control == CornerControl::On {
            let worst = worst_corner_mm(&collected, &blocks);
            assert!(
                worst <= 1e-9,
                "seed {seed}: a corner loses {worst} mm too much"
            );
        }
    }
    assert!(overlapped_s > 0.0, "nothing overlaps");
    assert!(
        count > 20_000 || std::env::var("TANDEM_SEED").is_ok(),
        "{count} blocks"
    );
}

#[test]
fn random_programs_as_published_end_on_their_ticks() {
    for seed in seeds(100) {
        println!("seed {seed}");
        let blocks = program(seed);
        let collected = run(
            &context(&[1000.0; 3], PERIOD_S),
            &published(),
            &blocks,
            0.008,
        );
        assert_continuous(&collected, &blocks, seed);
        assert_overlaps_as_stated(
            &assert_two_at_a_time(&collected, &blocks, seed),
            &blocks,
            seed,
        );
        for start_s in collected.starts_s() {
            let ticks = start_s / PERIOD_S;
            assert!(
                (ticks - ticks.round()).abs() < 1e-6,
                "seed {seed}: a block starts at {ticks} ticks"
            );
        }
    }
}

#[test]
fn the_square_is_no_slower_than_with_exact_stops() {
    let corners = [
        [0.0, 0.0],
        [20.0, 0.0],
        [20.0, 20.0],
        [0.0, 20.0],
        [0.0, 0.0],
    ];
    let mut blocks = lines(&corners.map(|p| AxisVector::from_slice(&p)), |_| 5000.0);
    let context = context(&[1000.0; 3], PERIOD_S);
    let through = run(&context, &Options::default(), &blocks, 0.008);
    for block in &mut blocks {
        block.path_mode = PathMode::ExactStop;
    }
    let stopping = run(&context, &Options::default(), &blocks, 0.008);
    assert!(worst_excess(&through, &context) < 1e-6 && worst_excess(&stopping, &context) < 1e-6);
    assert!(
        (stopping.duration_s() - 4.0 * (0.24 + 5000.0 / 60.0 / 999.0)).abs() < 1e-9,
        "{}",
        stopping.duration_s()
    );
    assert!(
        through.duration_s() < stopping.duration_s() - 0.015,
        "{}",
        through.duration_s()
    );
}

#[test]
fn a_planner_one_percent_too_fast_is_noticed() {
    let (honest, optimist) = (
        context(&[1000.0; 3], PERIOD_S),
        context(&[1010.0; 3], PERIOD_S),
    );
    let blocks = lines(
        &[[0.0, 0.0], [40.0, 0.0], [40.0, 40.0]].map(|p| AxisVector::from_slice(&p)),
        |_| 12000.0,
    );
    let excess =
        |planned| worst_excess(&run(planned, &Options::default(), &blocks, 0.008), &honest);
    assert!(excess(&honest) < 1e-6 && excess(&optimist) > 0.001);
}
