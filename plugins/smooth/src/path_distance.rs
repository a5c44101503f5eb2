//! The distance of the motion from the path: at a place, and between two.

use tandem_motion::tube::{Lanes, each};

use crate::frame::{dot, larger, minus, plus};
use crate::route::Run;
use crate::window::Window;

/// Share of the tolerance beyond which it does not matter how much it is: the boxes of the next try are as narrow as they get.
pub const FAR: f64 = 1.4;

/// Share of the tolerance that the motion may reach at an instant.
pub const ALLOWED: f64 = 0.999;
/// Share of the tolerance from which on a nearer chord is looked for.
pub const DEVIATION: f64 = 0.95;
/// Halvings at most of the time between two samples: what lies between is then a thousandth of the way.
pub const HALVINGS: u32 = 10;
/// Below this share of the tolerance nothing nearer is looked for.
pub const NEAR_ENOUGH: f64 = 0.35;
/// Chords searched on each side.
pub const SEARCHED: usize = 400;

/// A place of the motion, and the nearest one of the path.
#[derive(Clone, Copy, Debug)]
pub struct PathDistance<const L: usize> {
    point: Lanes<L>,
    chord: usize,
    /// The place on that chord.
    foot: Lanes<L>,
    /// The distance of the two, and as a share of what is allowed.
    off: f64,
    pub share: f64,
}

impl<const L: usize> PathDistance<L> {
    /// The chord of the place on the path.
    pub fn chord(&self) -> usize {
        self.chord
    }

    /// Path coordinate of the place on the path.
    pub fn path_coordinate(&self, run: &Run<'_, L>) -> f64 {
        let chord = &run.chords[self.chord];
        chord.s + dot(&minus(&self.foot, &chord.start), &chord.direction)
    }
}

/// The place of the path that is nearest to `point`, around chord `near`.
#[inline(always)]
pub fn path_distance<const L: usize>(
    run: &Run<'_, L>,
    near: usize,
    point: &Lanes<L>,
) -> PathDistance<L> {
    let chords = run.chords;
    let look = |i: usize| {
        let chord = &chords[i];
        let way = minus(point, &chord.start);
        let along = dot(&way, &chord.direction).clamp(0.0, chord.length);
        let across: Lanes<L> = each(|l| way[l] - along * chord.direction[l]);
        dot(&across, &across) / (chord.tolerance * chord.tolerance)
    };
    let mut best = look(near);
    let mut found = near;
    for step in 1..SEARCHED {
        if best < NEAR_ENOUGH * NEAR_ENOUGH || step > 3 && best <= DEVIATION * DEVIATION {
            break;
        }
        for i in [near.checked_add(step), near.checked_sub(step)]
            .into_iter()
            .flatten()
        {
            if i < chords.len() {
                let share = look(i);
                (best, found) = if share < best {
                    (share, i)
                } else {
                    (best, found)
                };
            }
        }
    }
    let chord = &chords[found];
    let along = dot(&minus(point, &chord.start), &chord.direction).clamp(0.0, chord.length);
    let share = best.sqrt();
    let foot = plus(&chord.start, along, &chord.direction);
    PathDistance {
        point: *point,
        chord: found,
        foot,
        off: share * chord.tolerance,
        share: share / ALLOWED,
    }
}

/// A bound of the distance from the path between two places of the motion, as a share of what is allowed. The line between
/// them stands off the line between their feet by no more than they do themselves; the path between the feet stands off
/// that line by no more than its vertices, and the motion off the other by no more than `bulge`.
#[inline(always)]
pub fn distance_bound<const L: usize>(
    run: &Run<'_, L>,
    a: &PathDistance<L>,
    b: &PathDistance<L>,
    bulge: f64,
) -> f64 {
    let chords = run.chords;
    let first = a.chord.min(b.chord);
    let last = a.chord.max(b.chord);
    let mut tolerance = chords[first].tolerance;
    let mut between = 0.0f64;
    if first < last {
        let way = minus(&b.foot, &a.foot);
        let per = 1.0 / dot(&way, &way).max(f64::MIN_POSITIVE);
        for chord in &chords[first + 1..=last] {
            tolerance = tolerance.min(chord.tolerance);
            let to = minus(&chord.start, &a.foot);
            let along = dot(&to, &way) * per;
            let across: Lanes<L> = each(|l| to[l] - along * way[l]);
            between = larger(between, dot(&across, &across));
        }
        between = between.sqrt();
    }
    (larger(a.off, b.off) + bulge + between) / (ALLOWED * tolerance)
}

/// The same in halves, as often as it takes; in the end what the motion can do between two places.
pub fn closer<const L: usize>(
    run: &Run<'_, L>,
    window: &Window<L>,
    [from_s, to_s]: [f64; 2],
    (a, b): (&PathDistance<L>, &PathDistance<L>),
    bulge: f64,
    left: u32,
) -> f64 {
    let ends = larger(a.share, b.share);
    if left == 0 {
        let way = minus(&b.point, &a.point);
        let least = run.chords[a.chord]
            .tolerance
            .min(run.chords[b.chord].tolerance);
        return ends + (dot(&way, &way).sqrt() / 2.0 + bulge) / (ALLOWED * least);
    }
    let t = f64::midpoint(from_s, to_s);
    let middle = path_distance(run, usize::midpoint(a.chord, b.chord), &window.state(t)[0]);
    let mut worst = larger(ends, middle.share);
    if turns_back(run, a, &middle) || turns_back(run, &middle, b) {
        // Between two samples of this phase, but a slower motion has one there.
        worst = larger(worst, FAR);
    }
    for (times, places) in [([from_s, t], (a, &middle)), ([t, to_s], (&middle, b))] {
        // What is too far already need not be known better.
        if worst > 1.0 || worst.is_nan() {
            break;
        }
        let between = distance_bound(run, places.0, places.1, bulge / 4.0);
        let between = if between > 1.0 {
            closer(run, window, times, places, bulge / 4.0, left - 1)
        } else {
            between
        };
        worst = larger(worst, between);
    }
    worst
}

/// Whether the motion goes back from `a` to `b`, by more than two places within tolerance of them may: on a chord behind which,
/// and before which, the path goes on in much the same direction. Elsewhere the nearest place may be one that is passed at another
/// time.
fn turns_back<const L: usize>(run: &Run<'_, L>, a: &PathDistance<L>, b: &PathDistance<L>) -> bool {
    let chord = &run.chords[b.chord];
    let back = -dot(&minus(&b.point, &a.point), &chord.direction);
    if a.chord != b.chord || back <= 2.0 * ALLOWED * chord.tolerance {
        return false;
    }
    let before = b.chord.checked_sub(1).and_then(|i| run.chords.get(i));
    let behind = run.chords.get(b.chord + 1);
    before
        .into_iter()
        .chain(behind)
        .all(|next| dot(&next.direction, &chord.direction) > 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::to_chord;
    use crate::order::tests::open;
    use crate::route::Chord;
    use crate::window::Piece;
    use tandem_rig::Random;

    /// Chords of 1 to 2 mm one after the other that turn by up to `turn_rad`.
    fn path(random: &mut Random, turn_rad: f64, tolerance: f64) -> Vec<Chord<2>> {
        let (mut start, mut s, mut heading) = ([0.0; 2], 0.0, 0.0_f64);
        let mut chords = vec![];
        for _ in 0..3 {
            let (length, direction) = (random.between(1.0, 2.0), [heading.cos(), heading.sin()]);
            chords.push(Chord {
                start,
                direction,
                s,
                length,
                feed: 10.0,
                pace: 10.0,
                tolerance,
                speed: 10.0,
                turn_s: 0.1,
                turn: 0.0,
            });
            start = plus(&start, length, &direction);
            (s, heading) = (s + length, heading + random.between(-turn_rad, turn_rad));
        }
        chords
    }

    /// What is said of the distance of the motion from the path, as the checker asks for it: as a share of what is allowed.
    fn said(run: &Run<'_, 2>, window: &Window<2>) -> f64 {
        let end_s = window.pieces[0].duration_s;
        let acceleration = |n: u32| window.state(end_s * f64::from(n) / 1000.0)[2];
        let most = (0..=1000)
            .map(|n| dot(&acceleration(n), &acceleration(n)))
            .fold(0.0, larger);
        let bulge = most.sqrt() * end_s * end_s / 8.0;
        let last = run.chords.len() - 1;
        let places = (
            path_distance(run, 0, &window.state(0.0)[0]),
            path_distance(run, last, &window.state(end_s)[0]),
        );
        let (from, to) = (&places.0, &places.1);
        let between = distance_bound(run, from, to, bulge);
        if between > 1.0 {
            closer(run, window, [0.0, end_s], (from, to), bulge, HALVINGS)
        } else {
            larger(between, larger(from.share, to.share))
        }
    }

    /// The largest distance of the motion from the nearest chord, as a share of what is allowed.
    fn reached(run: &Run<'_, 2>, window: &Window<2>) -> f64 {
        let end_s = window.pieces[0].duration_s;
        let off = |n: u32| {
            let at = window.state(end_s * f64::from(n) / 2000.0)[0];
            let to = |chord: &Chord<2>| to_chord(&at, &chord.start, &chord.at(chord.end()));
            run.chords.iter().map(to).fold(f64::INFINITY, f64::min)
        };
        let most = (0..=2000).map(off).fold(0.0, f64::max);
        most.sqrt() / (ALLOWED * run.chords[0].tolerance)
    }

    fn window(piece: Piece<2>) -> Window<2> {
        let mut window = Window::new();
        window.pieces.push(piece);
        window
    }

    #[test]
    fn a_motion_beyond_the_tolerance_is_never_passed_and_one_well_within_it_is() {
        let mut random = Random::from_the_clock();
        let mut counts = [0; 2];
        for _ in 0..400 {
            let (turn_rad, tolerance) = (random.length(1e-3, 1.2), random.length(0.01, 1.0));
            let chords = path(&mut random, turn_rad, tolerance);
            let run = open(&chords);
            let (first, last) = (&chords[0], &chords[2]);
            let speed = random.between(3.0, 6.0);
            let state =
                |at: Lanes<2>, direction: Lanes<2>| [at, each(|l| speed * direction[l]), [0.0; 2]];
            let from = state(first.start, first.direction);
            let to = state(last.at(last.end()), last.direction);
            let window = window(Piece::between(&from, &to, 0.0, run.end() / speed));
            let (said, reached) = (said(&run, &window), reached(&run, &window));
            if reached > 1.0 {
                assert!(said > 1.0, "{said} is said of {reached}: {chords:?}");
                counts[0] += 1;
            } else if reached < 0.4 {
                assert!(said <= 1.0, "{said} is said of {reached}: {chords:?}");
                counts[1] += 1;
            }
        }
        assert!(counts.iter().all(|count| *count > 20), "{counts:?}");
    }

    /// Beside a place of the path at these distances, by the number of chords from it.
    #[test]
    fn a_nearer_chord_is_looked_for_around_the_place_and_farther_while_it_is_too_far() {
        let found = |middle: f64, next: f64, others: f64| {
            let chords: Vec<_> = (0..21_u32)
                .map(|n| Chord {
                    start: [
                        0.0,
                        match n.abs_diff(10) {
                            0 => middle,
                            1..=3 => next,
                            _ => others,
                        },
                    ],
                    direction: [1.0, 0.0],
                    length: 1.0,
                    ..path(&mut Random::new(1), 0.0, 1.0)[0]
                })
                .collect();
            path_distance(&open(&chords), 10, &[0.5, 0.0]).off
        };
        for (distances, nearest) in [
            ([0.3, 0.1, 0.1], 0.3),
            ([0.6, 0.4, 0.1], 0.4),
            ([0.6, 0.7, 0.1], 0.6),
            ([0.94, 0.96, 0.1], 0.94),
            ([0.97, 0.96, 0.1], 0.1),
            ([2.0, 3.0, 1.5], 1.5),
        ] {
            let [middle, next, others] = distances;
            let found = found(middle, next, others);
            assert!((found - nearest).abs() < 1e-12, "{distances:?}: {found}");
        }
    }

    /// Over a right angle: the corner stands off the line between places 0.3 mm before it and 0.8 mm behind it by the height of that triangle.
    #[test]
    fn a_corner_between_two_places_counts_as_far_as_it_stands_off_the_line_between_them() {
        let mut chords = path(&mut Random::new(1), 0.0, 2.0);
        let corner = chords[1].start;
        chords[1].direction = [-chords[0].direction[1], chords[0].direction[0]];
        let run = open(&chords);
        let before = path_distance(&run, 0, &chords[0].at(chords[0].end() - 0.3));
        let behind = path_distance(&run, 1, &plus(&corner, 0.8, &chords[1].direction));
        for (a, b) in [(&before, &behind), (&behind, &before)] {
            let share = distance_bound(&run, a, b, 0.1);
            let expected = (0.3 * 0.8 / 0.3_f64.hypot(0.8) + 0.1) / (ALLOWED * 2.0);
            assert!((share - expected).abs() < 1e-9, "{share}, not {expected}");
        }
        let same = distance_bound(&run, &before, &before, 0.1);
        assert!((same - 0.1 / (ALLOWED * 2.0)).abs() < 1e-9, "{same}");
    }

    #[test]
    fn a_motion_that_goes_back_on_its_chord_by_more_than_the_tolerance_is_not_passed() {
        let mut random = Random::new(1);
        for (back, passes) in [(0.05, true), (3.0, false)] {
            for tolerance in [0.01, 0.1] {
                let chords = path(&mut random, 0.0, tolerance);
                let run = open(&chords);
                let at = chords[1].at(chords[1].s + 0.9);
                let place = |back: f64| {
                    let point = plus(&at, -back, &chords[1].direction);
                    path_distance(&run, 1, &point)
                };
                let goes_back = turns_back(&run, &place(0.0), &place(back * tolerance));
                assert_eq!(!goes_back, passes, "{back} times {tolerance} mm");
                let goes_on = turns_back(&run, &place(back * tolerance), &place(0.0));
                assert!(!goes_on);
            }
        }
    }

    /// Back by more than the tolerance in the first half of the time, or in the second, though both ends are on the path.
    #[test]
    fn a_motion_that_goes_back_in_either_half_is_too_far_off() {
        let chords = path(&mut Random::new(1), 0.0, 0.05);
        let run = open(&chords);
        let direction = chords[0].direction;
        for (x, passes) in [
            ([0.0, 3.2, -3.0], false),
            ([0.9, -3.2, 3.2], false),
            ([0.1, 0.5, 0.3], true),
        ] {
            let mut piece = Piece::between(&[[0.0; 2]; 3], &[[0.0; 2]; 3], 0.0, 1.0);
            for (n, x) in x.into_iter().enumerate() {
                piece.c[n] = each(|l| x * direction[l]);
            }
            let window = window(piece);
            let places = [0.0, 1.0].map(|t| path_distance(&run, 0, &window.state(t)[0]));
            let ends = (&places[0], &places[1]);
            let off = closer(&run, &window, [0.0, 1.0], ends, 0.0, HALVINGS);
            assert_eq!(off < FAR, passes, "{x:?}: {off}");
        }
    }

    /// Where nothing is halved any more, half of the way between the ends counts, and what the motion can do in it.
    #[test]
    fn in_the_end_half_of_the_way_between_two_places_counts() {
        let chords = path(&mut Random::new(1), 0.0, 0.5);
        let run = open(&chords);
        let place = |s: f64| path_distance(&run, 0, &chords[0].at(s));
        let (from, to) = (place(0.2), place(0.6));
        let off = closer(&run, &Window::new(), [0.0, 1.0], (&from, &to), 0.1, 0);
        let expected = from.share.max(to.share) + (0.4 / 2.0 + 0.1) / (ALLOWED * 0.5);
        assert!((off - expected).abs() < 1e-9, "{off}, {expected}");
    }

    /// Where the path itself turns back, the place that a motion goes back to may be one that is passed at another time.
    #[test]
    fn next_to_a_turn_of_the_path_nothing_goes_back() {
        for (turned, goes_back) in [(None, true), (Some(0), false), (Some(2), false)] {
            let mut chords = path(&mut Random::new(1), 0.0, 0.05);
            if let Some(turned) = turned {
                chords[turned].direction = chords[1].direction.map(|d| -d);
            }
            let run = open(&chords);
            let at = |s: f64| path_distance(&run, 1, &chords[1].at(chords[1].s + s));
            assert_eq!(
                turns_back(&run, &at(0.7), &at(0.4)),
                goes_back,
                "{turned:?}"
            );
        }
    }
}
