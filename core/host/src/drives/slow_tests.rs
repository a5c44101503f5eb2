//! What a device behind slots is told and says, with a device that answers when the test lets it.

use std::sync::mpsc::{Receiver, Sender, channel};

use super::*;

const PATIENCE_PERIODS: u64 = 5;

/// What the device was asked, as it was asked.
#[derive(Debug, PartialEq)]
enum Asked {
    /// The tick and the reset of its setpoint.
    Exchange(u64, u32),
    QuickStop,
    Stop,
}

/// A device whose exchange says that it was asked, and waits for its answer.
struct Gated {
    asked: Sender<Asked>,
    answers: Receiver<Result<(), PluginError>>,
}

impl Driver for Gated {
    fn describe(&self) -> DriverDescription {
        DriverDescription {
            slow: 1,
            ..DriverDescription::real()
        }
    }
    fn open(&mut self, _context: &DriverContext) -> Result<(), PluginError> {
        Ok(())
    }
    fn start(&mut self) -> Result<Attached, PluginError> {
        Ok(Attached::default())
    }
    fn exchange(
        &mut self,
        setpoint: &Setpoint,
        feedback: &mut Feedback,
    ) -> Result<(), PluginError> {
        let _ = self
            .asked
            .send(Asked::Exchange(setpoint.tick, setpoint.reset));
        feedback.inputs = setpoint.tick;
        feedback.spindle_at_speed = 1;
        self.answers.recv().unwrap_or(Ok(()))
    }
    fn quick_stop(&mut self) {
        let _ = self.asked.send(Asked::QuickStop);
    }
    fn stop(&mut self) -> Result<(), PluginError> {
        let _ = self.asked.send(Asked::Stop);
        Ok(())
    }
}

/// The fine loop's side of such a device, and the device's.
struct Bench {
    slow: Slow,
    asked: Receiver<Asked>,
    answers: Sender<Result<(), PluginError>>,
    tick: u64,
    feedback: Feedback,
}

impl Bench {
    fn new() -> Self {
        let (asked_of, asked) = channel();
        let (answers, given) = channel();
        let mut slow = Slow::new(
            Box::new(Gated {
                asked: asked_of,
                answers: given,
            }),
            0.001 * PATIENCE_PERIODS as f64,
        );
        slow.open(&DriverContext::new(0, 0.001)).unwrap();
        slow.start().unwrap();
        slow.switch().begin().unwrap();
        Self {
            slow,
            asked,
            answers,
            tick: 0,
            feedback: Feedback::default(),
        }
    }

    /// One fine period.
    fn exchange(&mut self, reset: u32) -> Result<(), PluginError> {
        self.tick += 1;
        let setpoint = Setpoint {
            enable: 1,
            reset,
            tick: self.tick,
            ..Setpoint::default()
        };
        self.slow.exchange(&setpoint, &mut self.feedback)
    }

    /// The device answers what it was asked, and that has arrived.
    fn answer(&self, answer: Result<(), PluginError>) {
        self.answers.send(answer).unwrap();
        while self.slow.shared.answered.is_empty() {
            thread::yield_now();
        }
    }
}

#[test]
fn an_answer_is_as_old_as_the_periods_since_it_was_asked_for_and_says_nothing_of_the_spindle_beyond_patience()
 {
    let mut bench = Bench::new();
    bench.exchange(0).unwrap();
    assert_eq!(bench.asked.recv(), Ok(Asked::Exchange(1, 0)));
    bench.answer(Ok(()));
    for age in 1..=2 * PATIENCE_PERIODS {
        bench.exchange(0).unwrap();
        assert_eq!(
            (
                bench.feedback.inputs,
                u64::from(bench.feedback.input_age_periods[3])
            ),
            (1, age)
        );
        let is_known = u32::from(age <= PATIENCE_PERIODS);
        assert_eq!(
            bench.feedback.spindle_at_speed, is_known,
            "{age} periods old"
        );
    }
    drop(bench.answers);
    bench.slow.stop().unwrap();
}

#[test]
fn a_reset_that_came_while_the_device_was_busy_reaches_it_once() {
    let mut bench = Bench::new();
    bench.exchange(0).unwrap();
    assert_eq!(bench.asked.recv(), Ok(Asked::Exchange(1, 0)));
    for reset in [0, 1, 0, 0] {
        bench.exchange(reset).unwrap();
    }
    bench.answer(Ok(()));
    assert_eq!(
        bench.asked.recv(),
        Ok(Asked::Exchange(5, 1)),
        "the newest setpoint, and the reset"
    );
    bench.exchange(0).unwrap();
    bench.answer(Ok(()));
    assert_eq!(bench.asked.recv(), Ok(Asked::Exchange(6, 0)));
    drop(bench.answers);
    bench.slow.stop().unwrap();
}

#[test]
fn a_quick_stop_comes_before_anything_else_that_the_device_is_asked() {
    let mut bench = Bench::new();
    bench.exchange(0).unwrap();
    assert_eq!(bench.asked.recv(), Ok(Asked::Exchange(1, 0)));
    bench.exchange(0).unwrap();
    bench.slow.quick_stop();
    bench.answer(Ok(()));
    assert_eq!(bench.asked.recv(), Ok(Asked::QuickStop));
    assert_eq!(bench.asked.recv(), Ok(Asked::Exchange(2, 0)));
    drop(bench.answers);
    bench.slow.stop().unwrap();
}

#[test]
fn its_failure_is_that_of_an_exchange_and_told_once() {
    let mut bench = Bench::new();
    bench.exchange(0).unwrap();
    assert_eq!(bench.asked.recv(), Ok(Asked::Exchange(1, 0)));
    bench.answer(Err(PluginError::fixed("the line is cut")));
    assert_eq!(
        bench.exchange(0),
        Err(PluginError::fixed("the line is cut"))
    );
    assert_eq!(bench.exchange(0), Ok(()));
    drop(bench.answers);
    bench.slow.stop().unwrap();
    assert_eq!(bench.asked.try_iter().last(), Some(Asked::Stop));
}

#[test]
fn a_device_that_does_not_come_back_is_not_waited_for() {
    let mut bench = Bench::new();
    bench.exchange(0).unwrap();
    assert_eq!(bench.asked.recv(), Ok(Asked::Exchange(1, 0)));
    assert_eq!(bench.slow.stop(), Err(does_not_answer()));
    assert!(bench.asked.try_recv().is_err(), "it is still in its call");
}

/// Behind a stop it is started once more, with a thread of its own again, and what was answered before counts no more.
#[test]
fn a_device_that_was_stopped_is_started_again_with_a_thread_of_its_own() {
    let mut bench = Bench::new();
    bench.exchange(0).unwrap();
    assert_eq!(bench.asked.recv(), Ok(Asked::Exchange(1, 0)));
    bench.answer(Ok(()));
    bench.slow.stop().unwrap();
    assert_eq!(bench.asked.recv(), Ok(Asked::Stop));
    bench.slow.start().unwrap();
    bench.slow.switch().begin().unwrap();
    bench.feedback = Feedback::default();
    bench.exchange(0).unwrap();
    assert_eq!(
        (bench.feedback.inputs, bench.feedback.input_age_periods[3]),
        (0, 1),
        "nothing was answered since"
    );
    // The exchange does not wait for the device, which was asked on its thread.
    assert_eq!(bench.asked.recv(), Ok(Asked::Exchange(2, 0)));
    bench.answer(Ok(()));
    bench.exchange(0).unwrap();
    assert_eq!(bench.feedback.inputs, 2);
    drop(bench.answers);
    bench.slow.stop().unwrap();
}
