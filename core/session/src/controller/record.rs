//! What jobs leave behind: a folder each, with the files that a run writes.
//!
//! On the wall clock a thread writes them: a disk that takes its time, or hangs, never holds the loop that drives. What it has not
//! taken waits in a queue that has an end.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread;

use super::arrivals::wait_while;
use tandem_host::{Clock, JobOutcome};
use tandem_machine::Machine;
use tandem_recorder::{BlocksCsv, EventsCsv, RecordError, TraceCsv};
use tandem_rings::Sample;
use tandem_sdk::{Block, BlockReport, Event};

/// How far the files of a job may be behind its motion.
const MAX_BEHIND_S: f64 = 5.0;
/// Jobs whose files a disk may not have taken yet.
const MAX_WRITERS: usize = 4;
/// Stack of a thread, bytes: it is locked into memory with the rest.
const STACK_BYTES: usize = 512 * 1024;

/// Who is told, in words, of what cannot be written.
pub type Raise = Arc<dyn Fn(&str) + Send + Sync>;

/// Where jobs leave their files.
pub struct Records {
    pub root: PathBuf,
    pub clock: Clock,
    pub raise: Raise,
    /// One more for each thread that writes.
    writers: Arc<()>,
    /// How many rough periods the files may be behind.
    max_behind: usize,
}

impl Records {
    pub fn new(root: PathBuf, clock: Clock, rough_period_s: f64, raise: Raise) -> Self {
        Self {
            root,
            clock,
            raise,
            writers: Arc::default(),
            max_behind: (MAX_BEHIND_S / rough_period_s) as usize + 1,
        }
    }

    /// Begins the files of job `number`, what it is in a word, in a folder of their own. What goes wrong is raised, and
    /// [`Recording::broken`] says it. Host; allocates; waits for a disk in lockstep alone.
    pub fn begin(
        &self,
        (number, what): (u64, &str),
        machine: &Machine,
        signals: Vec<String>,
    ) -> Recording {
        let folder = self.root.join(format!("{number:06}-{what}"));
        let told = Told {
            raise: Arc::clone(&self.raise),
            news: Arc::default(),
        };
        let writer = match self.clock {
            Clock::Virtual => Files::begin(folder.clone(), machine, &signals)
                .map(|files| Writer::Here(Box::new(files))),
            Clock::Wall => self.spawn(&folder, machine, signals, &told),
        };
        let writer = writer.unwrap_or_else(|why| {
            told.tell(&why);
            Writer::Nobody
        });
        Recording {
            folder,
            writer,
            told,
        }
    }

    /// Waits until everything is written, as long as the end of a controller may.
    pub fn wait_for_all(&self) {
        wait_while(|| Arc::strong_count(&self.writers) > 1);
    }

    fn spawn(
        &self,
        folder: &Path,
        machine: &Machine,
        signals: Vec<String>,
        told: &Told,
    ) -> Result<Writer, String> {
        // One of the counts is our own.
        if Arc::strong_count(&self.writers) > MAX_WRITERS {
            return Err(format!(
                "{}: the disk has not taken the files of {MAX_WRITERS} jobs yet: this one leaves none",
                folder.display()
            ));
        }
        let (entries, coming) = sync_channel(self.max_behind);
        let folder = folder.to_owned();
        let machine = machine.clone();
        let told = told.clone();
        let counts = Arc::clone(&self.writers);
        let builder = thread::Builder::new()
            .name("tandem-record".to_string())
            .stack_size(STACK_BYTES);
        let begun = builder.spawn(move || {
            match Files::begin(folder, &machine, &signals) {
                Ok(files) => write_all(files, &coming, &told),
                Err(why) => told.tell(&why),
            }
            drop(counts);
        });
        begun.map_err(|why| format!("there is no thread that writes files: {why}"))?;
        Ok(Writer::Thread {
            entries,
            batch: vec![],
        })
    }
}

/// Says what cannot be written: to everybody, and to the loop that drives.
#[derive(Clone)]
struct Told {
    raise: Raise,
    news: Arc<Mutex<Vec<String>>>,
}

impl Told {
    fn tell(&self, why: &str) {
        (self.raise)(why);
        self.lock().push(why.to_string());
    }

    fn lock(&self) -> MutexGuard<'_, Vec<String>> {
        // What lies in it is whole after every statement.
        self.news.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The files of one job while it is driven.
pub struct Recording {
    folder: PathBuf,
    writer: Writer,
    told: Told,
}

enum Writer {
    /// In lockstep nobody waits for the motion.
    Here(Box<Files>),
    Thread {
        entries: SyncSender<Vec<Entry>>,
        /// What has come in this rough period.
        batch: Vec<Entry>,
    },
    /// Nothing is written, or no further.
    Nobody,
}

/// What is written.
enum Entry {
    Block(Box<(Block, BlockReport)>),
    Event(Event),
    Sample(Box<Sample>, Box<[f64]>),
    End(Box<JobOutcome>),
}

impl Recording {
    fn take(&mut self, entry: Entry) {
        match &mut self.writer {
            Writer::Here(files) => files.write(entry, &self.told),
            Writer::Thread { batch, .. } => batch.push(entry),
            Writer::Nobody => {}
        }
    }

    /// A block is planned for good. Soft side; allocates.
    pub fn block(&mut self, block: &Block, report: &BlockReport) {
        self.take(Entry::Block(Box::new((*block, *report))));
    }

    /// A word that is no motion is planned. Soft side.
    pub fn event(&mut self, event: &Event) {
        self.take(Entry::Event(*event));
    }

    /// A sample was sent. Soft side; allocates.
    pub fn sample(&mut self, sample: &Sample, signals: &[f64]) {
        self.take(Entry::Sample(Box::new(*sample), signals.into()));
    }

    /// A rough period is over: what has come in it goes to the thread that writes, and nobody waits for that. Soft side.
    pub fn period(&mut self) {
        let Writer::Thread { entries, batch } = &mut self.writer else {
            return;
        };
        if batch.is_empty() {
            return;
        }
        let sent = entries.try_send(std::mem::take(batch));
        if let Err(TrySendError::Full(left)) = &sent {
            let from = left.iter().find_map(|entry| match entry {
                Entry::Sample(sample, _) => Some(sample.tick),
                _ => None,
            });
            let from = from.map_or_else(String::new, |tick| format!(" from tick {tick} on"));
            self.told.tell(&format!(
                "{}: the disk does not keep up: nothing is written{from}; what it takes of what came before stays in files *.part",
                self.folder.display()
            ));
        }
        // A thread that is gone has said why.
        if sent.is_err() {
            self.writer = Writer::Nobody;
        }
    }

    /// What cannot be written any further, in words, once. Soft side.
    pub fn broken(&mut self) -> Option<String> {
        let news = std::mem::take(&mut *self.told.lock());
        (!news.is_empty()).then(|| news.join("; "))
    }

    /// The job is over: the files take their names, on the wall clock some time later.
    pub fn finish(mut self, outcome: &JobOutcome) {
        self.take(Entry::End(Box::new(outcome.clone())));
        self.period();
    }
}

/// Writes what comes until the job is over. Where it is not told of the end, what is there stays as it is.
fn write_all(mut files: Files, coming: &Receiver<Vec<Entry>>, told: &Told) {
    while let Ok(batch) = coming.recv() {
        for entry in batch {
            files.write(entry, told);
        }
    }
    files.give_up();
}

/// The files; none of them once the job is over.
struct Files {
    folder: PathBuf,
    open: Option<(TraceCsv, BlocksCsv, EventsCsv)>,
}

impl Files {
    /// Makes the folder and the files in it. Waits for the disk.
    fn begin(folder: PathBuf, machine: &Machine, signals: &[String]) -> Result<Self, String> {
        fs::create_dir_all(&folder).map_err(|e| format!("{}: {e}", folder.display()))?;
        let signals: Vec<&str> = signals.iter().map(String::as_str).collect();
        let trace = TraceCsv::create(&folder.join("trace.csv"), machine, &signals)?;
        let blocks = BlocksCsv::create(&folder.join("blocks.csv"), machine)?;
        let events = EventsCsv::create(&folder.join("events.csv"), machine.fine_period_s)?;
        Ok(Self {
            folder,
            open: Some((trace, blocks, events)),
        })
    }

    fn write(&mut self, entry: Entry, told: &Told) {
        let Some((trace, blocks, events)) = &mut self.open else {
            return;
        };
        match entry {
            Entry::Block(of) => blocks.block(&of.0, &of.1),
            Entry::Event(event) => events.event(&event),
            Entry::Sample(sample, signals) => note(
                told,
                [
                    trace.sample(&sample, &signals),
                    blocks.sample(&sample),
                    events.sample(&sample),
                ],
            ),
            Entry::End(outcome) => self.finish(&outcome, told),
        }
    }

    fn finish(&mut self, outcome: &JobOutcome, told: &Told) {
        let Some((trace, blocks, events)) = self.open.take() else {
            return;
        };
        let whole = outcome.fault.is_none() && !outcome.aborted;
        note(
            told,
            [
                trace.finish(),
                blocks.finish(),
                events.finish(&outcome.left, whole),
            ],
        );
        let path = self.folder.join("summary.json");
        let written = serde_json::to_string_pretty(&outcome.summary)
            .map_err(|e| e.to_string())
            .and_then(|text| fs::write(&path, text + "\n").map_err(|e| e.to_string()));
        if let Err(why) = written {
            told.tell(&format!("{}: {why}", path.display()));
        }
    }

    fn give_up(self) {
        if let Some((trace, blocks, events)) = self.open {
            trace.give_up();
            blocks.give_up();
            events.give_up();
        }
    }
}

fn note(told: &Told, written: [Result<(), RecordError>; 3]) {
    for error in written.into_iter().filter_map(Result::err) {
        told.tell(&error.to_string());
    }
}

#[cfg(test)]
mod tests {
    use rustix::fs::{CWD, FileType, Mode};

    use super::*;

    /// A disk that hangs: what has come since waits up to the bound, and beyond it somebody is told once, with the first sample that
    /// is missing. Jobs behind it leave nothing once too many wait, and say so.
    #[test]
    fn what_waits_for_a_disk_has_an_end() {
        let folder = tempfile::tempdir().unwrap();
        let place = Path::new(env!("CARGO_MANIFEST_DIR"));
        let machine = place.join("../../examples/machines/mill-3axis.toml");
        let machine = Machine::read(&machine, &[]).unwrap();
        let raised = Arc::new(Mutex::new(vec![]));
        let hears = Arc::clone(&raised);
        let raise: Raise = Arc::new(move |why: &str| hears.lock().unwrap().push(why.to_string()));
        let mut records = Records::new(folder.path().to_owned(), Clock::Wall, 0.008, raise);
        records.max_behind = 3;
        let pipe = |job: u64| {
            let folder = folder.path().join(format!("{job:06}-mdi"));
            fs::create_dir_all(&folder).unwrap();
            let pipe = folder.join("trace.csv");
            // A child process would hold what other tests let go at this moment.
            rustix::fs::mknodat(CWD, &pipe, FileType::Fifo, Mode::RWXU, 0).unwrap();
            pipe
        };
        let pipes: Vec<_> = (1..=MAX_WRITERS as u64).map(pipe).collect();
        let begin = |job: u64| records.begin((job, "mdi"), &machine, vec![]);
        let mut hung: Vec<_> = (1..=MAX_WRITERS as u64).map(begin).collect();
        let mut said = vec![];
        for tick in 0..6 {
            let sample = Sample {
                tick,
                ..Sample::default()
            };
            hung[0].sample(&sample, &[]);
            hung[0].period();
            said.push(hung[0].broken());
        }
        assert_eq!(said.iter().flatten().count(), 1, "{said:?}");
        let words = said[3].as_ref().unwrap();
        assert!(words.contains("from tick 3 on"), "{words}");
        let one_more = MAX_WRITERS as u64 + 1;
        let words = begin(one_more).broken().unwrap();
        assert!(words.contains("the files of 4 jobs"), "{words}");
        assert_eq!(raised.lock().unwrap().len(), 2);
        // Read at last, the pipes have what had come in time.
        drop(hung);
        let rows = |pipe: &PathBuf| fs::read_to_string(pipe).unwrap().lines().count();
        assert_eq!(pipes.iter().map(rows).collect::<Vec<_>>(), [4, 1, 1, 1]);
        records.wait_for_all();
    }
}
