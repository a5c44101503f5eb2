//! Block overlap: the planner `block-overlap`.
//!
//! After C.-Y. Lee, C.-J. Kim, S. G. Baek and S. Heo, on a block-overlap interpolator with a variable time constant. Every
//! block is driven with a trapezoid of speed along its path, and the next block starts when this one starts to slow down:
//! the two motions add up, the velocity stays continuous and the corner is rounded. The time constant of a junction is
//! how long the two overlap. Never more than two blocks move at a time.
//!
//! | option | values | meaning |
//! |---|---|---|
//! | `corner_control` | `on` (default) | `TA` is the longest constant: tolerance and short blocks shorten it |
//! | | `off` | the constant is `TA`, whatever the corner loses |
//! | `limits` | `slow` (default) | axis limits hold: lower feeds, or the next block starts later |
//! | | `stretch` | the same, but a constant may be longer than `TA` where no tolerance acts |
//! | | `off` | as published, for simulated drives: `TA` decides, whatever the axes can do |
//! | `buffer_blocks` | 512 | blocks kept for looking ahead |
//!
//! The rules and why they hold stand in `docs/block-overlap.md`.

mod buffer;
mod choose;
mod corner;
mod drive;
mod entry;
mod feeds;
mod join;
mod mover;
mod options;
mod planner;
mod reason;
mod rules;

pub use corner::{corner_error_mm, tau_for_tolerance_s};
pub use options::{CornerControl, LimitMode, Options};
pub use planner::BlockOverlap;

tandem_sdk::plugin!(planner "block-overlap" = BlockOverlap::new);
