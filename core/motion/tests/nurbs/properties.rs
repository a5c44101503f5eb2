//! What must hold of every curve.

use proptest::prelude::*;
use tandem_motion::nurbs::{ArcLength, Nurbs, Place};
use tandem_sdk::{Axes, AxisVector, NurbsData};

use crate::common::{axes, circle, curve, distance};
use crate::independent::any_curve;

fn made(data: &NurbsData) -> Option<Nurbs> {
    Nurbs::new(data, &axes()).ok()
}

/// A parameter in the middle part of a span, away from its knots.
fn inside(curve: &Nurbs, share: f64) -> (usize, f64, f64) {
    let (from, to) = curve.range();
    let span = curve.span(from + share * (to - from));
    let (low, high) = (curve.knots()[span], curve.knots()[span + 1]);
    (span, low + (0.1 + 0.8 * share) * (high - low), high - low)
}

proptest! {
    #[test]
    fn derivatives_match_differences(data in any_curve(), share in 0.0..1.0f64) {
        let Some(curve) = made(&data) else { return Ok(()) };
        let (span, u, width) = inside(&curve, share);
        let h = 1e-4 * width;
        let [before, at, behind] = [u - h, u, u + h].map(|u| curve.derivatives_in(span, u));
        let check = |low: AxisVector, high: AxisVector, rate: AxisVector, scale: f64| {
            let difference = (high - low) * (0.5 / h);
            distance(&difference, &rate) <= 1e-4 * (scale + distance(&rate, &AxisVector::ZERO))
        };
        let size = |v: &AxisVector| distance(v, &AxisVector::ZERO);
        prop_assert!(check(before.position, behind.position, at.first, size(&at.third) * width * width));
        prop_assert!(check(before.first, behind.first, at.second, size(&at.first) / width + size(&at.third) * width));
        let scale = (size(&at.first) / width + size(&at.second)) / width;
        prop_assert!(check(before.second, behind.second, at.third, 20.0 * scale));
    }

    #[test]
    fn the_curve_moves_with_its_points(
        data in any_curve(), share in 0.0..1.0f64, turn in -3.0..3.0f64, shift in -50.0..50.0f64,
    ) {
        let Some(curve) = made(&data) else { return Ok(()) };
        let (sin, cos) = turn.sin_cos();
        let map = |p: &AxisVector| {
            AxisVector::from_slice(&[2.0 * cos * p[0] - sin * p[1] + shift, sin * p[0] + cos * p[1], p[2] - p[0]])
        };
        let mut moved = data.clone();
        moved.control_points = data.control_points.iter().map(map).collect();
        let Some(moved) = made(&moved) else { return Ok(()) };
        let (_, u, _) = inside(&curve, share);
        prop_assert!(distance(&moved.position(u), &map(&curve.position(u))) < 1e-9);
    }

    #[test]
    fn the_curve_stays_within_its_points(
        data in any_curve(), share in 0.0..1.0f64, direction in prop::array::uniform3(-1.0..1.0f64),
    ) {
        let Some(curve) = made(&data) else { return Ok(()) };
        let (span, u, _) = inside(&curve, share);
        let height = |p: &AxisVector| (0..3).map(|i| p[i] * direction[i]).sum::<f64>();
        let heights = data.control_points[span - data.degree..=span].iter().map(height);
        let (low, high) = heights.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
        let at = height(&curve.position(u));
        prop_assert!(at >= low - 1e-9 && at <= high + 1e-9);
    }

    #[test]
    fn a_further_knot_leaves_the_curve(data in any_curve(), share in 0.01..0.99f64, at in 0.0..1.0f64) {
        let Some(curve) = made(&data) else { return Ok(()) };
        let (from, to) = curve.range();
        let mut refined = curve.clone();
        let u = from + share * (to - from);
        for _ in 0..data.degree {
            let Ok(next) = refined.insert_knot(u) else { break };
            refined = next;
        }
        prop_assert!(refined.points() > curve.points());
        let v = from + at * (to - from);
        prop_assert!(distance(&refined.position(v), &curve.position(v)) < 1e-9);
        prop_assert!((refined.length().mm - curve.length().mm).abs() < 1e-7);
    }

    #[test]
    fn arc_length_and_parameter_are_inverse(data in any_curve(), share in 0.0..1.0f64) {
        let Some(curve) = made(&data) else { return Ok(()) };
        let table = ArcLength::new(&curve);
        let length = table.length();
        prop_assert!((length.mm - curve.length().mm).abs() <= 1e-9 + length.error_mm);
        let s = share * length.mm;
        let (u, _) = table.parameter(s, &mut Place::default());
        prop_assert!((table.length_at(&curve, u) - s).abs() < 5e-8 + length.error_mm, "{} {}", table.length_at(&curve, u), s);
    }

    #[test]
    fn derivatives_by_arc_length_match_differences(data in any_curve(), share in 0.0..1.0f64) {
        let Some(curve) = made(&data) else { return Ok(()) };
        let (span, u, _) = inside(&curve, share);
        let Some(at) = curve.along_path_in(span, u) else { return Ok(()) };
        let h = 1e-6 / at.parameter[0].abs().max(1e-3);
        let ds = h / at.parameter[0];
        let ends = [u - h, u + h].map(|u| curve.along_path_in(span, u).unwrap());
        let size = |v: &AxisVector| distance(v, &AxisVector::ZERO);
        let bend = (ends[1].direction - ends[0].direction) * (0.5 / ds);
        prop_assert!(distance(&bend, &at.curvature) <= 1e-3 * (1.0 + size(&at.curvature) + size(&at.third)));
        prop_assert!((size(&at.direction) - 1.0).abs() < 1e-12);
        let curvature = curve.curvature(&curve.derivatives_in(span, u)).unwrap();
        prop_assert!((curvature - size(&at.curvature)).abs() <= 1e-9 * (1.0 + size(&at.curvature)));
    }

    /// Curves in the first three axes are evaluated with half the lanes of others.
    #[test]
    fn other_axes_have_the_same_curve(data in any_curve(), share in 0.0..1.0f64) {
        let Some(curve) = made(&data) else { return Ok(()) };
        let away = |v: &AxisVector| AxisVector::from_slice(&[0.0, 0.0, 0.0, v[0], v[1], v[2]]);
        let moved = NurbsData { control_points: data.control_points.iter().map(away).collect(), ..data.clone() };
        let letters = ['X', 'Y', 'Z', 'U', 'V', 'W'].map(|letter| (letter, false));
        let moved = Nurbs::new(&moved, &Axes::new(&letters).unwrap()).unwrap();
        let (span, u, _) = inside(&curve, share);
        let [here, there] = [&curve, &moved].map(|curve| curve.derivatives_in(span, u));
        prop_assert_eq!(away(&here.position), there.position);
        prop_assert_eq!(away(&here.third), there.third);
        prop_assert_eq!(curve.speed_in(span, u), moved.speed_in(span, u));
        let along = [&curve, &moved].map(|curve| curve.along_path_in(span, u).map(|at| (at.third, at.parameter)));
        prop_assert_eq!(along[0].map(|(third, parameter)| (away(&third), parameter)), along[1]);
        let speed = curve.speed_in(span, u);
        prop_assert!((speed - curve.counted_length(&here.first)).abs() <= 1e-9 * (1.0 + speed));
    }

    #[test]
    fn a_point_of_the_curve_is_at_no_distance(data in any_curve(), share in 0.0..1.0f64) {
        let Some(curve) = made(&data) else { return Ok(()) };
        let (span, u, _) = inside(&curve, share);
        let nearest = curve.nearest(&curve.position(u), span, span);
        prop_assert!(nearest.distance_mm < 1e-6, "{nearest:?}");
    }
}

#[test]
fn a_circle_has_its_length_and_curvature() {
    for radius in [0.01, 1.0, 50.0] {
        let circle = curve(&circle(radius));
        let table = ArcLength::new(&circle);
        assert!(
            (table.length().mm - std::f64::consts::TAU * radius).abs() < 1e-9 * radius.max(1.0)
        );
        assert_eq!(circle.pieces().len(), 1);
        for step in 0..100 {
            let s = f64::from(step) / 100.0 * table.length().mm;
            let at = table.along_path(&circle, s, &mut Place::default()).unwrap();
            let angle = s / radius;
            let on = AxisVector::from_slice(&[radius * angle.cos(), radius * angle.sin()]);
            assert!(
                distance(&at.position, &on) < 5e-8,
                "{radius} {s}: {}",
                distance(&at.position, &on)
            );
            assert!((distance(&at.curvature, &AxisVector::ZERO) * radius - 1.0).abs() < 1e-8);
        }
    }
}
