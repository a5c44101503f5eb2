//! Modules that nobody wrote: valid WASM from random bytes, by `wasm-smith`. 60 of each kind; for a longer search
//! `TANDEM_MODULES=20000 cargo test -p tandem-policy generated`.

use arbitrary::Unstructured;
use tandem_policy::MAX_STRIKES;
use tandem_rig::Random;
use wasm_smith::{Config, Module};

use crate::hostile::{assert_within_the_machine, live};
use crate::{chain, start};

/// What a policy exports but for its layout: the bodies are random.
const EXPORTS: &str = r#"(module
  (memory (export "memory") 1 8)
  (func (export "on_blocks") (param i32 i32))
  (func (export "on_period") (param i32) (result f64) (f64.const 1))
  (func (export "save") (result i32) (i32.const 0))
  (func (export "restore") (param i32)))"#;

/// The layout: a window of 64 blocks at 1024, a period at 512, eight bytes of state at 0x4000.
const LAYOUT: &str = r#"
  (data (i32.const 16) "\30\00\00\00\78\00\00\00\00\04\00\00\40\00\00\00\b0\00\00\00\00\02\00\00")
  (data (i32.const 56) "\00\40\00\00\08\00\00\00")
  (func (export "tandem_policy_v1") (result i32) i32.const 16))"#;

/// What the engine of policies takes.
fn plain() -> Config {
    Config {
        available_imports: None,
        max_imports: 0,
        max_instructions: 60,
        allow_start_export: false,
        simd_enabled: false,
        relaxed_simd_enabled: false,
        threads_enabled: false,
        tail_call_enabled: false,
        exceptions_enabled: false,
        gc_enabled: false,
        reference_types_enabled: false,
        max_memories: 0,
        wide_arithmetic_enabled: false,
        ..Config::default()
    }
}

fn module(config: Config, random: &mut Random) -> Option<Vec<u8>> {
    let bytes = random.bytes(4096);
    Module::new(config, &mut Unstructured::new(&bytes))
        .ok()
        .map(|module| module.to_bytes())
}

/// How many modules of a kind are made.
fn wanted() -> usize {
    std::env::var("TANDEM_MODULES").map_or(60, |count| count.parse().unwrap())
}

/// The same in version 2, whose blocks and period are longer.
const LAYOUT_V2: &str = r#"
  (data (i32.const 16) "\40\00\00\00\80\02\00\00\00\10\00\00\40\00\00\00\38\02\00\00\00\02\00\00")
  (data (i32.const 56) "\00\40\00\00\08\00\00\00\00\00\00\00\00\00\00\00\00\00\00\00")
  (func (export "tandem_policy_v2") (result i32) i32.const 16))"#;

/// A module with the exports of a policy, and a layout that is right.
fn policy(random: &mut Random) -> Option<String> {
    let exports = wat::parse_str(EXPORTS).unwrap();
    let made = module(
        Config {
            exports: Some(exports),
            ..plain()
        },
        random,
    )?;
    let text = wasmprinter::print_bytes(made).unwrap();
    let layout = random.pick(&[LAYOUT, LAYOUT_V2]);
    Some(format!("{}{layout}", text.trim_end().strip_suffix(')')?))
}

/// Starts and calls a module twice: whatever it is, both come out the same and within the machine. Why it did not start,
/// where it did not.
fn try_out(name: &str, bytes: &[u8]) -> Option<String> {
    let blocks = chain(&[0.0, 90.0, 45.0, 180.0]);
    let mut lives = vec![];
    for _ in 0..2 {
        let mut policy = match start(bytes, &[]) {
            Ok(policy) => policy,
            Err(refusal) => {
                let text = refusal.to_string();
                assert!(text.len() < 2000 && !text.contains('\n'), "{name}: {text}");
                return Some(text);
            }
        };
        let seen = live(&mut policy, &blocks);
        assert_within_the_machine(name, &seen);
        assert!(policy.strikes() <= MAX_STRIKES, "{name}");
        lives.push((seen, policy.counters().clone()));
    }
    assert_eq!(lives[0], lives[1], "{name} is not the same twice");
    None
}

#[test]
fn generated_policies_are_contained() {
    let mut random = Random::from_the_clock();
    let made: Vec<_> = (0..wanted()).filter_map(|_| policy(&mut random)).collect();
    let refused: Vec<_> = made
        .iter()
        .filter_map(|text| try_out(text, text.as_bytes()))
        .collect();
    assert!(
        made.len() - refused.len() >= 10,
        "of {} generated policies too few start: {refused:#?}",
        made.len()
    );
}

#[test]
fn generated_modules_of_every_kind_are_refused_or_contained() {
    let mut random = Random::from_the_clock();
    let made: Vec<_> = (0..wanted())
        .filter_map(|_| module(Config::default(), &mut random))
        .collect();
    assert!(made.len() >= 10, "{}", made.len());
    for bytes in made {
        try_out(&format!("{bytes:02x?}"), &bytes);
    }
}
