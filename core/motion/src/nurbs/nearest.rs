//! The point of a curve nearest to a given one.

use std::ops::RangeInclusive;

use tandem_sdk::{AxisVector, MAX_AXES};

use super::Nurbs;
use super::hull::Hull;

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
/// Halvings of a span at most.
const HALVINGS: u32 = 60;
/// What no part is halved for, mm or rad.
const ROUNDING: f64 = 1e-9;
/// A foot this near is the nearest one, mm; a further one is proved by bounds of the parts, to a share of its distance.
const ON_CURVE_MM: f64 = 1e-7;
const PROVED: f64 = 0.99;

impl Nurbs {
    /// The point nearest to `point` on the spans `from_span` to `to_span` (clipped to the curve), to 1 % of its distance: each
    /// span is sampled, and each sample nearer than its neighbours is improved by Gauss-Newton steps, halved where they do
    /// not help. Where that gives a point off the curve, parts that may come nearer are halved and tried: weights far apart
    /// put most of a span between two samples. Does not allocate.
    pub fn nearest(&self, point: &AxisVector, from_span: usize, to_span: usize) -> Nearest {
        let spans = from_span.max(self.degree)..=to_span.min(self.points() - 1);
        self.nearer_on(
            spans,
            point,
            Nearest {
                u: self.range().0,
                distance_mm: f64::INFINITY,
            },
        )
    }

    /// The point of the whole curve nearest to `point`, where `best` is one known before: spans further away than that cost
    /// a look at their control points only. Does not allocate.
    pub fn nearer(&self, point: &AxisVector, best: Nearest) -> Nearest {
        self.nearer_on(self.degree..=self.points() - 1, point, best)
    }

    fn nearer_on(
        &self,
        spans: RangeInclusive<usize>,
        point: &AxisVector,
        mut best: Nearest,
    ) -> Nearest {
        for span in spans {
            if self.knots[span + 1] > self.knots[span]
                && self.min_distance_mm(span, point) < best.distance_mm
            {
                self.nearest_in(span, point, &mut best);
                if best.distance_mm > ON_CURVE_MM {
                    self.prove(span, &Hull::of_span(self, span), point, HALVINGS, &mut best);
                }
            }
        }
        best
    }

    /// No point of `span` is nearer to `point` than this, mm: it stays between its control points.
    fn min_distance_mm(&self, span: usize, point: &AxisVector) -> f64 {
        let mut low = AxisVector([f64::INFINITY; MAX_AXES]);
        let mut high = AxisVector([f64::NEG_INFINITY; MAX_AXES]);
        for index in span - self.degree..=span {
            let (at, _) = self.control_point(index);
            for axis in 0..MAX_AXES {
                low[axis] = low[axis].min(at[axis]);
                high[axis] = high[axis].max(at[axis]);
            }
        }
        let off = |axis: usize| {
            (low[axis] - point[axis])
                .max(point[axis] - high[axis])
                .max(0.0)
        };
        (0..MAX_AXES)
            .map(|axis| off(axis).powi(2))
            .sum::<f64>()
            .sqrt()
    }

    /// Looks for a nearer point on a part of `span`, in the nearer half first.
    fn prove(
        &self,
        span: usize,
        part: &Hull,
        point: &AxisVector,
        halvings: u32,
        best: &mut Nearest,
    ) {
        if part.min_distance_mm(point) >= PROVED * best.distance_mm - ROUNDING {
            return;
        }
        for (u, end) in [part.range.0, part.range.1].into_iter().zip(part.ends()) {
            let distance_mm = distance(point, &end);
            if distance_mm < best.distance_mm {
                *best = self.improve(span, point, Nearest { u, distance_mm });
            }
        }
        if halvings > 0 {
            let mut halves = part.halves();
            if halves[1].min_distance_mm(point) < halves[0].min_distance_mm(point) {
                halves.swap(0, 1);
            }
            for half in &halves {
                self.prove(span, half, point, halvings - 1, best);
            }
        }
    }

    fn nearest_in(&self, span: usize, point: &AxisVector, best: &mut Nearest) {
        let from = self.knots[span];
        let to = self.knots[span + 1];
        let at = |step: usize| (from + (to - from) * step as f64 / TRIED as f64).min(to);
        let tried: [f64; TRIED + 1] = std::array::from_fn(|step| {
            distance(point, &self.derivatives_in(span, at(step)).position)
        });
        for step in 0..=TRIED {
            let lower = |other: Option<&f64>| other.is_none_or(|other| tried[step] <= *other);
            if lower(step.checked_sub(1).map(|before| &tried[before])) && lower(tried.get(step + 1))
            {
                let found = self.improve(
                    span,
                    point,
                    Nearest {
                        u: at(step),
                        distance_mm: tried[step],
                    },
                );
                if found.distance_mm < best.distance_mm {
                    *best = found;
                }
            }
        }
    }

    /// Improves a foot within `span`, with the derivatives inside: at a corner those behind it say nothing of it.
    fn improve(&self, span: usize, point: &AxisVector, mut best: Nearest) -> Nearest {
        let from = self.knots[span];
        let to = self.knots[span + 1];
        let mut share = 1.0;
        for _ in 0..ROUNDS {
            let at = self.derivatives_in(span, best.u);
            let squared: f64 = at.first.0.iter().map(|v| v * v).sum();
            let along: f64 = (*point - at.position)
                .0
                .iter()
                .zip(at.first.0)
                .map(|(a, b)| a * b)
                .sum();
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
    /// Lowest and highest position of `axis` on the curve, mm or rad, to 1e-9: parts that may reach further than what is
    /// found are halved, however uneven the parameter is. Does not allocate.
    pub fn extent(&self, axis: usize) -> (f64, f64) {
        let mut extent = (f64::INFINITY, f64::NEG_INFINITY);
        for span in self.degree..self.points() {
            if self.knots[span + 1] > self.knots[span] {
                widen(&Hull::of_span(self, span), axis, HALVINGS, &mut extent);
            }
        }
        extent
    }
}

fn widen(part: &Hull, axis: usize, halvings: u32, extent: &mut (f64, f64)) {
    for end in part.ends() {
        *extent = (extent.0.min(end[axis]), extent.1.max(end[axis]));
    }
    let (low, high) = part.bounds(axis);
    if halvings > 0 && (low < extent.0 - ROUNDING || high > extent.1 + ROUNDING) {
        part.halves()
            .iter()
            .for_each(|half| widen(half, axis, halvings - 1, extent));
    }
}

fn distance(a: &AxisVector, b: &AxisVector) -> f64 {
    (*a - *b).0.iter().map(|d| d * d).sum::<f64>().sqrt()
}
