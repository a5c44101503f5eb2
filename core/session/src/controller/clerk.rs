//! What of a client's requests waits for a disk: a thread of its own waits for it, and nobody else does.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use super::desk::Desk;

/// Stack of a thread, bytes: it is locked into memory with the rest.
const STACK_BYTES: usize = 512 * 1024;
/// How long the end of the controller waits for disks.
const PATIENCE: Duration = Duration::from_secs(2);

/// Does one thing after the other for a client.
pub struct Clerk {
    desk: Arc<Desk>,
    busy: Arc<AtomicUsize>,
}

impl Clerk {
    pub fn new(desk: Arc<Desk>) -> Self {
        Self {
            desk,
            busy: Arc::default(),
        }
    }

    /// Whether it is at work.
    pub fn is_busy(&self) -> bool {
        self.busy.load(Ordering::Acquire) > 0
    }

    /// Has `work` done; when it is over, whoever serves clients is woken. `false` where the computer has no thread for it.
    #[must_use]
    pub fn give(&self, work: impl FnOnce(&Desk) + Send + 'static) -> bool {
        let (desk, busy) = (Arc::clone(&self.desk), Arc::clone(&self.busy));
        let clerks = Arc::clone(&desk.clerks);
        busy.fetch_add(1, Ordering::AcqRel);
        clerks.fetch_add(1, Ordering::AcqRel);
        let at_work = Arc::clone(&clerks);
        let builder = thread::Builder::new()
            .name("tandem-disk".to_string())
            .stack_size(STACK_BYTES);
        let begun = builder.spawn(move || {
            // Its client is told by the work itself; a defect costs nobody else anything.
            let _ = catch_unwind(AssertUnwindSafe(|| work(&desk)));
            busy.fetch_sub(1, Ordering::AcqRel);
            desk.ring();
            drop(desk);
            clerks.fetch_sub(1, Ordering::AcqRel);
        });
        if begun.is_err() {
            at_work.fetch_sub(1, Ordering::AcqRel);
            self.busy.fetch_sub(1, Ordering::AcqRel);
        }
        begun.is_ok()
    }
}

/// Waits for all that are at work, as long as the end of a controller may: a disk that hangs does not keep it from ending.
pub fn wait_for_all(desk: &Desk) {
    wait_while(|| desk.clerks.load(Ordering::Acquire) > 0);
}

/// Waits while a disk `takes` its time, as long as the end of a controller may.
pub fn wait_while(takes: impl Fn() -> bool) {
    let began = Instant::now();
    while takes() && began.elapsed() < PATIENCE {
        thread::sleep(Duration::from_millis(1));
    }
}
