//! Several drivers as one.

use std::sync::Arc;
use std::sync::atomic::AtomicUsize;
use std::sync::atomic::Ordering::Relaxed;

use tandem_sdk::{
    Attached, Driver, DriverContext, DriverDescription, Feedback, JointState, Latch, MAX_LATCHES, PluginError,
    Setpoint, Words,
};

use super::share::Share;

/// One of the drivers, with what it is told and what it answers, in its own numbers.
pub struct Part {
    driver: Box<dyn Driver>,
    share: Share,
    title: String,
    setpoint: Setpoint,
    feedback: Feedback,
    /// Its exchange has failed since the drives were last reset: nothing is known of its joints.
    has_failed: bool,
}

impl Part {
    /// `driver` for its `share` of the machine.
    pub fn new(driver: Box<dyn Driver>, share: Share, title: String) -> Self {
        let (setpoint, feedback) = (Setpoint::default(), Feedback::default());
        Self { driver, share, title, setpoint, feedback, has_failed: false }
    }

    /// Takes its part of what the machine is told.
    #[inline]
    fn take(&mut self, whole: &Setpoint) {
        let own = &mut self.setpoint;
        (own.enable, own.reset, own.tick) = (whole.enable, whole.reset, whole.tick);
        own.homing = if whole.homing == 0 { 0 } else { self.share.own_bits(whole.homing) };
        own.limited = if whole.limited == 0 { 0 } else { self.share.own_bits(whole.limited) };
        own.outputs = self.share.outputs.to_own(whole.outputs);
        own.arm = self.share.own_arm(whole.arm);
        for (i, joint) in self.share.joints().iter().enumerate() {
            own.position[i] = whole.position[*joint];
            own.velocity[i] = whole.velocity[*joint];
            own.acceleration[i] = whole.acceleration[*joint];
        }
        own.spindle_rad_per_s = if self.share.spindle { whole.spindle_rad_per_s } else { 0.0 };
        self.has_failed &= whole.reset == 0;
    }

    /// Adds its answer to that of the machine; `latches` have been filled before it.
    #[inline]
    fn give(&self, whole: &mut Feedback, latches: &mut usize) {
        let own = &self.feedback;
        for (i, joint) in self.share.joints().iter().enumerate() {
            whole.state[*joint] = if self.has_failed { JointState::Lost } else { own.state[i] };
            whole.fault_code[*joint] = own.fault_code[i];
            whole.age_periods[*joint] = own.age_periods[i];
            whole.position[*joint] = own.position[i];
            whole.speed[*joint] = own.speed[i];
            whole.current_a[*joint] = own.current_a[i];
        }
        if own.homed != 0 {
            whole.homed |= self.share.machine_bits(own.homed);
        }
        whole.inputs |= self.share.inputs.to_machine(own.inputs);
        for run in self.share.inputs.runs() {
            let (to, from, count) = (run.machine as usize, run.own as usize, run.count as usize);
            whole.input_age_periods[to..to + count].copy_from_slice(&own.input_age_periods[from..from + count]);
        }
        for (own, number) in own.analog.iter().zip(&self.share.analog) {
            whole.analog[*number] = *own;
        }
        for latch in own.latches.iter().filter(|latch| latch.edge != 0) {
            self.give_latch(latch, whole, latches);
        }
        if self.share.spindle {
            whole.spindle_rad_per_s = own.spindle_rad_per_s;
            whole.spindle_angle_rad = own.spindle_angle_rad;
            whole.spindle_at_speed = if self.has_failed { 0 } else { own.spindle_at_speed };
        }
        if own.has_phase != 0 {
            (whole.has_phase, whole.phase_ns) = (1, own.phase_ns);
        }
    }

    fn give_latch(&self, own: &Latch, whole: &mut Feedback, latches: &mut usize) {
        let Some(input) = self.share.inputs.machine(own.input) else { return };
        let Some(latch) = whole.latches.get_mut(*latches) else { return };
        *latch = Latch { input, joints: self.share.machine_bits(own.joints), ..*own };
        for (i, joint) in self.share.joints().iter().enumerate() {
            latch.position[*joint] = own.position[i];
        }
        *latches += 1;
    }

    /// What it knows gets older by a period: its exchange has failed.
    fn grow_old(&mut self) {
        self.feedback.age_periods.iter_mut().for_each(|age| *age = age.saturating_add(1));
        self.feedback.input_age_periods.iter_mut().for_each(|age| *age = age.saturating_add(1));
        self.feedback.latches = [Latch::default(); MAX_LATCHES];
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
}

impl Composite {
    /// `parts`, which describe themselves together as `description`; the number of the first that fails goes to `failed`.
    pub fn new(parts: Vec<Part>, description: DriverDescription, failed: Arc<AtomicUsize>) -> Self {
        Self { parts, description, failed, latches: 0 }
    }

    fn send_all(&mut self, setpoint: &Setpoint) {
        for part in &mut self.parts {
            part.take(setpoint);
            part.driver.send(&part.setpoint);
        }
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
        self.parts.iter().try_for_each(|part| named(part.driver.check(&part.share.context(context)), &part.title))
    }

    fn open(&mut self, context: &DriverContext) -> Result<(), PluginError> {
        let open = |part: &mut Part| named(part.driver.open(&part.share.context(context)), &part.title);
        self.parts.iter_mut().try_for_each(open)
    }

    fn start(&mut self) -> Result<Attached, PluginError> {
        let mut attached = Attached { known: 0, homed: 0, ..Attached::default() };
        for index in 0..self.parts.len() {
            let part = &mut self.parts[index];
            part.has_failed = false;
            match named(part.driver.start(), &part.title) {
                Ok(own) => part.share.add_to(&mut attached, &own),
                Err(error) => {
                    // Why it could not start is told; what those that had started say when they stop would hide it.
                    self.parts[..index].iter_mut().rev().for_each(|part| _ = part.driver.stop());
                    return Err(error);
                }
            }
        }
        Ok(attached)
    }

    fn exchange(&mut self, setpoint: &Setpoint, feedback: &mut Feedback) -> Result<(), PluginError> {
        self.send_all(setpoint);
        self.forget(feedback);
        let mut answer = Ok(());
        for (index, part) in self.parts.iter_mut().enumerate() {
            if let Err(error) = part.driver.exchange(&part.setpoint, &mut part.feedback) {
                part.grow_old();
                // Told once: from then on its joints are lost, and those of the others are waited for.
                if !part.has_failed && answer.is_ok() {
                    self.failed.store(index, Relaxed);
                    answer = Err(error);
                }
                part.has_failed = true;
            }
            part.give(feedback, &mut self.latches);
        }
        answer
    }

    fn quick_stop(&mut self) {
        self.parts.iter_mut().for_each(|part| part.driver.quick_stop());
    }

    fn stop(&mut self) -> Result<(), PluginError> {
        let mut answer = Ok(());
        for part in &mut self.parts {
            answer = answer.and(named(part.driver.stop(), &part.title));
        }
        answer
    }

    fn explain(&self, joint: u32, code: u32) -> Words {
        let of = |part: &Part| Some(part.driver.explain(part.share.own_joint(joint as usize)? as u32, code));
        self.parts.iter().find_map(of).unwrap_or_default()
    }
}

/// An answer whose refusal names the driver.
fn named<T>(answer: Result<T, PluginError>, title: &str) -> Result<T, PluginError> {
    answer.map_err(|error| PluginError::new(format!("{title}: {error}")))
}
