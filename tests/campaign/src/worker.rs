//! Worker processes: each drives one run after the other, and may die of one.

use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::time::Duration;

use rustix::process::{Resource, Rlimit, setrlimit};
use tandem_rig::processor_time_of;

use crate::case::Case;
use crate::run::{registry, run};
use crate::verdict::Report;

/// The argument that makes the binary a worker.
pub const WORKER: &str = "worker";
/// Address space of a worker, bytes: a run that asks for more aborts.
const MAX_BYTES: u64 = 1 << 31;

/// Share of a processor below which a worker does nothing, which is less than the busiest computer leaves to it.
const MIN_SHARE: f64 = 0.002;
/// Characters of what a worker said before it died that are told: a backtrace is long.
const MAX_WORDS: usize = 300;

/// The main loop of a worker: a folder comes in as a line, a report goes out as a line.
///
/// # Errors
/// The parent has gone away.
pub fn serve() -> std::io::Result<()> {
    // A panic is told in the report.
    std::panic::set_hook(Box::new(|_| ()));
    let _ = setrlimit(
        Resource::As,
        Rlimit {
            current: Some(MAX_BYTES),
            maximum: Some(MAX_BYTES),
        },
    );
    let registry = registry();
    let mut out = std::io::stdout().lock();
    for line in std::io::stdin().lock().lines() {
        let folder = PathBuf::from(line?);
        let report = match Case::read(&folder) {
            Ok(case) => run(&case, &folder, &registry),
            Err(cause) => Report::failed("no-case", cause),
        };
        writeln!(out, "{}", written(&report))?;
        out.flush()?;
    }
    Ok(())
}

fn written(report: &Report) -> String {
    let Report {
        planner,
        kind,
        why,
        size,
        samples,
        memory_mb,
    } = report;
    let why = why.replace(['\n', '\t'], " ");
    format!("{planner}\t{kind}\t{size}\t{samples}\t{memory_mb}\t{why}")
}

fn read(line: &str) -> Option<Report> {
    let mut fields = line.splitn(6, '\t');
    let mut next = || fields.next();
    Some(Report {
        planner: next()?.to_string(),
        kind: next()?.to_string(),
        size: next()?.parse().ok()?,
        samples: next()?.parse().ok()?,
        memory_mb: next()?.parse().ok()?,
        why: next()?.to_string(),
    })
}

/// A worker as its parent sees it, and the folder of its runs.
pub struct Worker {
    binary: PathBuf,
    folder: PathBuf,
    patience: Duration,
    process: Option<Process>,
}

struct Process {
    child: Child,
    input: ChildStdin,
    lines: Receiver<String>,
    errors: Receiver<String>,
    /// It has answered.
    is_used: bool,
}

impl Worker {
    /// A worker made of `binary`, which works in `folder` and gets at most `patience` of a processor for each run.
    pub fn new(binary: &Path, folder: &Path, patience: Duration) -> Self {
        Self {
            binary: binary.to_owned(),
            folder: folder.to_owned(),
            patience,
            process: None,
        }
    }

    /// Drives a case. A worker that dies or does not answer is replaced, and its run has failed. What a worker keeps of the memory
    /// of earlier runs is not the run's: where it took too much, a fresh one drives it again.
    pub fn run(&mut self, case: &Case) -> Report {
        let planner = case.planner();
        let is_used = self.process.as_ref().is_some_and(|it| it.is_used);
        let attempt = |worker: &mut Self| {
            worker
                .attempt(case)
                .unwrap_or_else(|cause| Report::failed("no-worker", cause))
        };
        let mut report = attempt(self);
        if report.kind == "memory" && is_used {
            if let Some(process) = self.process.take() {
                process.end();
            }
            report = attempt(self);
        }
        Report { planner, ..report }
    }

    fn attempt(&mut self, case: &Case) -> Result<Report, String> {
        case.write(&self.folder)?;
        let mut process = match self.process.take() {
            Some(process) => process,
            None => Process::start(&self.binary)?,
        };
        writeln!(process.input, "{}", self.folder.display()).map_err(|e| e.to_string())?;
        match process.answer(self.patience) {
            Ok(line) => {
                process.is_used = true;
                self.process = Some(process);
                read(&line).ok_or_else(|| format!("a worker answers {line:?}"))
            }
            Err(RecvTimeoutError::Timeout) => {
                process.end();
                Ok(Report::failed(
                    "hang",
                    format!("no answer within {} s", self.patience.as_secs()),
                ))
            }
            Err(RecvTimeoutError::Disconnected) => {
                let (status, words) = process.end();
                let kind = if words.contains("memory allocation") {
                    "memory"
                } else {
                    "abort"
                };
                Ok(Report::failed(kind, format!("{status} {words}")))
            }
        }
    }
}

impl Drop for Worker {
    fn drop(&mut self) {
        if let Some(process) = self.process.take() {
            process.end();
        }
    }
}

impl Process {
    fn start(binary: &Path) -> Result<Self, String> {
        let mut command = Command::new(binary);
        command
            .arg(WORKER)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped());
        let mut child = command
            .spawn()
            .map_err(|e| format!("{}: {e}", binary.display()))?;
        let taken = (child.stdin.take(), child.stdout.take(), child.stderr.take());
        let (Some(input), Some(output), Some(errors)) = taken else {
            return Err("a worker without pipes".to_string());
        };
        Ok(Self {
            child,
            input,
            lines: lines_of(output),
            errors: lines_of(errors),
            is_used: false,
        })
    }

    /// What it answers, as long as it has taken less than `patience` of its processor's time, and takes any: on a computer that
    /// does other work besides, a run lasts longer and is no worse.
    fn answer(&self, patience: Duration) -> Result<String, RecvTimeoutError> {
        let begun = self.processor_time();
        let mut taken = Duration::ZERO;
        loop {
            let wait = patience.saturating_sub(taken).max(patience / 10);
            match self.lines.recv_timeout(wait) {
                Err(RecvTimeoutError::Timeout) => {}
                answer => return answer,
            }
            let before = taken;
            taken = self.processor_time().saturating_sub(begun);
            if taken >= patience || taken.saturating_sub(before) < wait.mul_f64(MIN_SHARE) {
                return Err(RecvTimeoutError::Timeout);
            }
        }
    }

    /// What its first thread, which drives the runs, has taken of the processor.
    fn processor_time(&self) -> Duration {
        processor_time_of(self.child.id()).unwrap_or_default()
    }

    /// Ends it; how it ended, and what it said.
    fn end(mut self) -> (String, String) {
        drop(self.input);
        let _ = self.child.kill();
        let status = self
            .child
            .wait()
            .map_or_else(|e| e.to_string(), |status| status.to_string());
        let words: Vec<String> = self.errors.iter().collect();
        (status, words.join(" ").chars().take(MAX_WORDS).collect())
    }
}

/// The lines of a pipe, read by a thread, so that one can wait for them with patience.
fn lines_of(pipe: impl std::io::Read + Send + 'static) -> Receiver<String> {
    let (sender, receiver) = channel();
    std::thread::spawn(move || {
        for line in BufReader::new(pipe).lines().map_while(Result::ok) {
            if sender.send(line).is_err() {
                return;
            }
        }
    });
    receiver
}
