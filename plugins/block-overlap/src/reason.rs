//! What held a block's feed down.

use tandem_sdk::LimitedBy;

use crate::buffer::Taken;
use crate::entry::Entry;
use crate::join::Mode;
use crate::rules::{Rules, lesser};

/// Relative difference of feeds that are the same.
const SAME: f64 = 1e-9;

/// What held the feed of `entry` down; where nothing did, what made `next` start late.
pub fn limited_by(rules: &Rules, entry: &Entry, next: &Entry, taken: &Taken) -> LimitedBy {
    let feed = taken.feed_mm_per_s;
    let corner = &taken.corner;
    if feed >= entry.feed_mm_per_s * (1.0 - SAME) {
        return match taken.mode {
            Mode::Late => late_by(entry, next, taken),
            Mode::Rest if corner.tight => LimitedBy::Tolerance,
            _ => entry.reason,
        };
    }
    let at_most = |limit: f64| feed >= limit * (1.0 - SAME);
    let slowed = 2.0 * entry.length_mm / (taken.up_s + taken.join.down_s);
    let rounded_s = entry.length_mm / feed - entry.length_mm / entry.feed_mm_per_s;
    match () {
        () if taken.mode == Mode::Flow && at_most(corner.cap_mm_per_s) => {
            let room_mm = lesser(
                lesser(entry.length_mm, corner.room_mm),
                corner.cap_mm_per_s * corner.longest_s,
            );
            if room_mm < corner.span_mm {
                LimitedBy::Junction
            } else {
                LimitedBy::Tolerance
            }
        }
        () if at_most(entry.triangle_mm_per_s) => LimitedBy::Acceleration,
        () if rules.grid && at_most(slowed) && taken.mode != Mode::Late => LimitedBy::TimeConstant,
        () if rules.grid && rounded_s <= rules.tick_s => entry.reason,
        () if taken.mode == Mode::Flow && taken.next_feed_mm_per_s < feed => {
            LimitedBy::Acceleration
        }
        () => LimitedBy::Junction,
    }
}

/// Overlaps that differ by less, relatively, are the same.
const SAME_OVERLAP: f64 = 1e-6;

/// What bounds the overlap of a late start: the tolerance, the time constant, the ramps themselves where only the feeds
/// differ, or turning.
fn late_by(entry: &Entry, next: &Entry, taken: &Taken) -> LimitedBy {
    let join = &taken.join;
    let corner = &taken.corner;
    let reaches = |bound_s: f64| join.overlap_s >= bound_s * (1.0 - SAME_OVERLAP);
    let slope = lesser(entry.slope_s2_per_mm, next.slope_s2_per_mm);
    match () {
        () if reaches((corner.span_mm * slope).sqrt()) => LimitedBy::Tolerance,
        () if reaches(corner.longest_s) => LimitedBy::TimeConstant,
        () if reaches(lesser(
            join.down_s,
            taken.next_feed_mm_per_s * next.slope_s2_per_mm,
        )) =>
        {
            LimitedBy::Acceleration
        }
        () => LimitedBy::Junction,
    }
}
