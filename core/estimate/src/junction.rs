//! Where two blocks meet on a look-ahead machine, and what a block allows between its ends.
//!
//! All limits have one form, with w the square of the speed and a the path acceleration: `a·h + w·k ≤ A`.

use tandem_sdk::{AxisVector, MAX_AXES};

use crate::element::Element;

/// Turns below this are rounding.
const STRAIGHT: f64 = 1e-9;
/// Share of an axis' acceleration that turning may take under [`Rule::Axis`]; see docs/look-ahead.md.
const TURNING_SHARE: f64 = 0.8;
/// Share that the constant form of a junction's cost may take of an axis.
const CONSTANT_SHARE: f64 = 0.5;

/// How a control decides at which feed blocks meet.
#[derive(Clone, Debug, PartialEq)]
pub enum Rule {
    /// As published by Lee and Lee: `max(A·T/(1 − cos θ), V)`. Turning costs nothing else.
    Tangent {
        /// A along the path, mm/s²; none: the smallest of the axes that move.
        acceleration_mm_per_s2: Option<f64>,
        /// T, s.
        period_s: f64,
        /// V, mm/s.
        speed_difference_mm_per_s: f64,
    },
    /// No axis steps by more than V, and over any time Δt its velocity changes by at most A·Δt + V.
    Axis {
        /// A per axis, mm/s².
        acceleration_mm_per_s2: [f64; MAX_AXES],
        /// V per axis, mm/s.
        speed_difference_mm_per_s: [f64; MAX_AXES],
    },
}

/// One limit inside a block: `a·h + w·k ≤ A`.
#[derive(Clone, Copy, Debug, Default)]
pub struct Row {
    h: f64,
    k: f64,
    a: f64,
}

/// The limits inside a block.
#[derive(Clone, Copy, Debug, Default)]
pub struct Rows {
    rows: [Row; MAX_AXES],
    count: usize,
}

/// A junction: the feed that its rule allows, mm/s, and half the change of direction.
#[derive(Clone, Copy, Debug, Default)]
pub struct Junction {
    /// Highest feed, mm/s.
    pub feed_mm_per_s: f64,
    /// Half the change of direction.
    pub half_step: AxisVector,
}

impl Rows {
    fn push(&mut self, row: Row) {
        self.rows[self.count] = row;
        self.count += 1;
    }

    fn each(&self) -> &[Row] {
        &self.rows[..self.count]
    }

    /// Highest square of the speed at one end of `length_mm` when it is `w` at the other.
    pub fn reach(&self, w: f64, length_mm: f64) -> f64 {
        let along = |r: &Row| (r.h * w + 2.0 * length_mm * r.a) / (r.h + 2.0 * length_mm * r.k);
        self.each().iter().map(along).fold(f64::INFINITY, f64::min)
    }

    /// Highest square of the speed inside, when the squares at the ends have this mean.
    pub fn peak(&self, mean: f64, length_mm: f64) -> f64 {
        let top = |r: &Row| (r.h * mean + length_mm * r.a) / (r.h + length_mm * r.k);
        self.each().iter().map(top).fold(f64::INFINITY, f64::min)
    }

    /// Path acceleration left at the square `w` of the speed, mm/s².
    pub fn acceleration_mm_per_s2(&self, w: f64) -> f64 {
        let left = |r: &Row| {
            if r.h > 0.0 {
                (r.a - w * r.k) / r.h
            } else {
                f64::INFINITY
            }
        };
        self.each().iter().map(left).fold(f64::INFINITY, f64::min)
    }

    /// Square of the highest speed at which turning takes no more than its share.
    pub fn turning_cap(&self) -> f64 {
        let cap = |r: &Row| {
            if r.k > 0.0 {
                TURNING_SHARE * r.a / r.k
            } else {
                f64::INFINITY
            }
        };
        self.each().iter().map(cap).fold(f64::INFINITY, f64::min)
    }
}

impl Rule {
    /// Where `before` passes into `after` without a rest.
    pub fn join(&self, before: &Element, after: &Element) -> Junction {
        let step = after.directions[0] - before.directions[1];
        let capped = before.feed_mm_per_s.min(after.feed_mm_per_s);
        let feed = match self {
            Self::Tangent {
                period_s,
                speed_difference_mm_per_s,
                ..
            } => {
                let acceleration = self
                    .path_acceleration(before)
                    .min(self.path_acceleration(after));
                let drop = 2.0 * (before.turn_rad(after) / 2.0).sin().powi(2);
                let tangent = if drop < STRAIGHT * STRAIGHT {
                    f64::INFINITY
                } else {
                    acceleration * period_s / drop
                };
                tangent.max(*speed_difference_mm_per_s)
            }
            Self::Axis {
                speed_difference_mm_per_s,
                ..
            } => {
                let axes = speed_difference_mm_per_s.iter().zip(step.0.map(f64::abs));
                axes.filter(|(_, step)| *step > STRAIGHT)
                    .map(|(v, step)| v / step)
                    .fold(f64::INFINITY, f64::min)
            }
        };
        Junction {
            feed_mm_per_s: feed.min(capped),
            half_step: step * 0.5,
        }
    }

    fn path_acceleration(&self, element: &Element) -> f64 {
        match self {
            Self::Tangent {
                acceleration_mm_per_s2: Some(a),
                ..
            } => *a,
            _ => element.acceleration_mm_per_s2,
        }
    }

    /// The limits inside `element` between the junctions at its ends.
    pub fn rows(&self, element: &Element, ends: [&Junction; 2]) -> Rows {
        let mut rows = Rows::default();
        let Self::Axis {
            acceleration_mm_per_s2,
            ..
        } = self
        else {
            rows.push(Row {
                h: 1.0,
                k: 0.0,
                a: self.path_acceleration(element),
            });
            return rows;
        };
        for (axis, a) in acceleration_mm_per_s2.iter().enumerate() {
            let plain = Row {
                h: element.most[axis],
                k: element.bend[axis],
                a: *a,
            };
            let halves = ends.map(|end| end.half_step[axis]);
            let row = if halves == [0.0; 2] {
                plain
            } else {
                cost(plain, element, ends, halves)
            };
            if row.h > 0.0 || row.k > 0.0 {
                rows.push(row);
            }
        }
        rows
    }
}

/// A row with what the steps at both ends cost the axis: they are taken back inside the block, at the rate
/// `(v_s·Δu_s + v_e·Δu_e)/(2t)`. Bounded by a constant, or by the square of the speed, whichever leaves more speed.
fn cost(row: Row, element: &Element, ends: [&Junction; 2], halves: [f64; 2]) -> Row {
    let per_mm = 1.0 / element.length_mm;
    let [start, end] = ends.map(|end| end.feed_mm_per_s);
    let [before, after] = halves;
    let taken = element.feed_mm_per_s * (start * before.abs() + end * after.abs()) * per_mm;
    let constant = Row {
        a: row.a - taken,
        ..row
    };
    let square = Row {
        h: row.h + before.abs().max(after.abs()),
        k: row.k + (before + after).abs() * per_mm,
        a: row.a,
    };
    let slow = start.min(end).powi(2);
    let reach = |r: &Row| {
        (
            r.h * slow + 2.0 * element.length_mm * r.a,
            r.h + 2.0 * element.length_mm * r.k,
        )
    };
    let ((n, d), (other_n, other_d)) = (reach(&constant), reach(&square));
    let as_far = n >= element.feed_mm_per_s.powi(2) * d || n * other_d >= other_n * d;
    if constant.a >= (1.0 - CONSTANT_SHARE) * row.a && as_far {
        constant
    } else {
        square
    }
}
