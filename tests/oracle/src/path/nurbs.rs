//! Pieces of NURBS curves, by de Boor's triangle in homogeneous coordinates.

use std::rc::Rc;

use crate::{
    Position,
    geometry::{distance, dot, minus, plus_scaled},
};

/// Parts of a piece whose ends are tried before the nearest of them is improved.
const TRIED: usize = 8;
/// Steps towards the foot of a point.
const STEPS: usize = 12;
/// A step so short, as a share of the piece, is no longer a step.
const SETTLED: f64 = 1e-9;
/// Thirds that are left out of the surroundings of a point to which its steps do not lead.
const THIRDS: usize = 60;
/// Halvings towards the first point within reach: a slightly later one is within reach too.
const HALVINGS: usize = 12;
/// Chords whose sum is nearly the length of a piece.
const CHORDS: usize = 64;
/// A piece turns by less than this between its chords, rad.
const GREATEST_TURN_RAD: f64 = 0.2;
/// The halves of a piece differ in length by less than this factor.
const GREATEST_RATIO: f64 = 1.3;
/// Pieces shorter than this are not halved: a cusp never gets straight.
const SHORTEST_MM: f64 = 1e-6;
/// A piece that never leaves its point is none.
const NOTHING_MM: f64 = 1e-12;

/// A whole curve.
#[derive(Debug)]
pub struct Nurbs {
    pub degree: usize,
    pub points: Vec<Position>,
    pub weights: Vec<f64>,
    pub knots: Vec<f64>,
}

/// A part of a curve within one knot span, travelled from one parameter to another.
#[derive(Clone, Debug)]
pub struct Curve {
    nurbs: Rc<Nurbs>,
    span: usize,
    from: f64,
    to: f64,
    length_mm: f64,
}

impl Nurbs {
    /// Whether the numbers make a curve.
    pub fn check(&self) -> Result<(), String> {
        let (points, order) = (self.points.len(), self.degree + 1);
        if points < order || self.weights.len() != points || self.knots.len() != points + order {
            return Err(format!(
                "a curve with {points} control points and {} knots",
                self.knots.len()
            ));
        }
        if self.knots.windows(2).any(|pair| pair[1] < pair[0])
            || self.weights.iter().any(|&weight| weight <= 0.0)
        {
            return Err("a curve with falling knots or a weight that is not positive".into());
        }
        Ok(())
    }

    /// The curve in pieces that are nearly straight.
    pub fn pieces(self) -> Vec<Curve> {
        let nurbs = Rc::new(self);
        let mut pieces = Vec::new();
        for span in nurbs.degree..nurbs.points.len() {
            let (from, to) = (nurbs.knots[span], nurbs.knots[span + 1]);
            if to > from {
                Curve::new(&nurbs, span, from, to).cut(&mut pieces);
            }
        }
        pieces
    }

    /// Position and its derivative by the parameter.
    fn evaluate(&self, span: usize, u: f64) -> (Position, Position) {
        let (degree, first) = (self.degree, span - self.degree);
        let mut points: Vec<(Position, f64)> = (first..=span)
            .map(|index| {
                (
                    plus_scaled(
                        &Position::default(),
                        self.weights[index],
                        &self.points[index],
                    ),
                    self.weights[index],
                )
            })
            .collect();
        let mut rate = (Position::default(), 0.0);
        for level in 1..=degree {
            if level == degree {
                let scale = degree as f64 / (self.knots[span + 1] - self.knots[span]);
                let (before, after) = (points[degree - 1], points[degree]);
                rate = (
                    minus(&after.0, &before.0).map(|part| scale * part),
                    scale * (after.1 - before.1),
                );
            }
            for index in (level..=degree).rev() {
                let (low, high) = (
                    self.knots[first + index],
                    self.knots[span + 1 + index - level],
                );
                let share = (u - low) / (high - low);
                let ((a, v), (b, w)) = (points[index - 1], points[index]);
                points[index] = (plus_scaled(&a, share, &minus(&b, &a)), v + share * (w - v));
            }
        }
        let (at, weight) = points[degree];
        let position = at.map(|part| part / weight);
        (
            position,
            plus_scaled(&rate.0, -rate.1, &position).map(|part| part / weight),
        )
    }
}

impl Curve {
    fn new(nurbs: &Rc<Nurbs>, span: usize, from: f64, to: f64) -> Self {
        let mut curve = Self {
            nurbs: Rc::clone(nurbs),
            span,
            from,
            to,
            length_mm: 0.0,
        };
        // What chords leave out goes with the square of their length: that of twice as long ones shows how much it is.
        let (sum_mm, coarse_mm) = (curve.chords_mm(CHORDS), curve.chords_mm(CHORDS / 2));
        curve.length_mm = sum_mm + (sum_mm - coarse_mm) / 3.0;
        curve
    }

    fn chords_mm(&self, count: usize) -> f64 {
        let ends: Vec<Position> = (0..=count)
            .map(|step| self.at(step as f64 / count as f64))
            .collect();
        ends.windows(2)
            .map(|pair| distance(&pair[0], &pair[1]))
            .sum()
    }

    fn cut(self, pieces: &mut Vec<Self>) {
        let middle = f64::midpoint(self.from, self.to);
        if self.is_plain() || middle <= self.from || middle >= self.to {
            if self.length_mm > NOTHING_MM {
                pieces.push(self);
            }
            return;
        }
        Self::new(&self.nurbs, self.span, self.from, middle).cut(pieces);
        Self::new(&self.nurbs, self.span, middle, self.to).cut(pieces);
    }

    /// Whether the piece is nearly straight and travelled evenly.
    fn is_plain(&self) -> bool {
        if self.length_mm < SHORTEST_MM {
            return true;
        }
        let ends: Vec<Position> = (0..=TRIED)
            .map(|step| self.at(step as f64 / TRIED as f64))
            .collect();
        let chords: Vec<Position> = ends
            .windows(2)
            .map(|pair| minus(&pair[1], &pair[0]))
            .collect();
        let lengths: Vec<f64> = chords
            .iter()
            .map(|chord| dot(chord, chord).sqrt())
            .collect();
        let longest = lengths.iter().copied().fold(0.0, f64::max);
        let shortest = lengths.iter().copied().fold(f64::INFINITY, f64::min);
        let cosine = |i: usize, k: usize| dot(&chords[i], &chords[k]) / (lengths[i] * lengths[k]);
        longest <= GREATEST_RATIO * shortest
            && (1..TRIED).all(|k| cosine(0, k) > GREATEST_TURN_RAD.cos())
    }

    fn parameter(&self, fraction: f64) -> f64 {
        if fraction < 0.5 {
            self.from + fraction * (self.to - self.from)
        } else {
            self.to + (fraction - 1.0) * (self.to - self.from)
        }
    }

    pub fn at(&self, fraction: f64) -> Position {
        self.nurbs.evaluate(self.span, self.parameter(fraction)).0
    }

    pub fn length_mm(&self) -> f64 {
        self.length_mm
    }

    pub fn reversed(&self) -> Self {
        Self {
            from: self.to,
            to: self.from,
            ..self.clone()
        }
    }

    /// Fraction of the nearest point of the piece: the best of many points, improved.
    pub fn foot(&self, point: &Position) -> f64 {
        let off_mm = |fraction: f64| distance(&self.at(fraction), point);
        let tried = (0..=TRIED).map(|step| step as f64 / TRIED as f64);
        let (mut best, mut best_mm) = (0.0, f64::INFINITY);
        for fraction in tried {
            let found_mm = off_mm(fraction);
            if found_mm < best_mm {
                (best, best_mm) = (fraction, found_mm);
            }
        }
        let mut share = 1.0;
        for _ in 0..STEPS {
            let next = (best + share * self.step(point, best)).clamp(0.0, 1.0);
            let next_mm = off_mm(next);
            if next_mm < best_mm {
                (best, best_mm) = (next, next_mm);
            } else {
                share /= 2.0;
            }
        }
        if self.step(point, best).abs() < SETTLED {
            best
        } else {
            self.narrowed(point, best)
        }
    }

    /// `best` or a nearer point beside it, found without its steps: where the point is near the center of curvature they hardly
    /// get on.
    fn narrowed(&self, point: &Position, best: f64) -> f64 {
        let off_mm = |fraction: f64| distance(&self.at(fraction), point);
        let beside = 1.0 / TRIED as f64;
        let (mut low, mut high) = ((best - beside).max(0.0), (best + beside).min(1.0));
        for _ in 0..THIRDS {
            let third = (high - low) / 3.0;
            if off_mm(low + third) < off_mm(high - third) {
                high -= third;
            } else {
                low += third;
            }
        }
        let found = f64::midpoint(low, high);
        if off_mm(found) < off_mm(best) {
            found
        } else {
            best
        }
    }

    /// The step towards the place where the line to the point is square to the curve, as if the curve were straight.
    fn step(&self, point: &Position, fraction: f64) -> f64 {
        let (here, rate) = self.nurbs.evaluate(self.span, self.parameter(fraction));
        let squared = dot(&rate, &rate);
        if squared > 0.0 {
            dot(&minus(point, &here), &rate) / squared / (self.to - self.from)
        } else {
            0.0
        }
    }

    /// A fraction within reach of the point, soon after the first one; `low` is out of reach and `nearest` within.
    pub fn entry(&self, point: &Position, reach_mm: f64, low: f64, nearest: f64) -> f64 {
        let (mut outside, mut inside) = (low, nearest);
        for _ in 0..HALVINGS {
            let middle = f64::midpoint(outside, inside);
            if distance(&self.at(middle), point) <= reach_mm {
                inside = middle;
            } else {
                outside = middle;
            }
        }
        inside
    }
}
