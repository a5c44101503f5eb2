//! Against the crate `bspline`, which knows the recursion only: a rational curve is one of its polynomial curves in
//! homogeneous coordinates.

use std::ops::{Add, Mul};

use bspline::BSpline;
use proptest::prelude::*;
use tandem_sdk::{AxisVector, NurbsData};

use crate::common::{canonical, curve, distance};

#[derive(Clone, Copy)]
struct Homogeneous([f64; 4]);

impl Mul<f64> for Homogeneous {
    type Output = Self;
    fn mul(self, factor: f64) -> Self {
        Self(self.0.map(|v| v * factor))
    }
}

impl Add for Homogeneous {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self(std::array::from_fn(|i| self.0[i] + other.0[i]))
    }
}

fn theirs(data: &NurbsData) -> BSpline<Homogeneous, f64> {
    let points = data.control_points.iter().zip(&data.weights);
    let homogeneous = points
        .map(|(p, w)| Homogeneous([p[0] * w, p[1] * w, p[2] * w, *w]))
        .collect();
    BSpline::new(data.degree, homogeneous, data.knots.clone())
}

fn at(spline: &BSpline<Homogeneous, f64>, u: f64) -> AxisVector {
    let [x, y, z, w] = spline.point(u).0;
    AxisVector::from_slice(&[x / w, y / w, z / w])
}

#[test]
fn canonical_curves() {
    for name in ["butterfly", "trident", "infinity"] {
        let ours = canonical(name);
        let theirs = theirs(&ours.data());
        for step in 0..=1000 {
            let u = f64::from(step) / 1000.0;
            assert!(
                distance(&ours.position(u), &at(&theirs, u)) < 1e-10,
                "{name} at {u}"
            );
        }
    }
}

prop_compose! {
    /// A curve with knots of any multiplicity up to the degree, unclamped ones among them.
    pub fn any_curve()(degree in 1usize..=5)(
        degree in Just(degree),
        points in prop::collection::vec(prop::array::uniform3(-100.0..100.0f64), degree + 1..14),
        steps in prop::collection::vec(0usize..4, 30),
        weights in prop::collection::vec(-4.0..4.0f64, 14),
        clamp in any::<bool>(),
    ) -> NurbsData {
        let count = points.len();
        let mut knots = vec![0.0f64];
        for index in 1..=count + degree {
            // A knot more often than the degree would break the curve.
            let run = knots.iter().rev().take_while(|k| **k == knots[index - 1]).count();
            let step = if steps[index] == 0 && run < degree { 0.0 } else { 0.3 + steps[index] as f64 };
            knots.push(knots[index - 1] + step);
        }
        if clamp {
            let (low, high) = (knots[degree], knots[count]);
            knots[..degree].fill(low);
            knots[count + 1..].fill(high);
        }
        let control_points = points.iter().map(|p| AxisVector::from_slice(p)).collect();
        NurbsData { degree, control_points, weights: weights[..count].iter().map(|w| w.exp2()).collect(), knots }
    }
}

proptest! {
    #[test]
    fn any_degree_weights_and_knots(data in any_curve(), share in 0.0..1.0f64) {
        prop_assume!(data.knots[data.degree] < data.knots[data.control_points.len()]);
        prop_assume!(tandem_motion::nurbs::Nurbs::new(&data, &crate::common::axes()).is_ok());
        let ours = curve(&data);
        let (from, to) = ours.range();
        let u = from + share * (to - from);
        let theirs = theirs(&data);
        prop_assert!(distance(&ours.position(u), &at(&theirs, u)) < 1e-9);
    }
}
