//! A linear axis wrapped around a rotary table: the kinematics `wrapped-rotary`.
//!
//! The program speaks of the developed surface of a cylinder, in mm; the joint of that axis is the table, which turns by
//! `position / radius`. A feed along the path is then the feed along the surface: on the cylinder it is the tangential feed,
//! whatever mixture of table and slides makes it, and circles and curves in the plane of that axis lie on the surface too.
//! Every other axis is its own joint.
//!
//! ```toml
//! [kinematics]
//! plugin = "wrapped-rotary"
//! [kinematics.options]
//! axis = "y"               # the axis that is wrapped
//! radius_mm = 30           # of the surface that is cut
//!
//! [joints.x]
//! axis = "x"
//! [joints.a]               # the table
//! kind = "rotary"
//! max_feed_deg_per_min = 7200
//! max_acceleration_deg_per_s2 = 1000
//! ```

use tandem_sdk::{AxisVector, Kinematics, KinematicsContext, PluginError};

tandem_sdk::plugin!(kinematics "wrapped-rotary" = WrappedRotary::new);

tandem_sdk::options! {
    /// The keys of `[kinematics.options]`.
    pub struct Options {
        /// The linear axis that is wrapped; its joint is the table.
        pub axis: char = 'y',
        /// Radius of the surface, mm; negative where the table turns the other way. It is to be stated.
        pub radius_mm: f64 = 0.0,
    }
}

/// The map: one joint is its axis by the radius, rad.
#[derive(Clone, Copy, Debug)]
pub struct WrappedRotary {
    axis: usize,
    radius_mm: f64,
}

impl WrappedRotary {
    /// The map on a machine with the axes of `context`. Host.
    ///
    /// # Errors
    /// An axis that the machine does not have, or that turns by itself; a radius of nothing.
    pub fn new(options: &Options, context: &KinematicsContext) -> Result<Self, PluginError> {
        let [axis] = context.linear_axes("axis", [options.axis])?;
        let radius_mm = options.radius_mm;
        if !(1e-3..=1e6).contains(&radius_mm.abs()) {
            return Err(PluginError::of_option(
                "radius_mm",
                format!("{radius_mm}: must be 0.001 to 1000000"),
            ));
        }
        Ok(Self { axis, radius_mm })
    }
}

impl Kinematics for WrappedRotary {
    fn to_joints(&self, axes: &AxisVector) -> AxisVector {
        let mut joints = *axes;
        joints[self.axis] = axes[self.axis] / self.radius_mm;
        joints
    }

    fn to_axes(&self, joints: &AxisVector) -> AxisVector {
        let mut axes = *joints;
        axes[self.axis] = joints[self.axis] * self.radius_mm;
        axes
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;
    use tandem_sdk::Axes;

    fn made(options: &str) -> Result<Box<dyn Kinematics>, PluginError> {
        let axes = Axes::new(&[('X', false), ('Y', false), ('B', true)]).unwrap();
        PLUGIN.kinematics(options, &KinematicsContext::new(axes))
    }

    #[test]
    fn half_a_circumference_is_half_a_turn() {
        let map = made("axis = \"y\"\nradius_mm = 20").unwrap();
        let joints = map.to_joints(&AxisVector::from_slice(&[5.0, 20.0 * PI, 1.0]));
        assert_eq!(joints, AxisVector::from_slice(&[5.0, PI, 1.0]));
        assert_eq!(
            map.to_axes(&joints),
            AxisVector::from_slice(&[5.0, 20.0 * PI, 1.0])
        );
    }

    #[test]
    fn options_are_checked() {
        let cases = [
            ("axis = \"b\"\nradius_mm = 1", "linear axis b"),
            ("axis = \"y\"", "radius_mm: 0: must be"),
            ("axis = \"y\"\nradius_mm = nan", "radius_mm: NaN: must be"),
            ("axis = \"y\"\nradius = 1", "radius"),
        ];
        for (options, word) in cases {
            let words = made(options).err().expect(options).to_string();
            assert!(words.contains(word), "{words}");
        }
    }
}
