//! Driving allocates nothing once the memory for windows is there: what a curve needs is allocated when it is accepted.

mod common;
#[path = "../../../tests/counting_allocator.rs"]
mod counting_allocator;

use common::{context, curve_block};
use counting_allocator::heap_use_of;
use tandem_motion::nurbs::{ArcLength, Nurbs};
use tandem_nurbs::{NurbsPlanner, Options};
use tandem_rig::{Away, Offer};
use tandem_sdk::{AxisVector, NurbsData, Planner};

/// A wave of so many spans.
fn wave(spans: u32) -> NurbsData {
    let count = spans + 3;
    let point =
        |n: u32| AxisVector::from_slice(&[0.05 * f64::from(n), 2.0 * (0.05 * f64::from(n)).sin()]);
    let mut knots = vec![0.0; 3];
    knots.extend((0..=count - 3).map(f64::from));
    knots.extend([f64::from(count - 3); 3]);
    let control_points: Vec<AxisVector> = (0..count).map(point).collect();
    NurbsData {
        degree: 3,
        weights: vec![1.0; control_points.len()],
        control_points,
        knots,
    }
}

fn drive(planner: &mut NurbsPlanner) -> f64 {
    let mut driven = Away::default();
    planner.finish();
    while planner.advance(0.008, &mut driven).unwrap().done == 0 {}
    driven.duration_s
}

#[test]
fn a_long_curve_is_driven_in_memory_that_is_there() {
    for form in ["adaptive", "windowed", "scan"] {
        let block = curve_block(wave(10_000), 1.0, 100.0);
        let options = Options::parse(&format!("form = \"{form}\"")).unwrap();
        let start = block.0.start;
        let mut planner = NurbsPlanner::new(&options, &context(start)).unwrap();
        let accepting = heap_use_of(|| assert!(block.offer(&mut planner).is_ok()));
        assert!(accepting.allocations > 0, "the counter counts");
        let first_s = drive(&mut planner);
        // Windows change places with each other: each of them has to have held the largest.
        for _ in 0..4 {
            planner.reset(&start);
            block.offer(&mut planner).unwrap();
            drive(&mut planner);
        }
        planner.reset(&start);
        block.offer(&mut planner).unwrap();
        let mut again_s = 0.0;
        let steady = heap_use_of(|| again_s = drive(&mut planner));
        assert_eq!(steady.allocations, 0, "{form}");
        assert!(
            (first_s - again_s).abs() < 1e-9 && first_s > 7.0,
            "{form}: {first_s} s, {again_s} s"
        );
    }
}

/// What a curve takes goes with its spans and with nothing else.
#[test]
fn the_table_takes_the_same_for_every_span() {
    let axes = context(AxisVector::ZERO).axes;
    let bytes = [1_000, 10_000].map(|spans| {
        let curve = Nurbs::new(&wave(spans), &axes).unwrap();
        let tables = curve
            .pieces()
            .iter()
            .map(|piece| ArcLength::of_piece(&curve, piece).bytes())
            .sum::<usize>();
        tables as f64 / f64::from(spans)
    });
    println!("{bytes:?} bytes a span");
    assert!(
        (bytes[0] / bytes[1] - 1.0).abs() < 0.02 && bytes[1] < 600.0,
        "{bytes:?} bytes a span"
    );
}
