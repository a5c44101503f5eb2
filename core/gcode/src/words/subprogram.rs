//! M98 and M99: subprograms, which begin with their number in a line of its own.

use super::{Action, Group, Word};
use crate::line::Line;
use crate::line_error::{Checked, Span};

pub(super) const WORDS: &[Word] = &[
    Word::new(
        "M98",
        Group::Stop,
        "PL",
        "call subprogram P, L times, when the rest of the line is done",
        Action::Act(call),
        "M98 P100 L2\nM30\nO100\nG91 G0 X1\nM99",
    ),
    Word::new(
        "M99",
        Group::Stop,
        "",
        "end of a subprogram; in the program itself, back to its first line",
        Action::Act(end),
        "M98 P100\nM30\nO100\nM99",
    ),
];

/// Highest number of a subprogram, and most times that it is called by one line.
const MAX_NUMBER: u32 = 99_999_999;

/// Where the program goes on instead of at the next line.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Jump {
    Call {
        number: u32,
        times: u32,
        /// Of the word that names the subprogram.
        span: Span,
    },
    /// M99.
    End,
    /// M6 where a subroutine changes tools: to tool `number`.
    ToolChange { number: u32 },
}

/// What M98, M99 and M6 ask of whoever executes the lines.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Subprograms {
    /// Somebody obeys: the lines are those of a program.
    pub obeyed: bool,
    pub jump: Option<Jump>,
}

fn call(line: &mut Line) -> Checked<()> {
    of_a_program(line)?;
    let Some(number) = line.words.integer(b'P', 0..=MAX_NUMBER)? else {
        let message = "M98 needs P, the number of the subprogram";
        return Err(line.orders.error(Group::Stop, "word-missing", message));
    };
    let times = line.words.integer(b'L', 0..=MAX_NUMBER)?.unwrap_or(1);
    if times > 0 {
        line.state.subprograms.jump = Some(Jump::Call {
            number,
            times,
            span: line.words.span(b'P'),
        });
    }
    Ok(())
}

fn end(line: &mut Line) -> Checked<()> {
    of_a_program(line)?;
    line.state.subprograms.jump = Some(Jump::End);
    Ok(())
}

fn of_a_program(line: &Line) -> Checked<()> {
    if line.state.subprograms.obeyed {
        return Ok(());
    }
    let message = "subprograms belong to a program: manual input has none";
    Err(line.orders.error(Group::Stop, "refused", message))
}

#[cfg(test)]
mod tests {
    use crate::testing::messages;

    #[test]
    fn manual_input_has_no_subprograms() {
        for text in ["M98 P1", "M99"] {
            assert!(
                messages(text)[0].starts_with("1:1 [refused] subprograms belong to a program"),
                "{text}"
            );
        }
    }
}
