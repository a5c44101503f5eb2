//! M7, M8 and M9: coolant.

use tandem_sdk::EventKind;

use super::{Action, Group, Word};
use crate::line::Line;
use crate::line_error::Checked;

pub(super) const WORDS: &[Word] = &[
    Word::new(
        "M7",
        Group::Mist,
        "",
        "mist coolant on",
        Action::Act(mist_on),
        "M7",
    ),
    Word::new(
        "M8",
        Group::Flood,
        "",
        "flood coolant on",
        Action::Act(flood_on),
        "M8",
    ),
    Word::new(
        "M9",
        Group::CoolantOff,
        "",
        "coolant off",
        Action::Act(off),
        "M9",
    ),
];

/// What flows.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Coolant {
    pub mist: bool,
    pub flood: bool,
}

fn mist_on(line: &mut Line) -> Checked<()> {
    let flood = line.state.coolant.flood;
    switch(line, Coolant { mist: true, flood });
    Ok(())
}

fn flood_on(line: &mut Line) -> Checked<()> {
    let mist = line.state.coolant.mist;
    switch(line, Coolant { mist, flood: true });
    Ok(())
}

fn off(line: &mut Line) -> Checked<()> {
    if line.orders.has(Group::Mist) || line.orders.has(Group::Flood) {
        let message = "M9 and M7 or M8 exclude each other in a line";
        return Err(line.orders.error(Group::CoolantOff, "conflict", message));
    }
    stop(line);
    Ok(())
}

/// Stops what flows.
pub(crate) fn stop(line: &mut Line) {
    switch(line, Coolant::default());
}

pub(super) fn switch(line: &mut Line, wanted: Coolant) {
    let before = std::mem::replace(&mut line.state.coolant, wanted);
    let value = |on: bool| f64::from(u8::from(on));
    if wanted.mist != before.mist {
        line.event(EventKind::Mist, 0, value(wanted.mist));
    }
    if wanted.flood != before.flood {
        line.event(EventKind::Flood, 0, value(wanted.flood));
    }
}

#[cfg(test)]
mod tests {
    use crate::testing::assert_items;

    #[test]
    fn only_what_changes_is_switched() {
        assert_items(
            "M7 M8\nM8\nM9",
            &[
                "1: Mist 0 1 before 0",
                "1: Flood 0 1 before 0",
                "3: Mist 0 0 before 0",
                "3: Flood 0 0 before 0",
                "End",
            ],
        );
    }
}
