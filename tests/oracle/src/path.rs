//! The programmed path as a chain of lines, arcs and pieces of curves.

mod arc;
mod line;
mod nurbs;
#[cfg(test)]
mod tests;

pub use arc::Arc;
pub use line::Line;
pub use nurbs::{Curve, Nurbs};

use crate::{Position, geometry::distance};

/// A piece is no longer than this times its length, which of a curve is known to a ten-millionth.
const LONGER: f64 = 1.0001;

/// The whole path in the order of travel.
#[derive(Clone, Debug, Default)]
pub struct Path {
    /// Pieces with a length; each starts where the one before ends.
    pub elements: Vec<Element>,
    /// The programmed end.
    pub end: Position,
}

/// A block, or a part of an arc or curve short enough to be curved one way only.
#[derive(Clone, Debug)]
pub struct Element {
    /// Line of the part program, from 1.
    pub line: u32,
    pub shape: Shape,
    pub feed: Feed,
    /// Whether path speed counts linear axes here; degrees otherwise.
    pub moves_linear: bool,
    /// Tolerance in force, mm.
    pub tolerance_mm: f64,
    /// The element ends at a position where motion has to stop.
    pub exact_stop: bool,
}

#[derive(Clone, Debug)]
pub enum Shape {
    Line(Line),
    Arc(Arc),
    Curve(Curve),
}

/// How fast a block may be travelled.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Feed {
    /// As fast as the axes may.
    Rapid,
    /// mm/s, or deg/s where only rotary axes move.
    PerSecond(f64),
}

/// A place on the path; places compare in the order of travel.
#[derive(Clone, Copy, Debug, Default, PartialEq, PartialOrd)]
pub struct PathPosition {
    pub element: usize,
    /// From 0 at the start of the element to 1 at its end.
    pub fraction: f64,
}

impl Shape {
    pub fn at(&self, fraction: f64) -> Position {
        match self {
            Self::Line(line) => line.at(fraction),
            Self::Arc(arc) => arc.at(fraction),
            Self::Curve(curve) => curve.at(fraction),
        }
    }

    pub fn length_mm(&self) -> f64 {
        match self {
            Self::Line(line) => line.length_mm(),
            Self::Arc(arc) => arc.length_mm(),
            Self::Curve(curve) => curve.length_mm(),
        }
    }

    /// The same piece, travelled the other way.
    pub fn reversed(&self) -> Self {
        match self {
            Self::Line(line) => Self::Line(line.reversed()),
            Self::Arc(arc) => Self::Arc(arc.reversed()),
            Self::Curve(curve) => Self::Curve(curve.reversed()),
        }
    }

    /// The nearest point with a fraction in `[low, high]`: fraction and distance.
    pub fn nearest(&self, point: &Position, low: f64, high: f64) -> (f64, f64) {
        let free = match self {
            Self::Line(line) => line.foot(point),
            Self::Arc(arc) => arc.foot(point),
            Self::Curve(curve) => curve.foot(point),
        };
        let fraction = free.clamp(low, high.max(low));
        (fraction, distance(&self.at(fraction), point))
    }

    /// The same, where it is nearer than `off_mm`.
    pub fn nearer(
        &self,
        point: &Position,
        (low, high): (f64, f64),
        off_mm: f64,
    ) -> Option<(f64, f64)> {
        if self.is_beyond(distance(&self.at(low), point), off_mm) {
            return None;
        }
        Some(self.nearest(point, low, high)).filter(|found| found.1 < off_mm)
    }

    /// Whether what is `from_mm` away from one of its points is further than `reach_mm` from all of them: then the piece, which
    /// is not that long, need not be looked at closely.
    fn is_beyond(&self, from_mm: f64, reach_mm: f64) -> bool {
        from_mm > reach_mm + LONGER * self.length_mm()
    }

    /// The first fraction from `low` on that lies within a distance of the point.
    pub fn first_within(&self, point: &Position, reach_mm: f64, low: f64) -> Option<f64> {
        let low_mm = distance(&self.at(low), point);
        if low_mm <= reach_mm {
            return Some(low);
        }
        if self.is_beyond(low_mm, reach_mm) {
            return None;
        }
        let (nearest, off_mm) = self.nearest(point, low, 1.0);
        if off_mm > reach_mm {
            return None;
        }
        let first = match self {
            Self::Line(line) => line.entry(point, reach_mm),
            Self::Arc(arc) => arc.entry(point, reach_mm, low, nearest),
            Self::Curve(curve) => curve.entry(point, reach_mm, low, nearest),
        };
        Some(first.clamp(low, nearest))
    }
}
