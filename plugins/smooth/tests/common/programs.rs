//! Random programs: the same for the same seed everywhere.

use tandem_rig::Random;
use tandem_sdk::{ArcGeometry, AxisVector, Block, BlockKind};

use super::{Point, lines};

/// Kinds of programs.
pub const KINDS: [&str; 8] = [
    "corners 2-D",
    "corners 3-D",
    "wandering",
    "micro blocks",
    "noisy",
    "arcs and lines",
    "zigzag",
    "all lengths",
];

/// Blocks of a program, and points along its path near enough to stand for it.
pub fn program(seed: u64) -> (&'static str, Vec<Block>, Vec<Point>) {
    let kind = (seed % KINDS.len() as u64) as usize;
    let mut random = Random::new(seed.wrapping_add(1));
    let feed = random.between(15.0, 200.0);
    let points = match kind {
        0 => walk(&mut random, 25, (0.3, 8.0), 3.2, false),
        1 => walk(&mut random, 25, (0.2, 5.0), 3.2, true),
        2 => walk(&mut random, 250, (0.04, 0.25), 0.5, true),
        3 => curve(&mut random, 1200, (0.002, 0.012), 0.0),
        4 => curve(&mut random, 150, (0.05, 0.4), 0.004),
        5 => return arcs(&mut random, feed),
        6 => zigzag(&mut random),
        _ => walk(&mut random, 60, (1e-3, 20.0), 2.5, true),
    };
    (KINDS[kind], lines(&points, feed), points)
}

/// Steps that turn by at most `turn_rad` each.
fn walk(
    random: &mut Random,
    steps: usize,
    (low, high): (f64, f64),
    turn_rad: f64,
    space: bool,
) -> Vec<Point> {
    let (mut at, mut heading, mut slope) = ([0.0; 3], 0.0f64, 0.0f64);
    let mut points = vec![at];
    for _ in 0..steps {
        heading += random.between(-turn_rad, turn_rad);
        slope = if space {
            (slope + random.between(-turn_rad, turn_rad)).clamp(-1.5, 1.5)
        } else {
            0.0
        };
        let length = random.length(low, high);
        at[0] += length * heading.cos() * slope.cos();
        at[1] += length * heading.sin() * slope.cos();
        at[2] += length * slope.sin();
        points.push(at);
    }
    points
}

/// A smooth curve in steps, with noise.
fn curve(random: &mut Random, steps: usize, (low, high): (f64, f64), noise: f64) -> Vec<Point> {
    let (length, radius) = (random.length(low, high), random.length(0.5, 20.0));
    let waves = [random.between(0.3, 2.0), random.between(0.3, 2.0)];
    let at = |s: f64| {
        let angle = s / radius;
        [
            radius * angle.sin(),
            radius * (1.0 - (waves[0] * angle).cos()),
            0.4 * radius * (waves[1] * angle).sin(),
        ]
    };
    (0..=steps)
        .map(|n| at(n as f64 * length).map(|v| v + random.between(-noise, noise)))
        .collect()
}

fn zigzag(random: &mut Random) -> Vec<Point> {
    let (length, angle) = (random.length(0.1, 3.0), random.between(0.2, 1.5));
    let step = |n: i32| {
        [
            f64::from(n) * length * angle.cos(),
            f64::from(n % 2) * length * angle.sin(),
            0.0,
        ]
    };
    (0..40).map(step).collect()
}

/// Lines and arcs that join at any angle, in the plane, some of them helices.
fn arcs(random: &mut Random, feed: f64) -> (&'static str, Vec<Block>, Vec<Point>) {
    let (mut at, mut heading) = ([0.0f64; 3], 0.0f64);
    let (mut blocks, mut points) = (Vec::new(), vec![at]);
    for index in 0..24u64 {
        if random.below(3) == 0 {
            heading += random.between(-1.5, 1.5);
        }
        let from = at;
        let mut block = Block::at(AxisVector::from_slice(&from));
        if random.below(2) == 0 {
            let length = random.length(0.2, 10.0);
            at = [
                at[0] + length * heading.cos(),
                at[1] + length * heading.sin(),
                at[2],
            ];
            (block.kind, block.length_mm) = (BlockKind::Line, length);
            points.push(at);
        } else {
            let (radius, sweep) = (random.length(0.05, 8.0), random.between(-4.0, 4.0));
            let rise = if random.below(3) == 0 {
                random.between(-1.0, 1.0)
            } else {
                0.0
            };
            let side = sweep.signum();
            let center = [
                at[0] - side * radius * heading.sin(),
                at[1] + side * radius * heading.cos(),
            ];
            let start = heading - side * std::f64::consts::FRAC_PI_2;
            let on = |share: f64| {
                let angle = start + share * sweep;
                [
                    center[0] + radius * angle.cos(),
                    center[1] + radius * angle.sin(),
                    from[2] + share * rise,
                ]
            };
            let count = (sweep.abs() * (radius / 8e-6).sqrt()).ceil() as usize;
            points.extend((1..=count).map(|n| on(n as f64 / count as f64)));
            at = on(1.0);
            heading += sweep;
            block.kind = BlockKind::Arc;
            block.length_mm = (radius * sweep).hypot(rise);
            block.arc = ArcGeometry {
                plane: [0, 1],
                center_mm: center,
                radius_mm: radius,
                start_angle_rad: start,
                sweep_rad: sweep,
            };
        }
        block.end = AxisVector::from_slice(&at);
        (block.index, block.line, block.feed_mm_per_s) = (index, index as u32 + 1, feed);
        blocks.push(block);
    }
    (KINDS[5], blocks, points)
}
