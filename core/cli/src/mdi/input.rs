//! Lines of standard input, one when it is asked for.

use std::io::{BufRead, Read, stdin};
use std::sync::mpsc::{Receiver, Sender, TryRecvError, channel};
use std::thread;

use tandem_gcode::MAX_LINE_BYTES;
use tandem_session::NextLine;

use super::editor::LineEditor;
use crate::operator::{keep_terminal, restore_terminal};

/// Reads a line only while one is asked for, so that keys pressed during motion are nobody's line.
#[derive(Default)]
pub struct Input {
    reader: Option<Reader>,
    /// A line is asked for.
    asked: bool,
    over: bool,
    /// Lines are typed at a terminal.
    typed: bool,
}

/// The thread that reads; it ends with the process where no line comes.
struct Reader {
    ask: Sender<()>,
    read: Receiver<Option<String>>,
}

impl Input {
    /// Lines that are `typed` at a terminal, with history and completion, or those of a pipe.
    pub fn new(typed: bool) -> Self {
        Self {
            reader: None,
            asked: false,
            over: false,
            typed,
        }
    }

    /// The line, if it has come; where it `may_wait`, until it has.
    pub fn next(&mut self, may_wait: bool) -> NextLine {
        if self.over {
            return NextLine::Over;
        }
        let reader = self.reader.get_or_insert_with(|| reader(self.typed));
        if !self.asked {
            self.asked = true;
            // A reader that is gone says so below.
            let _ = reader.ask.send(());
        }
        let read = if may_wait {
            reader.read.recv().unwrap_or(None)
        } else {
            match reader.read.try_recv() {
                Err(TryRecvError::Empty) => return NextLine::Later,
                Err(TryRecvError::Disconnected) => None,
                Ok(read) => read,
            }
        };
        self.asked = false;
        self.over = read.is_none();
        read.map_or(NextLine::Over, NextLine::Line)
    }
}

impl Drop for Input {
    fn drop(&mut self) {
        if self.typed && self.asked {
            // The editor still has the terminal.
            restore_terminal();
        }
    }
}

fn reader(typed: bool) -> Reader {
    let (ask, asked) = channel::<()>();
    let (sender, read) = channel();
    thread::spawn(move || {
        let mut editor = if typed { LineEditor::new().ok() } else { None };
        for () in asked {
            let line = match &mut editor {
                Some(editor) => {
                    keep_terminal();
                    editor.line()
                }
                None => plain_line(),
            };
            // Nobody listens any more only where the session is over.
            if sender.send(line).is_err() {
                return;
            }
        }
    });
    Reader { ask, read }
}

/// The next line of a pipe; what is too long for a line is cut off behind what shows that. Comments may hold any bytes.
pub fn plain_line() -> Option<String> {
    let room = MAX_LINE_BYTES as u64 + 2;
    let mut input = stdin().lock();
    let mut line = vec![];
    let read = |line: &mut Vec<u8>, input: &mut dyn BufRead| {
        let bytes = input.take(room).read_until(b'\n', line);
        bytes.is_ok_and(|bytes| bytes > 0)
    };
    let is_there = read(&mut line, &mut input);
    let mut rest = line.clone();
    while rest.len() as u64 == room && !rest.ends_with(b"\n") {
        rest.clear();
        read(&mut rest, &mut input);
    }
    let line = String::from_utf8_lossy(&line);
    is_there.then(|| line.trim_end_matches(['\r', '\n']).to_string())
}
