//! Circles from I, J, K or R.

use std::f64::consts::TAU;

use super::{line::Line, state::State};
use crate::{Position, geometry::minus, path::Arc};

/// Start and end may differ in radius by this, or by a thousandth, because programs are rounded; beyond, the arc
/// has no clear meaning.
const RADIUS_ROUNDING_MM: f64 = 0.005;
const RADIUS_ROUNDING: f64 = 0.001;
const RADIUS_ERROR_MM: f64 = 0.5;
/// Ends nearer than this are one point, and the arc a full circle: sums of increments differ in the last bits.
const SAME_POINT_MM: f64 = 1e-9;

type Point = [f64; 2];

/// The arc from where the state stands to a target, with words I, J, K, R and P of a line.
pub fn build(
    state: &State,
    line: &mut Line,
    target: &Position,
    clockwise: bool,
) -> Result<Arc, String> {
    let [first, second, _] = state.plane;
    let start = [state.position[first], state.position[second]];
    let end = [target[first], target[second]];
    let center = match line.take('R') {
        Some(radius) => center_from_radius(start, end, radius * state.unit_mm, clockwise)?,
        None => center_from_words(state, line, start, end)?,
    };
    let radius_mm = (start[0] - center[0]).hypot(start[1] - center[1]);
    if radius_mm == 0.0 {
        return Err("arc without a radius".into());
    }
    let start_rad = angle(start, center);
    let sweep_rad = sweep(start_rad, angle(end, center), clockwise, same(start, end))
        + extra_turns(line, clockwise)?;
    let mut along = minus(target, &state.position);
    (along[first], along[second]) = (0.0, 0.0);
    Ok(Arc {
        from: state.position,
        along,
        plane: [first, second],
        center_mm: center,
        radius_mm,
        start_rad,
        sweep_rad,
    })
}

fn center_from_words(
    state: &State,
    line: &mut Line,
    start: Point,
    end: Point,
) -> Result<Point, String> {
    let words = [0, 1].map(|index| line.take(['I', 'J', 'K'][state.plane[index]]));
    let center = match (words, state.absolute_centers) {
        ([None, None], _) => return Err("arc without a centre or radius".into()),
        ([Some(first), Some(second)], true) => {
            let offset = [0, 1].map(|index| state.offset_mm(state.plane[index]));
            [
                first * state.unit_mm + offset[0],
                second * state.unit_mm + offset[1],
            ]
        }
        (_, true) => return Err("G90.1 with half a centre".into()),
        (_, false) => {
            [0, 1].map(|index| start[index] + words[index].unwrap_or(0.0) * state.unit_mm)
        }
    };
    if same(start, end) {
        Ok(center)
    } else {
        center_between(center, start, end)
    }
}

/// The programmed centre is rounded; the nearest one with start and end on the same circle is meant.
fn center_between(center: Point, start: Point, end: Point) -> Result<Point, String> {
    let radius = |point: Point| (point[0] - center[0]).hypot(point[1] - center[1]);
    let error = (radius(start) - radius(end)).abs();
    let rounding = RADIUS_ROUNDING_MM
        .max(RADIUS_ROUNDING * radius(start))
        .min(RADIUS_ERROR_MM);
    if error > rounding {
        return Err(format!("the end of the arc is {error} mm off its circle"));
    }
    let chord = [end[0] - start[0], end[1] - start[1]];
    let middle = [
        f64::midpoint(start[0], end[0]),
        f64::midpoint(start[1], end[1]),
    ];
    let along = (center[0] - middle[0]) * chord[0] + (center[1] - middle[1]) * chord[1];
    let length = chord[0].hypot(chord[1]);
    // Where the arc is nearly closed, a rounded end says little about the centre.
    if along.abs() / length > 2.0 * rounding {
        return Err("the arc is nearly closed, and its end is off its circle".into());
    }
    let fraction = along / length.powi(2);
    Ok([
        center[0] - fraction * chord[0],
        center[1] - fraction * chord[1],
    ])
}

fn center_from_radius(
    start: Point,
    end: Point,
    radius_mm: f64,
    clockwise: bool,
) -> Result<Point, String> {
    let chord = [end[0] - start[0], end[1] - start[1]];
    let length = chord[0].hypot(chord[1]);
    if same(start, end) {
        return Err("arc by radius that ends where it starts".into());
    }
    let short_by = length / 2.0 - radius_mm.abs();
    if short_by > RADIUS_ROUNDING_MM.max(RADIUS_ROUNDING * radius_mm.abs()) {
        return Err(format!("arc radius {radius_mm} mm does not reach its end"));
    }
    let height = (radius_mm.powi(2) - length.powi(2) / 4.0).max(0.0).sqrt();
    // To the left of the chord for the short way counter-clockwise.
    let side = if clockwise == (radius_mm > 0.0) {
        -height / length
    } else {
        height / length
    };
    Ok([
        f64::midpoint(start[0], end[0]) - side * chord[1],
        f64::midpoint(start[1], end[1]) + side * chord[0],
    ])
}

fn same(start: Point, end: Point) -> bool {
    (end[0] - start[0]).hypot(end[1] - start[1]) < SAME_POINT_MM
}

fn angle(point: Point, center: Point) -> f64 {
    (point[1] - center[1]).atan2(point[0] - center[0])
}

fn sweep(start_rad: f64, end_rad: f64, clockwise: bool, full: bool) -> f64 {
    let direction = if clockwise { -1.0 } else { 1.0 };
    let turn = ((end_rad - start_rad) * direction).rem_euclid(TAU);
    direction * if full || turn == 0.0 { TAU } else { turn }
}

/// P counts the turns of an arc, the begun one included.
fn extra_turns(line: &mut Line, clockwise: bool) -> Result<f64, String> {
    let turns = line.take('P').unwrap_or(1.0);
    if turns.fract() != 0.0 || !(1.0..=1000.0).contains(&turns) {
        return Err(format!("unknown word P{turns}"));
    }
    Ok((turns - 1.0) * if clockwise { -TAU } else { TAU })
}
