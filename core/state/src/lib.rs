//! What a machine knows from one session to the next: offsets, places, parameters, tools, turns, history, alarms, and the line
//! that was driven. One SQLite file a machine, one writer, a thread of its own that no loop waits for.
//!
//! [`Store::commit`] returns when a change is on disk; what a [`Recorder`] takes is written soon after, in order, as much as
//! waits at once. A process that is killed, and a computer that loses power, leave the file as it was after one of these
//! writes.
//!
//! ```
//! use std::sync::Arc;
//!
//! use tandem_sdk::{Axes, AxisVector};
//! use tandem_state::{Change, Owner, Store};
//!
//! let folder = tempfile::tempdir().unwrap();
//! let path = folder.path().join("mill.sqlite");
//! let axes = Axes::new(&[('X', false), ('Y', false), ('Z', false)]).unwrap();
//! let owner = Owner { machine: "mill", axes: &axes, home: AxisVector::ZERO };
//!
//! let store = Store::open(&path, owner).unwrap();
//! assert!(store.is_new());
//! let mut program = store.load().to_program(&owner.home);
//! program.origins[1] = AxisVector::from_slice(&[10.0, 20.0, -5.0]);
//! store.commit(vec![Change::Program(Arc::new(program.clone()))]).unwrap();
//! program.tool_in_spindle = 7;
//! store.recorder().record(Change::Program(Arc::new(program.clone()))).unwrap();
//! store.close().unwrap();
//!
//! let store = Store::open(&path, owner).unwrap();
//! assert_eq!(store.load().to_program(&owner.home), program);
//! ```

#![allow(
    clippy::doc_markdown,
    reason = "SQLite and LinuxCNC are names, not code"
)]
#![allow(
    clippy::cast_possible_wrap,
    reason = "counts that SQLite takes as signed numbers are judged or small"
)]

mod change;
mod data;
mod error;
mod linuxcnc;
mod place;
mod queue;
mod rows;
mod schema;
mod store;
mod write;

pub use change::Change;
pub use data::{
    Alarm, Driven, Job, JobEnd, JobKind, Outcome, PERSISTENT_PARAMETERS, PersistentState, Tool,
    ToolLife, USER_PARAMETERS, WorkOffsets,
};
pub use error::StateError;
pub use linuxcnc::{AtLine, LinearUnit, LinuxCnc};
pub use place::default_path;
pub use store::{Owner, Reader, Recorder, Store};
pub use write::{MAX_TOOL_NUMBER, MAX_TOOLS};
