//! Random programs: a correct run passes, and no single sample can be moved without being found.

use crate::common;

use std::fmt::Write;

use common::{at, smooth_machine, stop_at_all, trace, verdict};
use proptest::prelude::*;
use tandem_oracle::{Options, Position, judge};

/// Corners on a grid of 0.1 mm; successive ones at least a millimetre apart.
fn corners() -> impl Strategy<Value = Vec<Position>> {
    let coordinate = || (-300..300_i32).prop_map(|tenths| f64::from(tenths) / 10.0);
    let corner = (coordinate(), coordinate(), coordinate()).prop_map(|(x, y, z)| at(x, y, z));
    prop::collection::vec(corner, 1..6).prop_map(|corners| {
        let mut points = vec![at(0.0, 0.0, 0.0)];
        for corner in corners {
            if common::gap(&points[points.len() - 1], &corner) > 1.0 {
                points.push(corner);
            }
        }
        points
    })
}

fn program(points: &[Position], feed_mm_per_s: f64) -> String {
    let mut text = format!("G21 G90 F{}\n", feed_mm_per_s * 60.0);
    for [x, y, z, ..] in points.iter().skip(1) {
        writeln!(text, "G1X{x}Y{y}Z{z}").expect("a string takes all");
    }
    text + "M2\n"
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn moving_one_sample_turns_the_verdict(
        points in corners(),
        feed in 5.0..200.0_f64,
        which in any::<prop::sample::Index>(),
        axis in 0..3_usize,
        up in any::<bool>(),
    ) {
        let feed = (feed * 60.0).round() / 60.0;
        let program = program(&points, feed);
        let mut samples = if points.len() > 1 { stop_at_all(&points, feed, 999.0) } else { vec![points[0]; 5] };
        let options = Options { sample_tolerance_mm: Some(2e-6), ..Options::default() };
        let good = judge(&trace(&samples), &program, &smooth_machine(), &options);
        prop_assert!(good.passed(), "{program}{good}");
        prop_assert!(good.maxima.sample_deviation_mm < 1e-11, "{program}{good}");
        let index = which.index(samples.len());
        samples[index][axis] += if up { 1e-3 } else { -1e-3 };
        let bad = verdict(&samples, &program);
        prop_assert!(!bad.passed(), "sample {index}\n{program}{bad}");
        prop_assert!(bad.findings.iter().any(|finding| finding.sample.abs_diff(index) <= 3), "{index}\n{bad}");
    }

    #[test]
    fn no_text_makes_the_reader_panic(text in "[GXYZIJKRFMNP0-9. ()%/;#\\-\n]{0,200}") {
        let _ = verdict(&[at(0.0, 0.0, 0.0); 3], &text);
    }
}
