//! The report of a run: one HTML file that draws what the machine was told to do, beside what it is allowed to do.
//!
//! The page needs no network, no server and no other file: style, script and samples are inside it. It shows the tool
//! path coloured by feed, and over one shared time axis the path feed, each axis' velocity, acceleration and jerk with
//! their limits, the path deviation, σ and the following error. What exceeds a limit is red and listed.
//! [`LatencyReport`] draws how late a thread woke, [`EstimateReport`] what programs are estimated to take, [`RefusalReport`]
//! where a program is refused, [`TuneReport`] what a search for settings found.
//!
//! ```
//! use tandem_report::{Axis, Report, Samples, Unit};
//!
//! let report = Report {
//!     title: "one tick to the right".into(),
//!     axes: vec![Axis { letter: 'X', unit: Unit::Mm, max_velocity: 250.0, max_acceleration: 1000.0, ..Axis::default() }],
//!     fine_period_s: 0.001,
//!     samples: Samples {
//!         t_s: vec![0.0, 0.001],
//!         line: vec![1, 1],
//!         command: vec![vec![0.0, 0.0005]],
//!         feed_mm_s: vec![0.0, 0.5],
//!         sigma: vec![1.0, 1.0],
//!         ..Samples::default()
//!     },
//!     ..Report::default()
//! };
//! let mut page = Vec::new();
//! report.write(&mut page)?;
//! # Ok::<(), std::io::Error>(())
//! ```

mod binding;
mod chart;
mod columns;
mod differences;
mod encode;
mod estimate;
mod findings;
mod judge;
mod latency;
mod model;
mod page;
mod refusal;
mod sections;
mod tables;
mod template;
mod text;
mod thin;
mod tune;

pub use estimate::{EstimateReport, EstimatedField, EstimatedProgram};
pub use latency::{LatencyBin, LatencyReport, LatencySeries};
pub use model::{Axis, Ended, Report, Samples, Signal, Unit};
pub use refusal::{RefusalReport, RefusedPlace};
pub use tune::{TuneParameter, TunePoint, TuneReport, TuneScene, TuneStep};
