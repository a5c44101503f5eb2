//! What is wrong with a module, said so that its author can mend it.

use tandem_policy::{Engine, MAX_BYTES};

use crate::{compile, each, read, start};

fn refusal(name: &str) -> String {
    let bytes = read(&format!("tests/fixtures/policies/refused/{name}.wat"));
    start(&bytes, &[])
        .err()
        .unwrap_or_else(|| panic!("{name} is accepted"))
        .to_string()
}

#[test]
fn every_unfit_module_is_refused_on_one_line() {
    let files = each("tests/fixtures/policies/refused");
    assert!(files.len() >= 23, "{}", files.len());
    for (name, _) in files {
        let text = refusal(&name);
        assert!(!text.contains('\n') && text.len() < 600, "{name}: {text}");
    }
}

#[test]
fn refusals_say_what_is_missing_and_which_version() {
    let cases = [
        (
            "other-version",
            "speaks version 3 of the policy ABI, this host speaks versions 1 to 2",
        ),
        (
            "missing-import",
            "it imports env.seed: a policy script needs no imports",
        ),
        ("imported-memory", "it imports env.memory"),
        (
            "no-layout",
            "the function tandem_policy_v2 () -> i32 is not exported",
        ),
        ("no-memory", "the memory memory is not exported"),
        (
            "no-calls",
            "exports neither on_blocks (i32, i32) nor on_period (i32) -> f64",
        ),
        (
            "wrong-types",
            "its export on_blocks is not (i32, i32); its export on_period is not (i32) -> f64",
        ),
        ("start-traps", "it does not start: trap:"),
        (
            "start-never-ends",
            "it does not start: out of fuel: more than 1000000 instructions",
        ),
        ("layout-recurses", "it does not start: "),
        (
            "giant-memory",
            "memory refused: it asked for 65536 pages of memory, 32 are allowed",
        ),
        (
            "layout-outside",
            "its layout is wrong: it lies outside of the memory",
        ),
        (
            "window-outside",
            "its layout is wrong: the window lies outside of the memory",
        ),
        ("text", "not a WASM module: "),
        (
            "small-blocks",
            "its layout is wrong: a block has 120 bytes, version 2 has 192",
        ),
        (
            "inputs-outside",
            "its layout is wrong: the table of inputs lies outside of the memory",
        ),
        ("inputs-many", "33 inputs, 32 are allowed"),
        ("program-many", "9 inputs of the program, 8 are allowed"),
        (
            "input-kind",
            "\"z\" is an input of the kind 7, which nobody knows",
        ),
        ("input-twice", "two inputs are called \"z\""),
        (
            "input-words",
            "\"door\" has words, which only what a program states can have",
        ),
        (
            "input-missing",
            "it looks at the signal \"dorr\", which this machine has not; it has none",
        ),
        (
            "axis-missing",
            "it looks at the axis \"q\", which this machine has not",
        ),
    ];
    for (name, expected) in cases {
        let text = refusal(name);
        assert!(text.contains(expected), "{name}: {text}");
    }
}

#[test]
fn names_of_any_kind_stand_on_one_line_of_a_refusal() {
    let long = "n".repeat(5000);
    let text = format!(r#"(module (import "\0a " "{long}" (func)))"#);
    let text = start(text.as_bytes(), &[]).err().unwrap().to_string();
    assert!(
        text.starts_with(r"it imports \n .nnn") && text.len() < 200,
        "{text}"
    );
    let text = r#"(module (func (export "tandem_policy_v\0a") (result i32) i32.const 0))"#;
    let text = start(text.as_bytes(), &[]).err().unwrap().to_string();
    assert!(text.starts_with(r"it speaks version \n of"), "{text}");
}

#[test]
fn parameters_that_do_not_fit_are_refused() {
    let bytes = read("scripts/policies/corner-time-constant.wasm");
    let refused = |stated: &[(&str, f64)]| {
        start(&bytes, stated)
            .err()
            .map(|e| e.to_string())
            .unwrap_or_default()
    };
    let text = refused(&[("corner_eror_um", 5.0), ("longest_ms", 0.0)]);
    assert!(
        text.contains("it has no parameter \"corner_eror_um\"; the nearest is corner_error_um"),
        "{text}"
    );
    assert!(
        text.contains("longest_ms is 0; it must be from 1 to 1000"),
        "{text}"
    );
    assert_eq!(refused(&[("corner_error_um", 5.0)]), "");
}

#[test]
fn a_file_of_any_size_is_not_compiled() {
    let text = compile(&vec![0; MAX_BYTES + 1]).err().unwrap().to_string();
    assert_eq!(text, "1048577 bytes: a policy script has at most 1048576");
}

#[test]
fn the_same_bytes_are_compiled_once() {
    let engine = Engine::new().unwrap();
    let bytes = read("scripts/policies/load-feed.wasm");
    let (one, two) = (
        engine.compile(&bytes).unwrap(),
        engine.compile(&bytes).unwrap(),
    );
    assert!(one.is_same(&two));
}
