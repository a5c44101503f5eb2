//! The binary trace: every fine sample of a run, bit for bit, in a few bytes.
//!
//! A file is a header, records, and a closing record. Each record carries a checksum that also covers the record before
//! it, so that nothing can be changed, dropped or inserted unseen. Every [`KEY_INTERVAL`]-th record is a *key*: it needs
//! no other record, begins with a marker and says its number, so that a reader finds its way again after damage and can
//! say how many records are lost. A file that ends anywhere is readable up to the last complete record.
//!
//! [`Writer`] and [`Reader`] work in a stream: neither ever holds more than one buffer of the file. Both are for the soft
//! side; they allocate, and they wait for the disk. The layout byte by byte is in `docs/trace.md`.

mod code;
mod error;
mod frame;
mod header;
mod reader;
mod source;
mod words;
mod writer;

pub use error::{Cause, TraceError};
pub use header::{FORMAT, Header, MAGIC, has_age, has_switched};
pub use reader::{Damage, Ending, Item, Reader, Record};
pub use writer::{KEY_INTERVAL, Writer};
