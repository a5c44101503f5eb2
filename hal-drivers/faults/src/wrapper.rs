//! The wrapper: a driver around a driver.

use tandem_random::Random;
use tandem_sdk::{
    Attached, Driver, DriverContext, DriverDescription, Feedback, Latch, MAX_LATCHES, PluginError,
    Setpoint, Words,
};

use crate::kind::{Kind, Line, freeze};
use crate::schedule::{Schedule, When};

/// One entry of `[[faults.wrap]]`, checked.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plan {
    /// What it does.
    pub kind: Kind,
    /// To which exchanges.
    pub when: When,
}

/// Passes everything through to the driver inside, except in the exchanges that its plan hits.
pub struct Wrapper {
    inner: Box<dyn Driver>,
    plan: Plan,
    random: Random,
    schedule: Schedule,
    line: Line,
    /// What the drives were handed last.
    handed: Setpoint,
    /// What the driver inside left in the feedback.
    left: Feedback,
    /// What was answered last.
    answered: Feedback,
}

impl Wrapper {
    /// Wraps `inner`, which is not open yet, as entry `index` of the list. Host; allocates.
    pub fn new(inner: Box<dyn Driver>, plan: Plan, seed: u64, index: u64) -> Self {
        let random = Random::of(seed, index);
        let line = Line::new(if let Kind::Delay(periods) = plan.kind {
            periods
        } else {
            0
        });
        let schedule = Schedule::new(plan.when, random);
        let (handed, answered) = (Setpoint::default(), Feedback::default());
        Self {
            inner,
            plan,
            random,
            schedule,
            line,
            handed,
            left: answered,
            answered,
        }
    }

    fn hand_over(
        &mut self,
        setpoint: &Setpoint,
        feedback: &mut Feedback,
    ) -> Result<(), PluginError> {
        self.handed = *setpoint;
        self.hand_over_again(feedback)
    }

    fn hand_over_again(&mut self, feedback: &mut Feedback) -> Result<(), PluginError> {
        // A driver is given the feedback as it left it, whatever has been made of that.
        *feedback = self.left;
        let answer = self.inner.exchange(&self.handed, feedback);
        self.left = *feedback;
        answer
    }

    fn hit(&mut self, setpoint: &Setpoint, feedback: &mut Feedback) -> Result<(), PluginError> {
        match self.plan.kind {
            Kind::Drop => *feedback = older(&self.answered),
            Kind::Duplicate => self.hand_over_again(feedback)?,
            Kind::Delay(_) => match self.line.pass(setpoint) {
                Some(late) => self.hand_over(&late, feedback)?,
                None => self.hand_over_again(feedback)?,
            },
            Kind::Freeze(mask) => {
                self.hand_over(setpoint, feedback)?;
                freeze(mask, &self.answered, feedback);
            }
            Kind::Corrupt(corruption, mask) => {
                self.hand_over(setpoint, feedback)?;
                corruption.apply(mask, feedback);
            }
            Kind::Fail => return Err(PluginError::fixed("failed on purpose, by [faults]")),
        }
        Ok(())
    }
}

/// What is handed out again of an answer where none has come: the same numbers, one period older, and no latch once more.
fn older(answered: &Feedback) -> Feedback {
    let mut old = *answered;
    old.age_periods
        .iter_mut()
        .for_each(|age| *age = age.saturating_add(1));
    old.input_age_periods
        .iter_mut()
        .for_each(|age| *age = age.saturating_add(1));
    old.latches = [Latch::default(); MAX_LATCHES];
    old
}

impl Driver for Wrapper {
    fn describe(&self) -> DriverDescription {
        self.inner.describe()
    }

    fn check(&self, context: &DriverContext) -> Result<(), PluginError> {
        self.inner.check(context)
    }

    fn open(&mut self, context: &DriverContext) -> Result<(), PluginError> {
        self.inner.open(context)
    }

    fn start(&mut self) -> Result<Attached, PluginError> {
        self.schedule = Schedule::new(self.plan.when, self.random);
        self.line.clear();
        self.handed = Setpoint::default();
        self.left = Feedback::default();
        self.answered = Feedback::default();
        self.inner.start()
    }

    fn exchange(
        &mut self,
        setpoint: &Setpoint,
        feedback: &mut Feedback,
    ) -> Result<(), PluginError> {
        if self.schedule.hits(setpoint.tick) {
            self.hit(setpoint, feedback)?;
        } else {
            // Where a delay ends, what was still on its way is overtaken and lost.
            self.line.clear();
            self.hand_over(setpoint, feedback)?;
        }
        self.answered = *feedback;
        Ok(())
    }

    fn quick_stop(&mut self) {
        self.inner.quick_stop();
    }

    fn stop(&mut self) -> Result<(), PluginError> {
        self.inner.stop()
    }

    fn explain(&self, joint: u32, code: u32) -> Words {
        self.inner.explain(joint, code)
    }
}
