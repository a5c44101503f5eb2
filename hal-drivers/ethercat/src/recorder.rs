//! Frames as a file that Wireshark opens.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;

/// The format's number where times are in ns, and the kind of link: Ethernet.
const MAGIC: u32 = 0xa1b2_3c4d;
const ETHERNET: u32 = 1;
const MAX_BYTES: u32 = 65535;

/// Writes both directions of a link, with the time of the link.
#[derive(Debug)]
pub(crate) struct Recorder {
    file: BufWriter<File>,
}

impl Recorder {
    pub(crate) fn create(path: &Path) -> Result<Self, String> {
        let failed = |error: std::io::Error| format!("{}: {error}", path.display());
        let mut file = BufWriter::new(File::create(path).map_err(failed)?);
        let header = [MAGIC, 4 << 16 | 2, 0, 0, MAX_BYTES, ETHERNET].map(u32::to_le_bytes);
        file.write_all(header.as_flattened()).map_err(failed)?;
        Ok(Self { file })
    }

    /// Adds a frame; what cannot be written ends up missing at the end of the file.
    pub(crate) fn add(&mut self, now_ns: u64, frame: &[u8]) {
        let bytes = frame.len() as u32;
        let header = [
            (now_ns / 1_000_000_000) as u32,
            (now_ns % 1_000_000_000) as u32,
            bytes,
            bytes,
        ]
        .map(u32::to_le_bytes);
        let _ = self
            .file
            .write_all(header.as_flattened())
            .and_then(|()| self.file.write_all(frame));
    }
}
