//! The loop of the published experiment, in its order of operations: the modules under test closed over the simulated axis.

use std::f64::consts::TAU;
use std::path::Path;

use serde_json::Value;
use tandem_force_control::friction::FrictionModel;
use tandem_force_control::guard::Guard;
use tandem_force_control::law::{Bounds, FeedLaw, Law, RateLimit};
use tandem_force_control::mean::RunningMean;
use tandem_force_control::observer::Observer;
use tandem_sdk::parse_options;
use tandem_sim::servo::{Cutting, CuttingOptions, Friction, PLANT_STEP_S, ServoAxis, ServoOptions};

pub const PERIOD_S: f64 = 1e-3;
pub const J: f64 = 1.842e-4;
pub const KT: f64 = 0.378;
pub const LEAD_MM: f64 = 20.0;
pub const TURNS: f64 = TAU / LEAD_MM;
/// Torque per depth and feed, N·m/(mm·mm/min).
pub const K_CUT: f64 = 0.1 / (3.0 * 150.0);
/// The published tooth period is 333 plant steps.
pub const TOOTH_S: f64 = 0.0333;

/// A reference case.
pub fn case(name: &str) -> Value {
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../../tests/fixtures/cases")
        .join(name);
    serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

pub fn number(value: &Value) -> f64 {
    value
        .as_f64()
        .unwrap_or_else(|| panic!("{value} is no number"))
}

/// Says what differs by more than the tolerance.
pub fn close(what: &str, found: f64, expected: f64, tolerance: f64) {
    assert!(
        (found - expected).abs() <= tolerance,
        "{what}: {found} instead of {expected} ± {tolerance}"
    );
}

/// A friction set of the published constants, as the plant has it.
pub fn plant_friction(set: &str) -> Friction {
    let (coulomb_nm, viscous_nm_s_per_rad, stribeck_nm) = match set {
        "none" => (0.0, 0.0, 0.0),
        "robot" => (0.01, 5e-5, 0.0),
        "machine" => (0.06, 6e-4, 0.0),
        "machine_stribeck" => (0.06, 6e-4, 0.02),
        set => panic!("no friction set {set}"),
    };
    Friction {
        coulomb_nm,
        viscous_nm_s_per_rad,
        stribeck_nm,
        ..Friction::default()
    }
}

/// The same as the model that is compensated.
pub fn model_of(friction: &Friction) -> FrictionModel {
    FrictionModel {
        coulomb_nm: friction.coulomb_nm,
        viscous_nm_s_per_rad: friction.viscous_nm_s_per_rad,
        stribeck_nm: friction.stribeck_nm,
        stribeck_speed_rad_per_s: friction.stribeck_speed_rad_per_s,
        constant_nm: friction.constant_nm,
    }
}

pub fn servo(friction: &str) -> ServoOptions {
    ServoOptions {
        friction: plant_friction(friction),
        ..ServoOptions::default()
    }
}

pub fn observer(time_constant_s: f64) -> Observer {
    Observer::new(J, KT, PERIOD_S, time_constant_s)
}

/// A cutter with the published gain and tooth period; `workpiece` in the words of the machine file.
pub fn cutting(workpiece: &str) -> Cutting {
    let specific = K_CUT * 60.0 / TOOTH_S * TAU / (LEAD_MM * 1e-3);
    let text = format!("specific_force_n_per_mm2 = {specific:?}\n[workpiece]\n{workpiece}");
    Cutting::new(&parse_options::<CuttingOptions>(&text).unwrap(), 1)
}

/// Ten plant steps from `t_s` on, under a cut whose force ripples at 30 Hz. Gives the cutting torque at
/// the last of them, and the highest, N·m.
pub fn plant(axis: &mut ServoAxis, cutting: &mut Cutting, ripple: f64, t_s: f64) -> (f64, f64) {
    let (mut load_nm, mut max_nm) = (0.0, 0.0_f64);
    for step in 0..10 {
        let factor = 1.0 + ripple * (TAU * 30.0 * (t_s + f64::from(step) * PLANT_STEP_S)).sin();
        let position = [axis.angle_rad / TURNS, 0.0, 0.0];
        let force_n = cutting.step(position, [1.0, 0.0, 0.0], TAU / 2.0 / TOOTH_S, PLANT_STEP_S);
        load_nm = factor * force_n * axis.torque_per_force_m();
        max_nm = max_nm.max(load_nm);
        axis.step(load_nm, PLANT_STEP_S);
    }
    (load_nm, max_nm)
}

/// What a force-controlled run is made of.
pub struct Setup {
    pub law: Option<Law>,
    pub feed_mm_per_min: f64,
    pub workpiece: String,
    pub ripple: f64,
    pub servo: ServoOptions,
    pub observer: Observer,
    pub compensated: Option<FrictionModel>,
    pub mean_samples: f64,
    pub guard: Option<Guard>,
    pub end_mm: f64,
}

/// A tick: what the plant does, and what is known of it.
#[derive(Clone, Copy, Debug, Default)]
pub struct Tick {
    pub t_s: f64,
    /// Path driven, mm.
    pub s_mm: f64,
    pub torque_nm: f64,
    /// The highest within the tick.
    pub max_nm: f64,
    pub feed_mm_per_min: f64,
}

/// A rough period: time, mean torque of the one before, feed asked for, mm/min, and place.
#[derive(Clone, Copy, Debug)]
pub struct Block {
    pub t_s: f64,
    pub mean_nm: f64,
    pub asked_mm_per_min: f64,
    pub s_mm: f64,
}

#[derive(Default)]
pub struct Ran {
    pub ticks: Vec<Tick>,
    pub blocks: Vec<Block>,
    pub tripped_s: Option<f64>,
}

impl Setup {
    /// The canonical run of a law (none: constant feed) over a specimen.
    pub fn new(law: Option<Law>, workpiece: &str, end_mm: f64) -> Self {
        Self {
            law,
            feed_mm_per_min: 150.0,
            workpiece: workpiece.to_string(),
            ripple: 0.0,
            servo: ServoOptions::default(),
            observer: observer(5e-3),
            compensated: None,
            mean_samples: 8.0,
            guard: None,
            end_mm,
        }
    }

    /// Drives to the end, or until the feed is zero for 0.5 s after the guard tripped, or 60 s.
    pub fn run(mut self) -> Ran {
        let bounds = Bounds {
            reference_nm: 0.1,
            min_mm_per_s: 10.0 / 60.0,
            max_mm_per_s: 5.0,
        };
        let programmed = self.feed_mm_per_min / 60.0;
        let mut law = self.law.map(|law| FeedLaw::new(law, bounds, programmed));
        let mut axis = ServoAxis::new(self.servo, 0.0, PERIOD_S, 5);
        let mut cutting = cutting(&self.workpiece);
        let (mut limit, mut mean) = (RateLimit::new(0.8, 0.0), RunningMean::new());
        let (mut queued, mut feed, mut command_mm) = (0.0, 0.0, 0.0);
        let mut ran = Ran::default();
        for tick in 0..60_000_u32 {
            let t_s = f64::from(tick) * PERIOD_S;
            let s_mm = axis.angle_rad / TURNS;
            if s_mm >= self.end_mm || ran.tripped_s.is_some_and(|trip| t_s > trip + 0.5) {
                break;
            }
            if tick % 8 == 0 {
                let mean_nm = mean.of(self.mean_samples);
                let mut asked = programmed;
                if tick > 0 {
                    if self
                        .guard
                        .as_mut()
                        .is_some_and(|guard| guard.trips(mean_nm))
                    {
                        ran.tripped_s.get_or_insert(t_s);
                    }
                    asked = law
                        .as_mut()
                        .map_or(programmed, |law| law.next(programmed, mean_nm, true));
                    ran.blocks.push(Block {
                        t_s,
                        mean_nm,
                        asked_mm_per_min: asked * 60.0,
                        s_mm,
                    });
                }
                if ran.tripped_s.is_some() {
                    asked = 0.0;
                }
                feed = limit.next(std::mem::replace(&mut queued, asked));
            }
            let last_command = feed_speed(&ran);
            command_mm += feed * PERIOD_S;
            let speed = axis.measure().speed_rad_per_s;
            let friction_a = self
                .compensated
                .map_or(0.0, |model| model.torque_nm(last_command) / KT);
            let current_a = axis.measured_current_a();
            let estimate_nm = self.observer.step(speed, current_a - friction_a);
            mean.push(estimate_nm);
            axis.control(command_mm * TURNS, feed * TURNS);
            let (torque_nm, max_nm) = plant(&mut axis, &mut cutting, self.ripple, t_s);
            ran.ticks.push(Tick {
                t_s,
                s_mm,
                torque_nm,
                max_nm,
                feed_mm_per_min: feed * 60.0,
            });
        }
        ran
    }
}

/// The commanded speed of the tick before, rad/s.
fn feed_speed(ran: &Ran) -> f64 {
    ran.ticks
        .last()
        .map_or(0.0, |tick| tick.feed_mm_per_min / 60.0 * TURNS)
}

impl Ran {
    /// Ticks with the place between two lengths.
    pub fn window(&self, [from, to]: [f64; 2]) -> Vec<Tick> {
        self.ticks
            .iter()
            .filter(|tick| tick.s_mm >= from && tick.s_mm <= to)
            .copied()
            .collect()
    }

    pub fn time_s(&self) -> f64 {
        self.ticks.len() as f64 * PERIOD_S
    }

    pub fn peak_nm(&self) -> f64 {
        self.ticks
            .iter()
            .fold(0.0, |most, tick| most.max(tick.max_nm))
    }
}

/// Root of the mean square.
pub fn rms(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0.0), |(sum, count), value| {
        (sum + value * value, count + 1.0)
    });
    (sum / count).sqrt()
}
