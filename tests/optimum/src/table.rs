//! The rows of the table: what is asked, and what came out.

use std::path::Path;

use crate::draw::{Paths, kind, program};
use crate::trial::{Mill, best_along_curve, driven, planning_speed};

/// What a time is compared with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Beside {
    /// The shortest time along the curve itself; within the chord error where that is a limit too.
    Curve {
        /// The chord error is a limit too.
        chord: bool,
    },
    /// The shortest time that `smooth` finds with any of these settings.
    Settings,
}

/// A row.
#[derive(Clone, Debug)]
pub struct Row {
    /// Its name, by which it is asked for.
    pub name: &'static str,
    /// What is driven.
    pub paths: Paths,
    /// On what.
    pub mill: Mill,
    /// Beside what.
    pub beside: Beside,
    /// The ratio of times that is asked for.
    pub asked: f64,
}

fn mill(planner: &'static str, tolerance: f64, acceleration: f64, jerk: f64) -> Mill {
    Mill {
        acceleration,
        jerk,
        tolerance,
        period_ms: 1.0,
        planner,
        options: vec![],
    }
}

/// All rows.
pub fn rows() -> Vec<Row> {
    let paper = |name, degrees, asked| Row {
        name,
        paths: Paths::Curve(degrees),
        mill: Mill {
            period_ms: 2.0,
            ..mill("nurbs", 0.01, 5000.0, 4e5)
        },
        beside: Beside::Curve { chord: true },
        asked,
    };
    let gentle = |name, degrees, asked| Row {
        mill: mill("nurbs", 0.01, 1000.0, 2e4),
        ..paper(name, degrees, asked)
    };
    let smooth = |name, paths, tolerance, (acceleration, jerk), asked| Row {
        name,
        paths,
        mill: mill("smooth", tolerance, acceleration, jerk),
        beside: if paths == Paths::Cam {
            Beside::Settings
        } else {
            Beside::Curve { chord: false }
        },
        asked,
    };
    let usual = (1000.0, 2e4);
    vec![
        paper("scan-paper", [3, 4], 1.01),
        gentle("scan-gentle", [3, 4], 1.01),
        paper("scan-jumps-paper", [2, 2], 1.08),
        gentle("scan-jumps-gentle", [2, 2], 1.08),
        smooth("smooth-curves-1um", Paths::Curve([3, 4]), 1e-3, usual, 1.05),
        smooth("smooth-cam-1um", Paths::Cam, 1e-3, usual, 1.10),
        smooth("smooth-cam-10um", Paths::Cam, 1e-2, usual, 1.005),
        smooth("smooth-cam-100um", Paths::Cam, 0.1, usual, 1.02),
        smooth("smooth-cam-jerk-1e5", Paths::Cam, 1e-2, (1000.0, 1e5), 1.02),
        smooth("smooth-cam-jerk-1e6", Paths::Cam, 1e-2, (1000.0, 1e6), 1.02),
        smooth("smooth-cam-5000", Paths::Cam, 1e-2, (5000.0, 1e5), 1.02),
    ]
}

/// Settings of `smooth` that are compared: a step of the grid as a multiple of the time of a feature, (tolerance/jerk)^⅓.
const STEPS: [f64; 6] = [0.4, 0.55, 0.75, 1.0, 1.3, 1.7];
/// Steps that the planner takes, ms.
const STEP_MS: [f64; 2] = [0.5, 20.0];

/// One program.
#[derive(Clone, Debug)]
pub struct Result {
    /// Seed of the program.
    pub seed: u64,
    /// What kind of path it is.
    pub kind: &'static str,
    /// As driven, s.
    pub time_s: f64,
    /// The shortest known, s.
    pub best_s: f64,
    /// `clean`, or what the judge says.
    pub verdict: String,
}

impl Row {
    /// Drives the program of `seed`; none where there is nothing to compare it with.
    pub fn run(&self, seed: u64, folder: &Path) -> Option<Result> {
        let text = program(self.paths, seed);
        let done = driven(&text, &self.mill, folder);
        let file = folder.join("program.ngc");
        let best_s = match self.beside {
            Beside::Curve { chord } => best_along_curve(&file, &self.mill, chord)?,
            Beside::Settings => self.settings(&text, folder).min(done.time_s),
        };
        Some(Result {
            seed,
            kind: if self.paths == Paths::Cam {
                kind(seed)
            } else {
                "curve"
            },
            time_s: done.time_s,
            best_s,
            verdict: done.verdict,
        })
    }

    /// Time of motion by processor time of planning the program of `seed` by itself; not a number where it is not driven.
    pub fn speed(&self, seed: u64, folder: &Path) -> f64 {
        let done = driven(&program(self.paths, seed), &self.mill, folder);
        let speed = (done.verdict == "clean").then(|| planning_speed(&folder.join("program.ngc")));
        speed.flatten().unwrap_or(f64::NAN)
    }

    fn settings(&self, text: &str, folder: &Path) -> f64 {
        let feature_s = (self.mill.tolerance / self.mill.jerk).cbrt();
        let times = STEPS.map(|share| {
            let step_ms = (1000.0 * share * feature_s).clamp(STEP_MS[0], STEP_MS[1]);
            let mut mill = self.mill.clone();
            mill.options = vec![
                ("grid_ms".to_string(), format!("{step_ms:.4}")),
                ("window_ms".to_string(), "2000".to_string()),
                ("rounds".to_string(), "8".to_string()),
            ];
            let done = driven(text, &mill, folder);
            if done.verdict == "clean" {
                done.time_s
            } else {
                f64::INFINITY
            }
        });
        times.into_iter().fold(f64::INFINITY, f64::min)
    }
}

/// The median of what is sorted.
pub fn median(sorted: &[f64]) -> f64 {
    sorted.get(sorted.len() / 2).copied().unwrap_or(f64::NAN)
}
