//! Straight spans: where a curve turns back on one, and the line itself by its arc length.
//!
//! Along a line nothing but the parameter slows down and turns back. By arc length that is a cusp whose derivatives only
//! rounding tells from those of a curve, so that the line is known as a line, and cut where it turns back.

use tandem_sdk::AxisVector;

use super::hull::Hull;
use super::{AlongPath, Nurbs};

/// Control points this near to a line are on it, mm or rad: programs round them to six decimals.
const ON_LINE: f64 = 1e-6;
/// Most that the direction of a line may be off, rad: of a short span rounding is a turn.
const TURN_RAD: f64 = 1e-5;
/// Halvings of a span at most.
const HALVINGS: u32 = 60;
/// Share of the coordinates of a span that is rounding.
const ROUNDING: f64 = 1e-13;
/// Share of its coordinates below which the length of a span is too short to tell a turn from rounding.
const SHORT: f64 = ROUNDING / TURN_RAD;
/// Parts of a span that are looked at: more are needed only where rounding, of coordinates and of weights far apart, looks
/// like turns.
const MAX_PARTS: u32 = 2000;
/// Most that the length along a line may differ from the distance of its ends, as a share.
const OFF_LENGTH: f64 = 1e-9;
/// The same of rounding of positions, mm.
const OFF_MM: f64 = 1e-12;

/// A straight span that runs one way.
#[derive(Clone, Copy, Debug)]
pub(super) struct Line {
    pub start_mm: f64,
    pub end_mm: f64,
    position: AxisVector,
    direction: AxisVector,
}

impl Line {
    /// The line along `span` between two parameters and path coordinates; `None` where the span is not straight, turns back
    /// in between, or is the same by its parameter (degree 1).
    pub fn new(
        curve: &Nurbs,
        span: usize,
        (from, to): (f64, f64),
        [start_mm, end_mm]: [f64; 2],
    ) -> Option<Self> {
        if curve.degree == 1 {
            return None;
        }
        Hull::of_span(curve, span).line()?;
        let [start, end] = [from, to].map(|u| curve.derivatives_in(span, u).position);
        let way = end - start;
        let length_mm = end_mm - start_mm;
        let runs_one_way =
            (curve.counted_length(&way) - length_mm).abs() <= OFF_LENGTH * length_mm + OFF_MM;
        runs_one_way.then(|| Self {
            start_mm,
            end_mm,
            position: start,
            direction: way * (1.0 / length_mm),
        })
    }

    pub fn at(&self, s_mm: f64) -> AlongPath {
        let position = self.position
            + self.direction * (s_mm.clamp(self.start_mm, self.end_mm) - self.start_mm);
        AlongPath {
            position,
            direction: self.direction,
            ..AlongPath::default()
        }
    }
}

impl Nurbs {
    /// Parameters inside straight spans at which the curve turns back on its own line, in order. Allocates.
    pub fn turning_points(&self) -> Vec<f64> {
        let mut found = Vec::new();
        for span in self.degree..self.points() {
            if self.knots[span + 1] > self.knots[span] {
                let hull = Hull::of_span(self, span);
                if let Some(line) = hull.line() {
                    let far = hull
                        .position(0)
                        .0
                        .iter()
                        .fold(0.0, |most, v| f64::max(most, v.abs()));
                    let least = ROUNDING
                        * hull
                            .along(&line)
                            .fold(far, |most, v| f64::max(most, v.abs()));
                    let mut last = None;
                    let mut parts = MAX_PARTS;
                    let before = found.len();
                    self.turns(
                        span,
                        &hull,
                        (&line, least),
                        (HALVINGS, &mut parts),
                        &mut last,
                        &mut found,
                    );
                    if parts == 0 {
                        found.truncate(before);
                    }
                }
            }
        }
        found
    }

    /// Looks for turns on a part of a straight span. `last` is the middle of the part before that runs one way, and which.
    fn turns(
        &self,
        span: usize,
        part: &Hull,
        (line, least): (&AxisVector, f64),
        (halvings, parts): (u32, &mut u32),
        last: &mut Option<(f64, f64)>,
        found: &mut Vec<f64>,
    ) {
        let steps = || {
            part.along(line)
                .zip(part.along(line).skip(1))
                .map(|(from, to)| to - from)
        };
        if steps().map(f64::abs).sum::<f64>() <= least || halvings == 0 || *parts == 0 {
            return;
        }
        *parts -= 1;
        let forth = steps().all(|step| step >= 0.0);
        let back = steps().all(|step| step <= 0.0);
        if !forth && !back {
            let halves = part.halves();
            let look = |half| {
                self.turns(
                    span,
                    half,
                    (line, least),
                    (halvings - 1, parts),
                    last,
                    found,
                );
            };
            return halves.iter().for_each(look);
        }
        let middle = f64::midpoint(part.range.0, part.range.1);
        let way = if forth { 1.0 } else { -1.0 };
        if let Some((before, other)) = *last
            && other != way
        {
            found.push(self.turn_between(span, line, (before, middle), way));
        }
        *last = Some((middle, way));
    }

    /// Where the derivative along `line` changes its sign to that of `way`, by halving.
    fn turn_between(
        &self,
        span: usize,
        line: &AxisVector,
        (mut low, mut high): (f64, f64),
        way: f64,
    ) -> f64 {
        for _ in 0..HALVINGS {
            let middle = f64::midpoint(low, high);
            let first = self.derivatives_in(span, middle).first;
            let along: f64 = first.0.iter().zip(line.0).map(|(a, b)| a * b).sum();
            if along * way > 0.0 {
                high = middle;
            } else {
                low = middle;
            }
        }
        high
    }
}

impl Hull {
    /// The direction of the line on which all control points lie, of unit length over all axes.
    fn line(&self) -> Option<AxisVector> {
        let far = |a: &AxisVector| a.0.iter().map(|v| v * v).sum::<f64>();
        let start = self.position(0);
        let ways = || (1..=self.degree()).map(|index| self.position(index) - start);
        let longest = ways().max_by(|a, b| far(a).total_cmp(&far(b)))?;
        let length = far(&longest).sqrt();
        let far_mm = far(&start).sqrt().max(length);
        if length <= ON_LINE.min(SHORT * far_mm) {
            return None;
        }
        let line = longest * (1.0 / length);
        let off = |way: &AxisVector| {
            let along: f64 = way.0.iter().zip(line.0).map(|(a, b)| a * b).sum();
            far(&(*way - line * along)).sqrt()
        };
        let most = ON_LINE.min(TURN_RAD * length);
        ways().all(|way| off(&way) <= most).then_some(line)
    }

    /// The control points along `line`, from the first one on.
    fn along<'a>(&'a self, line: &'a AxisVector) -> impl Iterator<Item = f64> + 'a {
        let start = self.position(0);
        let on = move |index: usize| {
            (self.position(index) - start)
                .0
                .iter()
                .zip(line.0)
                .map(|(a, b)| a * b)
                .sum()
        };
        (0..=self.degree()).map(on)
    }
}
