//! `tandem home --connect`.

use std::error::Error;

use serde_json::json;

use super::connection::{Connection, Trouble};
use super::work::{Work, tell_trouble};
use crate::args;

/// Has the controller home the axes of its machine.
pub fn home(at: &args::Connect, options: &args::Home) -> Result<u8, Box<dyn Error>> {
    options.place.refuse_with_connect(&[
        (options.clock.is_some(), "--clock"),
        (options.trace.is_some(), "--trace"),
        (options.report.is_some(), "--report"),
    ]);
    let mut work = Work::begin(Connection::open(at)?)?;
    Ok(driven(&mut work, options).unwrap_or_else(|trouble| tell_trouble(&trouble)))
}

fn driven(work: &mut Work, options: &args::Home) -> Result<u8, Trouble> {
    work.prepare(options.reset, false)?;
    let with = options.axis.map_or_else(
        || json!({}),
        |axis| json!({ "axis": axis.to_ascii_lowercase().to_string() }),
    );
    work.ask_to_move("home", with)?;
    let _keys = work.take_keys();
    let end = work.follow("home", &mut |_| ())?;
    end.tell();
    Ok(end.status())
}
