//! What jobs are made of, each file under the SHA-256 of its content: programs, machine files, and the files that these name.
//!
//! A machine is kept as the text that is in force, with its includes and overrides in it, and each file that it names stands there
//! as `sha256:…`. So the same machine has the same hash in every folder and on every computer, and whoever has the inputs can
//! make the machine again.

use std::fs::{self, File};
use std::io::{self, Read};
use std::path::{Path, PathBuf};

use tandem_machine::{Machine, MachineError};
use tempfile::TempDir;

use crate::hash::sha256;
use crate::job::Job;
use crate::whole::{clear_unfinished, write_whole};

/// Before the hash of a file, in the text of a machine.
const FILE: &str = "sha256:";
/// Before the hash of the list of a folder's files.
const FOLDER: &str = "sha256-folder:";

/// Why inputs cannot be had.
#[derive(Debug, thiserror::Error)]
pub enum InputError {
    /// The machine file.
    #[error(transparent)]
    Machine(#[from] MachineError),
    /// A file or folder.
    #[error("{place}: {cause}")]
    File {
        /// The file, or the key that names it.
        place: String,
        /// What is wrong.
        cause: String,
    },
}

fn at(place: impl Into<String>, cause: impl std::fmt::Display) -> InputError {
    InputError::File {
        place: place.into(),
        cause: cause.to_string(),
    }
}

/// A folder of inputs.
pub struct Inputs {
    folder: PathBuf,
    /// Machine files with the names of this computer.
    here: TempDir,
}

impl Inputs {
    /// The inputs in `folder`, which is made where it is not there. What killed processes left unfinished there is removed.
    ///
    /// # Errors
    /// It cannot be made.
    pub fn open(folder: &Path) -> Result<Self, InputError> {
        let of_folder = |e: io::Error| at(folder.display().to_string(), e);
        fs::create_dir_all(folder).map_err(of_folder)?;
        clear_unfinished(folder);
        Ok(Self {
            folder: fs::canonicalize(folder).map_err(of_folder)?,
            here: tempfile::tempdir().map_err(of_folder)?,
        })
    }

    /// Where the input called `hash` lies, or would.
    pub fn path(&self, hash: &str) -> PathBuf {
        self.folder.join(hash)
    }

    /// Takes `bytes` in; their hash.
    ///
    /// # Errors
    /// They cannot be written.
    pub fn put(&self, bytes: &[u8]) -> Result<String, InputError> {
        let hash = sha256(bytes);
        let path = self.path(&hash);
        if !path.exists() {
            write_whole(&path, bytes).map_err(|e| at(path.display().to_string(), e))?;
        }
        Ok(hash)
    }

    /// Takes the file at `path` in; its hash.
    ///
    /// # Errors
    /// It cannot be read or written.
    pub fn put_file(&self, path: &Path) -> Result<String, InputError> {
        let bytes = fs::read(path).map_err(|e| at(path.display().to_string(), e))?;
        self.put(&bytes)
    }

    /// The content of the input called `hash`.
    ///
    /// # Errors
    /// It is not there, or is not what its name says.
    pub fn get(&self, hash: &str) -> Result<Vec<u8>, InputError> {
        let path = self.path(hash);
        let bytes = fs::read(&path).map_err(|e| at(path.display().to_string(), e))?;
        if sha256(&bytes) != hash {
            return Err(at(
                path.display().to_string(),
                "it is not what its name says",
            ));
        }
        Ok(bytes)
    }

    /// Takes a machine in with everything that it names; its hash.
    ///
    /// # Errors
    /// The machine file is refused, or a file that it names cannot be read.
    pub fn put_machine(&self, machine: &Machine) -> Result<String, InputError> {
        let mut text = machine.effective_toml().to_string();
        let table: toml::Table = text.parse().map_err(|e| at("the machine in force", e))?;
        for (key, named) in named_files(&table) {
            let path = Path::new(&named);
            let token = if path.is_dir() {
                format!("{FOLDER}{}", self.put_folder(path)?)
            } else {
                let hash = self.put_file(path).map_err(|error| at(&key, error))?;
                format!("{FILE}{hash}")
            };
            let (name, token) = (quoted(&named), quoted(&token));
            if !text.contains(&name) {
                return Err(at(
                    key,
                    format!("{named} cannot be carried to another computer"),
                ));
            }
            text = text.replace(&name, &token);
        }
        self.put(text.as_bytes())
    }

    /// The machine called `hash`, with `set` on top.
    ///
    /// # Errors
    /// An input is missing, or the machine is refused.
    pub fn machine(&self, hash: &str, set: &[(String, String)]) -> Result<Machine, InputError> {
        let path = self.here.path().join(format!("{hash}.toml"));
        if !path.exists() {
            let text = self.get(hash)?;
            let text = String::from_utf8(text).map_err(|e| at(hash, e))?;
            write_whole(&path, self.with_names_of_here(&text)?.as_bytes())
                .map_err(|e| at(hash, e))?;
        }
        Ok(Machine::read(&path, set)?)
    }

    /// `text` without what only this computer calls so: the same everywhere.
    pub fn without_names_of_here(&self, text: &str) -> String {
        let folders = [self.here.path(), &self.folder];
        folders.iter().fold(text.to_string(), |text, folder| {
            text.replace(&format!("{}/", folder.display()), "")
        })
    }

    fn with_names_of_here(&self, text: &str) -> Result<String, InputError> {
        let table: toml::Table = text.parse().map_err(|e| at("the machine in force", e))?;
        let mut text = text.to_string();
        for (_, token) in named_files(&table) {
            let path = if let Some(hash) = token.strip_prefix(FILE) {
                // A file that is not what it should be is found before it is used.
                self.get(hash)?;
                self.path(hash)
            } else if let Some(hash) = token.strip_prefix(FOLDER) {
                self.folder_of(hash)?
            } else {
                continue;
            };
            text = text.replace(&quoted(&token), &quoted(&path.display().to_string()));
        }
        Ok(text)
    }

    /// Takes the plain files of a folder in, and a list of their hashes and names.
    fn put_folder(&self, folder: &Path) -> Result<String, InputError> {
        let of_folder = |e: io::Error| at(folder.display().to_string(), e);
        let mut list = vec![];
        for entry in fs::read_dir(folder).map_err(of_folder)? {
            let path = entry.map_err(of_folder)?.path();
            let name = path.file_name().and_then(|name| name.to_str());
            if let (true, Some(name)) = (path.is_file(), name) {
                list.push(format!("{} {name}\n", self.put_file(&path)?));
            }
        }
        list.sort();
        self.put(list.concat().as_bytes())
    }

    /// The folder whose list is called `hash`, made of the inputs.
    fn folder_of(&self, hash: &str) -> Result<PathBuf, InputError> {
        let folder = self.here.path().join(hash);
        let list = String::from_utf8(self.get(hash)?).map_err(|e| at(hash, e))?;
        fs::create_dir_all(&folder).map_err(|e| at(hash, e))?;
        for (file, name) in list.lines().filter_map(|line| line.split_once(' ')) {
            if name.contains('/') {
                return Err(at(hash, format!("{name} is no name of a file")));
            }
            write_whole(&folder.join(name), &self.get(file)?).map_err(|e| at(name, e))?;
        }
        Ok(folder)
    }

    /// Hashes of everything that `job` is made of, as far as what is here tells: a list of files that is not here is among them, and
    /// its files are not.
    ///
    /// # Errors
    /// An input is not what it should be.
    pub fn parts(&self, job: &Job) -> Result<Vec<String>, InputError> {
        let mut parts = vec![job.program.clone(), job.machine.clone()];
        let Some(text) = self.text(&job.machine)? else {
            return Ok(parts);
        };
        let table: toml::Table = text.parse().map_err(|e| at(&job.machine, e))?;
        for (_, token) in named_files(&table) {
            if let Some(file) = token.strip_prefix(FILE) {
                parts.push(file.to_string());
            } else if let Some(folder) = token.strip_prefix(FOLDER) {
                let list = self.text(folder)?.unwrap_or_default();
                parts.push(folder.to_string());
                parts.extend(
                    list.lines()
                        .filter_map(|line| Some(line.split_once(' ')?.0.to_string())),
                );
            }
        }
        Ok(parts)
    }

    /// Those of [`Inputs::parts`] that are not here.
    ///
    /// # Errors
    /// An input is not what it should be.
    pub fn missing(&self, job: &Job) -> Result<Vec<String>, InputError> {
        let mut parts = self.parts(job)?;
        parts.retain(|hash| !self.path(hash).exists());
        Ok(parts)
    }

    /// The input called `hash` as text; none where it is not here.
    fn text(&self, hash: &str) -> Result<Option<String>, InputError> {
        if !self.path(hash).exists() {
            return Ok(None);
        }
        let text = String::from_utf8(self.get(hash)?).map_err(|e| at(hash, e))?;
        Ok(Some(text))
    }
}

/// Where a machine file names files: tables, and the key in them. `*` stands for any name.
const NAMES: [(&[&str], &str); 10] = [
    (&["policy"], "script"),
    (&["tools"], "table"),
    (&["program"], "subroutine_path"),
    (&["kinematics"], "plugin"),
    (&["planner"], "plugin"),
    (&["feed_strategy"], "plugin"),
    (&["driver"], "plugin"),
    (&["driver", "stand_in"], "plugin"),
    (&["drivers", "*"], "plugin"),
    (&["drivers", "*", "stand_in"], "plugin"),
];

/// The files that a machine names, with the keys that do; plugins that are linked in are no files.
fn named_files(machine: &toml::Table) -> Vec<(String, String)> {
    let mut found = vec![];
    for (tables, key) in NAMES {
        each_table(machine, tables, &mut |table| {
            let Some(name) = table.get(key).and_then(toml::Value::as_str) else {
                return;
            };
            let is_file = key != "plugin" || name.contains('/') || name.starts_with(FILE);
            if is_file && !name.is_empty() {
                found.push((format!("{}.{key}", tables.join(".")), name.to_string()));
            }
        });
    }
    found
}

fn each_table(table: &toml::Table, path: &[&str], work: &mut dyn FnMut(&toml::Table)) {
    let Some((first, rest)) = path.split_first() else {
        return work(table);
    };
    for (name, value) in table {
        if let (true, Some(inner)) = (*first == "*" || name == first, value.as_table()) {
            each_table(inner, rest, work);
        }
    }
}

/// `text` as a value of TOML.
fn quoted(text: &str) -> String {
    toml::Value::String(text.to_string()).to_string()
}

/// Reads a file as long as `limit` bytes at most.
///
/// # Errors
/// It cannot be read, or is longer.
pub fn read_at_most(path: &Path, limit: u64) -> io::Result<Vec<u8>> {
    let mut bytes = vec![];
    File::open(path)?.take(limit + 1).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > limit {
        return Err(io::Error::other(format!("longer than {limit} bytes")));
    }
    Ok(bytes)
}
