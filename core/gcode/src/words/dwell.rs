//! G4: dwell.

use super::{Action, Group, Word};
use crate::line::Line;
use crate::line_error::Checked;

pub(super) const WORDS: &[Word] = &[Word::new(
    "G4",
    Group::NonModal,
    "P",
    "dwell of P seconds",
    Action::Act(dwell),
    "G4 P0.5",
)];

fn dwell(line: &mut Line) -> Checked<()> {
    let missing = || {
        let what = "G4 needs P, the dwell in seconds";
        let beside = if line.words.has(b'S') {
            "; S is the speed of the spindle (RepRap firmware takes G4 S for seconds, other controls for revolutions)"
        } else {
            ""
        };
        let message = format!("{what}{beside}");
        line.orders.error(Group::NonModal, "word-missing", message)
    };
    let dwell_s = line.words.not_negative(b'P')?.ok_or_else(missing)?;
    line.dwell(dwell_s);
    Ok(())
}

#[cfg(test)]
mod tests {
    use crate::testing::{assert_items, mill, run_on};

    #[test]
    fn a_dwell_that_another_firmware_reads_is_explained() {
        let told = |text| run_on(mill(), text).1.first().map(ToString::to_string);
        assert!(told("G4 S3").is_some_and(|text| text.contains("RepRap")));
        assert!(
            told("G4").is_some_and(|text| text.contains("P, the dwell") && !text.contains('S'))
        );
    }

    #[test]
    fn a_dwell_is_a_block_at_rest() {
        assert_items(
            "G0 X1\nG4 P1.5",
            &[
                "1: Rapid 0 to 1 0 0 0",
                "2: Dwell 1 to 1 0 0 0 for 1.5",
                "End",
            ],
        );
    }
}
