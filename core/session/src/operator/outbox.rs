//! What waits to be sent to a client, bounded.

use std::io::{self, ErrorKind, Write};

/// Telemetry is kept only while less than this waits, bytes.
const TELEMETRY_BYTES: usize = 8 * 1024;
/// A client that lets this much wait is closed: it asks and does not read, bytes.
const MAX_BYTES: usize = 256 * 1024;
/// Frames of a stream are kept only while less than this waits, bytes.
const FRAME_BYTES: usize = 64 * 1024;

/// Lines on their way to a client.
#[derive(Debug, Default)]
pub struct Outbox {
    bytes: Vec<u8>,
    /// Telemetry lines that found no room since the last one that did.
    lost: u64,
    /// The same of frames of a stream.
    lost_frames: u64,
}

impl Outbox {
    /// An answer; `false` where the client has let too many of them wait.
    #[must_use]
    pub fn answer(&mut self, line: &str) -> bool {
        let fits = self.bytes.len() + line.len() <= MAX_BYTES;
        if fits {
            self.bytes.extend_from_slice(line.as_bytes());
        }
        fits
    }

    /// A telemetry line, made from the number of those lost before it; counted where there is no room for it.
    pub fn telemetry(&mut self, line: impl FnOnce(u64) -> String) {
        if self.bytes.len() >= TELEMETRY_BYTES {
            self.lost += 1;
            return;
        }
        self.bytes.extend_from_slice(line(self.lost).as_bytes());
        self.lost = 0;
    }

    /// A frame of a stream, made from the number of those lost before it; counted where there is no room for it.
    pub fn frame(&mut self, line: impl FnOnce(u64) -> String) {
        if self.bytes.len() >= FRAME_BYTES {
            self.lost_frames += 1;
            return;
        }
        self.bytes
            .extend_from_slice(line(self.lost_frames).as_bytes());
        self.lost_frames = 0;
    }

    /// The last telemetry line: it takes its place where an answer would.
    pub fn last(&mut self, line: impl FnOnce(u64) -> String) {
        let line = line(self.lost);
        self.bytes.extend_from_slice(line.as_bytes());
    }

    /// Whether everything is sent.
    pub fn is_empty(&self) -> bool {
        self.bytes.is_empty()
    }

    /// Sends what the stream takes now; never waits.
    ///
    /// # Errors
    /// The stream is broken.
    pub fn send(&mut self, stream: &mut dyn Write) -> io::Result<()> {
        while !self.bytes.is_empty() {
            match stream.write(&self.bytes) {
                Ok(0) => return Err(ErrorKind::WriteZero.into()),
                Ok(count) => drop(self.bytes.drain(..count)),
                Err(error) if error.kind() == ErrorKind::WouldBlock => return Ok(()),
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) => return Err(error),
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn telemetry_without_room_is_counted_and_told_once() {
        let mut outbox = Outbox::default();
        let mut told = vec![];
        for _ in 0..20 {
            outbox.telemetry(|lost| {
                told.push(lost);
                "x".repeat(1024)
            });
        }
        assert_eq!(told, [0; 8]);
        assert!(outbox.answer("an answer is no telemetry\n"));
        let mut sent = vec![];
        outbox.send(&mut sent).unwrap();
        assert!(outbox.is_empty() && sent.len() > 8 * 1024);
        for _ in 0..2 {
            outbox.telemetry(|lost| {
                told.push(lost);
                String::new()
            });
        }
        assert_eq!(told[8..], [12, 0]);
    }

    #[test]
    fn answers_without_end_do_not_fit() {
        let mut outbox = Outbox::default();
        let line = "x".repeat(1000);
        assert!((0..MAX_BYTES / 1000).all(|_| outbox.answer(&line)));
        assert!(!outbox.answer(&line));
    }
}
