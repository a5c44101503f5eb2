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
/// this share of a ramp at most, and the rest of it can stop the machine. With half of it the raster of the examples takes 0.5 % longer;
/// with all of the ramp it would take 0.04 % less, with nothing left to stop with.
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::options::{CornerControl, Options};
    use tandem_sdk::AxisVector;

    /// Without corner control overlaps are as long as the time constant.
    fn rules() -> Rules {
        let options = Options {
            corner_control: CornerControl::Off,
            ..Options::default()
        };
        let axis = tandem_rig::axis(1000.0);
        Rules::new(&options, &tandem_rig::context(&[axis; 2], 0.001))
    }

    /// 10 mm along `direction` at a path acceleration of 1000 mm/s².
    fn block(direction: [f64; 2], bend: f64) -> Entry {
        Entry {
            length_mm: 10.0,
            slope_s2_per_mm: 1e-3,
            bend,
            directions: [AxisVector::from_slice(&direction); 2],
            ..Entry::blank()
        }
    }

    fn corner(turn_s2_per_mm: f64) -> Corner {
        Corner {
            turn_s2_per_mm,
            tau_s: 0.02,
            longest_s: 0.02,
            span_mm: 10.0,
            ..Corner::default()
        }
    }

    /// A straight block and one that bends, with these feeds.
    fn joined(corner: &Corner, bend: f64, feeds: [f64; 2], mode: Mode) -> Join {
        let (straight, curved) = (block([1.0, 0.0], 0.0), block([1.0, 0.0], bend));
        Join::new(&rules(), corner, [&straight, &curved], feeds, mode)
    }

    /// A stop in full overlap has what turning with the faster feed and arcs leave, at least what is left of their share.
    #[test]
    fn a_stop_in_full_overlap_has_what_turning_leaves() {
        for (turn, bend, feeds, left) in [
            // 50 mm/s in 20 ms turn by half of the acceleration.
            (2e-4, 0.0, [50.0, 30.0], 0.5),
            (2e-4, 0.0, [30.0, 50.0], 0.5),
            (1e-4, 1e-4, [50.0, 50.0], 1.0 - 0.25 - ARC_OVERLAP * 0.25),
            (2e-4, 1e-4, [50.0, 50.0], MIN_STOP),
        ] {
            let join = joined(&corner(turn), bend, feeds, Mode::Flow);
            assert_eq!([join.down_s, join.up_s, join.overlap_s], [0.02; 3]);
            assert!((join.stop_mm_per_s2 - left * 1000.0).abs() < 1e-6, "{left}");
        }
    }

    /// A stop in a late start has what turning leaves; where that is too little, the half of a ramp after a short overlap, and after
    /// a long one what is left of the share of turning.
    #[test]
    fn a_stop_in_a_late_start_has_what_turning_or_the_ramp_leaves() {
        // Ramps of 40 ms; the time constant allows 20 ms of overlap, half of them.
        let feeds = [40.0, 40.0];
        for (turn, bend, left) in [
            (3e-4, 0.0, 0.7),
            (7.5e-4, 0.0, HALF),
            (9e-4, 0.0, HALF),
            // 20 ms at 1000 mm/s² are 20 mm/s: the arc takes 0.24 of the acceleration.
            (2e-4, 4e-4, 1.0 - 0.2 - ARC_OVERLAP * 4e-4 * 400.0),
        ] {
            let join = joined(&corner(turn), bend, feeds, Mode::Late);
            assert_eq!([join.down_s, join.up_s], [0.04; 2]);
            assert!((join.overlap_s - 0.02).abs() < 1e-12, "{}", join.overlap_s);
            assert!(
                (join.stop_mm_per_s2 - left * 1000.0).abs() < 1e-6,
                "{turn} {bend}"
            );
        }
        // An overlap of 30 ms beside 40 ms leaves less than half.
        let long = Corner {
            longest_s: 0.03,
            ..corner(7.5e-4)
        };
        let join = joined(&long, 0.0, feeds, Mode::Late);
        assert!((join.overlap_s - 0.03).abs() < 1e-12, "{}", join.overlap_s);
        assert!((join.stop_mm_per_s2 - 250.0).abs() < 1e-6);
    }

    /// What a late start may overlap is bounded by the tolerance, `o² ≤ h·span`, and by what the axes have when both ramps
    /// meet.
    #[test]
    fn a_late_start_overlaps_as_tolerance_and_axes_allow() {
        let overlap_s = |corner: &Corner, after: &Entry| {
            late_overlap_s(&rules(), corner, [&block([1.0, 0.0], 0.0), after], 0.04)
        };
        let straight = block([1.0, 0.0], 0.0);
        let narrow = Corner {
            span_mm: 0.1,
            ..corner(3e-4)
        };
        assert!((overlap_s(&narrow, &straight) - 0.01).abs() < 1e-12);
        let open = Corner {
            longest_s: f64::INFINITY,
            ..corner(3e-4)
        };
        assert!((overlap_s(&open, &straight) - 0.04).abs() < 1e-12);
        // Turning takes more than its share: half of the ramp.
        let turning = Corner {
            turn_s2_per_mm: 9e-4,
            ..open
        };
        assert!((overlap_s(&turning, &straight) - 0.02).abs() < 1e-12);
        // Back along its way an axis needs twice what it has.
        assert_eq!(overlap_s(&open, &block([-1.0, 0.0], 0.0)), 0.0);
        // 1.5 · bend · (o/slope)² of an arc comes to half of the share that turning leaves.
        let bend = 0.5 / (ARC_OVERLAP * 400.0);
        let found_s = overlap_s(&open, &block([1.0, 0.0], bend));
        assert!((found_s - 0.02).abs() < 1e-9, "{found_s}");
    }

    /// The shortest overlap takes the change of feed and turning together, or turning with its share alone.
    #[test]
    fn the_shortest_overlap_is_what_the_axes_need() {
        let spare = 0.8;
        let corner = Corner {
            spare,
            ..corner(4e-4)
        };
        let straight = block([1.0, 0.0], 0.0);
        for feeds in [[50.0, 20.0], [20.0, 50.0]] {
            let found_s = needed_s(&corner, [&straight; 2], feeds);
            assert!((found_s - (20.0 * 4e-4 + 30.0 * 1e-3) / spare).abs() < 1e-12);
        }
        let found_s = needed_s(&corner, [&straight; 2], [50.0, 49.0]);
        assert!((found_s - 50.0 * 4e-4 / (TURN_SHARE - 0.2)).abs() < 1e-12);
    }
}
