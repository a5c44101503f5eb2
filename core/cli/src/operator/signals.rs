//! Signals that end a program: they stop the machine first.

use std::ops::RangeInclusive;
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use std::thread::{self, JoinHandle};

use rustix::process::Signal;
use signal_hook::iterator::{Handle, Signals as Received};
use tandem_host::Command;

use super::panel::Panel;
use super::tell;

/// Signals whose default is to end the process, and that may be sent to one that is whole. In the middle of motion each
/// is a stop.
const STOPS: [Signal; 13] = [
    Signal::INT,
    Signal::TERM,
    Signal::HUP,
    Signal::QUIT,
    Signal::USR1,
    Signal::USR2,
    Signal::ALARM,
    Signal::VTALARM,
    Signal::PROF,
    Signal::XCPU,
    Signal::IO,
    Signal::POWER,
    Signal::STKFLT,
];
/// The real-time signals that the C library leaves to programs: their default is to end the process as well.
const REAL_TIME: RangeInclusive<i32> = 34..=64;
/// Signals that change nothing: those of the terminal would put the process to sleep while the machine moves, and what a
/// write says that fails is enough.
const IGNORED: [Signal; 5] = [
    Signal::TSTP,
    Signal::TTIN,
    Signal::TTOU,
    Signal::PIPE,
    Signal::XFSZ,
];

/// How to stop: the first time on the path, then at once.
#[derive(Clone, Default)]
pub struct Stops(Arc<AtomicU32>);

impl Stops {
    /// Whether a stop was asked for.
    pub fn are_asked(&self) -> bool {
        self.0.load(Ordering::Relaxed) > 0
    }

    /// The session is to end where nothing moves any more.
    pub fn end(&self) {
        self.0.fetch_max(1, Ordering::Relaxed);
    }

    /// Asks once more.
    pub fn ask(&self, panel: &dyn Panel) -> String {
        let (command, words) = match self.0.fetch_add(1, Ordering::Relaxed) {
            0 => (
                Command::Abort,
                "abort: stopping on the path; once more is an emergency stop",
            ),
            _ => (Command::EmergencyStop, "emergency stop"),
        };
        // Stopping is never refused.
        panel
            .give(command)
            .map_or_else(|refusal| refusal, |()| words.to_string())
    }
}

/// Catches signals while it lives.
pub struct Signals {
    stops: Stops,
    handle: Handle,
    thread: Option<JoinHandle<()>>,
}

impl Signals {
    /// From now on signals that would end the process stop the machine.
    ///
    /// # Errors
    /// The system's words.
    pub fn catch(panel: Arc<dyn Panel>) -> Result<Self, String> {
        Self::catch_with(panel, Stops::default())
    }

    /// The same, counted on in `stops`.
    ///
    /// # Errors
    /// The system's words.
    pub fn catch_with(panel: Arc<dyn Panel>, stops: Stops) -> Result<Self, String> {
        let named = STOPS.iter().chain(&IGNORED).map(|signal| signal.as_raw());
        let mut received =
            Received::new(named.chain(REAL_TIME)).map_err(|e| format!("signals: {e}"))?;
        let handle = received.handle();
        let asked = stops.clone();
        let thread = thread::spawn(move || {
            let is_ignored =
                |signal: &i32| IGNORED.iter().any(|ignored| ignored.as_raw() == *signal);
            for _ in received.forever().filter(|signal| !is_ignored(signal)) {
                tell(&asked.ask(&*panel));
            }
        });
        Ok(Self {
            stops,
            handle,
            thread: Some(thread),
        })
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
