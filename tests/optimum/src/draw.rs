//! Fresh part programs: smooth curves, and paths as CAM writes them.

use std::f64::consts::{PI, TAU};
use std::fmt::Write;

use tandem_rig::Random;

type Point = [f64; 3];

/// What kind of path is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Paths {
    /// One NURBS curve of one of two degrees.
    Curve([u64; 2]),
    /// Lines.
    Cam,
}

/// A program from zero, which ends in the travel of ±250 mm; the same for the same seed everywhere.
pub fn program(paths: Paths, seed: u64) -> String {
    let mut random = Random::new(seed.wrapping_add(1));
    match paths {
        Paths::Curve(degrees) => {
            let degree = random.pick(&degrees);
            curve(&mut random, degree)
        }
        Paths::Cam => cam(&mut random, seed),
    }
}

fn head(feed_mm_per_min: f64) -> String {
    format!("G21 G90 G17 G64\nF{feed_mm_per_min:.0}\n")
}

/// Control points that wander, with weights; in half of the curves in the plane.
fn curve(random: &mut Random, degree: u64) -> String {
    let count = degree + 1 + random.below(14);
    let reach = random.length(3.0, 25.0);
    let (mut at, mut heading) = ([0.0f64; 3], random.between(0.0, TAU));
    let space = random.below(2) == 1;
    let mut text = head(random.between(3000.0, 15000.0));
    writeln!(text, "G5.2 P1 L{}", degree + 1).expect("a text takes what is written");
    for _ in 0..count {
        heading += random.between(-1.9, 1.9);
        let length = reach * random.between(0.3, 1.0);
        let slope = if space {
            random.between(-0.5, 0.5)
        } else {
            0.0
        };
        at[0] += length * heading.cos() * f64::cos(slope);
        at[1] += length * heading.sin() * f64::cos(slope);
        at[2] += length * f64::sin(slope);
        let weight = random.length(0.5, 3.0);
        writeln!(
            text,
            "X{:.4} Y{:.4} Z{:.4} P{weight:.3}",
            at[0], at[1], at[2]
        )
        .expect("a text takes what is written");
    }
    text.push_str("G5.3\nM2\n");
    text
}

/// Kinds of paths of lines.
pub const KINDS: [&str; 6] = [
    "chords", "relief", "pocket", "spiral", "corners", "trochoid",
];

/// The kind of the path of a seed.
pub fn kind(seed: u64) -> &'static str {
    KINDS[(seed % KINDS.len() as u64) as usize]
}

fn cam(random: &mut Random, seed: u64) -> String {
    let feed = random.between(1000.0, 9000.0);
    let points = match kind(seed) {
        "chords" => chords(random),
        "relief" => relief(random),
        "pocket" => pocket(random),
        "spiral" => spiral(random),
        "corners" => corners(random),
        _ => trochoid(random),
    };
    let mut text = head(feed);
    let mut last = [0.0; 3];
    for point in points.iter().skip(1) {
        let from_start: Point =
            std::array::from_fn(|n| ((point[n] - points[0][n]) * 1e4).round() / 1e4);
        if from_start != last {
            writeln!(
                text,
                "G1 X{:.4} Y{:.4} Z{:.4}",
                from_start[0], from_start[1], from_start[2]
            )
            .expect("a text takes what is written");
            last = from_start;
        }
    }
    text.push_str("M2\n");
    text
}

/// Places of a smooth curve, in chords that stand off by `error_mm`.
fn flattened(of: &dyn Fn(f64) -> Point, end: f64, error_mm: f64) -> Vec<Point> {
    let mut points = vec![of(0.0)];
    let mut t = 0.0;
    let mut step = end / 1000.0;
    while t < end {
        let sagitta = |step: f64| {
            let [a, b, c] = [t, t + step / 2.0, t + step].map(of);
            let off = |n: usize| b[n] - f64::midpoint(a[n], c[n]);
            (0..3).map(|n| off(n).powi(2)).sum::<f64>().sqrt()
        };
        step = (2.0 * step).min(end / 20.0);
        while sagitta(step) > error_mm {
            step *= 0.9;
        }
        t = (t + step).min(end);
        points.push(of(t));
    }
    points
}

fn chords(random: &mut Random) -> Vec<Point> {
    let size = random.length(3.0, 40.0);
    let waves: [f64; 6] = std::array::from_fn(|_| random.between(0.5, 3.0));
    let error_mm = random.length(5e-4, 1e-2);
    let of = |t: f64| {
        [
            size * ((waves[0] * t).sin() + 0.3 * (waves[1] * 2.0 * t).sin()),
            size * ((waves[2] * t).cos() + 0.3 * (waves[3] * 2.0 * t).sin()),
            0.1 * size * (waves[4] * t).sin(),
        ]
    };
    flattened(&of, random.between(2.0, 5.0), error_mm)
}

/// Rows over a wavy ground.
fn relief(random: &mut Random) -> Vec<Point> {
    let (width, rows) = (random.between(8.0, 25.0), 3 + random.below(4));
    let over = random.between(0.1, 0.5);
    let (height, wave) = (random.between(0.2, 2.0), random.between(2.0, 8.0));
    let pitch = random.length(0.05, 0.5);
    let mut points = vec![];
    for row in 0..rows {
        let y = row as f64 * over;
        let count = (width / pitch) as u64;
        for n in 0..=count {
            let along = if row % 2 == 0 { n } else { count - n };
            let x = along as f64 * pitch;
            points.push([x, y, height * (TAU * x / wave + y).sin()]);
        }
    }
    points
}

/// Rectangles inside of each other.
fn pocket(random: &mut Random) -> Vec<Point> {
    let (mut x, mut y) = (random.between(10.0, 30.0), random.between(10.0, 30.0));
    let over = random.between(0.5, 3.0);
    let (mut low_x, mut low_y) = (0.0, 0.0);
    let mut points = vec![[0.0; 3]];
    while x - low_x > over && y - low_y > over && points.len() < 30 {
        points.push([x, low_y, 0.0]);
        points.push([x, y, 0.0]);
        points.push([low_x, y, 0.0]);
        low_y += over;
        points.push([low_x, low_y, 0.0]);
        low_x += over;
        x -= over;
        y -= over;
    }
    points
}

fn spiral(random: &mut Random) -> Vec<Point> {
    let (pitch, turns) = (random.between(0.5, 3.0), random.between(2.0, 5.0));
    let inner = random.between(0.5, 5.0);
    let of = move |t: f64| {
        let radius = inner + pitch * t / TAU;
        [radius * t.cos(), radius * t.sin(), -0.02 * t]
    };
    flattened(&of, turns * TAU, random.length(5e-4, 1e-2))
}

fn corners(random: &mut Random) -> Vec<Point> {
    let (mut at, mut heading) = ([0.0f64; 3], 0.0f64);
    let mut points = vec![at];
    for _ in 0..25 {
        heading += random.between(-2.5, 2.5);
        let length = random.length(0.3, 8.0);
        at[0] += length * heading.cos();
        at[1] += length * heading.sin();
        points.push(at);
    }
    points
}

fn trochoid(random: &mut Random) -> Vec<Point> {
    let (radius, step) = (random.between(0.5, 4.0), random.between(0.2, 1.0));
    let of = move |t: f64| {
        [
            step * t / TAU + radius * (t - PI / 2.0).cos(),
            radius * t.sin(),
            0.0,
        ]
    };
    flattened(
        &of,
        random.between(3.0, 6.0) * TAU,
        random.length(1e-3, 1e-2),
    )
}
