//! A device that takes longer than a fine period to answer: called on a thread of its own, and never waited for.
//!
//! Two slots of one entry lie between the fine loop and the thread: what is told, and what was answered. Whoever writes
//! replaces what has not been read, so neither side ever waits; the slots are `crossbeam_queue::ArrayQueue`s, which take
//! no lock and no memory.

use std::sync::atomic::AtomicBool;
use std::sync::atomic::Ordering::{Acquire, Relaxed, Release};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use crossbeam_queue::ArrayQueue;
use tandem_sdk::{
    Attached, Driver, DriverContext, DriverDescription, Feedback, PluginError, Setpoint, Words,
};

/// How long the thread sleeps where nothing new was told: a fraction of any answer that needs a thread.
const IDLE: Duration = Duration::from_millis(1);
/// How long a thread has to come back when the driver is stopped: several answers of a slow line.
const END: Duration = Duration::from_secs(2);

/// What the thread is told: the setpoint of a period.
struct Message {
    period: u64,
    setpoint: Setpoint,
}

/// What came of it.
struct Answer {
    /// Of which period the setpoint was.
    period: u64,
    feedback: Feedback,
    result: Result<(), PluginError>,
}

struct Shared {
    /// Taken by the thread while there is one, else by who calls in line: nobody waits for it.
    driver: Mutex<Box<dyn Driver>>,
    message: ArrayQueue<Message>,
    answered: ArrayQueue<Answer>,
    /// The driver is called on its own thread; else in line, as on the virtual clock.
    has_thread: AtomicBool,
    ends: AtomicBool,
    stops_quickly: AtomicBool,
    thread: Mutex<Option<JoinHandle<()>>>,
}

/// A slow driver.
pub struct Slow {
    shared: Arc<Shared>,
    description: DriverDescription,
    period: u64,
    /// Period in which the spindle was told its present speed.
    spindle_since: u64,
    last: Setpoint,
    /// Period of the setpoint that was answered last.
    answered: u64,
    feedback: Feedback,
    /// Time after which the last answer says nothing of the spindle any more, s, and in fine periods.
    patience_s: f64,
    patience_periods: u64,
}

/// Gives a slow driver its thread.
#[derive(Clone)]
pub struct Switch(Arc<Shared>);

impl std::fmt::Debug for Switch {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Switch")
    }
}

impl Slow {
    /// `driver`, in line until its switch gives it a thread. Of a spindle that has said nothing for `patience_s`, the time in
    /// which it is to come to its speed, nothing is known.
    pub fn new(driver: Box<dyn Driver>, patience_s: f64) -> Self {
        let description = driver.describe();
        let shared = Shared {
            driver: Mutex::new(driver),
            message: ArrayQueue::new(1),
            answered: ArrayQueue::new(1),
            has_thread: AtomicBool::new(false),
            ends: AtomicBool::new(false),
            stops_quickly: AtomicBool::new(false),
            thread: Mutex::new(None),
        };
        Self {
            shared: Arc::new(shared),
            description,
            period: 0,
            spindle_since: 0,
            last: Setpoint::default(),
            answered: 0,
            feedback: Feedback::default(),
            patience_s,
            patience_periods: 0,
        }
    }

    /// What gives it its thread.
    pub fn switch(&self) -> Switch {
        Switch(Arc::clone(&self.shared))
    }

    /// The driver, for calls between exchanges; none while its thread has not come back.
    fn driver(&self) -> Option<MutexGuard<'_, Box<dyn Driver>>> {
        self.shared.driver.try_lock().ok()
    }

    /// Hands `setpoint` on; a reset that nobody has read yet stays in what replaces it.
    fn tell(&mut self, setpoint: &Setpoint) {
        if setpoint.spindle_rad_per_s.to_bits() != self.last.spindle_rad_per_s.to_bits() {
            self.spindle_since = self.period;
        }
        let message = Message {
            period: self.period,
            setpoint: *setpoint,
        };
        let replaced = self.shared.message.force_push(message);
        if replaced.is_some_and(|message| message.setpoint.reset != 0) && setpoint.reset == 0 {
            let setpoint = Setpoint {
                reset: 1,
                ..*setpoint
            };
            let _ = self.shared.message.force_push(Message {
                period: self.period,
                setpoint,
            });
        }
        self.last = *setpoint;
    }

    /// What is known by now, with its age.
    fn hear(&mut self, feedback: &mut Feedback) -> Result<(), PluginError> {
        let mut result = Ok(());
        if let Some(answer) = self.shared.answered.pop() {
            (self.answered, self.feedback, result) =
                (answer.period, answer.feedback, answer.result);
        }
        let age = self.period - self.answered;
        *feedback = self.feedback;
        let short = u16::try_from(age).unwrap_or(u16::MAX);
        feedback
            .input_age_periods
            .iter_mut()
            .for_each(|own| *own = own.saturating_add(short));
        // An answer to what was told before the speed was changed says nothing of the new one.
        let is_old = age > self.patience_periods || self.answered < self.spindle_since;
        if is_old {
            feedback.spindle_at_speed = 0;
        }
        result
    }
}

impl Switch {
    /// Calls the driver on its own thread from here on. Host; allocates.
    ///
    /// # Errors
    /// The computer gives no thread.
    pub fn begin(&self) -> std::io::Result<()> {
        let shared = Arc::clone(&self.0);
        shared.ends.store(false, Release);
        let thread = thread::Builder::new()
            .name("tandem-slow".to_string())
            .spawn(move || shared.run())?;
        *self.0.thread.lock().unwrap_or_else(PoisonError::into_inner) = Some(thread);
        self.0.has_thread.store(true, Release);
        Ok(())
    }
}

impl Shared {
    fn run(&self) {
        let mut driver = self.driver.lock().unwrap_or_else(PoisonError::into_inner);
        let mut feedback = Feedback::default();
        while !self.ends.load(Acquire) {
            if self.stops_quickly.swap(false, Relaxed) {
                driver.quick_stop();
            }
            let Some(Message { period, setpoint }) = self.message.pop() else {
                thread::sleep(IDLE);
                continue;
            };
            let result = driver.exchange(&setpoint, &mut feedback);
            self.answered.force_push(Answer {
                period,
                feedback,
                result,
            });
        }
    }

    /// Whether the thread, if there is one, has come back.
    fn end(&self) -> bool {
        self.ends.store(true, Release);
        let thread = self
            .thread
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .take();
        let Some(thread) = thread else { return true };
        for _ in 0..END.as_millis() / IDLE.as_millis() {
            if thread.is_finished() {
                break;
            }
            thread::sleep(IDLE);
        }
        // One that hangs in the device is left to it.
        thread.is_finished() && thread.join().is_ok()
    }
}

impl Driver for Slow {
    fn describe(&self) -> DriverDescription {
        self.description
    }

    fn check(&self, context: &DriverContext) -> Result<(), PluginError> {
        self.driver().map_or(Ok(()), |driver| driver.check(context))
    }

    fn open(&mut self, context: &DriverContext) -> Result<(), PluginError> {
        self.patience_periods = (self.patience_s / context.fine_period_s).ceil() as u64;
        self.driver()
            .map_or_else(|| Err(does_not_answer()), |mut driver| driver.open(context))
    }

    fn start(&mut self) -> Result<Attached, PluginError> {
        // What was told and answered before a stop is of no use behind it.
        let _ = (self.shared.message.pop(), self.shared.answered.pop());
        self.period = 0;
        self.spindle_since = 0;
        self.answered = 0;
        self.last = Setpoint::default();
        self.feedback = Feedback::default();
        self.driver()
            .map_or_else(|| Err(does_not_answer()), |mut driver| driver.start())
    }

    fn exchange(
        &mut self,
        setpoint: &Setpoint,
        feedback: &mut Feedback,
    ) -> Result<(), PluginError> {
        if !self.shared.has_thread.load(Acquire) {
            return self
                .driver()
                .map_or(Ok(()), |mut driver| driver.exchange(setpoint, feedback));
        }
        self.period += 1;
        self.tell(setpoint);
        self.hear(feedback)
    }

    fn quick_stop(&mut self) {
        if self.shared.has_thread.load(Acquire) {
            self.shared.stops_quickly.store(true, Relaxed);
        } else if let Some(mut driver) = self.driver() {
            driver.quick_stop();
        }
    }

    fn stop(&mut self) -> Result<(), PluginError> {
        if !self.shared.end() {
            return Err(does_not_answer());
        }
        // Until its switch gives it another thread, it is called in line.
        self.shared.has_thread.store(false, Release);
        self.driver()
            .map_or_else(|| Err(does_not_answer()), |mut driver| driver.stop())
    }

    fn explain(&self, joint: u32, code: u32) -> Words {
        self.driver()
            .map_or_else(Words::default, |driver| driver.explain(joint, code))
    }
}

fn does_not_answer() -> PluginError {
    PluginError::fixed("its device does not answer: a call has not come back")
}

#[cfg(test)]
#[path = "slow_tests.rs"]
mod tests;
