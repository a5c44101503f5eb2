//! The plan as the planner emitted it, by program time and by path coordinate.

use tandem_sdk::{Segment, SegmentFlags};

/// Segments one after the other, each with its start in program time, s.
pub struct Plan {
    pieces: Vec<(f64, Segment)>,
}

/// A place of the plan as the governor must see it: the velocity that is continuous over junctions, and its rate.
#[derive(Clone, Copy, Debug)]
pub struct PlanState {
    pub velocity: [f64; 8],
    pub acceleration: [f64; 8],
}

/// A stretch of program time inside one segment.
#[derive(Clone, Copy)]
pub struct Stretch<'a> {
    segment: &'a Segment,
    start_s: f64,
    pub from_s: f64,
    pub until_s: f64,
}

impl Plan {
    pub fn new(segments: &[Segment]) -> Self {
        let mut start_s = 0.0;
        let mut pieces: Vec<(f64, Segment)> = vec![];
        for segment in segments {
            // A rest without duration belongs to what comes before it.
            match pieces.last_mut() {
                Some((_, last)) if segment.duration_s == 0.0 => {
                    last.flags = last.flags.with(segment.flags);
                }
                _ if segment.duration_s == 0.0 => {}
                _ => pieces.push((start_s, *segment)),
            }
            start_s += segment.duration_s;
        }
        Self { pieces }
    }

    /// Program time at the end, s.
    pub fn end_s(&self) -> f64 {
        self.pieces
            .last()
            .map_or(0.0, |(start_s, segment)| start_s + segment.duration_s)
    }

    /// Program time at which a path coordinate is reached first, s.
    pub fn time_s(&self, path_mm: f64) -> f64 {
        let behind = |(_, segment): &(f64, Segment)| segment.path_mm(segment.duration_s) < path_mm;
        let index = self
            .pieces
            .partition_point(behind)
            .min(self.pieces.len() - 1);
        let (start_s, segment) = &self.pieces[index];
        let (mut low, mut high) = (0.0, segment.duration_s);
        for _ in 0..60 {
            let middle = f64::midpoint(low, high);
            let side = if segment.path_mm(middle) < path_mm {
                &mut low
            } else {
                &mut high
            };
            *side = middle;
        }
        start_s + high
    }

    /// What lies between two program times, segment by segment.
    pub fn stretches(&self, from_s: f64, until_s: f64) -> impl Iterator<Item = Stretch<'_>> {
        let first = self
            .pieces
            .partition_point(|(start_s, _)| *start_s <= from_s)
            .max(1)
            - 1;
        self.pieces[first..]
            .iter()
            .take_while(move |(start_s, _)| *start_s < until_s)
            .map(move |(start_s, segment)| {
                let end_s = start_s + segment.duration_s;
                Stretch {
                    segment,
                    start_s: *start_s,
                    from_s: from_s.max(*start_s),
                    until_s: until_s.min(end_s),
                }
            })
    }

    /// Whether an axis brakes at its limit somewhere between two program times: then nothing can be slower.
    pub fn brakes_at_limit(&self, from_s: f64, until_s: f64, limit: &[f64]) -> bool {
        let brakes = |place: &PlanState, axis: usize| {
            let along = place.acceleration[axis] * place.velocity[axis].signum();
            place.velocity[axis] != 0.0 && along <= -0.9989 * limit[axis]
        };
        self.stretches(from_s, until_s).any(|stretch| {
            let ends = [stretch.at(stretch.from_s), stretch.at(stretch.until_s)];
            ends.iter()
                .any(|place| (0..limit.len()).any(|axis| brakes(place, axis)))
        })
    }

    /// Whether the plan comes to rest between two program times.
    pub fn rests(&self, from_s: f64, until_s: f64) -> bool {
        self.stretches(from_s, until_s).any(|stretch| {
            let end_s = stretch.start_s + stretch.segment.duration_s;
            stretch.segment.flags.contains(SegmentFlags::ENDS_AT_REST) && end_s <= until_s
        })
    }
}

impl Stretch<'_> {
    /// The place at a program time within the stretch.
    pub fn at(&self, time_s: f64) -> PlanState {
        let local_s = (time_s - self.start_s).clamp(0.0, self.segment.duration_s);
        let (velocity, acceleration) = (
            self.segment.velocity(local_s),
            self.segment.acceleration(local_s),
        );
        let (lead, rate) = (self.segment.step_velocity, self.segment.step_acceleration);
        PlanState {
            velocity: std::array::from_fn(|axis| {
                velocity[axis] - lead[axis] + rate[axis] * local_s
            }),
            acceleration: std::array::from_fn(|axis| acceleration[axis] + rate[axis]),
        }
    }
}
