//! The axis that a drive moves: a position loop around a velocity loop around an inertia.

use super::description::{Cut, DriveDescription};

/// Deceleration by the brake, as a multiple of the rated one.
const BRAKE: f64 = 2.0;
/// Deceleration by friction without torque, as a multiple of the rated one.
const FRICTION: f64 = 0.05;

/// Where an axis is and where it should be, in counts and s.
#[derive(Clone, Debug)]
pub(super) struct Axis {
    pub(super) position: f64,
    pub(super) velocity: f64,
    /// Share of the rated torque.
    pub(super) torque: f64,
    pub(super) demand: f64,
    pub(super) demand_velocity: f64,
    /// What the encoder shows above the place of the switches; homing changes it.
    pub(super) origin: f64,
    /// Torque of the process, against the motor, as a share of the rated one.
    pub(super) load: f64,
    /// The axis does not move, whatever the motor does.
    pub(super) blocked: bool,
}

/// What holds the axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Power {
    /// The motor.
    Motor,
    /// The brake.
    Brake,
    /// Nothing but friction.
    None,
}

impl Axis {
    pub(super) fn new(of: &DriveDescription) -> Self {
        Self {
            position: of.position_counts,
            velocity: 0.0,
            torque: 0.0,
            demand: of.position_counts,
            demand_velocity: 0.0,
            origin: 0.0,
            load: 0.0,
            blocked: false,
        }
    }

    /// Moves for `dt_s`. `feed_forward` is a velocity that needs no error of position, `torque_limit` a share of rated.
    pub(super) fn step(
        &mut self,
        of: &DriveDescription,
        dt_s: f64,
        power: Power,
        feed_forward: f64,
        torque_limit: f64,
    ) {
        let rated = of.rated_acceleration_counts_per_s2;
        let load = self.load + self.cutting(of);
        let acceleration = match power {
            Power::Motor => {
                let asked = of.position_gain_per_s * (self.demand - self.position) + feed_forward;
                let torque = (asked - self.velocity) / of.velocity_lag_s / rated + load;
                self.torque = torque.clamp(-torque_limit, torque_limit);
                (self.torque - load) * rated
            }
            Power::Brake | Power::None => {
                self.torque = 0.0;
                let most = rated
                    * if power == Power::Brake {
                        BRAKE
                    } else {
                        FRICTION
                    };
                -(self.velocity / dt_s).clamp(-most, most)
            }
        };
        self.velocity += acceleration * dt_s;
        if self.blocked {
            self.velocity = 0.0;
        }
        self.position += self.velocity * dt_s;
        if power != Power::Motor {
            self.settle();
        }
    }

    /// Torque of what is cut here at this speed, as a share of the rated one.
    fn cutting(&self, of: &DriveDescription) -> f64 {
        let place = self.place();
        let here = |cut: &&Cut| (cut.from_counts..cut.to_counts).contains(&place);
        let shares = of.cuts.iter().filter(here);
        shares.map(|cut| cut.torque_share_s_per_count).sum::<f64>() * self.velocity
    }

    /// The demand is where the axis is.
    pub(super) fn settle(&mut self) {
        self.demand = self.position;
        self.demand_velocity = 0.0;
    }

    /// Lets the velocity of the demand go towards `velocity`, by at most `acceleration`, and the demand with it.
    pub(super) fn ramp(&mut self, dt_s: f64, velocity: f64, acceleration: f64) {
        let most = acceleration * dt_s;
        let before = self.demand_velocity;
        self.demand_velocity += (velocity - before).clamp(-most, most);
        self.demand += 0.5 * (before + self.demand_velocity) * dt_s;
    }

    /// Position by which switches go.
    pub(super) fn place(&self) -> f64 {
        self.position - self.origin
    }

    /// Calls `place` the position `new`.
    pub(super) fn adopt(&mut self, place: f64, new: f64) {
        let by = new - (place + self.origin);
        self.origin += by;
        self.position += by;
        self.demand += by;
    }
}
