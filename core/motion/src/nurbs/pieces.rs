//! Where a curve has corners.

use tandem_sdk::AxisVector;

use super::hull::Hull;
use super::{Derivatives, Nurbs};
use crate::half_angle_turn_rad;

/// Turns below this are rounding of the control points, rad; above it the curve has a corner.
pub const CORNER_RAD: f64 = 1e-6;
/// Share of the mean parameter speed below which the curve stands still in its parameter: a cusp.
const STANDS_STILL: f64 = 1e-7;
/// The same share below which that is rounding.
const ROUNDING: f64 = 1e-12;
/// Share of the coordinates below which Bezier points coincide.
const COINCIDES: f64 = 1e-12;

/// Control points no further apart are one, mm or rad: what rounding leaves of a coordinate and its weight.
const SAME_MM: f64 = 1e-12;

/// Axes that path speed does not count move where they would go further in a span, rad.
const MOVES_RAD: f64 = 1e-9;

/// A smooth part of a curve.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Piece {
    /// First and last parameter.
    pub range: (f64, f64),
    /// Direction just behind the start, of unit length over the counted axes.
    pub start_direction: AxisVector,
    /// Direction just before the end.
    pub end_direction: AxisVector,
}

impl Nurbs {
    /// The smooth parts of the curve, in order: it is cut at knots where the direction turns by more than
    /// [`CORNER_RAD`] (only a knot that stands as often as the degree, or coinciding control points, can do that), where
    /// the curve stands still in its parameter at a knot, and where it turns back on a straight span. Spans in which it
    /// stays at a point are left out. Allocates.
    pub fn pieces(&self) -> Vec<Piece> {
        let (from, to) = self.range();
        let mut pieces = Vec::new();
        let mut start = (!self.stays(from)).then(|| (from, self.direction_behind(from)));
        let turns = self.turning_points();
        let mut places: Vec<f64> = self.inner_knots().chain(turns.iter().copied()).collect();
        places.sort_unstable_by(f64::total_cmp);
        places.dedup();
        for u in places {
            let stays = self.stays(u);
            if let Some((from, start_direction)) = start {
                let end_direction = self.direction_before(u);
                let goes_on = !stays
                    && half_angle_turn_rad(&end_direction, &self.direction_behind(u)) <= CORNER_RAD
                    && !self.stands_still(u)
                    && !turns.contains(&u);
                if goes_on {
                    continue;
                }
                pieces.push(Piece {
                    range: (from, u),
                    start_direction,
                    end_direction,
                });
            }
            start = (!stays).then(|| (u, self.direction_behind(u)));
        }
        let end = |(from, start_direction)| Piece {
            range: (from, to),
            start_direction,
            end_direction: self.direction_before(to),
        };
        pieces.extend(start.map(end));
        pieces
    }

    /// Whether the curve stays at a point in the span behind `u`: its control points coincide.
    fn stays(&self, u: f64) -> bool {
        let span = self.span(u);
        let (first, _) = self.control_point(span - self.degree);
        (span - self.degree..=span).all(|index| {
            let off = self.control_point(index).0 - first;
            off.0.iter().all(|off| off.abs() <= SAME_MM)
        })
    }

    /// The distinct knots inside the curve.
    pub fn inner_knots(&self) -> impl Iterator<Item = f64> {
        let (from, to) = self.range();
        let knots = self
            .knots
            .windows(2)
            .filter(move |pair| pair[1] > pair[0] && pair[1] > from && pair[1] < to);
        knots.map(|pair| pair[1])
    }

    /// Whether the curve stands still in its parameter at the start of a piece and at its end: what is left of the derivatives
    /// there is rounding.
    pub fn stands_still_at_ends(&self, piece: &Piece) -> [bool; 2] {
        let (from, to) = piece.range;
        let mut last = self.span(to);
        while self.knots[last] >= to {
            last -= 1;
        }
        [(self.span(from), from), (last, to)].map(|(span, u)| {
            let first = self.derivatives_in(span, u).first;
            let speed = self.counted_length(&first) * (self.knots[span + 1] - self.knots[span]);
            speed <= ROUNDING * self.gauss(span, self.knots[span], self.knots[span + 1])
        })
    }

    fn stands_still(&self, knot: f64) -> bool {
        let span = self.span(knot);
        self.stands_still_in(span, &self.derivatives_in(span, knot).first)
    }

    fn stands_still_in(&self, span: usize, first: &AxisVector) -> bool {
        let from = self.knots[span];
        let to = self.knots[span + 1];
        self.counted_length(first) * (to - from) <= STANDS_STILL * self.gauss(span, from, to)
    }

    /// The first knot at which only axes move that path speed does not count: beside it they move any distance in no length.
    /// Does not allocate.
    pub fn turns_alone(&self) -> Option<f64> {
        let (start, _) = self.control_point(0);
        let uncounted = |vector: AxisVector, least: f64| {
            vector
                .0
                .iter()
                .zip(self.counted.0)
                .any(|(v, counted)| counted == 0.0 && v.abs() > least)
        };
        if !(1..self.points()).any(|index| uncounted(self.control_point(index).0 - start, SAME_MM))
        {
            return None;
        }
        let spans =
            (self.degree..self.points()).filter(|span| self.knots[span + 1] > self.knots[*span]);
        let mut knots =
            spans.flat_map(|span| [(span, self.knots[span]), (span, self.knots[span + 1])]);
        let alone = knots.find(|(span, knot)| {
            let first = self.derivatives_in(*span, *knot).first;
            let width = self.knots[span + 1] - self.knots[*span];
            uncounted(first * width, MOVES_RAD) && self.stands_still_in(*span, &first)
        });
        alone.map(|(_, knot)| knot)
    }

    /// Direction just behind `u`.
    fn direction_behind(&self, u: f64) -> AxisVector {
        let span = self.span(u);
        if self.knots[span] == u {
            return self.leaving(&Hull::of_span(self, span), false);
        }
        self.direction(&self.derivatives_in(span, u), self.knots[span + 1] - u)
    }

    /// Direction just before `u`.
    fn direction_before(&self, u: f64) -> AxisVector {
        let mut span = self.span(u);
        while self.knots[span] >= u {
            span -= 1;
        }
        if self.knots[span + 1] == u {
            return self.leaving(&Hull::of_span(self, span), true);
        }
        self.direction(&self.derivatives_in(span, u), self.knots[span] - u)
    }

    /// The direction at the start of a span, or at its end: towards the first Bezier point that is another one. Derivatives
    /// do not tell where weights are far apart, because the first one holds for the smallest part of the span only.
    fn leaving(&self, hull: &Hull, backward: bool) -> AxisVector {
        let last = hull.degree();
        let point = |n: usize| hull.position(if backward { last - n } else { n });
        let start = point(0);
        let far = start.0.iter().fold(0.0, |most: f64, v| most.max(v.abs()));
        let extent = (1..=last)
            .map(|n| self.counted_length(&(point(n) - start)))
            .fold(far, f64::max);
        let other = (1..=last)
            .map(|n| point(n) - start)
            .find(|way| self.counted_length(way) > COINCIDES * extent);
        let sign = if backward { -1.0 } else { 1.0 };
        other.map_or(AxisVector::ZERO, |way| {
            way * (sign / self.counted_length(&way))
        })
    }

    /// The direction in which the curve leaves a point, by the first derivative that is not zero: `step` is signed.
    fn direction(&self, at: &Derivatives, step: f64) -> AxisVector {
        let moves = [
            at.first * step,
            at.second * (step * step / 2.0),
            at.third * (step * step * step / 6.0),
        ];
        let largest = moves
            .iter()
            .map(|m| self.counted_length(m))
            .fold(0.0, f64::max);
        let first = moves
            .iter()
            .find(|m| self.counted_length(m) > STANDS_STILL * largest);
        first.map_or(AxisVector::ZERO, |m| {
            *m * (step.signum() / self.counted_length(m))
        })
    }
}
