//! One case with one build.

use std::fs::File;
use std::io::Write;
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use serde_json::Value;

use crate::cases::Case;

/// The files that a run is asked for.
pub const TRACE: &str = "trace.ttr";
const BLOCKS: &str = "blocks.csv";
const EVENTS: &str = "events.csv";
const SUMMARY: &str = "summary.json";
/// A run that takes longer is ended; both builds are then said not to end.
const PATIENCE: Duration = Duration::from_mins(2);

/// What a run left.
#[derive(Debug)]
pub struct Ran {
    /// The folder in which it ran.
    pub folder: PathBuf,
    /// Exit status; none where a signal or the end of patience ended it.
    pub status: Option<i32>,
    /// Standard output.
    pub output: String,
    /// Standard error.
    pub errors: String,
    /// The binary trace; empty where there is none, as in what follows.
    pub trace: Vec<u8>,
    /// The blocks as they were driven.
    pub blocks: String,
    /// What was switched.
    pub events: String,
    /// The summary.
    pub summary: Value,
}

/// Runs `case` with `binary` in `folder`, which is made.
///
/// # Errors
/// The folder or the process.
pub fn run(case: &Case, binary: &Path, folder: &Path) -> Result<Ran, String> {
    let wrong = |e: std::io::Error| format!("{}: {e}", folder.display());
    std::fs::create_dir_all(folder).map_err(wrong)?;
    for (name, bytes) in &case.files {
        std::fs::write(folder.join(name), bytes).map_err(wrong)?;
    }
    let mut input = File::options()
        .read(true)
        .write(true)
        .create(true)
        .truncate(true)
        .open(folder.join("input"))
        .map_err(wrong)?;
    input.write_all(case.input.as_bytes()).map_err(wrong)?;
    let create = |name: &str| File::create(folder.join(name)).map_err(wrong);
    let mut command = Command::new(binary);
    // Both say the same name of themselves in their help.
    command
        .arg0("tandem")
        .args(&case.arguments)
        .current_dir(folder);
    if case.arguments.first().is_some_and(|first| first == "run") {
        // A case may ask for these files itself.
        let asked = [
            ("--trace", TRACE),
            ("--blocks", BLOCKS),
            ("--events", EVENTS),
            ("--summary", SUMMARY),
        ];
        let free = asked
            .into_iter()
            .filter(|(option, _)| case.arguments.iter().all(|argument| argument != option));
        command.args(free.flat_map(|(option, name)| [option, name]));
    }
    command.stdin(File::open(folder.join("input")).map_err(wrong)?);
    command
        .stdout(Stdio::from(create("stdout")?))
        .stderr(Stdio::from(create("stderr")?));
    let status = wait(&mut command).map_err(|e| format!("{}: {e}", binary.display()))?;
    let bytes = |name: &str| std::fs::read(folder.join(name)).unwrap_or_default();
    let text = |name: &str| String::from_utf8_lossy(&bytes(name)).into_owned();
    Ok(Ran {
        folder: folder.to_owned(),
        status,
        output: text("stdout"),
        errors: text("stderr"),
        trace: bytes(TRACE),
        blocks: text(BLOCKS),
        events: text(EVENTS),
        summary: serde_json::from_str(&text(SUMMARY)).unwrap_or_default(),
    })
}

fn wait(command: &mut Command) -> std::io::Result<Option<i32>> {
    let (mut child, begun) = (command.spawn()?, Instant::now());
    while begun.elapsed() < PATIENCE {
        if let Some(status) = child.try_wait()? {
            return Ok(status.code());
        }
        std::thread::sleep(Duration::from_millis(2));
    }
    child.kill()?;
    child.wait().map(|status| status.code())
}
