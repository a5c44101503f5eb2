//! What is done when a loop does not come back: it is said, what was recorded is kept, and the process ends.

use std::path::PathBuf;
use std::sync::atomic::Ordering::Relaxed;
use std::sync::{Arc, Mutex, PoisonError};

use serde_json::json;
use tandem_host::Run;
use tandem_machine::Machine;
use tandem_recorder::flush_outputs;
use tandem_rings::Status;
use tandem_session::operator::Counters;

use crate::operator::restore_terminal;
use crate::{FAULT, operator};

/// What is known of the run without the threads that drive it.
struct LastWords {
    path: PathBuf,
    program: String,
    machine: String,
    planner: String,
    clock: &'static str,
    status: Arc<Status>,
}

static LAST_WORDS: Mutex<Option<LastWords>> = Mutex::new(None);

/// From now on a loop that does not come back ends the process with exit status 3. Once, at start.
pub fn arrange() {
    tandem_host::at_hang(|words| {
        restore_terminal();
        operator::tell(&format!("fault: {words}"));
        let left = "the process ends here, so that the drives' own watchdog stops what still moves";
        say!("{left}; what was recorded until now is kept");
        let last = LAST_WORDS
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .take();
        let summary = last.as_ref().map(LastWords::in_the_making);
        for path in flush_outputs()
            .into_iter()
            .filter(|path| Some(path) != summary.as_ref())
        {
            say!("incomplete: {}", path.display());
        }
        if let Some(last) = last {
            last.write(words);
        }
        // Destructors would wait for the thread that hangs.
        std::process::exit(i32::from(FAULT));
    });
}

/// A run begins: where its summary goes that is written without it.
pub fn summarise_in(
    path: Option<&PathBuf>,
    program: &str,
    machine: &Machine,
    clock: &'static str,
    run: &Run,
) {
    let last = path.map(|path| LastWords {
        path: path.clone(),
        program: program.to_string(),
        machine: machine.name.clone(),
        planner: machine.planner.plugin.clone(),
        clock,
        status: run.status(),
    });
    *LAST_WORDS.lock().unwrap_or_else(PoisonError::into_inner) = last;
}

impl LastWords {
    /// Where the summary would be made, which nobody finishes any more.
    fn in_the_making(&self) -> PathBuf {
        let mut part = self.path.as_os_str().to_owned();
        part.push(".part");
        part.into()
    }

    /// Only what is known: numbers that the threads of the run have not handed out are left out.
    fn write(&self, fault: &str) {
        let status = &self.status;
        let summary = json!({
            "format": tandem_recorder::SUMMARY_FORMAT,
            "program": self.program,
            "machine": self.machine,
            "planner": self.planner,
            "clock": self.clock,
            "incomplete": true,
            "line": status.line.load(Relaxed),
            "counters": Counters::of(status),
            "fault": fault,
        });
        let _ = std::fs::remove_file(self.in_the_making());
        if let Err(error) = std::fs::write(&self.path, format!("{summary:#}\n")) {
            say!("{}: {error}", self.path.display());
        }
    }
}
