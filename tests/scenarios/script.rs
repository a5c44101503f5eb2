//! `tandem script`: from nothing to a module, in each language whose compiler is there.

use std::path::Path;
use std::process::{Command, Output};

use tandem_policy::{Bounds, Budget, Counters, Engine, Facts, Period, Policy, Tuning};
use tandem_sdk::{AxisVector, Block, BlockKind};
use tempfile::TempDir;

use crate::harness::{mill, root};

fn script(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_tandem"))
        .arg("script")
        .args(arguments)
        .output()
        .unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// Builds `source`; `false`, and a line that says so, where the compiler is missing.
fn builds(source: &Path, out: &Path) -> bool {
    let output = script(&[
        "build",
        &source.to_string_lossy(),
        "--out",
        &out.to_string_lossy(),
    ]);
    let said = text(&output.stderr);
    if !output.status.success() && said.contains("missing: ") {
        println!("skipped {}: {said}", source.display());
        return false;
    }
    assert!(output.status.success(), "{}: {said}", source.display());
    true
}

/// What a module does with a zigzag and with a load that rises.
fn behaviour(module: &Path) -> (Vec<Tuning>, Vec<Option<f64>>, Counters) {
    let script = Engine::new()
        .unwrap()
        .compile(&std::fs::read(module).unwrap())
        .unwrap();
    let facts = Facts {
        signals: vec!["spindle_temperature_c".to_string()],
        ..Facts::default()
    };
    let mut policy =
        Policy::new(script, vec![], Budget::default(), Bounds::default(), &facts).unwrap();
    for index in 0..64_u32 {
        let at =
            |index: u32| AxisVector::from_slice(&[f64::from(index), f64::from(index * index % 7)]);
        let kind = if index % 20 == 0 {
            BlockKind::Rapid
        } else {
            BlockKind::Line
        };
        let feed_mm_per_s = if index % 20 == 0 { f64::INFINITY } else { 60.0 };
        let (end, length_mm) = (at(index + 1), 2.0);
        policy.offer(
            &Block {
                kind,
                end,
                length_mm,
                feed_mm_per_s,
                tool: 1 + index / 50,
                ..Block::at(at(index))
            },
            None,
        );
    }
    policy.decide(None);
    let tunings = (0..64).map(|index| policy.tuning(index)).collect();
    let period = |index: u32| Period {
        duration_s: 0.008,
        cutting_torque_nm: 0.2 * f64::from(index),
        reference_torque_nm: 1.0,
        ..Period::default()
    };
    let ratios = (0..20).map(|index| policy.period(&period(index))).collect();
    (tunings, ratios, policy.counters().clone())
}

#[test]
fn the_scripts_rebuilt_behave_as_the_modules_beside_them() {
    let folder = TempDir::new().unwrap();
    for source in [
        "corner-time-constant.ts",
        "gentle-start.c",
        "load-feed.ts",
        "material-feed.ts",
        "arm-reach",
    ] {
        let source = root().join("scripts/policies").join(source);
        let out = folder.path().join("rebuilt.wasm");
        if builds(&source, &out) {
            let (tunings, ratios, rebuilt) = behaviour(&out);
            let (kept_tunings, kept_ratios, kept) = behaviour(&source.with_extension("wasm"));
            assert_eq!(
                (tunings, ratios),
                (kept_tunings, kept_ratios),
                "{}",
                source.display()
            );
            assert_eq!(rebuilt.troubles() + kept.troubles(), 0);
        }
    }
}

#[test]
fn a_new_script_builds_in_every_language_and_does_the_same() {
    let folder = TempDir::new().unwrap();
    let mut seen = vec![];
    for (lang, source) in [("as", "corners.ts"), ("c", "corners.c"), ("rust", "")] {
        let place = folder.path().join(lang).join("corners");
        let made = script(&["new", &place.to_string_lossy(), "--lang", lang]);
        assert!(made.status.success(), "{}", text(&made.stderr));
        let named = if lang == "rust" {
            place.join("src/lib.rs")
        } else {
            place.join(source)
        };
        assert!(
            named.is_file() && text(&made.stderr).starts_with(&named.display().to_string()),
            "{}",
            text(&made.stderr)
        );
        let out = folder.path().join(format!("{lang}.wasm"));
        if builds(&place.join(source), &out) {
            let checked = script(&["check", &out.to_string_lossy()]);
            assert!(checked.status.success(), "{}", text(&checked.stdout));
            assert!(
                text(&checked.stdout).contains("sharp_turn_deg = 30, from 1 to 180: "),
                "{}",
                text(&checked.stdout)
            );
            seen.push(behaviour(&out).0);
        }
        assert_eq!(
            script(&["new", &place.to_string_lossy()]).status.code(),
            Some(1),
            "it is there already"
        );
    }
    assert!(seen.windows(2).all(|pair| pair[0] == pair[1]), "{seen:?}");
    assert!(
        seen.iter()
            .flatten()
            .all(|tuning| tuning.feed_cap_mm_per_s.is_none_or(|feed| feed == 20.0))
    );
}

#[test]
fn check_takes_parameters_and_limits_of_the_machine() {
    let file = root()
        .join("scripts/policies/corner-time-constant.wasm")
        .to_string_lossy()
        .into_owned();
    let machine = mill().to_string_lossy().into_owned();
    let with = |set: &[&str]| script(&[&["check", &file, "--machine", &machine], set].concat());
    let fine = with(&["--set", "policy.parameters.corner_error_um=5"]);
    assert!(fine.status.success(), "{}", text(&fine.stderr));
    let slip = with(&["--set", "policy.parameters.corner_error=5"]);
    assert_eq!(slip.status.code(), Some(1));
    assert!(
        text(&slip.stderr).contains("the nearest is corner_error_um"),
        "{}",
        text(&slip.stderr)
    );
    let starved = with(&[
        "--set",
        "policy.fuel_per_call=200",
        "--set",
        "policy.fuel_per_block=1",
    ]);
    assert_eq!(starved.status.code(), Some(1));
    assert!(
        text(&starved.stdout).contains("out of fuel: more than 264 instructions"),
        "{}",
        text(&starved.stdout)
    );
}

#[test]
fn bench_measures_and_doctor_names_every_language() {
    let file = root()
        .join("scripts/policies/load-feed.wasm")
        .to_string_lossy()
        .into_owned();
    let bench = script(&["bench", &file, "--calls", "200"]);
    assert!(bench.status.success(), "{}", text(&bench.stderr));
    let said = text(&bench.stdout);
    assert!(
        said.contains("a rough period: p50") && said.contains("most fuel"),
        "{said}"
    );
    assert!(!said.contains("window"), "it tunes no blocks: {said}");
    let doctor = text(&script(&["doctor"]).stdout);
    assert!(
        ["AssemblyScript", "C ", "Rust"]
            .iter()
            .all(|language| doctor.contains(language)),
        "{doctor}"
    );
}
