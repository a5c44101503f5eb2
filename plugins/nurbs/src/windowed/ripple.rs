//! Look-ahead over corners: what a corner asks of those before it, and the ramps between them.

use super::ramp::{MIN_S, Ramp, Tangential, highest};

/// A place with a speed that is not to be exceeded there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Corner {
    /// Path coordinate, mm.
    pub at_mm: f64,
    /// Speed, mm/s.
    pub speed_mm_per_s: f64,
}

/// Lowers the speeds so that each can be reached from its neighbours: backward, so that a corner lowers the ones before it
/// (the ripple effect), then forward.
/// `limits` are those of the ramps up and down from each corner to the next.
pub fn propagate(corners: &mut [Corner], limits: &[[Tangential; 2]]) {
    for i in (1..corners.len()).rev() {
        let way = corners[i].at_mm - corners[i - 1].at_mm;
        let speed = corners[i - 1].speed_mm_per_s;
        corners[i - 1].speed_mm_per_s =
            limits[i - 1][1].reach_mm_per_s(corners[i].speed_mm_per_s, way, speed);
    }
    for i in 1..corners.len() {
        let way = corners[i].at_mm - corners[i - 1].at_mm;
        let speed = corners[i].speed_mm_per_s;
        corners[i].speed_mm_per_s =
            limits[i - 1][0].reach_mm_per_s(corners[i - 1].speed_mm_per_s, way, speed);
    }
}

/// The motion from one corner to the next: up to a peak, at most `feed_mm_per_s`, level, and down. A level stretch too
/// short to be one makes a ramp longer.
pub fn ramps(
    from: &Corner,
    to: &Corner,
    feed_mm_per_s: f64,
    [up, down]: &[Tangential; 2],
) -> [Ramp; 3] {
    let length = to.at_mm - from.at_mm;
    let [start, end] = [from.speed_mm_per_s, to.speed_mm_per_s];
    let way_mm = |peak: f64| up.way_mm(start, peak) + down.way_mm(peak, end);
    let least = start.max(end);
    let peak = highest((least, feed_mm_per_s.max(least)), |peak| {
        length - way_mm(peak)
    });
    let [mut up_s, mut down_s] = [up.duration_s(peak - start), down.duration_s(peak - end)];
    let mut level_s = if peak > 0.0 {
        (length - way_mm(peak)).max(0.0) / peak
    } else {
        0.0
    };
    if level_s < MIN_S && up_s > down_s {
        up_s += level_s * peak / f64::midpoint(start, peak);
        level_s = 0.0;
    } else if level_s < MIN_S && down_s > 0.0 {
        down_s += level_s * peak / f64::midpoint(peak, end);
        level_s = 0.0;
    }
    let level_mm = from.at_mm + f64::midpoint(start, peak) * up_s;
    let down_mm = to.at_mm - f64::midpoint(peak, end) * down_s;
    [
        Ramp::new(from.at_mm, [start, peak], up_s),
        Ramp::new(level_mm, [peak, peak], level_s),
        Ramp::new(down_mm, [peak, end], down_s),
    ]
}
