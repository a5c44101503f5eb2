//! The form `scan` on the canonical curves: limits per axis on every sample, and the time against the best known.

mod common;

use common::{Collected, canonical, context, curve_block, run};
use tandem_motion::nurbs::{ArcLength, Nurbs, Place};
use tandem_sdk::{Axes, AxisVector, PlannerContext, SegmentFlags};

fn xy() -> Axes {
    Axes::new(&[('X', false), ('Y', false)]).unwrap()
}

/// Largest velocity, acceleration and jerk of each axis as a share of its limit, from rest to rest.
pub fn shares(collected: &Collected, context: &PlannerContext) -> [f64; 3] {
    let period_s = context.fine_period_s;
    let mut positions: Vec<AxisVector> = collected.samples(period_s).into_iter().map(|sample| sample.0).collect();
    let ends = [positions[0], positions[positions.len() - 1]];
    positions.splice(0..0, [ends[0]; 3]);
    positions.extend([ends[1]; 3]);
    let mut worst = [0.0f64; 3];
    for (axis, limits) in context.limits.axes().iter().enumerate() {
        let mut values: Vec<f64> = positions.iter().map(|p| p[axis]).collect();
        for (worst, limit) in
            worst.iter_mut().zip([limits.feed_mm_per_s, limits.acceleration_mm_per_s2, limits.jerk_mm_per_s3])
        {
            values = values.windows(2).map(|pair| (pair[1] - pair[0]) / period_s).collect();
            *worst = values.iter().fold(*worst, |most, value| most.max(value.abs() / limit));
        }
    }
    worst
}

fn chord_error_mm(curve: &Nurbs, table: &ArcLength, from: f64, to: f64) -> f64 {
    let mut place = Place::default();
    let ends = [from, to].map(|s| table.position(curve, s, &mut place));
    let along = ends[1] - ends[0];
    let squared: f64 = along.0.iter().map(|v| v * v).sum();
    if squared < 1e-18 {
        return 0.0;
    }
    let off = |share: f64| {
        let point = table.position(curve, from + share * (to - from), &mut Place::default()) - ends[0];
        let foot: f64 = point.0.iter().zip(along.0).map(|(a, b)| a * b).sum::<f64>() / squared;
        (point - along * foot).0.iter().map(|d| d * d).sum::<f64>().sqrt()
    };
    (1..20).map(|step| off(f64::from(step) / 20.0)).fold(0.0, f64::max)
}

#[test]
fn canonical_curves_are_driven_near_the_best_time() {
    for (name, best_s, most) in [("butterfly", 2.7529, 1.08), ("trident", 1.9212, 1.05), ("infinity", 5.3019, 1.05)] {
        let (data, length_mm) = canonical(name);
        let curve = Nurbs::new(&data, &xy()).unwrap();
        let table = ArcLength::new(&curve);
        let block = curve_block(data, length_mm, 250.0);
        let (context, end) = (context(block.facts().start), block.facts().end);
        let started = std::time::Instant::now();
        let collected = run("", &context, &[block]);
        let planning_s = started.elapsed().as_secs_f64();
        let rests = collected.segments.iter().filter(|s| s.flags.contains(SegmentFlags::ENDS_AT_REST)).count();
        let [velocity, acceleration, jerk] = shares(&collected, &context);
        let samples = collected.samples(context.fine_period_s);
        let chords = samples.windows(2).map(|pair| chord_error_mm(&curve, &table, pair[0].1, pair[1].1));
        let chord_um = 1000.0 * chords.fold(0.0, f64::max);
        let fastest =
            samples.windows(2).map(|pair| (pair[1].1 - pair[0].1) / context.fine_period_s).fold(0.0, f64::max);
        let ratio = collected.duration_s() / best_s;
        println!(
            "{name}: {:.4} s, {ratio:.4} of the best; velocity {velocity:.4}, acceleration {acceleration:.4}, jerk \
             {jerk:.4}, chord {chord_um:.4} um, {} segments, {rests} rests, planned {:.0} times as fast",
            collected.duration_s(),
            collected.segments.len(),
            collected.duration_s() / planning_s
        );
        let last = collected.segments.last().unwrap();
        assert!(last.flags.contains(SegmentFlags::ENDS_AT_REST) && last.position(0.0) == end);
        assert!(rests == 1, "{name}: {rests} rests");
        assert!(velocity <= 1.0 && acceleration <= 1.0 && jerk <= 1.0, "{name}: {velocity} {acceleration} {jerk}");
        assert!(fastest <= 250.0 * (1.0 + 1e-6), "{name}: {fastest}");
        assert!(chord_um <= 1.01, "{name}: {chord_um}");
        assert!(ratio <= most, "{name}: {ratio}");
    }
}
