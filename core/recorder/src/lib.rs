//! What is kept of a run: the trace, the table of blocks, the events, and the summary.
//!
//! Everything here is on the soft side. A [`Monitor`] sees every block and every sample and turns them into the numbers of a
//! [`Summary`]; [`TraceCsv`], [`BlocksCsv`] and [`EventsCsv`] write them down as they come. A file that cannot be written any
//! further is a value ([`RecordError`]), and what becomes of the motion then is not decided here.

mod beyond;
mod block_times;
mod curve_watch;
mod joint_peaks;
mod lateness;
mod monitor;
mod path_watch;
mod policy_summary;
mod polyline;
mod record;
mod stops;
mod summary;
mod worst;

pub use beyond::{worst_of_judged, worst_of_reported};
pub use block_times::{BlockTimes, TimeGoesTo};
pub use curve_watch::{CurveWatch, OnCurve};
pub use joint_peaks::{JointPeaks, JointWatch, WatchedJoint};
pub use lateness::{Lateness, Row};
pub use monitor::Monitor;
pub use policy_summary::PolicySummary;
pub use polyline::polyline;
pub use record::{
    BlocksCsv, EventsCsv, Output, RecordError, RoughCsv, SWITCHED_COLUMNS, TraceCsv, age,
    flush_outputs, outputs_word, rpm,
};
pub use stops::{Stop, StopWatch};
pub use summary::{
    ExchangeUs, FORMAT as SUMMARY_FORMAT, LatenessUs, OfLimit, OfLimits, PageFaults, PlanningRow,
    PlanningUs, Summary,
};
pub use worst::Worst;
