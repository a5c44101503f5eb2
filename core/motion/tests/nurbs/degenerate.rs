//! Curves at the edge of what is one.

use tandem_motion::nurbs::{ArcLength, Nurbs, NurbsError, Place};
use tandem_sdk::{Axes, AxisVector, NurbsData};

use crate::common::{axes, clamped, curve, distance};

/// Every place of the table lies on the curve and steps by what was asked for.
fn assert_even(data: &NurbsData) {
    let curve = curve(data);
    let table = ArcLength::new(&curve);
    let (mut place, steps) = (Place::default(), 2000);
    let step_mm = table.length().mm / f64::from(steps);
    let mut before = table.position(&curve, 0.0, &mut place);
    for step in 1..=steps {
        let at = table.position(&curve, step_mm * f64::from(step), &mut place);
        let moved = distance(&at, &before);
        assert!(
            moved <= step_mm + 1e-8,
            "{step}: {moved} instead of {step_mm}"
        );
        before = at;
    }
    assert!(distance(&before, &data.control_points[data.control_points.len() - 1]) < 1e-9);
}

const ZIGZAG: [[f64; 3]; 6] = [
    [0.0, 0.0, 0.0],
    [5.0, 9.0, 0.0],
    [10.0, -3.0, 1.0],
    [15.0, 4.0, 2.0],
    [22.0, 0.0, 2.0],
    [30.0, 5.0, 0.0],
];

#[test]
fn coinciding_control_points() {
    for (at, count) in [(0, 2), (0, 3), (2, 2), (2, 3), (5, 2), (5, 3)] {
        let mut points = ZIGZAG.to_vec();
        for _ in 1..count {
            points.insert(at, ZIGZAG[at]);
        }
        assert_even(&clamped(3, &points, &vec![1.0; points.len()]));
    }
}

#[test]
fn a_cusp_inside_a_span() {
    // The control polygon of a cubic that crosses itself so that C′(1/2) = 0.
    assert_even(&clamped(
        3,
        &[
            [0.0, 0.0, 0.0],
            [1.0, 1.0, 0.0],
            [0.0, 1.0, 0.0],
            [1.0, 0.0, 0.0],
        ],
        &[1.0; 4],
    ));
}

#[test]
fn weights_far_apart() {
    assert_even(&clamped(3, &ZIGZAG, &[1.0, 1e4, 1.0, 1e4, 1.0, 1.0]));
    assert_even(&clamped(5, &ZIGZAG, &[1e-4, 1.0, 1e-4, 1.0, 1.0, 1.0]));
    let refused = Nurbs::new(
        &clamped(3, &ZIGZAG, &[1.0, 1e7, 1.0, 1.0, 1.0, 1.0]),
        &axes(),
    )
    .unwrap_err();
    assert!(refused.to_string().contains("1.0e7"), "{refused}");
}

/// With weights that rise or fall a hundredfold most of the curve lies in a small part of the parameter, turns with it.
#[test]
fn bounds_and_feet_where_the_parameter_is_uneven() {
    let rising = [
        [0.0, 0.0, 0.0],
        [130.0, 1.0, 5.0],
        [-130.0, 2.0, -5.0],
        [0.0, 3.0, 0.0],
        [1.0, 4.0, 0.0],
    ];
    let bends = [
        [77.0, 58.0, 0.0],
        [33.0, -21.0, 0.0],
        [-66.0, -88.0, 0.0],
        [86.0, -43.0, 0.0],
        [-71.0, 83.0, 1.0],
    ];
    for (degree, points, weights) in [
        (4, &rising, [1.0, 1e2, 1e4, 1e6, 1e6]),
        (4, &rising, [1e6, 1e6, 1e4, 1e2, 1.0]),
        (2, &bends, [1.0, 73.0, 1.8, 0.13, 0.04]),
        (3, &bends, [0.04, 86.0, 0.04, 3.0, 300.0]),
    ] {
        let curve = curve(&clamped(degree, points, &weights));
        let table = ArcLength::new(&curve);
        let step_mm = table.length().mm / 3000.0;
        let (mut place, mut least, mut most) =
            (Place::default(), [f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
        for step in 0..=3000 {
            let at = table.position(&curve, f64::from(step) * step_mm, &mut place);
            let nearest = curve.nearest(&at, 0, curve.points());
            assert!(
                nearest.distance_mm < 1e-6,
                "degree {degree}, {weights:?}: {nearest:?} at {at:?}"
            );
            let mut beside = at;
            beside[2] += 20.0;
            assert!(curve.nearest(&beside, 0, curve.points()).distance_mm <= 20.0 / 0.99);
            for axis in 0..3 {
                (least[axis], most[axis]) = (least[axis].min(at[axis]), most[axis].max(at[axis]));
            }
        }
        for axis in 0..3 {
            let (low, high) = curve.extent(axis);
            assert!(
                low <= least[axis] + 1e-8 && high >= most[axis] - 1e-8,
                "{axis}: {low} {high} {least:?} {most:?}"
            );
            assert!(
                low > least[axis] - 0.1 && high < most[axis] + 0.1,
                "{axis}: {low} {high} {least:?} {most:?}"
            );
        }
    }
}

#[test]
fn a_corner_inside_cuts_the_curve() {
    let mut data = clamped(3, &ZIGZAG, &[1.0; 6]);
    data.knots = vec![0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 2.0, 2.0, 2.0, 2.0];
    assert_eq!(curve(&data).pieces().len(), 1);
    let mut points = ZIGZAG.to_vec();
    points.push([35.0, 5.0, 0.0]);
    let mut data = clamped(3, &points, &[1.0; 7]);
    data.knots = vec![0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 2.0, 2.0, 2.0, 2.0];
    let pieces = curve(&data).pieces();
    assert_eq!(
        pieces.iter().map(|p| p.range).collect::<Vec<_>>(),
        [(0.0, 1.0), (1.0, 2.0)]
    );
    let chord = AxisVector::from_slice(&ZIGZAG[3]) - AxisVector::from_slice(&ZIGZAG[2]);
    let unit = chord * (1.0 / distance(&chord, &AxisVector::ZERO));
    assert!(distance(&pieces[0].end_direction, &unit) < 1e-12);
    let chord = AxisVector::from_slice(&ZIGZAG[4]) - AxisVector::from_slice(&ZIGZAG[3]);
    let unit = chord * (1.0 / distance(&chord, &AxisVector::ZERO));
    assert!(distance(&pieces[1].start_direction, &unit) < 1e-12);
}

/// Just before a square corner the foot lies before it, though the direction behind it says there is nothing to gain.
#[test]
fn the_foot_of_a_point_before_a_corner() {
    let mut data = clamped(
        2,
        &[
            [0.0, 0.0, 0.0],
            [0.0, 2.0, 0.0],
            [4.0, 2.0, 0.0],
            [4.0, 0.0, 0.0],
            [6.0, 0.0, 0.0],
        ],
        &[1.0; 5],
    );
    data.knots = vec![0.0, 0.0, 0.0, 1.0, 1.0, 2.0, 2.0, 2.0];
    let curve = curve(&data);
    for step in 1..200 {
        let u = f64::from(step) / 100.0;
        let nearest = curve.nearest(&curve.position(u), 0, curve.points());
        assert!(nearest.distance_mm < 1e-9, "{u}: {nearest:?}");
    }
}

/// 10·(1 − u)² − 20·u·(1 − u) + 5·u² = 0, the derivative of the cubic with these points over 3.
#[test]
fn turns_back_on_a_line_cut_the_curve() {
    let way = [0.6, 0.0, 0.8];
    let points = [0.0, 10.0, 0.0, 5.0].map(|x: f64| way.map(|w| w * x));
    for weights in [[1.0; 4], [2.0; 4]] {
        let curve = curve(&clamped(3, &points, &weights));
        let turns = [
            (20.0 - 50.0f64.sqrt()) / 35.0,
            (20.0 + 50.0f64.sqrt()) / 35.0,
        ];
        let pieces = curve.pieces();
        let ranges: Vec<_> = pieces.iter().map(|p| p.range).collect();
        assert_eq!(ranges.len(), 3, "{ranges:?}");
        for (piece, (from, to)) in
            pieces
                .iter()
                .zip([(0.0, turns[0]), (turns[0], turns[1]), (turns[1], 1.0)])
        {
            assert!(
                (piece.range.0 - from).abs() < 1e-12 && (piece.range.1 - to).abs() < 1e-12,
                "{ranges:?}"
            );
        }
        let lengths = pieces.iter().map(|piece| {
            let table = ArcLength::of_piece(&curve, piece);
            let length_mm = table.length().mm;
            let [from, to] = [piece.range.0, piece.range.1].map(|u| curve.position(u));
            assert!((distance(&from, &to) - length_mm).abs() < 1e-9);
            // The derivatives are those of the line up to both ends, where the parameter stands still.
            for share in [0.0, 1e-12, 0.3, 1.0] {
                let at = table
                    .along_path(&curve, share * length_mm, &mut Place::default())
                    .unwrap();
                assert!(
                    distance(&at.direction, &piece.start_direction) < 1e-12
                        && at.curvature == AxisVector::ZERO
                );
                assert!(distance(&at.position, &(from + (to - from) * share)) < 1e-9);
            }
            length_mm
        });
        let (sum_mm, whole) = (lengths.sum::<f64>(), curve.length());
        assert!(
            (sum_mm - whole.mm).abs() < 1e-9 + whole.error_mm,
            "{sum_mm} {whole:?}"
        );
    }
}

/// With weights far apart the first derivative holds for the smallest part of a span only: it does not tell the direction.
#[test]
fn corners_between_heavy_and_light_points_cut_the_curve() {
    let points = [
        [0.0, 0.0, 0.0],
        [0.77, 1.55, 0.0],
        [-0.86, -1.72, 0.0],
        [-0.48, -0.97, 0.0],
        [-0.5, -1.0, 0.0],
    ];
    let pieces = curve(&clamped(1, &points, &[0.032, 0.0078, 0.0024, 28.8, 0.0013])).pieces();
    assert_eq!(
        pieces.iter().map(|p| p.range).collect::<Vec<_>>(),
        [(0.0, 1.0), (1.0, 2.0), (2.0, 3.0), (3.0, 4.0)]
    );
}

#[test]
fn a_straight_span_without_a_turn_is_not_cut() {
    // It slows down to a stand in the middle of its parameter, and goes on the same way.
    let still = [
        [0.0, 0.0, 0.0],
        [3.0, 0.0, 0.0],
        [3.0, 0.0, 0.0],
        [6.0, 0.0, 0.0],
    ];
    assert_eq!(curve(&clamped(3, &still, &[1.0; 4])).pieces().len(), 1);
    // Off the line by more than rounding it is a hairpin, no turn.
    let hairpin = [
        [0.0, 0.0, 0.0],
        [10.0, 1e-5, 0.0],
        [0.0, 1e-5, 0.0],
        [5.0, 0.0, 0.0],
    ];
    assert_eq!(curve(&clamped(3, &hairpin, &[1.0; 4])).pieces().len(), 1);
}

#[test]
fn hairpins_are_found_by_their_radius() {
    // x turns where 105 u² − 120 u + 30 = 0; the radii there are 1.5e-12 mm and 6e-12 mm.
    let points = [
        [0.0, 0.0, 0.0],
        [10.0, 1e-5, 0.0],
        [0.0, 1e-5, 0.0],
        [5.0, 0.0, 0.0],
    ];
    let hairpin = curve(&clamped(3, &points, &[1.0; 4]));
    let found = hairpin.hairpins((0.0, 1.0), 1e-9);
    assert_eq!(found.len(), 2);
    for (u, turn) in found.iter().zip([0.369_398_1, 0.773_459_1]) {
        assert!((u - turn).abs() < 1e-6, "{u} {turn}");
    }
    assert!(hairpin.hairpins((0.0, 1.0), 1e-13).is_empty());
    assert_eq!(hairpin.hairpins((0.5, 1.0), 1e-9), found[1..]);
    // Standing still in the parameter and going on the same way is none, nor is a smooth turn.
    let still = [
        [0.0, 0.0, 0.0],
        [3.0, 0.0, 0.0],
        [3.0, 0.0, 0.0],
        [6.0, 0.0, 0.0],
    ];
    assert!(
        curve(&clamped(3, &still, &[1.0; 4]))
            .hairpins((0.0, 1.0), 1e-9)
            .is_empty()
    );
    assert!(
        curve(&clamped(3, &ZIGZAG, &[1.0; 6]))
            .hairpins((0.0, 1.0), 1e-9)
            .is_empty()
    );
}

/// At the knot between the first two spans the curve stands still, and the first one turns back 4e-9 mm before it: there its speed
/// falls, rises and falls again between two of the even places at which it is looked at.
#[test]
fn a_hairpin_beside_a_standstill_at_a_knot_is_found() {
    let points = [
        [45.16, 0.19, 0.0],
        [43.90, 1.39, 0.0],
        [43.92, 1.37, 0.0],
        [43.89, 1.40, 0.0],
        [45.06, 0.29, 0.0],
        [42.50, 2.73, 0.0],
    ];
    let points = points.map(|point| point.map(|x| 1e-3 * x));
    let curve = curve(&clamped(3, &points, &[1.0; 6]));
    let (from, to) = curve.range();
    let share = |u: &f64| (u - from) / (to - from);
    let found = curve.hairpins((from, to), 1e-9);
    assert_eq!(found.len(), 2, "{found:?}");
    for (u, turn) in found.iter().zip([0.984_018_4, 1.066_583_3]) {
        assert!((3.0 * share(u) - turn).abs() < 1e-6, "{u} {turn}");
    }
    let pieces = curve.pieces();
    assert_eq!(pieces.len(), 2);
    assert_eq!(curve.stands_still_at_ends(&pieces[0]), [false, true]);
    assert_eq!(curve.stands_still_at_ends(&pieces[1]), [true, false]);
}

#[test]
fn control_points_on_a_corner_cut_the_curve() {
    let points = [
        [0.0, 0.0, 0.0],
        [5.0, 0.0, 0.0],
        [10.0, 0.0, 0.0],
        [10.0, 0.0, 0.0],
        [10.0, 0.0, 0.0],
        [10.0, 5.0, 0.0],
        [10.0, 9.0, 0.0],
    ];
    let pieces = curve(&clamped(3, &points, &[1.0; 7])).pieces();
    assert_eq!(pieces.len(), 2);
    assert!(
        (pieces[0].end_direction[0] - 1.0).abs() < 1e-12
            && (pieces[1].start_direction[1] - 1.0).abs() < 1e-12
    );
}

/// The span from 0.3 to 0.5 is straight and lies within some hundredths of a millimetre, far from zero: what rounding leaves
/// of coordinates is more than 1e-13 of that, and looked like turn after turn.
#[test]
fn a_turn_beside_a_heavy_control_point_is_found() {
    let near = [-0.0009, 0.0, 0.0];
    let points = [
        [-27.05, -7.8378, 0.0],
        near,
        near,
        [17.49, 4.0, -17.0],
        near,
        near,
        [-0.0009, -3.0, -2.0],
        [-26.0, 33.09, 7.118],
    ];
    let mut data = clamped(4, &points, &[1.0, 1.0, 1.0, 1000.0, 2.0, 0.5, 1.0, 1.0]);
    data.knots = [vec![0.0; 5], vec![0.3, 0.5, 0.9], vec![1.0; 5]].concat();
    let turns = curve(&data).turning_points();
    assert!(
        turns.len() == 1 && turns[0] > 0.3 && turns[0] < 0.5,
        "{turns:?}"
    );
}

/// Where more control points coincide than the degree the curve waits at a point: that span is no piece.
#[test]
fn a_span_without_length_is_left_out() {
    let corner = [10.0, 0.0, 0.0];
    let points = [
        [0.0; 3],
        [0.0; 3],
        [0.0; 3],
        corner,
        corner,
        corner,
        [20.0, 10.0, 0.0],
    ];
    let pieces = curve(&clamped(2, &points, &[1.0, 1.0, 3.0, 1.0, 7.0, 1.0, 1.0])).pieces();
    assert_eq!(
        pieces.iter().map(|p| p.range).collect::<Vec<_>>(),
        [(1.0, 3.0), (4.0, 5.0)]
    );
    assert!((pieces[0].end_direction[0] - 1.0).abs() < 1e-12);
    assert!((pieces[1].start_direction[1] - 0.5f64.sqrt()).abs() < 1e-12);
}

#[test]
fn knots_that_leave_out_an_end_are_refused() {
    let mut data = clamped(2, &ZIGZAG[..4], &[1.0; 4]);
    for knots in [
        [0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0],
        [0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0],
    ] {
        data.knots = knots.to_vec();
        assert!(matches!(
            Nurbs::new(&data, &axes()).unwrap_err(),
            NurbsError::End {
                count: 4,
                degree: 2,
                ..
            }
        ));
    }
}

#[test]
fn a_span_that_only_turns_is_refused() {
    let axes = Axes::new(&[('X', false), ('Y', false), ('A', true)]).unwrap();
    let points = [
        [0.0, 0.0, 0.0],
        [1.0, 0.0, 0.1],
        [1.0, 0.0, 0.2],
        [1.0, 0.0, 0.3],
        [2.0, 0.0, 0.3],
    ];
    let refused = Nurbs::new(&clamped(2, &points, &[1.0; 5]), &axes).unwrap_err();
    assert_eq!(refused, NurbsError::NotCounted { from: 1.0, to: 2.0 });
}

/// For an instant, at a knot inside, at the start or at the end: beside it A would turn any angle in no length.
#[test]
fn instants_that_only_turn_are_found() {
    let axes = Axes::new(&[('X', false), ('Y', false), ('A', true)]).unwrap();
    let at = |degree: usize, points: &[[f64; 3]]| {
        Nurbs::new(&clamped(degree, points, &vec![1.0; points.len()]), &axes)
            .unwrap()
            .turns_alone()
    };
    assert_eq!(
        at(
            2,
            &[
                [0.0, 0.0, 0.0],
                [1.0, 0.0, 0.1],
                [1.0, 0.0, 0.2],
                [2.0, 1.0, 0.3]
            ]
        ),
        Some(1.0)
    );
    assert_eq!(
        at(
            3,
            &[
                [0.0; 3],
                [1.0, 0.0, 0.1],
                [1.0, 0.0, 0.2],
                [1.0, 0.0, 0.3],
                [2.0, 0.0, 0.3]
            ]
        ),
        Some(1.0)
    );
    assert_eq!(
        at(2, &[[0.0, 0.0, 0.0], [0.0, 0.0, 0.1], [1.0, 0.0, 0.2]]),
        Some(0.0)
    );
    assert_eq!(
        at(2, &[[0.0, 0.0, 0.0], [1.0, 0.0, 0.1], [1.0, 0.0, 0.2]]),
        Some(1.0)
    );
    // All stand still; and A alone, which then counts.
    assert_eq!(at(2, &[[0.0; 3], [0.0; 3], [1.0, 0.0, 0.2]]), None);
    assert_eq!(at(2, &[[0.0; 3], [0.0, 0.0, 0.1], [0.0, 0.0, 0.3]]), None);
    assert_eq!(at(2, &[[0.0; 3], [1.0, 0.0, 0.1], [2.0, 3.0, 0.3]]), None);
}

/// On this curve an 8-point rule over a quarter of a span and its halves agree to 1e-13 by chance, 4e-9 mm off.
#[test]
fn a_chance_agreement_is_not_taken_for_accuracy() {
    let points = [
        [0.0, 0.0, 0.0],
        [
            68.082_265_058_323_09,
            13.062_950_827_115_419,
            -3.191_860_096_595_357_6,
        ],
        [
            -46.281_779_250_372_8,
            -3.231_281_306_209_422_3,
            -48.135_597_597_138_51,
        ],
        [
            -96.741_770_751_754_37,
            31.004_114_116_558_72,
            -41.920_154_141_043_106,
        ],
    ];
    let mut data = clamped(
        2,
        &points,
        &[
            1.0,
            1.572_447_149_881_072,
            0.201_808_637_666_060_1,
            0.785_928_957_674_693_3,
        ],
    );
    data.knots = vec![
        0.0,
        0.0,
        0.3,
        2.599_999_999_999_999_6,
        4.899_999_999_999_999_5,
        6.2,
        6.2,
    ];
    let curve = curve(&data);
    for span in [2, 3] {
        let (from, to) = (curve.knots()[span], curve.knots()[span + 1]);
        let border = |part: u32| from + (to - from) * f64::from(part) / 1024.0;
        let fine: f64 = (0..1024)
            .map(|part| curve.length_in(span, border(part), border(part + 1)).mm)
            .sum();
        assert!((curve.length_in(span, from, to).mm - fine).abs() < 1e-11);
    }
}

#[test]
fn ten_thousand_control_points() {
    let points: Vec<[f64; 3]> = (0..10_000u32)
        .map(|i| {
            [
                f64::from(i) * 0.1,
                (f64::from(i) * 0.37).sin() * 3.0,
                (f64::from(i) * 0.11).cos(),
            ]
        })
        .collect();
    let curve = curve(&clamped(3, &points, &vec![1.0; points.len()]));
    let table = ArcLength::new(&curve);
    assert!(
        table.length().mm > 1000.0 && table.parts() < 200_000,
        "{} parts",
        table.parts()
    );
    assert!((curve.length().mm - table.length().mm).abs() < 1e-7);
}

#[test]
fn refusals_say_why() {
    let good = clamped(3, &ZIGZAG, &[1.0; 6]);
    let refusal = |change: &dyn Fn(&mut NurbsData)| {
        let mut data = good.clone();
        change(&mut data);
        Nurbs::new(&data, &axes()).unwrap_err()
    };
    assert_eq!(refusal(&|d| d.degree = 6), NurbsError::Degree(6));
    assert_eq!(
        refusal(&|d| d.control_points.truncate(3)),
        NurbsError::Points {
            degree: 3,
            points: 3
        }
    );
    assert_eq!(
        refusal(&|d| d.weights[2] = 0.0),
        NurbsError::Weight {
            index: 2,
            value: 0.0
        }
    );
    assert_eq!(
        refusal(&|d| d.weights.truncate(5)),
        NurbsError::Weights {
            points: 6,
            weights: 5
        }
    );
    assert_eq!(
        refusal(&|d| d.knots[5] = 0.5),
        NurbsError::Knot {
            index: 5,
            value: 0.5,
            before: 1.0
        }
    );
    assert!(
        refusal(&|d| d.knots.truncate(9))
            .to_string()
            .contains("need 10 knots")
    );
    assert_eq!(refusal(&|d| d.knots.fill(1.0)), NurbsError::Empty(1.0));
    assert_eq!(
        refusal(&|d| d.control_points[4][1] = f64::NAN),
        NurbsError::Point(4)
    );
    assert_eq!(
        refusal(&|d| d.control_points.fill(AxisVector::ZERO)),
        NurbsError::NoLength
    );
    assert!(
        refusal(&|d| d.knots[5] = 1.0 + 1e-12)
            .to_string()
            .contains("differ by")
    );
    let mut broken = clamped(1, &ZIGZAG, &[1.0; 6]);
    broken.knots[3] = broken.knots[2];
    assert!(matches!(
        Nurbs::new(&broken, &axes()),
        Err(NurbsError::Multiplicity { count: 2, .. })
    ));
}

#[test]
fn rotary_axes_count_where_nothing_else_moves() {
    let axes = Axes::new(&[('X', false), ('A', true)]).unwrap();
    let mut data = clamped(
        2,
        &[[0.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 2.0, 0.0]],
        &[1.0; 3],
    );
    assert!((Nurbs::new(&data, &axes).unwrap().length().mm - 2.0).abs() < 1e-12);
    data.control_points[2][0] = 3.0;
    assert!((Nurbs::new(&data, &axes).unwrap().length().mm - 3.0).abs() < 1e-9);
}
