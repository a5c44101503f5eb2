//! Words that move coordinate systems or go to stored positions: G10, G53 to G59.3, G92, G28 and G30.

use tandem_sdk::AxisVector;

use super::{Action, Group, Word, tool};
use crate::config::Tool;
use crate::line::Line;
use crate::line_error::{Checked, LineError};
use crate::state::coordinates::SYSTEMS;
use crate::state::letters::{AXIS_MASK, mask};

pub(super) const WORDS: &[Word] = &[
    Word::new(
        "G10",
        Group::NonModal,
        "LPRXYZABCUVWIJQ",
        "L1, L10, L11 tool table (P tool; I J Q of a lathe's tool have no effect; L0, to read it again, has none either); L2 (R rotation), L20 coordinate systems (P 1 to 9, 0 the one in force)",
        Action::Act(set_data),
        "G10 L2 P1 X10 R30",
    ),
    Word::new(
        "G52",
        Group::NonModal,
        "XYZABCUVW",
        "local coordinate system: the offset of G92 as it is given, in the axes that are named",
        Action::Act(set_local_offset),
        "G52 X5",
    ),
    Word::new(
        "G53",
        Group::NonModal,
        "",
        "machine coordinates, in this line",
        Action::Act(machine_coordinates),
        "G53 G0 X1",
    ),
    Word::new(
        "G54",
        Group::CoordinateSystem,
        "",
        "coordinate system 1",
        Action::Act(|line| select(line, 0)),
        "G54",
    ),
    Word::new(
        "G55",
        Group::CoordinateSystem,
        "",
        "coordinate system 2",
        Action::Act(|line| select(line, 1)),
        "G55",
    ),
    Word::new(
        "G56",
        Group::CoordinateSystem,
        "",
        "coordinate system 3",
        Action::Act(|line| select(line, 2)),
        "G56",
    ),
    Word::new(
        "G57",
        Group::CoordinateSystem,
        "",
        "coordinate system 4",
        Action::Act(|line| select(line, 3)),
        "G57",
    ),
    Word::new(
        "G58",
        Group::CoordinateSystem,
        "",
        "coordinate system 5",
        Action::Act(|line| select(line, 4)),
        "G58",
    ),
    Word::new(
        "G59",
        Group::CoordinateSystem,
        "",
        "coordinate system 6",
        Action::Act(|line| select(line, 5)),
        "G59",
    ),
    Word::new(
        "G59.1",
        Group::CoordinateSystem,
        "",
        "coordinate system 7",
        Action::Act(|line| select(line, 6)),
        "G59.1",
    ),
    Word::new(
        "G59.2",
        Group::CoordinateSystem,
        "",
        "coordinate system 8",
        Action::Act(|line| select(line, 7)),
        "G59.2",
    ),
    Word::new(
        "G59.3",
        Group::CoordinateSystem,
        "",
        "coordinate system 9",
        Action::Act(|line| select(line, 8)),
        "G59.3",
    ),
    Word::new(
        "G92",
        Group::NonModal,
        "XYZABCUVW",
        "the current position gets these coordinates",
        Action::Act(set_position_offset),
        "G92 X0",
    ),
    Word::new(
        "G92.1",
        Group::NonModal,
        "",
        "clear the offsets of G92",
        Action::Act(clear_g92),
        "G92.1",
    ),
    Word::new(
        "G92.2",
        Group::NonModal,
        "",
        "suspend the offsets of G92",
        Action::Act(suspend_g92),
        "G92.2",
    ),
    Word::new(
        "G92.3",
        Group::NonModal,
        "",
        "restore the offsets of G92",
        Action::Act(restore_g92),
        "G92.3",
    ),
    Word::new(
        "G28",
        Group::NonModal,
        "XYZABCUVW",
        "rapid to the first reference position, through a point",
        Action::Act(|line| go_to_reference(line, 0)),
        "G28 Z2",
    ),
    Word::new(
        "G28.1",
        Group::NonModal,
        "",
        "store the first reference position",
        Action::Act(|l| store(l, 0)),
        "G28.1",
    ),
    Word::new(
        "G30",
        Group::NonModal,
        "XYZABCUVW",
        "rapid to the second reference position, through a point",
        Action::Act(|line| go_to_reference(line, 1)),
        "G30 Z2",
    ),
    Word::new(
        "G30.1",
        Group::NonModal,
        "",
        "store the second reference position",
        Action::Act(|l| store(l, 1)),
        "G30.1",
    ),
];

/// G53 holds for the axis words of its line, which the motion asks for. On its own it would be taken for a mode by whoever
/// wrote it.
fn machine_coordinates(line: &mut Line) -> Checked<()> {
    if line.orders.motion.is_some() || line.orders.has(Group::Motion) {
        return Ok(());
    }
    let message = "G53 holds for the axis words of its line, and there are none: it is no mode";
    Err(line.orders.error(Group::NonModal, "axis-missing", message))
}

fn select(line: &mut Line, system: usize) -> Checked<()> {
    line.state.coordinates.select(system);
    Ok(())
}

fn clear_g92(line: &mut Line) -> Checked<()> {
    line.state.coordinates.clear_g92();
    Ok(())
}

fn suspend_g92(line: &mut Line) -> Checked<()> {
    line.state.coordinates.suspend_g92();
    Ok(())
}

fn restore_g92(line: &mut Line) -> Checked<()> {
    line.state.coordinates.restore_g92();
    Ok(())
}

/// G92: the offset that gives the current position the named coordinates.
fn set_position_offset(line: &mut Line) -> Checked<()> {
    needs_axes(line, "G92")?;
    let coordinates = &line.state.coordinates;
    let at = coordinates.to_program(&line.state.path.position);
    let mut g92 = *coordinates.g92();
    for (axis, value) in line.named_axes() {
        g92[axis] += at[axis] - value;
    }
    assume_offsets(line, true);
    line.state.coordinates.set_g92(g92);
    Ok(())
}

fn set_local_offset(line: &mut Line) -> Checked<()> {
    needs_axes(line, "G52")?;
    let mut g92 = *line.state.coordinates.g92();
    for (axis, value) in line.named_axes() {
        g92[axis] = value;
    }
    assume_offsets(line, false);
    line.state.coordinates.set_g92(g92);
    Ok(())
}

fn needs_axes(line: &Line, word: &str) -> Checked<()> {
    if line.words.present & AXIS_MASK == 0 {
        let message = format!("{word} needs at least one axis word");
        return Err(line.orders.error(Group::NonModal, "axis-missing", message));
    }
    Ok(())
}

/// Whether the offsets of the named axes now follow from what the first pass has assumed.
fn assume_offsets(line: &mut Line, from_position: bool) {
    let named = line.letters.axes_of(line.words.present & AXIS_MASK);
    let coordinates = &mut line.state.coordinates;
    let of_position = if from_position {
        line.state.path.assumed | coordinates.assumed
    } else {
        0
    };
    coordinates.assumed |= named
        & if line.reads_assumed.get() {
            u32::MAX
        } else {
            of_position
        };
}

/// G10.
fn set_data(line: &mut Line) -> Checked<()> {
    match line.words.integer(b'L', 0..=999)? {
        // Reads the tool table again: it is what this run has made of it.
        Some(0) => refuse_letters(line, "G10 L0", "PRXYZABCUVWIJQ"),
        Some(1) => set_tool(line, ToolOrigin::Value),
        Some(10) => set_tool(line, ToolOrigin::Position),
        Some(11) => set_tool(line, ToolOrigin::Fixture),
        Some(2) => {
            refuse_letters(line, "G10 L2", "IJQ")?;
            set_system(line)
        }
        Some(20) => {
            refuse_letters(line, "G10 L20", "IJQ")?;
            set_system_here(line)
        }
        Some(other) => {
            let message = format!(
                "G10 L{other} is not known: L0, L1, L10 and L11 (tools), L2 and L20 (systems) are"
            );
            Err(line.words.error(b'L', "refused", message))
        }
        None => Err(line.orders.error(
            Group::NonModal,
            "word-missing",
            "G10 needs L: 1, 2, 10, 11 or 20",
        )),
    }
}

fn refuse_letters(line: &Line, word: &str, letters: &str) -> Checked<()> {
    let Some((letter, span)) = line.words.first_of(mask(letters)) else {
        return Ok(());
    };
    let message = format!("{word} does not take {}", letter as char);
    Err(LineError::new(span, "unused-word", message))
}

/// The index of the coordinate system that P names.
fn system(line: &Line) -> Checked<usize> {
    match line.words.integer(b'P', 0..=SYSTEMS as u32)? {
        Some(0) => Ok(line.state.coordinates.active()),
        Some(number) => Ok(number as usize - 1),
        None => {
            let message = "G10 needs P, the coordinate system (0 to 9)";
            Err(line.orders.error(Group::NonModal, "word-missing", message))
        }
    }
}

/// G10 L2: the origin of a system, and its rotation R in degrees.
fn set_system(line: &mut Line) -> Checked<()> {
    let system = system(line)?;
    let mut origin = *line.state.coordinates.origin(system);
    for (axis, value) in line.named_axes() {
        origin[axis] = value;
    }
    if let Some(degrees) = line.words.get(b'R') {
        if degrees != 0.0 && !line.state.coordinates.can_rotate() {
            return Err(line
                .words
                .error(b'R', "axis", "a rotation needs the linear axes X and Y"));
        }
        line.state
            .coordinates
            .set_rotation(system, degrees.to_radians());
    }
    assume_offsets(line, false);
    line.state.coordinates.set_origin(system, origin);
    Ok(())
}

/// G10 L20: the origin at which the current position gets the named coordinates.
fn set_system_here(line: &mut Line) -> Checked<()> {
    let system = system(line)?;
    if line.words.has(b'R') {
        return Err(line.words.error(
            b'R',
            "unused-word",
            "G10 L20 takes no R: L2 sets the rotation",
        ));
    }
    let wanted = wanted(line);
    assume_offsets(line, true);
    let position = line.state.path.position;
    line.state
        .coordinates
        .shift_origin(system, &position, &wanted);
    Ok(())
}

/// The values of the named axes, by axis.
fn wanted(line: &Line) -> Vec<Option<f64>> {
    let mut wanted = vec![None; line.letters.count()];
    for (axis, value) in line.named_axes() {
        wanted[axis] = Some(value);
    }
    wanted
}

/// What the axis words of a tool mean.
#[derive(Clone, Copy, PartialEq, Eq)]
enum ToolOrigin {
    /// L1: the offset itself.
    Value,
    /// L10: the coordinates that the current position gets in the system in force.
    Position,
    /// L11: the same in the system of G59.3, without G92.
    Fixture,
}

/// G10 L1, L10, L11: a row of the tool table, for this run only. It acts with the next G43.
fn set_tool(line: &mut Line, from: ToolOrigin) -> Checked<()> {
    let Some(number) = line.words.integer(b'P', 1..=tool::MAX_TOOL)? else {
        return Err(line.orders.error(
            Group::NonModal,
            "word-missing",
            "G10 needs P, the number of the tool",
        ));
    };
    let zero = Tool {
        number,
        pocket: None,
        offset: AxisVector::ZERO,
        diameter_mm: 0.0,
    };
    // Without a table every tool has a row of zeros, where lengths of zero are safe at all.
    let without_table =
        || (line.config.tools.is_empty() && line.config.zero_length_without_table).then_some(zero);
    let Some(mut tool) = line
        .state
        .tools
        .find(number)
        .copied()
        .or_else(without_table)
    else {
        return Err(line
            .words
            .error(b'P', "tool", format!("the tool table has no tool {number}")));
    };
    let at = match from {
        ToolOrigin::Value => AxisVector::ZERO,
        ToolOrigin::Position => line
            .state
            .coordinates
            .without_tool(&line.state.path.position, false),
        ToolOrigin::Fixture => line
            .state
            .coordinates
            .without_tool(&line.state.path.position, true),
    };
    for (axis, value) in line.named_axes() {
        tool.offset[axis] = if from == ToolOrigin::Value {
            value
        } else {
            at[axis] - value
        };
    }
    assume_offsets(line, from != ToolOrigin::Value);
    if let Some(radius) = line.words.not_negative(b'R')? {
        tool.diameter_mm = 2.0 * radius * line.state.modes.unit_mm;
    }
    if line.state.tools.set(tool) {
        Ok(())
    } else {
        Err(line.words.error(b'P', "tool", "the tool table is full"))
    }
}

/// G28.1 and G30.1.
fn store(line: &mut Line, which: usize) -> Checked<()> {
    line.state.coordinates.reference[which] = line.state.path.position;
    Ok(())
}

/// G28 and G30: a rapid to the programmed point, then one of the named axes (or all) to the reference position.
fn go_to_reference(line: &mut Line, which: usize) -> Checked<()> {
    let named = line.words.present & AXIS_MASK;
    line.advance();
    line.rapid()?;
    for axis in 0..line.letters.count() {
        if named == 0 || line.words.has(line.letters.letter(axis)) {
            line.state.path.position[axis] = line.state.coordinates.reference[which][axis];
            line.state.path.uncertain &= !(1 << axis);
        }
    }
    line.rapid()
}

#[cfg(test)]
mod tests {
    use crate::testing::{ends, last, messages, mill, run_on, short};

    #[test]
    fn offsets_add_up() {
        assert_eq!(ends("G10 L2 P1 X10 Y20\nG0 X1 Y1"), [["11", "21", "0"]]);
        assert_eq!(
            ends("G0 X50\nG10 L20 P1 X0\nG0 X1"),
            [["50", "0", "0"], ["51", "0", "0"]]
        );
        assert_eq!(
            ends("G10 L2 P9 X5\nG59.3 G0 X1\nG54 X1"),
            [["6", "0", "0"], ["1", "0", "0"]]
        );
        assert_eq!(
            ends("G91 G10 L2 P1 X5\nG10 L2 P0 X5\nG90 G0 X0"),
            [["5", "0", "0"]],
            "G91 has no effect on it"
        );
        assert_eq!(
            ends("G0 X10\nG92 X0 Y5\nX1 Y6\nG92.2\nX1\nG92.3\nX1\nG92.1\nX2")[1..],
            [
                ["11", "1", "0"],
                ["1", "1", "0"],
                ["11", "1", "0"],
                ["2", "1", "0"]
            ]
        );
        assert_eq!(
            ends("G10 L2 P1 X10\nG92 X5\nG53 G0 X7\nX0"),
            [["7", "0", "0"], ["-5", "0", "0"]]
        );
        assert_eq!(
            ends("G52 X5\nG0 X1\nG52 X0 Y2\nG0 X1 Y0"),
            [["6", "0", "0"], ["1", "2", "0"]]
        );
        // L20 leaves G92 and the tool out of the origin: the current position is what it says.
        assert_eq!(
            ends("G43 H1 G0 Z5\nG92 X3\nG10 L20 P1 X1 Z2\nG0 X2 Z4")[1..],
            [["1", "0", "27"]]
        );
        assert_eq!(
            short(last("G10 L2 P1 X10\nG92 Y5\nG43 H2 G0 X1").offset[2]),
            "25"
        );
        assert_eq!(
            ends("G10 L1 P2 Z3 R4 I10 J-20 Q7\nG43 H2 G0 Z#5410"),
            [["0", "0", "3"]]
        );
        assert!(messages("G10 L2 P1 X1 Q3")[0].contains("L2 does not take Q"));
        assert!(messages("G10 L0").is_empty());
        assert!(messages("G10 L0 P1")[0].contains("L0 does not take P"));
    }

    #[test]
    fn reference_positions() {
        assert_eq!(
            ends("G0 X5 Y5 Z5\nG28.1\nG0 X9 Y9 Z9\nG28 Z20")[2..],
            [["9", "9", "20"], ["9", "9", "5"]]
        );
        assert_eq!(
            ends("G0 X5 Y5 Z5\nG30.1\nG0 X9\nG30")[2..],
            [["5", "5", "5"]]
        );
        assert_eq!(ends("G0 X5 Z5\nG91 G28 Z0")[1..], [["5", "0", "0"]]);
        // A motion word beside G28 only sets the mode.
        assert_eq!(
            ends("F60 G0 X5 Z5\nG1 G91 G28 Z0\nX1")[1..],
            [["5", "0", "0"], ["6", "0", "0"]]
        );
    }

    #[test]
    fn a_rotated_system_turns_moves_arcs_and_offsets() {
        assert_eq!(
            ends("G10 L2 P1 X10 R90\nG0 X5\nY2")[..],
            [["0", "5", "0"], ["8", "5", "0"]]
        );
        assert_eq!(ends("G10 L2 P1 R90\nG91 G0 X5\nX1")[1], ["0", "6", "0"]);
        // The offset of G92 lies before the rotation, machine coordinates after it.
        assert_eq!(
            ends("G10 L2 P1 R90\nG92 X-3\nG0 X2\nG53 X1"),
            [["0", "5", "0"], ["1", "5", "0"]]
        );
        assert_eq!(
            ends("G10 L2 P1 R90\nG0 X5\nG10 L20 P1 X1 Y1\nG0 X0 Y0")[1],
            ["1", "4", "0"]
        );
        let arc = last("F60 G10 L2 P1 R90\nG2 X2 I1");
        assert_eq!(
            arc.arc.center_mm.map(short),
            ["0".to_owned(), "1".to_owned()]
        );
        assert_eq!(short(last("G10 L2 P1 R30\nG0 X#5230").end[0]), "25.981");
    }

    #[test]
    fn a_tool_is_measured_where_it_stands() {
        assert_eq!(
            ends("G53 G0 Z30\nG10 L10 P1 Z3\nG43 H1\nG0 Z4")[1],
            ["0", "0", "31"]
        );
        assert_eq!(
            ends("G10 L2 P9 Z5\nG53 G0 Z30\nG10 L11 P1 Z3\nG43 H1\nG0 Z1")[1],
            ["0", "0", "23"]
        );
    }

    #[test]
    fn machine_coordinates_are_no_mode() {
        assert_eq!(run_on(mill(), "G53 G0\nX1\nG53 X2").1.len(), 0);
        for wrong in ["G53", "G0 X1\nG53", "G53 G90 S100"] {
            let found = run_on(mill(), wrong).1;
            assert!(
                found.len() == 1 && found[0].code == "axis-missing",
                "{wrong}: {found:?}"
            );
        }
    }
}
