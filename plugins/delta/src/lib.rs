//! A platform on three pairs of rods whose carriages slide on upright columns: the kinematics `delta`.
//!
//! The columns stand evenly around the axis of the third axis, the first one where the first axis is greatest. A joint is the
//! height of its carriage, from which the rods lead down to the platform: where all three are at the same height the platform
//! hangs in the middle. Every further axis is its own joint.
//!
//! ```toml
//! [kinematics]
//! plugin = "delta"
//! [kinematics.options]
//! axes = ["x", "y", "z"]   # the default
//! rod_mm = 300
//! radius_mm = 150          # from rod end to rod end, in the plane, with the platform in the middle
//!
//! [joints.a]
//! max_feed_mm_per_min = 12000
//! max_acceleration_mm_per_s2 = 2000
//! [joints.b]
//! max_feed_mm_per_min = 12000
//! max_acceleration_mm_per_s2 = 2000
//! [joints.c]
//! max_feed_mm_per_min = 12000
//! max_acceleration_mm_per_s2 = 2000
//! ```

use std::f64::consts::TAU;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};

use tandem_sdk::{AxisVector, Kinematics, KinematicsContext, PluginError};

tandem_sdk::plugin!(kinematics "delta" = Delta::new);

tandem_sdk::options! {
    /// The keys of `[kinematics.options]`.
    pub struct Options {
        /// The two axes of the plane and the one along the columns; the carriages take their places.
        pub axes: [char; 3] = ['x', 'y', 'z'],
        /// Length of a rod, mm. It is to be stated.
        pub rod_mm: f64 = 0.0,
        /// How far a rod reaches in the plane with the platform in the middle, mm. It is to be stated.
        pub radius_mm: f64 = 0.0,
    }
}

/// The map: heights of three carriages. A place that a rod does not reach has none.
#[derive(Debug)]
pub struct Delta {
    axes: [usize; 3],
    rod_mm: f64,
    columns_mm: [[f64; 2]; 3],
    /// A place that a rod does not reach has been asked for.
    missed: AtomicBool,
}

impl Delta {
    /// The map on a machine with the axes of `context`. Host.
    ///
    /// # Errors
    /// An axis that the machine does not have, that turns, or is named twice; rods that do not reach the middle.
    pub fn new(options: &Options, context: &KinematicsContext) -> Result<Self, PluginError> {
        let axes = context.linear_axes("axes", options.axes)?;
        let (rod_mm, radius_mm) = (options.rod_mm, options.radius_mm);
        if !(1e-3..=1e6).contains(&radius_mm) {
            let words = format!("{radius_mm}: must be 0.001 to 1000000");
            return Err(PluginError::of_option("radius_mm", words));
        }
        if !(rod_mm > radius_mm && rod_mm <= 1e6) {
            let words = format!("{rod_mm}: must be longer than radius_mm, {radius_mm}");
            return Err(PluginError::of_option("rod_mm", words));
        }
        let column = |number: usize| {
            let (sin, cos) = (TAU * number as f64 / 3.0).sin_cos();
            [radius_mm * cos, radius_mm * sin]
        };
        Ok(Self {
            axes,
            rod_mm,
            columns_mm: std::array::from_fn(column),
            missed: AtomicBool::new(false),
        })
    }
}

impl Kinematics for Delta {
    fn to_joints(&self, axes: &AxisVector) -> AxisVector {
        let mut joints = *axes;
        let [x, y, z] = self.axes.map(|axis| axes[axis]);
        for (joint, [at_x, at_y]) in self.axes.iter().zip(&self.columns_mm) {
            let plane = (x - at_x).powi(2) + (y - at_y).powi(2);
            let over = self.rod_mm * self.rod_mm - plane;
            if over < 0.0 {
                self.missed.store(true, Relaxed);
            }
            joints[*joint] = z + over.sqrt();
        }
        joints
    }

    /// The platform is where three spheres about the carriages meet, below them.
    fn to_axes(&self, joints: &AxisVector) -> AxisVector {
        let mut axes = *joints;
        let heights = self.axes.map(|axis| joints[axis]);
        let point = |i: usize| {
            let [x, y] = self.columns_mm[i];
            [x, y, heights[i]]
        };
        // Points as far from the first carriage as from another lie in a plane. Both planes give x and y as linear in z.
        let square = |p: [f64; 3]| p[0] * p[0] + p[1] * p[1] + p[2] * p[2];
        let first = point(0);
        let row = |i: usize| {
            let other = point(i);
            let half = (square(other) - square(first)) / 2.0;
            [
                other[0] - first[0],
                other[1] - first[1],
                other[2] - first[2],
                half,
            ]
        };
        let (one, two) = (row(1), row(2));
        let determinant = one[0] * two[1] - one[1] * two[0];
        let solved = |a: f64, b: f64| {
            let x = (a * two[1] - one[1] * b) / determinant;
            let y = (one[0] * b - a * two[0]) / determinant;
            [x, y]
        };
        let [x0, y0] = solved(one[3], two[3]);
        let [x1, y1] = solved(-one[2], -two[2]);
        // On the sphere about the first: a quadratic in z, of which the lower solution is the platform.
        let (dx, dy) = (x0 - first[0], y0 - first[1]);
        let a = x1 * x1 + y1 * y1 + 1.0;
        let b = dx * x1 + dy * y1 - first[2];
        let c = dx * dx + dy * dy + first[2] * first[2] - self.rod_mm * self.rod_mm;
        let z = (-b - (b * b - a * c).sqrt()) / a;
        let [to_x, to_y, to_z] = self.axes;
        axes[to_x] = x0 + x1 * z;
        axes[to_y] = y0 + y1 * z;
        axes[to_z] = z;
        axes
    }

    fn health(&self) -> Result<(), PluginError> {
        if self.missed.load(Relaxed) {
            return Err(PluginError::fixed("a rod does not reach that far"));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tandem_sdk::Axes;

    fn made(options: &str) -> Result<Box<dyn Kinematics>, PluginError> {
        let axes = Axes::new(&[('X', false), ('Y', false), ('Z', false), ('A', true)]).unwrap();
        PLUGIN.kinematics(options, &KinematicsContext::new(axes))
    }

    #[test]
    fn carriages_lead_to_the_platform_and_back() {
        let map = made("rod_mm = 250\nradius_mm = 150").unwrap();
        let middle = map.to_joints(&AxisVector::from_slice(&[0.0, 0.0, -5.0, 1.0]));
        for height in &middle.0[..3] {
            assert!((height - 195.0).abs() < 1e-9, "{middle:?}");
        }
        assert_eq!(middle[3], 1.0);
        for place in [[60.0, -30.0, 10.0], [-80.0, 5.0, -40.0], [0.0, 90.0, 0.0]] {
            let back = map.to_axes(&map.to_joints(&AxisVector::from_slice(&place)));
            for axis in 0..3 {
                assert!(
                    (back[axis] - place[axis]).abs() < 1e-9,
                    "{place:?}: {back:?}"
                );
            }
        }
        assert!(map.to_joints(&AxisVector::from_slice(&[-150.0, 0.0]))[0].is_nan());
        assert!(map.health().unwrap_err().to_string().contains("rod"));
    }

    #[test]
    fn rods_reach_the_middle() {
        for (options, word) in [
            ("rod_mm = 100\nradius_mm = 100", "rod_mm"),
            ("rod_mm = 100", "radius_mm"),
            (
                "rod_mm = 250\nradius_mm = 150\naxes = [\"x\", \"y\", \"a\"]",
                "linear axis a",
            ),
            (
                "rod_mm = 250\nradius_mm = 150\naxes = [\"x\", \"y\", \"y\"]",
                "twice",
            ),
        ] {
            let words = made(options).err().expect(options).to_string();
            assert!(words.contains(word), "{words}");
        }
    }
}
