//! Arcs as programs write them.

use super::*;
use proptest::prelude::*;

fn ends(start: Point, end: Point, clockwise: bool) -> Ends {
    Ends {
        start,
        end,
        clockwise,
        turns: 1,
        tolerance_mm: tolerance_mm(1.0),
    }
}

fn one(parts: Result<Parts, Impossible>) -> ArcGeometry {
    let parts = parts.unwrap();
    assert_eq!(parts.as_slice().len(), 1);
    parts.as_slice()[0].arc
}

#[test]
fn quarter_and_full_circles() {
    let quarter = one(ends([10.0, 0.0], [0.0, 10.0], false).about([0.0, 0.0]));
    assert!((quarter.sweep_rad - PI / 2.0).abs() < 1e-15);
    let rest = one(ends([10.0, 0.0], [0.0, 10.0], true).about([0.0, 0.0]));
    assert!((rest.sweep_rad + 1.5 * PI).abs() < 1e-15);
    let full = one(ends([10.0, 0.0], [10.0, 0.0], true).about([0.0, 0.0]));
    assert_eq!(full.sweep_rad, -TAU);
    let three = one(Ends {
        turns: 3,
        ..ends([10.0, 0.0], [10.0, 0.0], false)
    }
    .about([0.0, 0.0]));
    assert_eq!(three.sweep_rad, 3.0 * TAU);
}

#[test]
fn radius_arcs_take_the_short_or_the_long_way() {
    let short = one(ends([10.0, 0.0], [0.0, 10.0], false).of_radius(10.0));
    assert!(
        distance(short.center_mm, [0.0, 0.0]) < 1e-12 && (short.sweep_rad - PI / 2.0).abs() < 1e-12
    );
    let long = one(ends([10.0, 0.0], [0.0, 10.0], false).of_radius(-10.0));
    assert!(
        distance(long.center_mm, [10.0, 10.0]) < 1e-12 && (long.sweep_rad - 1.5 * PI).abs() < 1e-12
    );
    let half = one(ends([10.0, 0.0], [-10.0, 0.0], true).of_radius(9.9999));
    assert!((half.radius_mm - 10.0).abs() < 1e-12 && (half.sweep_rad + PI).abs() < 1e-12);
    assert_eq!(
        ends([0.0, 0.0], [20.0, 0.0], true)
            .of_radius(9.0)
            .unwrap_err()
            .0,
        "arc-radius"
    );
    assert_eq!(
        ends([0.0, 0.0], [0.0, 0.0], true)
            .of_radius(9.0)
            .unwrap_err()
            .0,
        "arc-ends"
    );
}

#[test]
fn radii_may_differ_as_in_linuxcnc() {
    // An arc of a quarter, whose radius at the end is greater by `unlike`.
    let about = |radius: f64, unlike: f64, unit_mm| {
        Ends {
            tolerance_mm: tolerance_mm(unit_mm),
            ..ends([radius, 0.0], [0.0, radius + unlike], false)
        }
        .about([0.0, 0.0])
    };
    for (radius, unlike, unit_mm, fits) in [
        (10.0, 0.0282, 1.0, true),
        (10.0, 0.0284, 1.0, false),
        (10.0, 0.0718, 25.4, true),
        (10.0, 0.0719, 25.4, false),
        (100.0, 0.1, 1.0, true),
        (100.0, 0.1002, 1.0, false),
        (4000.0, 2.82, 1.0, true),
        (4000.0, 2.84, 1.0, false),
        (9000.0, 7.18, 25.4, true),
        (9000.0, 7.19, 25.4, false),
    ] {
        let parts = about(radius, unlike, unit_mm);
        assert_eq!(parts.is_ok(), fits, "{radius} {unlike}: {parts:?}");
        for part in parts.iter().flat_map(Parts::as_slice) {
            let off = (part.arc.radius_mm - radius - unlike / 2.0).abs();
            assert!(off <= unlike, "{part:?}");
        }
    }
    let (code, why) = about(10.0, 0.03, 1.0).unwrap_err();
    assert_eq!(code, "arc-radius");
    assert_eq!(
        why,
        "the arc does not fit: its radius is 10.0000 mm at the start and 10.0300 mm at the end"
    );
}

#[test]
fn extents_know_the_quadrants() {
    let arc = one(ends([10.0, 0.0], [0.0, -10.0], false).about([0.0, 0.0]));
    let part = Part {
        arc,
        start: [10.0, 0.0],
        end: [0.0, -10.0],
    };
    assert_eq!(extent(&part), [(-10.0, 10.0), (-10.0, 10.0)]);
    let arc = one(ends([10.0, 0.0], [0.0, 10.0], false).about([0.0, 0.0]));
    let part = Part {
        arc,
        start: [10.0, 0.0],
        end: [0.0, 10.0],
    };
    assert_eq!(extent(&part), [(0.0, 10.0), (0.0, 10.0)]);
}

#[test]
fn nearly_closed_arcs_stay_on_the_programmed_circle() {
    // Moving the centre alone would shift it by 0.06 mm here, and by the whole radius in the second case.
    for (end, turns) in [
        ([10.001, 0.2], 1),
        ([10.001, 0.2], 3),
        ([10.004, 0.0], 1),
        ([10.004, 0.0], 2),
    ] {
        let clockwise = end[1] > 0.0;
        let parts = Ends {
            turns,
            ..ends([10.0, 0.0], end, clockwise)
        }
        .about([0.0, 0.0])
        .unwrap();
        let [first, last] = parts.as_slice() else {
            panic!("{parts:?}")
        };
        assert_eq!(
            (first.start, first.end, last.end),
            ([10.0, 0.0], last.start, end)
        );
        for part in [first, last] {
            assert!(
                distance(part.arc.center_mm, [0.0, 0.0]) < 0.005
                    && (part.arc.radius_mm - 10.0).abs() < 0.005
            );
            assert!((distance(part.end, part.arc.center_mm) - part.arc.radius_mm).abs() < 1e-12);
        }
        let swept = first.arc.sweep_rad + last.arc.sweep_rad;
        assert!(
            (swept.abs() - TAU * f64::from(turns)).abs() < 0.03,
            "{swept}"
        );
    }
}

proptest! {
    /// Ends rounded to 0.001 mm: both lie on the circle of the arc, and sweeping it from the start meets the end.
    #[test]
    fn rounded_arcs_hold_together(
        r in 0.5..200.0f64, a in 0.0..TAU, sweep in 0.2..6.0f64, cx in -50.0..50.0f64, clockwise: bool,
    ) {
        let round = |v: f64| (v * 1000.0).round() / 1000.0;
        let at = |angle: f64| [round(cx + r * angle.cos()), round(r * angle.sin())];
        let b = if clockwise { a - sweep } else { a + sweep };
        let ends = ends(at(a), at(b), clockwise);
        let parts = ends.about([round(cx), 0.0]).unwrap();
        let mut at = ends.start;
        for part in parts.as_slice() {
            let arc = &part.arc;
            prop_assert_eq!(part.start, at);
            for end in [part.start, part.end] {
                prop_assert!((distance(end, arc.center_mm) - arc.radius_mm).abs() < 1e-9);
            }
            let last = arc.start_angle_rad + arc.sweep_rad;
            at = [arc.center_mm[0] + arc.radius_mm * last.cos(), arc.center_mm[1] + arc.radius_mm * last.sin()];
            prop_assert!(distance(at, part.end) < 1e-9);
            at = part.end;
        }
        prop_assert_eq!(at, ends.end);
        let swept: f64 = parts.as_slice().iter().map(|part| part.arc.sweep_rad.abs()).sum();
        prop_assert!((swept - sweep).abs() < 0.02);
    }
}
