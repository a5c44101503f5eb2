//! Scripts that mean harm: contained every time, and the same every time.

use tandem_policy::{Bounds, Budget, Facts, Period, Policy, Refusal};
use tandem_rig::Random;
use tandem_sdk::Block;

use crate::{as_version_2, chain, compile, decide, each, read, start, values};

/// Windows and periods in turn; what came out.
pub fn live(policy: &mut Policy, blocks: &[Block]) -> Vec<u64> {
    let mut seen = vec![];
    for period in 0..60 {
        decide(policy, blocks);
        for index in 0..blocks.len() {
            let tuning = policy.tuning(index);
            let asked = [
                tuning.time_constant_s,
                tuning.path_tolerance_mm,
                tuning.feed_cap_mm_per_s,
            ];
            seen.extend(asked.iter().map(|ask| ask.map_or(0, f64::to_bits)));
        }
        let ratio = policy.period(&Period {
            period,
            duration_s: 0.008,
            ..Period::default()
        });
        seen.push(ratio.map_or(0, f64::to_bits));
    }
    seen
}

/// Time constants, tolerances, feed caps and ratios that a machine at 50 mm/s may get.
pub fn assert_within_the_machine(name: &str, seen: &[u64]) {
    for value in seen
        .iter()
        .filter(|bits| **bits != 0)
        .map(|bits| f64::from_bits(*bits))
    {
        let most = Bounds::default().time_constant_s.1.max(50.0);
        assert!(
            value.is_finite() && value > 0.0 && value <= most,
            "{name}: {value}"
        );
    }
}

#[test]
fn every_hostile_script_is_contained_and_asks_for_nothing_beyond_the_machine() {
    let blocks = chain(&[0.0, 90.0, 45.0, 180.0]);
    let files = each("tests/fixtures/policies/hostile");
    assert!(files.len() > 12, "{}", files.len());
    let newer: Vec<_> = files
        .iter()
        .filter(|(_, bytes)| !String::from_utf8_lossy(bytes).contains("tandem_policy_v2"))
        .map(|(name, bytes)| (name.clone(), as_version_2(bytes)))
        .collect();
    assert!(newer.len() > 12, "{}", newer.len());
    for (name, bytes) in files.into_iter().chain(newer) {
        let mut policy = start(&bytes, &[]).unwrap_or_else(|e| panic!("{name}: {e}"));
        let seen = live(&mut policy, &blocks);
        assert_within_the_machine(&name, &seen);
        let mut again = start(&bytes, &[]).unwrap();
        assert_eq!(
            live(&mut again, &blocks),
            seen,
            "{name} is not the same twice"
        );
        assert_eq!(again.counters(), policy.counters(), "{name}");
        let harmless = [
            "largest-numbers",
            "most-negative-numbers",
            "nan",
            "tiny-numbers",
            "flutter",
            "vandal",
            "vandal-inputs",
        ];
        let expected = u32::from(!harmless.contains(&name.as_str())) * 3;
        assert_eq!(
            policy.strikes(),
            expected,
            "{name}: {:?}",
            policy.take_notes()
        );
        assert_eq!(policy.is_quarantined(), expected == 3, "{name}");
    }
}

#[test]
fn each_kind_of_trouble_is_counted_as_what_it_is() {
    let of = |name: &str| {
        let mut policy = start(
            &read(&format!("tests/fixtures/policies/hostile/{name}.wat")),
            &[],
        )
        .unwrap();
        live(&mut policy, &chain(&[0.0, 90.0]));
        (policy.counters().clone(), policy.take_notes().join("\n"))
    };
    assert_eq!(of("infinite-loop").0.out_of_fuel, 3);
    assert_eq!(
        of("deep-recursion").0.stack_overflows + of("deep-recursion").0.out_of_fuel,
        3
    );
    assert_eq!(of("memory-growth").0.memory_refusals, 3);
    assert_eq!(of("memory-growth-slow").0.memory_refusals, 3);
    assert_eq!(of("table-growth").0.memory_refusals, 3);
    assert_eq!(of("unreachable").0.traps, 3);
    assert_eq!(of("infinities").0.not_finite, 3);
    let (counters, notes) = of("infinite-loop");
    assert_eq!(
        (counters.windows, counters.periods),
        (2, 1),
        "not called after the third strike"
    );
    assert_eq!(
        (counters.max_window_fuel, counters.max_period_fuel),
        (22_000, 20_000)
    );
    assert!(
        notes.contains("line 7: on_blocks: out of fuel: more than 22000 instructions in one call"),
        "{notes}"
    );
    assert!(notes.contains("strike 3 of 3, in quarantine"), "{notes}");
}

#[test]
fn requests_beyond_the_machine_are_limited_and_counted() {
    let mut policy = start(
        &read("tests/fixtures/policies/hostile/largest-numbers.wat"),
        &[],
    )
    .unwrap();
    let blocks = chain(&[0.0, 90.0]);
    decide(&mut policy, &blocks);
    assert_eq!(policy.tuning(0).time_constant_s, Some(1.0));
    assert_eq!(
        (
            policy.tuning(0).feed_cap_mm_per_s,
            policy.tuning(0).path_tolerance_mm
        ),
        (None, None)
    );
    assert_eq!(
        (policy.counters().limited, policy.counters().time_constants),
        (6, 2)
    );
    let notes = policy.take_notes().join("\n");
    assert!(
        notes.contains("line 7: time constant 50 -> 1000 ms, 1.798e308 was asked for"),
        "{notes}"
    );
}

/// The script that halves feeds, with something else in the place of a piece of its text.
pub fn half_feed_but(piece: &str, other: &str) -> Vec<u8> {
    let text = String::from_utf8(read("tests/fixtures/policies/good/half-feed.wat")).unwrap();
    assert!(text.contains(piece));
    text.replace(piece, other).into_bytes()
}

#[test]
fn a_script_that_never_starts_and_one_that_saves_and_cannot_restore_are_refused() {
    let layout = "(result i32) i32.const 16)";
    let endless = half_feed_but(layout, "(result i32) (loop $l (br $l)) i32.const 16)");
    let why = start(&endless, &[]).err().expect("it never starts");
    assert!(why.to_string().contains("out of fuel"), "{why}");
    let forgetful = half_feed_but("(func (export \"restore\")", "(func");
    let why = start(&forgetful, &[]).err().expect("it cannot restore");
    assert!(why.to_string().contains("go together"), "{why}");
}

#[test]
fn of_a_window_with_one_answer_that_is_no_number_none_counts() {
    let cap = "(f64.mul (f64.const 0.5) (f64.load offset=32 (local.get $at)))";
    let infinite_at_100 = "(f64.add (f64.const 20) (f64.div (f64.const 1) \
                           (f64.sub (f64.const 100) (f64.load offset=32 (local.get $at)))))";
    let mut policy = start(&half_feed_but(cap, infinite_at_100), &[]).unwrap();
    let mut blocks = chain(&[0.0, 90.0]);
    decide(&mut policy, &blocks);
    assert_eq!(policy.tuning(0).feed_cap_mm_per_s, Some(20.02));
    blocks[1].feed_mm_per_s = 100.0;
    decide(&mut policy, &blocks);
    assert_eq!(policy.counters().not_finite, 1);
    assert!((0..2).all(|index| policy.tuning(index).is_empty()));
}

#[test]
fn a_period_without_an_answer_is_driven_at_the_whole_feed_and_the_next_one_begins_there() {
    let bounds = Bounds {
        ratio_change_per_s: 1.0,
        ..Bounds::default()
    };
    let mut policy = Policy::new(
        compile(&half_feed_but(
            "(f64.const 1) (i32.and",
            "(f64.const nan) (i32.and",
        ))
        .unwrap(),
        values(&[]),
        Budget::default(),
        bounds,
        &Facts::default(),
    )
    .unwrap();
    let mut ask = |period| {
        policy.period(&Period {
            period,
            duration_s: 0.008,
            ..Period::default()
        })
    };
    assert_eq!([1, 2, 3].map(&mut ask), [Some(0.992), None, Some(0.992)]);
    assert_eq!([5, 7].map(&mut ask), [Some(0.984), Some(0.976)]);
    assert_eq!(policy.counters().ratios, 4);
    // The whole feed is no ratio that is asked for.
    let mut policy = start(&read("tests/fixtures/policies/good/half-feed.wat"), &[]).unwrap();
    let first = Period {
        duration_s: 0.008,
        ..Period::default()
    };
    assert_eq!(policy.period(&first), Some(1.0));
    assert_eq!(policy.counters().ratios, 0);
}

/// A script that asks for the least, as often as it is asked, with these calls.
fn greedy(calls: &str) -> String {
    let module = String::from_utf8(read(
        "tests/fixtures/policies/hostile/most-negative-numbers.wat",
    ))
    .unwrap();
    let kept = |line: &&str| {
        [
            ("on_blocks", "(func (export \"on_blocks\")"),
            ("on_period", "(func (export \"on_period\")"),
        ]
        .iter()
        .all(|(call, start)| !line.trim_start().starts_with(start) || calls.contains(call))
    };
    module.lines().filter(kept).collect::<Vec<_>>().join("\n")
}

#[test]
fn cap_and_ratio_together_never_go_below_the_lowest_feed_ratio() {
    let lowest = Bounds::default().lowest_feed_ratio;
    for calls in ["on_blocks on_period", "on_blocks", "on_period"] {
        let mut policy = start(greedy(calls).as_bytes(), &[]).unwrap();
        decide(&mut policy, &chain(&[0.0; 64]));
        let caps = (0..64).map(|index| {
            policy
                .tuning(index)
                .feed_cap_mm_per_s
                .map_or(1.0, |cap| cap / 50.0)
        });
        let cap = caps.fold(1.0, f64::min);
        let ratios = (0..60).map(|period| {
            policy
                .period(&Period {
                    period,
                    duration_s: 0.008,
                    ..Period::default()
                })
                .unwrap_or(1.0)
        });
        let ratio = ratios.fold(1.0, f64::min);
        let product = cap * ratio;
        assert!(
            product >= lowest * (1.0 - 1e-12),
            "{calls}: {cap} x {ratio} = {product}"
        );
        assert!(
            product < lowest * (1.0 + 1e-12),
            "{calls}: what is allowed can be had: {product}"
        );
    }
}

#[test]
fn truncated_and_random_bytes_are_refused_or_run_within_their_budget() {
    let whole = read("scripts/policies/corner-time-constant.wasm");
    let blocks = chain(&[0.0, 90.0]);
    let try_out = |bytes: &[u8]| match start(bytes, &[]) {
        Ok(mut policy) => drop(live(&mut policy, &blocks)),
        Err(refusal) => assert!(refusal.to_string().len() < 2000, "{refusal}"),
    };
    for end in (0..whole.len()).step_by(37) {
        assert!(
            matches!(
                start(&whole[..end], &[]),
                Err(Refusal::NotAModule(_) | Refusal::Exports(_))
            ),
            "{end} bytes"
        );
    }
    let mut random = Random::from_the_clock();
    for _ in 0..200 {
        let mut bytes = whole.clone();
        for _ in 0..=random.below(4) {
            let at = random.below(bytes.len() as u64) as usize;
            bytes[at] = random.below(256) as u8;
        }
        try_out(&bytes);
        let noise = random.below(200) as usize;
        try_out(&random.bytes(noise));
    }
}
