//! Which crate may depend on which.

use std::collections::BTreeMap;

use toml::Table;

use crate::expect_none;
use crate::tree::{File, files};

/// For each package, or folder of packages, what its `[dependencies]` may name of the workspace.
const ALLOWED: &[(&str, &[&str])] = &[
    ("core/sdk", &[]),
    ("core/view", &[]),
    ("core/report", &["tandem-view"]),
    ("core/web", &["tandem-view"]),
    ("core/motion", &["tandem-sdk"]),
    ("core/gcode", &["tandem-motion", "tandem-sdk"]),
    ("core/policy", &["tandem-motion", "tandem-sdk"]),
    ("core/machine", &["tandem-sdk"]),
    ("core/rings", &["tandem-sdk"]),
    (
        "core/state",
        &["tandem-gcode", "tandem-machine", "tandem-sdk"],
    ),
    ("core/fine", &["tandem-rings", "tandem-sdk"]),
    ("core/trace", &["tandem-rings", "tandem-sdk"]),
    (
        "core/recorder",
        &[
            "tandem-fine",
            "tandem-machine",
            "tandem-motion",
            "tandem-rings",
            "tandem-sdk",
        ],
    ),
    (
        "core/rough",
        &["tandem-gcode", "tandem-rings", "tandem-sdk"],
    ),
    (
        "core/host",
        &[
            "tandem-faults",
            "tandem-fine",
            "tandem-gcode",
            "tandem-machine",
            "tandem-motion",
            "tandem-policy",
            "tandem-recorder",
            "tandem-rings",
            "tandem-rough",
            "tandem-sdk",
        ],
    ),
    (
        "core/session",
        &[
            "tandem-gcode",
            "tandem-host",
            "tandem-machine",
            "tandem-recorder",
            "tandem-rings",
            "tandem-rough",
            "tandem-sdk",
            "tandem-state",
        ],
    ),
    (
        "core/estimate",
        &[
            "tandem-gcode",
            "tandem-host",
            "tandem-machine",
            "tandem-motion",
            "tandem-rings",
            "tandem-sdk",
        ],
    ),
    (
        "core/batch",
        &[
            "tandem-gcode",
            "tandem-host",
            "tandem-machine",
            "tandem-recorder",
            "tandem-rings",
            "tandem-sdk",
        ],
    ),
    ("core/batch-nats", &["tandem-batch"]),
    ("plugins", &["tandem-motion", "tandem-sdk"]),
    // It reads a table of the machine file, and no hardware.
    ("hal-drivers/random", &[]),
    (
        "hal-drivers/faults",
        &["tandem-machine", "tandem-random", "tandem-sdk"],
    ),
    ("hal-drivers/ethercat-emulator", &[]),
    (
        "hal-drivers/ethercat",
        &["tandem-ethercat-emulator", "tandem-sdk"],
    ),
    ("hal-drivers", &["tandem-random", "tandem-sdk"]),
    ("scripts", &[]),
    (
        "tests/campaign",
        &[
            "tandem-after-interpolation",
            "tandem-block-overlap",
            "tandem-corexy",
            "tandem-gcode",
            "tandem-host",
            "tandem-look-ahead",
            "tandem-machine",
            "tandem-nurbs",
            "tandem-oracle",
            "tandem-recorder",
            "tandem-rig",
            "tandem-rings",
            "tandem-sdk",
            "tandem-sim",
            "tandem-smooth",
            "tandem-wrapped-rotary",
        ],
    ),
    ("tests/conformance", &["tandem-sdk"]),
    ("tests/net", &["tandem-campaign", "tandem-oracle"]),
    (
        "tests/optimum",
        &[
            "tandem-campaign",
            "tandem-gcode",
            "tandem-host",
            "tandem-machine",
            "tandem-motion",
            "tandem-oracle",
            "tandem-rig",
            "tandem-sdk",
        ],
    ),
    ("tests/oracle", &[]),
    (
        "tests/readers",
        &[
            "tandem-estimate",
            "tandem-ethercat-emulator",
            "tandem-gcode",
            "tandem-host",
            "tandem-look-ahead",
            "tandem-machine",
            "tandem-policy",
            "tandem-rig",
            "tandem-rings",
            "tandem-sdk",
            "tandem-session",
            "tandem-sim",
            "tandem-trace",
        ],
    ),
    ("tests/rig", &["tandem-sdk"]),
    ("tests/third-party", &["tandem-sdk"]),
    ("tests/tidy", &[]),
];

/// Packages of others that a hard or a contract crate may use: nothing that allocates behind its back, no I/O.
const OTHERS: &[(&str, &[&str])] = &[("core/sdk", &["serde", "toml"]), ("core/fine", &["rtrb"])];

/// The command may name everything.
const COMMAND: &str = "core/cli";

struct Package {
    folder: String,
    manifest: Table,
}

impl Package {
    fn names(&self, section: &str) -> Vec<&String> {
        self.manifest
            .get(section)
            .and_then(|s| s.as_table())
            .map(|s| s.keys().collect())
            .unwrap_or_default()
    }

    fn name(&self) -> &str {
        self.manifest["package"]["name"].as_str().unwrap()
    }
}

fn packages() -> Vec<Package> {
    let of_package =
        |file: &File| file.text.contains("\n[package]\n") || file.text.starts_with("[package]\n");
    let manifests = files(&["Cargo.toml"])
        .into_iter()
        .filter(|f| of_package(f) && !f.name.contains("fuzz"));
    let parse = |file: File| {
        let folder = file.name.trim_end_matches("/Cargo.toml").to_string();
        let manifest = file
            .text
            .parse()
            .unwrap_or_else(|e| panic!("{}: {e}", file.name));
        Package { folder, manifest }
    };
    manifests.map(parse).collect()
}

fn rule<'a>(rules: &'a [(&str, &[&str])], folder: &str) -> Option<&'a [&'a str]> {
    let is_in = |place: &str| {
        folder
            .strip_prefix(place)
            .is_some_and(|rest| rest.is_empty() || rest.starts_with('/'))
    };
    rules
        .iter()
        .find(|(place, _)| is_in(place))
        .map(|(_, names)| *names)
}

#[test]
fn dependencies_point_one_way() {
    let packages = packages();
    let ours: BTreeMap<&str, &str> = packages
        .iter()
        .map(|p| (p.name(), p.folder.as_str()))
        .collect();
    let mut findings = vec![];
    for package in packages.iter().filter(|p| p.folder != COMMAND) {
        let folder = &package.folder;
        let Some(allowed) = rule(ALLOWED, folder) else {
            findings.push(format!(
                "{folder}/Cargo.toml:1: no rule says what this package may depend on"
            ));
            continue;
        };
        for name in package.names("dependencies") {
            if ours.contains_key(name.as_str()) && !allowed.contains(&name.as_str()) {
                findings.push(format!(
                    "{}: {} must not depend on {name}",
                    place(folder, name),
                    package.name()
                ));
            }
        }
    }
    expect_none("dependencies against the order", &findings);
}

#[test]
fn hard_and_contract_crates_have_few_dependencies() {
    let mut findings = vec![];
    for package in packages() {
        let Some(allowed) = rule(OTHERS, &package.folder) else {
            continue;
        };
        for name in package.names("dependencies") {
            if !name.starts_with("tandem-") && !allowed.contains(&name.as_str()) {
                findings.push(format!(
                    "{}: {} must not depend on {name}",
                    place(&package.folder, name),
                    package.name()
                ));
            }
        }
    }
    expect_none("dependencies of hard crates", &findings);
}

#[test]
fn the_oracle_shares_nothing_with_what_it_judges() {
    let packages = packages();
    let oracle = packages
        .iter()
        .find(|p| p.folder == "tests/oracle")
        .expect("the oracle is there");
    for section in ["dependencies", "dev-dependencies", "build-dependencies"] {
        for name in oracle.names(section) {
            let at = place("tests/oracle", name);
            assert!(
                !name.starts_with("tandem"),
                "{at}: the oracle must not depend on {name}"
            );
        }
    }
}

/// Where a manifest names a dependency.
fn place(folder: &str, name: &str) -> String {
    let file = format!("{folder}/Cargo.toml");
    let text = crate::tree::read(&file);
    let line = text
        .lines()
        .position(|line| line.starts_with(name))
        .map_or(1, |index| index + 1);
    format!("{file}:{line}")
}
