//! The fine loop on a thread of its own with absolute deadlines; the rough loop on the caller's.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{SyncSender, sync_channel};
use std::thread;
use std::time::Duration;

use rustix::thread::{ClockId, clock_nanosleep_absolute};
use rustix::time::{Timespec, clock_gettime};
use tandem_fine::FineLoop;
use tandem_machine::FineThread;
use tandem_recorder::PageFaults;
use tandem_rings::{HostEnd, Sizes, sample_ring};

use crate::clock::periods::{Body, PeriodClock, Timing, run};
use crate::clock::realtime::{ProcessGrants, page_faults_of_this_thread, prepare_thread};
use crate::error::HostError;
use crate::plugins::hang::{FineRuns, FineWatch};
use crate::soft::soft_loop::SoftLoop;

const NS_PER_S: i64 = 1_000_000_000;

/// The periods of both loops.
#[derive(Clone, Copy, Debug)]
pub struct Periods {
    /// Rough period, ns.
    pub rough_ns: i64,
    /// Fine period, ns.
    pub fine_ns: i64,
    /// What the fine thread asks of the computer.
    pub fine_thread: FineThread,
}

/// What a body did in real time.
pub struct Ended<B> {
    /// The body.
    pub body: B,
    /// What the clock saw.
    pub timing: Timing,
    /// Page faults from the first deadline to the last period.
    pub page_faults: PageFaults,
}

/// Drives the run to its end in real time; gives the fine loop back.
pub fn drive(
    soft_loop: &mut SoftLoop<'_>,
    mut fine: Box<FineLoop>,
    periods: Periods,
    watch: Option<FineWatch>,
) -> Result<Ended<Box<FineLoop>>, HostError> {
    give_room(&mut soft_loop.host, &mut fine);
    fill_first(soft_loop);
    let body = FineBody { fine, watch };
    let thread = TimedThread::start(body, periods.fine_ns, periods.fine_thread)?;
    for note in &thread.notes {
        soft_loop.note(note);
    }
    while !thread.is_over() {
        soft_loop.step();
        soft_loop.drain();
        soft_loop.serve_stop();
        thread::sleep(Duration::from_nanos(periods.rough_ns.unsigned_abs()));
    }
    let timed = thread.join()?;
    soft_loop.drain();
    soft_loop.take_rests();
    Ok(Ended {
        body: timed.body.fine,
        timing: timed.timing,
        page_faults: timed.page_faults,
    })
}

/// Samples of a loop that has not begun get room for a recorder that looks away for seconds, as it may in real time.
pub fn give_room(host: &mut HostEnd, fine: &mut FineLoop) {
    let (to_host, from_fine) = sample_ring(Sizes::default().samples);
    fine.hand_out_through(to_host);
    host.samples = from_fine;
}

/// Fills the queue before the first fine period, so that its first tick is the first tick on either clock.
fn fill_first(soft_loop: &mut SoftLoop<'_>) {
    soft_loop.step();
}

/// The fine loop as the body of its thread.
pub struct FineBody {
    pub fine: Box<FineLoop>,
    /// Who looks whether it comes back.
    pub watch: Option<FineWatch>,
}

impl Body for FineBody {
    fn is_over(&self) -> bool {
        self.fine.is_over()
    }

    fn begin(&self) -> Option<FineRuns> {
        self.watch.as_ref().map(FineWatch::begin)
    }

    fn period(&mut self) {
        self.fine.tick();
        tandem_sdk::abi::beat();
    }

    fn phase_ns(&self) -> Option<i64> {
        self.fine.phase_ns()
    }

    fn missed(&mut self, periods: u64, in_a_row: u64) {
        self.fine.missed(periods, in_a_row);
    }
}

/// A thread that calls its body once a period, with everything that the computer grants.
pub struct TimedThread<B> {
    /// What was not granted, in words.
    pub notes: Vec<String>,
    over: Arc<AtomicBool>,
    handle: thread::JoinHandle<Ended<B>>,
    /// Until the thread has ended.
    _grants: ProcessGrants,
}

impl<B: Body + Send + 'static> TimedThread<B> {
    /// Starts the thread; it is prepared, and its first deadline one period away, when this returns.
    pub fn start(body: B, period_ns: i64, asks: FineThread) -> Result<Self, HostError> {
        let mut notes = vec![];
        let grants = ProcessGrants::acquire(&mut notes);
        let over = Arc::new(AtomicBool::new(false));
        let at_end = Arc::clone(&over);
        let (sender, receiver) = sync_channel(1);
        let work = move || {
            // Also where the body panics: who waits for the end finds out by joining.
            let _end = AtEnd(at_end);
            live(body, period_ns, asks, &sender)
        };
        let builder = thread::Builder::new().name("tandem-fine".to_string());
        let handle = builder.spawn(work);
        let handle = handle
            .map_err(|e| HostError::System(format!("the fine thread cannot be started: {e}")))?;
        notes.extend(receiver.recv().unwrap_or_default());
        Ok(Self {
            notes,
            over,
            handle,
            _grants: grants,
        })
    }

    /// Whether the last period is over.
    pub fn is_over(&self) -> bool {
        self.over.load(Ordering::Acquire)
    }

    /// Waits for the last period.
    pub fn join(self) -> Result<Ended<B>, HostError> {
        self.handle
            .join()
            .map_err(|_| HostError::System("the fine loop panicked".to_string()))
    }
}

struct AtEnd(Arc<AtomicBool>);

impl Drop for AtEnd {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Release);
    }
}

/// The life of the thread. What allocates lies before and after [`run`].
fn live<B: Body>(
    mut body: B,
    period_ns: i64,
    asks: FineThread,
    notes: &SyncSender<Vec<String>>,
) -> Ended<B> {
    let mut not_granted = vec![];
    prepare_thread(asks, &mut not_granted);
    let mut timing = Timing::default();
    // Nobody listens only where the host is gone.
    let _ = notes.send(not_granted);
    let mut clock = Monotonic;
    // The first reading maps the kernel's page of clock data: no lock on memory covers it.
    clock.now_ns();
    let runs = body.begin();
    let before = page_faults_of_this_thread();
    run(&mut clock, period_ns, &mut body, &mut timing);
    drop(runs);
    let page_faults = page_faults_of_this_thread().since(before);
    Ended {
        body,
        timing,
        page_faults,
    }
}

/// The computer's monotonic clock.
struct Monotonic;

impl PeriodClock for Monotonic {
    fn now_ns(&mut self) -> i64 {
        now_ns()
    }

    fn sleep_until(&mut self, deadline_ns: i64) {
        let deadline = Timespec {
            tv_sec: deadline_ns / NS_PER_S,
            tv_nsec: deadline_ns % NS_PER_S,
        };
        // A signal ends the sleep early: then the rest of it follows.
        while clock_nanosleep_absolute(ClockId::Monotonic, &deadline).is_err() {}
    }
}

/// The computer's monotonic clock, ns. Any thread; does not allocate.
pub fn now_ns() -> i64 {
    let now = clock_gettime(ClockId::Monotonic);
    now.tv_sec * NS_PER_S + now.tv_nsec
}
