//! What scripts of version 2 see of blocks, periods and the program, and that those of version 1 go on as before.

use tandem_policy::{Bounds, Budget, Facts, Instance, Period, Policy};
use tandem_rig::Random;
use tandem_sdk::{Axes, AxisVector, Block, BlockKind};

use crate::{chain, compile, decide, read, start, values};

const ECHOES: [&str; 2] = ["echo-as", "echo-c"];

/// A machine with two axes, of which Z is the second, and three signals.
fn small_mill() -> Facts {
    Facts {
        axes: Axes::new(&[('X', false), ('Z', false)]).unwrap(),
        tool_diameters_mm: vec![(3, 6.5)],
        signals: ["load", "door", "coolant_c"].map(str::to_string).to_vec(),
        ..Facts::default()
    }
}

fn on(facts: &Facts, bytes: &[u8], stated: &[(&str, f64)]) -> Result<Policy, String> {
    let script = compile(bytes).map_err(|e| e.to_string())?;
    let bounds = Bounds {
        time_constant_s: (1e-9, 1e9),
        lowest_feed_ratio: 1e-9,
        max_feed_ratio: 1e9,
        ..Bounds::default()
    };
    Policy::new(script, values(stated), Budget::default(), bounds, facts).map_err(|e| e.to_string())
}

fn echo(name: &str, field: u32) -> Policy {
    let bytes = read(&format!("tests/fixtures/policies/echo/{name}.wasm"));
    on(&small_mill(), &bytes, &[("field", f64::from(field))]).unwrap()
}

#[test]
fn every_field_of_a_block_that_an_sdk_reads_is_the_one_that_is_told() {
    let mut random = Random::from_the_clock();
    for name in ECHOES {
        let mut number = || random.between(1.0, 9.0);
        // Down and along, so that each share is a number of its own.
        let (start, way) = (
            AxisVector::from_slice(&[number(), number()]),
            AxisVector::from_slice(&[3.0, 4.0]),
        );
        let offset = AxisVector::from_slice(&[number(), number()]);
        let block = Block {
            kind: BlockKind::Line,
            line: 7,
            tool: 3,
            start,
            end: start + way,
            offset,
            length_mm: 5.0,
            feed_mm_per_s: 50.0,
            feed_cap_mm_per_s: 20.0,
            ..Block::at(start)
        };
        let told = [
            7.0,
            3.0,
            5.0,
            20.0,
            6.5,
            1.0,
            12.5,
            start[1],
            start[1] + 4.0,
            offset[1],
            0.8,
            0.8,
            0.8,
            0.8,
        ];
        for (field, told) in told.into_iter().enumerate() {
            let mut policy = echo(name, field as u32);
            policy.state(0, 1.0);
            policy.state(1, 12.5);
            decide(&mut policy, &[block]);
            let seen = policy.tuning(0).time_constant_s.unwrap();
            assert!(
                (seen - told).abs() < 1e-12,
                "{name}, field {field}: {seen} of {told}"
            );
        }
    }
}

#[test]
fn every_field_of_a_period_that_an_sdk_reads_is_the_one_that_is_told() {
    let mut random = Random::from_the_clock();
    for name in ECHOES {
        let mut next = || random.between(1.0, 9.0);
        let mut period = Period {
            line: 4,
            duration_s: next(),
            sigma: next(),
            ..Period::default()
        };
        period.current_a[7] = next();
        for vector in [
            &mut period.position,
            &mut period.speed,
            &mut period.axis_error,
            &mut period.max_axis_error,
        ] {
            vector[1] = next();
        }
        // In the order in which the script names them.
        (period.signals[0], period.signals[1]) = (next(), next());
        let told = [
            4.0,
            period.duration_s,
            period.current_a[7],
            period.position[1],
            period.speed[1],
            period.axis_error[1],
            period.max_axis_error[1],
            period.signals[0],
            period.signals[1],
            period.sigma,
            // 0, kept to the floor of a script that also caps feeds.
            1e-9_f64.sqrt(),
            1.0,
        ];
        for (field, told) in told.into_iter().enumerate() {
            let mut policy = echo(name, field as u32);
            assert_eq!(
                policy.signals(),
                [2, 1],
                "coolant_c and door of the machine's three"
            );
            let seen = policy.period(&period).unwrap();
            assert!(
                (seen - told).abs() < 1e-12,
                "{name}, field {field}: {seen} of {told}"
            );
        }
    }
}

#[test]
fn a_machine_without_what_a_script_looks_at_is_refused_in_words() {
    let flat = Facts {
        axes: Axes::new(&[('X', false), ('Y', false)]).unwrap(),
        ..small_mill()
    };
    let why = on(&flat, &read("scripts/policies/gentle-plunge.wasm"), &[]).err();
    assert_eq!(
        why.as_deref(),
        Some("it looks at the axis \"z\", which this machine has not")
    );
    let named = Facts {
        signals: vec!["spindle_temperatur_c".to_string()],
        ..small_mill()
    };
    let why = on(&named, &read("scripts/policies/warm-spindle.wasm"), &[]).err();
    assert_eq!(
        why.as_deref(),
        Some(
            "it looks at the signal \"spindle_temperature_c\", which this machine has not; \
             the nearest is spindle_temperatur_c"
        )
    );
}

/// What a script gives to blocks and periods of every kind.
fn behaviour(bytes: &[u8], seed: u64) -> Vec<u64> {
    let mut random = Random::new(seed);
    let mut policy = start(bytes, &[]).unwrap();
    let mut seen = vec![];
    for period in 0..20 {
        let degrees: Vec<f64> = (0..=random.below(63))
            .map(|_| random.between(-180.0, 180.0))
            .collect();
        decide(&mut policy, &chain(&degrees));
        for index in 0..degrees.len() {
            let tuning = policy.tuning(index);
            let given = [
                tuning.time_constant_s,
                tuning.path_tolerance_mm,
                tuning.feed_cap_mm_per_s,
            ];
            seen.extend(given.map(|value| value.unwrap_or(-1.0).to_bits()));
        }
        let ratio = policy.period(&Period {
            period,
            duration_s: 0.008,
            cutting_torque_nm: random.between(0.0, 4.0),
            reference_torque_nm: 2.0,
            ..Period::default()
        });
        seen.push(ratio.unwrap_or(-1.0).to_bits());
    }
    assert_eq!(policy.counters().troubles(), 0);
    seen
}

#[test]
fn modules_of_version_1_do_what_they_did() {
    for name in [
        "corner-time-constant",
        "gentle-start",
        "load-feed",
        "material-feed",
    ] {
        let old = read(&format!("tests/fixtures/policies/v1/{name}.wasm"));
        assert_eq!(compile(&old).unwrap().version, 1, "{name}");
        let new = read(&format!("scripts/policies/{name}.wasm"));
        assert_eq!(compile(&new).unwrap().version, 2, "{name}");
        let seed = Random::from_the_clock().below(u64::MAX);
        assert_eq!(
            behaviour(&old, seed),
            behaviour(&new, seed),
            "{name}, {seed}"
        );
    }
}

#[test]
fn a_module_of_version_1_gives_way_to_one_of_version_2_in_a_run_and_back() {
    let old = read("tests/fixtures/policies/v1/gentle-start.wasm");
    let plunge = read("scripts/policies/gentle-plunge.wasm");
    let mut policy = start(&old, &[]).unwrap();
    let mut down = chain(&[0.0]);
    (down[0].end[2], down[0].length_mm) = (-10.0, 200.0_f64.sqrt());
    let cap = |policy: &mut Policy| {
        decide(policy, &down);
        policy.tuning(0).feed_cap_mm_per_s
    };
    assert_eq!(cap(&mut policy), Some(20.0));
    let swap = |policy: &mut Policy, bytes: &[u8]| {
        let script = compile(bytes).unwrap();
        let instance = Instance::new(&script, &Budget::default(), &[]).unwrap();
        policy.swap(script, instance)
    };
    swap(&mut policy, &plunge).unwrap();
    let expected = 200.0 / 60.0 * 2.0_f64.sqrt();
    assert!((cap(&mut policy).unwrap() - expected).abs() < 1e-9);
    swap(&mut policy, &old).unwrap();
    assert_eq!(cap(&mut policy), Some(20.0));
    // What nobody watches for in this run cannot be seen later on.
    let why = swap(&mut policy, &read("scripts/policies/material-feed.wasm")).unwrap_err();
    assert!(
        why.to_string()
            .contains("it reads \"material\" of the program"),
        "{why}"
    );
}
