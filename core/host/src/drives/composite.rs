//! Several drivers as one.

use std::sync::Arc;
use std::sync::atomic::AtomicUsize;
use std::sync::atomic::Ordering::Relaxed;

use tandem_sdk::{
    Attached, Driver, DriverContext, DriverDescription, Feedback, JointState, Latch, MAX_AXES,
    MAX_LATCHES, PluginError, Setpoint, Words,
};

use super::share::Share;

/// The machine's number of each of a driver's joints.
struct Joints {
    machine: [u8; MAX_AXES],
    count: usize,
}

impl Joints {
    fn of(share: &Share) -> Self {
        let mut this = Self {
            machine: [0; MAX_AXES],
            count: 0,
        };
        for (machine, (_, joint)) in this.machine.iter_mut().zip(share.joints.pairs()) {
            *machine = joint as u8;
            this.count += 1;
        }
        this
    }

    /// The driver's and the machine's number of each, both below [`MAX_AXES`].
    #[inline]
    fn iter(&self) -> impl Iterator<Item = (usize, usize)> {
        self.machine
            .iter()
            .take(self.count)
            .enumerate()
            .map(|(own, machine)| (own, usize::from(*machine) % MAX_AXES))
    }
}

/// One of the drivers, with what it is told and what it answers, in its own numbers.
pub struct Part {
    driver: Box<dyn Driver>,
    share: Share,
    joints: Joints,
    title: String,
    setpoint: Setpoint,
    feedback: Feedback,
    /// What it was told last had orders ([`has_orders`]).
    has_orders: bool,
    /// Its exchange has failed since the drives were last reset: nothing is known of its joints.
    has_failed: bool,
}

impl Part {
    /// `driver` for its `share` of the machine.
    pub fn new(driver: Box<dyn Driver>, share: Share, title: String) -> Self {
        let (setpoint, feedback) = (Setpoint::default(), Feedback::default());
        Self {
            joints: Joints::of(&share),
            driver,
            share,
            title,
            setpoint,
            feedback,
            has_orders: false,
            has_failed: false,
        }
    }

    /// Takes its part of what the machine is told; `orders` says whether some of what is zero in most periods is not.
    #[allow(clippy::inline_always)] // two calls of it in every period
    #[inline(always)]
    fn take(&mut self, whole: &Setpoint, orders: bool) {
        let (share, own) = (&self.share, &mut self.setpoint);
        own.enable = whole.enable;
        own.tick = whole.tick;
        own.outputs = share.outputs.to_own(whole.outputs);
        for (i, joint) in self.joints.iter() {
            own.position[i] = whole.position[joint];
            own.velocity[i] = whole.velocity[joint];
            own.acceleration[i] = whole.acceleration[joint];
        }
        if share.spindle {
            own.spindle_rad_per_s = whole.spindle_rad_per_s;
        }
        if orders | self.has_orders {
            self.take_orders(whole);
        }
    }

    /// Takes what is zero in most periods.
    #[cold]
    fn take_orders(&mut self, whole: &Setpoint) {
        let (share, own) = (&self.share, &mut self.setpoint);
        own.reset = whole.reset;
        own.homing = share.joints.to_own(u64::from(whole.homing)) as u32;
        own.limited = share.joints.to_own(u64::from(whole.limited)) as u32;
        own.arm = share.own_arm(whole.arm);
        self.has_failed &= whole.reset == 0;
        self.has_orders = has_orders(whole);
    }

    /// Adds its answer to that of the machine; `latches` have been filled before it.
    #[inline]
    fn give(&self, whole: &mut Feedback, latches: &mut usize) {
        let (share, own) = (&self.share, &self.feedback);
        for (i, joint) in self.joints.iter() {
            whole.state[joint] = own.state[i];
            whole.fault_code[joint] = own.fault_code[i];
            whole.age_periods[joint] = own.age_periods[i];
            whole.position[joint] = own.position[i];
            whole.speed[joint] = own.speed[i];
            whole.current_a[joint] = own.current_a[i];
        }
        whole.inputs |= share.inputs.to_machine(own.inputs);
        for run in share.inputs.runs() {
            let (to, from, count) = (run.machine as usize, run.own as usize, run.count as usize);
            whole.input_age_periods[to..to + count]
                .copy_from_slice(&own.input_age_periods[from..from + count]);
        }
        for (own, number) in own.analog.iter().zip(&share.analog) {
            whole.analog[*number] = *own;
        }
        if share.spindle {
            whole.spindle_rad_per_s = own.spindle_rad_per_s;
            whole.spindle_angle_rad = own.spindle_angle_rad;
            whole.spindle_at_speed = own.spindle_at_speed;
        }
        if own.has_phase != 0 {
            (whole.has_phase, whole.phase_ns) = (1, own.phase_ns);
        }
        let caught = own
            .latches
            .iter()
            .fold(0, |edges, latch| edges | latch.edge);
        if caught | own.homed | u32::from(self.has_failed) != 0 {
            self.give_news(whole, latches);
        }
    }

    /// Gives what is there in few periods.
    #[cold]
    fn give_news(&self, whole: &mut Feedback, latches: &mut usize) {
        whole.homed |= self.share.joints.to_machine(u64::from(self.feedback.homed)) as u32;
        for own in self.feedback.latches.iter().filter(|latch| latch.edge != 0) {
            self.give_latch(own, whole, latches);
        }
        if self.has_failed {
            self.share
                .joints
                .pairs()
                .for_each(|(_, joint)| whole.state[joint] = JointState::Lost);
            whole.spindle_at_speed &= u32::from(!self.share.spindle);
        }
    }

    fn give_latch(&self, own: &Latch, whole: &mut Feedback, latches: &mut usize) {
        let Some(input) = self.share.inputs.machine(own.input) else {
            return;
        };
        let Some(latch) = whole.latches.get_mut(*latches) else {
            return;
        };
        let joints = self.share.joints.to_machine(u64::from(own.joints)) as u32;
        *latch = Latch {
            input,
            joints,
            ..*own
        };
        for (i, joint) in self.share.joints.pairs() {
            latch.position[joint] = own.position[i];
        }
        *latches += 1;
    }

    /// Its exchange has failed: what it knows gets older by a period. Whether it had not failed before: that is told once, and
    /// from then on its joints are lost, and those of the others are waited for.
    #[cold]
    fn is_first_failure(&mut self) -> bool {
        self.feedback
            .age_periods
            .iter_mut()
            .for_each(|age| *age = age.saturating_add(1));
        self.feedback
            .input_age_periods
            .iter_mut()
            .for_each(|age| *age = age.saturating_add(1));
        self.feedback.latches = [Latch::default(); MAX_LATCHES];
        !std::mem::replace(&mut self.has_failed, true)
    }
}

/// Several drivers that each have a part of the machine, as the one that has all of it: it sends to all, then receives from all.
///
/// Where one fails, the others go on being driven: the fine loop brings the machine to rest with them.
pub struct Composite {
    parts: Vec<Part>,
    description: DriverDescription,
    /// Number of the part whose exchange failed first.
    failed: Arc<AtomicUsize>,
    /// How many latches were handed out last.
    latches: usize,
    /// Why an exchange of this period failed; not told yet.
    failure: Option<PluginError>,
}

impl Composite {
    /// `parts`, which describe themselves together as `description`; the number of the first that fails goes to `failed`.
    pub fn new(parts: Vec<Part>, description: DriverDescription, failed: Arc<AtomicUsize>) -> Self {
        Self {
            parts,
            description,
            failed,
            latches: 0,
            failure: None,
        }
    }

    /// Begins the exchanges of all, so that they wait for their answers together. That of the first comes next, and sends by
    /// itself.
    #[inline]
    fn send_all(&mut self, setpoint: &Setpoint) {
        let Some((first, others)) = self.parts.split_first_mut() else {
            return;
        };
        let orders = has_orders(setpoint);
        for part in others {
            part.take(setpoint, orders);
            part.driver.send(&part.setpoint);
        }
        first.take(setpoint, orders);
    }

    fn forget(&mut self, feedback: &mut Feedback) {
        (feedback.homed, feedback.inputs, feedback.has_phase) = (0, 0, 0);
        for latch in &mut feedback.latches[..self.latches] {
            *latch = Latch::default();
        }
        self.latches = 0;
    }
}

impl Driver for Composite {
    fn describe(&self) -> DriverDescription {
        self.description
    }

    fn check(&self, context: &DriverContext) -> Result<(), PluginError> {
        self.parts.iter().try_for_each(|part| {
            named(part.driver.check(&part.share.context(context)), &part.title)
        })
    }

    fn open(&mut self, context: &DriverContext) -> Result<(), PluginError> {
        let open =
            |part: &mut Part| named(part.driver.open(&part.share.context(context)), &part.title);
        self.parts.iter_mut().try_for_each(open)
    }

    fn start(&mut self) -> Result<Attached, PluginError> {
        let mut attached = Attached {
            known: 0,
            homed: 0,
            ..Attached::default()
        };
        for index in 0..self.parts.len() {
            let part = &mut self.parts[index];
            part.has_failed = false;
            match named(part.driver.start(), &part.title) {
                Ok(own) => part.share.add_to(&mut attached, &own),
                Err(error) => {
                    // Why it could not start is told; what those that had started say when they stop would hide it.
                    self.parts[..index]
                        .iter_mut()
                        .rev()
                        .for_each(|part| _ = part.driver.stop());
                    return Err(error);
                }
            }
        }
        Ok(attached)
    }

    fn exchange(
        &mut self,
        setpoint: &Setpoint,
        feedback: &mut Feedback,
    ) -> Result<(), PluginError> {
        self.send_all(setpoint);
        self.forget(feedback);
        for (index, part) in self.parts.iter_mut().enumerate() {
            if let Err(error) = part.driver.exchange(&part.setpoint, &mut part.feedback)
                && part.is_first_failure()
                && self.failure.is_none()
            {
                self.failed.store(index, Relaxed);
                self.failure = Some(error);
            }
            part.give(feedback, &mut self.latches);
        }
        // An answer that was a place of its own all along would be copied to where it goes in every period.
        if self.failure.is_some() {
            self.failure.take().map_or(Ok(()), Err)
        } else {
            Ok(())
        }
    }

    fn quick_stop(&mut self) {
        self.parts
            .iter_mut()
            .for_each(|part| part.driver.quick_stop());
    }

    fn stop(&mut self) -> Result<(), PluginError> {
        let mut answer = Ok(());
        for part in &mut self.parts {
            answer = answer.and(named(part.driver.stop(), &part.title));
        }
        answer
    }

    fn explain(&self, joint: u32, code: u32) -> Words {
        let of = |part: &Part| Some(part.driver.explain(part.share.joints.own(joint)?, code));
        self.parts.iter().find_map(of).unwrap_or_default()
    }
}

/// Whether some of what is zero in most periods is not.
#[inline]
fn has_orders(setpoint: &Setpoint) -> bool {
    setpoint.reset | setpoint.homing | setpoint.limited | setpoint.arm.edge != 0
}

/// An answer whose refusal names the driver.
fn named<T>(answer: Result<T, PluginError>, title: &str) -> Result<T, PluginError> {
    answer.map_err(|error| PluginError::new(format!("{title}: {error}")))
}
