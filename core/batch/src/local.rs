//! Jobs on this computer: as many at once as it has cores, each recorded when it is done.

use std::fs::{self, OpenOptions};
use std::io::Write;
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering::Relaxed};
use std::thread;

use crate::job::Job;
use crate::result::{Ended, JobResult, Results};

/// How often a job is begun before it is taken for one that ends the process that simulates it.
pub const MAX_TRIES: u64 = 3;

/// A part of a list of jobs, as an array of Slurm or Kubernetes hands it out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shard {
    /// Its number, from 0.
    pub index: usize,
    /// How many there are.
    pub count: NonZeroUsize,
}

impl Shard {
    /// Everything.
    pub const ALL: Self = Self {
        index: 0,
        count: NonZeroUsize::MIN,
    };

    /// Whether the job at `place` in the list belongs to it. Neighbours are dealt out, because they take alike long.
    pub fn has(&self, place: usize) -> bool {
        place % self.count == self.index
    }
}

impl std::str::FromStr for Shard {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || format!("{text}: a part is named i/n, with i from 0 to n - 1");
        let (index, count) = text.split_once('/').ok_or_else(wrong)?;
        let index = index.parse().map_err(|_| wrong())?;
        let count: NonZeroUsize = count.parse().map_err(|_| wrong())?;
        if index < count.get() {
            Ok(Self { index, count })
        } else {
            Err(wrong())
        }
    }
}

/// Where jobs are simulated and recorded.
pub struct Bench<'a> {
    /// The results.
    pub results: &'a Results,
    /// A folder of marks of what is being simulated, so that a job that ends its process is not begun for ever.
    pub marks: &'a Path,
    /// Simulates a job.
    pub simulate: &'a (dyn Fn(&Job) -> Ended + Sync),
    /// At most so many at once.
    pub threads: usize,
    /// Set from outside: no further job is begun.
    pub stop: &'a AtomicBool,
    /// Is told how many are done after each.
    pub tell: &'a (dyn Fn(usize) + Sync),
}

impl Bench<'_> {
    /// The results of `jobs`, in their order; none for those that were not begun because it was to stop. What is recorded already
    /// is not simulated again. Host; starts threads.
    ///
    /// # Errors
    /// A result cannot be recorded.
    pub fn run(&self, jobs: &[Job]) -> Result<Vec<Option<JobResult>>, String> {
        fs::create_dir_all(self.marks).map_err(|e| format!("{}: {e}", self.marks.display()))?;
        let (next, done) = (AtomicUsize::new(0), AtomicUsize::new(0));
        let results = Mutex::new(vec![None; jobs.len()]);
        let failed = Mutex::new(None);
        let work = || {
            while let Some((place, job)) = self.next(&next, jobs) {
                match self.one(job) {
                    Ok(result) => {
                        results.lock().expect("no thread panics with it")[place] = Some(result);
                        (self.tell)(done.fetch_add(1, Relaxed) + 1);
                    }
                    Err(error) => {
                        // What cannot be recorded need not be computed: a full disk ends all of it.
                        failed
                            .lock()
                            .expect("no thread panics with it")
                            .get_or_insert(error);
                        next.store(jobs.len(), Relaxed);
                    }
                }
            }
        };
        let threads = self.threads.clamp(1, jobs.len().max(1));
        thread::scope(|scope| (0..threads).for_each(|_| drop(scope.spawn(work))));
        if let Some(error) = failed.into_inner().expect("no thread panics with it") {
            return Err(error);
        }
        Ok(results.into_inner().expect("no thread panics with it"))
    }

    fn next<'j>(&self, next: &AtomicUsize, jobs: &'j [Job]) -> Option<(usize, &'j Job)> {
        if self.stop.load(Relaxed) {
            return None;
        }
        let place = next.fetch_add(1, Relaxed);
        Some((place, jobs.get(place)?))
    }

    fn one(&self, job: &Job) -> Result<JobResult, String> {
        let id = job.id();
        if let Some(result) = self.results.get(&id) {
            return Ok(result);
        }
        let mark = self.marks.join(&id);
        let tries = fs::metadata(&mark).map_or(0, |mark| mark.len());
        let ended = if tries >= MAX_TRIES {
            Ended::Lost(format!("the process that simulated it ended {tries} times"))
        } else {
            begin(&mark)?;
            (self.simulate)(job)
        };
        let result = self.results.put(job, ended)?;
        // A mark that stays says too much of a job that is recorded, which nobody asks it for.
        let _ = fs::remove_file(&mark);
        Ok(result)
    }
}

/// A byte for each time that the job was begun.
fn begin(mark: &PathBuf) -> Result<(), String> {
    let file = OpenOptions::new().create(true).append(true).open(mark);
    file.and_then(|mut file| file.write_all(b"."))
        .map_err(|e| format!("{}: {e}", mark.display()))
}
