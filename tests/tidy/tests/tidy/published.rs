//! What is given to others: crates that cargo takes, the Python client, the Debian package.

use toml::{Table, Value};

use crate::expect_none;
use crate::tree::{files, root};

fn table(name: &str) -> Table {
    let text = std::fs::read_to_string(root().join(name)).unwrap();
    text.parse().unwrap_or_else(|e| panic!("{name}: {e}"))
}

/// A crate that is published says what it is, and depends on published crates of ours alone, by version.
#[test]
fn published_crates_can_be_packaged() {
    let workspace = table("Cargo.toml");
    let version = workspace["workspace"]["package"]["version"].as_str();
    let shared = workspace["workspace"]["dependencies"].as_table().unwrap();
    let manifests = files(&["Cargo.toml"]);
    let parsed: Vec<(&str, Table)> = manifests
        .iter()
        .filter_map(|file| Some((file.name.as_str(), file.text.parse().ok()?)))
        .collect();
    let is_published = |manifest: &Table| {
        let publish = manifest
            .get("package")
            .and_then(|package| package.get("publish"));
        publish.and_then(Value::as_bool) == Some(true)
    };
    let published: Vec<_> = parsed
        .iter()
        .filter(|(_, manifest)| is_published(manifest))
        .collect();
    let names: Vec<&str> = published
        .iter()
        .filter_map(|(_, manifest)| manifest["package"]["name"].as_str())
        .collect();
    assert_eq!(names.len(), 3, "{names:?}");
    let mut findings = vec![];
    for (file, manifest) in published {
        if manifest["package"].get("description").is_none() {
            findings.push(format!("{file}:1: no description"));
        }
        let needed = manifest.get("dependencies").and_then(Value::as_table);
        for (name, _) in needed
            .into_iter()
            .flatten()
            .filter(|(name, _)| name.starts_with("tandem-"))
        {
            let stated = shared[name].get("version").and_then(Value::as_str);
            if stated != version || !names.contains(&name.as_str()) {
                findings.push(format!(
                    "{file}:1: {name} is not published, or Cargo.toml states {stated:?} of it"
                ));
            }
        }
    }
    expect_none("published crates", &findings);
}

/// Link-time optimisation works with the settings of the command itself, whatever its crates say: small, as `release` makes that, a run
/// takes one and a half times the instructions.
#[test]
fn what_is_optimised_as_one_whole_is_optimised_for_speed() {
    let profiles = &table("Cargo.toml")["profile"];
    let whole: Vec<_> = profiles
        .as_table()
        .unwrap()
        .iter()
        .filter(|(_, profile)| profile.get("lto").and_then(Value::as_str) == Some("fat"))
        .collect();
    assert_eq!(whole.len(), 1);
    for (name, profile) in whole {
        let level = profile.get("opt-level").and_then(Value::as_integer);
        assert_eq!(level, Some(3), "profile {name}");
    }
}

#[test]
fn the_python_client_has_the_version_of_the_workspace() {
    let client = table("scripts/python/pyproject.toml");
    let workspace = table("Cargo.toml");
    assert_eq!(
        client["project"]["version"],
        workspace["workspace"]["package"]["version"]
    );
}

/// What the Debian package takes from the repository is there; the rest is what its script makes.
#[test]
fn the_debian_package_has_its_files() {
    let command = table("core/cli/Cargo.toml");
    let deb = &command["package"]["metadata"]["deb"];
    let assets = deb["assets"].as_array().unwrap();
    let script = std::fs::read_to_string(root().join("scripts/package/deb")).unwrap();
    let mut findings = vec![];
    for asset in assets {
        let from = asset[0].as_str().unwrap();
        let place = from.trim_end_matches('*');
        // What is built or written lies in the target folder of the workspace.
        let made = from.trim_start_matches("../../");
        let made = made.starts_with("target/") && script.contains(made);
        if !made && !root().join("core/cli").join(place).exists() {
            findings.push(format!("core/cli/Cargo.toml:1: there is no {from}"));
        }
    }
    expect_none("assets", &findings);
}
