//! Who calls the fine loop of a machine that stays: lockstep, or a thread of its own that lives through all jobs.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use rtrb::{Consumer, Producer, RingBuffer};
use tandem_fine::{FineLoop, JobEnd};
use tandem_sdk::abi::{Method, beat, calling};

use crate::clock::periods::Body;
use crate::clock::wall_clock::{Periods, TimedThread};
use crate::error::HostError;
use crate::plugins::hang::{FineRuns, FineWatch};

/// Loops on their way to the thread, and back: one of each, and one that nobody has fetched yet.
const IN_FLIGHT: usize = 4;

/// The fine loop, and who calls it.
pub enum Engine {
    /// Lockstep: whoever drives a job calls it.
    Here(Box<FineLoop>),
    /// A thread calls it once a fine period.
    Thread(Thread),
    /// A fault has ended its thread; or it is between two owners.
    Down(Option<Box<FineLoop>>),
}

/// The host's end of the thread.
pub struct Thread {
    timed: TimedThread<Resident>,
    next: Producer<Next>,
    retired: Consumer<Box<FineLoop>>,
    ends: Consumer<JobEnd>,
    shared: Arc<Shared>,
}

/// What both sides of the thread look at.
#[derive(Default)]
struct Shared {
    /// No further period is wanted.
    over: AtomicBool,
    /// The drives have let go.
    released: AtomicBool,
    /// Fine periods since the thread began.
    periods: AtomicU64,
}

/// A loop that is to take over, and whether it resets the drives' faults.
struct Next {
    fine: Box<FineLoop>,
    resets: bool,
}

/// The thread's body: the loop of the job, and after its end the same loop until the next one comes.
pub struct Resident {
    fine: Box<FineLoop>,
    next: Consumer<Next>,
    retired: Producer<Box<FineLoop>>,
    ends: Producer<JobEnd>,
    told: bool,
    shared: Arc<Shared>,
    watch: Option<FineWatch>,
}

impl Body for Resident {
    fn is_over(&self) -> bool {
        self.shared.over.load(Ordering::Acquire)
            || (self.fine.fault().is_some() && self.fine.is_over())
    }

    fn begin(&self) -> Option<FineRuns> {
        self.watch.as_ref().map(FineWatch::begin)
    }

    fn period(&mut self) {
        if !self.retired.is_full()
            && let Ok(Next { mut fine, resets }) = self.next.pop()
        {
            fine.succeed(&mut self.fine, resets);
            std::mem::swap(&mut fine, &mut self.fine);
            // There was room above, and nobody else fills it.
            let _ = self.retired.push(fine);
            self.told = false;
        }
        self.fine.tick();
        beat();
        if !self.told && self.fine.has_ended() {
            self.told = self.ends.push(self.fine.job_end()).is_ok();
        }
        self.shared
            .released
            .store(self.fine.is_over(), Ordering::Release);
        self.shared.periods.fetch_add(1, Ordering::Relaxed);
    }

    fn phase_ns(&self) -> Option<i64> {
        self.fine.phase_ns()
    }

    fn missed(&mut self, periods: u64, in_a_row: u64) {
        self.fine.missed(periods, in_a_row);
    }
}

impl Engine {
    /// A thread that calls `fine`, whose end as a job has been told or not. What the computer does not grant is said in words.
    ///
    /// # Errors
    /// There is no thread.
    pub fn start(
        fine: Box<FineLoop>,
        told: bool,
        periods: Periods,
        watch: Option<FineWatch>,
    ) -> Result<(Self, Vec<String>), HostError> {
        let shared = Arc::new(Shared::default());
        let (next, next_out) = RingBuffer::new(IN_FLIGHT);
        let (retired_in, retired) = RingBuffer::new(IN_FLIGHT);
        let (ends_in, ends) = RingBuffer::new(IN_FLIGHT);
        let body = Resident {
            fine,
            next: next_out,
            retired: retired_in,
            ends: ends_in,
            told,
            shared: Arc::clone(&shared),
            watch,
        };
        let mut timed = TimedThread::start(body, periods.fine_ns, periods.fine_thread)?;
        let notes = std::mem::take(&mut timed.notes);
        Ok((
            Self::Thread(Thread {
                timed,
                next,
                retired,
                ends,
                shared,
            }),
            notes,
        ))
    }

    /// Has `fine` take over from the loop that is there, which rests. With `resets` the drives' faults are reset before they are
    /// enabled. Host.
    ///
    /// # Errors
    /// The loop that is there is gone: its thread panicked.
    pub fn hand_over(&mut self, mut fine: Box<FineLoop>, resets: bool) -> Result<(), HostError> {
        match self {
            Self::Thread(thread) => {
                while thread.retired.pop().is_ok() {}
                while thread.ends.pop().is_ok() {}
                thread.shared.released.store(false, Ordering::Release);
                let sent = thread.next.push(Next { fine, resets });
                sent.map_err(|_| {
                    HostError::System("the fine loop takes no further job".to_string())
                })
            }
            Self::Here(last) | Self::Down(Some(last)) => {
                fine.succeed(last, resets);
                *last = fine;
                Ok(())
            }
            Self::Down(None) => Err(HostError::System("the fine loop is gone".to_string())),
        }
    }

    /// One fine period in lockstep; nothing where a thread does it.
    pub fn tick(&mut self) {
        if let Self::Here(fine) = self {
            calling(Method::FinePeriod, || fine.tick());
            beat();
        }
    }

    /// The end of the job, once it is there. Host.
    pub fn take_end(&mut self) -> Option<JobEnd> {
        match self {
            Self::Here(fine) => fine.has_ended().then(|| fine.job_end()),
            Self::Thread(thread) => thread.ends.pop().ok(),
            Self::Down(_) => None,
        }
    }

    /// Whether a fault has brought the machine to rest and the drives have let go: then the loop is fetched. Host.
    ///
    /// # Errors
    /// The fine loop panicked.
    pub fn fetch_faulted(&mut self) -> Result<Option<&FineLoop>, HostError> {
        let is_over = match self {
            Self::Here(fine) => fine.fault().is_some() && fine.is_over(),
            Self::Thread(thread) => thread.timed.is_over(),
            Self::Down(_) => false,
        };
        if !is_over {
            return Ok(None);
        }
        *self = match std::mem::replace(self, Self::Down(None)) {
            Self::Thread(thread) => Self::Down(Some(thread.timed.join()?.body.fine)),
            Self::Here(fine) => Self::Down(Some(fine)),
            down @ Self::Down(_) => down,
        };
        Ok(match self {
            Self::Down(Some(fine)) => Some(fine),
            _ => None,
        })
    }

    /// Whether the joints do not hold yet, in lockstep.
    pub fn is_attaching(&self) -> bool {
        matches!(self, Self::Here(fine) if fine.is_attaching())
    }

    /// Whether the drives have let go. Host.
    pub fn is_released(&self) -> bool {
        match self {
            Self::Here(fine) => fine.is_over(),
            Self::Thread(thread) => thread.shared.released.load(Ordering::Acquire),
            Self::Down(_) => true,
        }
    }

    /// Fine periods since the thread began; 0 in lockstep.
    pub fn periods(&self) -> u64 {
        match self {
            Self::Thread(thread) => thread.shared.periods.load(Ordering::Relaxed),
            _ => 0,
        }
    }

    /// Ends the thread, and gives the loop back. Host.
    ///
    /// # Errors
    /// The fine loop panicked.
    pub fn end(self) -> Result<Option<Box<FineLoop>>, HostError> {
        match self {
            Self::Here(fine) => Ok(Some(fine)),
            Self::Down(fine) => Ok(fine),
            Self::Thread(thread) => {
                thread.shared.over.store(true, Ordering::Release);
                Ok(Some(thread.timed.join()?.body.fine))
            }
        }
    }
}
