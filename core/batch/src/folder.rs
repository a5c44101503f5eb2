//! A folder of jobs: the list, the inputs, the results. Everything that a worker needs lies in it, so that processes and computers
//! that share the folder share the work.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::inputs::{InputError, Inputs};
use crate::job::{Build, Job};
use crate::result::{JobResult, Results};
use crate::whole::{clear_unfinished, write_whole};

/// A job, and what people call its parts.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Listed {
    /// The program, as it was named.
    pub program: String,
    /// The machine's name.
    pub machine: String,
    /// The job.
    pub job: Job,
}

/// A folder of jobs.
pub struct Folder {
    path: PathBuf,
}

impl Folder {
    /// The folder at `path`, which is made where it is not there. What killed processes left unfinished there is removed.
    ///
    /// # Errors
    /// It cannot be made.
    pub fn create(path: &Path) -> Result<Self, String> {
        fs::create_dir_all(path).map_err(|e| format!("{}: {e}", path.display()))?;
        clear_unfinished(path);
        Ok(Self {
            path: path.to_owned(),
        })
    }

    /// The folder at `path`, in which jobs were listed.
    ///
    /// # Errors
    /// There is no list.
    pub fn open(path: &Path) -> Result<Self, String> {
        let folder = Self {
            path: path.to_owned(),
        };
        let list = folder.list();
        if list.is_file() {
            Ok(folder)
        } else {
            Err(format!("{}: no jobs were submitted here", path.display()))
        }
    }

    fn list(&self) -> PathBuf {
        self.path.join("jobs.jsonl")
    }

    /// A file of the folder.
    pub fn file(&self, name: &str) -> PathBuf {
        self.path.join(name)
    }

    /// The inputs.
    ///
    /// # Errors
    /// Their folder cannot be made.
    pub fn inputs(&self) -> Result<Inputs, InputError> {
        Inputs::open(&self.path.join("inputs"))
    }

    /// The results of `build`.
    ///
    /// # Errors
    /// Their folder cannot be made.
    pub fn results(&self, build: Build) -> Result<Results, String> {
        Results::open(&self.path.join("results"), build)
    }

    /// Where marks of what is being simulated lie.
    pub fn marks(&self) -> PathBuf {
        self.path.join("begun")
    }

    /// Lists `jobs`.
    ///
    /// # Errors
    /// Others are listed there, or the list cannot be written.
    pub fn submit(&self, jobs: &[Listed]) -> Result<(), String> {
        let mut text = String::new();
        for job in jobs {
            text += &serde_json::to_string(job).map_err(|e| e.to_string())?;
            text.push('\n');
        }
        let list = self.list();
        if fs::read_to_string(&list).is_ok_and(|there| there != text) {
            return Err(format!(
                "{}: other jobs were submitted here",
                self.path.display()
            ));
        }
        write_whole(&list, text.as_bytes()).map_err(|e| format!("{}: {e}", list.display()))
    }

    /// The jobs that are listed.
    ///
    /// # Errors
    /// The list cannot be read, with its line.
    pub fn jobs(&self) -> Result<Vec<Listed>, String> {
        let list = self.list();
        let text = fs::read_to_string(&list).map_err(|e| format!("{}: {e}", list.display()))?;
        let each = text.lines().enumerate().map(|(index, line)| {
            serde_json::from_str(line).map_err(|e| format!("{}:{}: {e}", list.display(), index + 1))
        });
        each.collect()
    }

    /// Keeps a result that was computed elsewhere.
    ///
    /// # Errors
    /// It cannot be written.
    pub fn record(&self, result: &JobResult) -> Result<(), String> {
        self.results(result.build.clone())?.record(result)
    }

    /// Has workers stop.
    ///
    /// # Errors
    /// It cannot be written down.
    pub fn cancel(&self) -> Result<(), String> {
        let mark = self.path.join("cancelled");
        write_whole(&mark, b"").map_err(|e| format!("{}: {e}", mark.display()))
    }

    /// Whether workers are to stop.
    pub fn is_cancelled(&self) -> bool {
        self.path.join("cancelled").exists()
    }

    /// Every result that is whole, of whatever build, by job; of one job by the hashes of their builds.
    ///
    /// # Errors
    /// The folder of the results cannot be read.
    pub fn all_results(&self) -> Result<BTreeMap<String, Vec<JobResult>>, String> {
        let folder = self.path.join("results");
        let mut all: BTreeMap<String, Vec<JobResult>> = BTreeMap::new();
        if !folder.is_dir() {
            return Ok(all);
        }
        let entries = fs::read_dir(&folder).map_err(|e| format!("{}: {e}", folder.display()))?;
        for path in entries.flatten().map(|entry| entry.path()) {
            if path
                .extension()
                .is_some_and(|extension| extension == "json")
            {
                let bytes = fs::read(&path).map_err(|e| format!("{}: {e}", path.display()))?;
                if let Some(result) = JobResult::read(&bytes) {
                    all.entry(result.job.clone()).or_default().push(result);
                }
            }
        }
        for results in all.values_mut() {
            results.sort_by(|a, b| {
                let build =
                    |result: &JobResult| (result.build.binary.clone(), result.build.maths.clone());
                build(a).cmp(&build(b))
            });
        }
        Ok(all)
    }
}

/// The files that `pattern` fits, in their order; the name itself where it has no `*` or `?`.
///
/// # Errors
/// The pattern is none, or fits nothing.
pub fn files(pattern: &str) -> Result<Vec<PathBuf>, String> {
    if !pattern.contains(['*', '?']) {
        return Ok(vec![PathBuf::from(pattern)]);
    }
    let found = glob::glob(pattern).map_err(|e| format!("{pattern}: {e}"))?;
    let files: Vec<PathBuf> = found.flatten().filter(|path| path.is_file()).collect();
    if files.is_empty() {
        return Err(format!("{pattern}: no file has such a name"));
    }
    Ok(files)
}
