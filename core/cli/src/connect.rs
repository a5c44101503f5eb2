//! Clients of a controller: `tandem status`, `tandem ask`.

use std::error::Error;
use std::io::{BufRead, BufReader, Write};
use std::os::unix::net::UnixStream;
use std::path::Path;

use serde_json::{Map, Value, json};

use crate::{FAULT, REFUSED, args};

/// A connection to a controller.
struct Connection {
    reader: BufReader<UnixStream>,
    last_id: u64,
}

impl Connection {
    fn open(path: &Path) -> Result<Self, String> {
        let at = |why: String| {
            format!(
                "{}: {why}; tandem serve says where its socket is",
                path.display()
            )
        };
        let stream = UnixStream::connect(path).map_err(|e| at(e.to_string()))?;
        let mut this = Self {
            reader: BufReader::new(stream),
            last_id: 0,
        };
        let greeting = this.hear()?;
        match greeting["tandem"]["protocol"].as_u64() {
            Some(2) => Ok(this),
            _ => Err(at("nobody there speaks protocol 2".to_string())),
        }
    }

    fn hear(&mut self) -> Result<Value, String> {
        let mut line = String::new();
        match self.reader.read_line(&mut line) {
            Ok(0) => Err("the controller has closed the connection".to_string()),
            Ok(_) => serde_json::from_str(&line)
                .map_err(|e| format!("the controller says what is no JSON: {e}")),
            Err(error) => Err(format!("the controller: {error}")),
        }
    }

    /// Sends a request, and waits for its answer; events that come before it are given to `event`.
    fn ask(
        &mut self,
        request: &str,
        mut with: Map<String, Value>,
        event: &mut dyn FnMut(&Value),
    ) -> Result<Value, String> {
        self.last_id += 1;
        with.insert("id".to_string(), json!(self.last_id));
        with.insert("request".to_string(), json!(request));
        let line = format!("{}\n", Value::Object(with));
        self.reader
            .get_mut()
            .write_all(line.as_bytes())
            .map_err(|e| format!("the controller: {e}"))?;
        loop {
            let told = self.hear()?;
            if told["id"].as_u64() != Some(self.last_id) || told.get("event").is_some() {
                event(&told);
            } else if let Some(error) = told.get("error") {
                return Err(format!(
                    "{}: {}",
                    request,
                    error["why"].as_str().unwrap_or_default()
                ));
            } else {
                return Ok(told["ok"].clone());
            }
        }
    }
}

/// Prints the machine as one line, once or as it changes.
pub fn status(options: &args::Status) -> Result<u8, Box<dyn Error>> {
    let mut connection = Connection::open(&options.connect)?;
    if !options.watch {
        let status = connection.ask("status", Map::new(), &mut |_| ())?;
        say_out(&shown(&status));
        return Ok(0);
    }
    let with = Map::from_iter([("rate_hz".to_string(), json!(5.0))]);
    connection.ask("subscribe", with, &mut |_| ())?;
    let mut last = String::new();
    loop {
        let told = connection.hear()?;
        if told["event"] == "end" {
            return Ok(0);
        }
        let line = if told["event"] == "status" {
            shown(&told["status"])
        } else {
            continue;
        };
        if line != last {
            say_out(&line);
            last = line;
        }
    }
}

/// Sends one request, and prints its answer; with mdi it waits until the line is driven, with what begins a job until that is over.
pub fn ask(options: &args::Ask) -> Result<u8, Box<dyn Error>> {
    let mut connection = Connection::open(&options.connect)?;
    let mut with = Map::new();
    for (key, text) in &options.with {
        with.insert(
            key.clone(),
            serde_json::from_str(text).unwrap_or_else(|_| json!(text)),
        );
    }
    if !["status", "history", "list", "hold", "emergency-stop"].contains(&options.request.as_str())
    {
        connection.ask(
            "lease",
            Map::from_iter([("how".to_string(), json!("take"))]),
            &mut |_| (),
        )?;
    }
    let mut early = vec![];
    let answer = connection.ask(&options.request, with, &mut |event| {
        early.push(event.clone());
    });
    let ok = match answer {
        Ok(ok) => ok,
        Err(why) => {
            say!("{why}");
            return Ok(REFUSED);
        }
    };
    say_out(&ok.to_string());
    if !["mdi", "start", "home", "jog"].contains(&options.request.as_str()) {
        return Ok(0);
    }
    let mut events = early.into_iter();
    loop {
        let told = events.next().map_or_else(|| connection.hear(), Ok)?;
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
fn shown(status: &Value) -> String {
    let place = |key: &str| {
        let axes = status[key].as_object().cloned().unwrap_or_default();
        let of = |(name, value): (String, Value)| {
            let letter = name.split('_').next().unwrap_or_default().to_uppercase();
            format!("{letter}{:.3}", value.as_f64().unwrap_or_default())
        };
        axes.into_iter().map(of).collect::<Vec<_>>().join(" ")
    };
    let text = |key: &str| status[key].as_str().unwrap_or_default().to_string();
    let number = |key: &str| status[key].as_f64().unwrap_or_default();
    let fault = if status["fault"].is_string() {
        format!("  fault: {}", text("fault"))
    } else {
        String::new()
    };
    format!(
        "{}  machine {}  {} {}  F{:.0} S{:.0} T{:.0}  line {:.0}{fault}",
        text("state"),
        place("position"),
        text("system"),
        place("work_position"),
        number("feed_mm_per_min"),
        number("spindle_rpm"),
        number("tool"),
        number("line"),
    )
}

fn say_out(line: &str) {
    // A reader that has gone away is no reason to fail.
    let _ = writeln!(std::io::stdout(), "{line}");
}
