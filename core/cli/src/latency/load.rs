//! Busy cores, for a measurement under load.

use std::hint::black_box;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;

/// Memory that each busy thread walks through, to keep the caches busy as well, bytes.
const WALK_BYTES: usize = 4 * 1024 * 1024;

/// Busy threads of ordinary priority, one a core, until this is dropped.
pub struct Load {
    over: Arc<AtomicBool>,
    threads: Vec<thread::JoinHandle<()>>,
}

impl Load {
    /// Starts the threads.
    pub fn start() -> Self {
        let over = Arc::new(AtomicBool::new(false));
        let cores = thread::available_parallelism().map_or(1, usize::from);
        let busy = |_| {
            let over = Arc::clone(&over);
            thread::spawn(move || be_busy(&over))
        };
        let threads = (0..cores).map(busy).collect();
        Self { over, threads }
    }
}

impl Drop for Load {
    fn drop(&mut self) {
        self.over.store(true, Ordering::Relaxed);
        for thread in self.threads.drain(..) {
            // What a busy thread computed does not matter, nor how it ended.
            let _ = thread.join();
        }
    }
}

fn be_busy(over: &AtomicBool) {
    let mut memory = vec![1_u64; WALK_BYTES / size_of::<u64>()];
    while !over.load(Ordering::Relaxed) {
        for word in &mut memory {
            *word = word.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        }
        black_box(&mut memory);
    }
}
