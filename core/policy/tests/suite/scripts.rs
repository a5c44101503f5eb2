//! The scripts that come with the machine, as they are built.

use tandem_policy::{Bounds, Budget, Facts, Instance, Period, Policy};
use tandem_sdk::{AxisVector, Block, BlockKind};

use crate::{chain, compile, decide, read, start};

#[test]
fn corner_time_constant_keeps_the_error_it_is_told() {
    let bytes = read("scripts/policies/corner-time-constant.wasm");
    for error_um in [10.0, 20.0, 100.0] {
        let mut policy = start(&bytes, &[("corner_error_um", error_um)]).unwrap();
        let degrees = [0.0, 0.0, 20.0, 110.0, 80.0, 80.0];
        let blocks = chain(&degrees);
        decide(&mut policy, &blocks);
        assert_eq!(
            policy.tuning(0).time_constant_s,
            None,
            "straight on: the constant in force is the longest"
        );
        for (index, pair) in degrees.windows(2).enumerate() {
            let turn_rad = (pair[1] - pair[0]).to_radians().abs();
            for block in [index, index + 1] {
                let tuning = policy.tuning(block);
                let constant_s = tuning.time_constant_s.unwrap_or(0.05);
                let feed = tuning.feed_cap_mm_per_s.unwrap_or(50.0);
                let error = feed * constant_s * (turn_rad / 2.0).sin() / 4.0 * 1e3;
                assert!(
                    error <= error_um * 1.000_001,
                    "{error} of {error_um} um at the turn {index}"
                );
            }
        }
    }
}

#[test]
fn gentle_start_comes_up_over_a_length_and_begins_again_after_a_rapid() {
    let mut policy = start(
        &read("scripts/policies/gentle-start.wasm"),
        &[("ramp_mm", 20.0)],
    )
    .unwrap();
    let mut blocks = chain(&[0.0; 4]);
    blocks[3].tool = 9;
    decide(&mut policy, &blocks);
    let caps: Vec<_> = (0..4)
        .map(|index| policy.tuning(index).feed_cap_mm_per_s)
        .collect();
    assert_eq!(caps, [Some(20.0), Some(35.0), None, Some(20.0)]);
    let rapid = Block {
        kind: BlockKind::Rapid,
        feed_mm_per_s: f64::INFINITY,
        ..blocks[3]
    };
    decide(&mut policy, &[rapid, blocks[3]]);
    assert_eq!(
        (
            policy.tuning(0).feed_cap_mm_per_s,
            policy.tuning(1).feed_cap_mm_per_s
        ),
        (None, Some(20.0))
    );
}

#[test]
fn load_feed_takes_feed_away_at_once_and_gives_it_back_slowly() {
    let mut policy = start(
        &read("scripts/policies/load-feed.wasm"),
        &[("lowest_ratio", 0.2)],
    )
    .unwrap();
    let mut ratio = |torque: f64| {
        let period = Period {
            cutting_torque_nm: torque,
            reference_torque_nm: 2.0,
            duration_s: 0.1,
            ..Period::default()
        };
        policy.period(&period).unwrap()
    };
    assert_eq!(ratio(1.0), 1.0);
    assert_eq!(ratio(4.0), 0.5);
    assert!((ratio(0.0) - 0.55).abs() < 1e-12 && (ratio(0.0) - 0.6).abs() < 1e-12);
    assert_eq!(ratio(100.0), 0.2);
}

#[test]
fn load_feed_goes_by_the_motor_current_where_no_torque_is_estimated() {
    let mut policy = start(
        &read("scripts/policies/load-feed.wasm"),
        &[("reference_current_a", 5.0)],
    )
    .unwrap();
    let mut period = Period {
        duration_s: 0.008,
        ..Period::default()
    };
    period.current_a[1] = 10.0;
    assert_eq!(policy.period(&period), Some(0.5));
}

#[test]
fn material_feed_caps_by_the_table() {
    let mut policy = start(
        &read("scripts/policies/material-feed.wasm"),
        &[("material", 2.0), ("scale", 0.5)],
    )
    .unwrap();
    decide(&mut policy, &chain(&[0.0]));
    assert_eq!(policy.tuning(0).feed_cap_mm_per_s, Some(10.0));
    let mut policy = start(&read("scripts/policies/material-feed.wasm"), &[]).unwrap();
    decide(&mut policy, &chain(&[0.0]));
    assert!(
        policy.tuning(0).is_empty(),
        "the programmed feed is below that of aluminium"
    );
}

#[test]
fn parameters_are_declared_with_range_default_and_description() {
    for (script, count) in [
        ("corner-time-constant", 2),
        ("gentle-start", 4),
        ("load-feed", 4),
        ("material-feed", 2),
        ("gentle-plunge", 3),
        ("warm-spindle", 3),
        ("curvature-tolerance", 3),
        ("keep-contour", 3),
    ] {
        let script = compile(&read(&format!("scripts/policies/{script}.wasm"))).unwrap();
        let instance = Instance::new(&script, &Budget::default(), &[]).unwrap();
        assert_eq!(instance.parameters().len(), count);
        assert!(
            instance
                .parameters()
                .iter()
                .all(|p| p.description.len() > 10),
            "{:?}",
            instance.parameters()
        );
    }
}

/// A line that goes down by `down_mm` over 3 mm, from `height_mm` of the program.
fn descent(height_mm: f64, down_mm: f64, tool: u32) -> Block {
    let offset = AxisVector::from_slice(&[100.0, 50.0, -80.0]);
    let start = AxisVector::from_slice(&[100.0, 50.0, height_mm - 80.0]);
    Block {
        kind: BlockKind::Line,
        end: start + AxisVector::from_slice(&[3.0, 0.0, -down_mm]),
        offset,
        length_mm: 3.0_f64.hypot(down_mm),
        feed_mm_per_s: 50.0,
        tool,
        ..Block::at(start)
    }
}

#[test]
fn gentle_plunge_holds_the_speed_of_the_descent_below_the_surface() {
    let script = compile(&read("scripts/policies/gentle-plunge.wasm")).unwrap();
    let facts = Facts {
        tool_diameters_mm: vec![(2, 6.0)],
        ..Facts::default()
    };
    let stated = crate::values(&[("plunge_mm_per_min", 300.0), ("surface_mm", 2.0)]);
    let mut policy =
        Policy::new(script, stated, Budget::default(), Bounds::default(), &facts).unwrap();
    let mut cap = |block: Block| {
        decide(&mut policy, &[block]);
        policy.tuning(0).feed_cap_mm_per_s
    };
    // Four down for five along: at 5 mm/s of descent 6.25 mm/s of path.
    assert!((cap(descent(0.0, 4.0, 9)).unwrap() - 6.25).abs() < 1e-12);
    // The table says 6 mm, and 50 mm/min a mm.
    assert!((cap(descent(0.0, 4.0, 2)).unwrap() - 6.25).abs() < 1e-12);
    assert_eq!(
        cap(descent(10.0, 4.0, 9)),
        None,
        "it ends above the surface"
    );
    assert_eq!(cap(descent(0.0, -4.0, 9)), None, "it goes up");
    assert_eq!(cap(descent(0.0, 0.0, 9)), None, "it goes along");
    assert_eq!(
        cap(descent(0.0, 0.1, 9)),
        None,
        "so flat that the feed is low enough"
    );
}

#[test]
fn warm_spindle_lowers_the_feed_with_the_temperature() {
    let script = compile(&read("scripts/policies/warm-spindle.wasm")).unwrap();
    let facts = Facts {
        signals: vec!["door".to_string(), "spindle_temperature_c".to_string()],
        ..Facts::default()
    };
    let budget = Budget::default();
    let mut policy = Policy::new(script, vec![], budget, Bounds::default(), &facts).unwrap();
    assert_eq!(policy.signals(), [1]);
    let mut ratio = |celsius: f64| {
        let mut period = Period {
            duration_s: 0.008,
            ..Period::default()
        };
        period.signals[0] = celsius;
        policy.period(&period)
    };
    for (celsius, expected) in [
        (20.0, 1.0),
        (60.0, 1.0),
        (70.0, 0.65),
        (80.0, 0.3),
        (200.0, 0.3),
    ] {
        let given = ratio(celsius).unwrap();
        assert!((given - expected).abs() < 1e-12, "{celsius}: {given}");
    }
    assert_eq!(
        ratio(f64::NAN),
        None,
        "a sensor that is not heard of asks for nothing"
    );
}

#[test]
fn curvature_tolerance_is_a_share_of_the_radius() {
    let bytes = read("scripts/policies/curvature-tolerance.wasm");
    let mut policy = start(&bytes, &[("share_of_radius", 1e-4)]).unwrap();
    // Chords of 10 mm that turn by 0.05 rad lie on a circle of 200 mm.
    let degrees = [0.0, 0.05_f64.to_degrees(), 0.1_f64.to_degrees()];
    decide(&mut policy, &chain(&degrees));
    assert_eq!(
        policy.tuning(1).path_tolerance_mm,
        None,
        "10 um are in force"
    );
    let degrees = [0.0, 0.5_f64.to_degrees(), 1.0_f64.to_degrees()];
    decide(&mut policy, &chain(&degrees));
    let given = policy.tuning(1).path_tolerance_mm.unwrap();
    assert!((given - 20.0 * 1e-4).abs() < 1e-9, "{given}");
}

#[test]
fn material_feed_goes_by_what_the_program_states() {
    let bytes = read("scripts/policies/material-feed.wasm");
    let mut policy = start(&bytes, &[("material", 3.0)]).unwrap();
    let names: Vec<_> = policy.program_inputs().iter().map(|i| &i.name).collect();
    assert_eq!(names, ["material"]);
    assert_eq!(
        policy.program_inputs()[0].words,
        ["aluminium", "brass", "steel", "stainless"]
    );
    let blocks = chain(&[0.0; 3]);
    policy.offer(&blocks[0], None);
    policy.state(0, 2.0);
    policy.offer(&blocks[1], None);
    policy.state(0, f64::NAN);
    policy.offer(&blocks[2], None);
    policy.decide(None);
    let caps: Vec<_> = (0..3)
        .map(|index| policy.tuning(index).feed_cap_mm_per_s)
        .collect();
    let of = |mm_per_min: f64| Some(mm_per_min / 60.0);
    assert_eq!(caps, [of(800.0), of(1200.0), of(800.0)]);
    policy.state(0, 7.0);
    decide(&mut policy, &blocks);
    let cap = policy.tuning(0).feed_cap_mm_per_s;
    assert_eq!(cap, of(800.0), "no row of the table");
}

#[test]
fn keep_contour_lowers_the_feed_of_the_axis_that_lags() {
    let bytes = read("scripts/policies/keep-contour.wasm");
    let mut policy = start(&bytes, &[("axis_error_um", 20.0)]).unwrap();
    let mut ratio = |axis: usize, error_mm: f64, sigma: f64| {
        let mut period = Period {
            duration_s: 0.008,
            sigma,
            ..Period::default()
        };
        period.max_axis_error[axis] = error_mm;
        policy.period(&period).unwrap()
    };
    assert_eq!(ratio(1, 0.01, 1.0), 1.0);
    assert!((ratio(2, 0.04, 1.0) - 0.5).abs() < 1e-12);
    assert!(
        (ratio(2, 0.02, 0.5) - 0.508).abs() < 1e-12,
        "it comes back slowly"
    );
    assert!(
        (ratio(0, 0.4, 0.5) - 0.2).abs() < 1e-12,
        "not below the lowest"
    );
}
