//! Correct runs, made from closed formulas.
#![allow(dead_code, reason = "every test file uses a part of it")]

use tandem_oracle::{Kind, Machine, Options, Position, Trace, Verdict, judge};

pub const PERIOD_S: f64 = 0.001;

pub const MACHINE: &str = r#"
format = 1
[loops]
rough_period_ms = 8
fine_period_ms = 1
[motion]
allowable_speed_difference_mm_per_min = 100
path_tolerance_mm = 0.01
[axes.x]
travel_mm = [-250, 250]
max_feed_mm_per_min = 15000
max_rapid_mm_per_min = 12000
max_acceleration_mm_per_s2 = 1000
max_jerk_mm_per_s3 = 20000
[axes.y]
travel_mm = [-250, 250]
max_feed_mm_per_min = 15000
max_rapid_mm_per_min = 12000
max_acceleration_mm_per_s2 = 1000
max_jerk_mm_per_s3 = 20000
[axes.z]
travel_mm = [-100, 100]
max_feed_mm_per_min = 15000
max_rapid_mm_per_min = 12000
max_acceleration_mm_per_s2 = 1000
max_jerk_mm_per_s3 = 20000
[axes.a]
kind = "rotary"
travel_deg = [-360, 360]
max_feed_deg_per_min = 7200
max_rapid_deg_per_min = 7200
max_acceleration_deg_per_s2 = 2000
[planner]
plugin = "look-ahead"
"#;

pub fn machine() -> Machine {
    Machine::from_toml(MACHINE, "machine.toml").expect("the machine reads")
}

/// A machine whose planner may not step speeds.
pub fn smooth_machine() -> Machine {
    Machine {
        planner: "smooth".into(),
        ..machine()
    }
}

pub fn at(x: f64, y: f64, z: f64) -> Position {
    [x, y, z, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]
}

/// One stretch of constant acceleration after another: speed at both ends and length.
#[derive(Clone, Default)]
pub struct Profile {
    stretches: Vec<[f64; 3]>,
}

impl Profile {
    /// Speeds up, cruises and brakes over a length, between two given speeds.
    pub fn then(mut self, from: f64, peak: f64, to: f64, length: f64, acceleration: f64) -> Self {
        let reachable = ((2.0 * acceleration * length + from * from + to * to) / 2.0).sqrt();
        let peak = peak.min(reachable);
        let up = (peak * peak - from * from) / (2.0 * acceleration);
        let down = (peak * peak - to * to) / (2.0 * acceleration);
        self.stretches.extend([
            [from, peak, up],
            [peak, peak, length - up - down],
            [peak, to, down],
        ]);
        self
    }

    pub fn rest_to_rest(peak: f64, length: f64, acceleration: f64) -> Self {
        Self::default().then(0.0, peak, 0.0, length, acceleration)
    }

    pub fn length(&self) -> f64 {
        self.stretches.iter().map(|stretch| stretch[2]).sum()
    }

    /// Length travelled at a time, and whether motion is over.
    pub fn at(&self, t_s: f64) -> (f64, bool) {
        let (mut before, mut left) = (0.0, t_s);
        for &[from, to, length] in &self.stretches {
            let duration = if length > 1e-12 {
                2.0 * length / (from + to)
            } else {
                0.0
            };
            if left < duration {
                return (
                    before + from * left + (to - from) / duration * left * left / 2.0,
                    false,
                );
            }
            left -= duration;
            before += length;
        }
        (self.length(), true)
    }

    /// Samples of a path given by length; the last one is the end itself, and is held for a while.
    pub fn samples(&self, path: impl Fn(f64) -> Position) -> Vec<Position> {
        let mut samples = vec![path(0.0); 3];
        for tick in 1.. {
            let (length, over) = self.at(f64::from(tick) * PERIOD_S);
            samples.push(path(length));
            if over {
                break;
            }
        }
        samples.extend([path(self.length()); 3]);
        samples
    }
}

/// The polyline through points, by length.
pub fn polyline(points: Vec<Position>) -> impl Fn(f64) -> Position {
    move |length| {
        let mut left = length;
        for pair in points.windows(2) {
            let piece = gap(&pair[0], &pair[1]);
            if left < piece {
                return std::array::from_fn(|axis| {
                    pair[0][axis] + left / piece * (pair[1][axis] - pair[0][axis])
                });
            }
            left -= piece;
        }
        points[points.len() - 1]
    }
}

pub fn gap(a: &Position, b: &Position) -> f64 {
    a.iter()
        .zip(b)
        .map(|(a, b)| (a - b).powi(2))
        .sum::<f64>()
        .sqrt()
}

/// A run that stops at every vertex.
pub fn stop_at_all(points: &[Position], feed: f64, acceleration: f64) -> Vec<Position> {
    let mut samples = Vec::new();
    for pair in points.windows(2) {
        let profile = Profile::rest_to_rest(feed, gap(&pair[0], &pair[1]), acceleration);
        samples.extend(profile.samples(polyline(pair.to_vec())));
    }
    samples
}

pub fn trace(samples: &[Position]) -> Trace {
    Trace::from_samples(&[0, 1, 2, 3], PERIOD_S, samples)
}

pub fn verdict(samples: &[Position], program: &str) -> Verdict {
    judge(
        &trace(samples),
        program,
        &smooth_machine(),
        &Options::default(),
    )
}

#[track_caller]
pub fn assert_passes(verdict: &Verdict) {
    assert!(verdict.passed(), "{verdict}");
}

#[track_caller]
pub fn assert_finds(verdict: &Verdict, kinds: &[Kind]) {
    assert_eq!(verdict.kinds(), kinds, "{verdict}");
}
