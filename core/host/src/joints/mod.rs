//! What the drives move, and what that asks of everything before them: joints, their limits, their travel.
//!
//! Kinematics that are linear in the axes, which is found out here, are kept by planning. A joint that is a scaled axis
//! makes the limits of that axis narrower. A joint that is a sum of axes becomes a lane behind the axes, which planners,
//! governor and guard treat like an axis ([`tandem_sdk::JointLanes`]). Other kinematics are planned by the limits of the axes
//! alone; the guard judges their joints.

mod coupled;
mod fold;
mod joint;
mod linear;
mod space;
mod stated;
mod travel;

pub use coupled::CoupledJoints;
pub use space::JointSpace;
