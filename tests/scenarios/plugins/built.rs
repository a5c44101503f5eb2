//! Shared libraries for the tests. Cargo builds them from what the workspace has fetched: no network is needed.

use std::env::consts::{DLL_PREFIX, DLL_SUFFIX};
use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::{Mutex, OnceLock};

use toml::{Table, Value};

use crate::harness::{mill, root};

/// The `target` folder of the workspace.
fn target() -> &'static Path {
    Path::new(env!("CARGO_BIN_EXE_tandem"))
        .ancestors()
        .nth(2)
        .unwrap()
}

/// Where plugins are built that others may have written, all with the same settings, so that they share what they depend on.
pub fn third_party_target() -> PathBuf {
    target().join("third-party")
}

/// Cargo for such plugins.
pub fn cargo() -> Command {
    let mut cargo = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    cargo
        .env("CARGO_TERM_COLOR", "never")
        .env("CARGO_TARGET_DIR", third_party_target())
        .env("CARGO_INCREMENTAL", "0")
        .env("CARGO_PROFILE_DEV_DEBUG", "false")
        .env("CARGO_PROFILE_DEV_OPT_LEVEL", "1");
    cargo
}

/// Runs cargo, one at a time; what it prints goes into the failure.
pub fn run(cargo: &mut Command) -> String {
    static ONE: Mutex<()> = Mutex::new(());
    let _one = ONE
        .lock()
        .unwrap_or_else(std::sync::PoisonError::into_inner);
    let output = cargo.output().unwrap();
    let text = [output.stdout, output.stderr]
        .map(|bytes| String::from_utf8_lossy(&bytes).into_owned())
        .concat();
    assert!(output.status.success(), "{cargo:?}\n{text}");
    text
}

fn file(crate_name: &str) -> String {
    format!("{DLL_PREFIX}{}{DLL_SUFFIX}", crate_name.replace('-', "_"))
}

/// The plugin `name` of `tests/third-party`.
pub fn third_party(name: &str) -> PathBuf {
    static FOLDER: OnceLock<PathBuf> = OnceLock::new();
    let folder = FOLDER.get_or_init(|| {
        let manifest = root().join("tests/third-party/Cargo.toml");
        run(cargo()
            .args([
                "build",
                "--workspace",
                "--offline",
                "--locked",
                "--manifest-path",
            ])
            .arg(manifest));
        third_party_target().join("debug")
    });
    folder.join(file(name))
}

/// A built-in plugin as a shared library: its crate says nothing of one, and has no feature for it. So packages that do say it stand
/// around the same sources, all in one workspace: what they depend on is built once, and they are built beside each other.
pub fn built_in(package: &str) -> PathBuf {
    static FOLDER: OnceLock<PathBuf> = OnceLock::new();
    let folder = FOLDER.get_or_init(|| {
        let workspace = third_party_target().join("built-in");
        fs::create_dir_all(&workspace).unwrap();
        // Where every test is a process, one of them writes while the others wait.
        let lock = File::create(workspace.join("lock")).unwrap();
        lock.lock().unwrap();
        let manifest = write_workspace(&workspace);
        run(cargo()
            .args(["build", "--workspace", "--offline", "--manifest-path"])
            .arg(manifest));
        third_party_target().join("debug")
    });
    folder.join(file(package))
}

/// Writes the workspace of all built-in plugins as shared libraries into `folder`; gives its manifest.
fn write_workspace(folder: &Path) -> PathBuf {
    let plugins = fs::read_dir(root().join("plugins")).unwrap();
    let plugins = plugins.map(|entry| entry.unwrap().path());
    let plugins = plugins.chain([root().join("hal-drivers/sim")]);
    let members = plugins
        .map(|plugin| write_member(folder, &plugin))
        .collect();
    let mut manifest = read(&root().join("Cargo.toml"));
    manifest.remove("profile");
    lead_to(&root(), table(table(&mut manifest, "patch"), "crates-io"));
    let workspace = table(&mut manifest, "workspace");
    lead_to(&root(), table(workspace, "dependencies"));
    workspace.insert("members".into(), Value::Array(members));
    workspace.remove("exclude");
    fs::copy(root().join("Cargo.lock"), folder.join("Cargo.lock")).unwrap();
    let path = folder.join("Cargo.toml");
    fs::write(&path, manifest.to_string()).unwrap();
    path
}

/// Writes a package that makes a shared library of the sources in `plugin`; gives the name of its folder.
fn write_member(folder: &Path, plugin: &Path) -> Value {
    let mut package = read(&plugin.join("Cargo.toml"));
    for part in ["dev-dependencies", "bench"] {
        package.remove(part);
    }
    let source = plugin.join("src/lib.rs");
    let library = [
        ("path", source.to_str().unwrap().into()),
        ("crate-type", Value::Array(vec!["cdylib".into()])),
    ];
    let library = library.map(|(key, value)| (key.to_string(), value));
    package.insert("lib".into(), Value::Table(library.into_iter().collect()));
    let name = plugin.file_name().unwrap().to_str().unwrap();
    let member = folder.join(name);
    fs::create_dir_all(&member).unwrap();
    fs::write(member.join("Cargo.toml"), package.to_string()).unwrap();
    name.into()
}

fn read(manifest: &Path) -> Table {
    fs::read_to_string(manifest).unwrap().parse().unwrap()
}

fn table<'a>(manifest: &'a mut Table, key: &str) -> &'a mut Table {
    manifest[key].as_table_mut().unwrap()
}

/// Makes the paths of `dependencies`, which are told from `root`, lead there from anywhere.
fn lead_to(root: &Path, dependencies: &mut Table) {
    for (_, dependency) in dependencies.iter_mut() {
        if let Some(path) = dependency.get_mut("path") {
            *path = root.join(path.as_str().unwrap()).to_str().unwrap().into();
        }
    }
}

/// The mill's file without the table `section` and those below it.
pub fn mill_without(section: &str) -> String {
    let (text, table) = (fs::read_to_string(mill()).unwrap(), format!("[{section}"));
    let mut inside = false;
    let kept = text.lines().filter(|line| {
        inside = if line.starts_with('[') {
            line.starts_with(&table)
        } else {
            inside
        };
        !inside
    });
    kept.flat_map(|line| [line, "\n"]).collect()
}
