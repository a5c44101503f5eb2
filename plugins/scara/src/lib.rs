//! An arm of two links that turn in one plane: the kinematics `scara`.
//!
//! The upper arm turns about the shoulder, which stands in the plane of two axes; the forearm turns about the elbow at its end and
//! carries the tool. Both angles are 0 where the arm is stretched along the first axis; that of the elbow is the forearm's against
//! the upper arm. Every further axis is its own joint.
//!
//! ```toml
//! [kinematics]
//! plugin = "scara"
//! [kinematics.options]
//! axes = ["x", "y"]        # the default: the plane of the arm
//! upper_arm_mm = 200
//! forearm_mm = 160
//! shoulder_mm = [0, -250]  # machine coordinates
//! elbow = "left"           # on which side of the line from shoulder to tool, seen from the shoulder
//!
//! [joints.shoulder]
//! kind = "rotary"
//! max_feed_deg_per_min = 7200
//! max_acceleration_deg_per_s2 = 1000
//! [joints.elbow]
//! kind = "rotary"
//! max_feed_deg_per_min = 7200
//! max_acceleration_deg_per_s2 = 1000
//! [joints.z]
//! axis = "z"
//! ```

use std::sync::atomic::{AtomicBool, Ordering::Relaxed};

use serde::{Deserialize, Serialize};
use tandem_sdk::{AxisVector, Kinematics, KinematicsContext, PluginError};

tandem_sdk::plugin!(kinematics "scara" = Scara::new);

/// Which way the elbow is bent.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Elbow {
    /// It lies to the left of the line from the shoulder to the tool.
    #[default]
    Left,
    /// It lies to the right.
    Right,
}

tandem_sdk::options! {
    /// The keys of `[kinematics.options]`.
    pub struct Options {
        /// The two axes of the plane; their joints, shoulder and elbow, take their places.
        pub axes: [char; 2] = ['x', 'y'],
        /// Shoulder to elbow, mm. It is to be stated.
        pub upper_arm_mm: f64 = 0.0,
        /// Elbow to tool, mm. It is to be stated.
        pub forearm_mm: f64 = 0.0,
        /// The shoulder in the plane, machine coordinates, mm.
        pub shoulder_mm: [f64; 2] = [0.0, 0.0],
        /// The side of the line from shoulder to tool on which the elbow lies.
        pub elbow: Elbow = Elbow::Left,
    }
}

/// The map: two angles for a place in the plane. A place beyond the reach, or nearer than the folded arm, has none.
#[derive(Debug)]
pub struct Scara {
    axes: [usize; 2],
    upper_mm: f64,
    fore_mm: f64,
    shoulder_mm: [f64; 2],
    /// Sign of the elbow's angle: an elbow to the left of the line is bent to the right.
    bend: f64,
    /// A place without angles has been asked for.
    missed: AtomicBool,
}

impl Scara {
    /// The map on a machine with the axes of `context`. Host.
    ///
    /// # Errors
    /// An axis that the machine does not have, that turns, or is named twice; a link of no length.
    pub fn new(options: &Options, context: &KinematicsContext) -> Result<Self, PluginError> {
        let axes = context.linear_axes("axes", options.axes)?;
        let links = [
            ("upper_arm_mm", options.upper_arm_mm),
            ("forearm_mm", options.forearm_mm),
        ];
        for (name, length_mm) in links {
            if !(1e-3..=1e6).contains(&length_mm) {
                let words = format!("{length_mm}: must be 0.001 to 1000000");
                return Err(PluginError::of_option(name, words));
            }
        }
        Ok(Self {
            axes,
            upper_mm: options.upper_arm_mm,
            fore_mm: options.forearm_mm,
            shoulder_mm: options.shoulder_mm,
            bend: match options.elbow {
                Elbow::Left => -1.0,
                Elbow::Right => 1.0,
            },
            missed: AtomicBool::new(false),
        })
    }
}

impl Kinematics for Scara {
    fn to_joints(&self, axes: &AxisVector) -> AxisVector {
        let ([first, second], mut joints) = (self.axes, *axes);
        let x = axes[first] - self.shoulder_mm[0];
        let y = axes[second] - self.shoulder_mm[1];
        let (upper, fore) = (self.upper_mm, self.fore_mm);
        let cos = (x * x + y * y - upper * upper - fore * fore) / (2.0 * upper * fore);
        // Beyond the reach the root is no number, and so are the angles.
        let sin = self.bend * (1.0 - cos * cos).sqrt();
        if sin.is_nan() {
            self.missed.store(true, Relaxed);
        }
        joints[second] = sin.atan2(cos);
        joints[first] = y.atan2(x) - (fore * sin).atan2(upper + fore * cos);
        joints
    }

    fn to_axes(&self, joints: &AxisVector) -> AxisVector {
        let ([shoulder, elbow], mut axes) = (self.axes, *joints);
        let (sin, cos) = joints[shoulder].sin_cos();
        let (fore_sin, fore_cos) = (joints[shoulder] + joints[elbow]).sin_cos();
        axes[shoulder] = self.shoulder_mm[0] + self.upper_mm * cos + self.fore_mm * fore_cos;
        axes[elbow] = self.shoulder_mm[1] + self.upper_mm * sin + self.fore_mm * fore_sin;
        axes
    }

    fn health(&self) -> Result<(), PluginError> {
        if self.missed.load(Relaxed) {
            return Err(PluginError::fixed(
                "the arm does not reach that far, or not that near",
            ));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;
    use tandem_sdk::Axes;

    fn made(options: &str) -> Result<Box<dyn Kinematics>, PluginError> {
        let axes = Axes::new(&[('X', false), ('Y', false), ('Z', false), ('A', true)]).unwrap();
        PLUGIN.kinematics(options, &KinematicsContext::new(axes))
    }

    #[test]
    fn the_elbow_lies_on_the_side_that_is_stated() {
        let at = AxisVector::from_slice(&[200.0, 100.0, 7.0, 1.0]);
        for (side, bend) in [("left", -0.5 * PI), ("right", 0.5 * PI)] {
            let options = format!("upper_arm_mm = 200\nforearm_mm = 100\nelbow = \"{side}\"");
            let map = made(&options).unwrap();
            let joints = map.to_joints(&at);
            assert!((joints[1] - bend).abs() < 1e-12, "{side}: {joints:?}");
            let back = map.to_axes(&joints);
            assert!((back[0] - 200.0).abs() < 1e-12 && (back[1] - 100.0).abs() < 1e-12);
            assert_eq!((joints[2], joints[3]), (7.0, 1.0));
        }
        let map = made("upper_arm_mm = 200\nforearm_mm = 100\nshoulder_mm = [-1, 3]").unwrap();
        assert!(map.to_joints(&AxisVector::from_slice(&[299.1, 3.0]))[0].is_nan());
        assert!(map.health().unwrap_err().to_string().contains("reach"));
        assert!(map.to_joints(&AxisVector::from_slice(&[298.9, 3.0]))[0].is_finite());
    }

    #[test]
    fn what_is_no_arm_is_refused() {
        for (options, word) in [
            ("upper_arm_mm = 200", "forearm_mm"),
            (
                "upper_arm_mm = 200\nforearm_mm = 100\naxes = [\"x\", \"a\"]",
                "linear axis a",
            ),
            (
                "upper_arm_mm = 200\nforearm_mm = 100\naxes = [\"x\", \"x\"]",
                "twice",
            ),
            (
                "upper_arm_mm = 200\nforearm_mm = 100\nelbow = \"up\"",
                "elbow",
            ),
        ] {
            let words = made(options).err().expect(options).to_string();
            assert!(words.contains(word), "{words}");
        }
    }
}
