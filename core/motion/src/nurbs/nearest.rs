//! The point of a curve nearest to a given one.

use tandem_sdk::AxisVector;

use super::Nurbs;

/// The foot of a point on a curve.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Nearest {
    /// Its parameter.
    pub u: f64,
    /// Distance over all axes, mm.
    pub distance_mm: f64,
}

/// Parts of each span at whose ends the distance is taken.
const TRIED: usize = 24;
/// Improvements at most.
const ROUNDS: usize = 24;

impl Nurbs {
    /// The point nearest to `point` on the spans `from_span` to `to_span` (clipped to the curve): each span is sampled, and
    /// each sample nearer than its neighbours is improved by Gauss-Newton steps, halved where they do not help. Does not
    /// allocate.
    pub fn nearest(&self, point: &AxisVector, from_span: usize, to_span: usize) -> Nearest {
        let mut best = Nearest { u: self.range().0, distance_mm: f64::INFINITY };
        for span in from_span.max(self.degree)..=to_span.min(self.points() - 1) {
            if self.knots[span + 1] > self.knots[span] {
                self.nearest_in(span, point, &mut best);
            }
        }
        best
    }

    fn nearest_in(&self, span: usize, point: &AxisVector, best: &mut Nearest) {
        let (from, to) = (self.knots[span], self.knots[span + 1]);
        let at = |step: usize| (from + (to - from) * step as f64 / TRIED as f64).min(to);
        let tried: [f64; TRIED + 1] =
            std::array::from_fn(|step| distance(point, &self.derivatives_in(span, at(step)).position));
        for step in 0..=TRIED {
            let lower = |other: Option<&f64>| other.is_none_or(|other| tried[step] <= *other);
            if lower(step.checked_sub(1).map(|before| &tried[before])) && lower(tried.get(step + 1)) {
                let found = self.improve(span, point, Nearest { u: at(step), distance_mm: tried[step] });
                if found.distance_mm < best.distance_mm {
                    *best = found;
                }
            }
        }
    }

    /// Improves a foot within `span`, with the derivatives inside: at a corner those behind it say nothing of it.
    fn improve(&self, span: usize, point: &AxisVector, mut best: Nearest) -> Nearest {
        let (from, to) = (self.knots[span], self.knots[span + 1]);
        let mut share = 1.0;
        for _ in 0..ROUNDS {
            let at = self.derivatives_in(span, best.u);
            let squared: f64 = at.first.0.iter().map(|v| v * v).sum();
            let along: f64 = (*point - at.position).0.iter().zip(at.first.0).map(|(a, b)| a * b).sum();
            let u = (best.u + share * along / squared).clamp(from, to);
            if !u.is_finite() || u == best.u {
                break;
            }
            let distance_mm = distance(point, &self.derivatives_in(span, u).position);
            if distance_mm < best.distance_mm {
                best = Nearest { u, distance_mm };
            } else {
                share *= 0.5;
            }
        }
        best
    }
}

impl Nurbs {
    /// Lowest and highest position of `axis` on the curve, mm or rad: at the ends of spans and where the axis turns.
    /// Does not allocate.
    pub fn extent(&self, axis: usize) -> (f64, f64) {
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        for span in self.degree..self.points() {
            let (from, to) = (self.knots[span], self.knots[span + 1]);
            let mut before = from;
            for step in 0..=if to > from { TRIED } else { 0 } {
                let u = (from + (to - from) * step as f64 / TRIED as f64).min(to);
                for at in [u, self.turn(span, axis, before, u)] {
                    let value = self.derivatives_in(span, at).position[axis];
                    (low, high) = (low.min(value), high.max(value));
                }
                before = u;
            }
        }
        (low, high)
    }

    /// Where `axis` turns between two parameters, by halving; the first of them where it does not.
    fn turn(&self, span: usize, axis: usize, mut from: f64, mut to: f64) -> f64 {
        let rate = |u: f64| self.derivatives_in(span, u).first[axis];
        let first = rate(from);
        if first * rate(to) >= 0.0 {
            return from;
        }
        for _ in 0..40 {
            let middle = 0.5 * (from + to);
            if rate(middle) * first > 0.0 { from = middle } else { to = middle }
        }
        from
    }
}

fn distance(a: &AxisVector, b: &AxisVector) -> f64 {
    (*a - *b).0.iter().map(|d| d * d).sum::<f64>().sqrt()
}
