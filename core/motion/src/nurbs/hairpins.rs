//! Where a curve turns back on next to no radius.
//!
//! There it nearly stands still in its parameter. By arc length that is a feature of its own size, however small: between it
//! and the rest of the curve lie all derivatives up to those of a cusp.

use tandem_sdk::AxisVector;

use super::Nurbs;

/// Places of a span at which its speed in the parameter is compared; polynomials have no more minima than their degree.
const LOOKS: u32 = 32;
/// Share of the highest of these below which there may be a hairpin: on the way to a cusp the speed falls evenly.
const SLOW: f64 = 0.3;
/// Share of it below which it stands still at an end of a span: what rounding leaves.
const STILL: f64 = 1e-9;
/// Places between such an end and the first of the even ones, each half as far from it as the one before.
const NEARER: u32 = 16;
/// Halvings until the slowest place is known to rounding.
const HALVINGS: u32 = 60;

impl Nurbs {
    /// Parameters between the two of `range` at which the curve is slowest in its parameter and its radius is less than
    /// `radius_mm`, in order. Rough loop. Allocates.
    pub fn hairpins(&self, range: (f64, f64), radius_mm: f64) -> Vec<f64> {
        let mut found = Vec::new();
        for span in self.span(range.0)..self.points() {
            let part = (
                self.knots[span].max(range.0),
                self.knots[span + 1].min(range.1),
            );
            if part.1 > part.0 {
                self.hairpins_in(span, part, radius_mm, &mut found);
            }
        }
        found
    }

    fn hairpins_in(
        &self,
        span: usize,
        (from, to): (f64, f64),
        radius_mm: f64,
        found: &mut Vec<f64>,
    ) {
        let places = self.looked_at(span, (from, to));
        let fastest = places.iter().map(|at| at.speed).fold(0.0, f64::max);
        for n in 1..places.len() {
            let [before, after] = [&places[n - 1], &places[n]];
            let falls_and_rises = before.change < 0.0 && after.change > 0.0;
            if !falls_and_rises || before.speed.min(after.speed) > SLOW * fastest {
                continue;
            }
            // Where one of the places is the hairpin nearly itself, only the next one is behind it.
            let last = places.len() - 1;
            let wider = [&places[n.saturating_sub(2)], &places[(n + 1).min(last)]];
            if !self.turns_between([before, after]) && !self.turns_between(wider) {
                // It slows down and goes on the same way.
                continue;
            }
            let mut low = before.u;
            let mut high = after.u;
            for _ in 0..HALVINGS {
                let middle = f64::midpoint(low, high);
                if self.look(span, middle).change < 0.0 {
                    low = middle;
                } else {
                    high = middle;
                }
            }
            // An axis that does not count and moves there would have to do so on no way at all, from rest as well.
            let first = self.derivatives_in(span, high).first;
            if (0..first.0.len()).any(|axis| self.counted[axis] == 0.0 && first[axis] != 0.0) {
                continue;
            }
            // Where it stands still it has no curvature: that is a cusp.
            let per_mm = self
                .curvature(&self.derivatives_in(span, high))
                .unwrap_or(f64::INFINITY);
            if per_mm * radius_mm > 1.0 && high > from && high < to {
                found.push(high);
            }
        }
    }

    /// Places of a part of a span at which its speed is compared: even ones, and where it stands still at an end ever nearer to that,
    /// but not the end itself. There speed and direction are rounding, and between it and the last of the even places it may turn.
    fn looked_at(&self, span: usize, (from, to): (f64, f64)) -> Vec<Look> {
        let way = to - from;
        let look = |u: f64| self.look(span, u);
        let mut places: Vec<Look> = (0..=LOOKS)
            .map(|n| look(from + way * (f64::from(n) / f64::from(LOOKS))))
            .collect();
        let fastest = places.iter().map(|at| at.speed).fold(0.0, f64::max);
        let nearer = |end: f64, way: f64| {
            (1..=NEARER).map(move |n| end + way / (f64::from(LOOKS) * f64::from(1u32 << n)))
        };
        if look(to).speed <= STILL * fastest {
            places.pop();
            places.extend(nearer(to, -way).map(look));
        }
        if places[0].speed <= STILL * fastest {
            places.remove(0);
            let mut first: Vec<Look> = nearer(from, way).map(look).collect();
            first.reverse();
            places.splice(0..0, first);
        }
        places
    }

    fn look(&self, span: usize, u: f64) -> Look {
        let at = self.derivatives_in(span, u);
        Look {
            u,
            first: at.first,
            speed: self.counted_length(&at.first),
            change: self.counted_product(&at.first, &at.second),
        }
    }

    fn turns_between(&self, [before, after]: [&Look; 2]) -> bool {
        self.counted_product(&before.first, &after.first) < 0.0
    }
}

/// A place of a span as the search for hairpins sees it.
struct Look {
    /// Its parameter.
    u: f64,
    /// Derivative by the parameter, mm.
    first: AxisVector,
    /// Speed in the parameter, mm.
    speed: f64,
    /// Half of how the square of the speed changes, mm².
    change: f64,
}
