//! Enter on a standard input that is no terminal of ours: a pipe, or a terminal on the virtual clock.

use std::io::stdin;
use std::sync::mpsc::{Receiver, TryRecvError, channel};
use std::thread;

/// Reads one line when it is asked for, without waiting for it.
#[derive(Default)]
pub struct Enter {
    asked: Option<Receiver<bool>>,
    over: bool,
}

impl Enter {
    /// None comes: standard input is for something else.
    pub fn never() -> Self {
        Self {
            asked: None,
            over: true,
        }
    }

    /// Whether a line has come; `Some(false)` where none will.
    pub fn look(&mut self) -> Option<bool> {
        if self.over {
            return Some(false);
        }
        let asked = self.asked.get_or_insert_with(ask);
        let answer = match asked.try_recv() {
            Ok(pressed) => pressed,
            Err(TryRecvError::Empty) => return None,
            Err(TryRecvError::Disconnected) => false,
        };
        (self.asked, self.over) = (None, !answer);
        Some(answer)
    }
}

/// A thread that reads one line. Where none comes before the run ends, it ends with the process.
fn ask() -> Receiver<bool> {
    let (sender, receiver) = channel();
    thread::spawn(move || {
        let read = stdin().read_line(&mut String::new());
        // Nobody listens any more only where the run is over.
        let _ = sender.send(read.is_ok_and(|bytes| bytes > 0));
    });
    receiver
}
