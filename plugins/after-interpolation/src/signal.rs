//! What goes into the filter: the programmed position over time, every block at its command feed.

use std::collections::VecDeque;

use tandem_motion::Path;
use tandem_sdk::AxisVector;

/// What the programmed position does in a span of time.
#[derive(Clone, Copy, Debug)]
#[allow(clippy::large_enum_variant)] // nearly every span is a path, and boxing it would allocate for every block
enum Course {
    Rest(AxisVector),
    Path { path: Path, feed_mm_per_s: f64 },
}

/// A span of the signal.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Span {
    begin_s: f64,
    end_s: f64,
    course: Course,
}

impl Span {
    /// Where the span ends, s.
    pub fn end_s(&self) -> f64 {
        self.end_s
    }

    /// How fast the direction turns, rad/s; zero on a line and at rest.
    pub fn turn_rad_per_s(&self) -> f64 {
        match &self.course {
            Course::Rest(_) => 0.0,
            Course::Path {
                path,
                feed_mm_per_s,
            } => path.rad_per_mm() * feed_mm_per_s,
        }
    }

    fn position(&self, t_s: f64) -> AxisVector {
        match &self.course {
            Course::Rest(position) => *position,
            Course::Path {
                path,
                feed_mm_per_s,
            } => path.position((t_s - self.begin_s) * feed_mm_per_s),
        }
    }

    fn velocity(&self, t_s: f64) -> AxisVector {
        match &self.course {
            Course::Rest(_) => AxisVector::ZERO,
            Course::Path {
                path,
                feed_mm_per_s,
            } => path.direction((t_s - self.begin_s) * feed_mm_per_s) * *feed_mm_per_s,
        }
    }

    /// `∫ weight(t)·(position(t) − base) dt` from `from_s` to `to_s`, both in the span, by Gauss-Legendre quadrature:
    /// to rounding where `weight` is smooth on the scale of the interval.
    fn integral(
        &self,
        from_s: f64,
        to_s: f64,
        base: &AxisVector,
        weight: &impl Fn(f64) -> f64,
    ) -> AxisVector {
        let turned = self.turn_rad_per_s() * (to_s - from_s);
        let nodes: &[(f64, f64)] = if turned == 0.0 { &GAUSS_3 } else { &GAUSS_5 };
        let parts = (turned / MAX_TURN_RAD).ceil().max(1.0) as u32;
        let half_s = (to_s - from_s) / f64::from(2 * parts);
        let mut sum = AxisVector::ZERO;
        for part in 0..parts {
            let middle_s = from_s + f64::from(2 * part + 1) * half_s;
            for (node, share) in nodes {
                let t_s = middle_s + node * half_s;
                sum += (self.position(t_s) - *base) * (weight(t_s) * share * half_s);
            }
        }
        sum
    }
}

/// Nodes and weights on −1…1. Three are exact for a line under a weight of degree 4.
const GAUSS_3: [(f64, f64); 3] = [
    (-0.774_596_669_241_483_4, 5.0 / 9.0),
    (0.0, 8.0 / 9.0),
    (0.774_596_669_241_483_4, 5.0 / 9.0),
];

/// Five leave less than 1e-15 of a sine over [`MAX_TURN_RAD`].
const GAUSS_5: [(f64, f64); 5] = [
    (-0.906_179_845_938_664, 0.236_926_885_056_189_1),
    (-0.538_469_310_105_683_1, 0.478_628_670_499_366_5),
    (0.0, 0.568_888_888_888_888_9),
    (0.538_469_310_105_683_1, 0.478_628_670_499_366_5),
    (0.906_179_845_938_664, 0.236_926_885_056_189_1),
];

/// Largest angle of an arc that one set of nodes covers, rad. With twice as much the integral over a circle is off by more than rounding
/// (`integral_of_a_circle_is_that_of_its_cosine`); with half no test of this crate had another result.
const MAX_TURN_RAD: f64 = 0.5;

/// The programmed position from long ago (at rest) to the end of the last block started. Time counts from the last rest.
#[derive(Debug)]
pub(crate) struct Signal {
    spans: VecDeque<Span>,
}

impl Signal {
    /// At rest at `position` since ever.
    pub fn new(position: &AxisVector) -> Self {
        let mut this = Self {
            spans: VecDeque::with_capacity(256),
        };
        this.restart(position);
        this
    }

    /// Forgets everything: at rest at `position` since ever, and time starts at zero.
    pub fn restart(&mut self, position: &AxisVector) {
        self.spans.clear();
        self.spans.push_back(Span {
            begin_s: f64::NEG_INFINITY,
            end_s: 0.0,
            course: Course::Rest(*position),
        });
    }

    /// A block follows, driven at `feed_mm_per_s`.
    pub fn push_path(&mut self, path: &Path, feed_mm_per_s: f64) {
        let begin_s = self.end_s();
        let end_s = begin_s + path.length_mm() / feed_mm_per_s;
        self.spans.push_back(Span {
            begin_s,
            end_s,
            course: Course::Path {
                path: *path,
                feed_mm_per_s,
            },
        });
    }

    /// A rest at `position` follows.
    pub fn push_rest(&mut self, position: &AxisVector, duration_s: f64) {
        let begin_s = self.end_s();
        self.spans.push_back(Span {
            begin_s,
            end_s: begin_s + duration_s,
            course: Course::Rest(*position),
        });
    }

    /// Where the known signal ends, s.
    pub fn end_s(&self) -> f64 {
        self.spans.back().map_or(0.0, Span::end_s)
    }

    /// Forgets what ended before `t_s`. Keeps the memory bounded by what the filter looks back on.
    pub fn drop_before(&mut self, t_s: f64) {
        while self.spans.len() > 1 && self.spans[0].end_s <= t_s {
            self.spans.pop_front();
        }
    }

    /// Number of spans held.
    pub fn len(&self) -> usize {
        self.spans.len()
    }

    fn index_at(&self, t_s: f64) -> usize {
        self.spans
            .partition_point(|span| span.end_s <= t_s)
            .min(self.spans.len() - 1)
    }

    /// The span that holds `t_s`; at a border the later one.
    pub fn span_at(&self, t_s: f64) -> &Span {
        &self.spans[self.index_at(t_s)]
    }

    /// Programmed position at `t_s`.
    pub fn position(&self, t_s: f64) -> AxisVector {
        self.span_at(t_s).position(t_s)
    }

    /// Programmed velocity at `t_s`; at a border that of the span which holds `inside_s`.
    pub fn velocity(&self, t_s: f64, inside_s: f64) -> AxisVector {
        self.span_at(inside_s).velocity(t_s)
    }

    /// `∫ weight(t)·(position(t) − base) dt` from `from_s` to `to_s`.
    pub fn integral(
        &self,
        from_s: f64,
        to_s: f64,
        base: &AxisVector,
        weight: impl Fn(f64) -> f64,
    ) -> AxisVector {
        let mut sum = AxisVector::ZERO;
        for span in self.spans.range(self.index_at(from_s)..) {
            if span.begin_s >= to_s {
                break;
            }
            sum += span.integral(
                from_s.max(span.begin_s),
                to_s.min(span.end_s),
                base,
                &weight,
            );
        }
        sum
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tandem_sdk::{ArcGeometry, Block, BlockKind};

    fn circle() -> Path {
        let mut block = Block::at(AxisVector::from_slice(&[3.0, 0.0]));
        block.kind = BlockKind::Arc;
        block.length_mm = 3.0 * std::f64::consts::TAU;
        let sweep_rad = std::f64::consts::TAU;
        block.arc = ArcGeometry {
            plane: [0, 1],
            center_mm: [0.0; 2],
            radius_mm: 3.0,
            start_angle_rad: 0.0,
            sweep_rad,
        };
        Path::new(&block).unwrap()
    }

    #[test]
    fn integral_of_a_circle_is_that_of_its_cosine() {
        let mut signal = Signal::new(&AxisVector::from_slice(&[3.0, 0.0]));
        signal.push_path(&circle(), 6.0);
        let base = AxisVector::ZERO;
        let sum = signal.integral(-1.0, 2.5, &base, |_| 1.0);
        assert!((sum[0] - (3.0 + 3.0 * 5.0_f64.sin() / 2.0)).abs() < 1e-13);
        assert!((sum[1] - 3.0 * (1.0 - 5.0_f64.cos()) / 2.0).abs() < 1e-13);
        let ramp = signal.integral(0.0, 2.5, &base, |t| t);
        let moment = 3.0 * (5.0_f64.cos() / 4.0 + 2.5 * 5.0_f64.sin() / 2.0 - 0.25);
        assert!((ramp[0] - moment).abs() < 1e-13);
    }

    #[test]
    fn what_is_dropped_is_what_lies_behind() {
        let mut signal = Signal::new(&AxisVector::ZERO);
        (0..5).for_each(|_| signal.push_rest(&AxisVector::ZERO, 1.0));
        signal.drop_before(2.5);
        assert_eq!(signal.len(), 3);
        signal.drop_before(99.0);
        assert_eq!((signal.len(), signal.end_s()), (1, 5.0));
    }
}
