//! T, M6, G43, G49: the tool and its length.

use tandem_sdk::{AxisVector, EventKind};

use super::{Action, Group, Word, spindle};
use crate::fault::Checked;
use crate::line::Line;

pub(super) const WORDS: &[Word] = &[
    Word::new("M6", Group::ToolChange, "", "change to the tool selected by T", Action::Act(change), "T1 M6"),
    Word::new("G43", Group::ToolLength, "H", "tool length offset of tool H", Action::Act(length), "G43 H1"),
    Word::new("G49", Group::ToolLength, "", "tool length offset off", Action::Act(no_length), "G49"),
];

/// Highest tool number.
pub(super) const MAX_TOOL: u32 = 99_999;

/// The word T.
pub(crate) fn select(line: &mut Line) -> Checked<()> {
    let Some(number) = line.words.integer(b'T', 0..=MAX_TOOL)? else { return Ok(()) };
    if number != 0 && !line.config.tools.is_empty() && line.state.tools.find(number).is_none() {
        return Err(line.words.fault(b'T', "tool", format!("the tool table has no tool {number}")));
    }
    if line.state.tools.selected != Some(number) {
        line.state.tools.selected = Some(number);
        line.event(EventKind::ToolSelect, number, 0.0);
    }
    Ok(())
}

/// The spindle stops, as in LinuxCNC: nobody changes the tool of a spindle that turns.
fn change(line: &mut Line) -> Checked<()> {
    let Some(number) = line.state.tools.selected else {
        return Err(line.orders.fault(Group::ToolChange, "tool", "M6 has no tool to change to: T is missing"));
    };
    if number != line.state.tools.in_spindle {
        line.rest();
        spindle::stop(line);
        line.state.tools.in_spindle = number;
        line.event(EventKind::ToolChange, number, 0.0);
    }
    Ok(())
}

/// A later change of the tool or of its row acts with the next G43.
fn length(line: &mut Line) -> Checked<()> {
    let number = line.words.integer(b'H', 0..=MAX_TOOL)?.unwrap_or(line.state.tools.in_spindle);
    let no_tool = || line.orders.fault(Group::ToolLength, "tool", format!("the tool table has no tool {number}"));
    let offset = match number {
        0 => AxisVector::ZERO,
        _ => line.state.tools.find(number).map(|tool| tool.offset).ok_or_else(no_tool)?,
    };
    line.state.coordinates.set_tool(offset);
    Ok(())
}

fn no_length(line: &mut Line) -> Checked<()> {
    line.state.coordinates.set_tool(AxisVector::ZERO);
    Ok(())
}

#[cfg(test)]
mod tests {
    use crate::testing::{assert_items, ends, run, shown};

    #[test]
    fn a_change_rests_and_stops_the_spindle() {
        assert_items(
            "G0 X1 S60\nM3\nT1\nG0 X4 M6\nM6",
            &[
                "1: Rapid 0 to 1 0 0 0",
                "2: Dwell 1 to 1 0 0 0 for 0",
                "2: Spindle 0 6.283 before 2",
                "3: ToolSelect 1 0 before 2",
                "4: Spindle 0 0 before 2",
                "4: ToolChange 1 0 before 2",
                "4: Rapid 2 to 4 0 0 0",
                "End",
            ],
        );
        // T with a function is a tool all the same.
        assert!(shown(&run("TABS[-2]"))[0].starts_with("1: ToolSelect 2"));
    }

    #[test]
    fn the_length_of_the_tool_is_an_offset() {
        assert_eq!(
            ends("G43 H1 G0 Z0\nG49 Z1\nT2 M6\nG43 Z0"),
            [["0", "0", "20"], ["0", "0", "1"], ["0", "0", "1"], ["0", "0", "25"]]
        );
    }
}
