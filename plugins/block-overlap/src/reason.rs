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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::corner::Corner;
    use crate::join::Join;
    use crate::options::{CornerControl, Options};

    /// Knots lie on ticks of 1 ms where corners are not controlled.
    fn rules(corner_control: CornerControl) -> Rules {
        let options = Options {
            corner_control,
            ..Options::default()
        };
        Rules::new(
            &options,
            &tandem_rig::context(&[tandem_rig::axis(1000.0)], 0.001),
        )
    }

    /// 10 mm at 50 mm/s under a policy's cap, with 1000 mm/s².
    fn block() -> Entry {
        Entry {
            length_mm: 10.0,
            feed_mm_per_s: 50.0,
            slope_s2_per_mm: 1e-3,
            triangle_mm_per_s: 100.0,
            reason: LimitedBy::Policy,
            ..Entry::blank()
        }
    }

    /// At `feed`, with ramps of 40 ms and an overlap of 20 ms that nothing at the junction asks for.
    fn taken(mode: Mode, feed_mm_per_s: f64) -> Taken {
        Taken {
            number: 0,
            feed_mm_per_s,
            up_s: 0.04,
            join: Join {
                down_s: 0.04,
                up_s: 0.04,
                overlap_s: 0.02,
                stop_mm_per_s2: f64::INFINITY,
            },
            mode,
            corner: Corner {
                span_mm: 1.0,
                room_mm: 20.0,
                longest_s: 0.1,
                cap_mm_per_s: 100.0,
                ..Corner::default()
            },
            next_feed_mm_per_s: 50.0,
        }
    }

    /// What holds down a block that `change` is made to.
    fn held(mut taken: Taken, change: impl FnOnce(&mut Entry, &mut Taken)) -> LimitedBy {
        let mut entry = block();
        change(&mut entry, &mut taken);
        limited_by(&rules(CornerControl::On), &entry, &block(), &taken)
    }

    #[test]
    fn a_block_at_its_own_feed_is_held_by_what_set_it() {
        for mode in [Mode::Flow, Mode::Rest] {
            assert_eq!(held(taken(mode, 50.0), |_, _| ()), LimitedBy::Policy);
        }
        let at_rest = held(taken(Mode::Rest, 50.0), |_, taken| {
            taken.corner.tight = true;
        });
        assert_eq!(at_rest, LimitedBy::Tolerance);
    }

    #[test]
    fn what_bounds_the_overlap_makes_the_next_block_start_late() {
        let late =
            |change: &dyn Fn(&mut Taken)| held(taken(Mode::Late, 50.0), |_, taken| change(taken));
        assert_eq!(late(&|_| ()), LimitedBy::Junction);
        // 20 ms at 1000 mm/s² round off 0.4 mm.
        let within = late(&|taken| taken.corner.span_mm = 0.4);
        assert_eq!(within, LimitedBy::Tolerance);
        let short = late(&|taken| taken.corner.longest_s = 0.02);
        assert_eq!(short, LimitedBy::TimeConstant);
        let down = late(&|taken| taken.join.down_s = 0.02);
        assert_eq!(down, LimitedBy::Acceleration);
        let up = late(&|taken| taken.next_feed_mm_per_s = 20.0);
        assert_eq!(up, LimitedBy::Acceleration);
    }

    #[test]
    fn a_lower_feed_is_held_by_the_junction_or_what_the_junction_is_held_by() {
        let at_cap = |change: &dyn Fn(&mut Entry, &mut Taken)| {
            held(taken(Mode::Flow, 40.0), |entry, taken| {
                taken.corner.cap_mm_per_s = 40.0;
                change(entry, taken);
            })
        };
        assert_eq!(at_cap(&|_, _| ()), LimitedBy::Tolerance);
        // The block, the room at the junction and the time constant each leave less than the tolerance does.
        let short = at_cap(&|entry, _| entry.length_mm = 0.9);
        let narrow = at_cap(&|_, taken| taken.corner.room_mm = 0.9);
        let brief = at_cap(&|_, taken| taken.corner.longest_s = 0.02);
        assert_eq!([short, narrow, brief], [LimitedBy::Junction; 3]);
        let late = held(taken(Mode::Late, 40.0), |_, taken| {
            taken.corner.cap_mm_per_s = 40.0;
        });
        assert_eq!(late, LimitedBy::Junction);
        let triangle = held(taken(Mode::Rest, 40.0), |entry, _| {
            entry.triangle_mm_per_s = 40.0;
        });
        assert_eq!(triangle, LimitedBy::Acceleration);
        for (mode, expected) in [
            (Mode::Flow, LimitedBy::Acceleration),
            (Mode::Late, LimitedBy::Junction),
        ] {
            let before_slower = held(taken(mode, 40.0), |_, taken| {
                taken.next_feed_mm_per_s = 30.0;
            });
            assert_eq!(before_slower, expected);
            let before_equal = held(taken(mode, 40.0), |_, taken| {
                taken.next_feed_mm_per_s = 40.0;
            });
            assert_eq!(before_equal, LimitedBy::Junction);
        }
    }

    #[test]
    fn on_ticks_time_constants_and_rounding_hold_a_feed_down() {
        let held = |corner_control, taken: &Taken| {
            limited_by(&rules(corner_control), &block(), &block(), taken)
        };
        // 10 mm take two ramps of a quarter of a second.
        for (mode, ramp_s, corner_control, expected) in [
            (
                Mode::Flow,
                0.25,
                CornerControl::Off,
                LimitedBy::TimeConstant,
            ),
            (Mode::Late, 0.25, CornerControl::Off, LimitedBy::Junction),
            (Mode::Flow, 0.25, CornerControl::On, LimitedBy::Junction),
            (Mode::Flow, 0.20, CornerControl::Off, LimitedBy::Junction),
        ] {
            let mut slow = taken(mode, 40.0);
            (slow.up_s, slow.join.down_s) = (ramp_s, ramp_s);
            assert_eq!(held(corner_control, &slow), expected, "{mode:?} {ramp_s}");
        }
        // They take 0.8 ms and 1.2 ms longer than at 50 mm/s.
        for (feed, expected) in [(49.8, LimitedBy::Policy), (49.7, LimitedBy::Junction)] {
            let rounded = taken(Mode::Late, feed);
            assert_eq!(held(CornerControl::Off, &rounded), expected, "{feed}");
            assert_eq!(
                held(CornerControl::On, &rounded),
                LimitedBy::Junction,
                "{feed}"
            );
        }
    }
}
