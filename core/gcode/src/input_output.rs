//! M62 to M66: digital outputs, and waiting for inputs.

use tandem_sdk::EventKind;

use crate::fault::{Checked, Fault};
use crate::interpreter::Interpreter;
use crate::item::{Input, InputMode, InputWait, Item};
use crate::table::Group;

/// Highest output of M62 to M65; the two above it are mist and flood coolant.
const MOST_OUTPUT: u32 = 61;

impl Interpreter {
    /// M62 to M66. M64 and M65 do not wait for motion: the machine is at rest when they switch, as in LinuxCNC, whose
    /// queue has run empty by then.
    pub(crate) fn input_output(&mut self, out: &mut Vec<Item>) -> Checked<()> {
        let Some(code) = self.orders.get(Group::InputOutput) else { return Ok(()) };
        if code == 660 {
            return self.wait_for_input(out);
        }
        let missing =
            || self.orders.fault(Group::InputOutput, "word-missing", "P, the number of the output, is missing");
        let number = self.words.integer(b'P', 0..=MOST_OUTPUT)?.ok_or_else(missing)?;
        if let Some(refusal) = self.config.outputs.refusal("output", number) {
            return Err(self.words.fault(b'P', "output", refusal));
        }
        let on = matches!(code, 620 | 640);
        let bit = 1 << number;
        if self.state.outputs_set & bit == 0 || (self.state.outputs & bit != 0) != on {
            self.state.outputs_set |= bit;
            self.state.outputs = if on { self.state.outputs | bit } else { self.state.outputs & !bit };
            if code >= 640 {
                self.rest(out);
            }
            self.event(EventKind::DigitalOutput, number, f64::from(u8::from(on)), out);
        }
        Ok(())
    }

    fn wait_for_input(&mut self, out: &mut Vec<Item>) -> Checked<()> {
        let input = match (self.words.integer(b'P', 0..=63)?, self.words.integer(b'E', 0..=63)?) {
            (Some(number), None) => match self.config.inputs.refusal("input", number) {
                Some(refusal) => return Err(self.words.fault(b'P', "input", refusal)),
                None => Input::Digital(number),
            },
            (_, Some(_)) => return Err(self.wait_fault("M66 E: there are no analogue inputs, only digital ones (P)")),
            (None, None) => return Err(self.wait_fault("M66 needs P, the number of a digital input")),
        };
        let mode = self.wait_mode()?;
        let timeout_s = self.words.not_negative(b'Q')?.unwrap_or(0.0);
        if mode != InputMode::Immediate && timeout_s == 0.0 {
            return Err(self.wait_fault("M66 needs Q, the longest wait in seconds, greater than zero"));
        }
        self.rest(out);
        let (line, before_block) = (self.state.line, self.state.next_index);
        out.push(Item::Wait(InputWait { line, before_block, input, mode, timeout_s }));
        Ok(())
    }

    fn wait_mode(&self) -> Checked<InputMode> {
        Ok(match self.words.integer(b'L', 0..=4)? {
            None | Some(0) => InputMode::Immediate,
            Some(1) => InputMode::Rise,
            Some(2) => InputMode::Fall,
            Some(3) => InputMode::High,
            Some(_) => InputMode::Low,
        })
    }

    fn wait_fault(&self, message: &str) -> Fault {
        self.orders.fault(Group::InputOutput, "input", message)
    }
}
