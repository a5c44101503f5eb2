//! The programs folder: what lies there, and what clients bring.

use std::fs::{self, File, OpenOptions};
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use serde_json::{Value, json};

use super::dispatcher::{Dispatcher, Loaded, MAX_PROGRAM_BYTES, RequestId};
use super::request::Asked;

/// A program on its way into the folder, part by part.
pub struct Upload {
    client: u64,
    name: String,
    part: PathBuf,
    bytes: u64,
}

impl Dispatcher {
    /// A program, as text or as a file of the programs folder.
    pub fn program_of(&self, asked: &Asked) -> Result<Loaded, String> {
        if asked.with.contains_key("text") {
            let name = asked
                .with
                .get("name")
                .and_then(Value::as_str)
                .unwrap_or("program.ngc")
                .to_string();
            return Ok(Loaded::new(name, asked.text("text")?.as_bytes().into()));
        }
        let path = asked.text("path")?;
        let folder = self.folder()?;
        let safe = Path::new(path)
            .components()
            .all(|part| matches!(part, std::path::Component::Normal(_)));
        if !safe {
            return Err(format!(
                "{path}: a program is named by its path within the programs folder"
            ));
        }
        let file = folder.join(path);
        let of = fs::metadata(&file).map_err(|e| format!("{}: {e}", file.display()))?;
        if !of.is_file() {
            return Err(format!("{path}: it is no file"));
        }
        let size = of.len();
        if size > MAX_PROGRAM_BYTES {
            return Err(format!(
                "{path}: it has {size} bytes, {MAX_PROGRAM_BYTES} are allowed"
            ));
        }
        let text = fs::read(&file).map_err(|e| format!("{}: {e}", file.display()))?;
        Ok(Loaded::new(path.to_string(), text.into()))
    }

    fn folder(&self) -> Result<&Path, String> {
        let missing = "there is no programs folder: tandem serve --programs FOLDER names one";
        self.programs.as_deref().ok_or_else(|| missing.to_string())
    }

    /// The files of the folder that a client may load.
    pub fn list(&self) -> Result<Value, String> {
        let folder = self.folder()?;
        let entries = fs::read_dir(folder).map_err(|e| format!("{}: {e}", folder.display()))?;
        let mut all: Vec<(String, Value)> = vec![];
        for entry in entries.filter_map(Result::ok) {
            let name = entry.file_name().to_string_lossy().into_owned();
            let Ok(of) = fs::metadata(entry.path()) else {
                continue;
            };
            if !of.is_file() || name.starts_with('.') {
                continue;
            }
            let written = of.modified().ok();
            let written_ms = written
                .and_then(|at| at.duration_since(SystemTime::UNIX_EPOCH).ok())
                .map(|since| since.as_millis() as u64);
            let about = json!({ "name": name, "bytes": of.len(), "written_unix_ms": written_ms });
            all.push((name, about));
        }
        all.sort_by(|a, b| a.0.cmp(&b.0));
        let programs: Vec<_> = all.into_iter().map(|(_, about)| about).collect();
        Ok(json!({ "programs": programs }))
    }

    /// Takes a part of a program, and with the last one puts the whole in its place: nobody ever sees half of one.
    pub fn upload(
        &self,
        from: RequestId,
        asked: &Asked,
        pending: &mut Option<Upload>,
    ) -> Result<Value, String> {
        let folder = self.folder()?;
        let name = asked.text("name")?;
        let text = asked.text("text")?;
        if !is_plain(name) {
            return Err(format!(
                "{name}: a program that is brought has a plain name: letters, digits, space and -_.()+ without a dot in front"
            ));
        }
        let place = folder.join(name);
        if place.exists() && !asked.is_on("replace") {
            return Err(format!("{name} is there already: \"replace\" replaces it"));
        }
        let goes_on = pending
            .as_ref()
            .is_some_and(|upload| upload.client == from.client && upload.name == name);
        if !goes_on {
            discard(pending);
        }
        let mut upload = pending.take().unwrap_or_else(|| Upload {
            client: from.client,
            name: name.to_string(),
            part: folder.join(format!(".{name}.part")),
            bytes: 0,
        });
        let bytes = upload.bytes + text.len() as u64;
        let taken = if bytes > MAX_PROGRAM_BYTES {
            Err(format!("{name}: {MAX_PROGRAM_BYTES} bytes are allowed"))
        } else {
            append(&upload.part, text, upload.bytes == 0)
        };
        upload.bytes = bytes;
        let done = taken.and_then(|()| {
            if asked.is_on("more") {
                return Ok(false);
            }
            let whole = finish(&upload.part, &place, folder, asked.is_on("replace"));
            whole.map(|()| true)
        });
        match done {
            Ok(true) => Ok(json!({ "name": name, "bytes": bytes })),
            Ok(false) => {
                *pending = Some(upload);
                Ok(json!({ "name": name, "bytes": bytes, "more": true }))
            }
            Err(why) => {
                discard(&mut Some(upload));
                Err(why)
            }
        }
    }
}

/// Forgets a program that did not come to its end.
pub fn discard(pending: &mut Option<Upload>) {
    if let Some(upload) = pending.take() {
        // What is left of it is begun anew by the next one of this name.
        let _ = fs::remove_file(upload.part);
    }
}

impl Upload {
    /// Whether this client brings it.
    pub fn is_by(&self, client: u64) -> bool {
        self.client == client
    }
}

/// A file's name that means the same everywhere, and leads nowhere else.
fn is_plain(name: &str) -> bool {
    let fits = |c: char| c.is_alphanumeric() || " -_.()+".contains(c);
    (1..=120).contains(&name.len()) && !name.starts_with('.') && name.chars().all(fits)
}

fn append(part: &Path, text: &str, first: bool) -> Result<(), String> {
    let at = |e: std::io::Error| format!("{}: {e}", part.display());
    if first {
        // Whatever lies there is neither followed, if it is a link, nor kept.
        let _ = fs::remove_file(part);
    }
    let mut file = OpenOptions::new()
        .append(true)
        .create_new(first)
        .open(part)
        .map_err(at)?;
    file.write_all(text.as_bytes()).map_err(at)
}

fn finish(part: &Path, place: &Path, folder: &Path, replaces: bool) -> Result<(), String> {
    let at = |e: std::io::Error| format!("{}: {e}", place.display());
    File::open(part)
        .and_then(|file| file.sync_all())
        .map_err(at)?;
    if replaces {
        fs::rename(part, place).map_err(at)?;
    } else {
        // Unlike a rename this refuses where somebody has put a file there meanwhile.
        fs::hard_link(part, place).map_err(at)?;
        fs::remove_file(part).map_err(at)?;
    }
    File::open(folder)
        .and_then(|folder| folder.sync_all())
        .map_err(at)
}
