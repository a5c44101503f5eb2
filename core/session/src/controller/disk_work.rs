//! What of a client's requests waits for a disk: a thread of its own waits for it, and nobody else does.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;

use super::arrivals::wait_while;
use super::dispatcher::Dispatcher;

/// Stack of a thread, bytes: it is locked into memory with the rest.
const STACK_BYTES: usize = 512 * 1024;

/// Work for one client that waits for a disk.
pub struct DiskWork {
    dispatcher: Arc<Dispatcher>,
    busy: Arc<AtomicUsize>,
}

impl DiskWork {
    pub fn new(dispatcher: Arc<Dispatcher>) -> Self {
        Self {
            dispatcher,
            busy: Arc::default(),
        }
    }

    /// Whether it is at work.
    pub fn is_busy(&self) -> bool {
        self.busy.load(Ordering::Acquire) > 0
    }

    /// Has `work` done; when it is over, whoever serves clients is woken. `false` where the computer has no thread for it.
    #[must_use]
    pub fn give(&self, work: impl FnOnce(&Dispatcher) + Send + 'static) -> bool {
        let dispatcher = Arc::clone(&self.dispatcher);
        let busy = Arc::clone(&self.busy);
        let disk_threads = Arc::clone(&dispatcher.disk_threads);
        busy.fetch_add(1, Ordering::AcqRel);
        disk_threads.fetch_add(1, Ordering::AcqRel);
        let at_work = Arc::clone(&disk_threads);
        let builder = thread::Builder::new()
            .name("tandem-disk".to_string())
            .stack_size(STACK_BYTES);
        let begun = builder.spawn(move || {
            // Its client is told by the work itself; a defect costs nobody else anything.
            let _ = catch_unwind(AssertUnwindSafe(|| work(&dispatcher)));
            busy.fetch_sub(1, Ordering::AcqRel);
            dispatcher.ring();
            drop(dispatcher);
            disk_threads.fetch_sub(1, Ordering::AcqRel);
        });
        if begun.is_err() {
            at_work.fetch_sub(1, Ordering::AcqRel);
            self.busy.fetch_sub(1, Ordering::AcqRel);
        }
        begun.is_ok()
    }
}

/// Waits for all that are at work, as long as the end of a controller may: a disk that hangs does not keep it from ending.
pub fn wait_for_all(dispatcher: &Dispatcher) {
    wait_while(|| dispatcher.disk_threads.load(Ordering::Acquire) > 0);
}
