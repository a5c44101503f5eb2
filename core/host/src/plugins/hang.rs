//! A thread beside the loops that notices when one of them does not come back.
//!
//! A call of a plugin that never returns cannot be ended: its thread is in foreign code, and everything that the thread was
//! to do, an emergency stop too, waits behind it. What is left is to say so, to keep what was recorded, and to end the
//! process, so that the drives hear nothing any more and stop by their own watchdog.

use std::sync::atomic::AtomicBool;
use std::sync::atomic::Ordering::{Acquire, Relaxed, Release};
use std::sync::{Arc, Condvar, Mutex, OnceLock, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use tandem_machine::{DriverChoice, Machine};
use tandem_rings::{Controls, Status};
use tandem_sdk::PluginKind;
use tandem_sdk::abi::{Method, Watched, Whereabouts, watch_this_thread};

/// What is done about a hang, on the thread that has noticed it: the words say who hangs where. It is expected to end the
/// process.
type AtHang = Arc<dyn Fn(&str) + Send + Sync>;

static AT_HANG: OnceLock<AtHang> = OnceLock::new();

/// Says what is to be done about a call that does not come back: it should say the words, keep what can be kept, and end
/// the process. Without this nothing is watched. Host, once, before the first run.
pub fn at_hang(what: impl Fn(&str) + Send + Sync + 'static) {
    // Who comes second finds everything arranged.
    let _ = AT_HANG.set(Arc::new(what));
}

/// Looks at a lane until its time is over. That it has not moved in any of them, and not how late a look is, makes it hang: a
/// computer that stands still as a whole, asleep or under a debugger, is no defect of a plugin.
const LOOKS: u32 = 20;
/// Longest wait for the machine to stand before the process ends, where the soft side hangs and the fine loop does not.
const LONGEST_STOP: Duration = Duration::from_secs(10);
/// Stack of the thread, bytes: it is locked into memory with the rest.
const STACK_BYTES: usize = 256 * 1024;

/// Watches the threads of a run while it lives. It belongs to the thread that made it, whose calls of plugins it watches.
pub struct HangWatch {
    shared: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
    _here: Watched,
}

struct Shared {
    names: Names,
    soft: Lane,
    fine: Lane,
    /// The fine loop has a thread of its own, which must come back every period.
    fine_runs: AtomicBool,
    machine: Mutex<Option<(Arc<Controls>, Arc<Status>)>>,
    over: Mutex<bool>,
    ends: Condvar,
    at_hang: AtHang,
}

/// One watched thread.
struct Lane {
    place: Arc<Whereabouts>,
    most: Duration,
}

/// Names of the plugins, as the machine file has them.
struct Names {
    planner: String,
    strategy: String,
    driver: String,
    kinematics: String,
}

/// The fine thread's end of a watch.
#[derive(Clone)]
pub struct FineWatch(Arc<Shared>);

impl HangWatch {
    /// Begins to watch this thread, where the program has said what to do about a hang.
    pub fn of(machine: &Machine) -> Option<Self> {
        AT_HANG
            .get()
            .and_then(|at_hang| Self::start(machine, Arc::clone(at_hang)))
    }

    /// Begins to watch this thread; `None` where the computer gives no thread to do so, which is no reason to stop.
    fn start(machine: &Machine, at_hang: AtHang) -> Option<Self> {
        let lane = |max_s: f64| Lane {
            place: Arc::default(),
            most: Duration::from_secs_f64(max_s),
        };
        let names = Names {
            planner: machine.planner.plugin.clone(),
            strategy: machine
                .feed_strategy
                .as_ref()
                .map(|choice| choice.plugin.clone())
                .unwrap_or_default(),
            driver: machine
                .drivers
                .iter()
                .map(DriverChoice::title)
                .collect::<Vec<_>>()
                .join(", "),
            kinematics: machine.kinematics.plugin.clone(),
        };
        let shared = Arc::new(Shared {
            names,
            soft: lane(machine.soft_hang_after_s),
            fine: lane(machine.fine_hang_after_s),
            fine_runs: AtomicBool::new(false),
            machine: Mutex::new(None),
            over: Mutex::new(false),
            ends: Condvar::new(),
            at_hang,
        });
        let seen = Arc::clone(&shared);
        let builder = thread::Builder::new()
            .name("tandem-hang".to_string())
            .stack_size(STACK_BYTES);
        let thread = builder.spawn(move || seen.watch()).ok()?;
        Some(Self {
            _here: watch_this_thread(&shared.soft.place),
            shared,
            thread: Some(thread),
        })
    }

    /// The run begins with these atomics.
    pub fn begin(&self, controls: Arc<Controls>, status: Arc<Status>) {
        *self
            .shared
            .machine
            .lock()
            .unwrap_or_else(PoisonError::into_inner) = Some((controls, status));
    }

    /// The end for the fine loop's thread.
    pub fn for_fine(&self) -> FineWatch {
        FineWatch(Arc::clone(&self.shared))
    }
}

impl Drop for HangWatch {
    fn drop(&mut self) {
        *self
            .shared
            .over
            .lock()
            .unwrap_or_else(PoisonError::into_inner) = true;
        self.shared.ends.notify_all();
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

impl FineWatch {
    /// From now on this thread comes back every period, until the answer is dropped. Fine thread, before its first period.
    pub fn begin(&self) -> FineRuns {
        let watched = watch_this_thread(&self.0.fine.place);
        self.0.fine_runs.store(true, Release);
        FineRuns {
            shared: Arc::clone(&self.0),
            _watched: watched,
        }
    }
}

/// The fine thread, as long as it must come back.
pub struct FineRuns {
    shared: Arc<Shared>,
    _watched: Watched,
}

impl Drop for FineRuns {
    fn drop(&mut self) {
        self.shared.fine_runs.store(false, Release);
    }
}

/// What was last seen of a lane.
#[derive(Default)]
struct Look {
    count: u64,
    /// Looks in a row at which nothing had changed.
    stuck: u32,
    next: Duration,
}

impl Look {
    /// Looks again after `passed`, when it is time to: whether the lane hangs, and in which method.
    fn again(
        &mut self,
        lane: &Lane,
        passed: Duration,
        must_move: impl Fn(Method) -> bool,
    ) -> Option<Method> {
        self.next = self.next.saturating_sub(passed);
        if !self.next.is_zero() {
            return None;
        }
        self.next = lane.most / LOOKS;
        let (count, method) = lane.place.look();
        let moves = count != self.count || !must_move(method);
        self.stuck = if moves { 0 } else { self.stuck + 1 };
        self.count = count;
        (self.stuck >= LOOKS).then_some(method)
    }
}

impl Shared {
    /// The life of the thread.
    fn watch(&self) {
        let between = self.soft.most.min(self.fine.most) / LOOKS;
        let (mut soft, mut fine) = (Look::default(), Look::default());
        let mut over = self.over.lock().unwrap_or_else(PoisonError::into_inner);
        while !*over {
            let waited = self
                .ends
                .wait_timeout(over, between)
                .unwrap_or_else(PoisonError::into_inner);
            over = waited.0;
            if *over {
                return;
            }
            let fine_runs = self.fine_runs.load(Acquire);
            let of_fine = fine.again(&self.fine, between, |_| fine_runs);
            let of_soft = soft.again(&self.soft, between, |method| method != Method::None);
            if let Some(method) = of_fine {
                (self.at_hang)(&self.words(method, self.fine.most));
                return;
            }
            if let Some(method) = of_soft {
                if fine_runs {
                    self.stop_machine();
                }
                (self.at_hang)(&self.words(method, self.soft.most));
                return;
            }
        }
    }

    fn words(&self, method: Method, most: Duration) -> String {
        let max_s = most.as_secs_f64();
        let machine = self.machine.lock().unwrap_or_else(PoisonError::into_inner);
        let at = machine.as_ref().map(|(_, status)| {
            format!(
                " (line {}, tick {})",
                status.line.load(Relaxed),
                status.tick.load(Relaxed)
            )
        });
        let at = at.unwrap_or_default();
        if let Some((kind, call)) = method.words() {
            let name = self.names.of(kind);
            return format!(
                "{} {name}: {call} does not come back: no answer for {max_s} s{at}",
                kind.name()
            );
        }
        let asked = &self.names.kinematics;
        let or = if asked == "identity" {
            String::new()
        } else {
            format!(", or kinematics {asked} that it asks,")
        };
        format!("the fine loop{or} does not come back: no period for {max_s} s{at}")
    }

    /// Nothing new will be planned, but the fine loop still moves: it stops on the path.
    fn stop_machine(&self) {
        let machine = self
            .machine
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .clone();
        let Some((controls, status)) = machine else {
            return;
        };
        controls.soft_fault.store(true, Relaxed);
        let asked = Instant::now();
        while self.fine_runs.load(Acquire) && asked.elapsed() < LONGEST_STOP {
            thread::sleep(Duration::from_millis(10));
        }
        drop(status);
    }
}

impl Names {
    fn of(&self, kind: PluginKind) -> &str {
        match kind {
            PluginKind::Planner => &self.planner,
            PluginKind::FeedStrategy => &self.strategy,
            PluginKind::Driver => &self.driver,
            PluginKind::Kinematics => &self.kinematics,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;
    use std::sync::mpsc::{Receiver, sync_channel};
    use tandem_sdk::{Kinematics, KinematicsContext, NoOptions, PluginError};

    /// A kinematics that says when it is called, and comes back when it is told to.
    struct Waits(Mutex<Receiver<()>>);

    static TOLD: Mutex<Option<Receiver<()>>> = Mutex::new(None);

    impl Waits {
        #[allow(clippy::unnecessary_wraps)] // the form of constructors
        fn open(_: &NoOptions, _: &KinematicsContext) -> Result<Self, PluginError> {
            Ok(Self(Mutex::new(TOLD.lock().unwrap().take().unwrap())))
        }
    }

    impl Kinematics for Waits {
        fn to_joints(&self, axes: &tandem_sdk::AxisVector) -> tandem_sdk::AxisVector {
            *axes
        }

        fn to_axes(&self, joints: &tandem_sdk::AxisVector) -> tandem_sdk::AxisVector {
            *joints
        }

        fn health(&self) -> Result<(), PluginError> {
            let _ = self.0.lock().unwrap().recv();
            Ok(())
        }
    }

    fn machine() -> Machine {
        let path =
            Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/machines/mill-3axis.toml");
        let set = [
            ("loops.soft_hang_after_s", "0.1"),
            ("loops.fine_hang_after_ms", "100"),
        ];
        let set = set.map(|(key, value)| (key.to_string(), value.to_string()));
        Machine::read(&path, &set).unwrap()
    }

    #[test]
    fn a_call_that_does_not_come_back_is_told_with_plugin_and_method_from_another_thread() {
        let (said, words) = sync_channel(1);
        let (go_on, told) = sync_channel(1);
        *TOLD.lock().unwrap() = Some(told);
        let plugin = tandem_sdk::local_plugin!(kinematics "waits" = Waits::open);
        let at_hang: AtHang = Arc::new(move |words: &str| {
            said.send(words.to_string()).unwrap();
            // In a program the process ends here.
            go_on.send(()).unwrap();
        });
        let watch = HangWatch::start(&machine(), at_hang).unwrap();
        let kinematics = plugin
            .kinematics("", &KinematicsContext::new(machine().axes))
            .unwrap();
        kinematics.health().unwrap();
        assert_eq!(
            words.recv().unwrap(),
            "kinematics identity: health does not come back: no answer for 0.1 s"
        );
        drop(watch);
    }

    #[test]
    fn a_fine_loop_that_stands_is_told_and_one_that_beats_or_has_ended_is_not() {
        let (said, words) = sync_channel(1);
        let at_hang: AtHang = Arc::new(move |words: &str| said.send(words.to_string()).unwrap());
        let watch = HangWatch::start(&machine(), at_hang).unwrap();
        let fine = watch.for_fine();
        let (beats, stands) = (Arc::new(AtomicBool::new(true)), Arc::clone(&watch.shared));
        let goes_on = Arc::clone(&beats);
        let thread = thread::spawn(move || {
            let runs = fine.begin();
            while goes_on.load(Relaxed) {
                tandem_sdk::abi::beat();
                thread::yield_now();
            }
            // It stands from here on, until it is noticed.
            while !*stands.over.lock().unwrap() {
                thread::yield_now();
            }
            drop(runs);
        });
        assert!(
            words.recv_timeout(Duration::from_millis(300)).is_err(),
            "it beats"
        );
        beats.store(false, Relaxed);
        assert!(
            words
                .recv()
                .unwrap()
                .starts_with("the fine loop does not come back: no period for 0.1 s")
        );
        drop(watch);
        thread.join().unwrap();
    }
}
