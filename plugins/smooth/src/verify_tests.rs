use super::*;
use crate::order::tests::{lines, open};
use crate::route::Chord;
use crate::timing::Mark;
use crate::window::{Piece, State};
use tandem_rig::Random;

const TOLERANCE: f64 = 0.1;
const PERIOD_S: f64 = 0.001;

/// Chords of this feed through `points`.
fn path(points: &[[f64; 2]], feed: f64) -> Vec<Chord<2>> {
    let mut chords = lines(points);
    for chord in &mut chords {
        (chord.feed, chord.pace) = (feed, feed);
        chord.tolerance = TOLERANCE;
        chord.speed = feed;
    }
    chords
}

/// 100 mm/s in feed motion and 200 mm/s in rapids, 1000 mm/s² and 20 000 mm/s³.
fn frame() -> Frame<2> {
    let axis = tandem_sdk::AxisLimits {
        feed_mm_per_s: 100.0,
        rapid_mm_per_s: 200.0,
        jerk_mm_per_s3: 20_000.0,
        ..tandem_rig::axis(1000.0)
    };
    Frame::new(&tandem_rig::context(&[axis; 2], PERIOD_S))
}

/// One quintic from rest to rest.
fn rest_to_rest(from: [f64; 2], to: [f64; 2], duration_s: f64, end: f64) -> Window<2> {
    let rest = |at: [f64; 2]| [at, [0.0; 2], [0.0; 2]];
    let mut window = Window::new();
    let piece = Piece::between(&rest(from), &rest(to), 0.0, duration_s);
    window.pieces.push(piece);
    window.marks = vec![
        Mark { t: 0.0, s: 0.0 },
        Mark {
            t: duration_s,
            s: end,
        },
    ];
    window
}

fn start(state: State<2>) -> Start<'static, 2> {
    Start {
        state,
        s: 0.0,
        resting: true,
        before: &[],
        end: 10.0,
        window_s: 1.0,
        old: None,
    }
}

fn check(run: &Run<'_, 2>, window: &mut Window<2>, travel: Option<&Travel<2>>) -> Checked {
    let state = window.pieces[0].state(0.0);
    Checker::default().check(run, &frame(), &[1.0; 2], &start(state), (window, travel))
}

fn assert_near(value: f64, expected: f64) {
    let most = 2e-4 * expected.abs().max(1e-3);
    assert!((value - expected).abs() < most, "{value}, not {expected}");
}

/// From rest to rest over 10 mm in T a quintic reaches 15/8·10/T, 10/√3·10/T² and, at its ends, 60·10/T³.
#[test]
fn what_is_checked_are_the_shares_of_all_limits() {
    let mut chords = path(&[[0.0, 0.0], [5.0, 0.0], [10.0, 0.0]], 50.0);
    for (t, off) in [(0.2_f64, 0.02), (0.15, 0.0)] {
        let mut window = rest_to_rest([0.0, off], [10.0, off], t, 10.0);
        let checked = check(&open(&chords), &mut window, None);
        assert_near(checked.speed, 18.75 / t / 50.0);
        let acceleration = 100.0 / 3.0_f64.sqrt() / (t * t);
        assert_near(checked.acceleration, acceleration / (1000.0 * ACCELERATION));
        assert_near(checked.jerk, 600.0 / t.powi(3) / (20_000.0 * JERK));
        // Between samples it may stand off by what the hull of its acceleration can do in a period.
        let bulge = 200.0 / (t * t) * PERIOD_S * PERIOD_S / 8.0;
        assert_near(checked.deviation, (off + bulge) / (ALLOWED * TOLERANCE));
        assert!(!checked.passes(), "{checked:?}");
    }
    // What is slow enough is known not to be above its limits, and no more than that.
    let mut window = rest_to_rest([0.0, 0.05], [10.0, 0.05], 1.0, 10.0);
    let checked = check(&open(&chords), &mut window, None);
    assert!(
        checked.passes() && checked.speed >= 18.75 / 50.0,
        "{checked:?}"
    );
    let mut window = rest_to_rest([0.0, 0.2], [10.0, 0.2], 1.0, 10.0);
    assert!(!check(&open(&chords), &mut window, None).passes());
    // A rapid has no feed, and the limits of rapids.
    for chord in &mut chords {
        chord.feed = f64::INFINITY;
    }
    let rapid = Run {
        rapid: true,
        ..open(&chords)
    };
    let mut window = rest_to_rest([0.0; 2], [10.0, 0.0], 0.08, 10.0);
    let speed = 18.75 / 0.08;
    assert_near(check(&rapid, &mut window, None).speed, speed / 200.0);
    assert_near(
        check(&open(&chords), &mut window, None).speed,
        speed / 100.0,
    );
}

/// Faster than the feed of the half that is slower: the motion is judged beside each chord, in eighths of the piece.
#[test]
fn a_piece_over_two_feeds_keeps_each_where_it_is() {
    let mut chords = path(&[[0.0, 0.0], [5.0, 0.0], [10.0, 0.0]], 50.0);
    chords[1].feed = 20.0;
    let t = 0.6_f64;
    let mut window = rest_to_rest([0.0; 2], [10.0, 0.0], t, 10.0);
    let checked = check(&open(&chords), &mut window, None);
    // Behind the vertex, which is passed in the middle, the next eighth.
    let share = 5.0_f64 / 8.0;
    let speed = 30.0 * (share * (1.0 - share)).powi(2) * 10.0 / t;
    assert_near(checked.speed, speed / 20.0);
    // The other way round the slow half is before it.
    chords.swap(0, 1);
    chords[0] = Chord {
        start: [0.0; 2],
        s: 0.0,
        ..chords[0]
    };
    chords[1] = Chord {
        start: [5.0, 0.0],
        s: 5.0,
        ..chords[1]
    };
    let checked = check(&open(&chords), &mut window, None);
    assert_near(checked.speed, speed / 20.0);
}

#[test]
fn a_motion_beyond_the_travel_is_beyond_it_by_as_much() {
    let chords = path(&[[0.0, 0.0], [10.0, 0.0]], 50.0);
    let axis = |max_mm: f64| tandem_sdk::AxisLimits {
        max_mm,
        ..tandem_rig::axis(1000.0)
    };
    let machine = tandem_rig::context(&[axis(9.9), axis(100.0)], PERIOD_S);
    let travel = Travel::new(&machine, &[1.0; 2]);
    let mut window = rest_to_rest([0.0; 2], [10.0, 0.0], 1.0, 10.0);
    let checked = check(&open(&chords), &mut window, Some(&travel));
    assert_near(checked.travel, 0.1);
    assert!(!checked.passes());
    let mut shorter = rest_to_rest([0.0; 2], [9.9, 0.0], 1.0, 9.9);
    let checked = check(&open(&chords), &mut shorter, Some(&travel));
    assert!(checked.passes(), "{checked:?}");
}

#[test]
fn what_is_too_large_alone_or_no_number_does_not_pass() {
    let kept = Checked {
        speed: 1.0,
        acceleration: 1.0,
        jerk: 1.0,
        deviation: 1.0,
        bulge: 0.0,
        travel: 0.0,
    };
    assert!(kept.passes());
    let set: [fn(&mut Checked, f64); 5] = [
        |checked, value| checked.speed = value,
        |checked, value| checked.acceleration = value,
        |checked, value| checked.jerk = value,
        |checked, value| checked.deviation = value,
        |checked, value| checked.travel = value,
    ];
    for set in set {
        for value in [1.0 + 1e-9, f64::INFINITY, f64::NAN] {
            let mut checked = kept;
            set(&mut checked, value);
            assert!(!checked.passes(), "{checked:?}");
            assert_eq!(checked.is_finite(), value.is_finite(), "{checked:?}");
        }
    }
    let chords = path(&[[0.0, 0.0], [10.0, 0.0]], 50.0);
    let mut window = rest_to_rest([0.0; 2], [10.0, 0.0], 1.0, 10.0);
    window.pieces[0].c[3][1] = f64::NAN;
    assert!(!check(&open(&chords), &mut window, None).passes());
    assert!(larger(1.0, f64::NAN).is_nan() && larger(f64::NAN, 1.0).is_nan());
    assert_eq!((larger(1.0, 2.0), larger(2.0, 1.0)), (2.0, 2.0));
    assert_eq!((smaller(1.0, 2.0), smaller(2.0, 1.0)), (1.0, 1.0));
}

/// From rest to rest on three lines that cut off the corner of [0, 5] and [5, 0].
fn over_a_corner(cut: f64) -> Window<2> {
    let rest = |at: [f64; 2]| [at, [0.0; 2], [0.0; 2]];
    let corners = [[0.0, 0.0], [5.0 - cut, 0.0], [5.0, cut], [5.0, 5.0]];
    let places = [0.0, 5.0 - cut, 5.0 + cut, 10.0];
    let mut window = Window::new();
    for (n, pair) in (0_u32..).zip(corners.windows(2)) {
        let piece = Piece::between(&rest(pair[0]), &rest(pair[1]), f64::from(n), 1.0);
        window.pieces.push(piece);
    }
    window.marks = (0_u32..)
        .zip(places)
        .map(|(n, s)| Mark { t: n.into(), s })
        .collect();
    window
}

/// The vertex stands off the diagonal between the places before and behind it.
#[test]
fn a_vertex_that_is_cut_off_counts_as_far_as_it_stands_off() {
    let chords = path(&[[0.0, 0.0], [5.0, 0.0], [5.0, 5.0]], 50.0);
    let run = open(&chords);
    for cut in [0.05, 0.1, 0.13, 0.15] {
        let mut window = over_a_corner(cut);
        let start = start(window.pieces[0].state(0.0));
        let mut checker = Checker::default();
        let found = (&mut window, None);
        let checked = checker.check(&run, &frame(), &[1.0; 2], &start, found);
        let allowed = ALLOWED * TOLERANCE;
        if checked.deviation <= 1.0 {
            let (off, bulge) = checker.vertices_off(&run, &start, &window, PERIOD_S);
            let vertex = cut / 2.0_f64.sqrt() / allowed;
            assert!(
                (vertex - 1e-9..vertex + 1e-3).contains(&off),
                "{vertex}: {off}"
            );
            assert_eq!(bulge, 0.0);
        }
        // In the middle the motion stands half of the cut off both lines, and the vertex off the line between these two feet.
        let between = (cut / 2.0 + cut / 8.0_f64.sqrt()) / allowed;
        assert!(
            between > 1.0 || (checked.deviation - between).abs() < 1e-3,
            "{between}: {checked:?}"
        );
        assert_eq!(checked.passes(), cut < 0.14, "{cut}: {checked:?}");
    }
}

/// On a path that turns back by `fold`, and back again, a motion straight along it meets both vertices. Where they are more than two
/// tolerances apart it is behind the place of the second when it comes near the first.
#[test]
fn a_motion_straight_through_a_fold_does_not_follow_it_where_that_is_longer_than_the_tolerance() {
    for (fold, passes) in [(0.1, true), (0.199, true), (0.201, false), (0.25, false)] {
        for back in 1..=4 {
            // The way back in one chord, or in several.
            let step = fold / f64::from(back);
            let way_back = (1..=back).map(|n| [5.0 - f64::from(n) * step, 0.0]);
            let mut points = vec![[0.0, 0.0], [5.0, 0.0]];
            points.extend(way_back);
            points.push([10.0, 0.0]);
            let chords = path(&points, 50.0);
            let end = chords[chords.len() - 1].end();
            // Many samples in the fold, or next to none.
            for duration_s in [1.0, 0.4] {
                let mut window = rest_to_rest([0.0; 2], [10.0, 0.0], duration_s, end);
                let checked = check(&open(&chords), &mut window, None);
                let follows = checked.deviation <= 1.0;
                assert_eq!(follows, passes, "{fold}: {checked:?}");
            }
        }
    }
}

#[test]
fn the_nearest_sample_is_looked_for_around_the_place_and_farther_while_it_is_too_far() {
    // Chords along X at these distances from the vertex; what leads from one to the next is far away.
    let nearest = |distances: &[f64], near: usize, among: (usize, usize)| {
        let samples = distances.iter().enumerate().flat_map(|(n, off)| {
            let far = if n % 2 == 0 { 1e3 } else { -1e3 };
            [[-far, *off], [far, *off]]
        });
        let checker = Checker::<2> {
            samples: samples.collect(),
            ..Checker::default()
        };
        let among = (2 * among.0, 2 * among.1);
        checker.nearest_sample(2 * near, among, &[0.0; 2], 1.0).0
    };
    let row = |middle: f64, next: f64, others: f64| {
        let mut row = [others; 9];
        row[3..6].copy_from_slice(&[next, middle, next]);
        row
    };
    // Near enough at once; then not, and the next one is nearer.
    assert_near(nearest(&row(0.3, 0.1, 0.1), 4, (0, 8)), 0.3);
    assert_near(nearest(&row(0.6, 0.4, 2.0), 4, (0, 8)), 0.4);
    // Within what is allowed nothing farther is looked for, beyond it is.
    assert_near(nearest(&row(0.94, 0.96, 0.5), 4, (0, 8)), 0.94);
    assert_near(nearest(&row(2.0, 2.0, 0.5), 4, (0, 8)), 0.5);
    // What is not among them does not count.
    assert_near(nearest(&row(0.1, 0.6, 2.0), 4, (5, 8)), 0.6);
    assert_near(nearest(&row(0.1, 0.6, 2.0), 4, (0, 3)), 0.6);
}

/// A brute search over the same samples never finds a nearer one where what was found is too far.
#[test]
fn no_nearer_sample_is_overlooked_where_it_matters() {
    let mut random = Random::from_the_clock();
    for _ in 0..2000 {
        let samples: Vec<[f64; 2]> = (0..20)
            .map(|n| [f64::from(n), random.between(-1.5, 1.5)])
            .collect();
        let first = random.below(10) as usize;
        let last = first + random.below(10) as usize;
        let near = random.below(20) as usize;
        let vertex = [random.between(0.0, 19.0), random.between(-1.5, 1.5)];
        let checker = Checker::<2> {
            samples,
            ..Checker::default()
        };
        let (found, link) = checker.nearest_sample(near, (first, last), &vertex, 1.0);
        let off = |n: usize| to_chord(&vertex, &checker.samples[n], &checker.samples[n + 1]);
        let least = |from: usize, to: usize| (from..=to).map(off).fold(f64::INFINITY, f64::min);
        let best = least(first, last.min(18)).sqrt();
        assert!(found >= best);
        assert_eq!(found, off(link).sqrt());
        assert!(
            found <= DEVIATION || found == best,
            "{found}, {best}: {near} in {first} to {last}"
        );
        // Three places on each side are looked at in any case, unless one is near enough.
        let at = near.clamp(first, last.min(18));
        let around = least(at.saturating_sub(3).max(first), (at + 3).min(last.min(18)));
        assert!(found <= around.sqrt() || found < NEAR_ENOUGH);
    }
}

/// From rest to rest in two samples, beside a line by a hundredth of its length: all of the acceleration is along it, but for as much.
#[test]
fn a_motion_that_brakes_within_a_sample_turns_no_more_than_it_does() {
    for off in [0.0, 0.01] {
        let mut window = rest_to_rest([0.0; 2], [1.0, 0.0], 2.0 * PERIOD_S, 1.0);
        // As far aside at its middle.
        let rest = [[0.0; 2]; 3];
        let aside = Piece::between(&rest, &[[0.0, off], [0.0; 2], [0.0; 2]], 0.0, PERIOD_S);
        let back = Piece::between(&rest, &[[0.0, -off], [0.0; 2], [0.0; 2]], 0.0, PERIOD_S);
        let middle = window.pieces[0].state(PERIOD_S);
        let end = window.pieces[0].state(2.0 * PERIOD_S);
        let halves = [([[0.0; 2]; 3], middle, aside), (middle, end, back)];
        window.pieces.clear();
        for (n, (from, to, across)) in (0_u32..).zip(halves) {
            let mut piece = Piece::between(&from, &to, f64::from(n) * PERIOD_S, PERIOD_S);
            for (c, of_across) in piece.c.iter_mut().zip(&across.c) {
                c[1] += of_across[1];
            }
            piece.c[0][1] += f64::from(n) * off;
            window.pieces.push(piece);
        }
        let size = |t: f64| {
            let a = window.state(t)[2];
            dot(&a, &a).sqrt()
        };
        let bend = (0..=200)
            .map(|n| size(f64::from(n) * 1e-5))
            .fold(0.0, larger);
        let checker = Checker::<2> {
            bends: vec![bend; 2],
            jerks: vec![1e12; 2],
            ..Checker::default()
        };
        let bulge = checker.bulge_around(&window, 0, PERIOD_S, PERIOD_S);
        let most = bend * PERIOD_S * PERIOD_S / 8.0;
        assert!(bulge <= 30.0 * off * most + 1e-12, "{bulge} of {most}");
        assert!(bulge >= 0.5 * off * most, "{bulge} of {most}");
    }
}

/// At 10 mm/s with 30 mm/s² along the motion and 40 across it, beside pieces of 100 mm/s² and a jerk of 2000.
#[test]
fn between_two_samples_counts_what_turns_the_motion() {
    let state = |v: f64, a: [f64; 2]| {
        let mut window = Window::<2>::new();
        for n in 0..4 {
            let mut piece = Piece::between(&[[0.0; 2]; 3], &[[0.0; 2]; 3], f64::from(n), 1.0);
            // Half a second on in piece 1 it has this state.
            piece.c[1] = if n == 1 {
                [v - 0.5 * a[0], -0.5 * a[1]]
            } else {
                [1e3; 2]
            };
            piece.c[2] = if n == 1 {
                [a[0] / 2.0, a[1] / 2.0]
            } else {
                [1e3; 2]
            };
            window.pieces.push(piece);
        }
        window
    };
    let checker = Checker::<2> {
        bends: vec![60.0, 50.0, 100.0, 1e6],
        jerks: vec![1e6, 2000.0, 1e6, 1e6],
        ..Checker::default()
    };
    let bulge =
        |v: f64, a: [f64; 2]| checker.bulge_around(&state(v, a), 1, 1.5, PERIOD_S) / (1e-6 / 8.0);
    // 40 across, 2 by the jerk of a period, and a turn of 0.01 of 100 mm/s².
    assert_near(bulge(10.0, [30.0, 40.0]), 43.0);
    assert_near(bulge(10.0, [-30.0, -40.0]), 43.0);
    assert_near(bulge(10.0, [30.0, 0.0]), 3.0);
    // Never more than all there is; at rest the direction is not known.
    assert_near(bulge(10.0, [0.0, 150.0]), 100.0);
    assert_near(bulge(1e-12, [1.0, 1.0]), 100.0);
    assert_near(bulge(0.5, [0.0, 1.0]), 1.0 + 2.0 + 20.0);
}

/// Along X in pieces of a quarter of a period, one of which turns: of the middle of piece 6 those from 2 to 10 lie within a period.
#[test]
fn between_two_samples_counts_what_lies_within_a_period_in_pieces_that_are_shorter() {
    const PIECES: u32 = 13;
    const NEAR: usize = 6;
    const PIECE_S: f64 = PERIOD_S / 4.0;
    const FAST: f64 = 1e6;
    let along_x = || {
        let mut window = Window::<2>::new();
        for n in 0..PIECES {
            let start_s = f64::from(n) * PIECE_S;
            let mut piece = Piece::between(&[[0.0; 2]; 3], &[[0.0; 2]; 3], start_s, PIECE_S);
            piece.c[0] = [FAST * start_s, 0.0];
            piece.c[1] = [FAST, 0.0];
            window.pieces.push(piece);
        }
        window
    };
    let bulge = |window: &Window<2>, bends: Vec<f64>| {
        let jerks = vec![1e12; bends.len()];
        let checker = Checker::<2> {
            bends,
            jerks,
            ..Checker::default()
        };
        let t = (NEAR as f64 + 0.5) * PIECE_S;
        checker.bulge_around(window, NEAR, t, PERIOD_S) / (PERIOD_S * PERIOD_S / 8.0)
    };
    for n in 0..PIECES as usize {
        let is_within = (2..=10).contains(&n);
        let mut window = along_x();
        window.pieces[n].c[2][1] = 25.0;
        let across = bulge(&window, vec![1000.0; PIECES as usize]);
        assert_near(across, if is_within { 50.0 } else { 0.0 });
        // The motion is at a twentieth of its speed across X in one piece: as much of the largest acceleration counts.
        let mut window = along_x();
        window.pieces[NEAR].c[1][1] = FAST / 20.0;
        let mut bends = vec![100.0; PIECES as usize];
        bends[n] = 1000.0;
        let turned = bulge(&window, bends);
        assert_near(turned, if is_within { 50.0 } else { 5.0 });
    }
}
