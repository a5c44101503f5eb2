//! The constants that shape how the rate of program time changes: what each is for and its unit, and where another value was tried,
//! what was seen with it. A share is of the limit that it is named after, without unit.

/// Order 2: share of the acceleration limit that is aimed at; the rest covers the curvature of the plan within a period.
pub const ORDER2_LIMIT_SHARE: f64 = 0.999;

/// Order 2: share of the acceleration limit that slowing down for a feed ahead counts on: a period that turns from one segment
/// to the next leaves less of both.
pub const FEEDS_AHEAD_LIMIT_SHARE: f64 = 0.98;

/// Order 2: longest piece of the plan in which slowing down for a feed ahead is laid out, as a share of its distance from here; one
/// period at least.
pub const FEEDS_AHEAD_PIECE_SHARE: f64 = 0.05;

/// Order 2: share by which the path speed may change in such a piece where it is beyond the feed.
pub const FEEDS_AHEAD_SPEED_SHARE: f64 = 0.1;

/// Order 2: shortest of these pieces, as a share of the program time that passes in a period at the ratio asked for.
pub const FEEDS_AHEAD_MIN_PERIODS: f64 = 0.125;

/// Order 2: the ratio below which they get no shorter, without unit: at a ratio of nothing they get on too.
pub const FEEDS_AHEAD_MIN_RATIO: f64 = 1e-3;

/// Order 3: share of the limits of jerk and acceleration that approaches aim at; the rest covers what changes within a period.
pub const ORDER3_LIMIT_SHARE: f64 = 0.995;

/// Order 3: share of the acceleration limit that is used at the points of a period: between them it may be higher.
pub const ACCELERATION_SHARE: f64 = 0.998;

/// Order 3: share of the jerk limit that is used at the points of a period, for the same reason. With half of it half of the limit is
/// left unused and lowering a rate to a feed takes 1.38 times as long as it must; with twice as much the limit is driven twice over
/// (the tests of `keep_limits.rs` and `way_below.rs`).
pub const JERK_SHARE: f64 = 0.997;

/// Order 3: by which share of the limit jerk goes beyond it where it must: the first that leaves a rate is taken.
pub const EXCESSES: [f64; 8] = [0.01, 0.03, 0.1, 0.2, 0.4, 0.8, 1.6, 3.2];

/// Order 3: how many times as long as the path by its speed an axis must need to decide how a stop begins. On a line both need
/// the same, and the law of the path, which knows no single axis, comes in to rest without chatter.
pub const CLEARLY_LONGER: f64 = 1.2;

/// Order 3: below this share of what one period can change, a rate is where it was to go.
pub const SNAP_SHARE: f64 = 1e-3;

/// Order 3: time in which the rate must have become constant, in units of the longest time in which an axis changes its
/// acceleration from none to its limit.
pub const RECOVERY_RAMPS: f64 = 3.2;

/// Order 3: least and most fine periods in which the rate must have become constant, whatever the limits. Where an axis reaches its
/// acceleration within a few periods, a change of the rate in small steps still needs some; and the work of a period is bounded.
pub const RECOVERY_PERIODS: [f64; 2] = [16.0, 640.0];

/// Order 3: for how long a way on which a feed is kept is tried out, in units of the longest time in which an axis changes its
/// acceleration from none to its limit, beside the longest time in which one stops; and the least and most fine periods of it.
pub const FEED_WAY_RAMPS: f64 = 6.0;
pub const FEED_WAY_PERIODS: [f64; 2] = [64.0, 2560.0];

/// Order 3: fine periods of a way that are tried one by one. A step behind them lasts for as many periods as this many go into
/// what has passed of the way.
pub const FEED_WAY_SINGLE_PERIODS: u32 = 48;

/// Order 3: share of the limits of jerk and acceleration that such longer steps count on: they are looked at nowhere between
/// their points. With half of it lowering the rate to a feed takes more than 1.3 times as long as it must (the tests of
/// `way_below.rs`).
pub const FEED_WAY_LIMIT_SHARE: f64 = 0.95;

/// Order 3: steps on such ways that are tried in a fine period, all together: the work of a period is bounded.
pub const FEED_WAY_STEPS: u32 = 500;

/// Order 3: share of the rate at which the plan keeps the feed everywhere that such a way is aimed at: it ends between the two.
pub const FEED_WAY_LANDING_SHARE: f64 = 0.9;

/// Order 3: share of the jerk that an approach counts on where the plan turns or changes its speed ahead.
pub const APPROACH_JERK_SHARE: f64 = 0.8;

/// Order 3: the same where the plan goes straight on at constant speed, which takes nothing of the jerk. The rest is for the law of
/// the approach, which comes in by whole periods.
pub const STRAIGHT_ON_JERK_SHARE: f64 = 0.97;

/// Order 3: how many times as much σ̈ may be where an approach ends as where it begins. It begins in small steps where next to nothing
/// moves; its end is not put off for that.
pub const APPROACH_END_FACTOR: f64 = 4.0;

/// Order 3: most that σ̈ may be, as a change of the change of σ in a period, without unit: σ changes in small steps also where
/// next to nothing moves and the limits would allow more. With half and with twice as much no test of this crate had another result.
pub const MAX_RATE_CHANGE: f64 = 0.02;

/// Order 3: how many times as large the steps may be where the queue runs dry: in steps of the size before a stop takes 14 periods,
/// and what is queued may be over before.
pub const HURRY_FACTOR: f64 = 8.0;

/// Order 3: below this share of the limits a plan goes straight on at constant speed.
pub const STRAIGHT_ON_SHARE: f64 = 1e-3;

/// Order 3: share of the jerk that braking for a place ahead counts on.
pub const BRAKING_JERK_SHARE: f64 = 0.9;

/// Order 3: fine periods at the present speed by which braking for a place ahead begins before it has to: whether it may wait is
/// decided once in a period.
pub const BRAKING_PERIODS: f64 = 2.0;

/// Order 3: fine periods at a lower feed by which it is to be reached before its place: the last of what a speed is above it is
/// divided by three in each.
pub const SETTLING_PERIODS: f64 = 10.0;

/// Fine periods for which lower feeds are looked for beyond the longest stop: those in which what was seen is acted on.
/// With none of them and with twice as many no test of this crate had another result.
pub const SLOWDOWN_PERIODS: f64 = 4.0;

/// Fine periods in which a stop has not begun to slow the machine: the one in which the queue is looked at, the one in which the rate
/// is chosen, and the one in which it begins to fall. With half as many the machine counts on a queue that is shorter than its stop (the
/// test of `tick/queue.rs`).
pub const REACTION_PERIODS: f64 = 3.0;

/// Fine periods at the present speed by which the end of a line is looked for further than a stop takes. With a third and
/// with twice as many no test of this crate had another result.
pub const LINE_END_LOOK_PERIODS: f64 = 3.0;

/// How near to the end of its line the machine comes to rest, mm.
pub const LINE_END_MM: f64 = 0.01;

/// As near as this to the end of its line, mm, the machine comes to rest at once: it does not get faster again.
pub const AT_LINE_END_MM: f64 = 0.001;

/// Order 3: share of the path jerk that a stop at the end of a line counts on where the plan turns or changes its speed, and
/// elsewhere. From 80 mm/s on a straight line the stop begins 3 % before it has to; with half of the second share 16 %,
/// and with twice as much too late (`core/fine/tests/suite/single_block.rs`).
pub const LINE_END_JERK_SHARES: [f64; 2] = [0.6, 0.9];

/// Order 3: fine periods at the present speed by which a stop at the end of a line is to end before it.
/// In that experiment 1, 2 and 4 rest 0.26, 0.42 and 0.64 µm before the end, and begin 2, 3 and 5 % before they have to.
pub const LINE_END_PERIODS: f64 = 2.0;

/// Order 3: share of the path jerk that bringing the rise of the speed to nothing, near the feed, counts on: in a period in
/// which the plan's own jerk turns round little of it is there.
pub const RISE_JERK_SHARE: f64 = 0.8;

/// Order 3: fine periods in which the speed may go on rising as it does, for the same reason.
pub const RISE_PERIODS: f64 = 1.0;

/// Order 3: most that σ̈ may be lowered to near the feed, as a change of the change of σ in a period, without unit. The small
/// steps of other approaches are for where next to nothing moves.
pub const MAX_LOWERING: f64 = 0.3;

/// Order 3: share of the feed that is aimed at: the mean over a period may be that much higher than its ends.
pub const FEED_SHARE: f64 = 1.0 - 1e-6;

/// Order 3: how many times as far each place ahead at which a constant rate is looked at lies from the one before as that one
/// from its own. The first lies a period away, for a plan of small features turns within a few; together they reach over 1900
/// periods, longer than most machines take to their feed.
pub const FEED_POINT_SPACING: f64 = 1.12;

/// Order 3: least rate for whose periods the first of those distances is taken: nearer to a rest the places would not reach far
/// enough.
pub const FEED_POINT_MIN_RATE: f64 = 0.02;

/// Order 3: fine periods from rest for which the first rate is to last: what the plan gains in fewer than these the rate could
/// not follow.
pub const BEGINNING_PERIODS: u32 = 6;

/// Order 2: share of the speed asked for by which a period may begin above it and still end as far below, so that its mean is
/// met. The rounds that seek the rate leave a thousandth where the plan changes by half in a period.
pub const ABOVE_FEED_SHARE: f64 = 0.01;

/// Order 2: by which share of the difference the way of the axes is taken to differ more from the path coordinate: the rate
/// changes in the period in which it is looked at.
pub const LONGER_MARGIN: f64 = 0.1;

/// Order 2: ratio of the two ways from which on they are no fit of a polynomial: where a rotary axis hands over to a linear
/// one, the path coordinate is in other units.
pub const MAX_LONGER: f64 = 1.01;
