//! A planner driven without the loops: machines, blocks, what comes out, reference cases; and doubles of drives and planners.
//! Tests and benches share it.

mod bent;
mod blocks;
mod cases;
mod collected;
mod drive;
mod echo;
mod files;
mod machine;
mod namespace;
mod random;
mod record;

pub use bent::Bent;
pub use blocks::{arc, line, lines, numbered, program};
pub use cases::{assert_close, canonical_curve, case, curve, numbers, points};
pub use collected::Collected;
pub use drive::{Away, Given, Offer, drive, feed, processor_time, processor_time_of, stream};
pub use echo::Echo;
pub use files::files;
pub use machine::{axis, context};
pub use namespace::{BUS_END, MASTER_END, program_beside, with_cable};
pub use random::Random;
pub use record::{CASES_VARIABLE, record_case};

/// Of a feed, mm/min per mm/s.
pub const MM_PER_MIN: f64 = 60.0;
