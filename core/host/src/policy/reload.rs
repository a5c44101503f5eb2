//! A new script in the place of the one that runs: read and compiled off the loops, put in place between two windows.

use std::path::Path;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::thread;
use std::time::{Duration, SystemTime};

use tandem_policy::{Instance, Script};

use super::PolicyHost;

/// How often the file is looked at.
const LOOK: Duration = Duration::from_secs(1);

/// What was read, compiled and started; or why not.
type Candidate = Result<(Script, Instance), String>;

/// Loads the script anew: where asked to, and on the wall clock where its file changes.
pub struct Reloader {
    host: PolicyHost,
    watch: Option<Watch>,
}

/// A thread that looks at the file, and compiles it where it has changed or where asked to.
struct Watch {
    ask: Sender<()>,
    candidates: Receiver<Candidate>,
}

impl Reloader {
    pub fn new(host: PolicyHost) -> Self {
        Self { host, watch: None }
    }

    /// Looks at the file from now on, on a thread of its own.
    ///
    /// # Errors
    /// The thread cannot be started; the run goes on without.
    pub fn watch(&mut self) -> Result<(), String> {
        let (ask, asked) = channel();
        let (found, candidates) = channel();
        let host = self.host.clone();
        let builder = thread::Builder::new().name("tandem-policy".to_string());
        let started = builder.spawn(move || look(&host, &asked, &found));
        started.map_err(|e| format!("policy: the file is not watched for changes: {e}"))?;
        self.watch = Some(Watch { ask, candidates });
        Ok(())
    }

    /// Between two rough periods, when no window is open: puts a new script in place, if there is one. `asked`: it is to
    /// be loaded though the file has not changed.
    pub fn serve(&self, asked: bool) {
        let Some(watch) = &self.watch else {
            if asked {
                self.take(candidate(&self.host));
            }
            return;
        };
        if asked {
            // The thread ends with the run only.
            let _ = watch.ask.send(());
        }
        while let Ok(candidate) = watch.candidates.try_recv() {
            self.take(candidate);
        }
    }

    /// What the script did since the last look.
    pub fn take_notes(&self) -> Vec<String> {
        self.host.take_notes()
    }

    fn take(&self, candidate: Candidate) {
        let mut policy = self.host.lock();
        let swapped = candidate.and_then(|(script, instance)| policy.swap(script, instance).map_err(|e| e.to_string()));
        if let Err(why) = swapped {
            policy.keep(&why);
        }
    }
}

/// Reads, compiles and starts the script as it is now.
fn candidate(host: &PolicyHost) -> Candidate {
    let bytes = std::fs::read(&host.path).map_err(|e| format!("{}: {e}", host.path.display()))?;
    let script = host.engine.compile(&bytes).map_err(|e| e.to_string())?;
    let (values, budget) = {
        let policy = host.lock();
        (policy.values().clone(), *policy.budget())
    };
    let instance = Instance::new(&script, &budget, &values).map_err(|e| e.to_string())?;
    Ok((script, instance))
}

/// The life of the thread: until the run ends.
fn look(host: &PolicyHost, asked: &Receiver<()>, found: &Sender<Candidate>) {
    let mut seen = stamp(&host.path);
    loop {
        let asked = match asked.recv_timeout(LOOK) {
            Ok(()) => true,
            Err(RecvTimeoutError::Timeout) => false,
            Err(RecvTimeoutError::Disconnected) => return,
        };
        let now = stamp(&host.path);
        // A file that is just being written or replaced is looked at again.
        if (asked || now != seen) && now.is_some() {
            seen = now;
            if found.send(candidate(host)).is_err() {
                return;
            }
        }
    }
}

fn stamp(path: &Path) -> Option<(SystemTime, u64)> {
    let data = std::fs::metadata(path).ok()?;
    Some((data.modified().ok()?, data.len()))
}
