//! Clients that look: `tandem status`; and `tandem ask`, which says one request.

use std::error::Error;
use std::io::Write;
use std::time::Duration;

use serde_json::{Map, Value, json};
use tandem_session::controller::WORDS;

use super::connection::{Connection, Trouble};
use super::work::{in_order, tell_trouble};
use crate::{FAULT, args};

/// How long is waited at once for what comes next.
const PATIENCE: Duration = Duration::from_mins(1);

/// Prints the machine as one line, once or as it changes.
pub fn status(options: &args::Status) -> Result<u8, Box<dyn Error>> {
    let mut connection = Connection::open(&options.controller)?;
    let looked = if options.watch {
        watch(&mut connection)
    } else {
        connection
            .ask("status", json!({}))
            .map(|status| say_out(&shown(&status)))
    };
    Ok(looked.map_or_else(|trouble| tell_trouble(&trouble), |()| 0))
}

fn watch(connection: &mut Connection) -> Result<(), Trouble> {
    connection.ask("subscribe", json!({ "rate_hz": 5.0 }))?;
    let mut last = String::new();
    loop {
        let Some(told) = connection.hear(PATIENCE)? else {
            continue;
        };
        if told["event"] == "end" {
            return Ok(());
        }
        if told["event"] == "status" {
            let line = shown(&told["status"]);
            if line != last {
                say_out(&line);
                last = line;
            }
        }
    }
}

/// Sends one request, and prints its answer; with mdi it waits until the line is driven, with what begins a job until that is over.
pub fn ask(options: &args::Ask) -> Result<u8, Box<dyn Error>> {
    let mut connection = Connection::open(&options.controller)?;
    Ok(answered(&mut connection, options).unwrap_or_else(|trouble| tell_trouble(&trouble)))
}

fn answered(connection: &mut Connection, options: &args::Ask) -> Result<u8, Trouble> {
    let of = |text: &String| serde_json::from_str(text).unwrap_or_else(|_| json!(text));
    let with: Map<String, Value> = options
        .with
        .iter()
        .map(|(key, text)| (key.clone(), of(text)))
        .collect();
    let request = options.request.as_str();
    let is_free = WORDS.iter().any(|word| word.name == request && !word.lease);
    if !is_free {
        connection.take_lease()?;
    }
    let ok = connection
        .ask(request, Value::Object(with))
        .map_err(|trouble| match trouble {
            Trouble::Refused(why) => Trouble::Refused(format!("{request}: {why}")),
            other => other,
        })?;
    say_out(&ok.to_string());
    if !["mdi", "start", "home", "jog"].contains(&request) {
        return Ok(0);
    }
    loop {
        let Some(told) = connection.hear(PATIENCE)? else {
            continue;
        };
        if told["event"] == "job" {
            say_out(&told["job"].to_string());
            return Ok(if told["job"]["outcome"] == "done" {
                0
            } else {
                FAULT
            });
        }
        if told["event"] == "end" {
            return Ok(FAULT);
        }
    }
}

/// The machine as one line.
pub fn shown(status: &Value) -> String {
    let text = |key: &str| status[key].as_str().unwrap_or_default().to_string();
    let number = |key: &str| status[key].as_f64().unwrap_or_default();
    let slows = status["state"] == "held" && status["at_rest"] == false;
    let fault = if status["fault"].is_string() {
        format!("  fault: {}", text("fault"))
    } else {
        String::new()
    };
    format!(
        "{}{}  machine {}  {} {}  F{:.0} S{:.0} T{:.0}  line {:.0}{}{fault}",
        text("state"),
        if slows { ", slowing down" } else { "" },
        letters(&status["position"]),
        text("system"),
        letters(&status["work_position"]),
        number("feed_mm_per_min"),
        number("spindle_rpm"),
        number("tool"),
        number("line"),
        bus(&status["bus"]),
    )
}

/// How well the drives are heard, where they are on a bus.
fn bus(bus: &Value) -> String {
    let Some(age) = bus["feedback_age_periods"].as_u64() else {
        return String::new();
    };
    let late = &bus["old_feedback_periods"];
    let phase = bus["phase_us"].as_f64();
    let phase = phase.map_or(String::new(), |us| format!(", phase {us:+.1} µs"));
    format!("  bus age {age}, late or lost {late}{phase}")
}

/// Coordinates in few characters: `X1.000 Y2.000`.
fn letters(position: &Value) -> String {
    let each = in_order(position).map(|(name, value)| {
        let letter = name.split('_').next().unwrap_or_default().to_uppercase();
        format!("{letter}{value:.3}")
    });
    each.collect::<Vec<_>>().join(" ")
}

fn say_out(line: &str) {
    // A reader that has gone away is no reason to fail.
    let _ = writeln!(std::io::stdout(), "{line}");
}
