//! How two blocks meet once their feeds are known: ramps and overlap.

use crate::choose::ROUNDING;
use crate::corner::Corner;
use crate::entry::Entry;
use crate::rules::{ARC_OVERLAP, Rules, TURN_SHARE, greater, lesser};

/// How a junction is passed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Mode {
    /// In full overlap: the next block starts when this one starts to slow down.
    Flow,
    /// The next block starts later, while this one slows down, or when it has come to rest.
    Late,
    /// At rest, for the program's sake or because nothing else is known yet.
    #[default]
    Rest,
}

/// A junction as it is driven.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Join {
    /// How long the block before slows down, s.
    pub down_s: f64,
    /// How long the block after speeds up, s.
    pub up_s: f64,
    /// How long the two overlap, s; zero for a rest.
    pub overlap_s: f64,
    /// Path deceleration that is left while they do, mm/s².
    pub stop_mm_per_s2: f64,
}

/// Overlaps shorter than this share of a fine period are none.
const NO_OVERLAP_TICKS: f64 = 1e-3;

/// Where turning takes more than its share there is nothing to brake with while the blocks overlap: then they overlap for
/// this share of a ramp at most, and the rest of it can stop the machine.
const HALF: f64 = 0.5;

impl Join {
    /// The junction `corner` between two blocks and their feeds.
    pub fn new(
        rules: &Rules,
        corner: &Corner,
        blocks: [&Entry; 2],
        feeds: [f64; 2],
        mode: Mode,
    ) -> Self {
        match mode {
            Mode::Flow => Self::flow(rules, corner, blocks, feeds),
            Mode::Late => Self::late(rules, corner, blocks, feeds),
            Mode::Rest => Self::rest(rules, corner.tau_s, blocks, feeds),
        }
    }

    /// At rest: each ramp as long as the time constant asks, or longer where the axes do.
    fn rest(rules: &Rules, tau_s: f64, blocks: [&Entry; 2], feeds: [f64; 2]) -> Self {
        let [down_s, up_s] = [0, 1].map(|i| rest_ramp_s(rules, blocks[i], feeds[i], tau_s));
        Self {
            down_s,
            up_s,
            overlap_s: 0.0,
            stop_mm_per_s2: f64::INFINITY,
        }
    }

    fn flow(rules: &Rules, corner: &Corner, blocks: [&Entry; 2], feeds: [f64; 2]) -> Self {
        let fastest = greater(feeds[0], feeds[1]);
        let tau_s = if rules.shorten || corner.longest_s.is_infinite() {
            let short = |i: usize| blocks[i].length_mm / feeds[i];
            let most = lesser(corner.span_mm / fastest, lesser(short(0), short(1)));
            let stretched = corner.longest_s.is_infinite();
            let needed_s = if stretched {
                needed_s(corner, blocks, feeds)
            } else {
                0.0
            };
            lesser(most, greater(corner.tau_s, needed_s))
        } else {
            corner.tau_s
        };
        let slope = greater(blocks[0].slope_s2_per_mm, blocks[1].slope_s2_per_mm);
        let stop = if slope > 0.0 {
            let bent = ARC_OVERLAP * greater(blocks[0].bend, blocks[1].bend) * fastest * fastest;
            greater(
                1.0 - fastest * corner.turn_s2_per_mm / tau_s - bent,
                MIN_STOP,
            ) / slope
        } else {
            rules.weakest_mm_per_s2
        };
        Self {
            down_s: tau_s,
            up_s: tau_s,
            overlap_s: tau_s,
            stop_mm_per_s2: stop,
        }
    }

    /// Ramps at the acceleration of the axes; in the overlap the remaining and the growing speed are in proportion to it.
    fn late(rules: &Rules, corner: &Corner, blocks: [&Entry; 2], feeds: [f64; 2]) -> Self {
        let slopes = blocks.map(|block| block.slope_s2_per_mm);
        let [down_s, up_s] = [feeds[0] * slopes[0], feeds[1] * slopes[1]];
        let ramp_s = lesser(down_s, up_s);
        let overlap_s = late_overlap_s(rules, corner, blocks, ramp_s);
        let slope = greater(slopes[0], slopes[1]);
        if overlap_s < NO_OVERLAP_TICKS * rules.tick_s {
            return Self {
                down_s,
                up_s,
                overlap_s: 0.0,
                stop_mm_per_s2: f64::INFINITY,
            };
        }
        let turn = corner.turn_s2_per_mm / lesser(slopes[0], slopes[1]);
        let bent = bent_share(blocks, overlap_s);
        // A short overlap leaves half, a long one what turning leaves.
        let turning = if turn + bent <= TURN_SHARE {
            1.0 - turn - bent
        } else {
            0.0
        };
        let halved = if overlap_s <= HALF * ramp_s {
            HALF
        } else {
            MIN_STOP
        };
        let left = greater(turning, halved);
        Self {
            down_s,
            up_s,
            overlap_s,
            stop_mm_per_s2: left / slope,
        }
    }
}

/// Least share of the acceleration that [`TURN_SHARE`] leaves, to rounding.
const MIN_STOP: f64 = 0.19;

/// The shortest overlap that the axes allow at these feeds, s.
fn needed_s(corner: &Corner, blocks: [&Entry; 2], feeds: [f64; 2]) -> f64 {
    let fast = usize::from(feeds[1] > feeds[0]);
    let change_s = (feeds[fast] - feeds[1 - fast]) * blocks[fast].slope_s2_per_mm;
    let turn = corner.turn_s2_per_mm;
    let bent = 1.0 - corner.spare;
    greater(
        (feeds[1 - fast] * turn + change_s) / corner.spare,
        feeds[fast] * turn / greater(TURN_SHARE - bent, 1e-3),
    )
}

/// How long the ramp of a block is that ends or starts at rest, s.
pub fn rest_ramp_s(rules: &Rules, block: &Entry, feed_mm_per_s: f64, tau_s: f64) -> f64 {
    let wanted_s = if rules.shorten {
        lesser(tau_s, block.length_mm / feed_mm_per_s)
    } else {
        tau_s
    };
    greater(wanted_s, feed_mm_per_s * block.slope_s2_per_mm)
}

/// How long two blocks may overlap where the next one starts late, s, while the shorter of both ramps takes `ramp_s`.
///
/// With the accelerations 1/h of the ramps the speeds at the edges of the overlap o are o/h, so the corner error is that
/// of a full overlap with τ = o and F = o/h: o² ≤ h·span.
pub fn late_overlap_s(rules: &Rules, corner: &Corner, blocks: [&Entry; 2], ramp_s: f64) -> f64 {
    let slope = lesser(blocks[0].slope_s2_per_mm, blocks[1].slope_s2_per_mm);
    let tolerated_s = (corner.span_mm * slope).sqrt();
    let longest_s = lesser(tolerated_s, corner.longest_s);
    let turn = corner.turn_s2_per_mm / slope;
    // Arcs ask for more the longer the overlap: bent · o².
    let bent = bent_share(blocks, 1.0);
    let bounded_s = |ramp_s: f64, spare: f64| {
        let max_s = lesser(longest_s, ramp_s);
        if bent * max_s * max_s > spare {
            (spare / bent).sqrt()
        } else {
            max_s
        }
    };
    // A right angle between two axes takes all of both, to rounding.
    let spare = 1.0 + ROUNDING - turn_share(rules, blocks);
    if spare <= 0.0 {
        return 0.0;
    }
    let half_s = bounded_s(HALF * ramp_s, spare);
    if turn < TURN_SHARE {
        greater(half_s, bounded_s(ramp_s, lesser(spare, TURN_SHARE - turn)))
    } else {
        half_s
    }
}

/// What the axis that turns most needs of its acceleration while one ramp falls and the other rises, at most.
fn turn_share(rules: &Rules, blocks: [&Entry; 2]) -> f64 {
    let ends = [blocks[0].directions[1], blocks[1].directions[0]];
    let [falling, rising] = [0, 1].map(|i| ends[i] * (1.0 / blocks[i].slope_s2_per_mm));
    rules.largest(&(rising - falling))
}

fn bent_share(blocks: [&Entry; 2], overlap_s: f64) -> f64 {
    let one = |block: &Entry| block.bend * (overlap_s / block.slope_s2_per_mm).powi(2);
    ARC_OVERLAP * (one(blocks[0]) + one(blocks[1]))
}
