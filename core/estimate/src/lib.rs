//! How long a part program takes: models of machining time, and their calibration.
//!
//! Three models behind one trait: the closed forms of a look-ahead and of an overlap control, and the published regression.
//! Two are simulated: the machine's own planner on the virtual clock ([`Choice::Simulate`]), and another control as one of the
//! planners here ([`planned`]). [`estimate`] streams a program through one.
//!
//! `core/estimate` sees blocks, not planners. `tandem_estimate::estimate` either hands every block of the first pass to
//! a model (`Model::block`, a bounded number of blocks kept) or runs the machine on the virtual clock with an observer
//! that looks at reports of blocks only. The closed forms repeat published rules, not the plugins' code, so that the
//! tests of either find the other's mistakes. A calibration measures samples of the driver, never what a planner says
//! of itself, because that is all that another control gives. docs/machining-time.md has the models and their accuracy.

mod choice;
pub mod diagnose;
mod element;
mod estimate;
pub mod experiment;
pub mod fit;
mod four_cases;
mod histogram;
mod junction;
mod look_ahead;
pub mod measured;
pub mod measurements;
mod model;
pub mod model_file;
mod overlap;
pub mod planned;
pub mod polygon;
mod regression;
mod tally;

pub use choice::{Choice, NAMES};
pub use element::{Element, Kind};
pub use estimate::{Estimate, EstimateError, estimate, program_errors};
pub use four_cases::{Driven, drive};
pub use histogram::{Field, Histogram};
pub use junction::{Junction, Rows, Rule};
pub use look_ahead::LookAhead;
pub use model::{Case, Model, Sink, Spent, total_s};
pub use overlap::{Constants, Overlap};
pub use regression::{
    CORRECTED_LONG, Coefficients, PRINTED_CUBE, PRINTED_SHORT, Regression, Switch, long_terms,
};
pub use tally::{Part, Tally};
