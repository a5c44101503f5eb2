//! Mathematics that planners share: paths by path coordinate, speed profiles along a block, segments from both.
//!
//! Units: mm, s, rad. Nothing here allocates unless it says so; everything is called on the rough loop.

mod arc;
pub mod blocks;
mod geometry;
mod lanes;
pub mod nurbs;
mod path;
mod profile;
pub mod retime;
mod segment;
pub mod stream;
pub mod tube;

pub use geometry::{half_angle_turn_rad, one_minus_cos};
pub use path::Path;
pub use profile::Profile;
pub use segment::{Builder, SpeedPiece, hermite, state};
