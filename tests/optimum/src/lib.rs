//! How near a planner comes to the shortest time: fresh curves and CAM paths, driven through the host and judged by the
//! oracle, beside a slow solver on a fine grid.
//!
//! `cargo run --release -p tandem-optimum -- --count 40` prints the table of `docs/near-optimal.md`, which says how to
//! read it.

pub mod best;
pub mod course;
pub mod draw;
pub mod table;
pub mod trial;
