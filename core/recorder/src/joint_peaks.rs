//! The greatest speeds of the joints in a run.

use std::collections::BTreeMap;

use serde::Serialize;
use tandem_sdk::AxisVector;

/// What one joint did, as finite differences of the samples: the largest magnitudes. What it is called names its unit.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum JointPeaks {
    /// A joint that slides.
    Linear {
        /// Largest |velocity|, mm/s.
        max_velocity_mm_s: f64,
        /// Largest |acceleration|, mm/s².
        max_acceleration_mm_s2: f64,
        /// Largest |jerk|, mm/s³.
        max_jerk_mm_s3: f64,
    },
    /// A joint that turns.
    Rotary {
        /// Largest |velocity|, deg/s.
        max_velocity_deg_s: f64,
        /// Largest |acceleration|, deg/s².
        max_acceleration_deg_s2: f64,
        /// Largest |jerk|, deg/s³.
        max_jerk_deg_s3: f64,
    },
}

impl JointPeaks {
    /// Velocity, acceleration and jerk, mm and s.
    fn linear([max_velocity_mm_s, max_acceleration_mm_s2, max_jerk_mm_s3]: [f64; 3]) -> Self {
        Self::Linear {
            max_velocity_mm_s,
            max_acceleration_mm_s2,
            max_jerk_mm_s3,
        }
    }

    /// Velocity, acceleration and jerk, rad and s.
    fn rotary(peaks: [f64; 3]) -> Self {
        let [max_velocity_deg_s, max_acceleration_deg_s2, max_jerk_deg_s3] =
            peaks.map(f64::to_degrees);
        Self::Rotary {
            max_velocity_deg_s,
            max_acceleration_deg_s2,
            max_jerk_deg_s3,
        }
    }
}

/// A joint that is watched.
#[derive(Clone, Debug)]
pub struct WatchedJoint {
    /// Its name.
    pub name: String,
    /// Whether it turns.
    pub rotary: bool,
}

/// Where the joints stand while the axes stand somewhere, mm or rad.
type ToJoints = Box<dyn Fn(&AxisVector) -> AxisVector + Send>;

/// Watches the joints of a run, with rest before the first sample.
pub struct JointWatch {
    joints: Vec<WatchedJoint>,
    to_joints: ToJoints,
    rate: f64,
    last: Option<[AxisVector; 3]>,
    peaks: [AxisVector; 3],
}

impl JointWatch {
    /// Nothing seen yet of `joints`, which stand at `to_joints` of where the axes stand. Host; allocates.
    pub fn new(
        joints: Vec<WatchedJoint>,
        to_joints: impl Fn(&AxisVector) -> AxisVector + Send + 'static,
        period_s: f64,
    ) -> Self {
        let peaks = [AxisVector::ZERO; 3];
        Self {
            joints,
            to_joints: Box::new(to_joints),
            rate: 1.0 / period_s,
            last: None,
            peaks,
        }
    }

    /// A sample was sent.
    pub fn sample(&mut self, command: &AxisVector) {
        let joints = (self.to_joints)(command);
        let [position, velocity, acceleration] =
            self.last
                .unwrap_or([joints, AxisVector::ZERO, AxisVector::ZERO]);
        let speed = (joints - position) * self.rate;
        let change = (speed - velocity) * self.rate;
        let jerk = (change - acceleration) * self.rate;
        for (peak, now) in self.peaks.iter_mut().zip([&speed, &change, &jerk]) {
            raise(peak, now);
        }
        self.last = Some([joints, speed, change]);
    }

    /// Peaks by the names of the joints.
    pub fn peaks(&self) -> BTreeMap<String, JointPeaks> {
        let each = self.joints.iter().enumerate().map(|(i, joint)| {
            let peaks = self.peaks.map(|peak| peak[i]);
            (
                joint.name.clone(),
                if joint.rotary {
                    JointPeaks::rotary(peaks)
                } else {
                    JointPeaks::linear(peaks)
                },
            )
        });
        each.collect()
    }
}

/// Raises every entry of `peak` to the magnitude of the entry of `now`, where that is a larger number.
fn raise(peak: &mut AxisVector, now: &AxisVector) {
    for (peak, now) in peak.0.iter_mut().zip(now.0) {
        *peak = larger(*peak, now.abs());
    }
}

/// The larger number; the first where the second is none.
pub(crate) fn larger(most: f64, value: f64) -> f64 {
    if value > most { value } else { most }
}
