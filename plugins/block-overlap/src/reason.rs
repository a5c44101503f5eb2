//! What held a block's feed down.

use tandem_sdk::LimitedBy;

use crate::buffer::Taken;
use crate::entry::Entry;
use crate::join::Mode;
use crate::rules::{Rules, lesser};

/// Relative difference of feeds that are the same.
const SAME: f64 = 1e-9;

/// What held the feed of `entry` down; where nothing did, what made the next block start late.
pub fn limited_by(rules: &Rules, entry: &Entry, taken: &Taken) -> LimitedBy {
    let (feed, corner) = (taken.feed_mm_per_s, &taken.corner);
    if feed >= entry.feed_mm_per_s * (1.0 - SAME) {
        let tolerated = taken.mode == Mode::Late && corner.span_mm < entry.length_mm;
        return if tolerated { LimitedBy::Tolerance } else { entry.reason };
    }
    let at_most = |limit: f64| feed >= limit * (1.0 - SAME);
    let slowed = 2.0 * entry.length_mm / (taken.up_s + taken.join.down_s);
    let rounded_s = entry.length_mm / feed - entry.length_mm / entry.feed_mm_per_s;
    match () {
        () if taken.mode == Mode::Flow && at_most(corner.cap_mm_per_s) => {
            let short = lesser(entry.length_mm, corner.room_mm) < corner.span_mm;
            if short { LimitedBy::Junction } else { LimitedBy::Tolerance }
        }
        () if rules.grid && at_most(slowed) && taken.mode != Mode::Late => LimitedBy::TimeConstant,
        () if rules.grid && rounded_s <= rules.tick_s => entry.reason,
        () if at_most(entry.triangle_mm_per_s) => LimitedBy::Acceleration,
        () if taken.mode == Mode::Flow && taken.next_feed_mm_per_s < feed => LimitedBy::Acceleration,
        () => LimitedBy::Junction,
    }
}
