//! A device that takes part in the exchange: what it said last, and since when it says nothing.

use tandem_sdk::Feedback;

use crate::bring_up::Ready;
use crate::map::u16_at;
use crate::options::DeviceOptions;
use crate::words::own;

/// State of a device that takes part.
pub(crate) const OP: u16 = 8;

/// A device that takes part in the exchange.
#[derive(Debug)]
pub(crate) struct Member {
    pub(crate) ready: Ready,
    /// Exchanges in a row without its answer.
    pub(crate) silent: u32,
    /// Why it counts as lost, from then on.
    pub(crate) lost: Option<u32>,
    /// Its state, as it was asked for last.
    pub(crate) al: u16,
    pub(crate) al_code: u16,
    /// Its inputs, as they came last.
    pub(crate) inputs: Vec<u8>,
}

impl Member {
    /// Its answer is missing once more.
    pub(crate) fn miss(&mut self, came: bool, patience: u32) {
        self.silent = self.silent.saturating_add(1);
        if let Some(drive) = &mut self.ready.drive {
            drive.miss();
        }
        if self.silent <= patience {
            return;
        }
        // Its state is asked for while it is missing; what it said then is the better reason.
        let left = came && self.al & 0x0f != OP;
        let why = match (left, came) {
            (true, _) => own::LEFT_STATE | u32::from(self.al_code),
            (false, true) => own::WORKING_COUNTER,
            (false, false) => own::NO_ANSWER,
        };
        let better = left
            && self
                .lost
                .is_some_and(|lost| lost & 0xffff_0000 != own::LEFT_STATE);
        if self.lost.is_none() || better {
            self.lost = Some(why);
        }
    }

    /// Its inputs and analog values, where the machine has them.
    pub(crate) fn read_lines(&self, options: &DeviceOptions, feedback: &mut Feedback) {
        let bits = |bit: usize| match &self.ready.drive {
            Some(drive) => bit < 32 && drive.digital >> bit & 1 == 1,
            None => self
                .inputs
                .get(bit / 8)
                .is_some_and(|byte| byte >> (bit % 8) & 1 == 1),
        };
        for (bit, line) in options
            .inputs
            .iter()
            .enumerate()
            .filter(|(_, line)| **line >= 0)
        {
            let mask = 1_u64 << line;
            feedback.inputs = if bits(bit) {
                feedback.inputs | mask
            } else {
                feedback.inputs & !mask
            };
        }
        for analog in &options.analog {
            let value = f64::from(u16_at(&self.inputs, analog.byte).cast_signed());
            feedback.analog[analog.input] = value * analog.scale + analog.offset;
        }
    }
}
