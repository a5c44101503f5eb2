//! M62 to M68: outputs, and waiting for inputs.

use tandem_sdk::EventKind;

use super::{Action, Group, Word};
use crate::item::{Input, InputMode, InputWait, Item};
use crate::line::Line;
use crate::line_error::{Checked, LineError};

pub(super) const WORDS: &[Word] = &[
    Word::new(
        "M62",
        Group::InputOutput,
        "P",
        "digital output P on, with the motion",
        WITH_MOTION_ON,
        "M62 P1",
    ),
    Word::new(
        "M63",
        Group::InputOutput,
        "P",
        "digital output P off, with the motion",
        WITH_MOTION_OFF,
        "M63 P1",
    ),
    Word::new(
        "M64",
        Group::InputOutput,
        "P",
        "digital output P on, at rest",
        AT_REST_ON,
        "M64 P1",
    ),
    Word::new(
        "M65",
        Group::InputOutput,
        "P",
        "digital output P off, at rest",
        AT_REST_OFF,
        "M65 P1",
    ),
    Word::new(
        "M66",
        Group::InputOutput,
        "PELQ",
        "wait for digital input P, or read analogue input E",
        Action::Act(wait),
        "M66 P3 L1 Q2",
    ),
    Word::new(
        "M67",
        Group::InputOutput,
        "EQ",
        "analogue output E to the value Q, with the motion",
        ANALOG_WITH_MOTION,
        "M67 E1 Q0.5",
    ),
    Word::new(
        "M68",
        Group::InputOutput,
        "EQ",
        "analogue output E to the value Q, at rest",
        ANALOG_AT_REST,
        "M68 E1 Q0.5",
    ),
];

const WITH_MOTION_ON: Action = Action::Act(|line| switch(line, true, false));
const WITH_MOTION_OFF: Action = Action::Act(|line| switch(line, false, false));
const AT_REST_ON: Action = Action::Act(|line| switch(line, true, true));
const AT_REST_OFF: Action = Action::Act(|line| switch(line, false, true));

const ANALOG_WITH_MOTION: Action = Action::Act(|line| set_analog(line, false));
const ANALOG_AT_REST: Action = Action::Act(|line| set_analog(line, true));

/// Highest output of M62 to M65; the two above it are mist and flood coolant.
const MAX_OUTPUT: u32 = 61;

/// What the program has set, and the answer of M66.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Outputs {
    /// Bit per output that the program has set.
    set: u64,
    /// Bit per output that is on.
    on: u64,
    /// Answer of the last M66 (#5399).
    pub answer: f64,
    /// The first pass has assumed that answer.
    pub answer_assumed: bool,
}

impl Outputs {
    /// Sets an output; whether that may change it.
    fn set(&mut self, number: u32, on: bool) -> bool {
        let bit = 1 << number;
        let changes = self.set & bit == 0 || (self.on & bit != 0) != on;
        self.set |= bit;
        self.on = if on { self.on | bit } else { self.on & !bit };
        changes
    }

    /// What they are is no longer known: whatever the program sets next is sent.
    pub fn forget(&mut self) {
        self.set = 0;
    }
}

/// M64 and M65 do not wait for motion: the machine is at rest when they switch, as in LinuxCNC, whose queue has run empty
/// by then.
fn switch(line: &mut Line, on: bool, at_rest: bool) -> Checked<()> {
    let missing = || {
        line.orders.error(
            Group::InputOutput,
            "word-missing",
            "P, the number of the output, is missing",
        )
    };
    let number = line
        .words
        .integer(b'P', 0..=MAX_OUTPUT)?
        .ok_or_else(missing)?;
    if let Some(refusal) = line.config.outputs.refusal("output", number) {
        return Err(line.words.error(b'P', "output", refusal));
    }
    if line.state.outputs.set(number, on) {
        if at_rest {
            line.rest();
        }
        line.event(EventKind::DigitalOutput, number, f64::from(u8::from(on)));
    }
    Ok(())
}

/// M67 and M68.
fn set_analog(line: &mut Line, at_rest: bool) -> Checked<()> {
    let missing = |what| line.orders.error(Group::InputOutput, "word-missing", what);
    let number = line
        .words
        .integer(b'E', 0..=63)?
        .ok_or_else(|| missing("E, the number of the output, is missing"))?;
    let value = line
        .words
        .get(b'Q')
        .ok_or_else(|| missing("Q, the value of the output, is missing"))?;
    if let Some(refusal) = line
        .config
        .analog_outputs
        .refusal("analogue output", number)
    {
        return Err(line.words.error(b'E', "output", refusal));
    }
    if at_rest {
        line.rest();
    }
    line.event(EventKind::AnalogOutput, number, value);
    Ok(())
}

fn wait(line: &mut Line) -> Checked<()> {
    let input = match (
        line.words.integer(b'P', 0..=63)?,
        line.words.integer(b'E', 0..=63)?,
    ) {
        (Some(number), None) => match line.config.inputs.refusal("input", number) {
            Some(refusal) => return Err(line.words.error(b'P', "input", refusal)),
            None => Input::Digital(number),
        },
        (None, Some(number)) => match line.config.analog_inputs.refusal("analogue input", number) {
            Some(refusal) => return Err(line.words.error(b'E', "input", refusal)),
            None => Input::Analog(number),
        },
        (Some(_), Some(_)) => {
            return Err(wait_error(
                line,
                "M66 takes either P, a digital input, or E, an analogue one",
            ));
        }
        (None, None) => {
            return Err(wait_error(
                line,
                "M66 needs P, the number of a digital input, or E, an analogue one",
            ));
        }
    };
    let mode = match line.words.integer(b'L', 0..=4)? {
        None | Some(0) => InputMode::Immediate,
        Some(1) => InputMode::Rise,
        Some(2) => InputMode::Fall,
        Some(3) => InputMode::High,
        Some(_) => InputMode::Low,
    };
    let timeout_s = line.words.not_negative(b'Q')?.unwrap_or(0.0);
    if mode != InputMode::Immediate && matches!(input, Input::Analog(_)) {
        return Err(wait_error(
            line,
            "an analogue input (E) is read at once: M66 E goes with L0 only",
        ));
    }
    if mode != InputMode::Immediate && timeout_s == 0.0 {
        return Err(wait_error(
            line,
            "M66 needs Q, the longest wait in seconds, greater than zero",
        ));
    }
    line.rest();
    let number = line.state.line;
    let before_block = line.state.path.next_index;
    line.out.push(Item::Wait(InputWait {
        line: number,
        before_block,
        input,
        mode,
        timeout_s,
    }));
    Ok(())
}

fn wait_error(line: &Line, message: &str) -> LineError {
    line.orders.error(Group::InputOutput, "input", message)
}

#[cfg(test)]
mod tests {
    use crate::Lines;
    use crate::testing::{assert_items, messages, mill, run_on};

    #[test]
    fn outputs_that_do_not_go_with_the_motion_switch_at_rest() {
        assert_items(
            "F60\nG1 X1\nM62 P1\nX2\nM64 P2\nX3\nM64 P2\nX4\nM63 P1\nX5\nM65 P2\nX6",
            &[
                "2: Line 0 to 1 0 0 0 length 1 feed 1",
                "3: DigitalOutput 1 1 before 1",
                "4: Line 1 to 2 0 0 0 length 1 feed 1",
                "5: Dwell 2 to 2 0 0 0 for 0",
                "5: DigitalOutput 2 1 before 3",
                "6: Line 3 to 3 0 0 0 length 1 feed 1",
                "8: Line 4 to 4 0 0 0 length 1 feed 1",
                "9: DigitalOutput 1 0 before 5",
                "10: Line 5 to 5 0 0 0 length 1 feed 1",
                "11: Dwell 6 to 5 0 0 0 for 0",
                "11: DigitalOutput 2 0 before 7",
                "12: Line 7 to 6 0 0 0 length 1 feed 1",
                "End",
            ],
        );
    }

    #[test]
    fn inputs_are_waited_for_at_rest() {
        assert_items(
            "G0 X1\nM66 P3 L1 Q2\nM66 P1 L0\nG0 X#5399",
            &[
                "1: Rapid 0 to 1 0 0 0",
                "2: Dwell 1 to 1 0 0 0 for 0",
                "2: Wait Digital(3) Rise 2 before 2",
                "3: Wait Digital(1) Immediate 0 before 2",
                "4: Rapid 2 to 0 0 0 0",
                "End",
            ],
        );
    }

    #[test]
    fn analogue_outputs_go_with_the_motion_or_wait_for_rest() {
        assert_items(
            "F60\nG1 X1\nM67 E1 Q0.5\nX2\nM68 E0 Q-3\nM66 E2\nG0 X[#5399+3]",
            &[
                "2: Line 0 to 1 0 0 0 length 1 feed 1",
                "3: AnalogOutput 1 0.5 before 1",
                "4: Line 1 to 2 0 0 0 length 1 feed 1",
                "5: Dwell 2 to 2 0 0 0 for 0",
                "5: AnalogOutput 0 -3 before 3",
                "6: Wait Analog(2) Immediate 0 before 3",
                "7: Rapid 3 to 3 0 0 0",
                "End",
            ],
        );
        for wrong in [
            "M67 E1",
            "M68 Q1",
            "M66 P1 E1",
            "M66 E1 L1 Q2",
            "M67 E64 Q1",
        ] {
            assert_eq!(messages(wrong).len(), 1, "{wrong}");
        }
        let mut config = mill();
        (config.analog_outputs, config.analog_inputs) = (Lines::none(), Lines::none());
        let (_, errors) = run_on(config, "M67 E1 Q1\nM66 E1");
        let shown: Vec<_> = errors.iter().map(|e| &*e.message).collect();
        assert_eq!(
            shown,
            [
                "no driver has analogue output 1; there is none",
                "no driver has analogue input 1; there is none"
            ]
        );
    }
}
