//! Ends of the way that joints run into: what stands there stands, and its drive pushes.

use serde::{Deserialize, Serialize};
use tandem_sdk::{AxisVector, DriverContext, MAX_AXES, PluginError};

use crate::options::refusal;
use crate::power::Power;

/// Fault code of a joint whose drive pushes against a hard stop with more torque than it may.
pub const TORQUE_FAULT: u32 = 2;

/// Torque with which a drive pushes for each mm (rad) that its joint is told to be beyond a hard stop, percent of the rated one:
/// a stiff position loop is at its rated torque within a millimetre.
const PERCENT_PER_MM: f64 = 100.0;

/// Torque that a drive has beside a limit, percent of the rated one: what servo drives give for seconds.
const PEAK_PERCENT: f64 = 300.0;

/// An end of the way of one joint, where it really stands.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HardStop {
    /// Number of the joint, from 0.
    pub joint: usize,
    /// It comes no further than this, mm (rad for a rotary joint).
    #[serde(default)]
    pub above_mm: Option<f64>,
    /// The same on the other side.
    #[serde(default)]
    pub below_mm: Option<f64>,
}

impl HardStop {
    pub(crate) fn check(&self) -> Result<(), PluginError> {
        let refuse = |words: &str| Err(refusal("hard_stops", words));
        if self.joint >= MAX_AXES {
            return refuse(&format!(
                "joint = {}: a machine has 8 joints at most",
                self.joint
            ));
        }
        match (self.above_mm, self.below_mm) {
            (Some(at), None) | (None, Some(at)) if at.is_finite() => Ok(()),
            _ => refuse("a hard stop has one of above_mm and below_mm, a number"),
        }
    }
}

/// All of them, and what the drives may push with.
#[derive(Clone, Debug)]
pub(crate) struct HardStops {
    stops: Vec<HardStop>,
    /// Torque of each joint while it is homed, percent.
    homing_percent: [f64; MAX_AXES],
}

impl HardStops {
    /// No drive has a limit of its own. Host; allocates.
    pub fn new(stops: &[HardStop]) -> Self {
        Self {
            stops: stops.to_vec(),
            homing_percent: [f64::INFINITY; MAX_AXES],
        }
    }

    /// The driver is opened for these joints.
    pub fn open(&mut self, context: &DriverContext) {
        self.homing_percent = context.joints.map(|joint| joint.homing_torque_percent);
    }

    /// Leaves in `to` where the joints come that are told to be there, both as their drives read it: `shift` is what they stand beside
    /// that. A drive that pushes with more than it may goes into its fault; those in `limited` are homed. Fine loop.
    pub fn press(
        &self,
        to: &mut AxisVector,
        shift: &AxisVector,
        limited: u32,
        powers: &mut [Power],
    ) {
        if self.stops.is_empty() {
            return;
        }
        let told = *to;
        for stop in &self.stops {
            let Some(power) = powers.get_mut(stop.joint) else {
                continue;
            };
            let real = told[stop.joint] + shift[stop.joint];
            let end = stop
                .above_mm
                .map(|at| real.min(at))
                .or(stop.below_mm.map(|at| real.max(at)));
            let Some(end) = end.filter(|end| *end != real) else {
                continue;
            };
            to[stop.joint] = end - shift[stop.joint];
            let homing = if limited >> stop.joint & 1 == 1 {
                self.homing_percent[stop.joint]
            } else {
                f64::INFINITY
            };
            if (real - end).abs() * PERCENT_PER_MM > homing.min(PEAK_PERCENT) {
                power.fail(TORQUE_FAULT);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tandem_sdk::JointState;

    #[test]
    fn a_joint_stays_at_its_stop_and_its_drive_pushes_as_far_as_it_may() {
        let stop = HardStop {
            joint: 1,
            above_mm: None,
            below_mm: Some(-10.0),
        };
        let mut stops = HardStops::new(&[stop]);
        let mut context = DriverContext::new(2, 0.001);
        context.joints[1].homing_torque_percent = 20.0;
        stops.open(&context);
        let shift = AxisVector::from_slice(&[0.0, 3.0]);
        for (to_mm, limited, reached_mm, fails) in [
            (-12.0, 0b10, -12.0, false),
            (-13.1, 0b10, -13.0, false),
            (-13.3, 0b10, -13.0, true),
            (-13.3, 0b01, -13.0, false),
            (-16.1, 0b00, -13.0, true),
        ] {
            let mut powers = [Power::new(0, 0); 2];
            let mut reached = AxisVector::from_slice(&[-50.0, to_mm]);
            stops.press(&mut reached, &shift, limited, &mut powers);
            assert_eq!((reached[0], reached[1]), (-50.0, reached_mm));
            assert_eq!(
                powers[1].state() == JointState::Fault,
                fails,
                "{to_mm} {limited}"
            );
        }
    }

    #[test]
    fn a_stop_has_one_side() {
        let of = |above_mm, below_mm| {
            HardStop {
                joint: 0,
                above_mm,
                below_mm,
            }
            .check()
        };
        assert!(of(Some(1.0), None).is_ok() && of(None, Some(-1.0)).is_ok());
        assert!(
            of(None, None).is_err()
                && of(Some(1.0), Some(-1.0)).is_err()
                && of(Some(f64::NAN), None).is_err()
        );
    }
}
