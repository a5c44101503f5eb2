//! What one driver has of the machine, and in which order it has it.

use tandem_machine::Owned;
use tandem_sdk::{Arm, Attached, AxisVector, DriverContext, MAX_AXES};

/// The part of the machine that one of several drivers has; its own numbers count from 0 in the order of the machine file.
#[derive(Clone, Debug, Default)]
pub struct Share {
    /// The machine's number of each of the driver's joints, and how many there are.
    joints: [usize; MAX_AXES],
    count: usize,
    pub inputs: Lines,
    pub outputs: Lines,
    /// The machine's number of each of the driver's analog inputs.
    pub analog: Vec<usize>,
    pub spindle: bool,
}

impl Share {
    /// What `owned` says, on a machine whose joints are called `names`. Where it names a joint that is none: that name.
    pub fn of(owned: &Owned, names: &[&str]) -> Result<Self, String> {
        let mut this = Self {
            inputs: Lines::of(&owned.inputs),
            outputs: Lines::of(&owned.outputs),
            analog: owned.analog.iter().map(|number| *number as usize).collect(),
            spindle: owned.spindle,
            ..Self::default()
        };
        for name in &owned.joints {
            let joint = names.iter().position(|other| other == name).ok_or_else(|| name.clone())?;
            let Some(entry) = this.joints.get_mut(this.count) else { return Err(name.clone()) };
            *entry = joint;
            this.count += 1;
        }
        Ok(this)
    }

    /// The machine's numbers of the driver's joints. Any loop; does not allocate.
    #[inline]
    pub fn joints(&self) -> &[usize] {
        &self.joints[..self.count]
    }

    /// The driver's number of a joint of the machine.
    pub fn own_joint(&self, joint: usize) -> Option<usize> {
        self.joints().iter().position(|own| *own == joint)
    }

    /// The driver's part of what the driver of the whole machine is told.
    pub fn context(&self, whole: &DriverContext) -> DriverContext {
        let mut context = *whole;
        context.joint_count = self.count as u32;
        context.start_position = AxisVector::ZERO;
        for (own, joint) in self.joints().iter().enumerate() {
            context.joints[own] = whole.joints[*joint];
            context.start_position[own] = whole.start_position[*joint];
        }
        context.inputs = self.inputs.to_own(whole.inputs);
        context.outputs = self.outputs.to_own(whole.outputs);
        let is_wanted = |(_, number): &(usize, &usize)| whole.analog >> **number & 1 == 1;
        context.analog = self.analog.iter().enumerate().filter(is_wanted).fold(0, |mask, (own, _)| mask | 1 << own);
        context.spindle = u32::from(self.spindle);
        context
    }

    /// Adds what the driver said of its joints to what all have said.
    pub fn add_to(&self, all: &mut Attached, own: &Attached) {
        all.known |= self.machine_bits(own.known);
        all.homed |= self.machine_bits(own.homed);
        for (i, joint) in self.joints().iter().enumerate() {
            all.position[*joint] = own.position[i];
            all.state[*joint] = own.state[i];
            all.fault_code[*joint] = own.fault_code[i];
            all.delay_periods[*joint] = own.delay_periods[i];
        }
    }

    /// Bits of the machine's joints as the driver numbers them. Any loop; does not allocate.
    #[inline]
    pub fn own_bits(&self, bits: u32) -> u32 {
        self.joints().iter().enumerate().fold(0, |own, (i, joint)| own | (bits >> joint & 1) << i)
    }

    /// Bits of the driver's joints as the machine numbers them. Any loop; does not allocate.
    #[inline]
    pub fn machine_bits(&self, own: u32) -> u32 {
        self.joints().iter().enumerate().fold(0, |bits, (i, joint)| bits | (own >> i & 1) << joint)
    }

    /// What the driver is to catch: nothing where the input is not its. Any loop; does not allocate.
    #[inline]
    pub fn own_arm(&self, arm: Arm) -> Arm {
        let input = if arm.edge == 0 { None } else { self.inputs.own(arm.input) };
        input.map_or(Arm::default(), |input| Arm { input, edge: arm.edge })
    }
}

/// Digital lines of the machine that a driver has, as runs of consecutive numbers on both sides: most have one.
#[derive(Clone, Debug, Default)]
pub struct Lines(Vec<Run>);

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Run {
    /// The machine's number of the first line.
    pub machine: u32,
    /// The driver's number of it.
    pub own: u32,
    pub count: u32,
}

impl Run {
    fn mask(self) -> u64 {
        u64::MAX >> (64 - self.count.clamp(1, 64))
    }
}

impl Lines {
    /// The lines with these numbers of the machine, in the driver's order.
    pub fn of(numbers: &[u32]) -> Self {
        let mut runs: Vec<Run> = vec![];
        for (own, machine) in (0..).zip(numbers.iter().copied()) {
            match runs.last_mut().filter(|run| run.machine + run.count == machine) {
                Some(run) => run.count += 1,
                None => runs.push(Run { machine, own, count: 1 }),
            }
        }
        Self(runs)
    }

    /// The runs. Any loop; does not allocate.
    #[inline]
    pub fn runs(&self) -> &[Run] {
        &self.0
    }

    /// Bits of the machine as the driver numbers them. Any loop; does not allocate.
    #[inline]
    pub fn to_own(&self, bits: u64) -> u64 {
        self.0.iter().fold(0, |own, run| own | (bits >> run.machine & run.mask()) << run.own)
    }

    /// Bits of the driver as the machine numbers them. Any loop; does not allocate.
    #[inline]
    pub fn to_machine(&self, own: u64) -> u64 {
        self.0.iter().fold(0, |bits, run| bits | (own >> run.own & run.mask()) << run.machine)
    }

    /// The driver's number of a line of the machine. Any loop; does not allocate.
    pub fn own(&self, machine: u32) -> Option<u32> {
        let run = self.0.iter().find(|run| (run.machine..run.machine + run.count).contains(&machine))?;
        Some(run.own + (machine - run.machine))
    }

    /// The machine's number of a line of the driver. Any loop; does not allocate.
    pub fn machine(&self, own: u32) -> Option<u32> {
        let run = self.0.iter().find(|run| (run.own..run.own + run.count).contains(&own))?;
        Some(run.machine + (own - run.own))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_keep_the_order_of_the_driver() {
        let lines = Lines::of(&[8, 9, 10, 3, 63]);
        assert_eq!(lines.runs().len(), 3);
        assert_eq!(lines.to_own(1 << 9 | 1 << 3 | 1 << 63 | 1 << 4), 0b11010);
        assert_eq!(lines.to_machine(0b11010 | 1 << 7), 1 << 9 | 1 << 3 | 1 << 63);
        assert_eq!((lines.own(3), lines.own(4), lines.machine(4), lines.machine(5)), (Some(3), None, Some(63), None));
        let all: Vec<u32> = (0..64).collect();
        let all = Lines::of(&all);
        assert_eq!((all.runs().len(), all.to_own(u64::MAX), all.to_machine(u64::MAX)), (1, u64::MAX, u64::MAX));
        assert_eq!(Lines::default().to_machine(u64::MAX), 0);
    }
}
