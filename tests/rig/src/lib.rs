//! A planner driven without the loops: machines, blocks, what comes out, reference cases. The planners' tests and benches
//! share it.

mod blocks;
mod cases;
mod collected;
mod drive;
mod machine;
mod random;
mod record;

pub use blocks::{arc, line, lines, numbered, program};
pub use cases::{assert_close, case, numbers, points};
pub use collected::Collected;
pub use drive::{Away, Given, Offer, drive, feed, stream};
pub use machine::{axis, context};
pub use random::Random;
pub use record::{CASES_VARIABLE, record_case};

/// Of a feed, mm/min per mm/s.
pub const MM_PER_MIN: f64 = 60.0;
