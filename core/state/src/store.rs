//! The file, its one writer, and those who ask it.

use std::fs::File;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError, mpsc};
use std::thread::JoinHandle;
use std::time::{Duration, Instant, SystemTime};

use rusqlite::{Connection, OpenFlags};
use tandem_machine::Machine;
use tandem_sdk::{Axes, AxisVector};

use crate::change::Change;
use crate::data::{Alarm, Driven, Job, PersistentState};
use crate::error::StateError;
use crate::queue::{Due, Queue, Request};
use crate::rows::{Rows, axes_of, letters_of};
use crate::schema::{FORMATS, bring_up, examine};
use crate::write::{Writer, judge};

/// How often the line that is driven is written at most: a program of short blocks drives a thousand a second, and each write
/// wears the disk. A restart needs the neighbourhood of the line, not the line.
const DRIVEN_EVERY: Duration = Duration::from_millis(250);
/// After a write that failed, the next attempt.
const AGAIN_AFTER: Duration = Duration::from_secs(1);
/// How long a reader is waited for that holds up a write.
const BUSY: Duration = Duration::from_secs(5);

/// Whose state a file is.
#[derive(Clone, Copy, Debug)]
pub struct Owner<'a> {
    /// The machine's name.
    pub machine: &'a str,
    /// Its axes.
    pub axes: &'a Axes,
    /// Its `home`, machine coordinates, mm or rad: the place of G28 and G30 where none is stored.
    pub home: AxisVector,
}

impl<'a> Owner<'a> {
    /// As a machine file says.
    pub fn of(machine: &'a Machine) -> Self {
        Self {
            machine: &machine.name,
            axes: &machine.axes,
            home: machine.home,
        }
    }
}

/// The state of one machine, open for writing: one process at a time. Dropping it writes what waits.
#[derive(Debug)]
pub struct Store {
    shared: Arc<Shared>,
    writer: Option<JoinHandle<()>>,
    axes: Axes,
    filled: bool,
    first: PersistentState,
    copy: Option<PathBuf>,
    next_job: AtomicU64,
    next_alarm: AtomicU64,
    vfs: Option<String>,
    _lock: File,
}

#[derive(Debug)]
struct Shared {
    path: PathBuf,
    queue: Mutex<Queue>,
    wake: Condvar,
}

impl Shared {
    fn queue(&self) -> MutexGuard<'_, Queue> {
        // Nothing is half done while it is locked.
        self.queue.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Sends what happens to the writer: clones go to whoever sees it. No method waits for the disk; each takes a lock that is
/// held for the length of an append, so none is for the fine loop.
#[derive(Clone, Debug)]
pub struct Recorder {
    shared: Arc<Shared>,
}

impl Recorder {
    /// Writes `change` soon. What cannot be written (a full disk) stays and is tried again; [`Store::trouble`] tells.
    ///
    /// # Errors
    /// A value that cannot last: not a number. Or the store is closed.
    pub fn record(&self, change: Change) -> Result<(), StateError> {
        judge(&change)?;
        if !self.shared.queue().push(change) {
            return Err(StateError::Closed {
                path: self.shared.path.clone(),
            });
        }
        self.shared.wake.notify_one();
        Ok(())
    }

    /// The line that is driven. It is written at most four times a second, the last one counts.
    pub fn driven(&self, driven: Driven) {
        self.shared.queue().driven = Some(driven);
        self.shared.wake.notify_one();
    }
}

impl Store {
    /// Opens or makes the file at `path`, with the folders above it, and starts its writer. An older file is brought to this
    /// version's format, and a copy of it kept beside it.
    ///
    /// # Errors
    /// The file is damaged, foreign, of a later version, of another machine, open elsewhere, or cannot be read or written.
    pub fn open(path: &Path, owner: Owner<'_>) -> Result<Self, StateError> {
        Self::open_on(path, owner, None)
    }

    /// [`Store::open`] on another file system layer of SQLite's, for tests that take power away.
    ///
    /// # Errors
    /// As [`Store::open`].
    pub fn open_on(path: &Path, owner: Owner<'_>, vfs: Option<&str>) -> Result<Self, StateError> {
        let cannot = |error: std::io::Error| StateError::Open {
            path: path.into(),
            why: error.to_string(),
        };
        if let Some(folder) = path
            .parent()
            .filter(|folder| !folder.as_os_str().is_empty())
        {
            std::fs::create_dir_all(folder).map_err(cannot)?;
        }
        let lock = lock(path)?;
        let reading = |error: rusqlite::Error| StateError::reading(path, &error);
        let writing = |error: rusqlite::Error| StateError::writing(path, &error);
        let mut connection = connect(path, OpenFlags::default(), vfs)?;
        if connection.is_readonly("main").map_err(reading)? {
            let why = "the file or its folder is read-only; SQLite needs both writable".into();
            return Err(StateError::Write {
                path: path.into(),
                why,
            });
        }
        let new = examine(&connection, path)?;
        let mode = connection
            .pragma_update_and_check(None, "journal_mode", "WAL", |row| row.get::<_, String>(0));
        if mode.map_err(writing)? != "wal" {
            let why = "this file system has no shared memory, which SQLite's write-ahead log needs"
                .into();
            return Err(StateError::Write {
                path: path.into(),
                why,
            });
        }
        connection
            .pragma_update(None, "synchronous", "FULL")
            .map_err(writing)?;
        let copy = bring_up(&mut connection, path, FORMATS)?;
        if !new {
            refuse_other(&connection, path, owner)?;
        }
        let writer = Writer::begin(&mut connection, owner.axes, &owner.home).map_err(writing)?;
        let prepared = writer
            .note("machine", owner.machine)
            .and_then(|()| writer.axes())
            .and_then(|()| writer.lose_open_jobs(now_unix_ms()))
            .and_then(|()| writer.commit());
        prepared.map_err(writing)?;
        sync_folder(path).map_err(cannot)?;
        let rows = Rows {
            connection: &connection,
            path,
            axes: owner.axes,
        };
        let first = rows.state()?;
        let filled = rows.note("filled")?.is_some();
        let [next_job, next_alarm] =
            [rows.highest("job")?, rows.highest("alarm")?].map(|last| AtomicU64::new(last + 1));
        let shared = Arc::new(Shared {
            path: path.into(),
            queue: Mutex::new(Queue::default()),
            wake: Condvar::new(),
        });
        let (axes, home, theirs) = (*owner.axes, owner.home, Arc::clone(&shared));
        let thread = std::thread::Builder::new().name("state".into());
        let writer = thread
            .spawn(move || write_on(&theirs, connection, &axes, &home))
            .map_err(cannot)?;
        Ok(Self {
            shared,
            writer: Some(writer),
            axes,
            filled,
            first,
            copy,
            next_job,
            next_alarm,
            vfs: vfs.map(str::to_owned),
            _lock: lock,
        })
    }

    /// The file.
    pub fn path(&self) -> &Path {
        &self.shared.path
    }

    /// The copy that was made because the file had an older format.
    pub fn copy_of_older(&self) -> Option<&Path> {
        self.copy.as_deref()
    }

    /// Gives a file that is new what `machine` says of tools, for a controller to begin with; any other file is left as it is, and so
    /// are the values of one that holds some without having been given initial ones. [`Store::load`] tells the outcome. On disk
    /// when it returns.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn fill(&mut self, machine: &Machine) -> Result<(), StateError> {
        if self.filled {
            return Ok(());
        }
        if self.first == PersistentState::default() {
            self.first = PersistentState::initial(machine);
        }
        self.commit(vec![Change::Whole(Box::new(self.first.clone()))])?;
        self.filled = true;
        Ok(())
    }

    /// Whether the file is new: nobody has committed a [`Change::Whole`] with initial values yet.
    pub fn is_new(&self) -> bool {
        !self.filled
    }

    /// What the file held when it was opened.
    pub fn load(&self) -> &PersistentState {
        &self.first
    }

    /// Who sends what happens to the writer.
    pub fn recorder(&self) -> Recorder {
        Recorder {
            shared: Arc::clone(&self.shared),
        }
    }

    /// Writes `changes`, all or none of them, behind everything that was recorded before, and returns when they are on disk:
    /// for what a client asked for, before it is told. Waits for the disk, so it is for no loop.
    ///
    /// # Errors
    /// A value that cannot last, or the file cannot be written. Then none of `changes` is, nor will be.
    pub fn commit(&self, changes: Vec<Change>) -> Result<(), StateError> {
        changes.iter().try_for_each(judge)?;
        let (answer, answered) = mpsc::sync_channel(1);
        let closed = || {
            Err(StateError::Closed {
                path: self.shared.path.clone(),
            })
        };
        if !self.shared.queue().ask(Request { changes, answer }) {
            return closed();
        }
        self.shared.wake.notify_one();
        answered.recv().unwrap_or_else(|_| closed())
    }

    /// Returns when everything that was recorded before is on disk.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn flush(&self) -> Result<(), StateError> {
        self.commit(Vec::new())
    }

    /// Why the writer could not write when it last tried; none where it could. It goes on trying.
    pub fn trouble(&self) -> Option<StateError> {
        self.shared.queue().trouble.clone()
    }

    /// A number for the next job.
    pub fn next_job(&self) -> u64 {
        self.next_job.fetch_add(1, Ordering::Relaxed)
    }

    /// A number for the next alarm.
    pub fn next_alarm(&self) -> u64 {
        self.next_alarm.fetch_add(1, Ordering::Relaxed)
    }

    /// The last jobs that are on disk, the latest first. Reads the disk.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn jobs(&self, count: usize) -> Result<Vec<Job>, StateError> {
        self.read(|rows| rows.last_jobs(count))
    }

    /// The last alarms that are on disk, acknowledged ones too, the latest first. Reads the disk.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn alarms(&self, count: usize) -> Result<Vec<Alarm>, StateError> {
        self.read(|rows| rows.last_alarms(count))
    }

    /// What is on disk now. Reads the disk.
    ///
    /// # Errors
    /// The file cannot be read.
    #[allow(
        clippy::redundant_closure_for_method_calls,
        reason = "the method is of one lifetime, the closure of any"
    )]
    pub fn read_back(&self) -> Result<PersistentState, StateError> {
        self.read(|rows| rows.state())
    }

    fn read<T>(
        &self,
        read: impl FnOnce(&Rows<'_>) -> Result<T, StateError>,
    ) -> Result<T, StateError> {
        let path = &self.shared.path;
        let connection = connect(path, OpenFlags::SQLITE_OPEN_READ_ONLY, self.vfs.as_deref())?;
        read(&Rows {
            connection: &connection,
            path,
            axes: &self.axes,
        })
    }

    /// Writes what waits and closes the file.
    ///
    /// # Errors
    /// What waits could not be written; it is lost.
    pub fn close(self) -> Result<(), StateError> {
        self.flush()
    }
}

impl Drop for Store {
    fn drop(&mut self) {
        self.shared.queue().closing = true;
        self.shared.wake.notify_one();
        if let Some(writer) = self.writer.take() {
            let _ = writer.join();
        }
    }
}

/// A state file that is only looked at, while another process may write it.
#[derive(Debug)]
pub struct Reader {
    connection: Connection,
    path: PathBuf,
    axes: Axes,
    machine: String,
}

impl Reader {
    /// Opens the file at `path`.
    ///
    /// # Errors
    /// There is none, or it is damaged, foreign, of another version, or cannot be read.
    pub fn open(path: &Path) -> Result<Self, StateError> {
        if !path.exists() {
            return Err(StateError::Missing { path: path.into() });
        }
        let connection = connect(path, OpenFlags::SQLITE_OPEN_READ_ONLY, None)?;
        let nothing = || StateError::Foreign {
            path: path.into(),
            what: "it is empty".into(),
        };
        if examine(&connection, path)? {
            return Err(nothing());
        }
        let axes = axes_of(&connection, path)?.ok_or_else(nothing)?;
        let machine = Rows {
            connection: &connection,
            path,
            axes: &axes,
        }
        .note("machine")?
        .unwrap_or_default();
        Ok(Self {
            connection,
            path: path.into(),
            axes,
            machine,
        })
    }

    /// The axes of the machine, with which vectors of [`Reader::state`] are ordered.
    pub fn axes(&self) -> &Axes {
        &self.axes
    }

    /// The machine's name.
    pub fn machine(&self) -> &str {
        &self.machine
    }

    fn rows(&self) -> Rows<'_> {
        Rows {
            connection: &self.connection,
            path: &self.path,
            axes: &self.axes,
        }
    }

    /// The state, as one instant saw it.
    ///
    /// # Errors
    /// It cannot be read, or is damaged.
    pub fn state(&self) -> Result<PersistentState, StateError> {
        self.rows().state()
    }

    /// The last jobs, the latest first.
    ///
    /// # Errors
    /// As [`Reader::state`].
    pub fn jobs(&self, count: usize) -> Result<Vec<Job>, StateError> {
        self.rows().last_jobs(count)
    }

    /// The last alarms, the latest first.
    ///
    /// # Errors
    /// As [`Reader::state`].
    pub fn alarms(&self, count: usize) -> Result<Vec<Alarm>, StateError> {
        self.rows().last_alarms(count)
    }
}

fn connect(path: &Path, flags: OpenFlags, vfs: Option<&str>) -> Result<Connection, StateError> {
    // A question mark in the name of a folder is no query.
    let flags = flags & !OpenFlags::SQLITE_OPEN_URI;
    let connection = match vfs {
        Some(vfs) => Connection::open_with_flags_and_vfs(path, flags, vfs),
        None => Connection::open_with_flags(path, flags),
    };
    let cannot = |error: rusqlite::Error| StateError::Open {
        path: path.into(),
        why: error.to_string(),
    };
    let connection = connection.map_err(cannot)?;
    connection.busy_timeout(BUSY).map_err(cannot)?;
    Ok(connection)
}

/// The right to write, for as long as the file stays open. It lies beside the state: SQLite's own locks of a file are gone
/// when any handle of it is closed.
fn lock(path: &Path) -> Result<File, StateError> {
    let mut name = path.as_os_str().to_owned();
    name.push(".lock");
    let cannot = |error: std::io::Error| StateError::Open {
        path: path.into(),
        why: error.to_string(),
    };
    let file = File::options()
        .create(true)
        .truncate(false)
        .write(true)
        .open(PathBuf::from(name))
        .map_err(cannot)?;
    match file.try_lock() {
        Ok(()) => Ok(file),
        Err(std::fs::TryLockError::WouldBlock) => Err(StateError::InUse { path: path.into() }),
        Err(std::fs::TryLockError::Error(error)) => Err(cannot(error)),
    }
}

/// SQLite makes the names of its journals safe, that of a new file only together with them.
fn sync_folder(path: &Path) -> std::io::Result<()> {
    let folder = path
        .parent()
        .filter(|folder| !folder.as_os_str().is_empty())
        .unwrap_or_else(|| Path::new("."));
    File::open(folder)?.sync_all()?;
    // The folder itself may be new.
    folder
        .parent()
        .filter(|above| !above.as_os_str().is_empty())
        .map_or(Ok(()), |above| File::open(above)?.sync_all())
}

/// Offsets of another machine would drive the tool into the table.
fn refuse_other(connection: &Connection, path: &Path, owner: Owner<'_>) -> Result<(), StateError> {
    let other = |what: String| {
        Err(StateError::OtherMachine {
            path: path.into(),
            what,
        })
    };
    // Without a name nobody came further than to make the tables.
    let Some(machine) = (Rows {
        connection,
        path,
        axes: owner.axes,
    })
    .note("machine")?
    else {
        return Ok(());
    };
    if machine != owner.machine {
        return other(format!(
            "it is that of \"{machine}\", and this machine is called \"{}\"",
            owner.machine
        ));
    }
    let known = letters_of(connection, path)?;
    for axis in 0..owner.axes.count() {
        let (letter, rotary) = (owner.axes.letter(axis), owner.axes.is_rotary(axis));
        if known.get(&letter).is_some_and(|known| *known != rotary) {
            let kinds = if rotary {
                ["slides", "turns"]
            } else {
                ["turns", "slides"]
            };
            return other(format!(
                "its axis {letter} {}, that of this machine {}",
                kinds[0], kinds[1]
            ));
        }
    }
    Ok(())
}

fn now_unix_ms() -> i64 {
    let since = SystemTime::now()
        .duration_since(SystemTime::UNIX_EPOCH)
        .unwrap_or_default();
    i64::try_from(since.as_millis()).unwrap_or(i64::MAX)
}

/// Tells those who wait when the writer's thread ends, however it does.
struct Ending<'a>(&'a Shared);

impl Drop for Ending<'_> {
    fn drop(&mut self) {
        self.0.queue().give_up();
    }
}

/// The writer's thread: everything that waits becomes one transaction.
fn write_on(shared: &Shared, mut connection: Connection, axes: &Axes, home: &AxisVector) {
    let _ending = Ending(shared);
    let mut retry = None;
    let mut line = Instant::now();
    loop {
        let mut queue = shared.queue();
        loop {
            let now = Instant::now();
            queue = match queue.due(retry, line, now) {
                Due::Now => break,
                Due::Never => shared
                    .wake
                    .wait(queue)
                    .unwrap_or_else(PoisonError::into_inner),
                Due::At(at) => {
                    shared
                        .wake
                        .wait_timeout(queue, at - now)
                        .unwrap_or_else(PoisonError::into_inner)
                        .0
                }
            };
        }
        let batch = queue.take();
        let closing = queue.closing;
        drop(queue);
        let written = batch
            .write(&mut connection, axes, home)
            .map_err(|error| StateError::writing(&shared.path, &error));
        retry = written.is_err().then(|| Instant::now() + AGAIN_AFTER);
        line = Instant::now() + DRIVEN_EVERY;
        let mut queue = shared.queue();
        queue.trouble = written.clone().err();
        queue.settle(batch, &written);
        if closing {
            return;
        }
    }
}
