//! The controller that stays: one machine, job after job, and what lasts between them. Its protocol is a JSON line a request,
//! on every door.

mod described;
mod desk;
mod lines;
mod request;
mod serve;
mod states;
mod talk;

pub use desk::{Keeper, NoKeeper};
pub use serve::{Controller, Options, ScriptLine};
pub use states::{ControllerState, judge, requests, table};
