//! What Linux grants to a thread with deadlines: each best-effort, with a note on what was not granted.
#![allow(
    unsafe_code,
    reason = "priority and page faults of a thread have no safe binding"
)]

use std::fs::File;
use std::hint::black_box;
use std::io::Write;
use std::num::NonZeroU64;

use rustix::mm::{MlockAllFlags, mlockall, munlockall};
use rustix::process::{Resource, getrlimit};
use rustix::thread::{
    CapabilitySet, CpuSet, capabilities, sched_getaffinity, sched_setaffinity,
    set_current_timer_slack,
};
use tandem_machine::FineThread;
use tandem_recorder::PageFaults;

/// Where Linux takes the longest wake-up time that is bearable.
const WAKE_UP_TIME: &str = "/dev/cpu_dma_latency";
/// Stack of the fine thread that is touched before the first period, bytes.
const STACK_BYTES: usize = 64 * 1024;

/// What holds for the whole process while this lives: memory stays locked, cores stay out of deep sleep.
#[derive(Debug)]
pub struct ProcessGrants {
    _memory: MemoryLock,
    _awake: Option<File>,
}

impl ProcessGrants {
    /// Asks for everything. Host, before the fine thread starts.
    pub fn acquire(notes: &mut Vec<String>) -> Self {
        Self {
            _memory: MemoryLock::acquire(notes),
            _awake: stay_awake(notes),
        }
    }
}

/// Keeps the cores out of the sleeps that they are slow to wake from, while the file is open.
fn stay_awake(notes: &mut Vec<String>) -> Option<File> {
    let file = File::options().write(true).open(WAKE_UP_TIME);
    // The kernel reads an i32: the wake-up time that is bearable, us.
    let asked = file.and_then(|mut file| file.write_all(&0_i32.to_ne_bytes()).map(|()| file));
    asked
        .map_err(|e| {
            notes.push(format!(
                "{WAKE_UP_TIME} ({e}): an idle core may be slow to wake"
            ));
        })
        .ok()
}

/// Memory stays locked while this lives.
#[derive(Debug)]
struct MemoryLock {
    locked: bool,
}

impl MemoryLock {
    /// Locks what is mapped, and what will be.
    fn acquire(notes: &mut Vec<String>) -> Self {
        if !may_lock_all() {
            notes.push(
                "memory is not locked (the limit on locked memory is finite): a page may fault in the fine loop; \
                 `ulimit -l unlimited` or CAP_IPC_LOCK grants it"
                    .to_string(),
            );
            return Self { locked: false };
        }
        let result = mlockall(MlockAllFlags::CURRENT | MlockAllFlags::FUTURE);
        if let Err(error) = result {
            notes.push(format!(
                "memory is not locked ({error}): a page may fault in the fine loop"
            ));
        }
        Self {
            locked: result.is_ok(),
        }
    }
}

impl Drop for MemoryLock {
    fn drop(&mut self) {
        if self.locked {
            // It was granted; should giving it back fail, the process only keeps more memory resident.
            let _ = munlockall();
        }
    }
}

/// Under a finite limit a lock on future memory turns a later allocation, anywhere in the process, into a failure.
fn may_lock_all() -> bool {
    let limit = getrlimit(Resource::Memlock).current;
    limit.is_none()
        || capabilities(None).is_ok_and(|sets| sets.effective.contains(CapabilitySet::IPC_LOCK))
}

/// Makes the calling thread one with deadlines. Fine thread, before its first period; may allocate.
pub fn prepare_thread(thread: FineThread, notes: &mut Vec<String>) {
    let priority = thread.priority;
    // Threads without a real-time priority are woken up to 50 µs late on purpose; this asks for 1 ns.
    let _ = set_current_timer_slack(NonZeroU64::new(1));
    match set_priority(priority) {
        Ok(()) => pin(thread.core, notes),
        Err(error) => notes.push(format!(
            "SCHED_FIFO priority {priority} is not granted ({error}): the fine loop shares the processor with every \
             other program, and is not pinned to a core either; `ulimit -r {priority}` or CAP_SYS_NICE grants it"
        )),
    }
    touch_stack();
}

fn set_priority(priority: u32) -> Result<(), std::io::Error> {
    let parameters = libc::sched_param {
        sched_priority: priority.cast_signed(),
    };
    // SAFETY: the handle is the calling thread's, the parameters outlive the call.
    let status = unsafe {
        libc::pthread_setschedparam(
            libc::pthread_self(),
            libc::SCHED_FIFO,
            &raw const parameters,
        )
    };
    if status == 0 {
        Ok(())
    } else {
        Err(std::io::Error::from_raw_os_error(status))
    }
}

/// To `core`, or else to the last core that the process may use: the first one gets most interrupts. Only with a
/// priority: an ordinary thread that may not move waits for whatever else runs on its core.
fn pin(core: Option<u32>, notes: &mut Vec<String>) {
    let result = sched_getaffinity(None).and_then(|allowed| {
        let last = || (0..CpuSet::MAX_CPU).rfind(|core| allowed.is_set(*core));
        let Some(chosen) = core.map(|core| core as usize).or_else(last) else {
            return Ok(());
        };
        let mut only = CpuSet::new();
        only.set(chosen);
        sched_setaffinity(None, &only)
    });
    if let Err(error) = result {
        let which = core.map_or("a core".to_string(), |core| format!("core {core}"));
        notes.push(format!(
            "the fine loop is not pinned to {which} ({error}): it may be moved while it runs"
        ));
    }
}

/// Touches the stack that the periods will use, so that none of it faults later.
#[inline(never)]
#[allow(clippy::large_stack_arrays)] // that it lies on the stack is the point
fn touch_stack() {
    let mut stack = [0_u8; STACK_BYTES];
    for byte in stack.iter_mut().step_by(1024) {
        *byte = 1;
    }
    black_box(&stack);
}

/// Page faults of the calling thread until now. Fine thread, before and after the periods; does not allocate.
pub fn page_faults_of_this_thread() -> PageFaults {
    // SAFETY: the structure holds numbers only, for which all zeros is a value.
    let mut usage: libc::rusage = unsafe { std::mem::zeroed() };
    // SAFETY: the pointer is to a structure of the right type that outlives the call.
    let status = unsafe { libc::getrusage(libc::RUSAGE_THREAD, &raw mut usage) };
    debug_assert_eq!(status, 0, "the arguments are constants that Linux knows");
    PageFaults {
        major: usage.ru_majflt.unsigned_abs(),
        minor: usage.ru_minflt.unsigned_abs(),
    }
}
