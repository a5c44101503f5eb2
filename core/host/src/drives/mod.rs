//! The drivers of a machine: each with its part of it, and all of them as the one that the fine loop calls.

mod at_rest;
mod composite;
mod no_driver;
mod roster;
mod share;
mod slow;

use tandem_machine::{AxisHoming, DriverChoice, Machine};
use tandem_sdk::{Attached, AxisVector, Driver, DriverContext, Name, PluginError, Words};

use crate::error::{HostError, refusal};
use crate::joints::JointSpace;
use crate::plugins::registry::{PluginRefusal, Registry};
use at_rest::AtRest;
use composite::{Composite, Part};
pub(crate) use no_driver::NoDriver;
pub use roster::{Entry, Roster};
use share::Share;
use slow::Slow;

/// A driver, made and not open yet.
struct UnopenedDriver {
    driver: Box<dyn Driver>,
    title: String,
    section: String,
    /// What it has of the machine; none where it has everything.
    share: Option<Share>,
}

/// The drivers of a machine.
pub struct Drives {
    all: Vec<UnopenedDriver>,
    roster: Roster,
}

impl Drives {
    /// Makes the drivers that the machine asks for; none is open yet. Host; allocates.
    ///
    /// # Errors
    /// One is not there, refuses its options, or names a joint that is none; two pace the loop.
    pub fn of(
        machine: &Machine,
        registry: &Registry,
        joints: &JointSpace,
    ) -> Result<Self, HostError> {
        let all: Vec<UnopenedDriver> = machine
            .drivers
            .iter()
            .map(|choice| made(machine, registry, joints, choice))
            .collect::<Result<_, _>>()?;
        let mut entries = all.iter().map(entry);
        let first = entries
            .next()
            .ok_or_else(|| refusal(machine, "drivers", "a machine has at least one driver"))?;
        let roster = Roster::new(first, entries.collect());
        if let [first, second, ..] = &roster.with_phase()[..] {
            let cause = format!(
                "the exchange of {} has a phase of its own, as that of {} has: the loop can follow one of them only",
                second.title, first.title
            );
            return Err(refusal(machine, &second.section, cause));
        }
        let mut drives = vec![];
        let mut roster = roster;
        for made in all {
            drives.push(made.behind_slots(machine, &mut roster)?);
        }
        Ok(Self {
            all: drives,
            roster,
        })
    }

    /// Who is who.
    pub fn roster(&self) -> Roster {
        self.roster.clone()
    }

    /// Whether the drives could be claimed, as far as that can be told without them. Nothing is touched. Host; may allocate.
    ///
    /// # Errors
    /// What a driver refuses, with its place in the machine file.
    pub fn check(&self, machine: &Machine, joints: &JointSpace) -> Result<(), HostError> {
        let whole = driver_context(machine, joints);
        let known = joints.health(&whole.start_position);
        known.map_err(|e| refusal(machine, "kinematics.plugin", e.to_string()))?;
        let check = |made: &UnopenedDriver| {
            made.driver
                .check(&made.context(&whole))
                .map_err(|e| made.refuses(machine, &e))
        };
        self.all.iter().try_for_each(check)
    }

    /// Claims the drives: where all joints stand. Where one driver cannot start, those that have started are stopped. In
    /// `real_time` a simulated bus takes the time that it takes. Host; may allocate.
    ///
    /// # Errors
    /// Why the drives cannot be reached, with the place of their driver in the machine file.
    pub fn open(
        &mut self,
        machine: &Machine,
        joints: &JointSpace,
        real_time: bool,
    ) -> Result<Attached, HostError> {
        let whole = DriverContext {
            real_time: u32::from(real_time),
            ..driver_context(machine, joints)
        };
        for made in &mut self.all {
            let context = made.context(&whole);
            made.driver
                .open(&context)
                .map_err(|e| made.refuses(machine, &e))?;
        }
        let mut attached = Attached::counting_from_power_on(AxisVector::ZERO);
        for index in 0..self.all.len() {
            let started = self.all[index].driver.start();
            match started {
                Ok(own) => self.all[index].add_to(&mut attached, &own),
                Err(error) => {
                    // Why it could not start is told; what those that had started say when they stop would hide it.
                    self.all[..index]
                        .iter_mut()
                        .rev()
                        .for_each(|made| _ = made.driver.stop());
                    return Err(self.all[index].refuses(machine, &error));
                }
            }
        }
        Ok(attached)
    }

    /// Lets go of all drives. Host; may allocate.
    ///
    /// # Errors
    /// What could not be released first, and by whom.
    pub fn stop(&mut self) -> Result<(), PluginError> {
        let mut answer = Ok(());
        for made in &mut self.all {
            answer = answer.and(made.driver.stop());
        }
        answer
    }

    /// What a code of the drive of `joint` means. Host; may allocate.
    pub fn explain(&self, joint: usize, code: u32) -> Words {
        let of = |made: &UnopenedDriver| match &made.share {
            Some(share) => share
                .joints
                .own(joint as u32)
                .map(|own| made.driver.explain(own, code)),
            None => Some(made.driver.explain(joint as u32, code)),
        };
        self.all.iter().find_map(of).unwrap_or_default()
    }

    /// The one driver that the fine loop calls. What its drives are told and answer is mapped from here on.
    pub fn into_driver(self) -> Box<dyn Driver> {
        let failed = self.roster.failed.clone();
        let mut parts = vec![];
        for made in self.all {
            match made.share {
                Some(share) => parts.push(Part::new(made.driver, share, made.title)),
                // It has everything: nobody stands beside it.
                None => return made.driver,
            }
        }
        Box::new(Composite::new(parts, self.roster.describe(), failed))
    }
}

/// The drivers of a machine as the fine loop has them: made, open and started, and put together. For tests and benches of what
/// the fine loop calls. Host; allocates.
///
/// # Errors
/// What refuses a run too.
pub fn attached_driver(
    machine: &Machine,
    registry: &Registry,
) -> Result<(Box<dyn Driver>, Attached), HostError> {
    let joints = JointSpace::of(machine, registry)?;
    let mut drives = Drives::of(machine, registry, &joints)?;
    let attached = drives.open(machine, &joints, false)?;
    Ok((drives.into_driver(), attached))
}

fn made(
    machine: &Machine,
    registry: &Registry,
    joints: &JointSpace,
    choice: &DriverChoice,
) -> Result<UnopenedDriver, HostError> {
    let section = choice.section();
    let driver = registry
        .driver(&choice.choice)
        .map_err(|e| e.at(machine, &section))?;
    let share = match &choice.owns {
        Some(owned) => {
            let names: Vec<_> = (0..joints.count())
                .map(|joint| joints.name(joint))
                .collect();
            let none = |name: String| {
                let cause = format!(
                    "no joint is called \"{name}\"; the machine has {}",
                    names.join(", ")
                );
                refusal(machine, &format!("{section}.joints"), cause)
            };
            Some(Share::of(owned, &names).map_err(none)?)
        }
        None => None,
    };
    let levels = share.as_ref().map_or(choice.inputs_at_rest, |share| {
        share.inputs.to_own(choice.inputs_at_rest)
    });
    let driver = if levels == 0 {
        driver
    } else {
        Box::new(AtRest { driver, levels })
    };
    Ok(UnopenedDriver {
        driver,
        title: choice.title(),
        section,
        share,
    })
}

fn entry(made: &UnopenedDriver) -> Entry {
    Entry {
        title: made.title.clone(),
        section: made.section.clone(),
        description: made.driver.describe(),
        joints: made
            .share
            .as_ref()
            .map(|share| share.joints.pairs().map(|(_, joint)| joint).collect()),
        spindle: made.share.as_ref().is_none_or(|share| share.spindle),
    }
}

impl UnopenedDriver {
    fn context(&self, whole: &DriverContext) -> DriverContext {
        self.share
            .as_ref()
            .map_or(*whole, |share| share.context(whole))
    }

    /// Adds what this driver said of its joints to what all have said.
    fn add_to(&self, all: &mut Attached, own: &Attached) {
        match &self.share {
            Some(share) => share.add_to(all, own),
            None => *all = *own,
        }
    }

    /// The driver as it is, or behind slots where its device is slow. A joint needs a setpoint in every fine period, so a slow
    /// device moves none.
    fn behind_slots(self, machine: &Machine, roster: &mut Roster) -> Result<Self, HostError> {
        if self.driver.describe().slow == 0 {
            return Ok(self);
        }
        if self
            .share
            .as_ref()
            .is_none_or(|share| !share.joints.runs().is_empty())
        {
            let cause = format!(
                "driver {} takes longer than a fine period to answer: it can move no joint",
                self.title
            );
            return Err(refusal(machine, &self.section, cause));
        }
        let slow = Slow::new(self.driver, machine.spindle.at_speed_within_s);
        roster.slow.push(slow.switch());
        Ok(Self {
            driver: Box::new(slow),
            ..self
        })
    }

    fn refuses(&self, machine: &Machine, error: &PluginError) -> HostError {
        let cause = format!("driver {}: {}", self.title, error.message());
        let option = error.option().map(str::to_string);
        PluginRefusal { option, cause }.at(machine, &self.section)
    }
}

/// What a driver is told that has the whole machine.
pub fn driver_context(machine: &Machine, joints: &JointSpace) -> DriverContext {
    let mut context = DriverContext::new(joints.count(), machine.fine_period_s);
    context.start_position = joints.to_joints(&machine.start);
    for (described, joint) in context.joints.iter_mut().zip(&joints.joints) {
        described.name = Name::new(&joint.name);
        described.rotary = u32::from(joint.rotary);
        described.limits = joint.limits;
    }
    let bit = |input: u32| 1_u64 << input.min(63);
    context.inputs = machine.probe.map_or(0, |probe| bit(probe.input));
    context.inputs |= machine
        .homing
        .iter()
        .filter_map(AxisHoming::switch)
        .flat_map(|switch| [Some(switch.input), switch.index.map(|index| index.input)])
        .flatten()
        .fold(0, |mask, input| mask | bit(input));
    for homing in machine.homing.iter().filter(|_| joints.are_axes()) {
        context.joints[homing.axis].homing_method = homing.drive().map_or(0, |drive| drive.method);
        context.joints[homing.axis].homing_torque_percent =
            homing.max_torque_percent.unwrap_or(f64::INFINITY);
    }
    context.inputs |= machine
        .inputs
        .iter()
        .fold(0, |mask, named| mask | bit(named.input));
    context.analog = machine
        .analog
        .iter()
        .fold(0, |mask, analog| mask | 1 << analog.input);
    context.outputs = u64::MAX;
    context.spindle = 1;
    context
}
