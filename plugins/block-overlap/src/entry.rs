//! What the planner knows of one block by itself.

use tandem_motion::blocks::BlockId;
use tandem_motion::{Builder, Path};
use tandem_sdk::{AxisVector, Block, BlockKind, LimitedBy};

use crate::rules::{ARC_SHARE, Rules, TURN_SHARE, greater, lesser};

/// The path of an arc, and how long a segment on it may be.
#[derive(Clone, Debug)]
pub struct Arc {
    /// The path.
    pub path: Path,
    /// Segments on it.
    pub fit: Builder,
}

/// A block with everything that its neighbours do not change.
#[derive(Clone, Debug)]
pub struct Entry {
    /// Index of the block.
    pub index: u64,
    /// Program line.
    pub line: u32,
    /// The kind of path.
    pub kind: BlockKind,
    /// The program needs rest at the start and at the end.
    pub rests: [bool; 2],
    /// Only rotary axes move: path and feed are in rad.
    pub turns_only: bool,
    /// Where it starts, exactly as programmed.
    pub start: AxisVector,
    /// Where it ends, exactly as programmed.
    pub end: AxisVector,
    /// Its path where that is an arc: lines need no more than their ends, and this is large.
    pub arc: Option<Arc>,
    /// Duration of a dwell, s.
    pub dwell_s: f64,
    /// Length, mm.
    pub length_mm: f64,
    /// The programmed feed under the policy's cap, mm/s.
    pub command_mm_per_s: f64,
    /// Highest feed that command, axis speeds and curvature allow, mm/s.
    pub feed_mm_per_s: f64,
    /// What set it.
    pub reason: LimitedBy,
    /// Time constant that acts from the deceleration of this block on, s.
    pub tau_s: f64,
    /// Length that the longer of its two time constants takes at its highest feed, mm.
    pub reach_mm: f64,
    /// Path tolerance, mm.
    pub tolerance_mm: f64,
    /// 1/path acceleration of its ramps, s²/mm; zero where limits are off.
    pub slope_s2_per_mm: f64,
    /// Share of an axis acceleration that a feed of 1 mm/s takes for turning, s²/mm²; zero on lines.
    pub bend: f64,
    /// Curvature, 1/mm.
    pub curvature_per_mm: f64,
    /// Highest feed of a block that speeds up from rest and slows down to rest, mm/s.
    pub triangle_mm_per_s: f64,
    /// Direction at the start and at the end, axis units per mm.
    pub directions: [AxisVector; 2],
}

impl Entry {
    /// What names it in segments.
    pub fn id(&self) -> BlockId {
        BlockId {
            index: self.index,
            line: self.line,
        }
    }

    /// A dwell of no duration.
    pub fn blank() -> Self {
        Self {
            index: 0,
            line: 0,
            kind: BlockKind::Dwell,
            rests: [true; 2],
            turns_only: false,
            start: AxisVector::ZERO,
            end: AxisVector::ZERO,
            arc: None,
            dwell_s: 0.0,
            length_mm: 0.0,
            command_mm_per_s: 0.0,
            feed_mm_per_s: 0.0,
            reason: LimitedBy::Feed,
            tau_s: 0.0,
            reach_mm: 0.0,
            tolerance_mm: 0.0,
            slope_s2_per_mm: 0.0,
            bend: 0.0,
            curvature_per_mm: 0.0,
            triangle_mm_per_s: 0.0,
            directions: [AxisVector::ZERO; 2],
        }
    }

    /// Takes what `block` says by itself; `taus_s` are the time constants of its ramps, on a tick. In place: entries are
    /// large.
    pub fn set(&mut self, block: &Block, rules: &Rules, taus_s: [f64; 2]) {
        self.index = block.index;
        self.line = block.line;
        self.kind = block.kind;
        self.rests = [block.starts_at_rest(), block.ends_at_rest()];
        self.tau_s = taus_s[1];
        self.command_mm_per_s = block.command_feed_mm_per_s();
        let stated = block.path_tolerance_mm;
        self.tolerance_mm = if stated.is_nan() {
            rules.tolerance_mm
        } else {
            stated
        };
        self.start = block.start;
        self.end = block.end;
        self.bend = 0.0;
        self.curvature_per_mm = 0.0;
        self.turns_only = false;
        self.arc = None;
        match block.kind {
            BlockKind::Dwell => {
                self.dwell_s = block.dwell_s;
                self.length_mm = 0.0;
                self.feed_mm_per_s = 0.0;
                return;
            }
            BlockKind::Arc => self.set_arc(block, rules),
            _ => self.set_line(block, rules),
        }
        self.reach_mm = self.feed_mm_per_s * greater(taus_s[0], taus_s[1]);
        self.triangle_mm_per_s = (self.length_mm / self.slope_s2_per_mm).sqrt();
    }

    fn set_line(&mut self, block: &Block, rules: &Rules) {
        self.length_mm = block.length_mm;
        let direction = (block.end - block.start) * (1.0 / block.length_mm);
        self.directions = [direction; 2];
        let moves = |axis: usize| rules.linear >> axis & 1 == 1 && direction[axis] != 0.0;
        self.turns_only = !(0..rules.axes).any(moves);
        self.slope_s2_per_mm = rules.largest(&direction);
        self.set_feed(block, rules, &direction);
    }

    /// Slope and bend of an arc: over its whole circle, whatever part of it is driven. A joint that is a sum of axes sways
    /// with the circle and rises with the helix at once: for the rise it has what turning leaves, `√(0.6² + 0.8²)` being all.
    fn set_arc(&mut self, block: &Block, rules: &Rules) {
        let Some(path) = Path::with_lanes(block, rules.joint_lanes) else {
            return;
        };
        self.length_mm = path.length_mm();
        self.directions = [path.direction(0.0), path.direction(self.length_mm)];
        let turn = path.rad_per_mm();
        let radius_mm = path.radius_mm();
        let plane = block.arc.plane.map(|axis| axis as usize);
        let mut weak = greater(
            rules.per_acceleration[plane[0]],
            rules.per_acceleration[plane[1]],
        );
        let mut rise = self.directions[0];
        rise[plane[0]] = 0.0;
        rise[plane[1]] = 0.0;
        let mut rising = 0.0;
        if let Some(lanes) = rules.joint_lanes {
            lanes.fill(&mut rise);
            for (weights, lane) in lanes.weights().iter().zip(lanes.first()..) {
                let per_acceleration = rules.per_acceleration[lane];
                weak = greater(
                    weak,
                    per_acceleration * weights[plane[0]].hypot(weights[plane[1]]),
                );
                rising = greater(rising, per_acceleration * rise[lane].abs());
            }
        }
        let in_plane = radius_mm * turn * weak / ARC_SHARE + rising / (1.0 - TURN_SHARE);
        self.slope_s2_per_mm = greater(in_plane, rules.largest(&rise));
        self.curvature_per_mm = radius_mm * turn * turn;
        self.bend = self.curvature_per_mm * weak;
        self.set_feed(block, rules, &path.max_direction());
        self.arc = Some(Arc {
            path,
            fit: Builder::new(&path, 0.0),
        });
    }

    /// `most` is the largest share of each axis in the path.
    fn set_feed(&mut self, block: &Block, rules: &Rules, most: &AxisVector) {
        let rapid = block.kind == BlockKind::Rapid;
        let command = block.feed_mm_per_s * rules.feed_ratio;
        let policy = block.feed_cap_mm_per_s;
        let mut feed = lesser(command, policy);
        for (speed, share) in rules.axis_mm_per_s[usize::from(rapid)]
            .0
            .iter()
            .zip(&most.0)
            .take(rules.axes)
        {
            if feed * share.abs() > *speed {
                feed = speed / share.abs();
            }
        }
        let turning = if self.bend > 0.0 {
            (TURN_SHARE / self.bend).sqrt()
        } else {
            f64::INFINITY
        };
        self.reason = match () {
            () if turning < feed => LimitedBy::Curvature,
            () if feed >= command || rapid => LimitedBy::Feed,
            () if feed >= policy => LimitedBy::Policy,
            () => LimitedBy::Velocity,
        };
        self.feed_mm_per_s = lesser(feed, turning);
    }

    /// The least and the greatest position of `axis` on its path, mm.
    pub fn extent_mm(&self, axis: usize) -> [f64; 2] {
        let (start, end) = (self.start[axis], self.end[axis]);
        let [mut low, mut high] = [lesser(start, end), greater(start, end)];
        if let Some(arc) = &self.arc {
            let bend = arc.path.curvature(0.0);
            let size = bend.0.iter().map(|b| b * b).sum::<f64>().sqrt();
            // Along the axis of a helix there is no curvature, and an arc in the plane has some in both of its axes or in one.
            if arc.path.max_curvature()[axis] > 0.0 {
                let radius_mm = arc.path.radius_mm();
                let middle = start + bend[axis] / size * radius_mm;
                low = lesser(low, middle - radius_mm);
                high = greater(high, middle + radius_mm);
            }
        }
        [low, high]
    }

    /// Whether nothing moves.
    pub fn is_dwell(&self) -> bool {
        self.kind == BlockKind::Dwell
    }

    /// Its path; of no use for a dwell.
    pub fn path(&self) -> Path {
        let line = || Path::line(&self.start, &self.end, self.length_mm);
        self.arc.as_ref().map_or_else(line, |arc| arc.path)
    }

    /// Whether rest is needed between this block and `next`: by the program, or because one feed is in mm/s and the other in
    /// rad/s, so that no share of both could be kept of what moves together.
    pub fn rests_before(&self, next: &Self) -> bool {
        self.rests[1] || next.rests[0] || self.turns_only != next.turns_only
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::options::Options;
    use std::sync::OnceLock;
    use tandem_sdk::{JointLanes, Limits, PlannerContext};

    /// X and Y with 1000 mm/s², and a joint that is three quarters of the sum of both, with 400 mm/s².
    fn rules() -> Rules {
        static LANES: OnceLock<JointLanes> = OnceLock::new();
        let weights = AxisVector::from_slice(&[0.75, 0.75]);
        let lanes = LANES.get_or_init(|| JointLanes::new(2, &[weights]).unwrap());
        let limits = [1000.0, 1000.0, 400.0].map(tandem_rig::axis);
        let context = PlannerContext {
            limits: Limits::new(&limits).unwrap(),
            joint_lanes: Some(lanes),
            ..tandem_rig::context(&limits[..2], 0.001)
        };
        Rules::new(&Options::default(), &context)
    }

    /// On a circle the sum sways by the length of its weights: that is what turning and speeding up have least of.
    #[test]
    fn an_arc_has_what_its_weakest_axis_or_joint_has_of_the_whole_circle() {
        let rules = rules();
        let weak = 0.75 * 2f64.sqrt() / (0.999 * 400.0);
        for (radius_mm, feed, expected) in [
            (5.0, 10.0, LimitedBy::Feed),
            (5.0, 100.0, LimitedBy::Curvature),
            (20.0, 100.0, LimitedBy::Curvature),
        ] {
            let from = AxisVector::from_slice(&[radius_mm, 0.0]);
            let block = tandem_rig::arc(&from, [0.0, 0.0], 1.0, feed);
            let mut entry = Entry::blank();
            entry.set(&block, &rules, [0.02; 2]);
            assert!((entry.length_mm - radius_mm).abs() < 1e-9);
            assert!((entry.curvature_per_mm * radius_mm - 1.0).abs() < 1e-9);
            assert!(
                (entry.bend * radius_mm / weak - 1.0).abs() < 1e-9,
                "{}",
                entry.bend
            );
            assert!((entry.slope_s2_per_mm * ARC_SHARE / weak - 1.0).abs() < 1e-9);
            let turning = (TURN_SHARE * radius_mm / weak).sqrt();
            assert!((entry.feed_mm_per_s / feed.min(turning) - 1.0).abs() < 1e-9);
            assert_eq!(entry.reason, expected, "{radius_mm} {feed}");
            // From rest to rest with that acceleration over its length.
            let triangle = (radius_mm / entry.slope_s2_per_mm).sqrt();
            assert!((entry.triangle_mm_per_s / triangle - 1.0).abs() < 1e-12);
            assert!((entry.reach_mm - 0.02 * entry.feed_mm_per_s).abs() < 1e-12);
        }
    }
}
