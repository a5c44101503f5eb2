//! M48 to M53: what the operator and the process may change.

use tandem_sdk::EventKind;

use super::{Action, Group, Word};
use crate::line::Line;
use crate::line_error::Checked;

pub(super) const WORDS: &[Word] = &[
    Word::new(
        "M48",
        Group::Override,
        "",
        "feed and spindle overrides on",
        Action::Act(both_on),
        "M48",
    ),
    Word::new(
        "M49",
        Group::Override,
        "",
        "feed and spindle overrides off",
        Action::Act(both_off),
        "M49",
    ),
    Word::new(
        "M50",
        Group::Override,
        "P",
        "feed override on (P1) or off (P0)",
        by_p(FEED),
        "M50 P0",
    ),
    Word::new(
        "M51",
        Group::Override,
        "P$",
        "spindle override on (P1) or off (P0)",
        by_p(SPINDLE),
        "M51 P0",
    ),
    Word::new(
        "M52",
        Group::Override,
        "P",
        "adaptive feed on (P1) or off (P0)",
        by_p(ADAPTIVE),
        "M52 P1",
    ),
    Word::new(
        "M53",
        Group::Override,
        "P",
        "feed hold permitted (P1) or not (P0)",
        by_p(HOLD),
        "M53 P0",
    ),
];

pub(super) const FEED: usize = 0;
pub(super) const SPINDLE: usize = 1;
const ADAPTIVE: usize = 2;
const HOLD: usize = 3;
/// The events of the four permissions.
const EVENTS: [EventKind; 4] = [
    EventKind::FeedOverride,
    EventKind::SpindleOverride,
    EventKind::AdaptiveFeed,
    EventKind::FeedHold,
];

/// What is permitted: feed override, spindle override, adaptive feed, feed hold.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Permits([bool; 4]);

impl Default for Permits {
    fn default() -> Self {
        Self([true, true, false, true])
    }
}

impl Permits {
    pub fn feed_override(self) -> bool {
        self.0[FEED]
    }

    pub fn adaptive_feed(self) -> bool {
        self.0[ADAPTIVE]
    }

    pub fn feed_hold(self) -> bool {
        self.0[HOLD]
    }

    pub fn spindle_override(self) -> bool {
        self.0[SPINDLE]
    }
}

/// The action of a word that P switches; without P it is on.
const fn by_p(which: usize) -> Action {
    match which {
        FEED => Action::Act(|line| switch_by_p(line, FEED)),
        SPINDLE => Action::Act(|line| switch_by_p(line, SPINDLE)),
        ADAPTIVE => Action::Act(|line| switch_by_p(line, ADAPTIVE)),
        _ => Action::Act(|line| switch_by_p(line, HOLD)),
    }
}

fn switch_by_p(line: &mut Line, which: usize) -> Checked<()> {
    let on = line.words.integer(b'P', 0..=1)?.unwrap_or(1) == 1;
    switch(line, which, on);
    Ok(())
}

fn both_on(line: &mut Line) -> Checked<()> {
    switch(line, FEED, true);
    switch(line, SPINDLE, true);
    Ok(())
}

fn both_off(line: &mut Line) -> Checked<()> {
    switch(line, FEED, false);
    switch(line, SPINDLE, false);
    Ok(())
}

/// What is permitted is what was so before.
pub(super) fn put_back(line: &mut Line, permits: Permits) {
    for (which, permitted) in permits.0.into_iter().enumerate() {
        switch(line, which, permitted);
    }
}

pub(super) fn switch(line: &mut Line, which: usize, on: bool) {
    if line.state.permits.0[which] != on {
        line.state.permits.0[which] = on;
        line.event(EVENTS[which], 0, f64::from(u8::from(on)));
    }
}

#[cfg(test)]
mod tests {
    use crate::testing::assert_items;

    #[test]
    fn permissions_are_events_where_they_change() {
        assert_items(
            "M49\nM50\nM51 P0\nM52\nM53 P0\nM48",
            &[
                "1: FeedOverride 0 0 before 0",
                "1: SpindleOverride 0 0 before 0",
                "2: FeedOverride 0 1 before 0",
                "4: AdaptiveFeed 0 1 before 0",
                "5: FeedHold 0 0 before 0",
                "6: SpindleOverride 0 1 before 0",
                "End",
            ],
        );
    }
}
