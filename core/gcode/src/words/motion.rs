//! G0, G1 and G80: straight lines.

use tandem_sdk::BlockKind;

use super::{Action, Group, Shape, Word, compensation, lathe};
use crate::line::Line;
use crate::line_error::Checked;

pub(super) const WORDS: &[Word] = &[
    Word::new(
        "G0",
        Group::Motion,
        "XYZABCUVW",
        "rapid",
        Action::Move(Shape::Straight, rapid),
        "G0 X1",
    ),
    Word::new(
        "G1",
        Group::Motion,
        "XYZABCUVW",
        "straight line at the feed",
        Action::Move(Shape::Straight, feed),
        "G1 X1",
    ),
    Word::new(
        "G80",
        Group::CycleCancel,
        "",
        "canned cycle off; alone it also ends the motion mode",
        Action::Act(super::nothing),
        "G80",
    ),
];

/// G53 asks for a place of the machine, which a distance is none.
#[inline]
fn refuse_distance(line: &Line) -> Checked<()> {
    if line.in_machine_coordinates() && !line.state.modes.absolute {
        return Err(line.orders.error(
            Group::NonModal,
            "conflict",
            "G53 does not go with G91: machine coordinates are absolute",
        ));
    }
    Ok(())
}

#[inline]
fn rapid(line: &mut Line) -> Checked<()> {
    refuse_distance(line)?;
    line.advance();
    straight(line, BlockKind::Rapid)
}

#[inline]
fn feed(line: &mut Line) -> Checked<()> {
    refuse_distance(line)?;
    line.advance();
    straight(line, BlockKind::Line)
}

/// A straight line from where the last block ended to the programmed position.
#[inline]
pub(crate) fn straight(line: &mut Line, kind: BlockKind) -> Checked<()> {
    if line.state.compensation.is_on() {
        return compensation::straight(line, kind);
    }
    if line.state.spindle.surface.is_some() {
        return lathe::straight_at_surface_speed(line, kind);
    }
    line_to(line, kind)
}

/// The same in one block.
#[inline]
pub(super) fn line_to(line: &mut Line, kind: BlockKind) -> Checked<()> {
    let end = line.state.path.block_end();
    let displacement = end - line.state.path.last_end;
    let length_mm = line.config.axes.path_length(&displacement);
    let feed_mm_per_s = match kind {
        BlockKind::Rapid => f64::INFINITY,
        _ => line.feed(length_mm, line.moves_linear(&displacement))?,
    };
    if length_mm == 0.0 {
        return Ok(());
    }
    for axis in 0..line.letters.count() {
        if displacement[axis] != 0.0 {
            line.check_travel(axis, end[axis], end[axis])?;
        }
    }
    line.push_to(end, |block| {
        block.kind = kind;
        block.length_mm = length_mm;
        block.feed_mm_per_s = feed_mm_per_s;
    });
    Ok(())
}

#[cfg(test)]
mod tests {
    use crate::testing::{assert_items, blocks, ends, mill, run_on};

    #[test]
    fn no_motion_no_block() {
        assert_items("F60 G1\nG1 X0 Y0\nG0 X0\nG91 X0\nG64 G17", &["End"]);
        // The rounding of offsets is no motion either.
        assert_eq!(
            blocks("G10 L2 P1 X0.1\nG92 Y1\nG0 X0.2\nG53 X0.3\nX0.2").len(),
            1
        );
    }

    #[test]
    fn the_motion_mode_holds_until_another_motion_word() {
        assert_items(
            "F60 G1 X1\nY2\nG80 G0 X0\nY0",
            &[
                "1: Line 0 to 1 0 0 0 length 1 feed 1",
                "2: Line 1 to 1 2 0 0 length 2 feed 1",
                "3: Rapid 2 to 0 2 0 0",
                "4: Rapid 3 to 0 0 0 0",
                "End",
            ],
        );
    }

    #[test]
    fn the_word_that_ends_the_motion_mode_moves_nothing() {
        let (items, errors) = run_on(mill(), "G0 X1\nG80 X5\nG80 G0 X2\nG80 G92 X0\nG52");
        let found: Vec<_> = errors
            .iter()
            .map(|error| (error.line, error.code))
            .collect();
        assert_eq!(found, [(2, "motion-missing"), (5, "axis-missing")]);
        let blocks = items
            .iter()
            .filter(|item| matches!(item, crate::Item::Block(..)));
        assert_eq!(blocks.count(), 2);
    }

    #[test]
    fn polar_coordinates_stand_for_x_and_y() {
        assert_eq!(ends("G0 @10 ^30")[0], ["8.66", "5", "0"]);
        // The direction, or the distance, stays where only the other is given; with G91 both add up.
        assert_eq!(
            ends("G0 @10 ^0\nG91 ^90\n@5 Z1\nG90 ^180")[1..],
            [["0", "10", "0"], ["0", "15", "1"], ["-15", "0", "1"]]
        );
        assert_eq!(ends("G20 G0 @1 ^90")[0], ["0", "25.4", "0"]);
        assert_eq!(ends("G10 L2 P1 X5 R90\nG0 @10 ^90")[0], ["-5", "0", "0"]);
        assert_eq!(
            ends("G0 X10\nG91 G81 Z-1 R1 ^90 L2 F60\nG80")[6],
            ["-10", "0", "0"]
        );
        for wrong in [
            "G0 @1 X2",
            "G53 G0 @1",
            "G92 @1",
            "G1 F60 @1 @2",
            "@1",
            "F60 G5 @1 I1 J1 P1 Q1",
        ] {
            let (_, errors) = run_on(mill(), wrong);
            assert!(!errors.is_empty(), "{wrong}");
        }
    }
}
