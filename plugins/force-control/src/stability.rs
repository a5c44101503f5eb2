//! Whether a feed law is stable: the loop, linearised and driven from a disturbance.
//!
//! The loop is servo, screw, chip (the path driven within a tooth period), observer, mean, law, the rough period that passes
//! before a ratio acts, the one in which the feed is led over to it, and the delay of the bus. Its growth over many rough periods is the spectral radius of what maps one rough period to the next.

use std::f64::consts::TAU;

use crate::law::Law;
use crate::mean::RunningMean;
use crate::observer::Observer;

/// Step of the plant, s.
const STEP_S: f64 = 1e-4;
/// Rough periods before the growth is measured, and over which it is.
const SETTLE: usize = 500;
const MEASURED: usize = 1000;
/// Rough periods over which the greatest feed is taken: longer than an oscillation.
const ENVELOPE: usize = 50;

/// What the loop is made of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LoopModel {
    /// Fine period, s.
    pub fine_period_s: f64,
    /// Fine periods of a rough one.
    pub per_rough: usize,
    /// Inertia at the motor, kg·m².
    pub inertia_kg_m2: f64,
    /// Torque constant, N·m/A.
    pub torque_constant_nm_per_a: f64,
    /// Travel per turn, mm.
    pub lead_mm: f64,
    /// Gain of the position loop, 1/s.
    pub position_gain_per_s: f64,
    /// Bandwidth of the velocity loop, Hz.
    pub velocity_loop_hz: f64,
    /// Its integral time, s.
    pub velocity_integral_s: f64,
    /// Time constant of the observer, s.
    pub observer_time_constant_s: f64,
    /// Fine samples of the mean.
    pub mean_samples: f64,
    /// Time between two teeth, s.
    pub tooth_period_s: f64,
    /// Rough periods before the feed asked for acts: 1 in Tandem.
    pub latency: usize,
    /// Fine periods by which the loop is late: a setpoint on its way to the drive, and what is measured on its way back.
    pub delay_periods: usize,
    /// The feed goes evenly to what is asked for, over a rough period, as in Tandem; else it steps there, as published.
    pub led: bool,
}

impl LoopModel {
    /// By how much a deviation grows in a rough period (below 1 it decays) under `law`, where the torque rises by
    /// `torque_per_feed` N·m per mm/s. Takes about a million operations; allocates.
    pub fn growth(&self, law: Law, torque_per_feed: f64, reference_nm: f64) -> f64 {
        let (gain, integral_gain) = linear_gains(law, torque_per_feed, reference_nm);
        let mut state = State::new(self);
        let mut feeds = vec![0.0_f64; self.latency + 2];
        let (mut integral, mut log_scale) = (0.0, 0.0);
        let mut levels = Vec::with_capacity(SETTLE + MEASURED);
        for block in 0..SETTLE + MEASURED {
            let torque = state.mean.of(self.mean_samples);
            integral -= integral_gain * torque;
            feeds.rotate_right(1);
            feeds[0] = if block == 0 {
                1.0
            } else {
                integral - gain * torque
            };
            let from = if self.led {
                self.latency + 1
            } else {
                self.latency
            };
            state.rough_period(self, [feeds[from], feeds[self.latency]], torque_per_feed);
            let size = feeds
                .iter()
                .fold(integral.abs(), |most, feed| most.max(feed.abs()));
            levels.push(log_scale + size.max(f64::MIN_POSITIVE).ln());
            if size > 1e6 || (size < 1e-6 && block % ENVELOPE == 0) {
                // Linear, so everything may be scaled; numbers stay in range.
                let scale = 1.0 / size.max(1e-200);
                log_scale -= scale.ln();
                for feed in &mut feeds {
                    *feed *= scale;
                }
                integral *= scale;
                state.scale(scale, TAU / self.lead_mm);
            }
        }
        let envelope = |end: usize| {
            levels[end - ENVELOPE..end]
                .iter()
                .copied()
                .fold(f64::NEG_INFINITY, f64::max)
        };
        ((envelope(SETTLE + MEASURED) - envelope(SETTLE)) / MEASURED as f64).exp()
    }

    /// The largest factor on the gains of `law` with which the loop is still stable, to 0.5 %; at most `most`.
    pub fn gain_margin(&self, law: Law, torque_per_feed: f64, reference_nm: f64, most: f64) -> f64 {
        let stable =
            |factor: f64| self.growth(law.scaled(factor), torque_per_feed, reference_nm) < 1.0;
        let (mut low, mut high) = (0.0, most);
        if stable(most) {
            return most;
        }
        while high - low > 0.005 * high && high > 1e-6 {
            let middle = f64::midpoint(low, high);
            if stable(middle) {
                low = middle;
            } else {
                high = middle;
            }
        }
        low
    }
}

/// The law near its reference: feed per torque, and per torque and rough period.
fn linear_gains(law: Law, torque_per_feed: f64, reference_nm: f64) -> (f64, f64) {
    match law {
        Law::Proportional { gain } => (gain, 0.0),
        Law::Pi {
            gain,
            integral_gain,
        } => (gain, integral_gain),
        // Feed and torque are in the proportion of the cut there.
        Law::Ratio { exponent } => (
            0.0,
            exponent * (reference_nm / torque_per_feed) / reference_nm,
        ),
    }
}

/// Everything that remembers, as deviations from a steady cut.
struct State {
    observer: Observer,
    mean: RunningMean,
    command: f64,
    angle: f64,
    speed: f64,
    integral: f64,
    current: f64,
    driven: Vec<f64>,
    at: usize,
    /// Speeds and currents on their way, the newest first.
    measured: Vec<(f64, f64)>,
}

impl State {
    fn new(model: &LoopModel) -> Self {
        let observer = || {
            let LoopModel {
                inertia_kg_m2,
                torque_constant_nm_per_a,
                fine_period_s,
                observer_time_constant_s,
                ..
            } = *model;
            Observer::new(
                inertia_kg_m2,
                torque_constant_nm_per_a,
                fine_period_s,
                observer_time_constant_s,
            )
        };
        let steps = (model.tooth_period_s / STEP_S).round().max(1.0) as usize;
        Self {
            observer: observer(),
            mean: RunningMean::new(),
            command: 0.0,
            angle: 0.0,
            speed: 0.0,
            integral: 0.0,
            current: 0.0,
            driven: vec![0.0; steps],
            at: 0,
            measured: vec![(0.0, 0.0); model.delay_periods + 1],
        }
    }

    /// A rough period in which the feed goes evenly from one to the other.
    fn rough_period(&mut self, model: &LoopModel, [from, to]: [f64; 2], torque_per_feed: f64) {
        let turns = TAU / model.lead_mm;
        let gain = model.inertia_kg_m2 * TAU * model.velocity_loop_hz;
        let steps = (model.fine_period_s / STEP_S).round().max(1.0) as usize;
        let step_s = model.fine_period_s / steps as f64;
        for period in 1..=model.per_rough {
            let feed = from + (to - from) * period as f64 / model.per_rough as f64;
            self.command += feed * model.fine_period_s * turns;
            self.measured.rotate_right(1);
            self.measured[0] = (self.speed, self.current);
            let (speed, current) = self.measured[model.delay_periods];
            self.mean.push(self.observer.step(speed, current));
            let error = model.position_gain_per_s * (self.command - self.angle) - self.speed;
            self.integral += gain / model.velocity_integral_s * model.fine_period_s * error;
            let torque = gain * error + self.integral;
            self.current = torque / model.torque_constant_nm_per_a;
            for _ in 0..steps {
                let driven = self.angle / turns;
                let chip = driven - std::mem::replace(&mut self.driven[self.at], driven);
                self.at = (self.at + 1) % self.driven.len();
                let load = torque_per_feed * chip / (self.driven.len() as f64 * step_s);
                self.speed += step_s * (torque - load) / model.inertia_kg_m2;
                self.angle += step_s * self.speed;
            }
        }
    }

    fn scale(&mut self, scale: f64, turns: f64) {
        self.observer.scale(scale);
        self.mean.scale(scale);
        // Where the axis stands does not matter; kept, it would grow until differences are lost in it.
        let here = self.angle;
        (self.command, self.angle) = (self.command - here, 0.0);
        self.driven
            .iter_mut()
            .for_each(|driven| *driven -= here / turns);
        for value in [
            &mut self.command,
            &mut self.angle,
            &mut self.speed,
            &mut self.integral,
            &mut self.current,
        ] {
            *value *= scale;
        }
        self.driven.iter_mut().for_each(|driven| *driven *= scale);
        for (speed, current) in &mut self.measured {
            (*speed, *current) = (*speed * scale, *current * scale);
        }
    }
}

impl Law {
    /// The law with its gains multiplied.
    #[must_use]
    pub fn scaled(self, factor: f64) -> Self {
        match self {
            Self::Proportional { gain } => Self::Proportional {
                gain: gain * factor,
            },
            Self::Pi {
                gain,
                integral_gain,
            } => Self::Pi {
                gain: gain * factor,
                integral_gain: integral_gain * factor,
            },
            Self::Ratio { exponent } => Self::Ratio {
                exponent: exponent * factor,
            },
        }
    }
}
