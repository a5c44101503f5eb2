//! What a run leaves behind: trace, blocks, and files that appear only when they are complete.

mod blocks_csv;
mod events_csv;
mod failure;
mod output;
mod trace_csv;

pub use blocks_csv::BlocksCsv;
pub(crate) use blocks_csv::limited_by;
pub use events_csv::EventsCsv;
pub use failure::RecordError;
pub use output::{Output, flush_outputs};
pub use trace_csv::{SWITCHED_COLUMNS, TraceCsv, outputs_word, rpm};
