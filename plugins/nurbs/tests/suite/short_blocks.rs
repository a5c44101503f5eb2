//! Blocks so short that many of them are driven in a fine period, some in less time than a segment may have.

use crate::common;

use common::run;
use tandem_rig::line;
use tandem_sdk::{AxisLimits, AxisVector, PlannerContext, SegmentFlags};

/// A machine that drives a tenth of a micrometre in a fraction of a microsecond.
fn fast() -> PlannerContext {
    let axis = AxisLimits {
        feed_mm_per_s: 600.0,
        jerk_mm_per_s3: 2e7,
        ..tandem_rig::axis(1e5)
    };
    tandem_rig::context(&[axis; 2], 1e-3)
}

#[test]
fn blocks_that_take_less_time_than_a_segment_are_driven_and_reported() {
    for form in ["scan", "windowed"] {
        for count in [3, 40, 63, 400] {
            for length in [1e-4, 3e-4, 2e-3] {
                let at = |n: usize| {
                    AxisVector::from_slice(&[0.6 * length * n as f64, 0.8 * length * n as f64])
                };
                let blocks: Vec<_> = (0..count)
                    .map(|n| {
                        let mut block = line(&at(n), &at(n + 1), 500.0);
                        (block.index, block.line) = (n as u64, n as u32 + 1);
                        (block, None)
                    })
                    .collect();
                let driven = run(&format!("form = \"{form}\""), &fast(), &blocks);
                let what = format!("{form}, {count} of {length} mm");
                let last = driven.segments.last().unwrap();
                assert!(last.flags.contains(SegmentFlags::ENDS_AT_REST), "{what}");
                assert_eq!(last.position(0.0), at(count), "{what}");
                assert_eq!(driven.reports.len(), count, "{what}");
            }
        }
    }
}

#[test]
fn a_rotary_axis_that_turns_on_blocks_of_a_ten_millionth_of_a_millimetre_is_driven() {
    let limits = |speed, acceleration, jerk| AxisLimits {
        feed_mm_per_s: speed,
        jerk_mm_per_s3: jerk,
        ..tandem_rig::axis(acceleration)
    };
    let axes = [
        limits(20.0, 1000.0, 5e4),
        limits(20.0, 1000.0, 5e4),
        limits(20.0, 1000.0, 5e4),
        limits(0.3, 20.0, 300.0),
    ];
    let context = tandem_rig::context(&axes, 1e-3);
    for form in ["scan", "windowed"] {
        let at = |n: usize| AxisVector::from_slice(&[7e-8 * n as f64, 0.0, 0.0, 2e-4 * n as f64]);
        let blocks: Vec<_> = (0..30)
            .map(|n| {
                let mut block = line(&at(n), &at(n + 1), 5.0);
                (block.index, block.line) = (n as u64, n as u32 + 1);
                (block, None)
            })
            .collect();
        let driven = run(&format!("form = \"{form}\""), &context, &blocks);
        assert_eq!(driven.end(), at(30), "{form}");
        assert_eq!(driven.reports.len(), 30, "{form}");
        let rests = driven
            .segments
            .iter()
            .filter(|s| s.flags.contains(SegmentFlags::ENDS_AT_REST))
            .count();
        assert_eq!(rests, 1, "{form}: they lie on one line");
        // With a jerk of 300 rad/s³ from rest to rest alone 0.008 rad take the rotary axis 0.09 s.
        assert!(
            driven.duration_s() < 0.2,
            "{form}: {} s",
            driven.duration_s()
        );
    }
}

#[test]
fn the_last_nanometre_before_a_rest_is_driven_where_jerk_is_low() {
    let slow = AxisLimits {
        feed_mm_per_s: 160.0,
        jerk_mm_per_s3: 90.0,
        ..tandem_rig::axis(3e4)
    };
    let context = PlannerContext {
        rough_period_s: 0.125e-3,
        ..tandem_rig::context(&[slow; 2], 0.125e-3)
    };
    for form in ["scan", "windowed"] {
        let end = AxisVector::from_slice(&[-15.0]);
        let block = (line(&AxisVector::ZERO, &end, 500.0), None);
        let driven = run(&format!("form = \"{form}\""), &context, &[block]);
        assert_eq!(driven.end(), end, "{form}");
        let last = driven
            .segments
            .iter()
            .rfind(|segment| segment.duration_s > 0.0)
            .unwrap();
        let left = last.velocity(last.duration_s)[0].abs();
        assert!(left < 1e-9, "{form}: {left} mm/s at the rest");
    }
}

/// Over 400 mm of one axis another turns by 0.17 rad: at 0.16 rad/s² it leaves the first one all of its acceleration.
#[test]
fn a_slow_axis_that_moves_little_on_a_long_line_does_not_make_it_slow() {
    let limits = |speed, acceleration, jerk| AxisLimits {
        feed_mm_per_s: speed,
        jerk_mm_per_s3: jerk,
        ..tandem_rig::axis(acceleration)
    };
    let axes = [limits(600.0, 300.0, 1e4), limits(2.0, 0.16, 1e4)];
    let context = tandem_rig::context(&axes, 1e-3);
    for form in ["scan", "windowed"] {
        let end = AxisVector::from_slice(&[400.0, 0.17]);
        let block = line(&AxisVector::ZERO, &end, 150.0);
        let driven = run(&format!("form = \"{form}\""), &context, &[(block, None)]);
        // At 150 mm/s, and twice half of the time in which that is built up.
        let least_s = 400.0 / 150.0 + 150.0 / 300.0;
        let took_s = driven.duration_s();
        assert!(took_s < 1.2 * least_s, "{form}: {took_s} s for {least_s}");
    }
}
