//! What jobs leave behind: a folder each, with the files that a run writes.

use std::fs;
use std::path::{Path, PathBuf};

use tandem_host::JobOutcome;
use tandem_machine::Machine;
use tandem_recorder::{BlocksCsv, EventsCsv, RecordError, TraceCsv};
use tandem_rings::Sample;
use tandem_sdk::{Block, BlockReport, Event};

/// The files of one job while it is driven. What cannot be written any further is told once, and the motion goes on.
pub struct Recording {
    folder: PathBuf,
    trace: TraceCsv,
    blocks: BlocksCsv,
    events: EventsCsv,
    errors: Vec<String>,
}

impl Recording {
    /// Begins the files of job `number`, what it is in a word, in a folder of their own below `root`. Host; allocates.
    ///
    /// # Errors
    /// A file cannot be made.
    pub fn begin(
        root: &Path,
        (number, what): (u64, &str),
        machine: &Machine,
        signals: &[String],
    ) -> Result<Self, String> {
        let folder = root.join(format!("{number:06}-{what}"));
        fs::create_dir_all(&folder).map_err(|e| format!("{}: {e}", folder.display()))?;
        let signals: Vec<&str> = signals.iter().map(String::as_str).collect();
        Ok(Self {
            trace: TraceCsv::create(&folder.join("trace.csv"), machine, &signals)?,
            blocks: BlocksCsv::create(&folder.join("blocks.csv"), machine)?,
            events: EventsCsv::create(&folder.join("events.csv"), machine.fine_period_s)?,
            folder,
            errors: vec![],
        })
    }

    /// A block is planned for good.
    pub fn block(&mut self, block: &Block, report: &BlockReport) {
        self.blocks.block(block, report);
    }

    /// A word that is no motion is planned.
    pub fn event(&mut self, event: &Event) {
        self.events.event(event);
    }

    /// A sample was sent.
    pub fn sample(&mut self, sample: &Sample, signals: &[f64]) {
        let written = [
            self.trace.sample(sample, signals),
            self.blocks.sample(sample),
            self.events.sample(sample),
        ];
        note(&mut self.errors, written);
    }

    /// The job is over: the files take their names. The answer is what could not be written, in words.
    pub fn finish(self, outcome: &JobOutcome) -> Vec<String> {
        let mut errors = self.errors;
        let whole = outcome.fault.is_none() && !outcome.aborted;
        note(
            &mut errors,
            [
                self.trace.finish(),
                self.blocks.finish(),
                self.events.finish(&outcome.left, whole),
            ],
        );
        let path = self.folder.join("summary.json");
        let written = serde_json::to_string_pretty(&outcome.summary)
            .map_err(|e| e.to_string())
            .and_then(|text| fs::write(&path, text + "\n").map_err(|e| e.to_string()));
        errors.extend(
            written
                .err()
                .map(|why| format!("{}: {why}", path.display())),
        );
        errors
    }
}

fn note(errors: &mut Vec<String>, written: [Result<(), RecordError>; 3]) {
    let failed = written.into_iter().filter_map(Result::err);
    errors.extend(failed.map(|error| error.to_string()));
}
