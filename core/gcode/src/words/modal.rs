//! M70 to M73: the modal state is saved and restored.

use tandem_sdk::AxisVector;

use super::coolant::{self, Coolant};
use super::modes::Modes;
use super::overrides::{self, Permits};
use super::spindle::{self, Spindle};
use super::{Action, Group, Word};
use crate::line::Line;
use crate::line_error::Checked;

pub(super) const WORDS: &[Word] = &[
    Word::new(
        "M70",
        Group::ModalState,
        "",
        "save the modal state of this call",
        Action::Act(save),
        "M70",
    ),
    Word::new(
        "M71",
        Group::ModalState,
        "",
        "forget the saved modal state",
        Action::Act(forget),
        "M70\nM71",
    ),
    Word::new(
        "M72",
        Group::ModalState,
        "",
        "restore the saved modal state",
        Action::Act(restore),
        "M70\nG91\nM72",
    ),
    Word::new(
        "M73",
        Group::ModalState,
        "",
        "save the modal state, and restore it when the subroutine ends",
        Action::Act(save_until_the_end),
        "M73",
    ),
];

/// What M70 saves: all modes but that of motion and the radius compensation, as in LinuxCNC.
#[derive(Clone, Debug)]
struct Saved {
    modes: Modes,
    system: usize,
    /// G92 was in force; which offset it is, is not saved.
    g92_applies: bool,
    /// The length of the tool in force, and the tool that was in the spindle.
    tool: AxisVector,
    in_spindle: u32,
    cycles_to_initial: bool,
    spindle: Spindle,
    coolant: Coolant,
    permits: Permits,
}

/// What each call of a subroutine, and the program itself, has saved.
#[derive(Clone, Debug, Default)]
pub(crate) struct SavedStates {
    program: Level,
    calls: Vec<Level>,
}

#[derive(Clone, Debug, Default)]
struct Level {
    saved: Option<Box<Saved>>,
    /// M73: restored when the call ends.
    at_end: bool,
}

impl SavedStates {
    /// A subroutine begins.
    pub fn enter(&mut self) {
        self.calls.push(Level::default());
    }

    /// All subroutines are over, and nothing of them is restored.
    pub fn leave_all(&mut self) {
        self.calls.clear();
    }

    fn level(&mut self) -> &mut Level {
        self.calls.last_mut().unwrap_or(&mut self.program)
    }
}

/// A subroutine ends: what M73 has saved in it is restored.
pub(crate) fn leave(line: &mut Line) {
    if let Some(Level {
        saved: Some(saved),
        at_end: true,
    }) = line.state.saved.calls.pop()
    {
        put_back(line, &saved);
    }
}

fn save(line: &mut Line) -> Checked<()> {
    let state = &line.state;
    let saved = Saved {
        modes: state.modes.clone(),
        system: state.coordinates.active(),
        g92_applies: state.coordinates.g92_applies(),
        tool: *state.coordinates.tool(),
        in_spindle: state.tools.in_spindle,
        cycles_to_initial: state.cycles.return_to_initial(),
        spindle: state.spindle,
        coolant: state.coolant,
        permits: state.permits,
    };
    *line.state.saved.level() = Level {
        saved: Some(Box::new(saved)),
        at_end: false,
    };
    Ok(())
}

fn save_until_the_end(line: &mut Line) -> Checked<()> {
    save(line)?;
    line.state.saved.level().at_end = true;
    Ok(())
}

fn forget(line: &mut Line) -> Checked<()> {
    *line.state.saved.level() = Level::default();
    Ok(())
}

fn restore(line: &mut Line) -> Checked<()> {
    let Some(saved) = line.state.saved.level().saved.clone() else {
        let message = "no modal state has been saved in this call: M70 or M73 must come before";
        return Err(line.orders.error(Group::ModalState, "modal-state", message));
    };
    put_back(line, &saved);
    Ok(())
}

fn put_back(line: &mut Line, saved: &Saved) {
    line.state.modes = saved.modes.clone();
    line.state.coordinates.select(saved.system);
    let coordinates = &mut line.state.coordinates;
    match (coordinates.g92_applies(), saved.g92_applies) {
        (true, false) => coordinates.suspend_g92(),
        (false, true) => coordinates.restore_g92(),
        _ => {}
    }
    line.state.cycles.set_to_initial(saved.cycles_to_initial);
    // The length of another tool would drive the one in the spindle to the wrong height.
    if saved.in_spindle == line.state.tools.in_spindle {
        line.state.coordinates.set_tool(saved.tool);
    }
    spindle::set(line, saved.spindle);
    coolant::switch(line, saved.coolant);
    overrides::put_back(line, saved.permits);
}

#[cfg(test)]
mod tests {
    use crate::testing::{assert_items, ends, messages};

    #[test]
    fn what_was_saved_is_in_force_again() {
        assert_items(
            "F60 S60 G21 G90 M3 M8 G64\nM70\nG91 G61 M5 M9 M49 F120 G55\nM72\nG1 X1 F60",
            &[
                "1: Spindle 0 6.283 before 0",
                "1: Flood 0 1 before 0",
                "3: Spindle 0 0 before 0",
                "3: Flood 0 0 before 0",
                "3: FeedOverride 0 0 before 0",
                "3: SpindleOverride 0 0 before 0",
                "4: Spindle 0 6.283 before 0",
                "4: Flood 0 1 before 0",
                "4: FeedOverride 0 1 before 0",
                "4: SpindleOverride 0 1 before 0",
                "5: Line 0 to 1 0 0 0 length 1 feed 1",
                "5: Dwell 1 to 1 0 0 0 for 0",
                "5: Spindle 0 0 before 2",
                "5: Flood 0 0 before 2",
                "End",
            ],
        );
        assert_eq!(
            ends("G10 L2 P2 X9\nM70\nG20 G55 G43 H1\nM72\nG0 X1 Z1"),
            [["1", "0", "1"]]
        );
        // The length of a tool that is no longer in the spindle stays out.
        assert_eq!(
            ends("T1 M6 G43\nM70\nT2 M6 G43\nM72\nG0 Z0"),
            [["0", "0", "25"]]
        );
    }

    #[test]
    fn whether_g92_is_in_force_is_restored_and_not_which_offset() {
        for (program, x) in [
            ("M70\nG92 X4\nM72\nG0 X1", "1"),
            ("G0 X1\nG92 X4\nM70\nG92.2\nM72\nG0 X0", "-3"),
            ("G0 X1\nG92 X4\nM70\nG92.1\nM72\nG0 X0", "0"),
            ("G0 X1\nG92 X4\nM70\nG92 X7\nM72\nG0 X0", "-6"),
            ("G92 X0\nM70\nG92 X7\nM72\nG0 X0", "-7"),
        ] {
            assert_eq!(ends(program).last().unwrap()[0], x, "{program}");
        }
    }

    #[test]
    fn nothing_is_restored_that_was_not_saved() {
        assert!(messages("M72")[0].starts_with("1:1 [modal-state]"));
        assert!(messages("M70\nM71\nM72")[0].starts_with("3:1 [modal-state]"));
    }
}
