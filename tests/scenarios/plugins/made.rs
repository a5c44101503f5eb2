//! `tandem plugin new`: what it makes builds, conforms and runs.

use std::process::Command;

use crate::harness::{Scenario, root};
use crate::plugins::built::{cargo, run, third_party_target};

fn make(arguments: &[&str]) -> (bool, String) {
    let output = Command::new(env!("CARGO_BIN_EXE_tandem")).args(["plugin", "new"]).args(arguments).output().unwrap();
    (output.status.success(), String::from_utf8_lossy(&output.stderr).into_owned())
}

#[test]
fn every_kind_builds_and_conforms_as_it_is_made() {
    let folder = tempfile::tempdir().unwrap();
    for kind in ["planner", "feed-strategy", "driver", "kinematics"] {
        let name = format!("made-{kind}");
        let place = folder.path().join(&name);
        let (made, words) = make(&[place.to_str().unwrap(), "--kind", kind, "--sdk", root().to_str().unwrap()]);
        assert!(made && words.contains("src/lib.rs"), "{words}");
        // What the workspace has fetched is enough: no network.
        std::fs::copy(root().join("tests/third-party/Cargo.lock"), place.join("Cargo.lock")).unwrap();
        let text = run(cargo().current_dir(&place).args(["test", "--offline"]));
        assert!(text.contains("test it_conforms ... ok") && !text.contains("warning"), "{text}");
        let readme = std::fs::read_to_string(place.join("README.md")).unwrap();
        let left = ["NAME", "CRATE", "KIND", "SECTION", "OPTIONS"].iter().find(|word| readme.contains(**word));
        assert_eq!(left, None, "{readme}");
        let source = std::fs::read_to_string(place.join("src/lib.rs")).unwrap();
        assert!(source.contains(&format!("\"{name}\"")) && !source.contains("one-block"), "{source}");
    }
    let place = folder.path().join("made-planner");
    run(cargo().current_dir(&place).args(["build", "--offline"]));
    let library = third_party_target().join("debug").join(format!(
        "{}made_planner{}",
        std::env::consts::DLL_PREFIX,
        std::env::consts::DLL_SUFFIX
    ));
    let setting = format!("planner.plugin={}", library.display());
    let done = Scenario::text("G21 G90\nF3000\nG1 X40 Y10\nM2\n").with(&["--set", &setting]).run();
    done.assert_within_limits();
}

#[test]
fn one_that_would_abort_does_not_compile() {
    let manifest = root().join("tests/third-party/current-limit/Cargo.toml");
    let mut check = cargo();
    check.env("CARGO_PROFILE_DEV_PANIC", "abort").args(["check", "--offline", "--locked", "--manifest-path"]);
    let output = check.arg(manifest).output().unwrap();
    let text = String::from_utf8_lossy(&output.stderr);
    assert!(!output.status.success() && text.contains("build it with panic = \"unwind\""), "{text}");
}

#[test]
fn what_is_there_is_not_overwritten_and_names_are_checked() {
    let folder = tempfile::tempdir().unwrap();
    let (made, words) = make(&[folder.path().to_str().unwrap(), "--kind", "driver"]);
    assert!(!made && (words.contains("is there already") || words.contains("the characters")), "{words}");
    let place = folder.path().join("Wrong_Name");
    let (made, words) = make(&[place.to_str().unwrap(), "--kind", "driver"]);
    assert!(!made && words.contains("a-z, 0-9 and -") && !place.exists(), "{words}");
    let place = folder.path().join("right");
    let (made, words) = make(&[place.to_str().unwrap(), "--kind", "driver", "--sdk", "/"]);
    assert!(!made && words.contains("no checkout of Tandem") && !place.exists(), "{words}");
}
