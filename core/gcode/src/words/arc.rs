//! G2 and G3 to blocks.

use tandem_sdk::{ArcGeometry, AxisVector, Block, BlockKind};

use super::circle::{Ends, Part, Parts, extent, tolerance_mm};
use super::modes::Plane;
use super::{Action, Group, Shape, Word, compensation};
use crate::line::Line;
use crate::line_error::{Checked, LineError, Span};

pub(super) const WORDS: &[Word] = &[
    Word::new(
        "G2",
        Group::Motion,
        "XYZABCUVWIJKRP",
        "arc or helix, clockwise; P turns",
        Action::Move(Shape::Arc, |line| arc(line, true)),
        "G2 X2 Y2 I2",
    ),
    Word::new(
        "G3",
        Group::Motion,
        "XYZABCUVWIJKRP",
        "arc or helix, counter-clockwise; P turns",
        Action::Move(Shape::Arc, |line| arc(line, false)),
        "G3 X2 Y2 R2",
    ),
];

/// Most turns of a helix.
const MAX_TURNS: u32 = 100_000;

fn arc(line: &mut Line, clockwise: bool) -> Checked<()> {
    let uncertain = line.state.path.uncertain;
    line.advance();
    line.refuse_machine_coordinates()?;
    let plane = plane(line)?;
    let compensated = line.state.compensation.is_on();
    let (start, end) = (line.state.path.last_end, line.state.path.block_end());
    let turns = line.words.integer(b'P', 1..=MAX_TURNS)?.unwrap_or(1);
    let pick = |v: &AxisVector| plane.map(|axis| v[axis]);
    let ends = Ends {
        start: pick(&start),
        end: pick(&end),
        clockwise,
        turns,
        tolerance_mm: tolerance_mm(line.state.modes.unit_mm),
    };
    if plane.iter().any(|axis| uncertain >> axis & 1 != 0) {
        line.state.path.last_end = line.state.path.position;
        return Ok(());
    }
    if compensated {
        return beside_arc(line, ends, plane);
    }
    let parts = circle(line, &ends, plane)?;
    let mut helix = end - start;
    for axis in plane {
        helix[axis] = 0.0;
    }
    check_arc_travel(line, plane, &parts, &helix)?;
    push_arcs(line, &parts, plane, end, &helix)
}

/// The arc with radius compensation: it begins where the programmed path has come to.
#[cold]
fn beside_arc(line: &mut Line, ends: Ends, plane: [usize; 2]) -> Checked<()> {
    let ends = Ends {
        start: line.state.compensation.begins(ends.start),
        ..ends
    };
    let parts = circle(line, &ends, plane)?;
    compensation::bent(line, &ends, &parts, plane)
}

/// One block a part; the axes outside the plane move in proportion to the swept angle.
fn push_arcs(
    line: &mut Line,
    all: &Parts,
    plane: [usize; 2],
    end: AxisVector,
    helix: &AxisVector,
) -> Checked<()> {
    let parts = all.as_slice();
    let along = if line.moves_linear(helix) {
        line.config.axes.path_length(helix)
    } else {
        0.0
    };
    let swept: f64 = parts.iter().map(|part| part.arc.sweep_rad).sum();
    let feed_mm_per_s = line.feed(
        parts.iter().map(|part| length_of(part, along, swept)).sum(),
        true,
    )?;
    let block = Block {
        end,
        feed_mm_per_s,
        ..line.state.blank_block()
    };
    push_parts(line, all, plane, &block, helix);
    Ok(())
}

/// One block a part of an arc that is otherwise as `whole`.
pub(super) fn push_parts(
    line: &mut Line,
    parts: &Parts,
    plane: [usize; 2],
    whole: &Block,
    helix: &AxisVector,
) {
    let parts = parts.as_slice();
    let along = if line.moves_linear(helix) {
        line.config.axes.path_length(helix)
    } else {
        0.0
    };
    let swept: f64 = parts.iter().map(|part| part.arc.sweep_rad).sum();
    let mut start = whole.start;
    for (n, part) in parts.iter().enumerate() {
        let mut end = whole.end;
        if n + 1 < parts.len() {
            end = start + *helix * (part.arc.sweep_rad / swept);
            end[plane[0]] = part.end[0];
            end[plane[1]] = part.end[1];
        }
        let arc = ArcGeometry {
            plane: plane.map(|axis| axis as u32),
            ..part.arc
        };
        let length_mm = length_of(part, along, swept);
        line.emit(Block {
            kind: BlockKind::Arc,
            arc,
            length_mm,
            start,
            end,
            ..*whole
        });
        start = end;
    }
}

fn length_of(part: &Part, along: f64, swept: f64) -> f64 {
    (part.arc.radius_mm * part.arc.sweep_rad).hypot(along * part.arc.sweep_rad / swept)
}

/// The axes of the plane in force.
pub(super) fn plane(line: &Line) -> Checked<[usize; 2]> {
    let letters = line.state.modes.plane.letters();
    let axes = letters.map(|letter| line.letters.axis(letter));
    match axes {
        [Some(a), Some(b)] if !line.letters.is_rotary(a) && !line.letters.is_rotary(b) => {
            Ok([a, b])
        }
        _ => {
            let [a, b] = letters.map(char::from);
            let message = format!(
                "an arc in the plane {a}{b} needs two linear axes; this machine has {}",
                line.letters.list()
            );
            Err(line.motion_error("axis", message))
        }
    }
}

fn circle(line: &Line, ends: &Ends, plane: [usize; 2]) -> Checked<Parts> {
    let letters = line
        .state
        .modes
        .plane
        .letters()
        .map(|letter| letter - b'X' + b'I');
    // An offset of zero across the plane says what is so: CAM systems for grbl write all three.
    let says_nothing =
        |letter: u8| !line.state.modes.arc_absolute && line.words.get(letter) == Some(0.0);
    let is_foreign = |letter: &u8| {
        line.words.has(*letter) && !letters.contains(letter) && !says_nothing(*letter)
    };
    if let Some(foreign) = (b'I'..=b'K').find(is_foreign) {
        let [a, b] = letters.map(char::from);
        let message = format!(
            "{} is no centre in this plane: {a} and {b} are (G17, G18, G19 choose)",
            foreign as char
        );
        return Err(line.words.error(foreign, "arc-centre", message));
    }
    let given = letters.map(|letter| line.words.get(letter));
    let arc = match (line.words.get(b'R'), given) {
        (Some(radius), [None, None]) => ends.of_radius(radius * line.state.modes.unit_mm),
        (Some(_), _) => {
            return Err(line.words.error(
                b'R',
                "arc-centre",
                "an arc has either R or I J K, not both",
            ));
        }
        (None, [None, None]) => return Err(no_center(line, letters)),
        (None, given) => ends.about(center(line, ends, plane, given)?),
    };
    arc.map_err(|(code, message)| arc_error(line, letters, code, message))
}

/// The centre in machine coordinates.
fn center(
    line: &Line,
    ends: &Ends,
    plane: [usize; 2],
    given: [Option<f64>; 2],
) -> Checked<[f64; 2]> {
    let unit = line.state.modes.unit_mm;
    let coordinates = &line.state.coordinates;
    if coordinates.is_rotated() && line.state.modes.plane != Plane::Xy {
        let message = "in a rotated coordinate system (G10 L2 R) arcs lie in the plane XY (G17)";
        return Err(line.motion_error("arc-centre", message));
    }
    let mut from = AxisVector::ZERO;
    if !line.state.modes.arc_absolute {
        for (axis, value) in plane.into_iter().zip(given) {
            from[axis] = value.unwrap_or(0.0) * unit;
        }
        let from = coordinates.direction(&from);
        return Ok(std::array::from_fn(|i| ends.start[i] + from[plane[i]]));
    }
    let [Some(a), Some(b)] = given else {
        return Err(line.motion_error(
            "arc-centre",
            "with G90.1 an arc needs both coordinates of its centre",
        ));
    };
    from[plane[0]] = a * unit;
    from[plane[1]] = b * unit;
    let center = coordinates.to_machine(&from);
    Ok(plane.map(|axis| center[axis]))
}

fn no_center(line: &Line, letters: [u8; 2]) -> LineError {
    let [a, b] = letters.map(char::from);
    line.motion_error(
        "arc-centre",
        format!("the arc has no centre ({a} {b}) and no radius (R)"),
    )
}

/// An error at the words of the circle.
fn arc_error(line: &Line, letters: [u8; 2], code: &'static str, message: String) -> LineError {
    let spans = [letters[0], letters[1], b'R']
        .into_iter()
        .filter(|l| line.words.has(*l))
        .map(|l| line.words.span(l));
    let span = spans.reduce(|a, b| Span {
        start: a.start.min(b.start),
        end: a.end.max(b.end),
    });
    LineError::new(span.unwrap_or_default(), code, message)
}

fn check_arc_travel(
    line: &Line,
    plane: [usize; 2],
    parts: &Parts,
    helix: &AxisVector,
) -> Checked<()> {
    for part in parts.as_slice() {
        for (axis, (low, high)) in plane.into_iter().zip(extent(part)) {
            line.check_travel(axis, low, high)?;
        }
    }
    for axis in (0..line.letters.count()).filter(|axis| helix[*axis] != 0.0) {
        line.check_travel(
            axis,
            line.state.path.position[axis],
            line.state.path.position[axis],
        )?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use crate::testing::{blocks, last, messages, short};

    #[test]
    fn helices_in_every_plane() {
        let helix = last("F60 G17 G2 X10 I5 Z4 A90 P2");
        assert_eq!(
            (helix.arc.plane, short(helix.arc.sweep_rad.to_degrees())),
            ([0, 1], "-540".into())
        );
        assert!((helix.length_mm - (5.0 * helix.arc.sweep_rad).hypot(4.0)).abs() < 1e-12);
        // Seen from +Y, G3 turns from Z to X.
        let quarter = last("F60 G18 G0 Z10\nG3 X10 Z0 K-10");
        assert_eq!(
            (quarter.arc.plane, short(quarter.arc.sweep_rad.to_degrees())),
            ([2, 0], "90".into())
        );
        let quarter = last("F60 G19 G0 Y10\nG3 Y0 Z10 R10");
        assert_eq!(
            (quarter.arc.plane, short(quarter.arc.sweep_rad.to_degrees())),
            ([1, 2], "90".into())
        );
        let turning = last("F60 G2 I5 A360");
        assert_eq!(short(turning.length_mm), short(10.0 * std::f64::consts::PI));
    }

    #[test]
    fn an_offset_of_zero_across_the_plane_says_nothing() {
        for (with, without) in [
            ("F60 G2 X10 I5 K0.000", "F60 G2 X10 I5"),
            ("F60 G18 G3 X10 Z10 K10 J0", "F60 G18 G3 X10 Z10 K10"),
            ("F60 G2 X10 R5 K0", "F60 G2 X10 R5"),
        ] {
            let [with, without] = [with, without].map(|text| format!("{:?}", blocks(text)));
            assert_eq!(with, without);
        }
        for wrong in [
            "F60 G2 X10 I5 K0.1",
            "F60 G90.1 G2 X10 I5 J0 K0",
            "F60 G2 X10 K0",
        ] {
            let found = messages(wrong);
            assert!(found[0].contains("[arc-centre]"), "{wrong}: {found:?}");
        }
    }

    #[test]
    fn a_nearly_closed_helix_is_one_path_in_two_blocks() {
        let [first, second] = blocks("F60 G0 X10\nG2 X10.001 Y0.2 Z8 I-10")[1..] else {
            panic!("two arcs")
        };
        let swept = first.arc.sweep_rad + second.arc.sweep_rad;
        assert!((first.end[2] - 8.0 * first.arc.sweep_rad / swept).abs() < 1e-9);
        assert_eq!(
            (first.end, second.end[0], second.end[1], second.end[2]),
            (second.start, 10.001, 0.2, 8.0)
        );
        assert!((first.length_mm + second.length_mm - (10.0 * swept).hypot(8.0)).abs() < 0.01);
        assert_eq!(
            (first.line, second.line, first.feed_mm_per_s),
            (2, 2, second.feed_mm_per_s)
        );
    }
}
