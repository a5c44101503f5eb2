//! The nearest and the first point of a piece, against a search through many of its points.

use proptest::prelude::*;

use super::{Arc, Line, Nurbs, Shape};
use crate::{Position, geometry::distance};

const STEPS: usize = 4000;

fn at(x: f64, y: f64, z: f64) -> Position {
    [x, y, z, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]
}

fn arc(radius_mm: f64, start_rad: f64, sweep_rad: f64, rise_mm: f64) -> Shape {
    let (from, along, plane, center_mm) = (
        at(0.0, 0.0, 1.0),
        at(0.0, 0.0, rise_mm),
        [0, 1],
        [1.0, -2.0],
    );
    Shape::Arc(Arc {
        from,
        along,
        plane,
        center_mm,
        radius_mm,
        start_rad,
        sweep_rad,
    })
}

/// Lines, arcs and helices of a radius from 1 to 20 mm, as the reader cuts them.
fn shapes() -> impl Strategy<Value = Shape> {
    let coordinate = || -10.0..10.0_f64;
    let line = [coordinate(), coordinate(), coordinate()]
        .prop_map(|[x, y, z]| Shape::Line(Line::new(at(1.0, 1.0, 1.0), at(x, y, z))));
    let curved = (
        1.0..20.0_f64,
        -3.0..3.0_f64,
        0.05..0.39_f64,
        any::<bool>(),
        prop_oneof![Just(0.0), -5.0..5.0_f64],
    );
    let curved = curved.prop_map(|(radius_mm, start_rad, sweep_rad, clockwise, rise_mm)| {
        arc(
            radius_mm,
            start_rad,
            if clockwise { -sweep_rad } else { sweep_rad },
            rise_mm,
        )
    });
    prop_oneof![line, curved, curves()]
}

/// A piece of a rational curve of any degree.
fn curves() -> impl Strategy<Value = Shape> {
    let point =
        [-10.0..10.0_f64, -10.0..10.0_f64, -10.0..10.0_f64].prop_map(|[x, y, z]| at(x, y, z));
    let points = prop::collection::vec((point, 0.3..3.0_f64), 2..=6);
    (points, any::<prop::sample::Index>()).prop_map(|(points, which)| {
        let order = points.len();
        let knots = (0..2 * order)
            .map(|index| if index < order { 0.0 } else { 1.0 })
            .collect();
        let (points, weights) = points.into_iter().unzip();
        let pieces = Nurbs {
            degree: order - 1,
            points,
            weights,
            knots,
        }
        .pieces();
        Shape::Curve(which.get(&pieces).clone())
    })
}

fn fractions() -> impl Iterator<Item = f64> {
    (0..=STEPS).map(|step| step as f64 / STEPS as f64)
}

proptest! {
    #[test]
    fn nearest_and_first(shape in shapes(), near in -0.2..1.2_f64, off in [-0.4..0.4_f64, -0.4..0.4, -0.4..0.4], low in 0.0..0.9_f64) {
        let mut point = shape.at(near);
        (0..3).for_each(|axis| point[axis] += off[axis]);
        let searched = || fractions().filter(|&fraction| fraction >= low);
        let off_mm = |fraction: f64| distance(&shape.at(fraction), &point);
        let best_mm = searched().map(off_mm).fold(f64::INFINITY, f64::min);
        let (fraction, nearest_mm) = shape.nearest(&point, low, 1.0);
        prop_assert!(fraction >= low && nearest_mm <= best_mm + 1e-9, "{nearest_mm} {best_mm}");
        prop_assert!((off_mm(fraction) - nearest_mm).abs() < 1e-12);

        let reach_mm = nearest_mm + 0.1;
        let first = shape.first_within(&point, reach_mm, low).expect("the nearest point is within reach");
        prop_assert!(off_mm(first) <= reach_mm + 1e-12);
        let before = searched().find(|&fraction| off_mm(fraction) <= reach_mm).unwrap_or(1.0);
        prop_assert!(first <= before + 1e-3, "{first} {before}");
        prop_assert!(shape.first_within(&point, nearest_mm - 1e-9, low).is_none());
    }

    #[test]
    fn travelled_back_it_is_the_same_piece(shape in shapes(), fraction in 0.0..1.0_f64) {
        prop_assert!(distance(&shape.reversed().at(fraction), &shape.at(1.0 - fraction)) < 1e-12);
        prop_assert!((shape.reversed().length_mm() - shape.length_mm()).abs() < 1e-12);
        let length_mm: f64 = fractions().skip(1).zip(fractions()).map(|(to, from)| distance(&shape.at(to), &shape.at(from))).sum();
        prop_assert!((length_mm - shape.length_mm()).abs() < 1e-7 * length_mm.max(1.0));
    }
}

#[test]
fn a_point_half_way_to_the_axis_of_a_helix() {
    let helix = arc(10.0, 0.3, 0.39, 3.0);
    let middle = helix.at(0.6);
    let inside = at(
        f64::midpoint(middle[0], 1.0),
        f64::midpoint(middle[1], -2.0),
        middle[2],
    );
    let (fraction, off_mm) = helix.nearest(&inside, 0.0, 1.0);
    assert!(
        (fraction - 0.6).abs() < 1e-12 && (off_mm - 5.0).abs() < 1e-12,
        "{fraction} {off_mm}"
    );
}
