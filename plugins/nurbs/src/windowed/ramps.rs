//! Corners and the ramps between them, until no ramp is faster than the limit.

use super::corners::Limit;
use super::grade::Grade;
use super::ramp::{MIN_S, Ramp, Tangential};
use super::ripple::{Corner, propagate, ramps};

/// Corners nearer to each other are one, mm: beside a cusp speeds fall to nothing, and the least time says nothing.
const APART_MM: f64 = 1e-9;
/// Corners of a window at most: ramps that exceed the limit with so many are left to the check of the samples.
const MAX_CORNERS: usize = 40_000;

/// Looks along a ramp at most: one that takes hours is refused later, and must not take them in planning.
const MAX_LOOKS: f64 = 1e5;

/// How closely ramps are compared with the limit.
#[derive(Clone, Copy, Debug)]
pub struct Care {
    /// How often, s.
    pub look_s: f64,
    /// How much faster than the limit is as good as the limit, as a share.
    pub over: f64,
    /// Rounds of new corners at most: each adds one to a ramp at most.
    pub rounds: usize,
}

/// From one corner to the next, and what was found there.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Pair {
    ends: [Corner; 2],
    found: [Option<Corner>; 3],
    /// The limit where it is level and ramps to the highest feed of the window go beyond it: they keep to it, and no corner is needed. Of
    /// corners there would be one more in each round, and more rounds than there are for a long line before one of a higher feed.
    level_mm_per_s: Option<f64>,
}

impl Pair {
    fn look(ends: [Corner; 2], parts: &[Ramp; 3], limit: &mut Limit, care: &Care) -> Self {
        let found = parts.map(|ramp| worst(&ramp, limit, care));
        let is_above = found.iter().any(Option::is_some);
        let level_mm_per_s = is_above
            .then(|| limit.level_between(ends[0].at_mm, ends[1].at_mm))
            .flatten()
            .filter(|level| ends.iter().all(|end| end.speed_mm_per_s <= *level));
        Self {
            ends,
            found: if level_mm_per_s.is_some() {
                [None; 3]
            } else {
                found
            },
            level_mm_per_s,
        }
    }
}

/// Plans; keeps its memory.
#[derive(Debug, Default)]
pub struct Rounds {
    pairs: Vec<Pair>,
    before: Vec<Pair>,
    limits: Vec<[Tangential; 2]>,
}

impl Rounds {
    /// Lowers the speeds of `corners`, and adds corners, until the ramps between them keep below `limit` everywhere; gives
    /// these.
    pub fn make(
        &mut self,
        corners: &mut Vec<Corner>,
        feed_mm_per_s: f64,
        grade: &Grade,
        limit: &mut Limit,
        care: &Care,
        into: &mut Vec<Ramp>,
    ) {
        self.pairs.clear();
        for _ in 0..care.rounds {
            self.limits.clear();
            self.limits.extend(
                corners
                    .windows(2)
                    .map(|ends| grade.between([ends[0].at_mm, ends[1].at_mm])),
            );
            propagate(corners, &self.limits);
            std::mem::swap(&mut self.pairs, &mut self.before);
            self.pairs.clear();
            into.clear();
            let mut known = self.before.iter().peekable();
            for (ends, limits) in corners.windows(2).zip(&self.limits) {
                let parts = ramps(&ends[0], &ends[1], feed_mm_per_s, limits);
                while known
                    .next_if(|pair| pair.ends[0].at_mm < ends[0].at_mm)
                    .is_some()
                {}
                // A pair looked at before, with the same speeds, has nothing new.
                let pair = match known.peek() {
                    Some(pair) if pair.ends == *ends => **pair,
                    _ => Pair::look([ends[0], ends[1]], &parts, limit, care),
                };
                self.pairs.push(pair);
                let parts = pair
                    .level_mm_per_s
                    .map_or(parts, |speed| ramps(&ends[0], &ends[1], speed, limits));
                into.extend(parts.into_iter().filter(|ramp| ramp.duration_s > 0.0));
            }
            let found = self
                .pairs
                .iter()
                .flat_map(|pair| pair.found.into_iter().flatten());
            let count = corners.len();
            corners.extend(found);
            if corners.len() == count || corners.len() > MAX_CORNERS {
                return;
            }
            corners.sort_unstable_by(|a, b| a.at_mm.total_cmp(&b.at_mm));
            merge(corners);
        }
    }
}

/// Corners that a ramp would pass in less than its least time, or that only rounding tells apart, are one, at the lower
/// speed. Both ends stay where they are.
fn merge(corners: &mut Vec<Corner>) {
    let end = corners[corners.len() - 1];
    corners.dedup_by(|next, kept| {
        let mean = f64::midpoint(next.speed_mm_per_s, kept.speed_mm_per_s);
        let near = next.at_mm - kept.at_mm < (MIN_S * mean).max(APART_MM);
        if near {
            kept.speed_mm_per_s = kept.speed_mm_per_s.min(next.speed_mm_per_s);
        }
        near
    });
    let count = corners.len();
    corners[count - 1] = if count > 1 { end } else { corners[0] };
}

/// The place of a ramp that is furthest above the limit, as a corner at the limit. Between two looks the limit may be lower than at
/// both: where a block of a higher feed begins. That place comes before others that are as far above: up to it the limit may be level,
/// and a ramp of its own keeps to that.
fn worst(ramp: &Ramp, limit: &mut Limit, care: &Care) -> Option<Corner> {
    if ramp.duration_s == 0.0 {
        return None;
    }
    let looks = (ramp.duration_s / care.look_s).ceil().clamp(1.0, MAX_LOOKS);
    let mut most = 1.0 + care.over;
    let mut found = None;
    let mut compare = |[at_mm, speed]: [f64; 2], allowed: f64, is_step: bool| {
        if speed > most * allowed || (is_step && found.is_some() && speed >= most * allowed) {
            most = speed / allowed;
            found = Some(Corner {
                at_mm,
                speed_mm_per_s: allowed,
            });
        }
    };
    let mut before = [0.0, ramp.start_mm, 0.0];
    for n in 0..=looks as usize {
        let t_s = ramp.duration_s * n as f64 / looks;
        let [at_mm, speed, ..] = ramp.at(t_s);
        let [before_s, before_mm, before_speed] = before;
        for place in limit.between(before_mm, at_mm) {
            // Ramps are monotonous.
            if speed.max(before_speed) > (1.0 + care.over) * place.speed_mm_per_s {
                let passed = ramp.at(ramp.time_at(place.at_mm, [before_s, t_s]));
                compare([place.at_mm, passed[1]], place.speed_mm_per_s, true);
            }
        }
        compare([at_mm, speed], limit.at(at_mm), false);
        before = [t_s, at_mm, speed];
    }
    found
}
