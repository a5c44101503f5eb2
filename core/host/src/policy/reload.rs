//! A new script in the place of the one that runs: read and compiled off the loops, put in place between two windows.

use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::thread;
use std::time::Duration;

use tandem_policy::{Instance, Script};
use tandem_recorder::PolicySummary;

use super::host::{PolicyHost, stamp};

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

    /// What the script did until now.
    pub fn summary(&self) -> PolicySummary {
        self.host.summary()
    }

    fn take(&self, candidate: Candidate) {
        let mut policy = self.host.lock();
        let swapped = candidate.and_then(|(script, instance)| {
            policy.swap(script, instance).map_err(|e| e.to_string())
        });
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
    let mut seen = host.stamp;
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

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use tandem_machine::Machine;

    const ONE: &str = include_str!("../../../../tests/fixtures/policies/good/half-feed.wat");
    const OTHER: &str = include_str!("../../../../tests/fixtures/policies/hostile/nan.wat");

    /// Looks every rough period, for a minute at most.
    fn until(reloader: &Reloader, done: impl Fn(&PolicySummary) -> bool) -> PolicySummary {
        for _ in 0..7500 {
            reloader.serve(false);
            let summary = reloader.summary();
            if done(&summary) {
                return summary;
            }
            thread::sleep(Duration::from_millis(8));
        }
        panic!("the file is not looked at: {:?}", reloader.summary());
    }

    #[test]
    fn a_file_that_changes_is_taken_and_a_bad_one_leaves_the_old_script_running() {
        let folder = tempfile::TempDir::new().unwrap();
        let file = folder.path().join("policy.wat");
        std::fs::write(&file, ONE).unwrap();
        let mill =
            Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/machines/mill-3axis.toml");
        let set = ("policy.script".to_string(), file.display().to_string());
        let host = PolicyHost::open(&Machine::read(&mill, &[set]).unwrap(), &[])
            .unwrap()
            .unwrap();
        let mut reloader = Reloader::new(host.clone());
        reloader.watch().unwrap();
        std::fs::write(&file, "no module").unwrap();
        let refused = until(&reloader, |summary| summary.refused_reloads > 0);
        assert_eq!(refused.reloads, 0);
        assert!(
            reloader.take_notes()[0].contains("the old one goes on: not a WASM module"),
            "the cause is told"
        );
        std::fs::write(&file, OTHER).unwrap();
        assert_eq!(until(&reloader, |summary| summary.reloads > 0).reloads, 1);
        // Asked to, it takes a file that has not changed.
        reloader.serve(true);
        assert_eq!(until(&reloader, |summary| summary.reloads > 1).reloads, 2);
    }
}
