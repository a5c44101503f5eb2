//! `ethercrab` without a task of its own: what it wants to send is sent, and what comes back is handed to it, by whoever waits
//! for one of its futures.

use std::pin::pin;
use std::sync::{Arc, Mutex, PoisonError};
use std::task::{Context, Poll, Waker};
use std::time::Duration;

use ethercrab::{MainDevice, MainDeviceConfig, PduRx, PduStorage, PduTx, RetryBehaviour, Timeouts};
use tandem_ethercat_emulator::MAX_FRAME;

use crate::bus::Bus;
use crate::link::Link;
use crate::time;

/// How long nobody looks where nothing is on its way, ns: what waits loop by loop costs so much virtual time.
const STEP_NS: u64 = 20_000;

/// Frames by which clocks are brought to one time at the start, with distributed clocks.
const STATIC_SYNC_FRAMES: u32 = 5_000;

/// Largest data of one of its frames.
const FRAME_BYTES: usize = PduStorage::element_size(1100);

/// `ethercrab`, and both ends of what goes through it.
pub(crate) struct Master {
    pub(crate) main: Arc<MainDevice<'static>>,
    ports: Ports,
    clocks: bool,
}

/// What it wants to send, and where what comes back is handed in.
struct Ports {
    tx: PduTx<'static>,
    rx: PduRx<'static>,
}

/// Masters that nobody uses. Their memory lives as long as the process, because `ethercrab` wants it so; a driver that is made
/// after another one is gone takes what that one had.
static UNUSED: Mutex<Vec<Master>> = Mutex::new(Vec::new());

impl Master {
    /// One that nobody uses; `clocks` where it is to bring the devices' clocks together.
    pub(crate) fn take(clocks: bool) -> Option<Self> {
        let mut unused = UNUSED.lock().unwrap_or_else(PoisonError::into_inner);
        match unused.iter().position(|master| master.clocks == clocks) {
            Some(index) => Some(unused.swap_remove(index)),
            None => Self::new(clocks),
        }
    }

    fn new(clocks: bool) -> Option<Self> {
        let storage: &'static PduStorage<16, FRAME_BYTES> = Box::leak(Box::new(PduStorage::new()));
        let (tx, rx, pdu_loop) = storage.try_split().ok()?;
        let timeouts = Timeouts {
            wait_loop_delay: Duration::from_micros(100),
            // A computer without real-time scheduling may keep a process waiting for so long.
            pdu: Duration::from_millis(100),
            eeprom: Duration::from_millis(500),
            // Longer than a frame that is lost and sent again takes.
            mailbox_echo: Duration::from_millis(500),
            mailbox_response: Duration::from_secs(1),
            ..Timeouts::default()
        };
        let config = MainDeviceConfig {
            dc_static_sync_iterations: if clocks { STATIC_SYNC_FRAMES } else { 0 },
            retry_behaviour: RetryBehaviour::Count(3),
        };
        Some(Self {
            main: Arc::new(MainDevice::new(pdu_loop, timeouts, config)),
            ports: Ports { tx, rx },
            clocks,
        })
    }

    /// Gives it to whoever comes next.
    pub(crate) fn give_back(self) {
        UNUSED
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .push(self);
    }

    /// Runs what `job` makes of the main device to its end.
    pub(crate) fn run<'a, F: Future>(
        &'a mut self,
        link: &mut Link,
        job: impl FnOnce(&'a MainDevice<'static>) -> F,
    ) -> F::Output {
        let Self { main, ports, .. } = self;
        time::set(link.now_ns());
        let mut future = pin!(job(main));
        let mut context = Context::from_waker(Waker::noop());
        loop {
            time::set(link.now_ns());
            if let Poll::Ready(output) = future.as_mut().poll(&mut context) {
                return output;
            }
            ports.turn(link, u64::MAX);
        }
    }

    /// Sends what a future wants to be sent, and takes in what comes within a step, or until then.
    pub(crate) fn turn(&mut self, link: &mut Link, until_ns: u64) {
        self.ports.turn(link, until_ns);
    }

    /// Runs what `job` makes of the main device to its end, in the time that the exchanges of a bus leave.
    pub(crate) fn run_beside<'a, F: Future>(
        &'a mut self,
        bus: &mut Bus,
        job: impl FnOnce(&'a MainDevice<'static>) -> F,
    ) -> F::Output {
        let Self { main, ports, .. } = self;
        time::set(bus.link_mut().now_ns());
        let mut future = pin!(job(main));
        let mut context = Context::from_waker(Waker::noop());
        loop {
            time::set(bus.link_mut().now_ns());
            if let Poll::Ready(output) = future.as_mut().poll(&mut context) {
                return output;
            }
            match bus.gap_ends_ns() {
                Some(until_ns) => ports.turn(bus.link_mut(), until_ns),
                None => bus.turn(),
            }
        }
    }
}

impl Ports {
    /// Sends what waits, and takes in what comes within a step, or until then.
    fn turn(&mut self, link: &mut Link, until_ns: u64) {
        while let Some(frame) = self.tx.next_sendable_frame() {
            // A frame that cannot be sent is one that is not answered.
            let _ = frame.send_blocking(|bytes| {
                link.send(bytes);
                Ok(bytes.len())
            });
        }
        let mut reply = [0; MAX_FRAME];
        let until_ns = until_ns.min(link.now_ns() + STEP_NS);
        if let Some(length) = link.receive(until_ns, &mut reply) {
            // What it does not know is its own matter: a reply that comes too late, or is another master's.
            let _ = self.rx.receive_frame(&reply[..length]);
        } else {
            link.wait_until(until_ns);
        }
    }
}
