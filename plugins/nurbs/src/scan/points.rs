//! Jerk between the places of the grid: the fine loop looks at single points of a period.

use super::motion::Rated;
use crate::stream::check::{POINT, jerk_share};
use crate::stream::relief::{Relief, Reliefs};
use crate::stream::{Bounds, Cursor, Route};

/// Share from which the next try takes something back.
const NEAR: f64 = 0.995;
/// What the next try aims at.
const AIM: f64 = 0.985;
/// Where it is looked at in an interval without a knot of the curve, and with one.
const PLACES: [&[f64]; 2] = [&[0.25, 0.75], &[0.02, 0.25, 0.5, 0.75, 0.98]];

/// Adds the intervals in which the jerk exceeds its limit; `knots` says which hold a knot of the curve. Gives whether there was one.
pub fn ease(route: &Route, bounds: &Bounds, motion: &Rated, knots: &[bool], reliefs: &mut Reliefs) -> bool {
    let (mut cursor, known, mut over) = (Cursor::default(), reliefs.count(), false);
    for (k, knot) in knots.iter().enumerate() {
        let mut worst = 0.0f64;
        for z in PLACES[usize::from(*knot)] {
            let [s_mm, rest @ ..] = motion.derivatives(k, *z);
            worst = worst.max(jerk_share(bounds, &route.at(s_mm, &mut cursor).0, rest));
        }
        // What is near the limit here would be the next to exceed it.
        if worst > NEAR {
            let [from_mm, to_mm] = [-0.3, 1.3].map(|z| motion.derivatives(k, z)[0]);
            reliefs.add(known, Relief { from_mm, to_mm, speed: 1.0, jerk: (AIM / worst).max(0.5) });
        }
        over |= worst > POINT;
    }
    if !over {
        reliefs.keep_first(known);
    }
    over
}
