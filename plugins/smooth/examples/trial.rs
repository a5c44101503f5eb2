//! Plans programs of straight lines without the loops and prints what came out: time, peaks of 1 kHz differences, distances
//! by brute force over every chord, and the planning time.
//!
//! `cargo run --release -p tandem-smooth --example trial -- [options as TOML] FILE…`, files being part programs of G1 lines or
//! cases as JSON with `points`, `limits`.

use tandem_sdk::{
    Accepted, Axes, AxisLimits, AxisVector, Block, BlockKind, BlockReport, Limits, Planner, PlannerContext, Segment,
    SegmentSink, size_of_contract,
};
use tandem_smooth::{Options, SmoothPlanner};

#[derive(Default)]
struct Collected(Vec<Segment>);

impl SegmentSink for Collected {
    fn segment(&mut self, segment: &Segment) {
        self.0.push(*segment);
    }
    fn block(&mut self, _: &BlockReport) {}
}

fn context(tolerance_mm: f64) -> PlannerContext {
    let axis = AxisLimits {
        min_mm: -1e4,
        max_mm: 1e4,
        feed_mm_per_s: 250.0,
        rapid_mm_per_s: 250.0,
        acceleration_mm_per_s2: 1000.0,
        jerk_mm_per_s3: 20000.0,
        speed_difference_mm_per_s: 0.0,
    };
    PlannerContext {
        size: size_of_contract::<PlannerContext>(),
        axes: Axes::new(&[('X', false), ('Y', false), ('Z', false)]).unwrap(),
        limits: Limits::new(&[axis; 3]).unwrap(),
        fine_period_s: 0.001,
        rough_period_s: 0.008,
        path_tolerance_mm: tolerance_mm,
        time_constant_s: 0.05,
        max_feed_ratio: 1.0,
        position: AxisVector::ZERO,
    }
}

type Point = [f64; 3];

fn read(path: &str) -> (Vec<Point>, f64) {
    let text = std::fs::read_to_string(path).unwrap();
    if path.ends_with(".json") {
        let case: serde_json::Value = serde_json::from_str(&text).unwrap();
        let numbers = |v: &serde_json::Value| -> Point { std::array::from_fn(|i| v[i].as_f64().unwrap_or(0.0)) };
        let points = case["points"].as_array().map_or(vec![], |all| all.iter().map(numbers).collect());
        return (points, case["limits"]["feed"].as_f64().unwrap());
    }
    let (mut points, mut feed) = (vec![[0.0; 3]], 50.0);
    for line in text.lines() {
        if let Some(f) = line.strip_prefix('F') {
            feed = f.trim().parse::<f64>().unwrap() / 60.0;
        }
        if !line.starts_with("G1X") {
            continue;
        }
        let mut point = *points.last().unwrap();
        for (axis, letter) in ['X', 'Y', 'Z'].into_iter().enumerate() {
            if let Some(at) = line.find(letter) {
                let rest = &line[at + 1..];
                let end = rest.find(|c: char| c.is_ascii_alphabetic()).unwrap_or(rest.len());
                point[axis] = rest[..end].trim().parse().unwrap();
            }
        }
        points.push(point);
    }
    (points, feed)
}

fn blocks(points: &[Point], feed: f64) -> Vec<Block> {
    let pairs = points.windows(2).filter(|pair| pair[0] != pair[1]).enumerate();
    pairs
        .map(|(index, pair)| {
            let mut block = Block::at(AxisVector::from_slice(&pair[0]));
            block.end = AxisVector::from_slice(&pair[1]);
            (block.kind, block.index, block.line) = (BlockKind::Line, index as u64, index as u32 + 1);
            block.length_mm = (0..3).map(|i| (pair[1][i] - pair[0][i]).powi(2)).sum::<f64>().sqrt();
            block.feed_mm_per_s = feed;
            block
        })
        .collect()
}

fn distance(p: &Point, a: &Point, b: &Point) -> f64 {
    let d: Point = std::array::from_fn(|i| b[i] - a[i]);
    let w: Point = std::array::from_fn(|i| p[i] - a[i]);
    let squared: f64 = d.iter().map(|v| v * v).sum();
    let along: f64 = d.iter().zip(&w).map(|(d, w)| d * w).sum();
    let share = if squared > 0.0 { (along / squared).clamp(0.0, 1.0) } else { 0.0 };
    (0..3).map(|i| (w[i] - share * d[i]).powi(2)).sum::<f64>().sqrt()
}

/// The largest distance of `points` from the chain, by brute force where that is affordable.
fn deviation(points: &[Point], chain: &[Point], brute: bool) -> f64 {
    let mut near = 0usize;
    let mut worst = 0.0f64;
    for point in points {
        let (mut best, mut found) = (f64::INFINITY, near);
        let (from, to) = if brute { (0, chain.len() - 1) } else { (near.saturating_sub(60), (near + 120).min(chain.len() - 1)) };
        for i in from..to {
            let off = distance(point, &chain[i], &chain[i + 1]);
            if off < best {
                (best, found) = (off, i);
            }
        }
        near = found;
        worst = worst.max(best);
    }
    worst
}

fn main() {
    let mut options = Options::default();
    let mut repeats = 3;
    let mut tolerance_mm = 0.01;
    for argument in std::env::args().skip(1) {
        if let Some(n) = argument.strip_prefix("repeats=") {
            repeats = n.parse().unwrap();
            continue;
        }
        if let Some(n) = argument.strip_prefix("tolerance=") {
            tolerance_mm = n.parse().unwrap();
            continue;
        }
        if argument.contains('=') {
            options = Options::parse(&argument.replace(',', "\n")).unwrap();
            continue;
        }
        trial(&argument, &options, repeats, tolerance_mm);
    }
}

/// Processor time of this thread, ns: what else the computer does is not counted.
fn cpu_ns() -> f64 {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").unwrap();
    text.split(' ').next().unwrap().parse().unwrap()
}

fn trial(path: &str, options: &Options, repeats: usize, tolerance_mm: f64) {
    let (points, feed) = read(path);
    if points.len() < 2 {
        println!("{path}: no points");
        return;
    }
    let blocks = blocks(&points, feed);
    let (mut best_ns, mut worst_ms) = (f64::INFINITY, f64::INFINITY);
    let mut kept = (Collected::default(), None);
    for _ in 0..repeats {
        let mut context = context(tolerance_mm);
        context.position = blocks[0].start;
        let mut planner = SmoothPlanner::new(options, &context).unwrap();
        let (mut collected, mut next) = (Collected::default(), 0);
        let started = cpu_ns();
        let mut worst = 0.0f64;
        loop {
            while next < blocks.len() && planner.accept(&blocks[next]).unwrap() == Accepted::Accepted {
                next += 1;
            }
            if next == blocks.len() {
                planner.finish();
            }
            let begun = std::time::Instant::now();
            let done = planner.advance(0.008, &mut collected).unwrap().done != 0;
            worst = worst.max(begun.elapsed().as_secs_f64() * 1e3);
            if done {
                break;
            }
        }
        best_ns = best_ns.min(cpu_ns() - started);
        worst_ms = worst_ms.min(worst);
        kept = (collected, Some(planner.effort()));
    }
    let (collected, effort) = (kept.0, kept.1.unwrap());
    report(path, &collected, &points, feed, best_ns / blocks.len() as f64, worst_ms, &effort);
}

fn report(
    path: &str,
    collected: &Collected,
    points: &[Point],
    feed: f64,
    ns: f64,
    worst_ms: f64,
    effort: &tandem_smooth::Effort,
) {
    let mut samples: Vec<Point> = vec![points[0]; 4];
    let mut start_s = 0.0;
    let mut n = 1;
    for segment in &collected.0 {
        while n as f64 * 1e-3 <= start_s + segment.duration_s + 1e-12 && segment.duration_s > 0.0 {
            let at = segment.position(n as f64 * 1e-3 - start_s);
            samples.push([at[0], at[1], at[2]]);
            n += 1;
        }
        start_s += segment.duration_s;
        if segment.duration_s == 0.0 {
            let at = segment.position(0.0);
            samples.push([at[0], at[1], at[2]]);
            start_s = (start_s * 1000.0 - 1e-9).ceil() / 1000.0;
            n = (start_s * 1000.0).round() as usize + 1;
        }
    }
    let time_s = start_s;
    let last = *samples.last().unwrap();
    samples.extend([last; 4]);
    let diff = |values: &Vec<Point>| -> Vec<Point> {
        values.windows(2).map(|p| std::array::from_fn(|i| (p[1][i] - p[0][i]) * 1e3)).collect()
    };
    let most = |values: &Vec<Point>| values.iter().flatten().fold(0.0f64, |m, v| m.max(v.abs()));
    let v = diff(&samples);
    let a = diff(&v);
    let j = diff(&a);
    let speed = v.iter().map(|v| v.iter().map(|x| x * x).sum::<f64>().sqrt()).fold(0.0, f64::max);
    let brute = points.len() < 4000;
    let off = deviation(&samples, points, brute);
    let missed = deviation(points, &samples, brute);
    let end = distance(&last, points.last().unwrap(), points.last().unwrap());
    let name = path.rsplit('/').next().unwrap();
    println!(
        "{name:24} T {time_s:8.3} a {:7.2} j {:8.1} v/F {:.5} dev {off:.5} miss {missed:.5} end {end:.1e} | {:6.0} kblk/s worst {worst_ms:.2} ms | win {} rej {} rep {} stops {} rounds {:.2} it {:.1}+{:.1} seg {}",
        most(&a),
        most(&j),
        speed / feed,
        1e6 / ns,
        effort.windows,
        effort.rejected,
        effort.repairs,
        effort.stops,
        effort.rounds as f64 / effort.windows as f64,
        effort.smooth_iterations as f64 / effort.rounds as f64,
        effort.pace_iterations as f64 / effort.rounds as f64,
        collected.0.len(),
    );
}
