//! Axes that follow given commands under a given cutting torque.

use tandem_force_control::friction::FrictionModel;
use tandem_force_control::observer::Observer;
use tandem_sim::servo::{PLANT_STEP_S, ServoAxis, ServoOptions};

use crate::rig::{KT, PERIOD_S};

/// Where the friction model is taken out.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Where {
    /// Before the observer.
    In,
    /// After it.
    Out,
}

/// One axis with its observer.
pub struct Watched {
    pub axis: ServoAxis,
    pub observer: Observer,
    pub compensated: Option<(FrictionModel, Where)>,
    last_command: f64,
}

/// What is known of an axis in a tick.
#[derive(Clone, Copy, Debug, Default)]
pub struct Known {
    /// Torque constant × current.
    pub current_nm: f64,
    pub estimate_nm: f64,
}

impl Watched {
    pub fn new(options: ServoOptions, observer: Observer, angle_rad: f64, seed: u64) -> Self {
        Self {
            axis: ServoAxis::new(options, angle_rad, PERIOD_S, seed),
            observer,
            compensated: None,
            last_command: 0.0,
        }
    }

    /// Begins a tick towards `angle` at `speed`. The plant is stepped from outside.
    pub fn begin(&mut self, angle: f64, speed: f64) -> Known {
        let measured = self.axis.measure();
        let current_a = self.axis.measured_current_a();
        let friction_nm = self
            .compensated
            .map_or(0.0, |(model, _)| model.torque_nm(self.last_command));
        let inside = matches!(self.compensated, Some((_, Where::In)));
        let taken = if inside { friction_nm / KT } else { 0.0 };
        let outside = if inside { 0.0 } else { friction_nm };
        let estimate_nm = self
            .observer
            .step(measured.speed_rad_per_s, current_a - taken)
            - outside;
        self.last_command = speed;
        self.axis.control(angle, speed);
        Known {
            current_nm: KT * current_a,
            estimate_nm,
        }
    }

    /// A tick under a constant cutting torque.
    pub fn tick(&mut self, angle: f64, speed: f64, load_nm: f64) -> Known {
        let known = self.begin(angle, speed);
        (0..10).for_each(|_| self.axis.step(load_nm, PLANT_STEP_S));
        known
    }
}
