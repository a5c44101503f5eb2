//! Another script in the place of the one that runs.

use tandem_policy::{Bounds, Budget, Facts, Instance, Period, Policy};

use crate::hostile::half_feed_but;
use crate::{chain, compile, decide, read, start, values};

fn swap(policy: &mut Policy, bytes: &[u8]) -> Result<(), String> {
    let script = compile(bytes).map_err(|e| e.to_string())?;
    let instance =
        Instance::new(&script, &Budget::default(), policy.values()).map_err(|e| e.to_string())?;
    policy.swap(script, instance).map_err(|e| e.to_string())
}

/// Feed caps of a window of lines.
fn caps(policy: &mut Policy, blocks: usize) -> Vec<Option<f64>> {
    decide(policy, &chain(&vec![0.0; blocks]));
    (0..blocks)
        .map(|index| policy.tuning(index).feed_cap_mm_per_s)
        .collect()
}

#[test]
fn state_that_is_saved_survives() {
    let bytes = read("scripts/policies/gentle-start.wasm");
    let mut kept = start(&bytes, &[]).unwrap();
    let mut reloaded = start(&bytes, &[]).unwrap();
    for _ in 0..3 {
        assert_eq!(caps(&mut reloaded, 1), caps(&mut kept, 1));
        swap(&mut reloaded, &bytes).unwrap();
    }
    assert_eq!(reloaded.counters().reloads, 3);
    // A script made afresh begins its cut again.
    assert_ne!(
        caps(&mut start(&bytes, &[]).unwrap(), 1),
        caps(&mut reloaded, 1)
    );
}

#[test]
fn after_a_script_that_cannot_save_the_next_one_begins_afresh() {
    let strict = half_feed_but(
        "(global.set $windows (i64.load (i32.const 0x4000)))",
        "unreachable",
    );
    for saved_bytes in ["0", "9000000", "-1"] {
        let save = format!("i32.const {saved_bytes})\n  (func (export \"restore\")");
        let bytes = half_feed_but("i32.const 8)\n  (func (export \"restore\")", &save);
        let mut policy = start(&bytes, &[]).unwrap();
        swap(&mut policy, &strict).unwrap();
        assert_eq!(policy.counters().reloads, 1, "{saved_bytes}");
        assert_eq!(caps(&mut policy, 1), [Some(25.0)]);
        // What is saved is handed over, and what fails with it is refused.
        let why = swap(&mut policy, &strict).unwrap_err();
        assert!(why.contains("unreachable"), "{why}");
    }
}

#[test]
fn a_bad_script_leaves_the_old_one_running() {
    let mut policy = start(&read("tests/fixtures/policies/good/half-feed.wat"), &[]).unwrap();
    for (name, _) in crate::each("tests/fixtures/policies/refused") {
        let bytes = read(&format!("tests/fixtures/policies/refused/{name}.wat"));
        let why = swap(&mut policy, &bytes).unwrap_err();
        policy.keep(&why);
        assert_eq!(caps(&mut policy, 2), [Some(25.0), Some(25.0)], "{name}");
    }
    assert!(policy.counters().refused_reloads >= 14 && policy.counters().reloads == 0);
    assert!(policy.take_notes()[0].contains("refused, the old one goes on"));
}

#[test]
fn a_new_script_ends_the_quarantine() {
    let mut policy = start(
        &read("tests/fixtures/policies/hostile/unreachable.wat"),
        &[],
    )
    .unwrap();
    for _ in 0..5 {
        assert_eq!(caps(&mut policy, 1), [None]);
    }
    assert!(policy.is_quarantined());
    swap(
        &mut policy,
        &read("tests/fixtures/policies/good/half-feed.wat"),
    )
    .unwrap();
    assert!(!policy.is_quarantined());
    assert_eq!(caps(&mut policy, 1), [Some(25.0)]);
    let odd = Period {
        period: 3,
        duration_s: 0.008,
        ..Period::default()
    };
    assert_eq!(policy.period(&odd), Some(0.9));
}

#[test]
fn a_script_that_gives_another_answer_than_the_first_is_refused_within_a_run() {
    // Caps of blocks that are planned already were made without a ratio in mind.
    let mut policy = start(&read("scripts/policies/gentle-start.wasm"), &[]).unwrap();
    let why = swap(
        &mut policy,
        &read("tests/fixtures/policies/good/half-feed.wat"),
    )
    .unwrap_err();
    assert!(
        why.contains("it exports on_period") && why.contains("a new run"),
        "{why}"
    );
    assert_eq!(policy.counters().reloads, 0);
}

#[test]
fn parameters_of_the_machine_file_reach_the_new_script() {
    let bytes = read("scripts/policies/material-feed.wasm");
    let mut policy = start(&bytes, &[("material", 3.0)]).unwrap();
    let before = caps(&mut policy, 1);
    swap(&mut policy, &bytes).unwrap();
    assert_eq!(
        (caps(&mut policy, 1), before),
        (vec![Some(800.0 / 60.0)], vec![Some(800.0 / 60.0)])
    );
    assert_eq!(*policy.values(), values(&[("material", 3.0)]));
    // A script that does not know the parameter is refused.
    assert!(
        swap(&mut policy, &read("scripts/policies/load-feed.wasm"))
            .unwrap_err()
            .contains("no parameter")
    );
}

/// An instance that takes the place of another is made with the same budget.
#[test]
fn a_policy_says_what_an_instance_may_use_and_how_much_its_calls_have() {
    let budget = Budget {
        fuel_per_call: 5000,
        fuel_per_block: 300,
        memory_pages: 3,
    };
    let script = compile(&read("tests/fixtures/policies/good/half-feed.wat")).unwrap();
    let instance = Instance::new(&script, &budget, &values(&[])).unwrap();
    assert_eq!(instance.memory_pages(), 1, "as its module states");
    let fuel_of = |blocks: usize| {
        let (bounds, facts) = (Bounds::default(), Facts::default());
        let mut policy = Policy::new(script.clone(), values(&[]), budget, bounds, &facts).unwrap();
        assert_eq!(*policy.budget(), budget);
        decide(&mut policy, &chain(&vec![0.0; blocks]));
        policy.counters().max_window_fuel
    };
    let (one, nine) = (fuel_of(1), fuel_of(9));
    assert!(one > 0 && nine < budget.window(9), "{one}, {nine}");
    // Each block takes it the same number of instructions, and these are some.
    let each = (nine - one) / 8;
    assert!(each > 5 && (nine - one).is_multiple_of(8), "{one}, {nine}");
}
