//! What the planner knows of one block by itself.

use tandem_motion::Path;
use tandem_sdk::{AxisVector, Block, BlockKind, LimitedBy};

use crate::rules::{ARC_SHARE, Rules, TURN_SHARE, greater, largest, lesser};

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
    /// Its path; `None` for a dwell.
    pub path: Option<Path>,
    /// Place and duration, s, of a dwell.
    pub dwell: (AxisVector, f64),
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
    /// A dwell of no duration.
    pub fn blank() -> Self {
        Self {
            index: 0,
            line: 0,
            kind: BlockKind::Dwell,
            rests: [true; 2],
            path: None,
            dwell: (AxisVector::ZERO, 0.0),
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
        (self.index, self.line, self.kind) = (block.index, block.line, block.kind);
        self.rests = [block.starts_at_rest(), block.ends_at_rest()];
        self.tau_s = taus_s[1];
        self.command_mm_per_s = block.command_feed_mm_per_s();
        let stated = block.path_tolerance_mm;
        self.tolerance_mm = if stated.is_nan() { rules.tolerance_mm } else { stated };
        self.path = Path::new(block);
        let Some(path) = &self.path else {
            (self.dwell, self.length_mm, self.feed_mm_per_s) = ((block.end, block.dwell_s), 0.0, 0.0);
            return;
        };
        self.length_mm = path.length_mm();
        self.directions = [path.direction(0.0), path.direction(self.length_mm)];
        (self.bend, self.curvature_per_mm) = (0.0, 0.0);
        if path.is_straight() {
            self.slope_s2_per_mm = largest(&self.directions[0], &rules.per_acceleration);
        } else {
            self.set_arc(block, rules);
        }
        self.set_feed(block, rules);
        self.reach_mm = self.feed_mm_per_s * greater(taus_s[0], taus_s[1]);
        self.triangle_mm_per_s = (self.length_mm / self.slope_s2_per_mm).sqrt();
    }

    /// Slope and bend of an arc: over its whole circle, whatever part of it is driven.
    fn set_arc(&mut self, block: &Block, rules: &Rules) {
        let Some(path) = &self.path else { return };
        let (turn, radius_mm) = (path.rad_per_mm(), path.radius_mm());
        let plane = block.arc.plane.map(|axis| axis as usize);
        let weak = greater(rules.per_acceleration[plane[0]], rules.per_acceleration[plane[1]]);
        let mut rise = self.directions[0];
        (rise[plane[0]], rise[plane[1]]) = (0.0, 0.0);
        let in_plane = radius_mm * turn * weak / ARC_SHARE;
        self.slope_s2_per_mm = greater(in_plane, largest(&rise, &rules.per_acceleration));
        self.curvature_per_mm = radius_mm * turn * turn;
        self.bend = self.curvature_per_mm * weak;
    }

    fn set_feed(&mut self, block: &Block, rules: &Rules) {
        let Some(path) = &self.path else { return };
        let rapid = block.kind == BlockKind::Rapid;
        let (command, policy) = (block.feed_mm_per_s * rules.feed_ratio, block.feed_cap_mm_per_s);
        let most = if path.is_straight() { self.directions[0] } else { path.max_direction() };
        let mut feed = lesser(command, policy);
        for (speed, share) in rules.axis_mm_per_s[usize::from(rapid)].0.iter().zip(&most.0) {
            if feed * share.abs() > *speed {
                feed = speed / share.abs();
            }
        }
        let turning = if self.bend > 0.0 { (TURN_SHARE / self.bend).sqrt() } else { f64::INFINITY };
        self.reason = match () {
            () if turning < feed => LimitedBy::Curvature,
            () if feed >= command || rapid => LimitedBy::Feed,
            () if feed >= policy => LimitedBy::Policy,
            () => LimitedBy::Velocity,
        };
        self.feed_mm_per_s = lesser(feed, turning);
    }

    /// Whether the program needs rest between this block and `next`.
    pub fn rests_before(&self, next: &Self) -> bool {
        self.rests[1] || next.rests[0]
    }
}
