//! What a fault does to an exchange.

use tandem_sdk::{AxisVector, Feedback, MAX_AXES, Setpoint};

/// Longest delay, fine periods.
pub const MAX_DELAY: u64 = 1000;

/// What is wrong with the feedback of a corrupted joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Corruption {
    /// The position is off by so much, mm or rad per joint.
    Off(AxisVector),
    /// The position is this, which is no position.
    Value(f64),
}

/// The joints concerned, by index.
pub type Mask = [bool; MAX_AXES];

/// What a fault does.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Kind {
    /// The setpoint is lost, and so is the answer: the feedback is the last one.
    Drop,
    /// Setpoints reach the drives so many exchanges late.
    Delay(u64),
    /// The feedback of these joints stays what it was; of all joints: the whole feedback.
    Freeze(Mask),
    /// The drives get the last setpoint once more in place of the new one.
    Duplicate,
    /// The feedback position is wrong.
    Corrupt(Corruption, Mask),
    /// The exchange fails.
    Fail,
}

impl Corruption {
    /// Falsifies the positions of the joints in `mask`. Fine loop; does not allocate.
    pub fn apply(&self, mask: Mask, feedback: &mut Feedback) {
        for joint in (0..MAX_AXES).filter(|joint| mask[*joint]) {
            match self {
                Self::Off(offset) => feedback.position[joint] += offset[joint],
                Self::Value(value) => feedback.position[joint] = *value,
            }
        }
    }
}

/// Puts back what `last` says of the joints in `mask`. Fine loop; does not allocate.
pub fn freeze(mask: Mask, last: &Feedback, feedback: &mut Feedback) {
    if mask == [true; MAX_AXES] {
        *feedback = *last;
        return;
    }
    for joint in (0..MAX_AXES).filter(|joint| mask[*joint]) {
        feedback.position[joint] = last.position[joint];
        feedback.speed[joint] = last.speed[joint];
        feedback.current_a[joint] = last.current_a[joint];
        feedback.state[joint] = last.state[joint];
        feedback.fault_code[joint] = last.fault_code[joint];
    }
}

/// Setpoints on their way to the drives.
#[derive(Debug)]
pub struct Line {
    waiting: Box<[Setpoint]>,
    count: usize,
    next: usize,
}

impl Line {
    /// An empty line on which `periods` setpoints have room. Host; allocates.
    pub fn new(periods: u64) -> Self {
        Self {
            waiting: vec![Setpoint::default(); periods as usize].into(),
            count: 0,
            next: 0,
        }
    }

    /// Puts `setpoint` in; gives the one that comes out, or none while the line fills. Fine loop; does not allocate.
    pub fn pass(&mut self, setpoint: &Setpoint) -> Option<Setpoint> {
        let place = self.waiting.get_mut(self.next)?;
        let out = std::mem::replace(place, *setpoint);
        self.next = (self.next + 1) % self.waiting.len();
        if self.count == self.waiting.len() {
            return Some(out);
        }
        self.count += 1;
        None
    }

    /// Loses what is on its way.
    pub fn clear(&mut self) {
        (self.count, self.next) = (0, 0);
    }
}
