//! A run to look at: a square of four lines, a conical spiral, a retract at rapid, with a hold in between.

use tandem_report::{Axis, Report, Samples, Signal, Unit};

const PERIOD_S: f64 = 0.001;
const MAX_ACCELERATION: f64 = 1000.0;
const SPEED_STEP: f64 = 100.0 / 60.0;
const TAU_SERVO_S: f64 = 0.004;

type Point = [f64; 3];

/// The report of the demonstration; `turns` of the spiral set its length, `broken` puts errors into it.
pub fn report(turns: u32, broken: bool) -> Report {
    let mut samples = simulate(turns);
    if broken {
        break_it(&mut samples);
    }
    let load = samples
        .feed_mm_s
        .iter()
        .zip(&samples.line)
        .map(|(feed, line)| 20.0 + feed * 0.4 + f64::from(line % 3));
    Report {
        title: "Square and spiral".into(),
        program: "square <and> spiral.ngc".into(),
        machine: "three-axis mill".into(),
        planner: "look-ahead".into(),
        facts: facts(&samples),
        axes: ['X', 'Y', 'Z'].map(axis).into(),
        fine_period_s: PERIOD_S,
        signals: vec![Signal {
            name: "spindle load".into(),
            unit: "%".into(),
            values: load.collect(),
        }],
        samples,
        path_tolerance_mm: Some(0.01),
        ..Report::default()
    }
}

fn axis(letter: char) -> Axis {
    Axis {
        letter,
        unit: Unit::Mm,
        max_velocity: 250.0,
        max_acceleration: MAX_ACCELERATION,
        max_jerk: Some(20_000.0),
        speed_difference: SPEED_STEP,
    }
}

fn facts(samples: &Samples) -> Vec<(String, String)> {
    let end = samples
        .command
        .iter()
        .map(|axis| format!("{:.3}", axis.last().unwrap_or(&0.0)));
    [
        ("clock", "virtual".to_owned()),
        ("fine period", "1 ms".to_owned()),
        ("rough period", "8 ms".to_owned()),
        ("blocks", "6".to_owned()),
        ("end position", end.collect::<Vec<_>>().join(" / ") + " mm"),
        ("guard stops", "0".to_owned()),
    ]
    .map(|(name, value)| (name.to_owned(), value))
    .into()
}

/// A piece of the path: where it is after a length, how long it is, and at what feed in mm/s.
struct Piece {
    at: Box<dyn Fn(f64) -> Point>,
    length: f64,
    feed: f64,
}

fn line(from: Point, to: Point, feed: f64) -> Piece {
    let length = from
        .iter()
        .zip(to)
        .map(|(a, b)| (b - a).powi(2))
        .sum::<f64>()
        .sqrt();
    let at = move |s: f64| [0, 1, 2].map(|k| from[k] + (to[k] - from[k]) * s / length);
    Piece {
        at: Box::new(at),
        length,
        feed,
    }
}

/// A spiral that winds inwards and down, walked by angle with a nearly constant speed.
fn spiral(turns: u32, feed: f64) -> Piece {
    let angle = f64::from(turns) * std::f64::consts::TAU;
    let mean_radius = 22.0;
    let length = angle * mean_radius;
    let at = move |s: f64| {
        let part = s / length;
        // Equal lengths take more of the angle where the radius is small.
        let turned = 1.0 - (1.0 - part * (1.0 - (4.0_f64 / 40.0).powi(2))).sqrt();
        let radius = 40.0 * (1.0 - turned);
        let (sin, cos) = (turned * angle).sin_cos();
        [radius * cos, radius * sin, -20.0 * turned]
    };
    Piece {
        at: Box::new(at),
        length,
        feed,
    }
}

fn pieces(turns: u32) -> Vec<Piece> {
    let corners =
        [[-50.0, -50.0], [50.0, -50.0], [50.0, 50.0], [-50.0, 50.0]].map(|[x, y]| [x, y, 0.0]);
    let mut pieces: Vec<Piece> = (0..4)
        .map(|k| line(corners[k], corners[(k + 1) % 4], 100.0))
        .collect();
    pieces.push(line(corners[0], [40.0, 0.0, 0.0], 200.0));
    let spiral = spiral(turns, 40.0);
    let end = (spiral.at)(spiral.length);
    pieces.push(spiral);
    pieces.push(line(end, [end[0], end[1], 30.0], 250.0));
    pieces
}

fn simulate(turns: u32) -> Samples {
    let mut samples = Samples {
        command: vec![Vec::new(); 3],
        feedback: vec![Vec::new(); 3],
        ..Samples::default()
    };
    let mut actual = [-50.0, -50.0, 0.0];
    for (index, piece) in pieces(turns).iter().enumerate() {
        for (s, feed, sigma) in speeds(piece, index == 2) {
            let command = (piece.at)(s);
            for k in 0..3 {
                actual[k] += (command[k] - actual[k]) * PERIOD_S / TAU_SERVO_S;
                samples.command[k].push(command[k]);
                samples.feedback[k].push(actual[k]);
            }
            samples.t_s.push(samples.t_s.len() as f64 * PERIOD_S);
            samples.line.push(10 * (index as u32 + 1));
            samples.feed_mm_s.push(feed);
            samples.programmed_feed_mm_s.push(piece.feed);
            samples.sigma.push(sigma);
        }
    }
    samples.deviation_mm = Some(
        samples
            .feed_mm_s
            .iter()
            .map(|feed| feed * feed * 1.4e-7 + 2e-5 * feed.sin().abs())
            .collect(),
    );
    samples
}

/// Length, speed and σ at each tick: a trapezoid over program time, with a feed hold at its middle where asked for.
fn speeds(piece: &Piece, hold: bool) -> Vec<(f64, f64, f64)> {
    let acceleration = 0.6 * MAX_ACCELERATION;
    let top = f64::min(piece.feed, (piece.length * acceleration).sqrt());
    let duration = piece.length / top + top / acceleration;
    // Stretched to whole ticks, so that the last sample is the end itself.
    let stretch = duration / ((duration / PERIOD_S).ceil() * PERIOD_S);
    let (mut t, mut held, mut sigma, mut ticks) = (0.0, 0, 1.0_f64, Vec::new());
    while t < duration - 1e-9 {
        let holding = hold && t > duration / 2.0 && held < 500;
        held += i32::from(holding);
        let step = 0.8 * acceleration / top * PERIOD_S;
        sigma += ((if holding { 0.0 } else { 1.0 }) - sigma).clamp(-step, step);
        t = f64::min(t + sigma * PERIOD_S * stretch, duration);
        let (s, speed) = trapezoid(t, duration, top, acceleration, piece.length);
        ticks.push((s, speed * sigma, sigma));
    }
    ticks
}

fn trapezoid(t: f64, duration: f64, top: f64, acceleration: f64, length: f64) -> (f64, f64) {
    let ramp = top / acceleration;
    let from_rest = |t: f64| 0.5 * acceleration * t * t;
    match t {
        _ if t < ramp => (from_rest(t), acceleration * t),
        _ if t > duration - ramp => (
            length - from_rest(duration - t),
            acceleration * (duration - t),
        ),
        _ => (from_rest(ramp) + (t - ramp) * top, top),
    }
}

/// A jump of one sample, and a stretch off the path.
fn break_it(samples: &mut Samples) {
    let n = samples.t_s.len();
    samples.command[0][n / 2] += 0.004;
    let deviation = samples
        .deviation_mm
        .as_mut()
        .expect("the demonstration measures it");
    deviation[n / 3..n / 3 + 40].fill(0.0132);
}
