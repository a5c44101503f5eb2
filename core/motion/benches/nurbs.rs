//! The cost of evaluating a cubic curve in 3-D: `cargo bench -p tandem-motion`.

use divan::counter::ItemsCount;
use tandem_motion::nurbs::{ArcLength, Nurbs, Place};
use tandem_sdk::{Axes, AxisVector, NurbsData};

const POINTS: usize = 100;
const CALLS: usize = 1000;

fn main() {
    divan::main();
}

/// A rational cubic helix-like curve with uniform knots.
fn curve() -> Nurbs {
    let at = |i: usize| i as f64 * 0.7;
    let data = NurbsData {
        degree: 3,
        control_points: (0..POINTS)
            .map(|i| AxisVector::from_slice(&[20.0 * at(i).cos(), 20.0 * at(i).sin(), at(i)]))
            .collect(),
        weights: (0..POINTS).map(|i| 1.0 + (i % 3) as f64).collect(),
        knots: (0..POINTS + 4).map(|i| i.clamp(3, POINTS) as f64).collect(),
    };
    Nurbs::new(
        &data,
        &Axes::new(&[('X', false), ('Y', false), ('Z', false)]).unwrap(),
    )
    .unwrap()
}

/// Position and three derivatives by the parameter, the span known. An item is an evaluation.
#[divan::bench]
fn derivatives_in_span(bencher: divan::Bencher) {
    let curve = curve();
    bencher.counter(ItemsCount::new(CALLS)).bench_local(|| {
        for call in 0..CALLS {
            let u = 50.0 + call as f64 / CALLS as f64;
            divan::black_box(curve.derivatives_in(50, divan::black_box(u)));
        }
    });
}

/// The same with the span sought by marching.
#[divan::bench]
fn derivatives_marching(bencher: divan::Bencher) {
    let curve = curve();
    bencher.counter(ItemsCount::new(CALLS)).bench_local(|| {
        let mut span = 3;
        for call in 0..CALLS {
            let u = 3.0 + call as f64 * 90.0 / CALLS as f64;
            span = curve.span_from(span, u);
            divan::black_box(curve.derivatives_in(span, divan::black_box(u)));
        }
    });
}

/// Position and three derivatives by the arc length.
#[divan::bench]
fn along_path(bencher: divan::Bencher) {
    let curve = curve();
    let table = ArcLength::new(&curve);
    let step_mm = table.length().mm / CALLS as f64;
    bencher.counter(ItemsCount::new(CALLS)).bench_local(|| {
        let mut place = Place::default();
        for call in 0..CALLS {
            divan::black_box(table.along_path(&curve, call as f64 * step_mm, &mut place));
        }
    });
}

/// The table of a curve of 97 spans. An item is a span.
#[divan::bench]
fn arc_length_table(bencher: divan::Bencher) {
    let curve = curve();
    bencher
        .counter(ItemsCount::new(POINTS - 3))
        .bench_local(|| divan::black_box(ArcLength::new(&curve)));
}
