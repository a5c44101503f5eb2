//! The controller that stays: one machine, job after job, and what lasts between them. Its protocol is a JSON line a request,
//! on every door.

mod arrivals;
mod ask;
mod described;
mod disk_work;
mod dispatcher;
mod history;
mod lines;
mod path;
mod persistence;
mod programs;
mod protocol;
mod record;
mod request;
mod schema;
mod scope;
mod script;
mod seeing;
mod serve;
mod settings;
mod states;
mod stream;
mod watch;
mod words;

pub(crate) use disk_work::DiskWork;
pub(crate) use dispatcher::{Dispatcher, Mode, RequestId};
pub(crate) use lines::{Lines, TakenLine};
pub use persistence::{NoPersistence, Persistence, Remembered};
pub(crate) use request::Asked;
pub use schema::{requests_table, schema};
pub use script::{ScriptLine, VirtualSender};
pub use serve::{Controller, Options};
pub use states::{ControllerState, judge, requests, table};
pub(crate) use stream::{NotTaken, PLACES};
pub use words::{Key, Kind, Role, WORDS, Word};
