//! What clients have said, and when: lines of a script that says it again on the virtual clock.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use serde_json::{Value, json};

/// Lines that may wait for the disk.
const MAX_WAITING: usize = 16 * 1024;
/// Stack of the thread, bytes: it is locked into memory with the rest.
const STACK_BYTES: usize = 256 * 1024;
/// How long the end of the controller waits for disks.
const PATIENCE: Duration = Duration::from_secs(2);

/// Writes what comes, in a thread of its own: whoever speaks waits for no disk.
pub struct Arrivals {
    path: PathBuf,
    began: Instant,
    fine_period_s: f64,
    /// None once it is broken.
    lines: Mutex<Option<SyncSender<String>>>,
    trouble: Arc<Mutex<Option<String>>>,
    writer: Option<JoinHandle<()>>,
}

impl Arrivals {
    /// Begins the file; fine periods count from here on. Host.
    ///
    /// # Errors
    /// The file cannot be made, or there is no thread.
    pub fn create(path: &Path, fine_period_s: f64) -> Result<Self, String> {
        let file = File::create(path).map_err(|e| format!("{}: {e}", path.display()))?;
        let (lines, coming) = sync_channel(MAX_WAITING);
        let trouble = Arc::<Mutex<Option<String>>>::default();
        let tells = Arc::clone(&trouble);
        let writer = thread::Builder::new()
            .name("tandem-arrivals".to_string())
            .stack_size(STACK_BYTES)
            .spawn(move || {
                if let Err(why) = write_all(file, &coming) {
                    *tells.lock().unwrap_or_else(PoisonError::into_inner) = Some(why.to_string());
                }
            })
            .map_err(|e| format!("there is no thread that writes {}: {e}", path.display()))?;
        Ok(Self {
            path: path.to_owned(),
            began: Instant::now(),
            fine_period_s,
            lines: Mutex::new(Some(lines)),
            trouble,
            writer: Some(writer),
        })
    }

    /// A client has said a line. The answer, once, is why nothing more is written.
    pub fn line(&self, client: u64, text: &str) -> Option<String> {
        let said = serde_json::from_str(text);
        self.add(client, "say", &said.unwrap_or_else(|_| json!(text)))
    }

    /// A sender has said bytes; the same.
    pub fn bytes(&self, client: u64, bytes: &[u8]) -> Option<String> {
        let text: String = bytes.iter().map(|byte| char::from(*byte)).collect();
        self.add(client, "say", &json!({ "grbl": text }))
    }

    /// A client is gone; the same.
    pub fn leaves(&self, client: u64) -> Option<String> {
        self.add(client, "leaves", &json!(true))
    }

    fn add(&self, client: u64, what: &str, value: &Value) -> Option<String> {
        let tick = (self.began.elapsed().as_secs_f64() / self.fine_period_s) as u64;
        let line = json!({ "tick": tick, "client": client, what: value });
        let mut lines = self.lines.lock().unwrap_or_else(PoisonError::into_inner);
        let why = match lines.as_ref()?.try_send(format!("{line}\n")) {
            Ok(()) => return None,
            Err(TrySendError::Full(_)) => "the disk does not keep up".to_string(),
            Err(TrySendError::Disconnected(_)) => {
                let mut trouble = self.trouble.lock().unwrap_or_else(PoisonError::into_inner);
                trouble.take().unwrap_or_default()
            }
        };
        *lines = None;
        let path = self.path.display();
        Some(format!(
            "{path}: {why}: what clients say is not written from tick {tick} on"
        ))
    }
}

/// Writes lines, and onto the disk as soon as none waits: who is killed has lost none of those.
fn write_all(file: File, coming: &Receiver<String>) -> std::io::Result<()> {
    let mut file = BufWriter::new(file);
    while let Ok(line) = coming.recv() {
        file.write_all(line.as_bytes())?;
        while let Ok(line) = coming.try_recv() {
            file.write_all(line.as_bytes())?;
        }
        file.flush()?;
    }
    Ok(())
}

impl Drop for Arrivals {
    fn drop(&mut self) {
        *self.lines.lock().unwrap_or_else(PoisonError::into_inner) = None;
        if let Some(writer) = self.writer.take() {
            // A disk that hangs keeps no process from ending.
            wait_while(|| !writer.is_finished());
        }
    }
}

/// Waits while a disk `takes` its time, as long as the end of a controller may.
pub fn wait_while(takes: impl Fn() -> bool) {
    let began = Instant::now();
    while takes() && began.elapsed() < PATIENCE {
        thread::sleep(Duration::from_millis(1));
    }
}
