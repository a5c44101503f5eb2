//! The controller that stays: one machine, job after job, and what lasts between them. Its protocol is a JSON line a request,
//! on every door.

mod arrivals;
mod ask;
mod clerk;
mod described;
mod desk;
mod history;
mod keeper;
mod lines;
mod path;
mod programs;
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
mod talk;
mod watch;
mod words;

pub(crate) use clerk::Clerk;
pub(crate) use desk::{Desk, From, Mode};
pub use keeper::{Keeper, NoKeeper, Remembered};
pub(crate) use lines::{Lines, TakenLine};
pub(crate) use request::Asked;
pub use schema::{requests_table, schema};
pub use script::VirtualSender;
pub use serve::{Controller, Options, ScriptLine};
pub use states::{ControllerState, judge, requests, table};
pub(crate) use stream::{NotTaken, PLACES};
pub use words::{Key, Kind, Role, WORDS, Word};
