//! The scripts that come with the machine, as they are built.

use tandem_policy::{Budget, Instance, Period};
use tandem_sdk::{Block, BlockKind};

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
