//! G5 and G5.1: Bezier curves in the plane XY, one a line.

use tandem_sdk::{AxisVector, NurbsData};

use super::places::Origin;
use super::push_curve;
use crate::line::Line;
use crate::line_error::Checked;
use crate::words::modes::Plane;

/// The end of the last cubic curve: the block that follows it, and its P and Q, mm.
pub(super) type Tail = (u64, [f64; 2]);

/// G5: a cubic curve to X Y; I J is its second control point from the start, P Q its third from the end. A G5 that
/// follows another without I J goes on in its direction.
pub(super) fn cubic(line: &mut Line) -> Checked<()> {
    let uncertain = line.state.path.uncertain;
    line.advance();
    let [x, y] = bezier_axes(line)?;
    let p = offset(line, b'P').zip(offset(line, b'Q'));
    let Some((p, q)) = p else {
        return Err(line.motion_error(
            "nurbs",
            "G5 needs P and Q, the third control point from the end",
        ));
    };
    let before = line
        .state
        .curves
        .tail
        .take()
        .filter(|(index, _)| *index == line.state.path.next_index);
    let [i, j] = match (offset(line, b'I'), offset(line, b'J'), before) {
        (Some(i), Some(j), _) => [i, j],
        (None, None, Some((_, [p, q]))) => [-p, -q],
        (None, None, None) => {
            let why = "G5 needs I and J, the second control point from the start: only a G5 behind another may lack them";
            return Err(line.motion_error("nurbs", why));
        }
        _ => return Err(line.motion_error("nurbs", "G5 takes I and J both or neither")),
    };
    let (start, end) = (line.state.path.last_end, line.state.path.block_end());
    let (mut second, mut third) = (start, end);
    second[x] += i;
    second[y] += j;
    third[x] += p;
    third[y] += q;
    bezier(line, &[start, second, third, end], uncertain)?;
    line.state.curves.tail = Some((line.state.path.next_index, [p, q]));
    Ok(())
}

/// G5.1: a quadratic curve to X Y; I J is its middle control point from the start.
pub(super) fn quadratic(line: &mut Line) -> Checked<()> {
    let uncertain = line.state.path.uncertain;
    line.advance();
    let [x, y] = bezier_axes(line)?;
    let (i, j) = (offset(line, b'I'), offset(line, b'J'));
    if i.is_none() && j.is_none() {
        return Err(line.motion_error(
            "nurbs",
            "G5.1 needs I or J, the middle control point from the start",
        ));
    }
    let (start, end) = (line.state.path.last_end, line.state.path.block_end());
    let mut middle = start;
    middle[x] += i.unwrap_or(0.0);
    middle[y] += j.unwrap_or(0.0);
    bezier(line, &[start, middle, end], uncertain)
}

fn offset(line: &Line, letter: u8) -> Option<f64> {
    line.words
        .get(letter)
        .map(|value| value * line.state.modes.unit_mm)
}

fn bezier_axes(line: &Line) -> Checked<[usize; 2]> {
    line.refuse_machine_coordinates()?;
    match (line.letters.axis(b'X'), line.letters.axis(b'Y')) {
        _ if line.state.modes.plane != Plane::Xy => {
            Err(line.motion_error("nurbs", "G5 and G5.1 need the plane XY (G17)"))
        }
        (Some(x), Some(y)) => Ok([x, y]),
        _ => Err(line.motion_error("axis", "G5 and G5.1 need the axes X and Y")),
    }
}

fn bezier(line: &mut Line, points: &[AxisVector], uncertain: u32) -> Checked<()> {
    if uncertain != 0 {
        line.state.path.last_end = line.state.path.position;
        return Ok(());
    }
    let degree = points.len() - 1;
    let knots = (0..2 * points.len())
        .map(|index| if index > degree { 1.0 } else { 0.0 })
        .collect();
    let weights = vec![1.0; points.len()];
    let data = NurbsData {
        degree,
        control_points: points.to_vec(),
        weights,
        knots,
    };
    push_curve(line, &Origin::line(line.state.line), data)
}
