//! The greatest speeds of the joints in a run.

use std::collections::BTreeMap;
use std::sync::Arc;

use serde::Serialize;
use tandem_sdk::AxisVector;

use super::JointSpace;
use crate::monitor::raise;

/// What one joint did, as finite differences of the samples; deg for mm where it turns.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct JointPeaks {
    /// Largest |velocity|, mm/s.
    pub max_velocity_mm_s: f64,
    /// Largest |acceleration|, mm/s².
    pub max_acceleration_mm_s2: f64,
    /// Largest |jerk|, mm/s³.
    pub max_jerk_mm_s3: f64,
}

/// Watches the joints of a run, with rest before the first sample.
pub struct JointWatch {
    space: Arc<JointSpace>,
    rate: f64,
    last: Option<[AxisVector; 3]>,
    peaks: [AxisVector; 3],
}

impl JointWatch {
    /// Nothing seen yet; none where the joints are the axes.
    pub fn new(space: &Arc<JointSpace>, period_s: f64) -> Option<Self> {
        let peaks = [AxisVector::ZERO; 3];
        (!space.are_axes()).then(|| Self { space: Arc::clone(space), rate: 1.0 / period_s, last: None, peaks })
    }

    /// A sample was sent.
    pub fn sample(&mut self, command: &AxisVector) {
        let joints = self.space.to_joints(command);
        let [position, velocity, acceleration] = self.last.unwrap_or([joints, AxisVector::ZERO, AxisVector::ZERO]);
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
        let each = self.space.joints.iter().enumerate().map(|(i, joint)| {
            let [max_velocity_mm_s, max_acceleration_mm_s2, max_jerk_mm_s3] =
                self.peaks.map(|peak| if joint.rotary { peak[i].to_degrees() } else { peak[i] });
            (joint.name.clone(), JointPeaks { max_velocity_mm_s, max_acceleration_mm_s2, max_jerk_mm_s3 })
        });
        each.collect()
    }
}
