//! Signals that end a program: they stop the machine first.

use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use std::thread::{self, JoinHandle};

use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
use signal_hook::iterator::{Handle, Signals as Received};
use tandem_host::Command;
use tandem_host::operator::Desk;

use super::tell;

/// How to stop: the first time on the path, then at once.
#[derive(Clone, Default)]
pub struct Stops(Arc<AtomicU32>);

impl Stops {
    /// Whether a stop was asked for.
    pub fn are_asked(&self) -> bool {
        self.0.load(Ordering::Relaxed) > 0
    }

    /// Asks once more.
    pub fn ask(&self, desk: &Desk) -> String {
        let (command, words) = match self.0.fetch_add(1, Ordering::Relaxed) {
            0 => (Command::Abort, "abort: stopping on the path; once more is an emergency stop"),
            _ => (Command::EmergencyStop, "emergency stop"),
        };
        // Stopping is never refused.
        desk.give(command).map_or_else(|refusal| refusal, |_| words.to_string())
    }
}

/// Catches signals while it lives.
pub struct Signals {
    stops: Stops,
    handle: Handle,
    thread: Option<JoinHandle<()>>,
}

impl Signals {
    /// From now on SIGINT, SIGTERM and SIGHUP stop the machine.
    ///
    /// # Errors
    /// The system's words.
    pub fn catch(desk: Arc<Desk>) -> Result<Self, String> {
        Self::catch_with(desk, Stops::default())
    }

    /// The same, counted on in `stops`.
    ///
    /// # Errors
    /// The system's words.
    pub fn catch_with(desk: Arc<Desk>, stops: Stops) -> Result<Self, String> {
        let mut received = Received::new([SIGINT, SIGTERM, SIGHUP]).map_err(|e| format!("signals: {e}"))?;
        let handle = received.handle();
        let asked = stops.clone();
        let thread = thread::spawn(move || {
            for _ in received.forever() {
                tell(&asked.ask(&desk));
            }
        });
        Ok(Self { stops, handle, thread: Some(thread) })
    }

    /// The count that Ctrl-C on the keyboard shares.
    pub fn stops(&self) -> Stops {
        self.stops.clone()
    }
}

impl Drop for Signals {
    fn drop(&mut self) {
        self.handle.close();
        if let Some(thread) = self.thread.take() {
            // It has nothing left to do; how it ended does not matter.
            let _ = thread.join();
        }
    }
}
