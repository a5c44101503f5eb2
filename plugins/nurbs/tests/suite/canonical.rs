//! The forms with windows on the canonical curves: limits on every sample, and the time against the best known.

use crate::common;

use common::measure::{BEST_S, Figures, figures};
use common::{canonical, context, curve_block, run};
use tandem_rig::case;
use tandem_sdk::{AxisVector, Block, BlockKind, SegmentFlags};

fn drive(form: &str, name: &str) -> Figures {
    let (data, length_mm) = canonical(name);
    let block = curve_block(data.clone(), length_mm, 250.0);
    let (context, end) = (context(block.0.start), block.0.end);
    let collected = run(&format!("form = \"{form}\""), &context, &[block]);
    let last = collected.segments.last().unwrap();
    assert!(last.flags.contains(SegmentFlags::ENDS_AT_REST) && last.position(0.0) == end);
    let figures = figures(&collected, &data, &context);
    println!(
        "{form} {name}: {figures:?}, {} segments",
        collected.segments.len()
    );
    // The fine loop looks at single points of the segments, and answers where they exceed the jerk by more than 1 %.
    let (mut start_s, mut worst) = (0.0, (0.0, 0.0));
    for segment in &collected.segments {
        for t in [0.0, 0.5, 1.0].map(|share| share * segment.duration_s) {
            for c in &segment.coefficients {
                let jerk = (6.0 * c[3] + t * (24.0 * c[4] + t * 60.0 * c[5])).abs() / 4e5;
                worst = if jerk > worst.0 {
                    (jerk, start_s + t)
                } else {
                    worst
                };
            }
        }
        start_s += segment.duration_s;
    }
    assert!(
        worst.0 <= 1.01,
        "{form} {name}: {:.4} of the jerk at {:.4} s",
        worst.0,
        worst.1
    );
    figures
}

fn drive_baseline(name: &str) -> Figures {
    let (data, length_mm) = canonical(name);
    let block = curve_block(data.clone(), length_mm, 250.0);
    let context = context(block.0.start);
    figures(
        &run("form = \"adaptive\"", &context, &[block]),
        &data,
        &context,
    )
}

/// What holds for both: limits per axis and of the chord, feed, one rest at the end, and the realised arc.
fn assert_limits(figures: &Figures, name: &str) {
    let [velocity, acceleration, jerk] = figures.axis;
    assert!(
        velocity <= 1000.0 && acceleration <= 5000.0 && jerk <= 4e5,
        "{name}: {figures:?}"
    );
    assert!(
        figures.path[0] <= 250.0 * (1.0 + 1e-6),
        "{name}: {figures:?}"
    );
    assert!(
        figures.chord_um <= 1.01 && figures.fluctuation < 1e-5 && figures.rests == 1,
        "{name}: {figures:?}"
    );
}

#[test]
fn scan_keeps_the_limits_of_the_axes_near_the_best_time() {
    for ((name, _, best_s), most) in BEST_S.into_iter().zip([1.08, 1.05, 1.05]) {
        let figures = drive("scan", name);
        assert_limits(&figures, name);
        assert!(
            figures.time_s <= most * best_s,
            "{name}: {}",
            figures.time_s / best_s
        );
    }
}

#[test]
fn windowed_keeps_the_limits_along_the_path_too() {
    for ((name, best_s, _), most) in BEST_S.into_iter().zip([1.15, 1.08, 1.03]) {
        let figures = drive("windowed", name);
        assert_limits(&figures, name);
        let [_, acceleration, jerk] = figures.path;
        assert!(acceleration <= 5000.0 && jerk <= 4e5, "{name}: {figures:?}");
        // The jerk of the baseline, start and stop counted, is about a hundred times that.
        let baseline = drive_baseline(name);
        assert!(
            jerk < baseline.path[2] / 90.0 && baseline.path[1] > 5000.0,
            "{name}: {baseline:?}"
        );
        assert!(
            figures.time_s <= most * best_s,
            "{name}: {}",
            figures.time_s / best_s
        );
    }
}

/// From rest to rest in a line, against the closed form of the fastest motion under limits of the axes.
#[test]
fn lines_take_the_shortest_time() {
    for row in case("002_line")["cases"]
        .as_array()
        .unwrap()
        .iter()
        .filter(|row| row["limits"] == "axis")
    {
        let number = |key: &str| row[key].as_f64().unwrap();
        let (length_mm, angle) = (number("L_mm"), number("angle_deg").to_radians());
        let mut block = Block::at(AxisVector::ZERO);
        block.end = AxisVector::from_slice(&[length_mm * angle.cos(), length_mm * angle.sin()]);
        (block.kind, block.length_mm, block.feed_mm_per_s) = (BlockKind::Line, length_mm, 250.0);
        for (form, most) in [("scan", 1.03), ("windowed", 1.15)] {
            let block = (block, None);
            let collected = run(
                &format!("form = \"{form}\""),
                &context(AxisVector::ZERO),
                &[block],
            );
            let ratio = collected.duration_s() / number("T_closed_form_s");
            assert!(ratio > 0.999 && ratio < most, "{form} {row}: {ratio}");
        }
    }
}
