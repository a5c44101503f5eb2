//! Jerk between the samples.

use super::ramp::Ramp;
use crate::stream::check::{POINT, jerk_share};
use crate::stream::relief::{Relief, Reliefs};
use crate::stream::{Bounds, Cursor, Route};

/// What the next try aims at.
const AIM: f64 = 0.98;
/// How often it is looked at, as a part of the fine period.
const PART: f64 = 0.25;

/// Lowers the speed where the jerk of an axis exceeds its limit: what turning takes goes with the third power. Gives
/// whether there was such a place.
pub fn ease(route: &Route, bounds: &Bounds, ramps: &[Ramp], reliefs: &mut Reliefs) -> bool {
    let (mut cursor, known) = (Cursor::default(), reliefs.count());
    let step_s = PART * bounds.context.fine_period_s;
    for ramp in ramps {
        let looks = (ramp.duration_s / step_s).ceil().max(1.0);
        for n in 0..=looks as usize {
            let [s_mm, derivatives @ ..] = ramp.at(ramp.duration_s * n as f64 / looks);
            let worst = jerk_share(bounds, &route.at(s_mm, &mut cursor).0, derivatives);
            if worst > POINT {
                let way_mm = step_s * derivatives[0];
                let speed = (AIM / worst).cbrt().max(0.8);
                reliefs.add(known, Relief { from_mm: s_mm - way_mm, to_mm: s_mm + way_mm, speed, jerk: 1.0 });
            }
        }
    }
    reliefs.count() > known
}
