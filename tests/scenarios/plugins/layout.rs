//! A plugin that is built with another revision of the contract, whose sizes are all the same.

use std::fs;
use std::path::Path;

use crate::harness::{Scenario, root};
use crate::plugins::built::{cargo, run, third_party, third_party_target};

/// Copies a folder without what cargo builds in it.
fn copy(from: &Path, to: &Path) {
    fs::create_dir_all(to).unwrap();
    for entry in fs::read_dir(from)
        .unwrap()
        .map(Result::unwrap)
        .filter(|entry| entry.file_name() != "target")
    {
        let (path, copied) = (entry.path(), to.join(entry.file_name()));
        if path.is_dir() {
            copy(&path, &copied);
        } else {
            fs::copy(path, copied).unwrap();
        }
    }
}

/// A plugin's library built in `folder` with a copy of the SDK in whose `AxisLimits` two fields have changed places.
fn swapped(folder: &Path) -> std::path::PathBuf {
    let (sdk, plugins) = (folder.join("core/sdk"), folder.join("tests/third-party"));
    copy(&root().join("core/sdk"), &sdk);
    copy(&root().join("tests/third-party"), &plugins);
    let workspace = fs::read_to_string(root().join("Cargo.toml")).unwrap();
    let begin = workspace.find("members = [").unwrap();
    let end = begin + workspace[begin..].find(']').unwrap() + 1;
    let workspace = format!(
        "{}members = [\"core/sdk\"]{}",
        &workspace[..begin],
        &workspace[end..]
    );
    fs::write(folder.join("Cargo.toml"), workspace).unwrap();
    let limits = sdk.join("src/limits.rs");
    let text = fs::read_to_string(&limits).unwrap();
    let [feed, rapid] = [
        "    pub feed_mm_per_s: f64,\n",
        "    pub rapid_mm_per_s: f64,\n",
    ];
    let changed = text
        .replacen(feed, "    pub SWAP: f64,\n", 1)
        .replacen(rapid, feed, 1);
    let changed = changed.replacen("    pub SWAP: f64,\n", rapid, 1);
    assert_ne!(changed, text);
    fs::write(&limits, changed).unwrap();
    let target = third_party_target().join("swapped");
    let mut cargo = cargo();
    // It is refused before any of it runs.
    cargo.env("CARGO_PROFILE_DEV_OPT_LEVEL", "0");
    cargo.env("CARGO_TARGET_DIR", &target).args([
        "build",
        "-p",
        "one-block",
        "--offline",
        "--locked",
        "--manifest-path",
    ]);
    run(cargo.arg(plugins.join("Cargo.toml")));
    target
        .join("debug")
        .join(third_party("one-block").file_name().unwrap())
}

#[test]
fn a_plugin_whose_contract_has_two_fields_swapped_is_refused_with_the_structures_name() {
    let folder = tempfile::tempdir().unwrap();
    let library = swapped(folder.path());
    let setting = format!("planner.plugin={}", library.display());
    let done = Scenario::text("G21 G90\nF600\nG1 X1\nM2\n")
        .with(&["--set", &setting])
        .run();
    assert_eq!(done.status(), 1, "{}", done.errors());
    let words = "it is built with another revision of tandem-sdk";
    assert!(
        done.errors().contains(words) && done.errors().contains("its AxisLimits is another one"),
        "{}",
        done.errors()
    );
    assert!(!done.file("trace.csv").exists(), "nothing has moved");
}
