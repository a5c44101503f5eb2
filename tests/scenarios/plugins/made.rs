//! `tandem plugin new`: what it makes builds, conforms and runs.

use std::path::Path;
use std::process::Command;

use crate::harness::{Scenario, root};
use crate::plugins::built::{cargo, mill_without, run, third_party_target};

fn make(arguments: &[&str]) -> (bool, String) {
    let output = Command::new(env!("CARGO_BIN_EXE_tandem"))
        .args(["plugin", "new"])
        .args(arguments)
        .output()
        .unwrap();
    (
        output.status.success(),
        String::from_utf8_lossy(&output.stderr).into_owned(),
    )
}

#[test]
fn every_kind_builds_and_conforms_as_it_is_made() {
    let folder = tempfile::tempdir().unwrap();
    for kind in ["planner", "feed-strategy", "driver", "kinematics"] {
        let name = format!("made-{kind}");
        let place = folder.path().join(&name);
        let (made, words) = make(&[
            place.to_str().unwrap(),
            "--kind",
            kind,
            "--sdk",
            root().to_str().unwrap(),
        ]);
        assert!(made && words.contains("src/lib.rs"), "{words}");
        // What the workspace has fetched is enough: no network.
        std::fs::copy(
            root().join("tests/third-party/Cargo.lock"),
            place.join("Cargo.lock"),
        )
        .unwrap();
        let text = run(cargo().current_dir(&place).args(["test", "--offline"]));
        assert!(
            text.contains("test it_conforms ... ok") && !text.contains("warning"),
            "{text}"
        );
        let readme = std::fs::read_to_string(place.join("README.md")).unwrap();
        let left = ["NAME", "CRATE", "KIND", "SECTION", "OPTIONS"]
            .iter()
            .find(|word| readme.contains(**word));
        assert_eq!(left, None, "{readme}");
        let source = std::fs::read_to_string(place.join("src/lib.rs")).unwrap();
        assert!(
            source.contains(&format!("\"{name}\"")) && !source.contains("one-block"),
            "{source}"
        );
        run(cargo().current_dir(&place).args(["build", "--offline"]));
        drives_as_its_readme_says(&place, &readme, kind);
    }
}

/// The mill with what the README says of the machine file.
fn drives_as_its_readme_says(place: &Path, readme: &str, kind: &str) {
    let (_, rest) = readme.split_once("```toml\n").unwrap();
    let (block, _) = rest.split_once("```").unwrap();
    let library = third_party_target().join("debug").join(format!(
        "{}made_{}{}",
        std::env::consts::DLL_PREFIX,
        kind.replace('-', "_"),
        std::env::consts::DLL_SUFFIX
    ));
    let (before, after) = block.split_once("path/to/").unwrap();
    let (_, after) = after.split_once('"').unwrap();
    let machine = place.join("machine.toml");
    let text = format!(
        "{}{before}{}\"{after}",
        mill_without(&kind.replace('-', "_")),
        library.display()
    );
    std::fs::write(&machine, text).unwrap();
    let done = Scenario::text("G21 G90\nF3000\nG1 X40 Y10\nM2\n")
        .on(&machine)
        .run();
    assert_eq!(
        (done.status(), done.number("limit_violations")),
        (0, 0.0),
        "{kind}: {}",
        done.errors()
    );
    assert_eq!(done.column("x_cmd_mm").last(), Some(&40.0), "{kind}");
}

/// What docs/writing-a-plugin.md shows compiles, and conforms.
#[test]
fn the_plugin_on_the_page_conforms() {
    let folder = tempfile::tempdir().unwrap();
    let place = folder.path().join("load-guard");
    let (made, words) = make(&[
        place.to_str().unwrap(),
        "--kind",
        "feed-strategy",
        "--sdk",
        root().to_str().unwrap(),
    ]);
    assert!(made, "{words}");
    let page = std::fs::read_to_string(root().join("docs/writing-a-plugin.md")).unwrap();
    let (_, rest) = page.split_once("```rust\n").unwrap();
    std::fs::write(place.join("src/lib.rs"), rest.split_once("```").unwrap().0).unwrap();
    std::fs::copy(
        root().join("tests/third-party/Cargo.lock"),
        place.join("Cargo.lock"),
    )
    .unwrap();
    let text = run(cargo().current_dir(&place).args(["test", "--offline"]));
    assert!(
        text.contains("test it_conforms ... ok") && !text.contains("warning"),
        "{text}"
    );
}

#[test]
fn one_that_would_abort_does_not_compile() {
    let manifest = root().join("tests/third-party/current-limit/Cargo.toml");
    let mut check = cargo();
    check.env("CARGO_PROFILE_DEV_PANIC", "abort").args([
        "check",
        "--offline",
        "--locked",
        "--manifest-path",
    ]);
    let output = check.arg(manifest).output().unwrap();
    let text = String::from_utf8_lossy(&output.stderr);
    assert!(
        !output.status.success() && text.contains("build it with panic = \"unwind\""),
        "{text}"
    );
}

#[test]
fn what_is_there_is_not_overwritten_and_names_are_checked() {
    let folder = tempfile::tempdir().unwrap();
    let (made, words) = make(&[folder.path().to_str().unwrap(), "--kind", "driver"]);
    assert!(
        !made && (words.contains("is there already") || words.contains("the characters")),
        "{words}"
    );
    let place = folder.path().join("Wrong_Name");
    let (made, words) = make(&[place.to_str().unwrap(), "--kind", "driver"]);
    assert!(
        !made && words.contains("a-z, 0-9 and -") && !place.exists(),
        "{words}"
    );
    let place = folder.path().join("right");
    let (made, words) = make(&[place.to_str().unwrap(), "--kind", "driver", "--sdk", "/"]);
    assert!(
        !made && words.contains("no checkout of Tandem") && !place.exists(),
        "{words}"
    );
}
