//! Single points between the places of the grid.

use super::motion::Rated;
use crate::stream::{Bounds, Cursor, Route};

/// A part of the path that is to be driven more slowly: path coordinates of its ends, mm, and the speed, mm/s.
#[derive(Clone, Copy, Debug)]
pub struct Slow {
    pub from_mm: f64,
    pub to_mm: f64,
    pub speed_mm_per_s: f64,
}

/// Share of the jerk limit that the motion itself may reach between the places of the grid: the fine loop looks at single
/// points of a period.
const POINT: f64 = 1.004;
/// Where it is looked at in an interval.
const PLACES: [f64; 5] = [0.02, 0.25, 0.5, 0.75, 0.98];

/// Adds the intervals in which the jerk exceeds its limit, at a knot of the curve between the places of the grid, and what
/// speed would keep it: jerk goes with the third power. Gives whether there was one.
pub fn slow_down(route: &Route, bounds: &Bounds, motion: &Rated, slow: &mut Vec<Slow>) -> bool {
    let (mut cursor, known) = (Cursor::default(), slow.len());
    for k in 0..motion.rate.intervals() {
        let (mut worst, mut speed) = (0.0f64, 0.0);
        for z in PLACES {
            let [s_mm, v, a, j] = motion.derivatives(k, z);
            let (at, _) = route.at(s_mm, &mut cursor);
            for (axis, limits) in bounds.context.limits.axes().iter().enumerate() {
                let (x1, x2, x3) = (at.direction[axis], at.curvature[axis], at.third[axis]);
                let jerk = x3 * v * v * v + 3.0 * x2 * v * a + x1 * j;
                worst = worst.max(jerk.abs() / limits.jerk_mm_per_s3);
                speed = v.max(speed);
            }
        }
        if worst > POINT {
            let [from_mm, to_mm] = [0.0, 1.0].map(|z| motion.derivatives(k, z)[0]);
            let factor = (0.98 / worst).cbrt().max(0.8);
            slow.push(Slow { from_mm, to_mm, speed_mm_per_s: factor * speed });
        }
    }
    slow.len() > known
}
