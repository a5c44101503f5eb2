//! The shortest time to come to rest on the path within velocity, acceleration and jerk, searched on the planned segments.
//!
//! The state is (p, σ, σ̇): program time, the rate at which it passes, and the rate of that. Time goes on in equal steps with
//! σ̈ constant in each. Of all states that can be reached, those of one cell of (σ, σ̇) are stood for by two, and no state
//! is rounded: each is the end of a way that keeps the limits at both ends and in the middle of every step, the limits
//! a little wider than the machine's. What is found can be driven so, and the shortest is shorter by what the cells
//! hide: little, as finer cells show. Nothing here is shared with the governor.

use std::collections::HashMap;

use tandem_sdk::{Segment, SegmentFlags};

use crate::walks_draw::Lane;

/// How much wider than the machine's the limits are here: acceleration and jerk.
const WIDER: [f64; 2] = [1.002, 1.01];
/// Below this rate the plan counts as it is, and the last of the way has a closed form.
const NEARLY: f64 = 0.04;

/// Derivatives by program time of every lane at a place.
type Motion = Vec<[f64; 3]>;

/// A plan, lane by lane.
pub struct JerkPlan<'a> {
    pieces: Vec<(f64, Segment)>,
    lanes: &'a [Lane],
}

#[derive(Clone, Copy, Debug)]
struct State {
    p_s: f64,
    sigma: f64,
    rate: f64,
}

/// Shortest time from `speed` and `acceleration` to none of both within the limits.
pub fn scalar_stop_s(speed: f64, acceleration: f64, most: f64, jerk: f64) -> f64 {
    let ends = speed + acceleration * acceleration.abs() / (2.0 * jerk);
    let (v, a) = if ends < 0.0 {
        (-speed, -acceleration)
    } else {
        (speed, acceleration)
    };
    let free = (jerk * v + a * a / 2.0).max(0.0).sqrt();
    let peak = free.min(most).max(-a);
    let held_s = if free > peak {
        (v + a * a / (2.0 * jerk) - peak * peak / jerk) / peak
    } else {
        0.0
    };
    (a + peak) / jerk + held_s.max(0.0) + peak / jerk
}

impl<'a> JerkPlan<'a> {
    /// The segments as they were emitted.
    pub fn new(segments: &[Segment], lanes: &'a [Lane]) -> Self {
        let (mut pieces, mut start_s): (Vec<(f64, Segment)>, f64) = (vec![], 0.0);
        for segment in segments {
            match pieces.last_mut() {
                Some((_, last)) if segment.duration_s == 0.0 => {
                    last.flags = last.flags.with(segment.flags);
                }
                _ if segment.duration_s == 0.0 => {}
                _ => pieces.push((start_s, *segment)),
            }
            start_s += segment.duration_s;
        }
        Self { pieces, lanes }
    }

    fn piece(&self, p_s: f64) -> usize {
        self.pieces
            .partition_point(|(start_s, _)| *start_s <= p_s)
            .max(1)
            - 1
    }

    /// Program time at which a path coordinate is reached first, s.
    pub fn time_s(&self, path_mm: f64) -> f64 {
        let behind = |(_, segment): &(f64, Segment)| segment.path_mm(segment.duration_s) < path_mm;
        let (start_s, segment) = &self.pieces[self
            .pieces
            .partition_point(behind)
            .min(self.pieces.len() - 1)];
        let (mut low, mut high) = (0.0, segment.duration_s);
        for _ in 0..60 {
            let middle = f64::midpoint(low, high);
            *(if segment.path_mm(middle) < path_mm {
                &mut low
            } else {
                &mut high
            }) = middle;
        }
        start_s + high
    }

    /// The next rest of the plan behind a place, s of program time.
    fn rest_s(&self, p_s: f64) -> f64 {
        let ends =
            |(_, segment): &&(f64, Segment)| segment.flags.contains(SegmentFlags::ENDS_AT_REST);
        let (start_s, last) = self.pieces[self.piece(p_s)..]
            .iter()
            .find(ends)
            .or(self.pieces.last())
            .expect("a plan has segments");
        start_s + last.duration_s
    }

    fn motion(&self, p_s: f64) -> Motion {
        let (start_s, segment) = &self.pieces[self.piece(p_s)];
        let t = (p_s - start_s).clamp(0.0, segment.duration_s);
        let axis = |c: &[f64; 6]| {
            [
                c[1] + t * (2.0 * c[2] + t * (3.0 * c[3] + t * (4.0 * c[4] + t * 5.0 * c[5]))),
                2.0 * c[2] + t * (6.0 * c[3] + t * (12.0 * c[4] + t * 20.0 * c[5])),
                6.0 * c[3] + t * (24.0 * c[4] + t * 60.0 * c[5]),
            ]
        };
        let axes: [[f64; 3]; 4] = std::array::from_fn(|n| axis(&segment.coefficients[n]));
        let sum =
            |lane: &Lane| std::array::from_fn(|d| (0..4).map(|n| lane.parts[n] * axes[n][d]).sum());
        self.lanes.iter().map(sum).collect()
    }

    /// A time that no stop can be shorter than: that of the lane that needs longest, were it alone. s.
    pub fn crude_s(&self, p_s: f64) -> f64 {
        let alone = |(motion, lane): (&[f64; 3], &Lane)| {
            scalar_stop_s(
                motion[0],
                motion[1],
                WIDER[0] * lane.acceleration,
                WIDER[1] * lane.jerk,
            )
        };
        let crude_s = self
            .motion(p_s)
            .iter()
            .zip(self.lanes)
            .map(alone)
            .fold(0.0, f64::max);
        crude_s.min(self.rest_s(p_s) - p_s)
    }

    /// Whether the limits hold at a place with σ, σ̇ and σ̈.
    fn keeps(&self, p_s: f64, sigma: f64, rate: f64, change: f64) -> bool {
        self.motion(p_s)
            .iter()
            .zip(self.lanes)
            .all(|([v, a, j], lane)| {
                let planned = [sigma * sigma * a, sigma * sigma * sigma * j];
                let [max_a, max_j] = [
                    WIDER[0] * lane.acceleration,
                    WIDER[1] * lane.jerk.max(planned[1].abs()),
                ];
                let acceleration = planned[0] + v * rate;
                let jerk = planned[1] + 3.0 * a * sigma * rate + v * change;
                acceleration.abs() <= max_a.max(planned[0].abs()) && jerk.abs() <= max_j
            })
    }

    /// σ̈ that the limits leave at the start of a step.
    fn changes(&self, state: &State, step_s: f64) -> (f64, f64) {
        let (mut low, mut high) = (-1.0 / (step_s * step_s), 1.0 / (step_s * step_s));
        let mut keep = |constant: f64, slope: f64, most: f64| {
            if slope != 0.0 {
                let (a, b) = ((-most - constant) / slope, (most - constant) / slope);
                (low, high) = (low.max(a.min(b)), high.min(a.max(b)));
            }
        };
        let State { p_s, sigma, rate } = *state;
        for ([v, a, j], lane) in self.motion(p_s).iter().zip(self.lanes) {
            let planned = sigma * sigma * sigma * j;
            keep(
                planned + 3.0 * a * sigma * rate,
                *v,
                WIDER[1] * lane.jerk.max(planned.abs()),
            );
        }
        // Where the acceleration is at its limit at the end of the step, no other way is shorter.
        let end = State {
            p_s: p_s + step_s * (sigma + step_s * rate / 2.0),
            sigma: sigma + step_s * rate,
            rate,
        };
        for ([v, a, _], lane) in self.motion(end.p_s).iter().zip(self.lanes) {
            let planned = end.sigma * end.sigma * a;
            keep(
                planned + v * rate,
                v * step_s,
                (WIDER[0] * lane.acceleration).max(planned.abs()) * 0.999,
            );
        }
        (low, high)
    }

    /// The shortest time to rest from full rate at `p_s`, s, with cells `fineness` times as fine as usual.
    pub fn stop_s(&self, p_s: f64, fineness: f64) -> f64 {
        let (crude_s, rest_s) = (self.crude_s(p_s), self.rest_s(p_s));
        let mut best_s = rest_s - p_s;
        let step_s = crude_s / (30.0 * fineness);
        let cell = |state: &State| {
            let rate = state.rate * crude_s * 10.0 * fineness;
            (
                (state.sigma * 50.0 * fineness).round() as i64,
                rate.round() as i64,
            )
        };
        let mut layer = vec![State {
            p_s,
            sigma: 1.0,
            rate: 0.0,
        }];
        let mut passed_s = 0.0;
        while passed_s + step_s < best_s && !layer.is_empty() {
            passed_s += step_s;
            let mut next: HashMap<(i64, i64), [State; 2]> = HashMap::new();
            for state in &layer {
                let (low, high) = self.changes(state, step_s);
                if low > high {
                    continue;
                }
                let steady = (-state.rate / step_s).clamp(low, high);
                for choice in [0.0, 0.15, 0.3, 0.5, 0.7, 0.85, 1.0]
                    .map(|x| low + x * (high - low))
                    .into_iter()
                    .chain([steady])
                {
                    let Some(after) = self.passed(state, choice, step_s) else {
                        continue;
                    };
                    if after.p_s >= rest_s {
                        best_s = best_s.min(passed_s);
                        continue;
                    }
                    if after.sigma <= NEARLY {
                        best_s = best_s.min(passed_s + self.last_s(&after));
                    }
                    let kept = next.entry(cell(&after)).or_insert([after; 2]);
                    if after.p_s < kept[0].p_s {
                        kept[0] = after;
                    }
                    if after.sigma + after.rate * step_s < kept[1].sigma + kept[1].rate * step_s {
                        kept[1] = after;
                    }
                }
            }
            layer = next.into_values().flatten().collect();
        }
        best_s
    }

    /// The state a step later, if the way there keeps the limits.
    fn passed(&self, state: &State, change: f64, step_s: f64) -> Option<State> {
        let at = |t: f64| State {
            p_s: state.p_s + t * (state.sigma + t * (state.rate / 2.0 + t * change / 6.0)),
            sigma: state.sigma + t * (state.rate + t * change / 2.0),
            rate: state.rate + t * change,
        };
        let (middle, end) = (at(step_s / 2.0), at(step_s));
        let keeps = |s: &State| {
            (0.0..=1.0).contains(&s.sigma) && self.keeps(s.p_s, s.sigma, s.rate, change)
        };
        (keeps(&middle) && keeps(&end)).then_some(end)
    }

    /// Time for the last of the rate, where nothing but jerk counts, s.
    fn last_s(&self, state: &State) -> f64 {
        let each = |(motion, lane): (&[f64; 3], &Lane)| WIDER[1] * lane.jerk / motion[0].abs();
        let most = self
            .motion(state.p_s)
            .iter()
            .zip(self.lanes)
            .map(each)
            .fold(f64::INFINITY, f64::min);
        scalar_stop_s(state.sigma, state.rate, f64::INFINITY, most)
    }
}
