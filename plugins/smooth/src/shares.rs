//! What a window takes of the limits, and what is taken back where it does not pass.

use crate::verify::Checked;

/// Shares of the limits that the solution may take: the rest covers what lies between the places asked. Half or twice of that rest
/// changes the times of the programs of docs/smooth-planner.md by 1 % at most, to either side.
const JERK_SHARE: f64 = 0.995;
const ACCELERATION_SHARE: f64 = 0.985;
const FEED_SHARE: f64 = 0.9995;

/// How much more of the limits than elsewhere the start in motion may take, as a share.
#[derive(Clone, Copy, Debug)]
pub struct Room {
    pub acceleration: f64,
    pub jerk: f64,
}

/// At rest the rate is free.
pub const NO_ROOM: Room = Room {
    acceleration: 0.0,
    jerk: 0.0,
};
/// What the window before left of the limits, but for a tenth: it was planned with the shares above. With half of it the same programs
/// take 0.04 % longer; twice as much is more than the check allows, and takes 13 % more intervals.
pub const LEFT: Room = Room {
    acceleration: 0.0132,
    jerk: 0.006,
};
/// Where nothing but the timing is taken from a round. Without it no rate may be found, and the timing is then whatever the solver was
/// at when it gave up: 2 % more intervals, and 0.08 % more time. With half or twice as much it is 0.04 % more.
pub const WIDE: Room = Room {
    acceleration: 0.2,
    jerk: 0.2,
};

/// Shares of two limits that the next window takes at first. What one window had to take back between two places asked, the next one
/// mostly has to: where it does so at once, it is not refused first. On the paths of
/// [`WINDOW_RAMPS`](crate::tuning::WINDOW_RAMPS) and fourteen machines whose acceleration takes 10 to 100 ms that saves half of the
/// repairs and an eighth of the intervals; the times are the same to 0.01 %.
#[derive(Clone, Copy, Debug)]
pub struct FirstTry {
    acceleration: f64,
    feed: f64,
}

impl FirstTry {
    pub const NOMINAL: Self = Self {
        acceleration: ACCELERATION_SHARE,
        feed: FEED_SHARE,
    };
    /// What is carried over at least: a single place of one window does not slow those behind it.
    const MIN: Self = Self {
        acceleration: 0.96,
        feed: 0.997,
    };
    /// Part of what is lacking that comes back with each window that passes at first.
    const BACK: f64 = 0.25;

    /// What a window takes of the limits at first, with this share of its boxes.
    pub fn shares(self, boxes: f64) -> Shares {
        Shares {
            jerk: JERK_SHARE,
            acceleration: self.acceleration,
            boxes,
            margin: 0.0,
            feed: self.feed,
        }
    }

    /// After a window has passed with `shares`, at its first try or after repairs.
    pub fn after(shares: &Shares, repaired: bool) -> Self {
        if repaired {
            return Self {
                acceleration: shares.acceleration.max(Self::MIN.acceleration),
                feed: shares.feed.max(Self::MIN.feed),
            };
        }
        let back = |share: f64, nominal: f64| share + Self::BACK * (nominal - share);
        Self {
            acceleration: back(shares.acceleration, ACCELERATION_SHARE),
            feed: back(shares.feed, FEED_SHARE),
        }
    }
}

/// What a round takes back.
#[derive(Clone, Copy, Debug)]
pub struct Shares {
    pub jerk: f64,
    pub acceleration: f64,
    pub boxes: f64,
    /// How far inside of the ends of the travel the motion is to stay, in lane units.
    pub margin: f64,
    pub feed: f64,
}

/// Share of the tolerance that may lie between two samples before a refused window is to turn more slowly.
const BULGE: f64 = 0.25;
/// Least share of the acceleration that one repair leaves it to turn with.
const SLOWER: f64 = 0.1;

/// The share of the boxes that leaves room for what lies between samples: that does not become less with them.
fn narrower(boxes: f64, checked: &Checked) -> f64 {
    if checked.deviation <= 1.0 {
        return boxes;
    }
    let bulge = checked.bulge.min(0.5);
    boxes * ((0.97 - bulge) / (checked.deviation - bulge)).clamp(0.7, 0.99)
}

/// Shares for the next round: what was exceeded, in proportion.
pub fn take_back(shares: Shares, checked: &Checked) -> Shares {
    let less = |share: f64, ratio: f64, aim: f64| {
        if ratio > 1.0 {
            share * (aim / ratio).max(0.7)
        } else {
            share
        }
    };
    let acceleration = less(shares.acceleration, checked.acceleration, 0.998);
    // Where the motion leaves the path between two samples, it has to turn more slowly than it does.
    let acceleration = if checked.deviation > 1.0 && checked.bulge > BULGE {
        acceleration.min(checked.acceleration) * (BULGE / checked.bulge).max(SLOWER)
    } else {
        acceleration
    };
    Shares {
        jerk: less(shares.jerk, checked.jerk, 0.998),
        acceleration,
        margin: shares.margin + 2.0 * checked.travel.max(0.0),
        boxes: narrower(shares.boxes, checked),
        feed: less(shares.feed, checked.speed, 0.9995),
    }
}
