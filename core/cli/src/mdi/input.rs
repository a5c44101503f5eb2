//! Lines of standard input, one when it is asked for.

use std::io::stdin;
use std::sync::mpsc::{Receiver, TryRecvError, channel};
use std::thread;

use tandem_session::NextLine;

/// Reads a line only while one is asked for, so that keys pressed during motion are nobody's line.
#[derive(Default)]
pub struct Input {
    asked: Option<Receiver<Option<String>>>,
    over: bool,
}

impl Input {
    /// The line, if it has come; where it `may_wait`, until it has.
    pub fn next(&mut self, may_wait: bool) -> NextLine {
        if self.over {
            return NextLine::Over;
        }
        let asked = self.asked.get_or_insert_with(ask);
        let read = if may_wait {
            asked.recv().unwrap_or(None)
        } else {
            match asked.try_recv() {
                Err(TryRecvError::Empty) => return NextLine::Later,
                Err(TryRecvError::Disconnected) => None,
                Ok(read) => read,
            }
        };
        self.asked = None;
        self.over = read.is_none();
        read.map_or(NextLine::Over, NextLine::Line)
    }
}

/// A thread that reads one line; it ends with the process where none comes.
fn ask() -> Receiver<Option<String>> {
    let (sender, receiver) = channel();
    thread::spawn(move || {
        let mut line = String::new();
        let read = stdin().read_line(&mut line).is_ok_and(|bytes| bytes > 0);
        line.truncate(line.trim_end_matches(['\r', '\n']).len());
        // Nobody listens any more only where the session is over.
        let _ = sender.send(read.then_some(line));
    });
    receiver
}
