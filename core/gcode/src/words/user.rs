//! M100 to M199: commands of the machine's own.

use tandem_sdk::EventKind;

use super::{Action, Group, Word};
use crate::config::FIRST_USER_COMMAND;
use crate::item::{Item, UserCommand};
use crate::line::Line;
use crate::line_error::Checked;

pub(super) const WORDS: &[Word] = &[Word::new(
    "M100",
    Group::User,
    "PQ",
    "M100 to M199: run the program that the machine file lists for the number, with P and Q, at rest",
    Action::Act(command),
    "M100 P1 Q2",
)];

/// Numbers in tenths of the words that share the one row.
pub(super) const TENTHS: std::ops::RangeInclusive<u16> = 1000..=1990;

fn command(line: &mut Line) -> Checked<()> {
    let codes = line.words.m.as_slice();
    let code = codes
        .iter()
        .find(|code| TENTHS.contains(&code.tenths))
        .map_or(FIRST_USER_COMMAND, |c| u32::from(c.tenths / 10));
    if !line.config.user_commands.contains(&code) {
        let message = format!(
            "M{code}: the machine file lists no such command ([user_commands] M{code} = \"program\")"
        );
        return Err(line.orders.error(Group::User, "refused", message));
    }
    line.rest();
    let [p, q] = [b'P', b'Q'].map(|letter| line.words.get(letter));
    line.event(EventKind::UserCommand, code, p.unwrap_or(-1.0));
    let number = line.state.line;
    let before_block = line.state.path.next_index;
    line.out.push(Item::Command(UserCommand {
        line: number,
        before_block,
        number: code,
        p,
        q,
    }));
    Ok(())
}

#[cfg(test)]
mod tests {
    use crate::testing::{assert_items, messages};

    #[test]
    fn a_listed_command_is_run_at_rest() {
        assert_items(
            "F60 G1 X1\nM101 P2 Q-0.5\nM199",
            &[
                "1: Line 0 to 1 0 0 0 length 1 feed 1",
                "2: Dwell 1 to 1 0 0 0 for 0",
                "2: UserCommand 101 2 before 2",
                "2: Command 101 Some(2.0) Some(-0.5) before 2",
                "3: UserCommand 199 -1 before 2",
                "3: Command 199 None None before 2",
                "End",
            ],
        );
    }

    #[test]
    fn another_command_is_refused() {
        assert!(
            messages("M102")[0]
                .starts_with("1:1 [refused] M102: the machine file lists no such command")
        );
        assert!(messages("M101 M199")[0].starts_with("1:6 [conflict]"));
        assert!(messages("M101.5")[0].starts_with("1:1 [unknown-code] M101.5"));
        assert!(messages("M101 R1")[0].contains("takes the word R"));
    }
}
