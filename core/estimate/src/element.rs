//! What a model needs to know of one block.

use tandem_motion::Path;
use tandem_sdk::{AxisVector, Block, BlockKind, Curve, Limits};

/// How a block spends its time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// A rapid, from rest to rest.
    Rapid,
    /// Feed motion.
    Cut,
    /// The machine waits.
    Dwell,
}

/// One block as models see it. Directions are changes of the axes per mm of path.
#[derive(Clone, Copy, Debug)]
pub struct Element {
    /// How it spends its time.
    pub kind: Kind,
    /// Line of the program, from 1.
    pub line: u32,
    /// Tool in the spindle.
    pub tool: u32,
    /// Length of the path, mm.
    pub length_mm: f64,
    /// Programmed feed, at most a policy's cap and what the axes may drive along this path; of a rapid the machine's rapid
    /// feed, mm/s.
    pub feed_mm_per_s: f64,
    /// Length over programmed feed; of a rapid over the rapid feed; of a dwell its duration, s.
    pub nominal_s: f64,
    /// Direction at the start and at the end.
    pub directions: [AxisVector; 2],
    /// Per axis the largest |direction| on the path.
    pub most: AxisVector,
    /// Per axis the largest |second derivative| on the path, 1/mm.
    pub bend: AxisVector,
    /// The smallest acceleration of the axes that move, mm/s².
    pub acceleration_mm_per_s2: f64,
    /// The machine rests at the start for the program's sake.
    pub starts_at_rest: bool,
    /// The machine rests at the end for the program's sake.
    pub ends_at_rest: bool,
    /// Time constant that the program asks for, s; NaN where it asks for none.
    pub time_constant_s: f64,
}

impl Element {
    /// What `block` says on a machine with `limits`. Does not allocate.
    pub fn new(block: &Block, curve: Option<Curve<'_>>, limits: &Limits) -> Self {
        let mut element = Self {
            kind: Kind::Dwell,
            line: block.line,
            tool: block.tool,
            length_mm: 0.0,
            feed_mm_per_s: f64::INFINITY,
            nominal_s: block.dwell_s,
            directions: [AxisVector::ZERO; 2],
            most: AxisVector::ZERO,
            bend: AxisVector::ZERO,
            acceleration_mm_per_s2: f64::INFINITY,
            starts_at_rest: block.starts_at_rest(),
            ends_at_rest: block.ends_at_rest(),
            time_constant_s: block.time_constant_s,
        };
        if block.kind != BlockKind::Dwell {
            element.length_mm = block.length_mm;
            element.geometry(block, curve);
            element.feeds(block, limits);
        }
        element
    }

    /// A straight block of feed motion in the plane of the first two axes, turned by `angle_rad` from the first.
    pub fn line(length_mm: f64, angle_rad: f64, feed_mm_per_s: f64) -> Self {
        let direction = AxisVector::from_slice(&[angle_rad.cos(), angle_rad.sin()]);
        let mut block = Block {
            kind: BlockKind::Line,
            length_mm,
            feed_mm_per_s,
            ..Block::at(AxisVector::ZERO)
        };
        block.end = direction * length_mm;
        let mut element = Self::new(&block, None, &unlimited());
        (element.directions, element.most) = ([direction; 2], direction.map(f64::abs));
        element
    }

    fn geometry(&mut self, block: &Block, curve: Option<Curve<'_>>) {
        if let Some(path) = Path::new(block) {
            self.directions = [path.direction(0.0), path.direction(path.length_mm())];
            (self.most, self.bend) = (path.max_direction(), path.max_curvature());
        } else if let Some(curve) = curve {
            let points = curve.control_points.get();
            if let [first, second, ..] = points {
                let [before, last] = points.last_chunk().copied().unwrap_or([*first, *second]);
                self.directions = [unit(*second - *first), unit(last - before)];
                self.most = AxisVector(std::array::from_fn(|i| {
                    self.directions[0][i].abs().max(self.directions[1][i].abs())
                }));
            }
        }
    }

    fn feeds(&mut self, block: &Block, limits: &Limits) {
        let along = limits.along(&self.most);
        let moving = limits
            .axes()
            .iter()
            .enumerate()
            .filter(|(axis, _)| self.most[*axis] > 0.0);
        self.acceleration_mm_per_s2 = moving
            .map(|(_, a)| a.acceleration_mm_per_s2)
            .fold(f64::INFINITY, f64::min);
        let rapid = block.kind == BlockKind::Rapid;
        self.kind = if rapid { Kind::Rapid } else { Kind::Cut };
        let programmed = if rapid {
            along.rapid_mm_per_s
        } else {
            block.feed_mm_per_s
        };
        self.feed_mm_per_s = if rapid {
            programmed
        } else {
            block.command_feed_mm_per_s().min(along.feed_mm_per_s)
        };
        self.nominal_s = if self.length_mm > 0.0 {
            self.length_mm / programmed
        } else {
            0.0
        };
    }

    /// Whether the machine rests between this block and `next`.
    pub fn rests_before(&self, next: &Self) -> bool {
        self.ends_at_rest || next.starts_at_rest
    }

    /// The angle by which the path turns from this block to `next`, rad.
    pub fn turn_rad(&self, next: &Self) -> f64 {
        let (out, into) = (unit(self.directions[1]), unit(next.directions[0]));
        2.0 * norm(into - out).atan2(norm(into + out))
    }
}

fn norm(vector: AxisVector) -> f64 {
    vector.0.iter().map(|v| v * v).sum::<f64>().sqrt()
}

fn unit(vector: AxisVector) -> AxisVector {
    let length = norm(vector);
    if length > 0.0 {
        vector * (1.0 / length)
    } else {
        vector
    }
}

/// Limits that nothing meets.
fn unlimited() -> Limits {
    let most = f64::INFINITY;
    let axis = tandem_sdk::AxisLimits {
        min_mm: -most,
        max_mm: most,
        feed_mm_per_s: most,
        rapid_mm_per_s: most,
        acceleration_mm_per_s2: most,
        jerk_mm_per_s3: most,
        speed_difference_mm_per_s: most,
    };
    Limits::new(&[axis; 2]).expect("two axes are a machine")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn turns_are_exact_from_straight_on_to_back() {
        let line = |angle: f64| Element::line(1.0, angle, 10.0);
        for angle in [0.0, 1e-9, 0.3, 1.5, 3.0, std::f64::consts::PI] {
            let turn = line(0.7).turn_rad(&line(0.7 + angle));
            assert!((turn - angle).abs() < 1e-12, "{turn} instead of {angle}");
        }
    }

    #[test]
    fn a_dwell_is_its_duration() {
        let block = Block {
            dwell_s: 1.5,
            ..Block::at(AxisVector::ZERO)
        };
        let element = Element::new(&block, None, &unlimited());
        assert_eq!(
            (element.kind, element.nominal_s, element.length_mm),
            (Kind::Dwell, 1.5, 0.0)
        );
    }
}
