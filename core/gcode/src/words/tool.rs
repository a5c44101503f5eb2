//! T, M6, G43, G49: the tool and its length.

use tandem_sdk::{AxisVector, BlockKind, EventKind};

use super::subprogram::Jump;
use super::{Action, Group, Word, motion, spindle};
use crate::line::Line;
use crate::line_error::Checked;
use crate::state::letters::{AXIS_MASK, mask};

pub(super) const WORDS: &[Word] = &[
    Word::new(
        "M6",
        Group::ToolChange,
        "",
        "change to the tool selected by T",
        Action::Act(change),
        "T1 M6",
    ),
    Word::new(
        "G43",
        Group::ToolLength,
        "H",
        "tool length offset of tool H",
        Action::Act(length),
        "G43 H1",
    ),
    Word::new(
        "G43.1",
        Group::ToolLength,
        "XYZABCUVW",
        "tool length offset as the axis words say, in the axes that are named",
        Action::Act(length_from_words),
        "G43.1 Z20",
    ),
    Word::new(
        "G43.2",
        Group::ToolLength,
        "HXYZABCUVW",
        "adds the offset of tool H, or that of the axis words, to the one in force",
        Action::Act(more_length),
        "G43 H1\nG43.2 H2",
    ),
    Word::new(
        "M61",
        Group::ToolChange,
        "Q",
        "the tool in the spindle is number Q; nothing is changed",
        Action::Act(set_number),
        "M61 Q2",
    ),
    Word::new(
        "G49",
        Group::ToolLength,
        "",
        "tool length offset off",
        Action::Act(no_length),
        "G49",
    ),
];

/// Highest tool number.
pub(super) const MAX_TOOL: u32 = 99_999;

/// The word T.
pub(crate) fn select(line: &mut Line) -> Checked<()> {
    let Some(number) = line.words.integer(b'T', 0..=MAX_TOOL)? else {
        return Ok(());
    };
    if number != 0 && !line.config.tools.is_empty() && line.state.tools.find(number).is_none() {
        return Err(line
            .words
            .error(b'T', "tool", format!("the tool table has no tool {number}")));
    }
    if line.state.tools.selected != Some(number) {
        line.state.tools.selected = Some(number);
        line.event(EventKind::ToolSelect, number, 0.0);
    }
    Ok(())
}

/// The spindle stops, as in LinuxCNC: nobody changes the tool of a spindle that turns. Without any T the spindle becomes
/// empty, as there. Where the machine has a subroutine that changes tools, it comes first, and M6 in it is the change itself.
fn change(line: &mut Line) -> Checked<()> {
    let number = line.state.tools.selected.unwrap_or(0);
    if number == line.state.tools.in_spindle {
        return Ok(());
    }
    let changing = line.state.tools.changing;
    let sub = line.config.tool_change.sub.as_ref().filter(|_| !changing);
    if let Some(name) = sub {
        stands_alone(line, name)?;
    }
    line.rest();
    spindle::stop(line);
    if !changing {
        retract(line)?;
    }
    if sub.is_some() {
        line.state.subprograms.jump = Some(Jump::ToolChange { number });
    } else {
        line.state.tools.in_spindle = number;
        line.event(EventKind::ToolChange, number, 0.0);
    }
    Ok(())
}

/// What else the line says would be done before the subroutine, or behind it: nobody is to guess.
fn stands_alone(line: &Line, name: &str) -> Checked<()> {
    let alone = line.orders.present() == Group::ToolChange.bit()
        && line.words.present & !mask("NTFS") == 0
        && line.words.polar.is_none();
    if alone {
        return Ok(());
    }
    let message = format!(
        "M6 calls o<{name}> on this machine: nothing but T, F and S may stand beside it, split the line"
    );
    Err(line.orders.error(Group::ToolChange, "conflict", message))
}

/// Up to where the machine changes tools, where it says so.
fn retract(line: &mut Line) -> Checked<()> {
    let (Some(up_mm), Some(z)) = (
        line.config.tool_change.retract_z_mm,
        line.letters.axis(b'Z'),
    ) else {
        return Ok(());
    };
    if line.state.path.position[z] >= up_mm {
        return Ok(());
    }
    line.state.path.position[z] = up_mm;
    line.state.path.uncertain &= !(1 << z);
    line.state.path.assumed &= !(1 << z);
    motion::straight(line, BlockKind::Rapid)?;
    line.rest();
    Ok(())
}

/// A later change of the tool or of its row acts with the next G43.
fn length(line: &mut Line) -> Checked<()> {
    let number = line
        .words
        .integer(b'H', 0..=MAX_TOOL)?
        .unwrap_or(line.state.tools.in_spindle);
    let offset = offset_of(line, number)?;
    line.state.coordinates.set_tool(offset);
    Ok(())
}

/// The offset of a tool.
fn offset_of(line: &mut Line, number: u32) -> Checked<AxisVector> {
    if let Some(tool) = line.state.tools.find(number) {
        return Ok(tool.offset);
    }
    let without_table = line.config.tools.is_empty() && line.config.zero_length_without_table;
    if number != 0 && !without_table {
        return Err(line
            .orders
            .error(Group::ToolLength, "tool", no_tool(line, number)));
    }
    if number != 0 {
        line.state.tools.assumed_zero.get_or_insert(line.state.line);
    }
    Ok(AxisVector::ZERO)
}

/// The diameter of a tool, mm; 0 for no tool.
pub(super) fn diameter_of(line: &mut Line, number: u32) -> Checked<f64> {
    if let Some(tool) = line.state.tools.find(number) {
        return Ok(tool.diameter_mm);
    }
    let without_table = line.config.tools.is_empty() && line.config.zero_length_without_table;
    if number != 0 && !without_table {
        return Err(line
            .orders
            .error(Group::CutterRadius, "tool", no_tool(line, number)));
    }
    if number != 0 {
        line.state.tools.assumed_zero.get_or_insert(line.state.line);
    }
    Ok(0.0)
}

#[cold]
fn no_tool(line: &Line, number: u32) -> String {
    if line.config.tools.is_empty() {
        return format!(
            "the size of tool {number} is not known: the machine file names no tool table \
             ([tools] table, or without_table = \"zero\" where every length is zero)"
        );
    }
    format!("the tool table has no tool {number}")
}

/// The offset in force with the axis words of the line: in their place, or added to them.
fn with_words(line: &Line, add: bool) -> AxisVector {
    let mut offset = *line.state.coordinates.tool();
    for (axis, value) in line.named_axes() {
        offset[axis] = if add { offset[axis] + value } else { value };
    }
    offset
}

fn length_from_words(line: &mut Line) -> Checked<()> {
    if line.words.present & AXIS_MASK == 0 {
        return Err(line.orders.error(
            Group::ToolLength,
            "axis-missing",
            "G43.1 needs at least one axis word",
        ));
    }
    let offset = with_words(line, false);
    line.state.coordinates.set_tool(offset);
    Ok(())
}

fn more_length(line: &mut Line) -> Checked<()> {
    let offset = match (
        line.words.integer(b'H', 0..=MAX_TOOL)?,
        line.words.present & AXIS_MASK != 0,
    ) {
        (Some(number), false) => *line.state.coordinates.tool() + offset_of(line, number)?,
        (None, true) => with_words(line, true),
        _ => {
            let message = "G43.2 needs either H, a tool, or axis words";
            return Err(line
                .orders
                .error(Group::ToolLength, "word-missing", message));
        }
    };
    line.state.coordinates.set_tool(offset);
    Ok(())
}

/// M61.
fn set_number(line: &mut Line) -> Checked<()> {
    let missing = || {
        line.orders.error(
            Group::ToolChange,
            "word-missing",
            "M61 needs Q, the number of the tool",
        )
    };
    let number = line
        .words
        .integer(b'Q', 0..=MAX_TOOL)?
        .ok_or_else(missing)?;
    if number != 0 && !line.config.tools.is_empty() && line.state.tools.find(number).is_none() {
        return Err(line
            .words
            .error(b'Q', "tool", format!("the tool table has no tool {number}")));
    }
    line.state.tools.in_spindle = number;
    Ok(())
}

fn no_length(line: &mut Line) -> Checked<()> {
    line.state.coordinates.set_tool(AxisVector::ZERO);
    Ok(())
}

#[cfg(test)]
mod tests {
    use crate::testing::{assert_items, ends, mill, run, run_on, shown};

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
        assert_items("M6", &["End"]);
        // T with a function is a tool all the same.
        assert!(shown(&run("TABS[-2]"))[0].starts_with("1: ToolSelect 2"));
    }

    #[test]
    fn the_length_of_the_tool_is_an_offset() {
        assert_eq!(
            ends("G43 H1 G0 Z0\nG49 Z1\nT2 M6\nG43 Z0"),
            [
                ["0", "0", "20"],
                ["0", "0", "1"],
                ["0", "0", "1"],
                ["0", "0", "25"]
            ]
        );
        assert_eq!(
            ends("G43 H1\nG43.2 H2\nG0 Z1\nG43.2 X3\nG0 X0\nG43.1 Z5\nG0 Z0")[..],
            [["0", "0", "46"], ["3", "0", "46"], ["3", "0", "5"]]
        );
        assert_eq!(ends("M61 Q2\nG43\nG0 Z0"), [["0", "0", "25"]]);
    }

    #[test]
    fn without_a_table_a_length_is_zero_only_where_the_machine_says_so() {
        let mut config = mill();
        config.tools.clear();
        let (_, errors) = run_on(config.clone(), "T5 M6\nG43 H5 G0 Z1");
        assert_eq!(
            (errors.len(), errors[0].line, errors[0].code),
            (1, 2, "tool")
        );
        assert!(
            errors[0].message.contains("without_table = \"zero\""),
            "{}",
            errors[0].message
        );
        config.zero_length_without_table = true;
        let (items, errors) = run_on(config.clone(), "T5 M6\nG43 H5 G0 Z1\nG43 H6\nZ2");
        assert!(errors.is_empty());
        assert!(
            shown(&items)
                .iter()
                .any(|item| item == "2: Rapid 0 to 0 0 1 0")
        );
        let mut program =
            crate::Program::spool("t.ngc", &b"T5 M6\nG43 H5 G0 Z1\nG43 H6"[..]).unwrap();
        let report = crate::check(&mut program, &config, &mut |_, _| Ok(())).unwrap();
        let notes: Vec<_> = report.warnings.iter().map(|w| (w.line, w.code)).collect();
        assert_eq!(notes, [(2, "tool-length")], "one note a run");
    }
}
