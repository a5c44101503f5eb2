//! One axis: what its motor feels of the cut.

use std::f64::consts::TAU;

use tandem_sdk::FineSample;

use crate::conversion::force_per_torque_per_m;
use crate::friction::FrictionModel;
use crate::mean::RunningMean;
use crate::observer::Observer;
use crate::options::AxisOptions;

/// No motor is commanded to turn faster than this, rad/s: it is the place that was given another name.
const FASTEST_RAD_PER_S: f64 = 5000.0;

/// Observer, compensation and mean of one axis.
#[derive(Clone, Debug)]
pub struct AxisLoad {
    index: usize,
    turns: f64,
    rate_per_s: f64,
    torque_constant_nm_per_a: f64,
    friction: FrictionModel,
    observer: Observer,
    last_command: Option<f64>,
    mean: RunningMean,
    /// Cutting torque now, N·m.
    pub torque_nm: f64,
    /// Force per torque, 1/m.
    pub force_per_torque_per_m: f64,
}

impl AxisLoad {
    /// The axis `index` of a machine, from checked options. Allocates; the other methods do not.
    pub fn new(index: usize, options: &AxisOptions, period_s: f64, time_constant_s: f64) -> Self {
        let [inertia_kg_m2, torque_constant, lead_mm] = [
            options.inertia_kg_m2,
            options.torque_constant_nm_per_a,
            options.lead_mm,
        ]
        .map(|v| v.unwrap_or(1.0));
        Self {
            index,
            turns: TAU / lead_mm,
            rate_per_s: 1.0 / period_s,
            torque_constant_nm_per_a: torque_constant,
            friction: options.friction,
            observer: Observer::new(inertia_kg_m2, torque_constant, period_s, time_constant_s),
            last_command: None,
            mean: RunningMean::new(),
            torque_nm: 0.0,
            force_per_torque_per_m: force_per_torque_per_m(lead_mm, options.screw_efficiency),
        }
    }

    /// Takes a fine sample; `follows` where it is the one after the last.
    pub fn step(&mut self, sample: &FineSample, follows: bool) {
        let speed = sample.speed[self.index] * self.turns;
        let command = sample.command[self.index] * self.turns;
        let last = self.last_command.replace(command);
        let commanded = last
            .filter(|_| follows)
            .map_or(speed, |last| (command - last) * self.rate_per_s);
        let commanded = if commanded.abs() > FASTEST_RAD_PER_S {
            speed
        } else {
            commanded
        };
        let free_a = self.friction.torque_nm(commanded) / self.torque_constant_nm_per_a;
        if !follows {
            self.observer.restart(speed);
        }
        let felt_nm = self
            .observer
            .step(speed, sample.current_a[self.index] - free_a);
        self.torque_nm = if commanded == 0.0 {
            self.beyond_holding(felt_nm)
        } else {
            felt_nm
        };
        self.mean.push(self.torque_nm);
    }

    /// What a standing axis surely takes: friction may hold a part in either direction.
    fn beyond_holding(&self, felt_nm: f64) -> f64 {
        let holding_nm = self.friction.holding_nm();
        felt_nm - felt_nm.clamp(-holding_nm, holding_nm)
    }

    /// Mean torque over the last `samples`, N·m.
    pub fn mean_nm(&self, samples: f64) -> f64 {
        self.mean.of(samples)
    }
}
