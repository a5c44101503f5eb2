//! The form `windowed`: the published method, after Kweon, Mohan and Yang, "Design of jerk bounded feed rate with look ahead
//! using adaptive NURBS interpolator".
//!
//! 1. [`corners`]: places where the limit of the speed is lowest;
//! 2. [`ripple`]: what each of them asks of those before it, and the ramps between them;
//! 3. [`ramps`]: where a ramp is faster than the limit there is another corner, as long as there are such;
//! 4. the check of every sample.
//!
//! A window that the check refuses is planned again with less acceleration, less jerk or lower caps.

mod corners;
mod grade;
mod motion;
mod plan;
mod points;
mod ramp;
mod ramps;
mod ripple;
#[cfg(test)]
mod tests;

pub use corners::{Limit, Spot, Survey};
pub use grade::Grade;
pub use motion::Ramps;
pub use plan::{STEP_S, Windowed};
pub use ramp::{Ramp, Tangential};
pub use ramps::{Care, Rounds};
pub use ripple::Corner;
