//! What a place of a plan asks of axes and joints when it is driven at another rate.

use tandem_sdk::{Axes, AxisVector, MAX_AXES, Segment, SegmentFlags, derivatives, polynomial};

use super::super::space::JointSpace;

/// How far an axis is moved to see how joints follow, mm or rad: far enough that rounding does not matter in a second difference,
/// near enough that the third derivative does not.
const APART_MM: f64 = 0.05;
const APART_RAD: f64 = 5e-4;

/// Shares of speed and acceleration that planning makes use of. Between the places that are looked at, the joints' motion is not
/// quite what it is there.
const SPEED_SHARE: f64 = 0.998;
const ACCELERATION_SHARE: f64 = 0.995;
/// Share of a joint's acceleration that turning may take: the rest is left to brake with, everywhere.
const TURNING_SHARE: f64 = 0.94;
/// Most of an acceleration that may be kept free, all through a block, to make up for the steps at its ends.
const RESERVE_SHARE: f64 = 0.1;
/// Share of an allowable velocity step.
const STEP_SHARE: f64 = 0.999;

/// Position, velocity and acceleration of the plan in program time, of the axes and behind them of the joints; and how the velocity
/// that is continuous over junctions lies behind the velocity.
#[derive(Clone, Copy, Debug)]
pub struct State {
    pub position: AxisVector,
    pub velocity: AxisVector,
    pub acceleration: AxisVector,
    /// Lead of the velocity over the continuous one, and the rate at which it is taken back.
    pub lead: AxisVector,
    pub takeback: AxisVector,
    /// Path coordinate, its speed and acceleration.
    pub path: [f64; 3],
}

/// One place of the plan. At the rate σ of program time, with w = σ² and u = dσ/dt, an entry accelerates by `bend·w + pace·u`.
#[derive(Clone, Copy, Debug)]
pub struct Point {
    /// Acceleration of each entry at rate 1.
    pub bend: [f64; MAX_AXES],
    /// The part of it that is not along the path.
    pub turning: [f64; MAX_AXES],
    /// Velocity that is continuous over junctions.
    pub pace: [f64; MAX_AXES],
    /// How fast the lead over it is taken back, without its sign.
    pub takeback: [f64; MAX_AXES],
    /// Most acceleration of each entry.
    pub most: [f64; MAX_AXES],
    /// Path speed in program time, mm/s.
    pub path_speed: f64,
    /// The square of the highest rate, for the sake of speeds and steps.
    pub highest: f64,
}

/// Value and first two derivatives of a polynomial.
fn evaluate(c: &[f64; 6], t: f64) -> [f64; 3] {
    let [first, second, _] = derivatives(c, t);
    [polynomial(c, t), first, second]
}

/// How the velocity steps at the ends of a block are made up for. In any window of time the velocity of an entry changes by no more
/// than its acceleration allows and one step; so half of each step is made up for on either side of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Steps {
    /// A long block keeps that much of each acceleration free, whatever its rate: (V/2 + V/2) over its duration, s.
    Reserve(f64),
    /// A short one takes back what the velocity is ahead as the planner does, at its own rate.
    Lead,
}

impl Steps {
    /// Of a block that lasts `block_s` at rate 1, or longer.
    pub fn of(block_s: f64, space: &JointSpace, entries: usize) -> Self {
        let small = space.limits.axes[..entries].iter().all(|limits| {
            limits.speed_difference_mm_per_s
                <= RESERVE_SHARE * limits.acceleration_mm_per_s2 * block_s
        });
        if small {
            Self::Reserve(block_s)
        } else {
            Self::Lead
        }
    }
}

/// How the joints follow from the axes near one place.
struct Local<'a> {
    space: &'a JointSpace,
    axes: &'a Axes,
    at: AxisVector,
    joints: AxisVector,
}

impl Local<'_> {
    /// By how much `direction` is to be scaled so that the place beside is as far away as it should be; `None` where nothing moves.
    fn scale(&self, direction: &AxisVector) -> Option<f64> {
        let share = (0..self.axes.count()).map(|axis| {
            let apart = if self.axes.is_rotary(axis) {
                APART_RAD
            } else {
                APART_MM
            };
            direction[axis].abs() / apart
        });
        let most = share.fold(0.0, f64::max);
        (most > 0.0).then(|| 1.0 / most)
    }

    fn beside(&self, direction: &AxisVector, scale: f64) -> AxisVector {
        self.space.to_joints(&(self.at + *direction * scale))
    }

    /// First derivative of the joints along `direction`.
    fn first(&self, direction: &AxisVector) -> AxisVector {
        let Some(scale) = self.scale(direction) else {
            return AxisVector::ZERO;
        };
        (self.beside(direction, scale) - self.beside(direction, -scale)) * (0.5 / scale)
    }

    /// Second derivative of the joints along `direction`.
    fn second(&self, direction: &AxisVector) -> AxisVector {
        let Some(scale) = self.scale(direction) else {
            return AxisVector::ZERO;
        };
        let around = self.beside(direction, scale) + self.beside(direction, -scale);
        (around - self.joints * 2.0) * (1.0 / (scale * scale))
    }
}

/// Puts `joints` behind the `axes` first entries of `vector`.
fn behind(vector: &mut AxisVector, axes: usize, joints: &AxisVector, count: usize) {
    vector.0[axes..axes + count].copy_from_slice(&joints.0[..count]);
}

impl State {
    /// The plan in `segment` at its local time `t_s`.
    pub fn of(segment: &Segment, t_s: f64, space: &JointSpace, axes: &Axes) -> Self {
        let count = axes.count();
        let joints = space.count();
        let [mut position, mut velocity, mut acceleration] = [AxisVector::ZERO; 3];
        for (axis, coefficients) in segment.coefficients[..count].iter().enumerate() {
            [position[axis], velocity[axis], acceleration[axis]] = evaluate(coefficients, t_s);
        }
        let (mut lead, mut takeback) = (AxisVector::ZERO, AxisVector::ZERO);
        for axis in 0..count {
            takeback[axis] = segment.step_acceleration[axis];
            lead[axis] = segment.step_velocity[axis] - takeback[axis] * t_s;
        }
        let local = Local {
            space,
            axes,
            at: position,
            joints: space.to_joints(&position),
        };
        let (joint_lead, along) = (local.first(&lead), local.first(&velocity));
        let turned = local.second(&velocity);
        let joint_acceleration = local.first(&acceleration) + turned;
        // The continuous velocity of a joint is J·g, with g that of the axes: its rate is J·g′ + (dJ/dτ)·g, and with g the velocity
        // less its lead the second part is that of the velocity less what the lead has of it.
        let bend_of_lead = if lead == AxisVector::ZERO {
            AxisVector::ZERO
        } else {
            (local.second(&(velocity + lead)) - local.second(&(velocity - lead))) * 0.25
        };
        let joint_takeback = local.first(&takeback) - bend_of_lead;
        behind(&mut position, count, &local.joints, joints);
        behind(&mut velocity, count, &along, joints);
        behind(&mut acceleration, count, &joint_acceleration, joints);
        behind(&mut lead, count, &joint_lead, joints);
        behind(&mut takeback, count, &joint_takeback, joints);
        // Kinematics that have failed tell nothing that could be planned with. The guard asks them again, and says so.
        for joint in count..count + joints {
            let mut all = [
                &mut position,
                &mut velocity,
                &mut acceleration,
                &mut lead,
                &mut takeback,
            ];
            if all.iter().any(|vector| !vector[joint].is_finite()) {
                for vector in &mut all {
                    vector[joint] = 0.0;
                }
            }
        }
        Self {
            position,
            velocity,
            acceleration,
            lead,
            takeback,
            path: evaluate(&segment.path, t_s),
        }
    }
}

impl Point {
    /// What the plan in `segment` asks for at its local time `t_s`. At a `junction` the velocity may step.
    pub fn of(
        segment: &Segment,
        (t_s, junction): (f64, bool),
        steps: Steps,
        space: &JointSpace,
        axes: &Axes,
    ) -> Self {
        let state = State::of(segment, t_s, space, axes);
        let rapid = segment.flags.contains(SegmentFlags::RAPID);
        let [_, path_speed, path_acceleration] = state.path;
        let mut point = Self {
            bend: [0.0; MAX_AXES],
            turning: [0.0; MAX_AXES],
            pace: [0.0; MAX_AXES],
            takeback: [0.0; MAX_AXES],
            most: [f64::INFINITY; MAX_AXES],
            path_speed,
            highest: 1.0,
        };
        let along = if path_speed > 0.0 {
            path_acceleration / path_speed
        } else {
            0.0
        };
        for entry in 0..axes.count() + space.count() {
            let limits = &space.limits.axes[entry];
            let reserve = match steps {
                Steps::Reserve(block_s) => limits.speed_difference_mm_per_s / block_s,
                Steps::Lead => 0.0,
            };
            let [lead, takeback] = match steps {
                Steps::Reserve(_) => [0.0; 2],
                Steps::Lead => [state.lead[entry], state.takeback[entry]],
            };
            let bend = state.acceleration[entry] + takeback;
            let pace = state.velocity[entry] - lead;
            if !(bend.is_finite() && pace.is_finite()) {
                continue;
            }
            point.bend[entry] = bend;
            point.pace[entry] = pace;
            point.takeback[entry] = takeback.abs();
            if path_speed > 0.0 {
                point.turning[entry] = bend - along * state.velocity[entry];
            }
            let most = ACCELERATION_SHARE * limits.acceleration_mm_per_s2 - reserve;
            if entry < axes.count() {
                // The planner has kept the limits of the axes: at rate 1 the plan is right as it is.
                point.most[entry] = most.max(bend.abs());
                continue;
            }
            point.most[entry] = most;
            let fastest = if rapid {
                limits.rapid_mm_per_s
            } else {
                limits.feed_mm_per_s
            };
            let step = limits.speed_difference_mm_per_s;
            let mut lower = |highest: f64| point.highest = point.highest.min(highest);
            lower((SPEED_SHARE * fastest / state.velocity[entry]).powi(2));
            lower(TURNING_SHARE * limits.acceleration_mm_per_s2 / point.turning[entry].abs());
            if state.lead[entry] != 0.0 && (junction || steps == Steps::Lead) {
                lower((STEP_SHARE * step / (2.0 * state.lead[entry])).powi(2));
            }
        }
        point
    }

    /// Path deceleration that is left at the square of the rate `square`, mm/s².
    pub fn deceleration(&self, square: f64) -> f64 {
        let left = (0..MAX_AXES).map(|entry| {
            let left = self.most[entry] - self.turning[entry].abs() * square;
            left / self.pace[entry].abs()
        });
        // Of 0/0 and of what has no limit nothing is asked.
        let least = left
            .filter(|left| *left >= 0.0)
            .fold(f64::INFINITY, f64::min);
        least * self.path_speed
    }
}
