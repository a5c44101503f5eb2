//! M0, M1, M60, M2 and M30: stops and the end of the program.

use tandem_sdk::EventKind;

use super::{Action, Group, Word, compensation, coolant, spindle};
use crate::item::Item;
use crate::line::Line;
use crate::line_error::Checked;

pub(super) const WORDS: &[Word] = &[
    Word::new(
        "M0",
        Group::Stop,
        "",
        "stop until the operator resumes",
        Action::Act(stop),
        "M0",
    ),
    Word::new(
        "M1",
        Group::Stop,
        "",
        "stop where the optional stop is on",
        Action::Act(optional_stop),
        "M1",
    ),
    Word::new(
        "M60",
        Group::Stop,
        "",
        "stop for a change of pallets, until the operator resumes",
        Action::Act(pallets),
        "M60",
    ),
    Word::new(
        "M2",
        Group::Stop,
        "",
        "end of the program",
        Action::Act(program_end),
        "M2",
    ),
    Word::new(
        "M30",
        Group::Stop,
        "",
        "end of the program",
        Action::Act(program_end),
        "M30",
    ),
];

fn stop(line: &mut Line) -> Checked<()> {
    line.rest();
    line.event(EventKind::ProgramStop, 0, 0.0);
    Ok(())
}

fn pallets(line: &mut Line) -> Checked<()> {
    line.rest();
    line.event(EventKind::ProgramStop, 60, 0.0);
    Ok(())
}

fn optional_stop(line: &mut Line) -> Checked<()> {
    line.rest();
    line.event(EventKind::OptionalStop, 0, 0.0);
    Ok(())
}

fn program_end(line: &mut Line) -> Checked<()> {
    compensation::off(line)?;
    line.rest();
    switch_off(line);
    line.event(EventKind::ProgramEnd, 0, 0.0);
    end(line);
    Ok(())
}

fn switch_off(line: &mut Line) {
    spindle::stop(line);
    coolant::stop(line);
}

/// Switches off what still runs and ends the stream.
pub(crate) fn end(line: &mut Line) {
    switch_off(line);
    line.out.push(Item::End);
    line.state.ended = true;
}

#[cfg(test)]
mod tests {
    use crate::testing::assert_items;

    #[test]
    fn a_change_of_pallets_is_a_stop() {
        assert_items(
            "F60 G1 X1\nM60\nX2",
            &[
                "1: Line 0 to 1 0 0 0 length 1 feed 1",
                "2: Dwell 1 to 1 0 0 0 for 0",
                "2: ProgramStop 60 0 before 2",
                "3: Line 2 to 2 0 0 0 length 1 feed 1",
                "End",
            ],
        );
    }

    #[test]
    fn nothing_follows_the_end() {
        assert_items("M2\nG0 X1", &["1: ProgramEnd 0 0 before 0", "End"]);
        assert_items(
            "%\nG0 X1\n%\nG41 nonsense",
            &["2: Rapid 0 to 1 0 0 0", "End"],
        );
        assert_items("", &["End"]);
    }
}
