//! Jerk between the places of the grid: the fine loop looks at single points of a period.

use super::motion::Rated;
use crate::stream::check::{POINT, jerk_share};
use crate::stream::relief::{Relief, Reliefs};
use crate::stream::{Bounds, Cursor, Route};

/// Share from which the next try takes something back.
const NEAR: f64 = 0.995;
/// What the next try aims at.
const AIM: f64 = 0.985;
/// Where it is looked at in an interval, and in one in which the path turns much.
const PLACES: [&[f64]; 2] =
    [&[1e-4, 0.25, 0.5, 0.75, 0.9999], &[1e-4, 0.08, 0.16, 0.25, 0.37, 0.5, 0.63, 0.75, 0.84, 0.92, 0.9999]];
/// Turn of the path in an interval that is much, rad.
const TURN: f64 = 0.05;

/// Adds the intervals in which the jerk exceeds its limit. Gives whether there was one.
pub fn ease(route: &Route, bounds: &Bounds, motion: &Rated, reliefs: &mut Reliefs) -> bool {
    let (mut cursor, known, mut over) = (Cursor::default(), reliefs.count(), false);
    for k in 0..motion.rate.intervals() {
        let mut worst = 0.0f64;
        let [from_mm, to_mm] = [0.0, 1.0].map(|z| motion.derivatives(k, z)[0]);
        let (at, leg) = route.at(f64::midpoint(from_mm, to_mm), &mut cursor);
        let turn = leg.course.counted_length(&at.curvature) * (to_mm - from_mm);
        for z in PLACES[usize::from(turn > TURN)] {
            let [s_mm, rest @ ..] = motion.derivatives(k, *z);
            worst = worst.max(jerk_share(bounds, &route.at(s_mm, &mut cursor).0, rest));
        }
        let knot = route.knot([from_mm, to_mm], &mut cursor);
        if let Some((knot_mm, sides)) = &knot {
            let [_, rest @ ..] = motion.derivatives(k, motion.place(k, *knot_mm));
            worst = sides.iter().fold(worst, |worst, side| worst.max(jerk_share(bounds, side, rest)));
        }
        // What is near the limit here would be the next to exceed it. At a knot the rows of the grid see too little of it:
        // there the speed is lowered, with whose third power it goes.
        if worst > NEAR {
            let [from_mm, to_mm] = [-0.3, 1.3].map(|z| motion.derivatives(k, z)[0]);
            let jerk = (AIM / worst).max(0.5);
            let speed = if knot.is_some() && worst > POINT { jerk.cbrt() } else { 1.0 };
            reliefs.add(known, Relief { from_mm, to_mm, speed, jerk });
        }
        over |= worst > POINT;
    }
    if !over {
        reliefs.keep_first(known);
    }
    over
}
