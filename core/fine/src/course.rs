//! The plan ahead as it is queued, at any place: what a way of σ is tried on before it is begun.

use tandem_rings::Queued;
use tandem_sdk::{MAX_AXES, Segment, SegmentFlags};

use crate::outlook::derivatives;
use crate::steps::Steps;

/// The plan from here on: the segment that moves, and what is queued behind it.
#[derive(Clone, Copy, Debug)]
pub struct Course<'a> {
    segment: &'a Segment,
    queued: [&'a [Queued]; 2],
    axes: usize,
}

/// Derivatives of the plan at a place by program time, per axis.
#[derive(Clone, Copy, Debug, Default)]
pub struct Motion {
    /// Velocity, mm/s.
    pub velocity: [f64; MAX_AXES],
    /// Acceleration, mm/s².
    pub acceleration: [f64; MAX_AXES],
    /// Jerk, mm/s³.
    pub jerk: [f64; MAX_AXES],
}

/// A place on a [`Course`].
#[derive(Clone, Copy, Debug)]
pub struct Place<'a> {
    course: Course<'a>,
    /// The segment here; none behind a rest and behind what is queued, where nothing moves.
    segment: Option<&'a Segment>,
    /// Entries passed.
    passed: usize,
    local_s: f64,
    /// The place lies within what is queued, or at a rest that ends it.
    known: bool,
}

impl<'a> Course<'a> {
    /// `segment` moves, `queued` follows; `axes` axes are looked at.
    pub fn new(segment: &'a Segment, queued: [&'a [Queued]; 2], axes: usize) -> Self {
        Self { segment, queued, axes }
    }

    /// The place at local time `local_s` of the segment that moves.
    pub fn begin(&self, local_s: f64) -> Place<'a> {
        Place { course: *self, segment: Some(self.segment), passed: 0, local_s, known: true }
    }

    fn entry(&self, n: usize) -> Option<&'a Queued> {
        let [first, second] = self.queued;
        first.get(n).or_else(|| second.get(n - first.len()))
    }
}

impl Place<'_> {
    /// How the plan moves here.
    pub fn motion(&self) -> Motion {
        let mut motion = Motion::default();
        let Some(segment) = self.segment else { return motion };
        for axis in 0..self.course.axes {
            let [velocity, acceleration, jerk] = derivatives(&segment.coefficients[axis], self.local_s);
            (motion.velocity[axis], motion.acceleration[axis], motion.jerk[axis]) = (velocity, acceleration, jerk);
        }
        motion
    }

    /// Whether what lies behind the place is known: `false` beyond what is queued, unless that ends at rest.
    pub fn is_known(&self) -> bool {
        self.known
    }

    /// How much of `most_s` lies in the segment here, s; all of it where nothing moves.
    pub fn stretch_s(&self, most_s: f64) -> f64 {
        self.segment.map_or(most_s, |segment| (segment.duration_s - self.local_s).clamp(0.0, most_s))
    }

    /// Moves on to the end of the segment, and by no more than `most_s`; gives what is left of it.
    pub fn advance(&mut self, most_s: f64) -> f64 {
        let Some(segment) = self.segment else { return 0.0 };
        let left_s = segment.duration_s - self.local_s;
        self.local_s += left_s.min(most_s);
        (most_s - left_s).max(0.0)
    }

    /// From the end of a segment to the start of the next one that moves; gives what steps there.
    pub fn step(&mut self) -> Option<Steps> {
        let before = self.segment;
        let mut rests = self.segment.is_none_or(ends);
        self.segment = None;
        while !rests && self.segment.is_none() {
            match self.course.entry(self.passed) {
                Some(Queued::Segment { segment, .. }) if segment.duration_s == 0.0 => rests = ends(segment),
                Some(Queued::Segment { segment, .. }) => self.segment = Some(segment),
                Some(Queued::Event(_)) => {}
                None => (rests, self.known) = (true, false),
            }
            self.passed += 1;
        }
        self.local_s = 0.0;
        match (before, self.segment) {
            // A plan made of samples may come to rest with some acceleration left.
            (Some(before), None) if self.known => Some(Steps::to_rest(before)),
            (Some(before), Some(behind)) if behind.flags.contains(SegmentFlags::STEPS) => {
                Some(Steps::between(before, behind))
            }
            _ => None,
        }
    }

    /// What steps within `horizon_s` from here.
    pub fn steps_within(mut self, horizon_s: f64) -> Steps {
        let (mut steps, mut left_s) = (Steps::default(), self.advance(horizon_s));
        while left_s > 0.0 && self.segment.is_some() {
            if let Some(more) = self.step() {
                steps.join(&more);
            }
            left_s = self.advance(left_s);
        }
        steps
    }
}

fn ends(segment: &Segment) -> bool {
    segment.flags.contains(SegmentFlags::ENDS_AT_REST)
}
