//! What the drives move, and what that asks of everything before them: joints, their limits, their travel.
//!
//! Kinematics that are linear in the axes, which is found out here, are kept by planning. A joint that is a scaled axis
//! makes the limits of that axis narrower. A joint that is a sum of axes becomes an entry after the axes, which planners,
//! governor and guard treat like an axis ([`tandem_sdk::JointLanes`]). Of other kinematics the planner knows the limits of the axes
//! alone, and its plan is driven as fast as the joints allow (`curved`); the guard judges what the kinematics say.
//!
//! # Joints that are sums of axes
//!
//! A joint limit on a `CoreXY` couples two axes: |x″ + y″| ≤ A. There are three ways to keep it. Limits per axis that are
//! narrow enough for every direction (A/2 each) waste most of the machine. A function of position and direction that a
//! planner asks knows nothing of curvature, of the jerk of a junction, or of two blocks that overlap. What is done
//! instead uses that everything a planner makes of a linear map is linear: directions, their steps at corners,
//! curvature, control points, polynomials. So the joint is a further entry of every vector, after the axes,
//! and its limits stand behind those of the axes. A planner that keeps the limits of each entry keeps those of the
//! joint, exactly and without knowing that it is one; the leaky bucket, the governor and the guard too. The price is
//! one more entry to look at for each such joint, and none where there is none: identity, a gantry and a scaled axis
//! have no such entries, and their machines run the code that they ran before.
//!
//! Limits per axis remain for planners that look at one axis at a time and cannot carry such entries:
//! `PlannerContext::axis_by_axis` narrows them until `Σ |weight| · limit` is within every joint's. The host fills the
//! entries of what it hands to a planner, and fills those of every segment again from its axes: a planner cannot get them
//! wrong. What lies along the path is measured in the axes alone (`Axes::count`), never over all entries. Whether a map
//! is linear is found out by asking it at the corners and inside the travel. The fine loop then uses the weights that
//! were found and not the plugin, so that what the guard has judged is what the drives are sent.
//!
//! Kinematics that are not linear are asked once a period, on the way to the guard, and what the guard has seen is what
//! is sent: a second answer could be another one. After a fault every sample is sent, so there the loop compares the
//! joints with their limits itself, and lets them go to rest one by one where a joint cannot follow.
//!
//! Ramping out leaves the path, axis by axis. With coupled joints that would break sums: two axes that slow down at their own
//! limits turn the direction. So there all entries go by one law, `v(t) = v₀·f(t)` once the acceleration has run out,
//! which keeps every sum.

pub mod apart;
mod coupled;
mod curved;
mod fold;
mod joint;
mod linear;
mod space;
mod stated;
mod travel;

pub use coupled::CoupledJoints;
pub use space::JointSpace;
