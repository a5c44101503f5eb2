//! The log that plugins write to, from any loop: a ring of records, made beforehand and drained on the soft side.

use std::sync::OnceLock;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

use crossbeam_queue::ArrayQueue;
use tandem_sdk::log::{HostTable, LogRecord};

/// Records that have room between two looks at the log.
const RECORDS: usize = 1024;

static RING: OnceLock<ArrayQueue<LogRecord>> = OnceLock::new();
static LOST: AtomicU64 = AtomicU64::new(0);
static TABLE: HostTable = HostTable::new(take);

/// Makes the ring, and makes it the log of the plugins that are linked in. Host, before the loops.
pub fn listen() {
    RING.get_or_init(|| ArrayQueue::new(RECORDS));
    tandem_sdk::log::attach(&TABLE);
}

/// What loaded plugins get.
pub fn table() -> &'static HostTable {
    listen();
    &TABLE
}

/// Takes a record: any thread, the fine loop's included. Does not allocate, lock or wait; without room the record is
/// lost, and counted.
unsafe extern "C" fn take(record: *const LogRecord) {
    // SAFETY: the plugin's side hands over a record that lives for the call.
    let record = unsafe { *record };
    if RING.get().is_none_or(|ring| ring.push(record).is_err()) {
        LOST.fetch_add(1, Relaxed);
    }
}

/// Hands what plugins have written since the last call to `each`, as lines. Soft side.
pub fn drain_plugin_log(each: &mut dyn FnMut(&str)) {
    let Some(ring) = RING.get() else { return };
    while let Some(record) = ring.pop() {
        let level = match record.level() {
            tandem_sdk::log::LogLevel::Info => "",
            tandem_sdk::log::LogLevel::Warning => "warning: ",
            tandem_sdk::log::LogLevel::Error => "error: ",
        };
        each(&format!("{}: {level}{}", record.source(), record.text()));
    }
    let lost = LOST.swap(0, Relaxed);
    if lost > 0 {
        each(&format!(
            "plugins wrote {lost} lines more than the log has room for"
        ));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::counting_allocator::{HeapUse, heap_use_of};

    #[test]
    fn a_line_for_the_log_takes_no_memory() {
        listen();
        let used = heap_use_of(|| {
            for joint in 0..20 {
                tandem_sdk::log!(
                    Warning,
                    "joint {joint}: {} frames lost, the last one {:.3} s ago",
                    3 * joint,
                    0.25
                );
            }
        });
        assert_eq!(used, HeapUse::default());
    }

    #[test]
    fn lines_come_in_order_and_what_is_lost_is_counted() {
        listen();
        for index in 0..RECORDS + 5 {
            tandem_sdk::log!(Warning, "line {index}");
        }
        let mut lines = vec![];
        drain_plugin_log(&mut |line| lines.push(line.to_string()));
        // Tests of this crate that run beside this one share the log.
        assert!(
            lines.contains(&"tandem-host: warning: line 7".to_string()),
            "{lines:?}"
        );
        assert!(
            lines
                .last()
                .is_some_and(|last| last.contains("more than the log has room for")),
            "{lines:?}"
        );
    }
}
