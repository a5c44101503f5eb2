//! M3, M4, M5 and S: the spindle.

use std::f64::consts::PI;

use tandem_sdk::EventKind;

use super::{Action, Group, Word};
use crate::fault::Checked;
use crate::line::Line;

pub(super) const WORDS: &[Word] = &[
    Word::new("M3", Group::Spindle, "", "spindle clockwise", Action::Act(|line| turn(line, 1)), "S100 M3"),
    Word::new("M4", Group::Spindle, "", "spindle counter-clockwise", Action::Act(|line| turn(line, -1)), "S100 M4"),
    Word::new("M5", Group::Spindle, "", "spindle stop", Action::Act(|line| turn(line, 0)), "M5"),
    Word::new(
        "G97",
        Group::SpindleMode,
        "",
        "spindle speed in revolutions a minute (always so)",
        Action::Act(super::nothing),
        "G97 S100",
    ),
];

/// Speed and direction of the spindle.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Spindle {
    /// 1 clockwise, −1 counter-clockwise, 0 stopped.
    pub direction: i8,
    pub speed_rad_per_s: f64,
}

impl Spindle {
    /// The speed commanded, positive clockwise.
    pub fn command_rad_per_s(self) -> f64 {
        match self.direction {
            0 => 0.0,
            direction => f64::from(direction) * self.speed_rad_per_s,
        }
    }
}

/// The word S in a line without M3, M4 and M5.
pub(crate) fn speed(line: &mut Line) -> Checked<()> {
    turn(line, line.state.spindle.direction)
}

/// A change of direction needs rest, a change of speed does not.
pub(super) fn turn(line: &mut Line, direction: i8) -> Checked<()> {
    let mut spindle = Spindle { direction, ..line.state.spindle };
    if let Some(speed) = line.words.not_negative(b'S')? {
        spindle.speed_rad_per_s = speed * PI / 30.0;
    }
    set(line, spindle);
    Ok(())
}

/// The spindle is to turn so.
pub(super) fn set(line: &mut Line, spindle: Spindle) {
    let before = line.state.spindle;
    let turns = spindle.direction != before.direction;
    if turns {
        line.rest();
    }
    line.state.spindle = spindle;
    if turns || spindle.command_rad_per_s() != before.command_rad_per_s() {
        line.event(EventKind::Spindle, 0, spindle.command_rad_per_s());
    }
}

/// Stops the spindle where it turns.
pub(crate) fn stop(line: &mut Line) {
    if line.state.spindle.direction != 0 {
        line.rest();
        line.state.spindle.direction = 0;
        line.event(EventKind::Spindle, 0, 0.0);
    }
}

#[cfg(test)]
mod tests {
    use crate::testing::assert_items;

    #[test]
    fn a_change_of_direction_rests_and_a_change_of_speed_does_not() {
        assert_items(
            "F60 G1 X1 S60\nM3\nX2\nX3 S30\nM4 X4\nM5",
            &[
                "1: Line 0 to 1 0 0 0 length 1 feed 1",
                "2: Dwell 1 to 1 0 0 0 for 0",
                "2: Spindle 0 6.283 before 2",
                "3: Line 2 to 2 0 0 0 length 1 feed 1",
                "4: Spindle 0 3.142 before 3",
                "4: Line 3 to 3 0 0 0 length 1 feed 1",
                "5: Dwell 4 to 3 0 0 0 for 0",
                "5: Spindle 0 -3.142 before 5",
                "5: Line 5 to 4 0 0 0 length 1 feed 1",
                "6: Dwell 6 to 4 0 0 0 for 0",
                "6: Spindle 0 0 before 7",
                "End",
            ],
        );
    }
}
