//! Files that a run writes. What exists is replaced only when the new content is complete.

use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

/// A file in the making, beside the one it will become.
pub struct Output {
    path: PathBuf,
    part: PathBuf,
    writer: Option<BufWriter<File>>,
}

impl Output {
    /// Starts a file at `path`.
    ///
    /// # Errors
    /// The path with the system's words.
    pub fn create(path: &Path) -> Result<Self, String> {
        let mut part = path.as_os_str().to_owned();
        part.push(".part");
        let part = PathBuf::from(part);
        let file = File::create(&part).map_err(|e| format!("{}: {e}", part.display()))?;
        Ok(Self { path: path.to_owned(), part, writer: Some(BufWriter::with_capacity(1 << 16, file)) })
    }

    /// Everything is written: the file takes its name.
    ///
    /// # Errors
    /// The path with the system's words.
    pub fn finish(mut self) -> Result<(), String> {
        let named = self.close().and_then(|()| fs::rename(&self.part, &self.path));
        named.map_err(|e| format!("{}: {e}", self.path.display()))
    }

    fn close(&mut self) -> io::Result<()> {
        self.writer.take().map_or(Ok(()), |mut writer| writer.flush())
    }
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
        if self.writer.take().is_some() {
            let _ = fs::remove_file(&self.part);
        }
    }
}
