//! The lines of a curve: LinuxCNC's G5.2 … G5.3 and Fanuc's G06.2.

use tandem_motion::nurbs::{MAX_DEGREE, NurbsError};
use tandem_sdk::AxisVector;

use super::{Curve, Dialect, open_curve};
use crate::line::Line;
use crate::line_error::{Checked, LineError, show};
use crate::state::letters::{AXIS_MASK, bit, mask};
use crate::words::orders::no_axis;

/// Orders (degree + 1) that can be asked for.
const ORDERS: std::ops::RangeInclusive<u32> = 2..=MAX_DEGREE as u32 + 1;
/// LinuxCNC's order where none is given: quadratic.
const LINUXCNC_ORDER: usize = 3;
/// Fanuc's order where none is given: cubic.
const FANUC_ORDER: usize = 4;
/// How far the first control point of a Fanuc curve may stand off the programmed position, mm or rad: the rounding of a
/// CAM system.
const START_ROUNDING: f64 = 1e-6;

/// The line with G5.2. Without axis words its P is the weight of the programmed position, the first control point.
pub(super) fn open_linuxcnc(line: &mut Line) -> Checked<()> {
    let uncertain = line.state.path.uncertain;
    let start = line.state.path.position;
    line.advance();
    let opened = open_curve(line, Dialect::LinuxCnc, uncertain);
    let Some(mut curve) = line.state.curves.open.take() else {
        return opened;
    };
    let done = opened.and_then(|()| first_linuxcnc(line, &mut curve, start));
    curve.broken |= done.is_err();
    line.state.curves.open = Some(curve);
    done
}

fn first_linuxcnc(line: &mut Line, curve: &mut Curve, start: AxisVector) -> Checked<()> {
    let bare = line.words.present & AXIS_MASK == 0;
    let weight = if bare { weight_of(line, b'P')? } else { 1.0 };
    curve.add(start, weight);
    linuxcnc_order(line, curve)?;
    if !bare {
        curve.add(line.state.path.position, weight_of(line, b'P')?);
    }
    Ok(())
}

/// A line between G5.2 and G5.3, or that with G5.3; true where it ends the curve.
pub(super) fn linuxcnc_line(line: &mut Line, curve: &mut Curve) -> Checked<bool> {
    if line.words.g.as_slice().iter().any(|code| code.tenths == 53) {
        only(line, "N")?;
        let order = *curve.order.get_or_insert(LINUXCNC_ORDER);
        return enough_points(line, curve, order).map(|()| true);
    }
    if line.words.present & !mask("N") == 0 {
        return Ok(false);
    }
    only(line, "NPLXYZABCUVW")?;
    if line.words.present & AXIS_MASK == 0 {
        let why = "a line between G5.2 and G5.3 gives a control point: its axis words are missing";
        return Err(first_error(line, why));
    }
    linuxcnc_order(line, curve)?;
    let weight = weight_of(line, b'P')?;
    line.advance();
    curve.add(line.state.path.position, weight);
    Ok(false)
}

fn linuxcnc_order(line: &Line, curve: &mut Curve) -> Checked<()> {
    let Some(order) = line.words.integer(b'L', ORDERS)? else {
        return Ok(());
    };
    match curve.order {
        Some(before) if before != order as usize => Err(line.words.error(
            b'L',
            "nurbs",
            format!("L has been {before} on this curve: it has one order"),
        )),
        _ => {
            curve.order = Some(order as usize);
            Ok(())
        }
    }
}

fn enough_points(line: &Line, curve: &Curve, order: usize) -> Checked<()> {
    if curve.points.len() >= order {
        return Ok(());
    }
    let points = curve.points.len();
    let opened = curve.line;
    let message = format!(
        "the curve that line {opened} opens has {points} control points (the position before it is one), \
         order {order} needs {order}"
    );
    Err(first_error(line, &message))
}

/// The line with G06.2: order, first knot, and the first control point, which is the programmed position.
pub(super) fn open_fanuc(line: &mut Line) -> Checked<()> {
    let uncertain = line.state.path.uncertain;
    let start = line.state.path.position;
    line.advance();
    let opened = open_curve(line, Dialect::Fanuc, uncertain);
    let Some(mut curve) = line.state.curves.open.take() else {
        return opened;
    };
    let done = opened.and_then(|()| first_fanuc(line, &mut curve, start));
    curve.broken |= done.is_err();
    line.state.curves.open = Some(curve);
    done
}

fn first_fanuc(line: &mut Line, curve: &mut Curve, start: AxisVector) -> Checked<()> {
    let order = line
        .words
        .integer(b'P', ORDERS)?
        .map_or(FANUC_ORDER, |order| order as usize);
    curve.order = Some(order);
    // LinuxCNC chooses by it how it divides the curve, which is driven as it is here.
    line.words.integer(b'Q', 1..=3)?;
    for axis in 0..line.letters.count() {
        let off = line.state.path.position[axis] - start[axis];
        if off.abs() > START_ROUNDING && !curve.broken {
            let message = format!(
                "the first control point is not where the machine stands ({} off): the curve begins there",
                show(off.abs())
            );
            return Err(line
                .words
                .error(line.letters.letter(axis), "nurbs", message));
        }
    }
    line.state.path.position = start;
    curve.add(start, weight_of(line, b'R')?);
    knot(line, curve)
}

/// A line of a Fanuc curve; true where it ends the curve.
pub(super) fn fanuc_line(line: &mut Line, curve: &mut Curve) -> Checked<bool> {
    if line.words.present & !mask("N") == 0 && line.words.g.as_slice().is_empty() {
        return Ok(false);
    }
    if curve.broken {
        line.advance();
        return Ok(false);
    }
    only(line, "NKRXYZABCUVW")?;
    let order = curve.order.unwrap_or(FANUC_ORDER);
    let alone = curve.knots.len() - curve.points.len();
    if line.words.present & AXIS_MASK == 0 {
        only(line, "NK")?;
        knot(line, curve)?;
        if alone == 0 {
            enough_points(line, curve, order)?;
        }
        return Ok(alone + 1 == order);
    }
    if alone > 0 {
        return Err(first_error(
            line,
            "a control point after knots that stand alone: those end the curve",
        ));
    }
    let weight = weight_of(line, b'R')?;
    line.advance();
    curve.add(line.state.path.position, weight);
    knot(line, curve).map(|()| false)
}

/// The knot of the line, checked against those before it.
fn knot(line: &Line, curve: &mut Curve) -> Checked<()> {
    let Some(knot) = line.words.get(b'K') else {
        return Err(first_error(line, "K, the knot of this line, is missing"));
    };
    let order = curve.order.unwrap_or(FANUC_ORDER);
    let index = curve.knots.len();
    let error = |message: String| Err(line.words.error(b'K', "nurbs", message));
    if let Some(before) = curve.knots.last().filter(|before| knot < **before) {
        return error(format!(
            "knot {} is below the one before it, {}: knots never fall",
            show(knot),
            show(*before)
        ));
    }
    if index < order && curve.knots.first().is_some_and(|first| *first != knot) {
        return error(format!(
            "the first {order} knots are equal: the curve begins at its first control point"
        ));
    }
    let points = curve.points.len();
    let degree = order - 1;
    if index > points && curve.knots.last() != Some(&knot) {
        return error(format!(
            "the last {order} knots are equal: the curve ends at its last control point"
        ));
    }
    if index < order {
        curve.knots.push(knot);
        return Ok(());
    }
    let alike = curve
        .knots
        .iter()
        .rev()
        .take_while(|before| **before == knot)
        .count();
    if index == points && alike > 0 {
        return error(if alike == index {
            NurbsError::Empty(knot).to_string()
        } else {
            NurbsError::End {
                value: knot,
                count: alike + order,
                degree,
            }
            .to_string()
        });
    }
    if index < points && alike == index {
        return error(
            NurbsError::End {
                value: knot,
                count: alike + 1,
                degree,
            }
            .to_string(),
        );
    }
    if index < points && alike == degree {
        return error(
            NurbsError::Multiplicity {
                value: knot,
                count: order,
                degree,
            }
            .to_string(),
        );
    }
    curve.knots.push(knot);
    Ok(())
}

/// The weight that `letter` gives; 1 without it.
fn weight_of(line: &Line, letter: u8) -> Checked<f64> {
    match line.words.get(letter) {
        Some(weight) if weight <= 0.0 => {
            let message = format!("the weight {} must be greater than zero", letter as char);
            Err(line.words.error(letter, "nurbs", message))
        }
        weight => Ok(weight.unwrap_or(1.0)),
    }
}

/// Refuses words other than `letters` in a line of a curve.
fn only(line: &Line, letters: &str) -> Checked<()> {
    let axes = AXIS_MASK & !line.letters.mask;
    let foreign = !mask(letters) | axes;
    let Some((letter, span)) = line.words.first_of(foreign) else {
        return Ok(());
    };
    if axes & bit(letter) != 0 {
        return Err(no_axis(letter, span, line.letters));
    }
    let message = format!(
        "{} has no place in this line of a curve{}",
        letter as char,
        line.words.exponent(letter)
    );
    Err(LineError::new(span, "unused-word", message))
}

/// An error at the first word of the line.
fn first_error(line: &Line, message: &str) -> LineError {
    let span = line.words.g.as_slice().first().map(|code| code.span);
    let word = line.words.first_of(u32::MAX).map(|(_, span)| span);
    LineError::new(span.or(word).unwrap_or_default(), "nurbs", message)
}
