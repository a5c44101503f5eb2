//! All joints of a machine as servo axes, with the cutting process between them.

use std::f64::consts::TAU;

use tandem_sdk::{AxisVector, MAX_AXES};

use super::PLANT_STEP_S;
use super::axis::ServoAxis;
use super::cutting::Cutting;
use super::options::ServoOptions;
use crate::joint::Motion;
use crate::options::Options;

/// What only a simulation knows.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Truth {
    /// Resultant of the cutting torques at the motors, mean over the period, N·m.
    pub cutting_torque_nm: f64,
    /// Depth of cut at the end of the period, mm.
    pub depth_mm: f64,
}

#[derive(Clone, Debug)]
pub(crate) struct ServoJoints {
    axes: Vec<ServoAxis>,
    cutting: Option<Cutting>,
    steps: u32,
    step_s: f64,
    /// Unit direction driven last, in joints 0 to 2.
    direction: [f64; 3],
    pub truth: Truth,
}

impl ServoJoints {
    /// Joints at rest. Allocates; the other methods do not.
    pub fn new(options: &Options, start: &AxisVector, count: usize, period_s: f64) -> Self {
        let steps = (period_s / PLANT_STEP_S - 1e-6).ceil().max(1.0) as u32;
        let axis = |index: usize| {
            let servo = options
                .servo
                .get(index)
                .or(options.servo.last())
                .copied()
                .unwrap_or_default();
            let seed = options
                .seed
                .wrapping_mul(MAX_AXES as u64)
                .wrapping_add(index as u64);
            ServoAxis::new(servo, start[index] * turns(&servo), period_s, seed)
        };
        Self {
            axes: (0..count).map(axis).collect(),
            cutting: options
                .cutting
                .as_ref()
                .map(|cutting| Cutting::new(cutting, options.seed)),
            steps,
            step_s: period_s / f64::from(steps),
            direction: [0.0; 3],
            truth: Truth::default(),
        }
    }

    /// One period towards `to`, at `velocity`. Fine loop.
    pub fn follow(&mut self, to: &AxisVector, velocity: &AxisVector, spindle_rad_per_s: f64) {
        let speed = (0..3)
            .map(|i| velocity[i] * velocity[i])
            .sum::<f64>()
            .sqrt();
        if speed > 0.0 {
            self.direction = std::array::from_fn(|i| velocity[i] / speed);
        }
        for (index, axis) in self.axes.iter_mut().enumerate() {
            let turns = turns(&axis.options);
            axis.control(to[index] * turns, velocity[index] * turns);
        }
        let mut torque_nm = 0.0;
        for _ in 0..self.steps {
            let loads_nm = self.loads_nm(spindle_rad_per_s);
            torque_nm += loads_nm.iter().map(|load| load * load).sum::<f64>().sqrt();
            for (index, axis) in self.axes.iter_mut().enumerate() {
                axis.step(loads_nm.get(index).copied().unwrap_or(0.0), self.step_s);
            }
        }
        for axis in &mut self.axes {
            axis.measure();
        }
        self.truth.cutting_torque_nm = torque_nm / f64::from(self.steps);
        self.truth.depth_mm = self
            .cutting
            .as_ref()
            .map_or(0.0, |cutting| cutting.depth_mm);
    }

    /// Cutting torque at the motor of joints 0 to 2.
    fn loads_nm(&mut self, spindle_rad_per_s: f64) -> [f64; 3] {
        let position = std::array::from_fn(|i| self.axes.get(i).map_or(0.0, position_mm));
        let Some(cutting) = &mut self.cutting else {
            return [0.0; 3];
        };
        let force_n = cutting.step(position, self.direction, spindle_rad_per_s, self.step_s);
        std::array::from_fn(|i| {
            let per_force = self.axes.get(i).map_or(0.0, ServoAxis::torque_per_force_m);
            force_n * self.direction[i] * per_force
        })
    }

    /// The brake of a joint holds or slows it: it is where the brake lets it. Fine loop.
    pub fn hold(&mut self, joint: usize, motion: &Motion) {
        let axis = &mut self.axes[joint];
        let turns = turns(&axis.options);
        axis.rest_at(motion.position * turns, motion.speed * turns);
    }

    /// No joint follows: nothing is cut. Fine loop.
    pub fn rest(&mut self) {
        self.truth.cutting_torque_nm = 0.0;
    }

    /// Where a joint really is, mm and mm/s.
    pub fn motion(&self, index: usize) -> Motion {
        let axis = &self.axes[index];
        let turns = turns(&axis.options);
        Motion {
            position: axis.angle_rad / turns,
            speed: axis.speed_rad_per_s / turns,
        }
    }

    /// What the encoder of a joint says, mm and mm/s.
    pub fn measured(&self, index: usize) -> Motion {
        let axis = &self.axes[index];
        let (turns, measured) = (turns(&axis.options), axis.measured());
        Motion {
            position: measured.angle_rad / turns,
            speed: measured.speed_rad_per_s / turns,
        }
    }

    /// The current of a joint as its drive measures it, A.
    pub fn current_a(&mut self, index: usize) -> f64 {
        self.axes[index].measured_current_a()
    }
}

/// Angle of the motor per travel, rad/mm.
fn turns(options: &ServoOptions) -> f64 {
    TAU / options.lead_mm
}

fn position_mm(axis: &ServoAxis) -> f64 {
    axis.angle_rad / turns(&axis.options)
}
