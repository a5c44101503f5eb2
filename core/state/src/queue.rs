//! What waits for the writer.

use std::collections::HashSet;
use std::mem::take;
use std::sync::mpsc::SyncSender;
use std::time::Instant;

use rusqlite::Connection;
use tandem_sdk::{Axes, AxisVector};

use crate::change::Change;
use crate::data::Driven;
use crate::error::StateError;
use crate::write::Writer;

/// Above so many waiting changes, those that later ones replace are left out, and the oldest of the history: a disk that
/// stays full does not fill the memory too.
const MAX_WAITING: usize = 4096;

/// Changes whose sender waits until they are on disk.
#[derive(Debug)]
pub(crate) struct Request {
    pub changes: Vec<Change>,
    pub answer: SyncSender<Result<(), StateError>>,
}

#[derive(Debug)]
enum Waiting {
    Change(Change),
    Request(Request),
}

/// What waits, in the order in which it came.
#[derive(Debug, Default)]
pub(crate) struct Queue {
    waiting: Vec<Waiting>,
    /// After how many entries it is looked whether some can be left out.
    thin_at: usize,
    requests: usize,
    /// The line that is driven: only the last one counts.
    pub driven: Option<Driven>,
    /// The store is dropped: what waits is written, and nothing more taken.
    pub closing: bool,
    /// Why the last attempt to write failed.
    pub trouble: Option<StateError>,
}

/// When the writer writes.
#[derive(Debug, PartialEq)]
pub(crate) enum Due {
    Now,
    At(Instant),
    /// Nothing waits.
    Never,
}

impl Queue {
    /// False where the store is closed.
    #[must_use]
    pub fn push(&mut self, change: Change) -> bool {
        if self.closing {
            return false;
        }
        self.waiting.push(Waiting::Change(change));
        if self.waiting.len() > self.thin_at.max(MAX_WAITING) {
            self.thin();
        }
        true
    }

    /// False where the store is closed.
    #[must_use]
    pub fn ask(&mut self, request: Request) -> bool {
        if self.closing {
            return false;
        }
        self.requests += 1;
        self.waiting.push(Waiting::Request(request));
        true
    }

    /// Nobody writes any more: who waits is told.
    pub fn give_up(&mut self) {
        self.closing = true;
        self.waiting.clear();
    }

    /// When to write: after a failure nothing but requests is tried before `retry`, and the line alone is no reason before
    /// `line`.
    pub fn due(&self, retry: Option<Instant>, line: Instant, now: Instant) -> Due {
        if self.closing || self.requests > 0 {
            return Due::Now;
        }
        let at = match (self.waiting.is_empty(), self.driven.is_some()) {
            (false, _) => retry.unwrap_or(now),
            (true, true) => retry.unwrap_or(now).max(line),
            (true, false) => return Due::Never,
        };
        if at <= now { Due::Now } else { Due::At(at) }
    }

    /// Everything that waits.
    pub fn take(&mut self) -> Batch {
        self.requests = 0;
        Batch {
            waiting: take(&mut self.waiting),
            driven: self.driven.take(),
        }
    }

    /// Tells those who wait how it went. What nobody waits for and was not written waits again, before what came since.
    pub fn settle(&mut self, batch: Batch, written: &Result<(), StateError>) {
        let mut again = Vec::new();
        for entry in batch.waiting {
            match entry {
                // Nobody there any more is no failure.
                Waiting::Request(request) => drop(request.answer.send(written.clone())),
                Waiting::Change(_) if written.is_ok() => {}
                change @ Waiting::Change(_) => again.push(change),
            }
        }
        if written.is_err() {
            again.append(&mut self.waiting);
            self.waiting = again;
            self.driven = self.driven.take().or(batch.driven);
        }
    }

    fn thin(&mut self) {
        let mut later = HashSet::new();
        let mut kept: Vec<_> = take(&mut self.waiting)
            .into_iter()
            .rev()
            .filter(|entry| match entry {
                Waiting::Change(change) => key(change).is_none_or(|key| later.insert(key)),
                Waiting::Request(_) => true,
            })
            .collect();
        let mut history = 0;
        kept.retain(|entry| {
            let is_history = matches!(entry, Waiting::Change(change) if key(change).is_none());
            history += usize::from(is_history);
            !is_history || history <= MAX_WAITING / 2
        });
        kept.reverse();
        self.waiting = kept;
        self.thin_at = 2 * self.waiting.len();
    }
}

/// What a change says the whole new value of; none for the history, of which each entry is another.
fn key(change: &Change) -> Option<(u8, usize, String)> {
    Some(match change {
        Change::Program(_) => (0, 0, String::new()),
        Change::ForgetReference(which) => (7, *which, String::new()),
        Change::ListParameter { number, .. } => (8, *number, String::new()),
        Change::Tool(tool) => (9, tool.number as usize, String::new()),
        Change::ToolLife { number, .. } => (10, *number as usize, String::new()),
        Change::ForgetTool(number) => (11, *number as usize, String::new()),
        Change::Turns { axis, .. } => (12, *axis, String::new()),
        Change::PolicyParameter { name, .. } => (13, 0, name.clone()),
        Change::LastPosition(_) => (14, 0, String::new()),
        Change::Whole(_) => (15, 0, String::new()),
        Change::JobBegan(_)
        | Change::JobEnded { .. }
        | Change::Raised(_)
        | Change::Acknowledged { .. } => return None,
    })
}

/// What is written at once.
pub(crate) struct Batch {
    waiting: Vec<Waiting>,
    driven: Option<Driven>,
}

impl Batch {
    /// One transaction: on disk, or nothing changed.
    pub fn write(
        &self,
        connection: &mut Connection,
        axes: &Axes,
        home: &AxisVector,
    ) -> rusqlite::Result<()> {
        let changes = self.waiting.iter().flat_map(|entry| match entry {
            Waiting::Change(change) => std::slice::from_ref(change),
            Waiting::Request(request) => &request.changes,
        });
        let mut changes = changes.peekable();
        if changes.peek().is_none() && self.driven.is_none() {
            return Ok(());
        }
        let writer = Writer::begin(connection, axes, home)?;
        changes.try_for_each(|change| writer.write(change))?;
        self.driven
            .as_ref()
            .map_or(Ok(()), |driven| writer.driven(driven))?;
        writer.commit()
    }
}
