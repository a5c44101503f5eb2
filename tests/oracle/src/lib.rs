//! The independent judge of a run: it reads a trace, the part program and the machine, and says whether every sample
//! kept the machine's limits and the programmed path.
//!
//! It shares no code with interpreter, planner or host, and reads nothing of theirs but the trace format. What it
//! cannot read it reports as *not judged*, never as passed.
//!
//! Trace, program and `machine.toml` all speak of degrees, so rotary axes stay in degrees here; every name that ends
//! in `_mm` means degrees for a rotary axis. A distance in axis space counts one degree as one millimetre.
//!
//! ```
//! use tandem_oracle::{Kind, Machine, Options, Trace, judge};
//!
//! let machine = Machine::from_toml(
//!     r#"
//!     [loops]
//!     fine_period_ms = 1
//!     [motion]
//!     path_tolerance_mm = 0.01
//!     [axes.x]
//!     travel_mm = [0, 100]
//!     max_feed_mm_per_min = 6000
//!     max_rapid_mm_per_min = 6000
//!     max_acceleration_mm_per_s2 = 1000
//!     "#,
//!     "machine.toml",
//! )?;
//! let leap = "t_s,line,x_cmd_mm\n0,1,0\n0.001,1,0.5\n";
//! let trace = Trace::from_reader(leap.as_bytes(), "leap.csv")?;
//! let verdict = judge(&trace, "G0 X0.5\nM2\n", &machine, &Options::default());
//! assert_eq!(verdict.kinds(), [Kind::Velocity, Kind::Acceleration, Kind::Feed]);
//! # Ok::<(), tandem_oracle::Error>(())
//! ```

mod axis;
mod error;
mod feed;
mod follow;
mod geometry;
mod judge;
mod limits;
mod machine;
mod options;
mod path;
mod places;
mod program;
mod trace;
mod verdict;
mod vertices;
mod walk;

pub use axis::{Axes, LETTERS, Position, axis_index};
pub use error::Error;
pub use judge::judge;
pub use machine::{Axis, Joint, Joints, Machine, Map};
pub use options::{Check, Options};
pub use trace::{Row, Trace};
pub use verdict::{AxisMaxima, Finding, Kind, Maxima, Outcome, Verdict};
