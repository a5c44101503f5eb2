//! The driver contract over a bus.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use tandem_sdk::{
    Attached, Driver, DriverContext, DriverDescription, Feedback, JointState, PluginError,
    Setpoint, Words,
};

use crate::bus::{Bus, Counters};
use crate::check;
use crate::options::{DeviceOptions, EMULATED, Options, number};
use crate::requests::{ObjectServer, Request};
use crate::survey::Value;
use crate::words::{joint_code, own};

/// Periods without an exchange of the host's, after which the driver keeps its bus alive by itself, and the share of the devices'
/// watchdog, where that is longer: a host that is only late is not taken for a silent one, which stops what moves.
const SILENT_PERIODS: u64 = 3;
const WATCHDOG_SHARE: f64 = 0.5;

/// Longest time for which the thread that keeps the bus alive does not look whether it is to end.
const MAX_NAP: Duration = Duration::from_millis(20);

/// The same while somebody asks for an object: a few looks in a period.
const NAP_AT_WORK: Duration = Duration::from_micros(200);

/// A bus of drives and terminals behind the driver contract.
///
/// On the wall clock a thread exchanges where the host does not, with real-time priority where the system grants it: between the start and the first exchange,
/// and behind the last one. It holds enabled joints where they are; joints that move while the host falls silent are stopped by
/// their drives.
#[derive(Debug)]
pub struct EthercatDrives {
    options: Options,
    context: DriverContext,
    shared: Option<Arc<Shared>>,
    keeper: Option<JoinHandle<()>>,
    running: bool,
}

/// What host and keeper share. The fine loop only ever tries to take it.
struct Shared {
    bus: Mutex<Bus>,
    opened: Instant,
    /// When the host exchanged last, ns since `opened`.
    heard_ns: AtomicU64,
    ends: AtomicBool,
}

impl std::fmt::Debug for Shared {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Shared")
    }
}

impl Shared {
    fn now_ns(&self) -> u64 {
        self.opened.elapsed().as_nanos() as u64
    }

    /// For the soft side: waits.
    fn bus(&self) -> MutexGuard<'_, Bus> {
        self.bus.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Goes on with objects that are asked for, where nobody has the bus; whether any is.
    fn serve(&self, server: Option<&mut ObjectServer>) -> bool {
        let Ok(mut bus) = self.bus.try_lock() else {
            return true;
        };
        let is_served = server.is_some_and(|server| {
            server.look(&mut bus);
            server.is_busy()
        });
        if bus.is_asked() {
            bus.work_beside();
        }
        is_served || bus.is_asked()
    }

    /// For the fine loop: the keeper has it for the time of one frame at most, and while the host is silent only.
    fn try_bus(&self, until: Duration) -> Option<MutexGuard<'_, Bus>> {
        let begun = Instant::now();
        loop {
            match self.bus.try_lock() {
                Ok(bus) => return Some(bus),
                Err(std::sync::TryLockError::Poisoned(poisoned)) => {
                    return Some(poisoned.into_inner());
                }
                Err(std::sync::TryLockError::WouldBlock) if begun.elapsed() < until => {
                    std::hint::spin_loop();
                }
                Err(std::sync::TryLockError::WouldBlock) => return None,
            }
        }
    }
}

impl EthercatDrives {
    /// A driver with options of their own kind, not yet opened.
    ///
    /// # Errors
    /// Options that go with no machine.
    pub fn new(options: &Options) -> Result<Self, PluginError> {
        check::judge_alone(options)?;
        let context = DriverContext::new(0, 0.001); // replaced by `open`
        Ok(Self {
            options: options.clone(),
            context,
            shared: None,
            keeper: None,
            running: false,
        })
    }

    /// What became of the exchanges since the start. Host; for tests and for people who watch.
    pub fn counters(&self) -> Counters {
        self.shared
            .as_ref()
            .map(|shared| shared.bus().counters)
            .unwrap_or_default()
    }

    /// Sends the frame of the last exchange once more and waits for it, at most for a period; whether it came. For benchmarks:
    /// this is what a bare frame of the same bytes takes.
    pub fn send_again(&mut self) -> bool {
        let shared = self.shared.as_ref().filter(|_| self.running);
        shared.is_some_and(|shared| shared.bus().send_again())
    }

    /// Asks for an object of a device while exchanges go on: it is read, or written and read back, in the gaps between them. On
    /// the wall clock the thread that keeps the bus alive does it. Host; allocates.
    ///
    /// # Errors
    /// There is no such device, another object is being asked for, or the object is one that the driver writes itself.
    pub fn ask(&self, request: &Request) -> Result<(), String> {
        let shared = self.shared.as_ref().filter(|_| self.running);
        let shared = shared.ok_or_else(|| "the bus is not in operation".to_string())?;
        shared.bus().ask(request)
    }

    /// What came of the object that was asked for, once it is there, and once. Host; allocates.
    pub fn answer(&self) -> Option<Result<Value, String>> {
        self.shared.as_ref()?.bus().take_answer()
    }

    /// Looks into the emulated bus, and changes it: for tests. Nothing where it is another.
    pub fn with_emulator<T>(
        &mut self,
        look: impl FnOnce(&mut tandem_ethercat_emulator::Wire) -> T,
    ) -> Option<T> {
        let shared = self.shared.as_ref()?;
        let mut bus = shared.bus();
        bus.link_mut().wire_mut().map(look)
    }

    fn period(&self) -> Duration {
        Duration::from_secs_f64(self.context.fine_period_s)
    }

    /// Starts the thread that keeps the bus alive, on the wall clock.
    fn keep(&mut self) {
        let Some(shared) = self.shared.clone().filter(|_| self.context.real_time != 0) else {
            return;
        };
        shared.ends.store(false, Ordering::Relaxed);
        shared.heard_ns.store(0, Ordering::Relaxed);
        let period = self.period();
        let half_ns = (self.options.watchdog_ms * 1e6 * WATCHDOG_SHARE) as u64;
        let silent_ns = half_ns.max(period.as_nanos() as u64 * SILENT_PERIODS);
        self.keeper = std::thread::Builder::new()
            .name("ethercat".to_string())
            .spawn(move || {
                ask_for_priority();
                let mut server = shared.bus().server();
                while !shared.ends.load(Ordering::Relaxed) {
                    let begun = Instant::now();
                    let heard_ns = shared.heard_ns.load(Ordering::Acquire);
                    let since_ns = shared.now_ns().saturating_sub(heard_ns);
                    if heard_ns > 0 && since_ns <= silent_ns {
                        let at_work = shared.serve(server.as_mut());
                        // Nothing is to be done before, and the fine loop has the computer for itself.
                        let left = Duration::from_nanos(silent_ns - since_ns);
                        let nap = left.clamp(period, MAX_NAP);
                        std::thread::sleep(if at_work { NAP_AT_WORK } else { nap });
                        continue;
                    }
                    if let Ok(mut bus) = shared.bus.try_lock() {
                        bus.keep_alive();
                    }
                    shared.serve(server.as_mut());
                    std::thread::sleep(period.saturating_sub(begun.elapsed()));
                }
            })
            .ok();
    }

    fn end_keeper(&mut self) {
        if let (Some(shared), Some(keeper)) = (&self.shared, self.keeper.take()) {
            shared.ends.store(true, Ordering::Relaxed);
            // A keeper that has panicked has ended.
            let _ = keeper.join();
        }
    }
}

impl Driver for EthercatDrives {
    fn describe(&self) -> DriverDescription {
        let real = DriverDescription::real();
        DriverDescription {
            simulated: u32::from(self.options.interface == EMULATED),
            watches_following: u32::from(self.options.drives_watch_following),
            hexadecimal_codes: 1,
            gives_phase: u32::from(self.options.sync == crate::options::Sync::Dc),
            enable_s: self.options.enable_s,
            disable_s: self.options.disable_s,
            ..real
        }
    }

    fn check(&self, context: &DriverContext) -> Result<(), PluginError> {
        check::judge(&self.options, context)
    }

    fn open(&mut self, context: &DriverContext) -> Result<(), PluginError> {
        if self.running {
            return Err(PluginError::fixed(
                "ethercat: open is refused: the driver is running",
            ));
        }
        check::judge(&self.options, context)?;
        self.context = *context;
        self.shared = None;
        let bus = Bus::open(&self.options, context)
            .map_err(|words| PluginError::new(format!("ethercat: {words}")))?;
        self.shared = Some(Arc::new(Shared {
            bus: Mutex::new(bus),
            opened: Instant::now(),
            heard_ns: AtomicU64::new(0),
            ends: AtomicBool::new(false),
        }));
        Ok(())
    }

    fn start(&mut self) -> Result<Attached, PluginError> {
        let Some(shared) = self.shared.as_ref().filter(|_| !self.running) else {
            return Err(PluginError::fixed(
                "ethercat: start is refused: the driver is closed, or runs already",
            ));
        };
        let attached = shared.bus().start();
        match attached {
            Ok(attached) => {
                self.running = true;
                self.keep();
                Ok(attached)
            }
            Err(words) => {
                shared.bus().stop();
                Err(PluginError::new(format!("ethercat: {words}")))
            }
        }
    }

    fn send(&mut self, setpoint: &Setpoint) -> bool {
        let until = self.period() / 2;
        if let Some(shared) = self.shared.as_ref().filter(|_| self.running)
            && let Some(mut bus) = shared.try_bus(until)
        {
            shared
                .heard_ns
                .store(shared.now_ns().max(1), Ordering::Release);
            bus.send(setpoint);
        }
        true
    }

    fn exchange(
        &mut self,
        setpoint: &Setpoint,
        feedback: &mut Feedback,
    ) -> Result<(), PluginError> {
        let until = self.period() / 2;
        let Some(shared) = self.shared.as_ref().filter(|_| self.running) else {
            return Err(PluginError::fixed(
                "ethercat: exchange is refused: the driver is not started",
            ));
        };
        let finite = setpoint.position.is_finite()
            && setpoint.velocity.is_finite()
            && setpoint.acceleration.is_finite();
        if !(finite && setpoint.spindle_rad_per_s.is_finite()) {
            return Err(PluginError::fixed(
                "ethercat: exchange is refused: the setpoint is not a finite number",
            ));
        }
        match shared.try_bus(until) {
            Some(mut bus) => {
                shared
                    .heard_ns
                    .store(shared.now_ns().max(1), Ordering::Release);
                bus.exchange(setpoint, feedback);
            }
            None => grow_old(feedback, self.context.joint_count as usize),
        }
        Ok(())
    }

    fn quick_stop(&mut self) {
        let until = self.period() / 2;
        if let Some(shared) = self.shared.as_ref().filter(|_| self.running)
            && let Some(mut bus) = shared.try_bus(until)
        {
            bus.quick_stop();
        }
    }

    fn stop(&mut self) -> Result<(), PluginError> {
        self.end_keeper();
        if let Some(shared) = &self.shared {
            shared.bus().stop();
        }
        self.running = false;
        Ok(())
    }

    fn explain(&self, joint: u32, code: u32) -> Words {
        if let Some((number, why)) = own::device(code) {
            let device = self.options.devices.get(number);
            let title = device.map_or_else(String::new, DeviceOptions::title);
            let words = if device.is_some_and(DeviceOptions::is_drive) {
                joint_code(own::SPINDLE + why)
            } else {
                joint_code(why)
            };
            return Words::new(format!("{title}: {words}"));
        }
        let name = self
            .context
            .joints
            .get(joint as usize)
            .map_or("", |joint| joint.name.as_str());
        let device = self
            .options
            .devices
            .iter()
            .find(|device| device.joint.as_deref() == Some(name));
        let own = device.and_then(|device| {
            device
                .codes
                .iter()
                .find(|known| number(&known.code) == Some(code))
        });
        let words = own.map_or_else(|| joint_code(code), |known| known.text.clone());
        match device.filter(|_| !words.is_empty()) {
            Some(device) => Words::new(format!("{}: {words}", device.title())),
            None => Words::new(words),
        }
    }
}

/// Real-time priority of the keeper: above every ordinary program, below the fine loop (`loops.fine_priority`, 80).
const KEEPER_PRIORITY: i32 = 40;

/// Asks for real-time priority for this thread; a computer that grants none keeps the bus alive as well as it can.
fn ask_for_priority() {
    let parameter = libc::sched_param {
        sched_priority: KEEPER_PRIORITY,
    };
    // SAFETY: the thread is this one, and the structure is read only.
    let _ = unsafe {
        libc::pthread_setschedparam(libc::pthread_self(), libc::SCHED_FIFO, &raw const parameter)
    };
}

/// The keeper had the bus for too long: nothing was heard in this period.
fn grow_old(feedback: &mut Feedback, joints: usize) {
    for joint in 0..joints {
        feedback.age_periods[joint] = feedback.age_periods[joint].saturating_add(1);
    }
    for age in &mut feedback.input_age_periods {
        *age = age.saturating_add(1);
    }
    for latch in &mut feedback.latches {
        latch.edge = 0;
    }
    debug_assert!(
        feedback.state[..joints]
            .iter()
            .all(|state| JointState::is_known(*state))
    );
}

impl Drop for EthercatDrives {
    fn drop(&mut self) {
        self.end_keeper();
    }
}
