//! The shortest time to come to rest on the path, found by dynamic programming on the recorded segments.
//!
//! The state is (p, σ): program time, on a grid that meets every end of a segment, and the rate at which it passes.
//! With y = σ² and u = dy/dp an axis accelerates by g″·y + g′·u/2, where g′ is its planned velocity, continuous over
//! junctions. Over one step of the grid u is constant and keeps every axis within its limit at both ends of the step.
//! Nothing here is shared with the governor.

use crate::plan::{Plan, PlanState};

/// Values of σ between 0 and 1.
const LEVELS: usize = 200;
/// Values of u that are tried in each state, beside the hardest braking.
const CHOICES: usize = 12;

/// Shortest times to rest from every place of a plan.
pub struct OptimalStop {
    /// Program time of the places, s.
    places_s: Vec<f64>,
    /// For each place the time to rest from each σ, s.
    times_s: Vec<[f64; LEVELS + 1]>,
}

impl OptimalStop {
    /// Searches the whole plan in steps of at most `step_s`; `limit` holds the accelerations that the axes may have.
    pub fn of(plan: &Plan, limit: &[f64], step_s: f64) -> Self {
        let steps = steps(plan, step_s);
        let mut places_s = vec![plan.end_s()];
        // At its end the plan is at rest.
        let mut times_s = vec![[0.0; LEVELS + 1]];
        for step in steps.iter().rev() {
            let next = times_s[times_s.len() - 1];
            times_s.push(std::array::from_fn(|level| {
                step.best_s(sigma(level), &next, limit)
            }));
            places_s.push(step.from_s);
        }
        places_s.reverse();
        times_s.reverse();
        Self { places_s, times_s }
    }

    /// Shortest time to rest at full rate from program time `at_s`, s.
    pub fn time_s(&self, at_s: f64) -> f64 {
        let after = self
            .places_s
            .partition_point(|place_s| *place_s < at_s)
            .clamp(1, self.places_s.len() - 1);
        let (low_s, high_s) = (self.places_s[after - 1], self.places_s[after]);
        let share = ((at_s - low_s) / (high_s - low_s)).clamp(0.0, 1.0);
        (1.0 - share) * self.times_s[after - 1][LEVELS] + share * self.times_s[after][LEVELS]
    }
}

/// One step of the grid.
struct Step {
    from_s: f64,
    length_s: f64,
    ends: [PlanState; 2],
}

fn steps(plan: &Plan, step_s: f64) -> Vec<Step> {
    let mut steps = vec![];
    for stretch in plan.stretches(0.0, plan.end_s()) {
        let long_s = stretch.until_s - stretch.from_s;
        let count = (long_s / step_s).ceil().max(1.0);
        let at = |number: f64| stretch.from_s + long_s * number / count;
        for number in 0..count as u32 {
            let (from_s, until_s) = (at(f64::from(number)), at(f64::from(number + 1)));
            let ends = [stretch.at(from_s), stretch.at(until_s)];
            steps.push(Step {
                from_s,
                length_s: until_s - from_s,
                ends,
            });
        }
    }
    steps
}

impl Step {
    /// The shortest time to rest from σ, where `next` holds those at the end of the step.
    fn best_s(&self, sigma: f64, next: &[f64; LEVELS + 1], limit: &[f64]) -> f64 {
        let y = sigma * sigma;
        if y == 0.0 {
            return 0.0;
        }
        // Braking to a rest within the step, where y falls to nothing while u stays.
        let hardest = self.range(y, limit, 1).0.max(self.range(0.0, limit, 1).0);
        if hardest <= -y / self.length_s {
            return 2.0 * sigma / -hardest;
        }
        let (low, high) = self.range(y, limit, 2);
        let choice =
            |number: usize| low + (high.min(0.0) - low).max(0.0) * number as f64 / CHOICES as f64;
        let faster = (0..=3)
            .map(|number| high.clamp(0.0, (1.0 - y) / self.length_s) * f64::from(number) / 3.0);
        let time_s = |u: f64| {
            let after = (y + u * self.length_s).max(0.0).sqrt();
            2.0 * self.length_s / (sigma + after) + interpolated(next, after)
        };
        (0..=CHOICES)
            .map(choice)
            .chain(faster)
            .map(time_s)
            .fold(f64::INFINITY, f64::min)
    }

    /// The smallest and largest u that keep every axis within its limit at the first `ends` ends of the step.
    fn range(&self, y: f64, limit: &[f64], ends: usize) -> (f64, f64) {
        let mut range = (f64::NEG_INFINITY, f64::INFINITY);
        for (number, end) in self.ends.iter().take(ends).enumerate() {
            let after_s = number as f64 * self.length_s;
            for (axis, most) in limit.iter().enumerate() {
                // |constant + slope · u| ≤ most
                let constant = end.acceleration[axis] * y;
                let slope = end.acceleration[axis] * after_s + end.velocity[axis] / 2.0;
                let (a, b) = ((-most - constant) / slope, (most - constant) / slope);
                if slope != 0.0 {
                    range = (range.0.max(a.min(b)), range.1.min(a.max(b)));
                }
            }
        }
        range
    }
}

fn sigma(level: usize) -> f64 {
    level as f64 / LEVELS as f64
}

fn interpolated(values: &[f64; LEVELS + 1], sigma: f64) -> f64 {
    let place = sigma.clamp(0.0, 1.0) * LEVELS as f64;
    let below = (place as usize).min(LEVELS - 1);
    let share = place - below as f64;
    (1.0 - share) * values[below] + share * values[below + 1]
}
