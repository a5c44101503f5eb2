//! Straight pieces.

use crate::{
    Position,
    geometry::{distance, dot, minus, plus_scaled},
};

#[derive(Clone, Debug)]
pub struct Line {
    from: Position,
    to: Position,
    along: Position,
    length_squared: f64,
}

impl Line {
    pub fn new(from: Position, to: Position) -> Self {
        let along = minus(&to, &from);
        Self {
            from,
            to,
            along,
            length_squared: dot(&along, &along),
        }
    }

    pub fn at(&self, fraction: f64) -> Position {
        // The far half counts from the end, so that the end itself is met to the last bit.
        if fraction < 0.5 {
            plus_scaled(&self.from, fraction, &self.along)
        } else {
            plus_scaled(&self.to, fraction - 1.0, &self.along)
        }
    }

    pub fn length_mm(&self) -> f64 {
        self.length_squared.sqrt()
    }

    pub fn reversed(&self) -> Self {
        Self::new(self.to, self.from)
    }

    /// Fraction of the nearest point of the endless line.
    pub fn foot(&self, point: &Position) -> f64 {
        dot(&minus(point, &self.from), &self.along) / self.length_squared
    }

    /// Fraction at which the endless line comes within a distance of the point.
    pub fn entry(&self, point: &Position, reach_mm: f64) -> f64 {
        let foot = self.foot(point);
        let off_mm = distance(&self.at(foot), point);
        foot - (reach_mm * reach_mm - off_mm * off_mm).max(0.0).sqrt() / self.length_mm()
    }
}
