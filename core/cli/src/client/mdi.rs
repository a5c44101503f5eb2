//! `tandem mdi --connect`.

use std::error::Error;
use std::io::{Write, stdout};
use std::thread;

use serde_json::{Value, json};
use tandem_session::NextLine;

use super::connection::{Connection, Trouble};
use super::work::{JobEnd, Work, exit_status};
use crate::args;
use crate::mdi::conversation::is_farewell;
use crate::mdi::input::Input;
use crate::mdi::{RESET, explain};
use crate::operator::{LOOK, tell};

/// Lines of a pipe that are with the controller and not yet driven, at most: far ahead of the machine, and far below what the
/// controller takes.
const MAX_AHEAD: usize = 200;

/// Has the controller drive lines.
pub fn mdi(at: &args::Connect, options: &args::Mdi) -> Result<u8, Box<dyn Error>> {
    let session = &options.session;
    let mut refused = session.of_own_drives().to_vec();
    refused.push((options.block_delete, "--block-delete"));
    options.place.refuse_with_connect(&refused);
    let work = Work::begin(Connection::open(at)?)?;
    let input = Input::new(work.keys);
    let mut remote = RemoteMdi {
        work,
        input,
        lines: 0,
        ahead: 0,
        driving: false,
        refused: false,
        fault: false,
    };
    if remote.work.keys {
        explain();
    }
    let done = remote.work.prepare(session.reset, session.home);
    let done = done
        .and_then(|()| remote.work.connection.release_lease())
        .and_then(|()| remote.work.subscribe())
        .and_then(|()| remote.talk());
    Ok(exit_status(done, remote.fault, remote.refused))
}

/// Lines by hand that a controller drives.
struct RemoteMdi {
    work: Work,
    input: Input,
    /// Lines that were read.
    lines: u32,
    /// Lines that the controller has taken and not driven yet.
    ahead: usize,
    /// The job that drives them has not ended.
    driving: bool,
    refused: bool,
    fault: bool,
}

impl RemoteMdi {
    fn talk(&mut self) -> Result<(), Trouble> {
        while !self.work.stops().are_asked() {
            // A pipe is read ahead, so that the controller plans through; a terminal waits for the rest.
            let next = if self.ahead >= MAX_AHEAD {
                NextLine::Later
            } else {
                self.input.next(false)
            };
            match next {
                NextLine::Over => break,
                NextLine::Line(line) if is_farewell(&line) => break,
                NextLine::Line(line) => {
                    self.lines += 1;
                    match line.trim() {
                        "" => {}
                        RESET => self.reset()?,
                        _ => self.say(&line)?,
                    }
                    if self.work.keys {
                        let keys = self.work.take_keys();
                        self.rest()?;
                        drop(keys);
                        self.work.connection.release_lease()?;
                    }
                }
                NextLine::Later => {
                    if self.hear()?.is_none() {
                        thread::sleep(LOOK);
                    }
                }
            }
        }
        self.rest()
    }

    /// Sends a line. One that is refused while others are driven may be too early: it is sent once more behind them.
    fn say(&mut self, line: &str) -> Result<(), Trouble> {
        self.work
            .connection
            .take_lease()
            .or_else(|trouble| self.refuse(trouble))?;
        let with = || json!({ "line": line });
        let early = self.ahead > 0;
        let mut said = self.work.ask_to_move("mdi", with());
        if early && matches!(said, Err(Trouble::Refused(_))) {
            self.rest()?;
            said = self.work.ask_to_move("mdi", with());
        }
        match said {
            Ok(_) => {
                self.ahead += 1;
                self.driving = true;
                Ok(())
            }
            Err(trouble) => self.refuse(trouble),
        }
    }

    fn reset(&mut self) -> Result<(), Trouble> {
        self.rest()?;
        let done = self.work.connection.take_lease();
        match done.and_then(|()| self.work.ask_to_move("reset", json!({}))) {
            Ok(_) => {
                self.fault = false;
                Ok(())
            }
            Err(trouble) => self.refuse(trouble),
        }
    }

    fn refuse(&mut self, trouble: Trouble) -> Result<(), Trouble> {
        match trouble {
            Trouble::Refused(why) => {
                self.refused = true;
                tell(&self.numbered(&why));
                Ok(())
            }
            // What is driven comes to its end first.
            Trouble::Stopped => Ok(()),
            gone @ Trouble::Gone(_) => Err(gone),
        }
    }

    /// The words of a refusal with the number of the line here: the controller counts those of a job.
    fn numbered(&self, why: &str) -> String {
        let behind = why.strip_prefix("input:").and_then(|rest| {
            let (line, behind) = rest.split_once(':')?;
            line.parse::<u32>().is_ok().then_some(behind)
        });
        behind.map_or_else(
            || why.to_string(),
            |behind| format!("input:{}:{behind}", self.lines),
        )
    }

    /// Until all lines are driven, or are not going to be.
    fn rest(&mut self) -> Result<(), Trouble> {
        while self.ahead > 0 || self.driving {
            self.hear()?;
        }
        Ok(())
    }

    fn hear(&mut self) -> Result<Option<Value>, Trouble> {
        let told = self.work.hear()?;
        let Some(told) = told else {
            return Ok(None);
        };
        match told["event"].as_str() {
            Some("driven" | "not-driven") => self.ahead = self.ahead.saturating_sub(1),
            Some("job") if told["job"]["job"] == "mdi" => {
                // Lines that came while it ended are the next job's.
                self.driving = self.ahead > 0;
                let end = JobEnd::of(&told);
                end.tell();
                if end.fault().is_some() {
                    self.fault = true;
                    tell(&format!("{RESET} goes on from here"));
                } else {
                    // A reader that has gone away is no reason to stop.
                    let _ = writeln!(stdout(), "{}", end.position());
                }
            }
            Some("refused") => (self.driving, self.refused) = (false, true),
            _ => {}
        }
        Ok(Some(told))
    }
}
