//! Servo axes with a motor, a screw, friction and an encoder, and the cutting process that loads them.
//!
//! Torques are at the motor shaft, N·m; the cutting force reaches it through the screw. The plant is integrated in
//! steps of [`PLANT_STEP_S`] with semi-implicit Euler: speed first, then angle. After the model of Song, Son, Kwon and Kim,
//! "Control of a CNC Machining Center Using the Indirect Measurement of the Cutting Force".

mod axis;
mod cutting;
mod friction;
mod joints;
mod options;
mod workpiece;

pub use axis::ServoAxis;
pub use cutting::Cutting;
pub use friction::Friction;
pub use options::{CuttingOptions, ServoOptions};
pub use workpiece::{Profile, Random, Workpiece};

pub(crate) use joints::ServoJoints;

/// Step of the simulated plant, s.
pub const PLANT_STEP_S: f64 = 1e-4;
