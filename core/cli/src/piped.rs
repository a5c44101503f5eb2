//! `tandem run -`: the lines of standard input, driven as they come.

use std::sync::mpsc::{Receiver, RecvTimeoutError, TryRecvError, sync_channel};
use std::sync::{Arc, OnceLock};
use std::thread;

use tandem_host::{HostError, Registry, Run, Switches};
use tandem_machine::Machine;
use tandem_session::operator::OperatorHub;
use tandem_session::{MdiInput, MdiSession, NextLine, Pace};

use crate::mdi::input::plain_line;
use crate::operator::LOOK;

/// Lines that are read ahead: a pipe holds as much.
const MAX_AHEAD: usize = 1000;

/// The operator's hub of the run, once there is one: behind an abort no line is waited for.
pub type Follow = Arc<OnceLock<Arc<OperatorHub>>>;

/// A run of what standard input says.
///
/// # Errors
/// Everything that refuses.
pub fn prepare(
    machine: &Machine,
    registry: &Registry,
    switches: Switches,
    real_time: bool,
) -> Result<(Run, Follow), HostError> {
    let follow = Follow::default();
    let input = Piped {
        lines: None,
        real_time,
        follow: Arc::clone(&follow),
    };
    let input = Box::new(input);
    let session = MdiSession::new(machine.clone(), registry, switches, Pace::Streams, input)?;
    Ok((session.enable()?, follow))
}

struct Piped {
    /// What a thread reads, from the first line that is asked for on.
    lines: Option<Receiver<String>>,
    real_time: bool,
    follow: Follow,
}

impl MdiInput for Piped {
    fn next_line(&mut self) -> NextLine {
        let lines = self.lines.get_or_insert_with(read);
        loop {
            if self.follow.get().is_some_and(|hub| hub.is_stopping()) {
                return NextLine::Over;
            }
            if self.real_time {
                return match lines.try_recv() {
                    Ok(line) => NextLine::Line(line),
                    Err(TryRecvError::Empty) => NextLine::Later,
                    Err(TryRecvError::Disconnected) => NextLine::Over,
                };
            }
            match lines.recv_timeout(LOOK) {
                Ok(line) => return NextLine::Line(line),
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => return NextLine::Over,
            }
        }
    }
}

/// A thread that reads lines until there are no more, or nobody listens.
fn read() -> Receiver<String> {
    let (sender, lines) = sync_channel(MAX_AHEAD);
    thread::spawn(move || {
        while let Some(line) = plain_line() {
            if sender.send(line).is_err() {
                return;
            }
        }
    });
    lines
}
