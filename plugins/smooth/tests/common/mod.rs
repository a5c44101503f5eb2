//! Programs as blocks, a planner run as the rough loop runs it, and its samples judged by brute force.
#![allow(dead_code, reason = "each user takes its own part")]

pub use tandem_rig::Collected;
use tandem_sdk::{AxisLimits, AxisVector, Block, PlannerContext, Segment};
use tandem_smooth::{Effort, Options, SmoothPlanner};

pub mod programs;

pub type Point = [f64; 3];

/// Three linear axes: 250 mm/s, 1000 mm/s², 20 000 mm/s³.
pub fn context(position: &Point, tolerance_mm: f64) -> PlannerContext {
    let axis = AxisLimits {
        jerk_mm_per_s3: 20000.0,
        ..tandem_rig::axis(1000.0)
    };
    let context = tandem_rig::context(&[axis; 3], 0.001);
    PlannerContext {
        path_tolerance_mm: tolerance_mm,
        position: AxisVector::from_slice(position),
        ..context
    }
}

/// Lines through `points`.
pub fn lines(points: &[Point], feed_mm_per_s: f64) -> Vec<Block> {
    let vectors: Vec<AxisVector> = points
        .iter()
        .map(|point| AxisVector::from_slice(point))
        .collect();
    let pairs = vectors.windows(2).filter(|pair| pair[0] != pair[1]);
    tandem_rig::numbered(
        pairs
            .map(|pair| tandem_rig::line(&pair[0], &pair[1], feed_mm_per_s))
            .collect(),
    )
}

/// A part program of G1 lines with all axes, or a case with `points` and `limits`: points and feed, mm/s.
pub fn read(path: &str) -> (Vec<Point>, f64) {
    let text = std::fs::read_to_string(path).unwrap();
    if text.starts_with('{') {
        let case: serde_json::Value = serde_json::from_str(&text).unwrap();
        let numbers = |v: &serde_json::Value| -> Point {
            std::array::from_fn(|i| v[i].as_f64().unwrap_or(0.0))
        };
        let points = case["points"]
            .as_array()
            .map_or(vec![], |all| all.iter().map(numbers).collect());
        return (points, case["limits"]["feed"].as_f64().unwrap());
    }
    let (mut points, mut feed) = (vec![[0.0; 3]], 50.0);
    for line in text.lines() {
        if let Some(f) = line.strip_prefix('F') {
            feed = f.trim().parse::<f64>().unwrap() / 60.0;
        }
        if line.starts_with("G1X") {
            let number = |from: char, to: Option<char>| -> f64 {
                let rest = line.split(from).nth(1).unwrap();
                to.map_or(rest, |to| rest.split(to).next().unwrap())
                    .trim()
                    .parse()
                    .unwrap()
            };
            points.push([
                number('X', Some('Y')),
                number('Y', Some('Z')),
                number('Z', None),
            ]);
        }
    }
    (points, feed)
}

/// Drives `blocks` from the first one's start.
pub fn run(blocks: &[Block], options: &Options, context: &PlannerContext) -> (Collected, Effort) {
    let mut planner = SmoothPlanner::new(options, context).unwrap();
    let collected = tandem_rig::drive(&mut planner, blocks, 0.008);
    (collected, planner.effort())
}

/// The samples of a fine period of 1 ms: a rest ends its period.
pub fn samples(segments: &[Segment]) -> Vec<Point> {
    let mut samples = Vec::new();
    let (mut start_s, mut next_s) = (0.0, 0.0);
    for segment in segments {
        let end_s = start_s + segment.duration_s;
        while next_s < end_s - 1e-12 {
            let at = segment.position(next_s - start_s);
            samples.push([at[0], at[1], at[2]]);
            next_s += 1e-3;
        }
        start_s = end_s;
        if segment.duration_s == 0.0 {
            let at = segment.position(0.0);
            samples.push([at[0], at[1], at[2]]);
            (start_s, next_s) = (0.0, 1e-3);
        }
    }
    samples
}

/// What samples reach.
#[derive(Clone, Copy, Debug)]
pub struct Peaks {
    pub time_s: f64,
    pub speed: f64,
    pub axis_speed: f64,
    pub acceleration: f64,
    pub jerk: f64,
    /// Of the samples from the path, and of its vertices from the samples.
    pub deviation_mm: [f64; 2],
}

/// Judges samples; distances by brute force over every chord.
pub fn judge(samples: &[Point], points: &[Point]) -> Peaks {
    let mut padded = vec![samples[0]; 4];
    padded.extend(samples);
    padded.extend([samples[samples.len() - 1]; 4]);
    let differences = |values: &[Point]| -> Vec<Point> {
        values
            .windows(2)
            .map(|p| std::array::from_fn(|i| (p[1][i] - p[0][i]) * 1e3))
            .collect()
    };
    let most = |values: &[Point]| values.iter().flatten().fold(0.0f64, |m, v| m.max(v.abs()));
    let velocity = differences(&padded);
    let acceleration = differences(&velocity);
    let jerk = differences(&acceleration);
    let size = |v: &Point| v.iter().map(|x| x * x).sum::<f64>().sqrt();
    Peaks {
        time_s: (samples.len() - 1) as f64 * 1e-3,
        speed: velocity.iter().map(size).fold(0.0, f64::max),
        axis_speed: most(&velocity),
        acceleration: most(&acceleration),
        jerk: most(&jerk),
        deviation_mm: [deviation(samples, points), deviation(points, samples)],
    }
}

fn distance(p: &Point, a: &Point, b: &Point) -> f64 {
    let d: Point = std::array::from_fn(|i| b[i] - a[i]);
    let w: Point = std::array::from_fn(|i| p[i] - a[i]);
    let squared: f64 = d.iter().map(|v| v * v).sum();
    let along: f64 = d.iter().zip(&w).map(|(d, w)| d * w).sum();
    let share = if squared > 0.0 {
        (along / squared).clamp(0.0, 1.0)
    } else {
        0.0
    };
    (0..3)
        .map(|i| (w[i] - share * d[i]).powi(2))
        .sum::<f64>()
        .sqrt()
}

/// Chords whose box is looked at before they are.
const BOXED: usize = 32;

/// The largest distance of `points` from the chain: over every chord, but for those whose box is farther than the best.
fn deviation(points: &[Point], chain: &[Point]) -> f64 {
    let boxes: Vec<[Point; 2]> = (0..chain.len() - 1)
        .step_by(BOXED)
        .map(|from| {
            let part = &chain[from..(from + BOXED + 1).min(chain.len())];
            let bound = |of: fn(f64, f64) -> f64| -> Point {
                std::array::from_fn(|i| part.iter().map(|p| p[i]).reduce(of).unwrap())
            };
            [bound(f64::min), bound(f64::max)]
        })
        .collect();
    let (mut near, mut worst) = (0, 0.0f64);
    for point in points {
        let mut best = f64::INFINITY;
        // The box of the last point first: the others are then mostly out of reach.
        for n in std::iter::once(near).chain(0..boxes.len()) {
            let [low, high] = &boxes[n];
            let way = |i: usize| (low[i] - point[i]).max(point[i] - high[i]).max(0.0);
            if way(0).hypot(way(1)).hypot(way(2)) > best {
                continue;
            }
            for i in n * BOXED..((n + 1) * BOXED).min(chain.len() - 1) {
                let off = distance(point, &chain[i], &chain[i + 1]);
                if off < best {
                    (best, near) = (off, n);
                }
            }
        }
        worst = worst.max(best);
    }
    worst
}
