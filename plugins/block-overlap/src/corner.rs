//! The junction of two blocks: what tolerance and turning allow there, in closed form.

use tandem_sdk::MAX_AXES;

use crate::entry::Entry;
use crate::options::LimitMode;
use crate::rules::{ARC_OVERLAP, Rules, TURN_SHARE, greater, lesser};

/// A junction, whatever feeds meet there.
///
/// With the overlap τ, feeds F and the step `Δu` of the direction, the corner error is `F·τ·|Δu|/8` (for a turn θ
/// `|Δu| = 2·sin(θ/2)`) and the acceleration of an axis `F·Δu/τ`. Both depend on `F·τ` alone or on `F/τ` alone.
#[derive(Clone, Copy, Debug, Default)]
pub struct Corner {
    /// The two blocks meet at rest.
    pub rest: bool,
    /// No overlap is short enough for the tolerance, so it is a rest.
    pub tight: bool,
    /// Acceleration that 1 mm/s over 1 s takes of the axis that turns most, as a share of its limit, s²/mm.
    pub turn_s2_per_mm: f64,
    /// The greatest F·τ that the tolerance allows, mm.
    pub span_mm: f64,
    /// The greatest F·τ that tolerance and short blocks allow, mm.
    pub room_mm: f64,
    /// Time constant, s: the longest overlap, or the overlap where it is not shortened.
    pub tau_s: f64,
    /// The longest overlap, s; infinite where constants may be stretched.
    pub longest_s: f64,
    /// The highest feed at which both blocks may pass in full overlap, mm/s.
    pub cap_mm_per_s: f64,
    /// Share of the acceleration that arcs leave at that feed for a change of feed.
    pub spare: f64,
}

impl Corner {
    /// The junction between `before` and `after`.
    pub fn new(rules: &Rules, before: &Entry, after: &Entry) -> Self {
        let tau_s = before.tau_s;
        let rest = before.rests_before(after);
        let blank = Self {
            rest,
            tau_s,
            longest_s: tau_s,
            spare: 1.0,
            ..Self::default()
        };
        if rest {
            return blank;
        }
        if leaves_travel(rules, before, after) {
            return Self {
                rest: true,
                tight: true,
                ..blank
            };
        }
        let (turn, squares) = rules.turn(&before.directions[1], &after.directions[0]);
        let span_mm = if rules.controlled {
            span_mm(rules, before, after, squares)
        } else {
            f64::INFINITY
        };
        if rules.limits == LimitMode::Off {
            let fastest = greater(before.feed_mm_per_s, after.feed_mm_per_s);
            let ticks = max_ticks(span_mm / (fastest * rules.tick_s));
            if ticks < 1.0 {
                return Self {
                    rest: true,
                    tight: true,
                    ..blank
                };
            }
            let tau_s = lesser(tau_s, ticks * rules.tick_s);
            return Self {
                tau_s,
                cap_mm_per_s: f64::INFINITY,
                room_mm: f64::INFINITY,
                span_mm,
                ..blank
            };
        }
        let shorter = lesser(before.length_mm, after.length_mm);
        // Without corner control a short block is slowed by its constants; longer ones would not fit into it.
        let fits = rules.shorten
            || before.reach_mm <= before.length_mm && after.reach_mm <= after.length_mm;
        let stretch = rules.limits == LimitMode::Stretch && fits;
        let room_mm = if rules.shorten || stretch {
            lesser(span_mm, shorter)
        } else {
            span_mm
        };
        let longest_s = if stretch { f64::INFINITY } else { tau_s };
        let bend = ARC_OVERLAP * greater(before.bend, after.bend);
        let cap = cap_mm_per_s(turn, room_mm, longest_s, bend);
        let bent = bend * lesser(cap, greater(before.feed_mm_per_s, after.feed_mm_per_s)).powi(2);
        let spare = 1.0 - lesser(bent, TURN_SHARE);
        Self {
            turn_s2_per_mm: turn,
            span_mm,
            room_mm,
            longest_s,
            cap_mm_per_s: cap,
            spare,
            ..blank
        }
    }

    /// The highest feed of the faster of two blocks in full overlap where the slower has `slow_mm_per_s`; `slope` is
    /// 1/path acceleration of the faster one.
    ///
    /// Acceleration: `slow·g + (fast − slow)·slope ≤ spare·τ` with `τ = min(longest, room/fast)`.
    pub fn lift_mm_per_s(&self, slow_mm_per_s: f64, slope: f64) -> f64 {
        if slope == 0.0 {
            return self.cap_mm_per_s;
        }
        let level = slow_mm_per_s * (slope - self.turn_s2_per_mm);
        let by_room = (level + (level * level + 4.0 * slope * self.spare * self.room_mm).sqrt())
            / (2.0 * slope);
        let by_time = (self.spare * self.longest_s + level) / slope;
        greater(
            lesser(lesser(by_room, by_time), self.cap_mm_per_s),
            slow_mm_per_s,
        )
    }
}

/// Beyond an end by less than this is rounding, mm.
const ROUNDED_MM: f64 = 1e-9;

/// Whether the two blocks together may be beyond an end of the travel, where neither is alone. While they overlap, what is still
/// to go of the first comes on top of what is gone of the second: so an axis that turns back there may go further than either.
fn leaves_travel(rules: &Rules, before: &Entry, after: &Entry) -> bool {
    (0..rules.axes.min(MAX_AXES)).any(|axis| {
        let [low, high] = [rules.travel_mm[0][axis], rules.travel_mm[1][axis]];
        let (at, [first, second]) = (
            before.end[axis],
            [before, after].map(|it| it.extent_mm(axis)),
        );
        // An end that one of them goes beyond by itself is none: travel counts for nothing before homing.
        let above =
            first[1] + (second[1] - at) > greater(high, greater(first[1], second[1])) + ROUNDED_MM;
        let below =
            first[0] + (second[0] - at) < lesser(low, lesser(first[0], second[0])) - ROUNDED_MM;
        above || below
    })
}

/// The longest overlap where the axes do not count, in whole ticks; zero where none is short enough. `span` is the greatest
/// F·τ that the tolerance allows, in ticks of travel. The chord between two samples lies inside the corner by its n-th part
/// of a tick: `n + 1/n ≤ span`.
fn max_ticks(span: f64) -> f64 {
    if span < 2.0 {
        0.0
    } else {
        (f64::midpoint(span, (span * span - 4.0).sqrt()) + 1e-9).floor()
    }
}

/// The largest F with `F·g/τ + bend·F² ≤ TURN_SHARE` and `τ = min(longest, room/F)`.
fn cap_mm_per_s(turn: f64, room_mm: f64, longest_s: f64, bend: f64) -> f64 {
    if room_mm <= 0.0 {
        return 0.0;
    }
    let square = turn / room_mm + bend;
    let by_room = if square > 0.0 {
        (TURN_SHARE / square).sqrt()
    } else {
        f64::INFINITY
    };
    let linear = turn / longest_s;
    let by_time = match bend {
        0.0 if linear > 0.0 => TURN_SHARE / linear,
        0.0 => f64::INFINITY,
        _ => 2.0 * TURN_SHARE / (linear + (linear * linear + 4.0 * bend * TURN_SHARE).sqrt()),
    };
    lesser(by_room, by_time)
}

/// The largest X = F·τ with `X·|Δu|/8 + X²·κ/64 ≤ tolerance`: the corner error, and what two blocks of the curvatures
/// κ₁ + κ₂ = κ lose while one starts and the other ends. The second term is an upper bound: with d₁ and d₂ the distances
/// still to go and already gone, arcs lose at most κ·d₁·d₂, and d₁·d₂ ≤ (X/8)².
fn span_mm(rules: &Rules, before: &Entry, after: &Entry, squares: f64) -> f64 {
    let allowed_mm = lesser(before.tolerance_mm, after.tolerance_mm) - rules.sag_mm;
    let sharp = squares.sqrt() / 8.0;
    let curved = CURVED * (before.curvature_per_mm + after.curvature_per_mm) / 64.0;
    if allowed_mm <= 0.0 {
        return if sharp < STRAIGHT && curved == 0.0 {
            f64::INFINITY
        } else {
            0.0
        };
    }
    if curved == 0.0 {
        return allowed_mm / sharp;
    }
    2.0 * allowed_mm / (sharp + (sharp * sharp + 4.0 * curved * allowed_mm).sqrt())
}

/// Directions that differ by less are the same, to the rounding of coordinates.
const STRAIGHT: f64 = 1e-9;

/// Margin on the curved term for what is left out of it: the arc's own change of direction while it starts.
const CURVED: f64 = 1.1;

/// The corner error, mm: the distance of the vertex from the parabola on which two straight blocks overlap for `tau_s`,
/// one slowing down from `before_mm_per_s`, the other speeding up to `after_mm_per_s`, with the turn angle `turn_rad`.
///
/// For equal feeds `F·τ/4·sin(θ/2)`. Else the point is at `s/(1−s) = r`, r the positive root of
/// `b²·r³ + a·b·c·r² − a·b·c·r − a² = 0` with a and b half of feed times τ and c = cos θ. Does not allocate.
pub fn corner_error_mm(
    before_mm_per_s: f64,
    after_mm_per_s: f64,
    tau_s: f64,
    turn_rad: f64,
) -> f64 {
    let a = before_mm_per_s * tau_s / 2.0;
    let b = after_mm_per_s * tau_s / 2.0;
    let c = turn_rad.cos();
    if a <= 0.0 || b <= 0.0 {
        return 0.0;
    }
    let value = |r: f64| ((b * b * r + a * b * c) * r - a * b * c) * r - a * a;
    let mut low = 0.0;
    let mut high = 2.0 * (1.0 + (a / b).max(1.0));
    for _ in 0..80 {
        let middle = f64::midpoint(low, high);
        *(if value(middle) > 0.0 {
            &mut high
        } else {
            &mut low
        }) = middle;
    }
    let s = low / (1.0 + low);
    let p = a * (1.0 - s) * (1.0 - s);
    let q = b * s * s;
    // |p·u₁ − q·u₂|² = (p − q)² + 2·p·q·(1 − cos θ), in the form that does not cancel.
    ((p - q).powi(2) + 4.0 * p * q * (turn_rad / 2.0).sin().powi(2)).sqrt()
}

/// The time constant, s, at which two blocks of the feed `feed_mm_per_s` lose `error_mm` at a corner:
/// `τ = 4·ε/(F·sin(θ/2))`. Does not allocate.
pub fn tau_for_tolerance_s(error_mm: f64, feed_mm_per_s: f64, turn_rad: f64) -> f64 {
    4.0 * error_mm / (feed_mm_per_s * (turn_rad / 2.0).sin())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::options::Options;

    fn rules() -> Rules {
        let axis = tandem_rig::axis(1000.0);
        Rules::new(&Options::default(), &tandem_rig::context(&[axis; 2], 0.001))
    }

    /// A block that may stand off its path by 0.05 mm.
    fn block(curvature_per_mm: f64) -> Entry {
        Entry {
            tolerance_mm: 0.05,
            curvature_per_mm,
            ..Entry::blank()
        }
    }

    /// What blocks lose at a corner and by their curvatures is what the tolerance leaves beside the chords of the samples.
    #[test]
    fn the_span_takes_all_of_the_tolerance() {
        let rules = rules();
        let sag_mm = rules.sag_mm;
        for (squares, curvatures) in [
            (2.0, [0.0, 0.0]),
            (0.5, [0.02, 0.0]),
            (0.0, [0.05, 0.2]),
            (2.0, [0.3, 0.1]),
        ] {
            let [before, after] = curvatures.map(block);
            let span = span_mm(&rules, &before, &after, squares);
            let sharp = span * f64::sqrt(squares) / 8.0;
            let curved = CURVED * span * span * (curvatures[0] + curvatures[1]) / 64.0;
            let lost = sharp + curved + sag_mm;
            assert!(
                (lost - 0.05).abs() < 1e-9,
                "{squares} {curvatures:?}: {lost}"
            );
        }
        // The stricter of both counts. What leaves nothing beside the chords allows a straight junction only.
        let strict = Entry {
            tolerance_mm: 0.01,
            ..block(0.0)
        };
        let spans = [(block(0.0), strict.clone()), (strict, block(0.0))];
        for (before, after) in spans {
            let span = span_mm(&rules, &before, &after, 2.0);
            assert!((span * f64::sqrt(2.0) / 8.0 + sag_mm - 0.01).abs() < 1e-9);
        }
        let none = |curvature| Entry {
            tolerance_mm: sag_mm,
            ..block(curvature)
        };
        let straight = span_mm(&rules, &none(0.0), &none(0.0), 0.0);
        assert_eq!(straight, f64::INFINITY);
        assert_eq!(span_mm(&rules, &none(0.0), &none(0.0), 1e-6), 0.0);
        assert_eq!(span_mm(&rules, &none(0.1), &none(0.0), 0.0), 0.0);
    }

    /// n ticks of overlap take `n + 1/n` ticks of travel.
    #[test]
    fn an_overlap_has_the_most_ticks_that_its_span_takes() {
        for ticks in 1..50 {
            let ticks = f64::from(ticks);
            let needed = ticks + 1.0 / ticks;
            assert_eq!(max_ticks(needed * (1.0 + 1e-9)), ticks);
            assert_eq!(
                max_ticks(needed * (1.0 - 1e-6)),
                if ticks > 1.0 { ticks - 1.0 } else { 0.0 }
            );
        }
    }

    /// The cap takes the share of turning in the overlap that it allows: that of the room or the longest one.
    #[test]
    fn the_cap_takes_all_of_the_share_of_turning() {
        for (turn, room_mm, longest_s, bend) in [
            (2e-3, 1.0, 0.1, 0.0),
            (2e-3, 1.0, 0.01, 0.0),
            (2e-3, 1.0, 0.1, 1e-4),
            (2e-3, 1.0, 0.01, 1e-4),
            (0.0, 1.0, 0.01, 1e-4),
            (2e-3, 1.0, f64::INFINITY, 1e-4),
        ] {
            let cap = cap_mm_per_s(turn, room_mm, longest_s, bend);
            let overlap_s = longest_s.min(room_mm / cap);
            let share = cap * turn / overlap_s + bend * cap * cap;
            assert!(
                (share - TURN_SHARE).abs() < 1e-9,
                "{turn} {longest_s} {bend}: {share}"
            );
        }
        assert_eq!(cap_mm_per_s(0.0, 1.0, 0.1, 0.0), f64::INFINITY);
        assert_eq!(cap_mm_per_s(2e-3, 0.0, 0.1, 0.0), 0.0);
    }

    /// At the lifted feed turning with the slower block's and the change to it take what arcs leave of the acceleration, in the overlap
    /// of the time constant and in one that the room shortens.
    #[test]
    fn a_lifted_feed_takes_all_of_the_overlap() {
        let corner = Corner {
            turn_s2_per_mm: 4e-4,
            room_mm: 2.0,
            longest_s: 0.03,
            cap_mm_per_s: 1000.0,
            spare: 0.7,
            ..Corner::default()
        };
        for (slow, slope, room_mm) in [
            (5.0, 1e-3, 2.0),
            (30.0, 3e-3, 2.0),
            (45.0, 1e-3, 2.0),
            (5.0, 1e-3, 0.2),
            (15.0, 3e-3, 0.5),
        ] {
            let corner = Corner { room_mm, ..corner };
            let fast = corner.lift_mm_per_s(slow, slope);
            let overlap_s = f64::min(corner.longest_s, room_mm / fast);
            let taken_s = slow * corner.turn_s2_per_mm + (fast - slow) * slope;
            assert!(fast > slow);
            assert!(
                (taken_s / (corner.spare * overlap_s) - 1.0).abs() < 1e-9,
                "{slow} {room_mm}"
            );
        }
        let capped = Corner {
            cap_mm_per_s: 20.0,
            ..corner
        };
        assert_eq!(capped.lift_mm_per_s(5.0, 1e-3), 20.0);
        assert_eq!(corner.lift_mm_per_s(5.0, 0.0), 1000.0);
        // A slower block that takes more than there is lifts nothing.
        assert_eq!(corner.lift_mm_per_s(200.0, 1e-3), 200.0);
    }

    /// A line that runs into an arc: turning on it, half as much again while they overlap, bounds the feed at which they do, and what it
    /// takes is not there for a change of feed.
    #[test]
    fn an_arc_takes_its_part_of_an_overlap() {
        let line = Entry {
            feed_mm_per_s: 200.0,
            length_mm: 100.0,
            tau_s: 0.02,
            tolerance_mm: 100.0,
            rests: [false; 2],
            ..Entry::blank()
        };
        let arc = Entry {
            bend: 1e-4,
            ..line.clone()
        };
        for [before, after] in [[&line, &arc], [&arc, &line]] {
            let corner = Corner::new(&rules(), before, after);
            let cap = (TURN_SHARE / (1.5 * 1e-4)).sqrt();
            assert!((corner.cap_mm_per_s / cap - 1.0).abs() < 1e-9);
            assert!((corner.spare - (1.0 - TURN_SHARE)).abs() < 1e-9);
            let slow = Entry {
                feed_mm_per_s: 40.0,
                ..before.clone()
            };
            let slower = Entry {
                feed_mm_per_s: 30.0,
                ..after.clone()
            };
            let spare = Corner::new(&rules(), &slow, &slower).spare;
            assert!(
                (spare - (1.0 - 1.5 * 1e-4 * 1600.0)).abs() < 1e-9,
                "{spare}"
            );
        }
    }
}
