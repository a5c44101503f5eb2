//! `tandem run --connect`.

use std::error::Error;
use std::io::{IsTerminal, Read, Write, stderr, stdout};
use std::path::Path;

use serde_json::json;
use tandem_recorder::Output;

use super::connection::{Connection, Trouble};
use super::looks::shown;
use super::work::{JobEnd, Work, tell_trouble};
use crate::{FAULT, args, run::Driven};

/// Longest program that goes over the connection, bytes; JSON needs a little more.
const MAX_BYTES: u64 = 7 << 20;

/// Has the controller run a program.
pub fn run(at: &args::Connect, options: &args::Run) -> Result<u8, Box<dyn Error>> {
    let operator = &options.operator;
    options.place.refuse_with_connect(&[
        (options.clock.is_some(), "--clock"),
        (options.commands.is_some(), "--commands"),
        (options.pause, "--pause"),
        (options.dry, "--dry-run"),
        (operator.listen.is_some(), "--listen"),
        (operator.listen_tcp.is_some(), "--listen-tcp"),
        (options.trace.is_some(), "--trace"),
        (options.blocks.is_some(), "--blocks"),
        (options.rough.is_some(), "--rough"),
        (options.events.is_some(), "--events"),
        (options.report.is_some(), "--report"),
        (options.reference_time_s.is_some(), "--reference-time-s"),
    ]);
    let text = program(&options.program)?;
    let summary = options.summary.as_deref().map(Output::create).transpose()?;
    let mut work = Work::begin(Connection::open(at)?)?;
    let end = match driven(&mut work, options, &text) {
        Err(trouble) => return Ok(tell_trouble(&trouble)),
        Ok(end) => end,
    };
    let mut status = end.status();
    if let (Some(mut out), Some(path)) = (summary, &options.summary) {
        let text = serde_json::to_string_pretty(end.summary())?;
        let written = writeln!(out, "{text}").map_err(|e| e.to_string());
        if let Err(why) = written.and_then(|()| out.finish()) {
            say!("error: summary: {}: {why}", path.display());
            status = FAULT;
        }
    }
    conclude(options, &end);
    Ok(status)
}

/// The text of a program; `-` is standard input.
fn program(path: &Path) -> Result<String, String> {
    let at = |e: std::io::Error| format!("{}: {e}", path.display());
    let mut text = vec![];
    if path.as_os_str() == "-" {
        std::io::stdin().take(MAX_BYTES + 1).read_to_end(&mut text)
    } else {
        std::fs::File::open(path).and_then(|file| file.take(MAX_BYTES + 1).read_to_end(&mut text))
    }
    .map_err(at)?;
    if text.len() as u64 > MAX_BYTES {
        return Err(format!(
            "{}: a program of more than {MAX_BYTES} bytes is loaded from the controller's programs folder: tandem ask load path=…",
            path.display()
        ));
    }
    String::from_utf8(text).map_err(|e| format!("{}: {e}", path.display()))
}

fn driven(work: &mut Work, options: &args::Run, text: &str) -> Result<JobEnd, Trouble> {
    work.prepare(options.reset, options.home)?;
    // The operator's switches are the controller's: what this run asks for is taken back behind it.
    let before = work.connection.ask("status", json!({}))?;
    let asked = [
        (options.block_delete, "block-delete", "block_delete"),
        (options.optional_stop, "optional-stop", "optional_stop"),
    ];
    let mut turned_on = vec![];
    for (wanted, request, key) in asked {
        if wanted && before[key] != true {
            work.connection.ask(request, json!({ "on": true }))?;
            turned_on.push(request);
        }
    }
    let name = options.program.display().to_string();
    let with = json!({ "text": text, "name": name });
    let loaded = work.connection.ask("load", with)?;
    for warning in loaded["warnings"].as_array().into_iter().flatten() {
        say!("{}", warning.as_str().unwrap_or_default());
    }
    work.subscribe()?;
    work.ask_to_move("start", json!({}))?;
    let keys = work.take_keys();
    let on_terminal = stderr().is_terminal();
    let end = work.follow("program", &mut |told| {
        if on_terminal && told["event"] == "status" {
            // A terminal that has gone away ends the command with its signal.
            let _ = write!(stderr(), "\r\x1b[K{}", shown(&told["status"]));
            let _ = stderr().flush();
        }
    })?;
    drop(keys);
    if on_terminal {
        let _ = write!(stderr(), "\r\x1b[K");
    }
    for request in turned_on {
        work.connection.ask(request, json!({ "on": false }))?;
    }
    Ok(end)
}

/// The words of a run that is over.
fn conclude(options: &args::Run, end: &JobEnd) {
    if let Ok(driven) = serde_json::from_value::<Driven>(end.summary().clone()) {
        // A reader that has gone away is no reason to fail.
        let _ = write!(stdout(), "{driven}");
    }
    if let Some(path) = &options.summary {
        let _ = writeln!(stdout(), "summary: {}", path.display());
    }
    end.tell();
}
