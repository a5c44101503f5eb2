//! `ethercrab` in this process and on virtual time, in front of an emulated bus.

use std::cell::{Cell, RefCell};
use std::future::Future;
use std::pin::pin;
use std::task::{Context, Poll, Waker};
use std::time::Duration;

use embassy_time_driver::Driver;
use ethercrab::{MainDevice, MainDeviceConfig, PduRx, PduStorage, PduTx, Timeouts};
use tandem_ethercat_emulator::{BusDescription, MAX_FRAME, Wire};

/// Most devices and bytes of process data of a master in tests.
pub const MAX_DEVICES: usize = 32;
pub const MAX_BYTES: usize = 512;

/// Time that passes where nothing is on its way, in ns.
const IDLE_NS: u64 = 10_000;
/// A test that takes longer, in virtual time, has come to a stop.
const MAX_NS: u64 = 120_000_000_000;

thread_local! {
    static NOW_NS: Cell<u64> = const { Cell::new(0) };
}

struct VirtualTime;

impl Driver for VirtualTime {
    fn now(&self) -> u64 {
        NOW_NS.get() / 1000
    }

    /// Everything is polled in every step, so nobody has to be woken.
    fn schedule_wake(&self, _at: u64, _waker: &Waker) {}
}

embassy_time_driver::time_driver_impl!(static TIME: VirtualTime = VirtualTime);

/// The emulator's time, in ns.
pub fn now_ns() -> u64 {
    NOW_NS.get()
}

/// A master's end of an emulated bus.
pub struct Rig {
    pub wire: RefCell<Wire>,
    tx: RefCell<PduTx<'static>>,
    rx: RefCell<PduRx<'static>>,
}

impl Rig {
    /// A bus by its description, power on at time 0, and a master in front of it.
    pub fn new(description: &BusDescription) -> (Self, MainDevice<'static>) {
        NOW_NS.set(0);
        let storage: &'static PduStorage<16, { PduStorage::element_size(1100) }> =
            Box::leak(Box::new(PduStorage::new()));
        let (tx, rx, pdu_loop) = storage.try_split().unwrap();
        let config = MainDeviceConfig {
            dc_static_sync_iterations: 1000,
            ..MainDeviceConfig::default()
        };
        let timeouts = Timeouts {
            wait_loop_delay: Duration::from_micros(100),
            ..Timeouts::default()
        };
        let master = MainDevice::new(pdu_loop, timeouts, config);
        let wire = RefCell::new(Wire::new(description).unwrap());
        (
            Self {
                wire,
                tx: RefCell::new(tx),
                rx: RefCell::new(rx),
            },
            master,
        )
    }

    /// A bus by the text of its description.
    pub fn of(toml: &str) -> (Self, MainDevice<'static>) {
        Self::new(&BusDescription::from_toml(toml).unwrap())
    }

    /// Drives a master's future, frames and time until the future is done.
    pub fn run<F: Future>(&self, future: F) -> F::Output {
        let mut future = pin!(future);
        let mut context = Context::from_waker(Waker::noop());
        loop {
            if let Poll::Ready(output) = future.as_mut().poll(&mut context) {
                return output;
            }
            self.send();
            self.step();
            assert!(
                now_ns() < MAX_NS,
                "the master waits for something that does not come"
            );
        }
    }

    fn send(&self) {
        let mut wire = self.wire.borrow_mut();
        while let Some(frame) = self.tx.borrow_mut().next_sendable_frame() {
            let sent = frame.send_blocking(|bytes| {
                wire.send(now_ns(), bytes);
                Ok(bytes.len())
            });
            sent.unwrap();
        }
    }

    /// Time goes on to the next reply, or a little.
    fn step(&self) {
        let mut wire = self.wire.borrow_mut();
        let next = now_ns() + IDLE_NS;
        NOW_NS.set(
            wire.next_reply_ns()
                .map_or(next, |due_ns| due_ns.clamp(now_ns(), next)),
        );
        let mut reply = [0; MAX_FRAME];
        while let Some(length) = wire.receive(now_ns(), &mut reply) {
            // A reply that the master does not want is its own matter.
            let _ = self.rx.borrow_mut().receive_frame(&reply[..length]);
        }
    }

    /// Waits until a time.
    pub async fn until(&self, at_ns: u64) {
        std::future::poll_fn(|_| {
            if now_ns() >= at_ns {
                Poll::Ready(())
            } else {
                Poll::Pending
            }
        })
        .await;
    }

    /// Lets time pass without a master.
    pub fn silence(&self, ms: u64) {
        NOW_NS.set(now_ns() + ms * 1_000_000);
        self.wire.borrow_mut().advance(now_ns());
    }
}
