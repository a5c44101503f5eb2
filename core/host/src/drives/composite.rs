//! Several drivers as one.

use std::sync::Arc;
use std::sync::atomic::AtomicUsize;
use std::sync::atomic::Ordering::Relaxed;

use tandem_sdk::{
    Attached, AxisVector, Driver, DriverContext, DriverDescription, Feedback, JointState, Latch,
    MAX_AXES, MAX_LATCHES, PluginError, Setpoint, Words,
};

use super::share::Share;

/// The machine's number of each of a driver's joints.
struct Joints {
    machine: [u8; MAX_AXES],
    count: usize,
    /// They follow each other on the machine, as most do, from this one on.
    first: Option<usize>,
}

impl Joints {
    fn of(share: &Share) -> Self {
        let first = match share.joints.runs() {
            [run] => Some(run.machine as usize),
            _ => None,
        };
        let mut this = Self {
            machine: [0; MAX_AXES],
            count: 0,
            first,
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
    /// Among the drivers, from 0.
    number: usize,
    driver: Box<dyn Driver>,
    share: Share,
    joints: Joints,
    title: String,
    setpoint: Setpoint,
    feedback: Feedback,
    /// It has inputs or analog values.
    measures: bool,
    /// It begins its exchanges before those of others, as far as is known.
    sends: bool,
    /// Its exchange has failed since the drives were last reset: nothing is known of its joints.
    has_failed: bool,
}

impl Part {
    /// `driver` for its `share` of the machine.
    pub fn new(driver: Box<dyn Driver>, share: Share, title: String) -> Self {
        let (setpoint, feedback) = (Setpoint::default(), Feedback::default());
        Self {
            number: 0,
            joints: Joints::of(&share),
            measures: !(share.inputs.runs().is_empty() && share.analog.is_empty()),
            driver,
            share,
            title,
            setpoint,
            feedback,
            sends: true,
            has_failed: false,
        }
    }

    /// Takes its part of what the machine is told in every period.
    #[inline]
    fn take(&mut self, whole: &Setpoint) {
        let own = &mut self.setpoint;
        own.tick = whole.tick;
        // As many at once as are known when this is compiled: what the drives read of it joint by joint is at hand all the same.
        match (self.joints.first, self.joints.count) {
            (Some(first), 1) => return take_run::<1>(first, whole, own),
            (Some(first), 2) => return take_run::<2>(first, whole, own),
            (Some(first), 3) => return take_run::<3>(first, whole, own),
            (Some(first), 4) => return take_run::<4>(first, whole, own),
            _ => {}
        }
        for (i, joint) in self.joints.iter() {
            own.position[i] = whole.position[joint];
            own.velocity[i] = whole.velocity[joint];
            own.acceleration[i] = whole.acceleration[joint];
        }
    }

    /// Takes what is the same in most periods.
    fn take_orders(&mut self, whole: &Setpoint) {
        let share = &self.share;
        let own = &mut self.setpoint;
        own.enable = whole.enable;
        own.outputs = share.outputs.to_own(whole.outputs);
        if share.spindle {
            own.spindle_rad_per_s = whole.spindle_rad_per_s;
        }
        own.reset = whole.reset;
        own.homing = share.joints.to_own(u64::from(whole.homing)) as u32;
        own.limited = share.joints.to_own(u64::from(whole.limited)) as u32;
        own.arm = share.own_arm(whole.arm);
        self.has_failed &= whole.reset == 0;
    }

    /// Adds its answer to that of the machine; `latches` have been filled before it.
    #[inline]
    fn give(&self, whole: &mut Feedback, latches: &mut usize) {
        let share = &self.share;
        let own = &self.feedback;
        for (i, joint) in self.joints.iter() {
            whole.state[joint] = own.state[i];
            whole.fault_code[joint] = own.fault_code[i];
            whole.age_periods[joint] = own.age_periods[i];
            whole.position[joint] = own.position[i];
            whole.speed[joint] = own.speed[i];
            whole.current_a[joint] = own.current_a[i];
        }
        if self.measures {
            self.give_measured(whole);
        }
        if share.spindle {
            whole.spindle_rad_per_s = own.spindle_rad_per_s;
            whole.spindle_angle_rad = own.spindle_angle_rad;
            whole.spindle_at_speed = own.spindle_at_speed;
        }
        if own.has_phase != 0 {
            whole.has_phase = 1;
            whole.phase_ns = own.phase_ns;
        }
        let caught = own
            .latches
            .iter()
            .fold(0, |edges, latch| edges | latch.edge);
        if caught | own.homed | u32::from(self.has_failed) != 0 {
            self.give_news(whole, latches);
        }
    }

    fn give_measured(&self, whole: &mut Feedback) {
        let share = &self.share;
        let own = &self.feedback;
        whole.inputs |= share.inputs.to_machine(own.inputs);
        for run in share.inputs.runs() {
            let (to, from, count) = (run.machine as usize, run.own as usize, run.count as usize);
            whole.input_age_periods[to..to + count]
                .copy_from_slice(&own.input_age_periods[from..from + count]);
        }
        for (own, number) in own.analog.iter().zip(&share.analog) {
            whole.analog[*number] = *own;
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

    /// Its exchange has failed: what it knows gets older by a period. Where it had not failed before, that is told once, by who
    /// is the first of a period; from then on its joints are lost, and those of the others are waited for.
    #[cold]
    #[inline(never)]
    fn fail(&mut self, error: PluginError, told: &mut Option<PluginError>, first: &AtomicUsize) {
        self.feedback
            .age_periods
            .iter_mut()
            .for_each(|age| *age = age.saturating_add(1));
        self.feedback
            .input_age_periods
            .iter_mut()
            .for_each(|age| *age = age.saturating_add(1));
        self.feedback.latches = [Latch::default(); MAX_LATCHES];
        if !std::mem::replace(&mut self.has_failed, true) && told.is_none() {
            first.store(self.number, Relaxed);
            *told = Some(error);
        }
    }
}

/// What is the same in most periods of what a machine is told.
#[derive(Default)]
struct Orders {
    enable: u32,
    outputs: u64,
    spindle_bits: u64,
    /// What lasts for few periods, whatever it says.
    passing: u32,
}

impl Orders {
    #[inline]
    fn of(setpoint: &Setpoint) -> Self {
        Self {
            enable: setpoint.enable,
            outputs: setpoint.outputs,
            spindle_bits: setpoint.spindle_rad_per_s.to_bits(),
            passing: setpoint.reset | setpoint.homing | setpoint.limited | setpoint.arm.edge,
        }
    }

    /// Whether the drivers are to be told: what passes is told in each of its periods, and once when it is over.
    #[inline]
    fn differ(&self, before: &Self) -> bool {
        let changed = (self.outputs ^ before.outputs)
            | (self.spindle_bits ^ before.spindle_bits)
            | u64::from((self.enable ^ before.enable) | self.passing | before.passing);
        changed != 0
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
    /// Some driver but the first begins its exchanges before those of others, as far as is known.
    any_sends: bool,
    /// What the drivers were told last of what is the same in most periods.
    orders: Orders,
    /// How many latches were handed out last.
    latches: usize,
    /// Why an exchange of this period failed; not told yet.
    failure: Option<PluginError>,
}

impl Composite {
    /// `parts`, which describe themselves together as `description`; the number of the first that fails goes to `failed`.
    pub fn new(
        mut parts: Vec<Part>,
        description: DriverDescription,
        failed: Arc<AtomicUsize>,
    ) -> Self {
        for (number, part) in parts.iter_mut().enumerate() {
            part.number = number;
        }
        Self {
            parts,
            description,
            failed,
            any_sends: true,
            orders: Orders::default(),
            latches: 0,
            failure: None,
        }
    }

    /// Tells each what is its, and those that send beforehand do so.
    #[inline]
    fn tell_all(&mut self, setpoint: &Setpoint) {
        for part in &mut self.parts {
            part.take(setpoint);
        }
        let orders = Orders::of(setpoint);
        if orders.differ(&self.orders) {
            self.order_all(setpoint, orders);
        }
        if self.any_sends {
            self.send_all();
        }
    }

    #[cold]
    #[inline(never)]
    fn order_all(&mut self, setpoint: &Setpoint, orders: Orders) {
        self.parts
            .iter_mut()
            .for_each(|part| part.take_orders(setpoint));
        self.orders = orders;
    }

    /// Begins the exchanges, so that the drivers wait for their answers together. That of the first comes next, and sends by
    /// itself.
    #[inline(never)]
    fn send_all(&mut self) {
        self.any_sends = false;
        for part in self.parts.iter_mut().skip(1).filter(|part| part.sends) {
            part.sends = part.driver.send(&part.setpoint);
            self.any_sends |= part.sends;
        }
    }

    #[inline]
    fn forget(&mut self, feedback: &mut Feedback) {
        feedback.homed = 0;
        feedback.inputs = 0;
        feedback.has_phase = 0;
        if self.latches > 0 {
            self.forget_latches(feedback);
        }
    }

    #[cold]
    #[inline(never)]
    fn forget_latches(&mut self, feedback: &mut Feedback) {
        feedback.latches.fill(Latch::default());
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
        let mut attached = Attached::counting_from_power_on(AxisVector::ZERO);
        for index in 0..self.parts.len() {
            let part = &mut self.parts[index];
            part.has_failed = false;
            part.sends = true;
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
        self.any_sends = true;
        Ok(attached)
    }

    fn exchange(
        &mut self,
        setpoint: &Setpoint,
        feedback: &mut Feedback,
    ) -> Result<(), PluginError> {
        self.tell_all(setpoint);
        self.forget(feedback);
        for part in &mut self.parts {
            if let Err(error) = part.driver.exchange(&part.setpoint, &mut part.feedback) {
                part.fail(error, &mut self.failure, &self.failed);
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

/// Takes what `N` joints are told that follow each other on the machine, from `first` on.
#[inline]
fn take_run<const N: usize>(first: usize, whole: &Setpoint, own: &mut Setpoint) {
    let from = first.min(MAX_AXES - N);
    own.position.0[..N].copy_from_slice(&whole.position.0[from..from + N]);
    own.velocity.0[..N].copy_from_slice(&whole.velocity.0[from..from + N]);
    own.acceleration.0[..N].copy_from_slice(&whole.acceleration.0[from..from + N]);
}

/// An answer whose refusal names the driver.
fn named<T>(answer: Result<T, PluginError>, title: &str) -> Result<T, PluginError> {
    answer.map_err(|error| PluginError::new(format!("{title}: {error}")))
}
