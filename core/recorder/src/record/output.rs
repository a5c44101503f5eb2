//! Files that a run writes, and standard output as one. What exists is replaced only when the new content is complete.

use std::fmt;
use std::fs::{self, File, OpenOptions};
use std::io::{self, BufWriter, Seek, Write};
use std::os::fd::AsFd;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak};

use serde::Serialize;
use tandem_rings::Sample;

/// The name that stands for standard output.
const STANDARD_OUTPUT: &str = "-";

/// A file in the making, beside the one it will become. What is no regular file (a device, a pipe) is written directly.
pub struct Output {
    path: PathBuf,
    part: Option<PathBuf>,
    /// The thread that writes is the only one that takes it, unless the process ends before its time.
    writer: Arc<SharedWriter>,
    /// The file that is not complete stays beside the one that it would have become.
    keeps: bool,
}

type SharedWriter = Mutex<Option<BufWriter<File>>>;

/// The files in the making: what writes them, and where they lie meanwhile.
static OPEN: Mutex<Vec<(Weak<SharedWriter>, PathBuf)>> = Mutex::new(Vec::new());

/// The process is about to end before its time: what was written of each file until now goes onto the disk. The answer is
/// where. Host, from any thread.
pub fn flush_outputs() -> Vec<PathBuf> {
    let open = std::mem::take(&mut *lock(&OPEN));
    let flush = |(writer, path): (Weak<SharedWriter>, PathBuf)| {
        let writer = writer.upgrade()?;
        // Who writes at this moment may be the one that hangs, on a disk that does not answer: it is not waited for.
        let mut writer = writer.try_lock().ok()?;
        // What cannot be written any more cannot be kept.
        writer.as_mut()?.flush().is_ok().then_some(path)
    };
    open.into_iter().filter_map(flush).collect()
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    // What lies in it is whole after every statement.
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

fn begin(file: File, path: &Path) -> Arc<SharedWriter> {
    let writer = Arc::new(Mutex::new(Some(BufWriter::with_capacity(1 << 16, file))));
    let mut open = lock(&OPEN);
    open.retain(|(other, _)| other.strong_count() > 0);
    open.push((Arc::downgrade(&writer), path.to_owned()));
    writer
}

impl Output {
    /// Starts a file at `path`; `-` is standard output.
    ///
    /// # Errors
    /// The path with the system's words.
    pub fn create(path: &Path) -> Result<Self, String> {
        if path.as_os_str() == STANDARD_OUTPUT {
            let handle = io::stdout().as_fd().try_clone_to_owned();
            let file = handle.map_err(|e| format!("standard output cannot be written: {e}"))?;
            let path = PathBuf::from("standard output");
            return Ok(Self {
                writer: begin(File::from(file), &path),
                path,
                part: None,
                keeps: false,
            });
        }
        // A link stays a link: the file that it leads to is the one to replace.
        let path = fs::canonicalize(path).unwrap_or_else(|_| path.to_owned());
        let special = fs::metadata(&path).is_ok_and(|found| !found.is_file());
        let part = (!special).then(|| beside(&path));
        let file = match &part {
            Some(part) => File::create(part),
            None => OpenOptions::new().write(true).open(&path),
        };
        let file = file.map_err(|e| format!("{}: it cannot be written: {e}", path.display()))?;
        let writer = begin(file, part.as_ref().unwrap_or(&path));
        Ok(Self {
            path,
            part,
            writer,
            keeps: false,
        })
    }

    /// Takes room for the first `bytes` now, so that they can be written when the disk has become full. What is no regular
    /// file has none to take.
    ///
    /// # Errors
    /// The path with the system's words: there is no room for them now.
    pub fn reserve(&mut self, bytes: u64) -> Result<(), String> {
        let mut writer = lock(&self.writer);
        let (Some(_), Some(writer)) = (&self.part, writer.as_mut()) else {
            return Ok(());
        };
        let file = writer.get_mut();
        let taken = rustix::fs::fallocate(&*file, rustix::fs::FallocateFlags::empty(), 0, bytes);
        // Not every file system knows how: then the room is written.
        let taken = taken.map_err(io::Error::from).or_else(|_| {
            io::copy(&mut io::Read::take(io::repeat(b' '), bytes), file)?;
            file.rewind()
        });
        taken.map_err(|e| format!("{}: it cannot be written: {e}", self.path.display()))
    }

    /// What it becomes.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// From now on what is written stays, also where the file never takes its name. Where it lies meanwhile; none for what
    /// is written directly.
    pub fn keep(&mut self) -> Option<&Path> {
        self.keeps = true;
        self.part.as_deref()
    }

    /// Everything is written: the file takes its name.
    ///
    /// # Errors
    /// The path with the system's words.
    pub fn finish(mut self) -> Result<(), String> {
        self.close()
            .and_then(|()| self.name())
            .map_err(|e| format!("{}: {e}", self.path.display()))
    }

    /// [`Output::finish`] for `what` of a run: where it fails, what is written stays.
    ///
    /// # Errors
    /// What could not be written, and where the rest is.
    pub fn finish_record(mut self, what: &'static str) -> Result<(), RecordError> {
        let written = self.close().and_then(|()| self.name());
        written.map_err(|error| RecordError::of(what, &mut self, error))
    }

    fn name(&self) -> io::Result<()> {
        self.part
            .as_ref()
            .map_or(Ok(()), |part| fs::rename(part, &self.path))
    }

    /// Everything is written, or as much as can be: the first error is also that of [`Output::finish`].
    ///
    /// # Errors
    /// The system's words.
    pub fn close(&mut self) -> io::Result<()> {
        let mut place = lock(&self.writer);
        let Some(writer) = place.as_mut() else {
            return Ok(());
        };
        writer.flush()?;
        // Of the room that was taken what is not used goes back.
        if self.part.is_some() {
            let file = writer.get_mut();
            let end = file.stream_position()?;
            file.set_len(end)?;
        }
        *place = None;
        Ok(())
    }

    /// Begins again from the first byte.
    ///
    /// # Errors
    /// The system's words.
    pub fn begin_again(&mut self) -> io::Result<()> {
        let mut place = lock(&self.writer);
        let Some(writer) = place.take() else {
            return Ok(());
        };
        // What could not be written is given up.
        let (mut file, _) = writer.into_parts();
        if self.part.is_some() {
            file.rewind()?;
        }
        *place = Some(BufWriter::with_capacity(1 << 16, file));
        Ok(())
    }
}

fn beside(path: &Path) -> PathBuf {
    let mut part = path.as_os_str().to_owned();
    part.push(".part");
    part.into()
}

impl Write for Output {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        lock(&self.writer)
            .as_mut()
            .map_or(Err(io::ErrorKind::BrokenPipe.into()), |w| w.write(bytes))
    }

    fn flush(&mut self) -> io::Result<()> {
        lock(&self.writer).as_mut().map_or(Ok(()), Write::flush)
    }
}

impl Drop for Output {
    fn drop(&mut self) {
        let Some(writer) = lock(&self.writer).take() else {
            return;
        };
        // What could not be written is not tried once more.
        drop(writer.into_parts());
        if let (false, Some(part)) = (self.keeps, &self.part) {
            let _ = fs::remove_file(part);
        }
    }
}

/// A file that a run writes and that cannot be written any further: a full disk, a reader that has gone away.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct RecordError {
    /// What it was to hold: `trace`, `blocks`, `events`, `report`, `summary`.
    pub what: &'static str,
    /// The file.
    pub file: String,
    /// Why, in the system's words.
    pub cause: String,
    /// Fine period of the first sample that is missing, where the motion was still going on.
    pub tick: Option<u64>,
    /// Its program line.
    pub line: Option<u32>,
    /// Where that lies which was written before; none where nothing is left of it.
    pub kept_as: Option<String>,
}

impl RecordError {
    /// That `what` could not be written to `out`, because of `cause`; nothing is left of it.
    pub fn lost(what: &'static str, file: &Path, cause: impl fmt::Display) -> Self {
        let (file, cause) = (file.display().to_string(), cause.to_string());
        Self {
            what,
            file,
            cause,
            tick: None,
            line: None,
            kept_as: None,
        }
    }

    /// That `what` could not be written to `out`, because of `cause`. What was written of it stays where it is.
    pub fn of(what: &'static str, out: &mut Output, cause: impl fmt::Display) -> Self {
        let kept_as = out.keep().map(|part| part.display().to_string());
        Self {
            kept_as,
            ..Self::lost(what, out.path(), cause)
        }
    }

    /// The same, with the first sample that is missing.
    #[must_use]
    pub fn at(self, sample: &Sample) -> Self {
        Self {
            tick: Some(sample.tick),
            line: Some(sample.line),
            ..self
        }
    }
}

impl fmt::Display for RecordError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{}: {}: it cannot be written any further",
            self.what, self.file
        )?;
        match (self.tick, self.line) {
            (Some(tick), Some(line)) => write!(f, ", from tick {tick}, line {line}")?,
            (None, Some(line)) => write!(f, ", from line {line}")?,
            _ => {}
        }
        write!(f, ": {}", self.cause)?;
        match &self.kept_as {
            Some(part) => write!(f, "; what is written stays in {part}"),
            None => Ok(()),
        }
    }
}

impl std::error::Error for RecordError {}
