//! What comes out of a job: numbers by name, or why there are none; one file each.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use serde_json::Value;
use tandem_recorder::Summary;

use crate::inputs::read_at_most;
use crate::job::{Build, FORMAT, Job};
use crate::whole::{clear_unfinished, write_whole};

/// What comes out of a job. The same job gives the same text on every computer with the same [`Build`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct JobResult {
    /// [`FORMAT`].
    pub format: u32,
    /// The job's name.
    pub job: String,
    /// What computed it.
    pub build: Build,
    /// How it ended.
    pub ended: Ended,
}

/// How a job ended.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Ended {
    /// The program came to its end: the numbers of the summary, and those of [`crate::simulate`].
    Done(BTreeMap<String, f64>),
    /// Machine or program are refused, in words; nothing moved.
    Refused(String),
    /// A fault or a stop ended the run before its program did, in words.
    Stopped(String),
    /// Whatever computed it did not come back, as often as it was tried.
    Lost(String),
}

impl Ended {
    /// The numbers, where there are any.
    pub fn numbers(&self) -> Option<&BTreeMap<String, f64>> {
        match self {
            Self::Done(numbers) => Some(numbers),
            _ => None,
        }
    }

    /// Why there are none.
    pub fn cause(&self) -> Option<&str> {
        match self {
            Self::Done(_) => None,
            Self::Refused(cause) | Self::Stopped(cause) | Self::Lost(cause) => Some(cause),
        }
    }

    /// The word for it in tables.
    pub fn word(&self) -> &'static str {
        match self {
            Self::Done(_) => "done",
            Self::Refused(_) => "refused",
            Self::Stopped(_) => "stopped",
            Self::Lost(_) => "lost",
        }
    }
}

/// Longest file of a result, bytes.
const LONGEST: u64 = 1 << 20;

impl JobResult {
    /// The text that is kept and sent.
    pub fn text(&self) -> String {
        let mut text = serde_json::to_string(self).expect("a result is plain data");
        text.push('\n');
        text
    }

    /// The result whose text `bytes` are; none where they are not whole.
    pub fn read(bytes: &[u8]) -> Option<Self> {
        let result: Self = serde_json::from_slice(bytes).ok()?;
        (result.format == FORMAT && bytes.ends_with(b"\n")).then_some(result)
    }
}

/// Keys of a summary that tell of the computer, or of nothing that can be compared.
const NOT_OF_THE_MOTION: [&str; 6] = [
    "format",
    "wall_time_s",
    "planning_ns_per_block",
    "planning_us",
    "stops",
    "record_errors",
];

/// The numbers of a summary by their keys, tables in them with a dot; what depends on the computer is left out.
pub fn numbers_of(summary: &Summary) -> BTreeMap<String, f64> {
    let mut numbers = BTreeMap::new();
    let value = serde_json::to_value(summary).unwrap_or_default();
    for (key, value) in value.as_object().into_iter().flatten() {
        if !NOT_OF_THE_MOTION.contains(&key.as_str()) {
            add(&mut numbers, key, value);
        }
    }
    numbers
}

fn add(numbers: &mut BTreeMap<String, f64>, key: &str, value: &Value) {
    if let Some(number) = value.as_f64() {
        numbers.insert(key.to_string(), number);
    }
    for (inner, value) in value.as_object().into_iter().flatten() {
        add(numbers, &format!("{key}.{inner}"), value);
    }
}

/// A folder of results, one file each, named by [`Build::key`]. Any number of processes may share it.
pub struct Results {
    folder: PathBuf,
    build: Build,
}

impl Results {
    /// The results of `build` in `folder`, which is made where it is not there. What killed processes left unfinished there is
    /// removed.
    ///
    /// # Errors
    /// It cannot be made.
    pub fn open(folder: &Path, build: Build) -> Result<Self, String> {
        fs::create_dir_all(folder).map_err(|e| format!("{}: {e}", folder.display()))?;
        clear_unfinished(folder);
        let folder = folder.to_owned();
        Ok(Self { folder, build })
    }

    /// What computes here.
    pub fn build(&self) -> &Build {
        &self.build
    }

    fn path(&self, id: &str) -> PathBuf {
        self.folder.join(format!("{}.json", self.build.key(id)))
    }

    /// The result of the job called `id`. One that a power cut has torn is none.
    pub fn get(&self, id: &str) -> Option<JobResult> {
        let bytes = read_at_most(&self.path(id), LONGEST).ok()?;
        JobResult::read(&bytes).filter(|result| result.job == id && result.build == self.build)
    }

    /// Records how `job` ended; a result that is there is replaced by the same one.
    ///
    /// # Errors
    /// It cannot be written.
    pub fn put(&self, job: &Job, ended: Ended) -> Result<JobResult, String> {
        let result = JobResult {
            format: FORMAT,
            job: job.id(),
            build: self.build.clone(),
            ended,
        };
        self.record(&result)?;
        Ok(result)
    }

    /// Records a result of this build.
    ///
    /// # Errors
    /// It cannot be written.
    pub fn record(&self, result: &JobResult) -> Result<(), String> {
        let path = self.path(&result.job);
        write_whole(&path, result.text().as_bytes()).map_err(|e| format!("{}: {e}", path.display()))
    }
}
