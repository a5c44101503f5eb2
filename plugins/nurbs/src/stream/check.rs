//! Every limit on the samples of the fine period.

use tandem_sdk::{AxisVector, BlockKind};

use super::{Bounds, Cursor, Motion, Route, Start, Window};

/// Share of a limit that a sampled difference may reach.
const AIM: f64 = 0.9995;
/// What the chord error may exceed: the feed is right for the curvature at one place of the period.
const CHORD: f64 = 1.005;

/// The largest of each, as a share of what is allowed.
#[derive(Clone, Copy, Debug, Default)]
pub struct Worst {
    pub speed: f64,
    pub acceleration: f64,
    pub jerk: f64,
}

impl Worst {
    pub fn is_kept(&self) -> bool {
        // A comparison with NaN is false.
        self.speed <= 1.0 && self.acceleration <= 1.0 && self.jerk <= 1.0
    }
}

/// Samples the window into its memory, with the samples before it in front, and compares.
pub fn check<M: Motion>(route: &Route, bounds: &Bounds, start: &Start, window: &mut Window<M>) -> Worst {
    window.samples.clear();
    window.samples.extend(start.history);
    window.first_tick_s = start.first_tick_s;
    (window.stop_mm_per_s2, window.stop_mm_per_s3, window.most_mm_per_s) = (f64::INFINITY, f64::INFINITY, 0.0);
    let (period_s, duration_s) = (bounds.context.fine_period_s, window.duration_s());
    let (mut cursor, mut worst, mut before_mm) = (Cursor::default(), Worst::default(), start.state.s_mm);
    let mut count = 0;
    let mut rests = 0;
    while rests < 4 {
        let t = start.first_tick_s + f64::from(count) * period_s;
        count += 1;
        rests += u32::from(t >= duration_s);
        let state = window.at(t.min(duration_s));
        let (at, leg) = route.at(state.s_mm, &mut cursor);
        let speed = state.speed_mm_per_s;
        if !speed.is_finite() {
            return Worst { speed: f64::NAN, ..worst };
        }
        worst.speed = worst.speed.max(speed / (leg.feed_mm_per_s * (1.0 - 1e-9)));
        window.most_mm_per_s = window.most_mm_per_s.max(speed);
        for (axis, limits) in bounds.context.limits.axes().iter().enumerate() {
            let along = at.direction[axis].abs();
            let turning = at.direction[axis].signum() * at.curvature[axis] * speed * speed;
            let left = limits.acceleration_mm_per_s2 + turning.min(0.0);
            window.stop_mm_per_s2 = window.stop_mm_per_s2.min(left / along);
            window.stop_mm_per_s3 = window.stop_mm_per_s3.min(limits.jerk_mm_per_s3 / along);
        }
        let rapid = leg.block.kind == BlockKind::Rapid;
        if count > 1 && !rapid {
            let chord = chord_error_mm(route, &mut cursor, (before_mm, state.s_mm)) / bounds.chord_error_mm;
            // The chord error goes with the square of the speed.
            worst.speed = worst.speed.max((chord / CHORD).sqrt());
        }
        before_mm = state.s_mm;
        window.samples.push(at.position);
        differences(&mut worst, bounds, &window.samples, rapid);
    }
    worst
}

/// The differences that end at the last sample.
fn differences(worst: &mut Worst, bounds: &Bounds, samples: &[AxisVector], rapid: bool) {
    let &[p0, p1, p2, p3] = samples.last_chunk().expect("three samples stand in front");
    let rate = 1.0 / bounds.context.fine_period_s;
    for (axis, limits) in bounds.context.limits.axes().iter().enumerate() {
        let [d0, d1, d2] = [p1[axis] - p0[axis], p2[axis] - p1[axis], p3[axis] - p2[axis]];
        let most = if rapid { limits.rapid_mm_per_s } else { limits.feed_mm_per_s };
        worst.speed = worst.speed.max((d2 * rate).abs() / (AIM * most) - 1e-3);
        let acceleration = (d2 - d1).abs() * rate * rate;
        worst.acceleration = worst.acceleration.max(acceleration / (AIM * limits.acceleration_mm_per_s2));
        let jerk = (d2 - 2.0 * d1 + d0).abs() * rate * rate * rate;
        worst.jerk = worst.jerk.max(jerk / (AIM * limits.jerk_mm_per_s3));
    }
}

/// How far the path between two path coordinates stands off its chord, mm, looked at in three places.
fn chord_error_mm(route: &Route, cursor: &mut Cursor, (from_mm, to_mm): (f64, f64)) -> f64 {
    let start = route.at(from_mm, cursor).0.position;
    let chord = route.at(to_mm, cursor).0.position - start;
    let squared = dot(&chord, &chord);
    if squared < 1e-18 {
        return 0.0;
    }
    let off = |share: f64| {
        let mut near = *cursor;
        let point = route.at(from_mm + share * (to_mm - from_mm), &mut near).0.position - start;
        let along = dot(&point, &chord);
        (dot(&point, &point) - along * along / squared).max(0.0).sqrt()
    };
    [0.25, 0.5, 0.75].map(off).into_iter().fold(0.0, f64::max)
}

fn dot(a: &AxisVector, b: &AxisVector) -> f64 {
    a.0.iter().zip(b.0).map(|(a, b)| a * b).sum()
}
