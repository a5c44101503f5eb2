//! The path of one block by its path coordinate.

use tandem_sdk::{AxisVector, Block, BlockKind, JointLanes};

use crate::arc::Arc;

/// A line, arc or helix over the path coordinate `0 ≤ s ≤ length` (mm; rad where only rotary axes move).
#[derive(Clone, Copy, Debug)]
pub struct Path {
    start: AxisVector,
    end: AxisVector,
    length_mm: f64,
    shape: Shape,
}

#[derive(Clone, Copy, Debug)]
enum Shape {
    /// Change of the axes per mm.
    Line(AxisVector),
    Arc(Arc),
}

impl Path {
    /// The path of `block`, or `None` for kinds without one of their own (dwells) and NURBS.
    pub fn new(block: &Block) -> Option<Self> {
        Self::with_lanes(block, None)
    }

    /// The same with the joints that are sums of axes behind the axes, as [`tandem_sdk::PlannerContext::joint_lanes`] has them. A
    /// line carries them by being linear.
    pub fn with_lanes(block: &Block, lanes: Option<&'static JointLanes>) -> Option<Self> {
        let shape = match block.kind {
            BlockKind::Line | BlockKind::Rapid if block.length_mm > 0.0 => {
                return Some(Self::line(&block.start, &block.end, block.length_mm));
            }
            BlockKind::Arc if block.length_mm > 0.0 => Shape::Arc(Arc::new(block, lanes)),
            _ => return None,
        };
        Some(Self {
            start: block.start,
            end: block.end,
            length_mm: block.length_mm,
            shape,
        })
    }

    /// A straight line; `length_mm`, above zero, is its length in the path's metric.
    pub fn line(start: &AxisVector, end: &AxisVector, length_mm: f64) -> Self {
        let shape = Shape::Line((*end - *start) * (1.0 / length_mm));
        Self {
            start: *start,
            end: *end,
            length_mm,
            shape,
        }
    }

    /// Length, mm.
    pub fn length_mm(&self) -> f64 {
        self.length_mm
    }

    /// The start point, exactly as programmed.
    pub fn start(&self) -> &AxisVector {
        &self.start
    }

    /// The end point, exactly as programmed.
    pub fn end(&self) -> &AxisVector {
        &self.end
    }

    /// Whether the path is straight.
    pub fn is_straight(&self) -> bool {
        matches!(self.shape, Shape::Line(_))
    }

    /// Radius of an arc's circle, mm; infinite for a line.
    pub fn radius_mm(&self) -> f64 {
        match &self.shape {
            Shape::Line(_) => f64::INFINITY,
            Shape::Arc(arc) => arc.radius_mm,
        }
    }

    /// Swept angle per mm of path, rad/mm; zero for a line.
    pub fn rad_per_mm(&self) -> f64 {
        match &self.shape {
            Shape::Line(_) => 0.0,
            Shape::Arc(arc) => arc.rad_per_mm.abs(),
        }
    }

    /// Position at `s_mm`. Both ends are the programmed points bit for bit.
    pub fn position(&self, s_mm: f64) -> AxisVector {
        if s_mm <= 0.0 {
            return self.start;
        }
        if s_mm >= self.length_mm {
            return self.end;
        }
        match &self.shape {
            Shape::Line(direction) => self.start + *direction * s_mm,
            Shape::Arc(arc) => arc.position(&self.start, s_mm),
        }
    }

    /// Change of the axes per mm at `s_mm`. Of unit length over the axes that path speed counts.
    pub fn direction(&self, s_mm: f64) -> AxisVector {
        match &self.shape {
            Shape::Line(direction) => *direction,
            Shape::Arc(arc) => arc.direction(s_mm),
        }
    }

    /// Second derivative of the axes by path coordinate at `s_mm`, 1/mm.
    pub fn curvature(&self, s_mm: f64) -> AxisVector {
        match &self.shape {
            Shape::Line(_) => AxisVector::ZERO,
            Shape::Arc(arc) => arc.curvature(s_mm),
        }
    }

    /// Third derivative of the axes by path coordinate at `s_mm`, 1/mm².
    pub fn third(&self, s_mm: f64) -> AxisVector {
        match &self.shape {
            Shape::Line(_) => AxisVector::ZERO,
            Shape::Arc(arc) => arc.third(s_mm),
        }
    }

    /// Per axis the largest |direction| on the path.
    pub fn max_direction(&self) -> AxisVector {
        match &self.shape {
            Shape::Line(direction) => direction.map(f64::abs),
            Shape::Arc(arc) => arc.largest(|angle| arc.direction_at(angle)),
        }
    }

    /// Per axis the largest |second derivative| on the path, 1/mm.
    pub fn max_curvature(&self) -> AxisVector {
        match &self.shape {
            Shape::Line(_) => AxisVector::ZERO,
            Shape::Arc(arc) => arc.largest(|angle| arc.curvature_at(angle)),
        }
    }

    /// Distance from `point` to the path over the axes in the path's metric, mm.
    pub fn distance_mm(&self, point: &AxisVector) -> f64 {
        let s_mm = match &self.shape {
            Shape::Line(direction) => nearest_on_line(&self.start, direction, point),
            Shape::Arc(arc) => arc.nearest(&self.start, point) / arc.rad_per_mm.abs(),
        };
        let at = self.position(s_mm.clamp(0.0, self.length_mm));
        (*point - at).0.iter().map(|d| d * d).sum::<f64>().sqrt()
    }
}

fn nearest_on_line(start: &AxisVector, direction: &AxisVector, point: &AxisVector) -> f64 {
    let dot =
        |a: &AxisVector, b: &AxisVector| -> f64 { a.0.iter().zip(&b.0).map(|(x, y)| x * y).sum() };
    dot(&(*point - *start), direction) / dot(direction, direction)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(end: &[f64]) -> Path {
        let mut block = Block::at(AxisVector::ZERO);
        block.kind = BlockKind::Line;
        block.end = AxisVector::from_slice(end);
        block.length_mm = end.iter().map(|v| v * v).sum::<f64>().sqrt();
        Path::new(&block).unwrap()
    }

    #[test]
    fn a_line_ends_at_its_programmed_point() {
        let path = line(&[0.1, 0.2, 0.3]);
        assert_eq!(
            path.position(path.length_mm()),
            AxisVector::from_slice(&[0.1, 0.2, 0.3])
        );
        assert_eq!(path.max_curvature(), AxisVector::ZERO);
        let aside = AxisVector::from_slice(&[-1.0, 0.0, 0.0]);
        assert_eq!(path.distance_mm(&aside), 1.0);
    }

    #[test]
    fn a_dwell_has_no_path() {
        assert!(Path::new(&Block::at(AxisVector::ZERO)).is_none());
    }
}
