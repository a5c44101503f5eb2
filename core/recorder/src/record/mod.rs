//! What a run leaves behind: trace, blocks, and files that appear only when they are complete.

mod blocks_csv;
mod events_csv;
mod output;
mod rough_csv;
mod trace_csv;

pub use blocks_csv::BlocksCsv;
pub use events_csv::EventsCsv;
pub use output::{Output, RecordError, flush_outputs};
pub use rough_csv::RoughCsv;
pub use trace_csv::{SWITCHED_COLUMNS, TraceCsv, age, outputs_word, rpm};
