//! Random machines as well as random programs: every sample at every phase within travel, velocity, acceleration and jerk as the
//! guard judges them, the path within its tolerance, and bounds on memory and on what is planned.

#[path = "../../../tests/counting_allocator.rs"]
mod counting_allocator;

use counting_allocator::peak_bytes_of;
use tandem_rig::{Collected, Random, arc, line, numbered, stream};
use tandem_sdk::{
    AxisLimits, AxisVector, Block, BlockKind, Limits, PathMode, Planner, PlannerContext, Segment,
};
use tandem_smooth::{Effort, Options, SmoothPlanner};

/// Machines in all.
const MACHINES: u64 = 16;
/// Phases at which each motion is sampled.
const PHASES: usize = 3;
/// Bytes that a planner holds at most.
const MAX_BYTES: usize = 60_000_000;
/// The tolerances of the guard, relative.
const GUARD: f64 = 1e-6;
const GUARD_JERK: f64 = 1e-2;

/// A machine of two to four axes, the fourth rotary, every limit anywhere in four decades.
fn machine(random: &mut Random) -> PlannerContext {
    let alike = random.below(3) == 0;
    let draw = |random: &mut Random| {
        let feed_mm_per_s = random.length(1.0, 1000.0);
        AxisLimits {
            min_mm: -1e4,
            max_mm: 1e4,
            feed_mm_per_s,
            rapid_mm_per_s: feed_mm_per_s * random.length(1.0, 3.0),
            acceleration_mm_per_s2: random.length(10.0, 1e5),
            jerk_mm_per_s3: random.length(1e3, 1e7),
            speed_difference_mm_per_s: 0.0,
        }
    };
    let first = draw(random);
    let count = 2 + random.below(3) as usize;
    let axes: Vec<AxisLimits> = (0..count)
        .map(|_| if alike { first } else { draw(random) })
        .collect();
    let period_s = random.pick(&[0.125e-3, 0.25e-3, 0.37e-3, 0.5e-3, 1e-3, 1.3e-3, 2e-3]);
    let context = tandem_rig::context(&axes, period_s);
    PlannerContext {
        rough_period_s: period_s * random.pick(&[1.0, 2.0, 4.0, 8.0, 16.0, 25.0]),
        path_tolerance_mm: random.length(1e-4, 1.0),
        max_feed_ratio: random.pick(&[1.0, 1.0, 1.2, 2.0]),
        ..context
    }
}

/// Lines and arcs of any length, a few rests and rapids among them.
fn program(random: &mut Random, context: &PlannerContext) -> Vec<Block> {
    let count = context.limits.count as usize;
    let (low, high) = random.pick(&[(1e-4, 0.01), (1e-3, 1.0), (0.1, 30.0), (1e-4, 30.0)]);
    let mut feed_mm_per_s = random.length(1.0 / 60.0, 300.0);
    let (turn, changes, arcs) = (
        random.pick(&[0.05, 0.5, 3.1]),
        random.below(4) == 0,
        random.below(2) == 0,
    );
    let (mut at, mut heading, mut blocks) =
        (AxisVector::ZERO, random.between(-3.1, 3.1), Vec::new());
    // No program takes more than some minutes.
    let (mut left_s, most) = (30.0, random.length(2.0, 400.0) as usize);
    while blocks.len() < most && left_s > 0.0 {
        heading += random.between(-turn, turn);
        if changes && random.below(5) == 0 {
            feed_mm_per_s = random.length(1.0 / 60.0, 300.0);
        }
        let length = random.length(low, high).min(20.0 * feed_mm_per_s);
        let mut block = if arcs && length > 1e-3 && random.below(3) == 0 {
            let (radius, sweep) = (length, random.between(-4.0, 4.0));
            let center = [
                at[0] + radius * heading.cos(),
                at[1] + radius * heading.sin(),
            ];
            arc(&at, center, sweep, feed_mm_per_s)
        } else {
            let mut to = at;
            (to[0], to[1]) = (
                at[0] + length * heading.cos(),
                at[1] + length * heading.sin(),
            );
            for axis in 2..count {
                to[axis] += if random.below(2) == 0 {
                    random.between(-length, length)
                } else {
                    0.0
                };
            }
            line(&at, &to, feed_mm_per_s)
        };
        match random.below(40) {
            0 => block.path_mode = PathMode::ExactStop,
            1 if block.kind == BlockKind::Line => {
                (block.kind, block.feed_mm_per_s) = (BlockKind::Rapid, f64::INFINITY);
            }
            _ => {}
        }
        left_s -= block.length_mm / feed_mm_per_s;
        at = block.end;
        blocks.push(block);
    }
    numbered(blocks)
}

/// The travel of every axis that the program moves, so that it lies along its ends.
fn hem_in(context: &mut PlannerContext, blocks: &[Block]) {
    let points: Vec<AxisVector> = blocks.iter().flat_map(path_of).collect();
    let mut axes = context.limits.axes().to_vec();
    for (axis, limits) in axes.iter_mut().enumerate() {
        let values = points.iter().map(|point| point[axis]);
        limits.min_mm = values.clone().fold(0.0, f64::min);
        limits.max_mm = values.fold(limits.min_mm + 1e-3, f64::max);
    }
    context.limits = Limits::new(&axes).unwrap();
}

/// Points along a block, near enough to stand for it.
fn path_of(block: &Block) -> Vec<AxisVector> {
    let path = tandem_motion::Path::new(block).unwrap();
    let count = if block.kind == BlockKind::Arc {
        4000
    } else {
        1
    };
    (0..=count)
        .map(|n| path.position(block.length_mm * f64::from(n) / f64::from(count)))
        .collect()
}

/// Samples of a fine period, the first `phase` of one behind the start; a rest ends its period.
fn samples(segments: &[Segment], period_s: f64, phase: f64) -> Vec<AxisVector> {
    let mut samples = vec![segments[0].position(0.0)];
    let (mut start_s, mut next_s) = (0.0, phase * period_s);
    for segment in segments {
        let end_s = start_s + segment.duration_s;
        while next_s < end_s {
            samples.push(segment.position(next_s - start_s));
            next_s += period_s;
        }
        start_s = end_s;
        if segment.duration_s == 0.0 {
            samples.push(segment.position(0.0));
            (start_s, next_s) = (0.0, period_s);
        }
    }
    let last = segments[segments.len() - 1];
    samples.extend([last.position(last.duration_s); 4]);
    samples
}

/// What the guard would say.
fn judge(samples: &[AxisVector], context: &PlannerContext) -> Result<(), String> {
    let period_s = context.fine_period_s;
    for (axis, limits) in context.limits.axes().iter().enumerate() {
        let x: Vec<f64> = samples.iter().map(|sample| sample[axis]).collect();
        let mut before = [x[0], 0.0, 0.0];
        for (n, at) in x.iter().enumerate() {
            let rounding = 4.0 * f64::EPSILON * at.abs().max(1.0) / period_s;
            let velocity = (at - before[0]) / period_s;
            let acceleration = (velocity - before[1]) / period_s;
            let jerk = (acceleration - before[2]) / period_s;
            let fastest = limits.feed_mm_per_s.max(limits.rapid_mm_per_s);
            let told = |what: &str, value: f64, limit: f64| {
                Err(format!(
                    "sample {n} axis {axis} {what} {value}, limit {limit}"
                ))
            };
            if *at < limits.min_mm - rounding || *at > limits.max_mm + rounding {
                return told(
                    "position",
                    *at,
                    if *at < 0.0 {
                        limits.min_mm
                    } else {
                        limits.max_mm
                    },
                );
            }
            if velocity.abs() > fastest * (1.0 + GUARD) + rounding {
                return told("velocity", velocity, fastest);
            }
            let most = limits.acceleration_mm_per_s2 * (1.0 + GUARD) + 2.0 * rounding / period_s;
            if acceleration.abs() > most {
                return told("acceleration", acceleration, limits.acceleration_mm_per_s2);
            }
            if jerk.abs()
                > limits.jerk_mm_per_s3 * (1.0 + GUARD_JERK)
                    + 4.0 * rounding / (period_s * period_s)
            {
                return told("jerk", jerk, limits.jerk_mm_per_s3);
            }
            before = [*at, velocity, acceleration];
        }
    }
    Ok(())
}

/// In the lanes of the planner: a rotary axis counts by degree.
fn lanes(context: &PlannerContext, at: &AxisVector) -> [f64; 4] {
    let scale = |i: usize| {
        if context.axes.is_rotary(i) {
            180.0 / std::f64::consts::PI
        } else {
            1.0
        }
    };
    std::array::from_fn(|i| {
        if i < context.limits.count as usize {
            scale(i) * at[i]
        } else {
            0.0
        }
    })
}

/// The largest distance of samples from the path, mm: looked for ahead of where the last one was, and a little behind.
fn deviation_mm(samples: &[AxisVector], blocks: &[Block], context: &PlannerContext) -> f64 {
    let points: Vec<[f64; 4]> = blocks
        .iter()
        .flat_map(path_of)
        .map(|point| lanes(context, &point))
        .collect();
    let (mut near, mut worst) = (0usize, 0.0f64);
    for sample in samples {
        let sample = lanes(context, sample);
        let mut best = (f64::INFINITY, near);
        let enough = context.path_tolerance_mm;
        let ahead = (0..points.len() - 1).map(|n| (near + n) % (points.len() - 1));
        let behind = (1..200).filter_map(|n| near.checked_sub(n));
        for (n, i) in behind.chain(ahead).enumerate() {
            let off = distance(&sample, &points[i], &points[i + 1]);
            if off < best.0 {
                best = (off, i);
            }
            if n > 400 && best.0 <= enough {
                break;
            }
        }
        near = best.1;
        worst = worst.max(best.0);
    }
    worst
}

fn distance(p: &[f64; 4], a: &[f64; 4], b: &[f64; 4]) -> f64 {
    let of = |f: &dyn Fn(usize) -> f64| (0..4).map(f).sum::<f64>();
    let squared = of(&|i| (b[i] - a[i]).powi(2));
    let along = of(&|i| (b[i] - a[i]) * (p[i] - a[i]));
    let share = if squared > 0.0 {
        (along / squared).clamp(0.0, 1.0)
    } else {
        0.0
    };
    of(&|i| (p[i] - a[i] - share * (b[i] - a[i])).powi(2)).sqrt()
}

/// How long the deceleration of a stop takes to be built up, as segments declare it for the depth of the queue: with half of
/// the jerk, the time of the slowest axis twice. More would let the machine wait for more than can be queued.
fn longest_ramp_s(segments: &[Segment]) -> f64 {
    let moving = segments
        .iter()
        .filter(|segment| segment.duration_s > 0.0 && segment.max_sigma_rate_per_s.is_finite());
    moving
        .map(|s| s.max_sigma_rate_per_s / s.max_sigma_acceleration_per_s2)
        .fold(0.0, f64::max)
}

fn attempt(seed: u64) -> Result<(Effort, f64, usize, usize), String> {
    let mut random = Random::new(seed);
    let mut context = machine(&mut random);
    let blocks = program(&mut random, &context);
    if random.below(2) == 0 {
        hem_in(&mut context, &blocks);
    }
    let options = Options {
        grid_ms: random.pick(&[6.0, 6.0, 3.0, 12.0]),
        rounds: random.pick(&[2, 2, 1, 3]),
        ..Options::default()
    };
    let mut planner = SmoothPlanner::new(&options, &context).map_err(|e| e.to_string())?;
    if let Some(refused) = blocks
        .iter()
        .find_map(|block| planner.check(block, None).err())
    {
        return Err(format!("refused: {refused}"));
    }
    let mut collected = Collected::default();
    planner.reset(&context.position);
    stream(
        &mut planner,
        &blocks,
        context.rough_period_s,
        &mut collected,
    );
    let effort = planner.effort();
    // What is collected does not count.
    let bytes = if seed.is_multiple_of(4) {
        peak_bytes_of(|| {
            let mut planner = SmoothPlanner::new(&options, &context).unwrap();
            stream(
                &mut planner,
                &blocks,
                context.rough_period_s,
                &mut tandem_rig::Away::default(),
            );
        })
    } else {
        0
    };
    let told = |what: String| {
        let limits = context.limits.axes();
        format!(
            "{what}; {} blocks, tolerance {} mm, period {} s, limits {limits:?}, {options:?}, feed {} mm/s",
            blocks.len(),
            context.path_tolerance_mm,
            context.fine_period_s,
            blocks[0].feed_mm_per_s
        )
    };
    let ramp_s = longest_ramp_s(&collected.segments);
    let slowest = context
        .limits
        .axes()
        .iter()
        .map(|axis| axis.acceleration_mm_per_s2 / axis.jerk_mm_per_s3);
    if ramp_s > 2.0 * slowest.fold(0.0, f64::max) * (1.0 + 1e-9) {
        return Err(told(format!(
            "a stop is said to take {ramp_s} s to build up"
        )));
    }
    for phase in 0..PHASES {
        let phase = phase as f64 / PHASES as f64;
        let samples = samples(&collected.segments, context.fine_period_s, phase);
        judge(&samples, &context).map_err(|e| told(format!("phase {phase:.2}: {e}")))?;
        let off_mm = deviation_mm(&samples, &blocks, &context);
        if off_mm > context.path_tolerance_mm {
            return Err(told(format!("phase {phase:.2}: {off_mm} mm off the path")));
        }
    }
    let (end, last) = (collected.end(), blocks[blocks.len() - 1].end);
    if !(0..4).all(|i| (end[i] - last[i]).abs() < 1e-9) {
        return Err(told(format!("ends at {end:?}, not {last:?}")));
    }
    if bytes > MAX_BYTES {
        return Err(told(format!("{bytes} bytes")));
    }
    Ok((effort, collected.duration_s(), blocks.len(), bytes))
}

#[test]
fn random_machines_keep_all_limits_at_every_phase() {
    let number = |name: &str, default| {
        std::env::var(name)
            .ok()
            .and_then(|text| text.parse().ok())
            .unwrap_or(default)
    };
    let (first, count) = (
        number("SMOOTH_SEED", 0),
        number("SMOOTH_MACHINES", MACHINES),
    );
    let (mut failed, mut totals, mut total_s) = (Vec::new(), Effort::default(), 0.0);
    for seed in first..first + count {
        let began = std::time::Instant::now();
        match attempt(seed) {
            Ok((effort, duration_s, blocks, bytes)) => {
                totals.windows += effort.windows;
                totals.rejected += effort.rejected;
                totals.stops += effort.stops;
                totals.intervals += effort.intervals;
                total_s += duration_s;
                if std::env::var("SMOOTH_PRINT").is_ok() {
                    let took_s = began.elapsed().as_secs_f64();
                    println!(
                        "seed {seed}: {blocks} blocks, {duration_s:.2} s in {took_s:.2} s, {bytes} bytes, {effort:?}"
                    );
                }
            }
            Err(why) => failed.push(format!("SMOOTH_SEED={seed} SMOOTH_MACHINES=1: {why}")),
        }
    }
    println!(
        "seeds {first} to {}: {total_s:.1} s, {totals:?}",
        first + count - 1
    );
    assert!(
        failed.is_empty(),
        "{} of {count}:\n{}",
        failed.len(),
        failed.join("\n")
    );
}
