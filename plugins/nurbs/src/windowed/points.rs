//! Jerk between the samples.

use super::corners::Limit;
use super::grade::Grade;
use super::motion::Ramps;
use super::ramp::Ramp;
use crate::stream::check::{POINT, jerk_share};
use crate::stream::relief::{Relief, Reliefs};
use crate::stream::{Cursor, Job};

/// What the next try aims at.
const AIM: f64 = 0.99;
/// How often it is looked at, as a part of the fine period.
const PART: f64 = 0.25;
/// Share of the jerk that turning alone may take where a ramp yields to it; where it takes more the speed is lowered.
const TURNING: f64 = 0.6;

/// Takes something back where the jerk of an axis exceeds its limit: of the jerk of the ramp, which turning adds to, or where
/// turning takes the most of it of the speed, with whose third power it goes. Gives whether there was such a place.
pub fn ease(job: &Job<Ramps>, ramps: &[Ramp], limit: &mut Limit, grade: &mut Grade, reliefs: &mut Reliefs) -> bool {
    let (mut cursor, known, mut found) = (Cursor::default(), reliefs.count(), false);
    let step_s = PART * job.bounds.context.fine_period_s;
    for ramp in ramps {
        let looks = (ramp.duration_s / step_s).ceil().max(1.0);
        let mut left = 1.0f64;
        for n in 0..=looks as usize {
            let [s_mm, v, a, j] = ramp.at(ramp.duration_s * n as f64 / looks);
            let (at, _) = job.route.at(s_mm, &mut cursor);
            let worst = jerk_share(job.bounds, &at, [v, a, j]);
            if worst <= POINT {
                continue;
            }
            found = true;
            let turning = jerk_share(job.bounds, &at, [v, a, 0.0]);
            if turning < TURNING {
                left = left.min((AIM - turning) / (worst - turning));
            } else {
                // A ramp may be slower there than the limit of the speed, which is what becomes lower.
                let (way_mm, speed) = (step_s * v, (AIM / worst).cbrt().max(0.8) * (v / limit.at(s_mm)).min(1.0));
                reliefs.add(known, Relief { from_mm: s_mm - way_mm, to_mm: s_mm + way_mm, speed, jerk: 1.0 });
            }
        }
        if left < 1.0 {
            grade.ease(ramp, left);
        }
    }
    found
}
