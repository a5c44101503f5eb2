//! What always holds: axis limits over every window of samples, end points, continuity, at most two blocks in motion, the
//! command feed. Over random programs with random time constants; a failure prints the seed of its program.

mod common;

use common::{Collected, Random, context, lines, published, run};
use tandem_block_overlap::{CornerControl, LimitMode, Options};
use tandem_sdk::{AxisVector, Block, BlockKind, PathMode, PlannerContext, SegmentFlags};

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
        let step = [length * f64::cos(heading), length * f64::sin(heading), 0.1 * length * random.between(-1.0, 1.0)];
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
        (block.feed_mm_per_s, block.time_constant_s, block.path_tolerance_mm) = (feed / 60.0, tau, tolerance);
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
                bucket = (bucket + sign * (next - velocity) - limits.acceleration_mm_per_s2 * PERIOD_S).max(0.0);
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

/// Continuity of position, velocity and path, path speed above the true speed and below the feed, ends in order.
fn assert_sound(collected: &Collected, blocks: &[Block], seed: u64) {
    let mut before = (blocks[0].start, AxisVector::ZERO, 0.0);
    let mut rest = true;
    for segment in &collected.segments {
        let slack = if rest { 1e-9 } else { 1e-6 };
        assert!(length(segment.position(0.0) - before.0) < 1e-8, "seed {seed}: the position jumps");
        assert!(length(segment.velocity(0.0) - before.1) < slack, "seed {seed}: the velocity steps");
        assert!((segment.path_mm(0.0) - before.2).abs() < 1e-7, "seed {seed}: the path jumps");
        for t in [0.0, segment.duration_s] {
            let speed = segment.path_speed_mm_per_s(t);
            assert!(length(segment.velocity(t)) <= speed + 1e-7, "seed {seed}: faster than the path speed");
            assert!(speed <= segment.feed_mm_per_s * (1.0 + 1e-9), "seed {seed}: {speed} is above the feed");
        }
        assert!(segment.stop_deceleration_mm_per_s2 > 50.0, "seed {seed}: {}", segment.stop_deceleration_mm_per_s2);
        let end = segment.duration_s;
        before = (segment.position(end), segment.velocity(end), segment.path_mm(end));
        rest = segment.flags.contains(SegmentFlags::ENDS_AT_REST);
    }
    assert_eq!(before.0, blocks.last().unwrap().end, "seed {seed}: the end point");
    assert_eq!(before.1, AxisVector::ZERO, "seed {seed}");
}

/// Each block ends before the one after the next begins: never more than two move.
fn assert_two_at_a_time(collected: &Collected, seed: u64) {
    let starts_s = collected.starts_s();
    for (index, report) in collected.reports.iter().enumerate().filter(|(i, _)| i + 2 < starts_s.len()) {
        let overlap_s = if report.end_feed_mm_per_s > 0.0 { report.time_constant_s } else { 0.0 };
        let end_s = starts_s[index] + report.time_s + overlap_s;
        assert!(
            end_s <= starts_s[index + 2] + 1e-9,
            "seed {seed}: block {index} ends after the start of the next but one"
        );
    }
}

/// Largest distance of a vertex passed in motion from the samples of its overlap, beyond the tolerance, mm.
fn worst_corner_mm(collected: &Collected, blocks: &[Block]) -> f64 {
    let tolerance = |block: &Block| if block.path_tolerance_mm.is_nan() { 0.01 } else { block.path_tolerance_mm };
    let starts_s = collected.starts_s();
    let mut worst = f64::NEG_INFINITY;
    for (index, pair) in blocks.windows(2).enumerate() {
        let tau_s = collected.reports[index].time_constant_s;
        let at = |k: u32| length(collected.at(starts_s[index + 1] + tau_s * f64::from(k) / 50.0).0 - pair[1].start);
        let nearest = (0..=50).map(at).fold(f64::INFINITY, f64::min);
        // What the search may miss between two of its steps.
        let fastest = |at: usize| collected.reports[at].peak_feed_mm_per_s;
        let step_mm = fastest(index).max(fastest(index + 1)) * tau_s / 100.0;
        worst = worst
            .max((nearest.powi(2) - step_mm.powi(2)).max(0.0).sqrt() - tolerance(&pair[0]).min(tolerance(&pair[1])));
    }
    worst
}

fn seeds(count: u64) -> Vec<u64> {
    match std::env::var("TANDEM_SEED") {
        Ok(seed) => vec![seed.parse().unwrap()],
        Err(_) => (1..=count).collect(),
    }
}

#[test]
fn random_programs_keep_every_promise() {
    let modes = [(CornerControl::On, LimitMode::Slow), (CornerControl::On, LimitMode::Stretch)];
    let loose = [(CornerControl::Off, LimitMode::Slow), (CornerControl::Off, LimitMode::Stretch)];
    let mut count = 0;
    for seed in seeds(400) {
        println!("seed {seed}");
        let blocks = program(seed);
        count += blocks.len();
        let context = context(&[1000.0, 700.0, 300.0], PERIOD_S);
        let (corner_control, limits) = modes.iter().chain(&loose).copied().nth(seed as usize % 4).unwrap();
        let options = Options { corner_control, limits, buffer_blocks: 4 + (seed as usize * 7) % 90 };
        let collected = run(&context, &options, &blocks, 0.008);
        let excess = worst_excess(&collected, &context);
        assert!(excess < 1e-6, "seed {seed}: exceeds by {excess} mm/s");
        assert_sound(&collected, &blocks, seed);
        assert_two_at_a_time(&collected, seed);
        if corner_control == CornerControl::On {
            let worst = worst_corner_mm(&collected, &blocks);
            assert!(worst <= 1e-9, "seed {seed}: a corner loses {worst} mm too much");
            let longest =
                |report: &tandem_sdk::BlockReport| report.end_feed_mm_per_s == 0.0 || report.time_constant_s < 0.201;
            assert!(limits == LimitMode::Stretch || collected.reports.iter().all(longest));
        }
    }
    assert!(count > 20_000 || std::env::var("TANDEM_SEED").is_ok(), "{count} blocks");
}

#[test]
fn random_programs_as_published_end_on_their_ticks() {
    for seed in seeds(100) {
        println!("seed {seed}");
        let blocks = program(seed);
        let collected = run(&context(&[1000.0; 3], PERIOD_S), &published(), &blocks, 0.008);
        assert_sound(&collected, &blocks, seed);
        assert_two_at_a_time(&collected, seed);
        for start_s in collected.starts_s() {
            let ticks = start_s / PERIOD_S;
            assert!((ticks - ticks.round()).abs() < 1e-6, "seed {seed}: a block starts at {ticks} ticks");
        }
    }
}

#[test]
fn the_square_is_no_slower_than_with_exact_stops() {
    let corners = [[0.0, 0.0], [20.0, 0.0], [20.0, 20.0], [0.0, 20.0], [0.0, 0.0]];
    let mut blocks = lines(&corners.map(|p| AxisVector::from_slice(&p)), |_| 5000.0);
    let context = context(&[1000.0; 3], PERIOD_S);
    let through = run(&context, &Options::default(), &blocks, 0.008);
    for block in &mut blocks {
        block.path_mode = PathMode::ExactStop;
    }
    let stopping = run(&context, &Options::default(), &blocks, 0.008);
    assert!(worst_excess(&through, &context) < 1e-6 && worst_excess(&stopping, &context) < 1e-6);
    assert!((stopping.duration_s() - 4.0 * (0.24 + 5000.0 / 60.0 / 999.0)).abs() < 1e-9, "{}", stopping.duration_s());
    assert!(through.duration_s() < stopping.duration_s() - 0.015, "{}", through.duration_s());
}

#[test]
fn a_planner_one_percent_too_fast_is_noticed() {
    let (honest, optimist) = (context(&[1000.0; 3], PERIOD_S), context(&[1010.0; 3], PERIOD_S));
    let blocks = lines(&[[0.0, 0.0], [40.0, 0.0], [40.0, 40.0]].map(|p| AxisVector::from_slice(&p)), |_| 12000.0);
    let excess = |planned| worst_excess(&run(planned, &Options::default(), &blocks, 0.008), &honest);
    assert!(excess(&honest) < 1e-6 && excess(&optimist) > 0.001);
}
