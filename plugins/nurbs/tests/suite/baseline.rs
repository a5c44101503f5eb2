//! The published baseline against its reference figures.

use crate::common;

use common::measure::{chord_error_mm, distance, realised_mm};
use common::{canonical, context, curve_block, run};
use tandem_motion::nurbs::{ArcLength, Nurbs, Place};
use tandem_rig::case;
use tandem_sdk::{Axes, SegmentFlags};

const PERIOD_S: f64 = 0.002;

#[test]
fn reference_figures() {
    let case = case("002_baseline");
    let rows = case["results"]
        .as_array()
        .unwrap()
        .iter()
        .filter(|row| row["update"] == "ARC");
    let mut count = 0;
    for row in rows {
        let name = row["curve"].as_str().unwrap();
        let (data, length_mm) = canonical(name);
        let curve = Nurbs::new(&data, &Axes::new(&[('X', false), ('Y', false)]).unwrap()).unwrap();
        let table = ArcLength::new(&curve);
        let block = curve_block(data, length_mm, 250.0);
        let collected = run("form = \"adaptive\"", &context(block.0.start), &[block]);
        let number = |key: &str| row[key].as_f64().unwrap();
        let close = |got: f64, key: &str, relative: f64| {
            assert!(
                (got - number(key)).abs() <= relative * number(key),
                "{name} {key}: {got} not {}",
                number(key)
            );
        };
        close(collected.duration_s(), "total_time_s", 1e-5);
        close(collected.reports[0].time_s, "total_time_s", 1e-5);
        close(collected.reports[0].peak_feed_mm_per_s, "feed_max", 1e-6);
        let samples = collected.path_samples(PERIOD_S);
        assert!(
            samples
                .len()
                .abs_diff(row["steps"].as_u64().unwrap() as usize + 1)
                <= 1,
            "{name}: {}",
            samples.len()
        );
        let whole = &samples[..samples.len() - 1];
        let feeds: Vec<f64> = whole
            .windows(2)
            .map(|pair| (pair[1].1 - pair[0].1) / PERIOD_S)
            .collect();
        close(
            feeds.iter().copied().fold(f64::INFINITY, f64::min),
            "feed_min",
            1e-4,
        );
        let accelerations: Vec<f64> = feeds
            .windows(2)
            .map(|pair| (pair[1] - pair[0]) / PERIOD_S)
            .collect();
        let largest = |values: &[f64]| values.iter().map(|v| v.abs()).fold(0.0, f64::max);
        close(largest(&accelerations), "max_abs_a_cmd", 0.01);
        let jerks: Vec<f64> = accelerations
            .windows(2)
            .map(|pair| (pair[1] - pair[0]) / PERIOD_S)
            .collect();
        close(largest(&jerks), "max_abs_j_cmd", 0.01);
        let errors = whole
            .windows(2)
            .map(|pair| chord_error_mm(&curve, &table, pair[0].1, pair[1].1));
        close(
            1000.0 * errors.fold(0.0, f64::max),
            "max_chord_err_um",
            0.05,
        );
        count += 1;
    }
    assert_eq!(count, 3);
}

#[test]
fn segments_follow_the_curve_and_each_other() {
    for name in ["butterfly", "trident", "infinity"] {
        let (data, length_mm) = canonical(name);
        let curve = Nurbs::new(&data, &Axes::new(&[('X', false), ('Y', false)]).unwrap()).unwrap();
        let table = ArcLength::new(&curve);
        let block = curve_block(data, length_mm, 250.0);
        let end = block.0.end;
        let collected = run("form = \"adaptive\"", &context(block.0.start), &[block]);
        let (mut place, mut before) = (Place::default(), None);
        for segment in &collected.segments {
            for share in [0.0, 0.13, 0.37, 0.62, 0.9, 1.0] {
                let t = share * segment.duration_s;
                let off = distance(
                    &segment.position(t),
                    &table.position(&curve, segment.path_mm(t), &mut place),
                );
                assert!(off < 5e-8, "{name}: {off:e}");
            }
            if let Some(before) = before.replace(segment.position(segment.duration_s)) {
                assert!(distance(&before, &segment.position(0.0)) < 1e-9);
            }
        }
        let last = collected.segments.last().unwrap();
        assert!(last.flags.contains(SegmentFlags::ENDS_AT_REST) && last.position(0.0) == end);
    }
}

/// Along the arc the feed of each period is that commanded, to 0.001 %.
#[test]
fn the_feed_does_not_fluctuate() {
    for name in ["butterfly", "trident"] {
        let (data, length_mm) = canonical(name);
        let curve = Nurbs::new(&data, &Axes::new(&[('X', false), ('Y', false)]).unwrap()).unwrap();
        let block = curve_block(data, length_mm, 250.0);
        let collected = run("form = \"adaptive\"", &context(block.0.start), &[block]);
        let samples = collected.path_samples(PERIOD_S);
        let samples = &samples[..samples.len() - 1];
        let realised = realised_mm(&curve, samples.iter().map(|(position, _)| *position));
        for (pair, realised_mm) in samples.windows(2).zip(realised) {
            let commanded_mm = pair[1].1 - pair[0].1;
            let off_mm = (realised_mm - commanded_mm).abs();
            assert!(
                off_mm < 1e-5 * commanded_mm,
                "{name}: {realised_mm} mm, not {commanded_mm}"
            );
        }
    }
}
