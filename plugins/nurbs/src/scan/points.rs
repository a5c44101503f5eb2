//! Jerk and feed between the places of the grid: the fine loop looks at single points of a period.

use super::motion::Rated;
use crate::stream::check::{POINT, jerk_share};
use crate::stream::slowdown::{Slowdown, Slowdowns};
use crate::stream::{Bounds, Cursor, Route};

/// Share from which the next try takes something back.
const NEAR: f64 = 0.995;
/// What the next try aims at.
const AIM: f64 = 0.985;
/// Where it is looked at in an interval, and in one in which the path turns much.
const PLACES: [&[f64]; 2] = [
    &[1e-4, 0.25, 0.5, 0.75, 0.9999],
    &[
        1e-4, 0.08, 0.16, 0.25, 0.37, 0.5, 0.63, 0.75, 0.84, 0.92, 0.9999,
    ],
];
/// Turn of the path in an interval that is much, rad.
const TURN: f64 = 0.05;

/// What the next try aims at where the feed is exceeded, and what of it is rounding.
const SLOWER: f64 = 0.9985;
const FASTER: f64 = 1.0 + 1e-7;

/// Adds the intervals in which the jerk exceeds its limit, or the speed the feed. Gives whether there was one.
pub fn ease(route: &Route, bounds: &Bounds, motion: &Rated, slowdowns: &mut Slowdowns) -> bool {
    let mut cursor = Cursor::default();
    let known = slowdowns.count();
    let mut over = false;
    for k in 0..motion.rate.intervals() {
        let mut worst = 0.0f64;
        let mut faster = 0.0f64;
        let [from_mm, to_mm] = [0.0, 1.0].map(|z| motion.derivatives(k, z)[0]);
        let (at, leg) = route.at(f64::midpoint(from_mm, to_mm), &mut cursor);
        let turn = leg.course.counted_length(&at.curvature) * (to_mm - from_mm);
        for z in PLACES[usize::from(turn > TURN)] {
            let [s_mm, rest @ ..] = motion.derivatives(k, *z);
            let (at, leg) = route.at(s_mm, &mut cursor);
            worst = worst.max(jerk_share(bounds, &at, rest));
            faster = faster.max(rest[0] / leg.feed_mm_per_s);
        }
        let knot = route.knot([from_mm, to_mm], &mut cursor);
        if let Some((knot_mm, sides)) = &knot {
            let [_, rest @ ..] = motion.derivatives(k, motion.place(k, *knot_mm));
            // Where a block of a higher feed begins the lower one holds.
            faster = faster.max(rest[0] / route.find(*knot_mm, &mut cursor).feed_mm_per_s);
            worst = sides.iter().fold(worst, |worst, side| {
                worst.max(jerk_share(bounds, side, rest))
            });
        }
        // What is near the limit here would be the next to exceed it. At a knot the rows of the grid see too little of it:
        // there the speed is lowered, with whose third power it goes.
        if worst > NEAR || faster > FASTER {
            let [from_mm, to_mm] = [-0.3, 1.3].map(|z| motion.derivatives(k, z)[0]);
            let jerk = if worst > NEAR {
                (AIM / worst).max(0.5)
            } else {
                1.0
            };
            let speed = if knot.is_some() && worst > POINT {
                jerk.cbrt()
            } else {
                1.0
            };
            let speed = if faster > FASTER {
                speed.min(SLOWER / faster)
            } else {
                speed
            };
            slowdowns.add(
                known,
                Slowdown {
                    from_mm,
                    to_mm,
                    speed,
                    jerk,
                },
            );
        }
        over |= worst > POINT || faster > FASTER;
    }
    if !over {
        slowdowns.keep_first(known);
    }
    over
}
