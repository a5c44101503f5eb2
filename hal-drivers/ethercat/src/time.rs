//! The time that `ethercrab` measures its timeouts in: that of the bus which the calling thread drives, virtual or real.

use std::cell::Cell;
use std::task::{Poll, Waker};

use embassy_time_driver::Driver;

thread_local! {
    static NOW_NS: Cell<u64> = const { Cell::new(0) };
}

struct BusTime;

impl Driver for BusTime {
    fn now(&self) -> u64 {
        NOW_NS.get() / 1000
    }

    /// Everything is polled in every step, so nobody has to be woken.
    fn schedule_wake(&self, _at: u64, _waker: &Waker) {}
}

embassy_time_driver::time_driver_impl!(static TIME: BusTime = BusTime);

/// From here on it is `now_ns` for this thread.
pub(crate) fn set(now_ns: u64) {
    NOW_NS.set(now_ns);
}

/// Time of the bus that this thread drives, in ns.
pub(crate) fn now_ns() -> u64 {
    NOW_NS.get()
}

/// Waits for so long.
pub(crate) async fn pass(ns: u64) {
    let at_ns = now_ns() + ns;
    std::future::poll_fn(|_| {
        if now_ns() >= at_ns {
            Poll::Ready(())
        } else {
            Poll::Pending
        }
    })
    .await;
}
