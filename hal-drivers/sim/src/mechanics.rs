//! The joints as bodies: how they follow, come to rest, are held and sink.

use std::f64::consts::TAU;

use tandem_sdk::{AxisVector, MAX_ANALOG, MAX_AXES};

use crate::joint::{CURRENT_A_PER_MM_PER_S2, Motion, Servo};
use crate::options::{Model, Options};
use crate::power::Power;
use crate::servo::ServoJoints;

/// All joints of a machine, in the coordinates of their encoders.
#[derive(Debug)]
pub(crate) struct Mechanics {
    model: Model,
    servo: Servo,
    /// The joints of the model `servo`.
    motors: Option<ServoJoints>,
    joints: [Motion; MAX_AXES],
    /// Where they were before the periods of the last exchange.
    before: [Motion; MAX_AXES],
    count: usize,
    /// The setpoint that each joint followed last; none where it follows nothing.
    followed: [Option<f64>; MAX_AXES],
    /// The velocity commanded last: joints go on at it while no setpoint comes.
    velocity: AxisVector,
    deceleration_mm_per_s2: f64,
    /// Speed at which gravity pulls each joint along.
    sag_mm_per_s: AxisVector,
    period_s: f64,
}

impl Mechanics {
    /// Joints at rest. Host; allocates.
    pub fn new(options: &Options, start: &AxisVector, count: usize, period_s: f64) -> Self {
        let joints = std::array::from_fn(|i| Motion {
            position: start[i],
            speed: 0.0,
        });
        let motors = (options.model == Model::Servo)
            .then(|| ServoJoints::new(options, start, count, period_s));
        Self {
            model: options.model,
            servo: Servo::new(
                TAU * options.natural_frequency_hz,
                options.damping_ratio,
                period_s,
            ),
            motors,
            joints,
            before: joints,
            count,
            followed: [None; MAX_AXES],
            velocity: AxisVector::ZERO,
            deceleration_mm_per_s2: options.quick_stop_deceleration_mm_per_s2,
            sag_mm_per_s: AxisVector(std::array::from_fn(|i| {
                options.sag_mm_per_s.get(i).copied().unwrap_or(0.0)
            })),
            period_s,
        }
    }

    /// An exchange begins. Fine loop.
    pub fn begin(&mut self) {
        self.before = self.joints;
    }

    /// Where the joints were before this exchange, and where they are now.
    pub fn way(&self) -> [AxisVector; 2] {
        [self.before, self.joints].map(|joints| AxisVector(joints.map(|joint| joint.position)))
    }

    /// Whether a joint follows.
    pub fn is_following(&self) -> bool {
        self.followed.iter().any(Option::is_some)
    }

    /// Whether a joint stands still.
    pub fn is_at_rest(&self, joint: usize) -> bool {
        self.joints[joint].speed == 0.0
    }

    /// Where the joints go where no new setpoint comes: on at the last velocity. Fine loop.
    pub fn coast(&self) -> AxisVector {
        let next = |i: usize| {
            self.followed[i].map_or(self.joints[i].position, |last| {
                last + self.velocity[i] * self.period_s
            })
        };
        AxisVector(std::array::from_fn(next))
    }

    /// The velocity commanded.
    pub fn set_velocity(&mut self, velocity: &AxisVector) {
        self.velocity = *velocity;
    }

    /// One period towards `to` for the joints whose drives follow; `powers` are those of all joints. Fine loop.
    pub fn step(&mut self, powers: &[Power], to: &AxisVector, spindle_rad_per_s: f64) {
        self.drive_motors(powers, to, spindle_rad_per_s);
        for (index, power) in powers.iter().enumerate() {
            if power.follows() {
                self.follow(index, to[index]);
            } else {
                self.rest(index, power);
            }
        }
    }

    fn drive_motors(&mut self, powers: &[Power], to: &AxisVector, spindle_rad_per_s: f64) {
        let Some(motors) = &mut self.motors else {
            return;
        };
        let follows = |joint: usize| powers.get(joint).is_some_and(Power::follows);
        if !(0..self.count).any(follows) {
            return motors.rest();
        }
        let joints = &self.joints;
        let aim = AxisVector(std::array::from_fn(|i| {
            if follows(i) {
                to[i]
            } else {
                joints[i].position
            }
        }));
        let velocity = AxisVector(std::array::from_fn(|i| {
            if follows(i) { self.velocity[i] } else { 0.0 }
        }));
        motors.follow(&aim, &velocity, spindle_rad_per_s);
    }

    fn follow(&mut self, index: usize, to: f64) {
        // A drive that just begins to follow has no setpoint to interpolate from: for it this is a step.
        let from = self.followed[index].unwrap_or(to);
        let joint = &mut self.joints[index];
        match self.model {
            Model::SecondOrder => self.servo.follow(joint, from, to),
            Model::Ideal | Model::Servo => {
                let ideal = Motion {
                    position: to,
                    speed: self.velocity[index],
                };
                *joint = self
                    .motors
                    .as_ref()
                    .map_or(ideal, |motors| motors.motion(index));
            }
        }
        self.followed[index] = Some(to);
    }

    /// A joint that does not follow: held, pulled down, or on its way to rest.
    fn rest(&mut self, index: usize, power: &Power) {
        self.followed[index] = None;
        let (joint, sag_mm_per_s) = (&mut self.joints[index], self.sag_mm_per_s[index]);
        if power.holds() {
            joint.speed = 0.0;
        } else if power.sags() && sag_mm_per_s != 0.0 {
            joint.speed = sag_mm_per_s;
            joint.position += sag_mm_per_s * self.period_s;
        } else {
            joint.brake(self.deceleration_mm_per_s2, self.period_s);
        }
        if let Some(motors) = &mut self.motors {
            motors.hold(index, joint);
        }
    }

    /// What the drive of a joint sees.
    pub fn seen(&self, joint: usize) -> Motion {
        self.motors
            .as_ref()
            .map_or(self.joints[joint], |motors| motors.measured(joint))
    }

    /// The current of a joint's motor over this exchange, A. Fine loop.
    pub fn current_a(&mut self, joint: usize) -> f64 {
        let change = self.joints[joint].speed - self.before[joint].speed;
        match (self.model, &mut self.motors) {
            (Model::SecondOrder, _) => CURRENT_A_PER_MM_PER_S2 * change / self.period_s,
            (_, Some(motors)) => motors.current_a(joint),
            _ => 0.0,
        }
    }

    /// What only a simulation knows, for the analog inputs.
    pub fn analog(&self) -> [f64; MAX_ANALOG] {
        let truth = self.motors.as_ref().map(|motors| &motors.truth);
        truth.map_or([0.0; MAX_ANALOG], |truth| {
            [truth.cutting_torque_nm, truth.depth_mm, 0.0, 0.0]
        })
    }
}
