//! Jerk between the samples.

use tandem_motion::nurbs::AlongPath;

use super::corners::Limit;
use super::grade::Grade;
use super::motion::Ramps;
use super::ramp::Ramp;
use crate::stream::check::{POINT, jerk_share};
use crate::stream::slowdown::{Slowdown, Slowdowns};
use crate::stream::{Cursor, Job};

/// What the next try aims at.
const AIM: f64 = 0.99;
/// How often it is looked at, as a part of the fine period.
const PART: f64 = 0.25;
/// Share of the jerk that turning alone may take where a ramp yields to it; where it takes more the speed is lowered.
const TURNING: f64 = 0.6;

/// Takes something back where the jerk of an axis exceeds its limit: of the jerk of the ramp, which turning adds to, or where
/// turning takes the most of it of the speed, with whose third power it goes. Gives whether there was such a place.
pub fn ease(
    job: &Job<Ramps>,
    ramps: &[Ramp],
    limit: &mut Limit,
    grade: &mut Grade,
    slowdowns: &mut Slowdowns,
) -> bool {
    let known = slowdowns.count();
    let mut found = false;
    let step_s = PART * job.bounds.context.fine_period_s;
    for ramp in ramps {
        let mut left = 1.0f64;
        look(job, ramp, step_s, |at, [s_mm, v, a, j]| {
            // Below zero it is the rounding of a ramp to rest.
            let v = v.max(0.0);
            let worst = jerk_share(job.bounds, at, [v, a, j]);
            if worst <= POINT {
                return;
            }
            found = true;
            let turning = jerk_share(job.bounds, at, [v, a, 0.0]);
            if turning < TURNING {
                left = left.min((AIM - turning) / (worst - turning));
            } else {
                // A ramp may be slower there than the limit of the speed, which is what becomes lower.
                let way_mm = step_s * v;
                let speed = (AIM / worst).cbrt().max(0.8) * (v / limit.at(s_mm)).min(1.0);
                slowdowns.add(
                    known,
                    Slowdown {
                        from_mm: s_mm - way_mm,
                        to_mm: s_mm + way_mm,
                        speed,
                        jerk: 1.0,
                    },
                );
            }
        });
        if left < 1.0 {
            grade.ease(ramp, left);
        }
    }
    found
}

/// The path along a ramp, and where the ramp is there: every `step_s`, and at knots on both sides.
fn look(job: &Job<Ramps>, ramp: &Ramp, step_s: f64, mut of: impl FnMut(&AlongPath, [f64; 4])) {
    let mut cursor = Cursor::default();
    let mut from_mm = ramp.start_mm;
    let looks = (ramp.duration_s / step_s).ceil().max(1.0);
    for n in 0..=looks as usize {
        let t_s = ramp.duration_s * n as f64 / looks;
        let state = ramp.at(t_s);
        while let Some((knot_mm, sides)) = job.route.knot([from_mm, state[0]], &mut cursor) {
            // Near enough: the path is known on both sides of the knot, and the ramp hardly changes on the way.
            let late_s = if state[1] > 0.0 {
                (state[0] - knot_mm) / state[1]
            } else {
                0.0
            };
            let at_knot = ramp.at((t_s - late_s).max(0.0));
            for side in &sides {
                of(side, at_knot);
            }
            from_mm = knot_mm;
        }
        of(&job.route.at(state[0], &mut cursor).0, state);
        from_mm = state[0];
    }
}
