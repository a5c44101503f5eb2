//! What one driver has of the machine, and in which order it has it.

use tandem_machine::Owned;
use tandem_sdk::{Arm, Attached, AxisVector, DriverContext, MAX_AXES};

/// The part of the machine that one of several drivers has; its own numbers count from 0 in the order of the machine file.
#[derive(Clone, Debug, Default)]
pub struct Share {
    /// At most [`MAX_AXES`].
    pub joints: Numbers,
    pub inputs: Numbers,
    pub outputs: Numbers,
    /// The machine's number of each of the driver's analog inputs.
    pub analog: Vec<usize>,
    pub spindle: bool,
}

impl Share {
    /// What `owned` says, on a machine whose joints are called `names`. Where it names a joint that is none: that name.
    pub fn of(owned: &Owned, names: &[&str]) -> Result<Self, String> {
        let number = |name: &String| {
            names
                .iter()
                .position(|other| other == name)
                .map(|joint| joint as u32)
        };
        let joints: Result<Vec<u32>, String> = owned
            .joints
            .iter()
            .map(|name| number(name).ok_or_else(|| name.clone()))
            .collect();
        if let Some(beyond) = owned.joints.get(MAX_AXES) {
            return Err(beyond.clone());
        }
        Ok(Self {
            joints: Numbers::of(&joints?),
            inputs: Numbers::of(&owned.inputs),
            outputs: Numbers::of(&owned.outputs),
            analog: owned.analog.iter().map(|number| *number as usize).collect(),
            spindle: owned.spindle,
        })
    }

    /// The driver's part of what the driver of the whole machine is told.
    pub fn context(&self, whole: &DriverContext) -> DriverContext {
        let mut context = *whole;
        context.joint_count = self.joints.pairs().count() as u32;
        context.start_position = AxisVector::ZERO;
        for (own, joint) in self.joints.pairs() {
            context.joints[own] = whole.joints[joint];
            context.start_position[own] = whole.start_position[joint];
        }
        context.inputs = self.inputs.to_own(whole.inputs);
        context.outputs = self.outputs.to_own(whole.outputs);
        let is_wanted = |(_, number): &(usize, &usize)| whole.analog >> **number & 1 == 1;
        context.analog = self
            .analog
            .iter()
            .enumerate()
            .filter(is_wanted)
            .fold(0, |mask, (own, _)| mask | 1 << own);
        context.spindle = u32::from(self.spindle);
        context
    }

    /// Adds what the driver said of its joints to what all have said.
    pub fn add_to(&self, all: &mut Attached, own: &Attached) {
        all.known |= self.joints.to_machine(u64::from(own.known)) as u32;
        all.homed |= self.joints.to_machine(u64::from(own.homed)) as u32;
        for (i, joint) in self.joints.pairs() {
            all.position[joint] = own.position[i];
            all.state[joint] = own.state[i];
            all.fault_code[joint] = own.fault_code[i];
            all.delay_periods[joint] = own.delay_periods[i];
        }
    }

    /// What the driver is to catch: nothing where the input is not its. Any loop; does not allocate.
    #[inline]
    pub fn own_arm(&self, arm: Arm) -> Arm {
        let input = if arm.edge == 0 {
            None
        } else {
            self.inputs.own(arm.input)
        };
        input.map_or(Arm::default(), |input| Arm {
            input,
            edge: arm.edge,
        })
    }
}

/// The machine's numbers of the joints or digital lines that a driver has, in its order, as runs of consecutive numbers on both
/// sides: most have one.
#[derive(Clone, Debug, Default)]
pub struct Numbers(Vec<Run>);

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Run {
    /// The machine's number of the first of them.
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

impl Numbers {
    /// These numbers of the machine, in the driver's order; all are below 64.
    pub fn of(numbers: &[u32]) -> Self {
        let mut runs: Vec<Run> = vec![];
        for (own, machine) in (0..).zip(numbers.iter().copied()) {
            match runs
                .last_mut()
                .filter(|run| run.machine + run.count == machine)
            {
                Some(run) => run.count += 1,
                None => runs.push(Run {
                    machine,
                    own,
                    count: 1,
                }),
            }
        }
        Self(runs)
    }

    /// The runs. Any loop; does not allocate.
    #[inline]
    pub fn runs(&self) -> &[Run] {
        &self.0
    }

    /// Each of them as the driver and as the machine numbers it, in the driver's order. Does not allocate.
    pub fn pairs(&self) -> impl Iterator<Item = (usize, usize)> {
        self.0.iter().flat_map(|run| {
            (0..run.count).map(|i| ((run.own + i) as usize, (run.machine + i) as usize))
        })
    }

    /// Bits of the machine as the driver numbers them. Any loop; does not allocate.
    #[inline]
    pub fn to_own(&self, bits: u64) -> u64 {
        self.0.iter().fold(0, |own, run| {
            own | (bits >> run.machine & run.mask()) << run.own
        })
    }

    /// Bits of the driver as the machine numbers them. Any loop; does not allocate.
    #[inline]
    pub fn to_machine(&self, own: u64) -> u64 {
        self.0.iter().fold(0, |bits, run| {
            bits | (own >> run.own & run.mask()) << run.machine
        })
    }

    /// The driver's number of one of the machine's. Any loop; does not allocate.
    pub fn own(&self, machine: u32) -> Option<u32> {
        let run = self
            .0
            .iter()
            .find(|run| (run.machine..run.machine + run.count).contains(&machine))?;
        Some(run.own + (machine - run.machine))
    }

    /// The machine's number of one of the driver's. Any loop; does not allocate.
    pub fn machine(&self, own: u32) -> Option<u32> {
        let run = self
            .0
            .iter()
            .find(|run| (run.own..run.own + run.count).contains(&own))?;
        Some(run.machine + (own - run.own))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_keep_the_order_of_the_driver() {
        let numbers = Numbers::of(&[8, 9, 10, 3, 63]);
        assert_eq!(numbers.runs().len(), 3);
        assert_eq!(numbers.to_own(1 << 9 | 1 << 3 | 1 << 63 | 1 << 4), 0b11010);
        assert_eq!(
            numbers.to_machine(0b11010 | 1 << 7),
            1 << 9 | 1 << 3 | 1 << 63
        );
        assert_eq!(
            (
                numbers.own(3),
                numbers.own(4),
                numbers.machine(4),
                numbers.machine(5)
            ),
            (Some(3), None, Some(63), None)
        );
        let all: Vec<u32> = (0..64).collect();
        let all = Numbers::of(&all);
        assert_eq!(
            (
                all.runs().len(),
                all.to_own(u64::MAX),
                all.to_machine(u64::MAX)
            ),
            (1, u64::MAX, u64::MAX)
        );
        assert_eq!(Numbers::default().to_machine(u64::MAX), 0);
    }

    #[test]
    fn a_driver_is_told_of_its_own_joints_in_its_own_order() {
        let owned = Owned {
            joints: vec!["u".into(), "x".into()],
            ..Owned::default()
        };
        let share = Share::of(&owned, &["x", "y", "z", "u"]).unwrap();
        let mut whole = DriverContext::new(4, 0.001);
        whole.start_position = AxisVector::from_slice(&[1.0, 2.0, 3.0, 4.0]);
        let own = share.context(&whole);
        assert_eq!(
            (own.joint_count, own.start_position),
            (2, AxisVector::from_slice(&[4.0, 1.0]))
        );
        let beyond = Owned {
            joints: vec!["x".into(); MAX_AXES + 1],
            ..Owned::default()
        };
        assert_eq!(Share::of(&beyond, &["x"]).unwrap_err(), "x");
        let none = Owned {
            joints: vec!["w".into()],
            ..Owned::default()
        };
        assert_eq!(Share::of(&none, &["x"]).unwrap_err(), "w");
    }
}
