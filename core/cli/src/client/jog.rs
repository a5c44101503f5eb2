//! `tandem jog --connect`.

use std::error::Error;
use std::io::{Write, stderr, stdout};
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use serde_json::{Value, json};
use tandem_host::Command;
use tandem_session::NextLine;
use tandem_session::jog::{JogMessage, ReachMessage};

use super::connection::{Connection, RequestSender, Trouble};
use super::panel::RemotePanel;
use super::work::{JobEnd, Work, exit_status, shown_position};
use crate::args;
use crate::jog::RESET;
use crate::jog::keys::{JogKeys, JogPanel};
use crate::jog::line::{Line, Wrong, parse};
use crate::mdi::input::Input;
use crate::operator::{Keyboard, LOOK, Panel, Stops, press, tell};

/// Has the controller jog.
pub fn jog(at: &args::Connect, options: &args::Jog) -> Result<u8, Box<dyn Error>> {
    let session = &options.session;
    options.place.refuse_with_connect(&session.of_own_drives());
    let work = Work::begin(Connection::open(at)?)?;
    let mut jogs = Jogs {
        work,
        axes: vec![],
        moving: Arc::default(),
        lines: 0,
        refused: false,
        fault: false,
    };
    let done = jogs
        .work
        .prepare(session.reset, session.home)
        .and_then(|()| jogs.ask_for_axes())
        .and_then(|()| jogs.work.subscribe());
    let done = match done {
        Err(trouble) => Err(trouble),
        Ok(()) if jogs.work.keys => {
            let keys = jogs.keys()?;
            let done = jogs.by_keys();
            drop(keys);
            done
        }
        Ok(()) => jogs.by_lines(),
    };
    Ok(exit_status(done, jogs.fault, jogs.refused))
}

struct Jogs {
    work: Work,
    /// Letters of the axes, and whether they turn.
    axes: Vec<(char, bool)>,
    /// A jog is asked for, and its job has not ended.
    moving: Arc<AtomicBool>,
    lines: u32,
    refused: bool,
    fault: bool,
}

impl Jogs {
    fn ask_for_axes(&mut self) -> Result<(), Trouble> {
        let status = self.work.connection.ask("status", json!({}))?;
        let names = status["position"].as_object().into_iter().flatten();
        self.axes = names
            .filter_map(|(name, _)| Some((name.chars().next()?, name.ends_with("_deg"))))
            .collect();
        Ok(())
    }

    /// What comes next from the controller; the end of a jog is told.
    fn hear(&mut self) -> Result<Option<Value>, Trouble> {
        let Some(told) = self.work.hear()? else {
            return Ok(None);
        };
        match told["event"].as_str() {
            Some("state") if told["state"] == "manual" => self.moving.store(true, Relaxed),
            Some("refused") => {
                self.refused = true;
                self.moving.store(false, Relaxed);
            }
            Some("job") => {
                self.moving.store(false, Relaxed);
                let end = JobEnd::of(&told);
                if end.fault().is_some() {
                    end.tell();
                    self.fault = true;
                    let word = if self.work.keys { "r" } else { RESET };
                    tell(&format!("{word} goes on from here"));
                } else if !self.work.keys {
                    // A reader that has gone away is no reason to stop.
                    let _ = writeln!(stdout(), "{}", end.position());
                }
            }
            _ => {}
        }
        Ok(Some(told))
    }

    /// Until nothing moves.
    fn rest(&mut self) -> Result<(), Trouble> {
        while self.moving.load(Relaxed) {
            self.hear()?;
        }
        Ok(())
    }

    fn keys(&self) -> Result<Keyboard, String> {
        let mut keys = JogKeys::new(Box::new(RemoteAxes {
            requests: self.work.connection.requests.clone(),
            panel: Arc::clone(&self.work.panel),
            stops: self.work.stops(),
            axes: self.axes.clone(),
            moving: Arc::clone(&self.moving),
            last: Mutex::default(),
        }));
        keys.explain();
        Keyboard::begin_with(move |bytes| keys.take(bytes))
    }

    fn by_keys(&mut self) -> Result<(), Trouble> {
        loop {
            if self.work.stops().are_asked() {
                return self.rest();
            }
            let Some(told) = self.hear()? else { continue };
            if told["event"] == "status" {
                let status = &told["status"];
                // A terminal that has gone away ends the session with its signal.
                let _ = write!(
                    stderr(),
                    "\r\x1b[K{}  {}  F{:.0}",
                    status["state"].as_str().unwrap_or_default(),
                    shown_position(&status["position"], 3),
                    status["feed_mm_per_min"].as_f64().unwrap_or_default()
                );
                let _ = stderr().flush();
            }
        }
    }

    fn by_lines(&mut self) -> Result<(), Trouble> {
        let mut input = Input::new(false);
        while !self.work.stops().are_asked() {
            match input.next(false) {
                NextLine::Over => break,
                NextLine::Later => {
                    if self.hear()?.is_none() {
                        thread::sleep(LOOK);
                    }
                }
                NextLine::Line(text) => {
                    self.lines += 1;
                    let column = text.len() - text.trim_start().len() + 1;
                    let done = match parse(&text) {
                        Ok(Line::Quit) => break,
                        Ok(line) => self.carry_out(&line),
                        Err(Wrong { column, why }) => {
                            self.refuse(column, &why);
                            Ok(())
                        }
                    };
                    match done {
                        Ok(()) | Err(Trouble::Stopped) => {}
                        Err(Trouble::Refused(why)) => self.refuse(column, &why),
                        Err(gone) => return Err(gone),
                    }
                }
            }
        }
        if self.moving.load(Relaxed) && !self.work.stops().are_asked() {
            self.let_go()?;
        }
        self.rest()
    }

    fn carry_out(&mut self, line: &Line) -> Result<(), Trouble> {
        match line {
            Line::Jog(words) => {
                let with = request(words, &self.axes).map_err(Trouble::Refused)?;
                self.work.ask_to_move("jog", with)?;
                self.moving.store(true, Relaxed);
                if matches!(words.reach, ReachMessage::By(_)) {
                    self.rest()?;
                }
            }
            Line::Stop => self.let_go()?,
            Line::Wait(seconds) => {
                let until = Instant::now() + Duration::from_secs_f64(*seconds);
                while Instant::now() < until && !self.work.stops().are_asked() {
                    self.hear()?;
                }
            }
            Line::Where => {
                let status = self.work.connection.ask("status", json!({}))?;
                let _ = writeln!(stdout(), "{}", shown_position(&status["position"], 4));
            }
            Line::Reset => {
                self.work.ask_to_move("reset", json!({}))?;
                self.fault = false;
            }
            Line::Command(command) => give(&*self.work.panel, *command)?,
            Line::Quit | Line::Nothing => {}
        }
        Ok(())
    }

    fn let_go(&mut self) -> Result<(), Trouble> {
        match self.work.connection.ask("jog", json!({ "stop": true })) {
            // It has come to rest by itself.
            Ok(_) | Err(Trouble::Refused(_)) => self.rest(),
            Err(gone) => Err(gone),
        }
    }

    fn refuse(&mut self, column: usize, why: &str) {
        self.refused = true;
        tell(&format!("input:{}:{column}: error: {why}", self.lines));
    }
}

fn give(panel: &dyn Panel, command: Command) -> Result<(), Trouble> {
    panel.give(command).map_err(Trouble::Gone)
}

/// A jog as a request has it.
fn request(words: &JogMessage, axes: &[(char, bool)]) -> Result<Value, String> {
    let letter = words.axis.to_ascii_lowercase();
    let Some((_, turns)) = axes.iter().find(|(name, _)| *name == letter) else {
        return Err(format!("the machine has no axis {letter}"));
    };
    let unit = if *turns { "deg" } else { "mm" };
    let mut with = json!({
        "axis": letter.to_string(), format!("feed_{unit}_per_min"): words.feed_per_min,
    });
    match words.reach {
        ReachMessage::On { positive } => {
            with["direction"] = json!(if positive { 1 } else { -1 });
        }
        ReachMessage::By(distance) => with[format!("distance_{unit}")] = json!(distance),
    }
    Ok(with)
}

/// The axes of a controller, for keys.
struct RemoteAxes {
    requests: RequestSender,
    panel: Arc<RemotePanel>,
    stops: Stops,
    axes: Vec<(char, bool)>,
    moving: Arc<AtomicBool>,
    /// The jog that was asked for last: while it moves, the same again only keeps it alive.
    last: Mutex<Option<JogMessage>>,
}

impl JogPanel for RemoteAxes {
    fn has_axis(&self, letter: char) -> bool {
        let letter = letter.to_ascii_lowercase();
        self.axes.iter().any(|(name, _)| *name == letter)
    }

    fn jog(&self, jog: JogMessage) -> Result<(), String> {
        let mut with = request(&jog, &self.axes)?;
        let mut last = self.last.lock().unwrap_or_else(PoisonError::into_inner);
        let before = last.replace(jog);
        let goes_on = matches!(jog.reach, ReachMessage::On { .. });
        if goes_on && before == Some(jog) && self.moving.load(Relaxed) {
            // A repeat that was long on its way finds the machine at rest, and leaves it there.
            with["again"] = json!(true);
        }
        let said = self.requests.say("jog", with);
        said.map(|_| ()).map_err(|gone| gone.words().to_string())
    }

    fn let_go(&self) {
        if self.moving.load(Relaxed) {
            // A connection that is gone is told by who listens.
            let _ = self.requests.say("jog", json!({ "stop": true }));
        }
    }

    fn command(&self, key: u8) -> Option<String> {
        press(key, &*self.panel, &self.stops)
    }

    fn reset(&self) {
        let _ = self.requests.say("reset", json!({}));
    }

    fn quit(&self) {
        self.let_go();
        self.stops.end();
    }

    fn say(&self, words: &str) {
        tell(words);
    }
}
