//! Files that a run writes. What exists is replaced only when the new content is complete.

use std::fs::{self, File, OpenOptions};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

/// A file in the making, beside the one it will become. What is no regular file (a device, a pipe) is written directly.
pub struct Output {
    path: PathBuf,
    part: Option<PathBuf>,
    writer: Option<BufWriter<File>>,
}

impl Output {
    /// Starts a file at `path`.
    ///
    /// # Errors
    /// The path with the system's words.
    pub fn create(path: &Path) -> Result<Self, String> {
        // A link stays a link: the file that it leads to is the one to replace.
        let path = fs::canonicalize(path).unwrap_or_else(|_| path.to_owned());
        let special = fs::metadata(&path).is_ok_and(|found| !found.is_file());
        let part = (!special).then(|| beside(&path));
        let file = match &part {
            Some(part) => File::create(part),
            None => OpenOptions::new().write(true).open(&path),
        };
        let file = file.map_err(|e| format!("{}: it cannot be written: {e}", path.display()))?;
        Ok(Self { path, part, writer: Some(BufWriter::with_capacity(1 << 16, file)) })
    }

    /// Everything is written: the file takes its name.
    ///
    /// # Errors
    /// The path with the system's words.
    pub fn finish(mut self) -> Result<(), String> {
        let named = self.close().and_then(|()| self.part.as_ref().map_or(Ok(()), |part| fs::rename(part, &self.path)));
        named.map_err(|e| format!("{}: {e}", self.path.display()))
    }

    fn close(&mut self) -> io::Result<()> {
        self.writer.take().map_or(Ok(()), |mut writer| writer.flush())
    }
}

fn beside(path: &Path) -> PathBuf {
    let mut part = path.as_os_str().to_owned();
    part.push(".part");
    part.into()
}

impl Write for Output {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.writer.as_mut().map_or(Err(io::ErrorKind::BrokenPipe.into()), |w| w.write(bytes))
    }

    fn flush(&mut self) -> io::Result<()> {
        self.writer.as_mut().map_or(Ok(()), Write::flush)
    }
}

impl Drop for Output {
    fn drop(&mut self) {
        if let (Some(_), Some(part)) = (self.writer.take(), &self.part) {
            let _ = fs::remove_file(part);
        }
    }
}
