//! Shared libraries for the tests. Cargo builds them from what the workspace has fetched: no network is needed.

use std::env::consts::{DLL_PREFIX, DLL_SUFFIX};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::{Mutex, OnceLock};

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

/// A built-in plugin as a shared library: its crate says nothing of one, and has no feature for it. Alone it takes other features of
/// what it depends on than the workspace does, those of plugins outside: so it is built beside them.
pub fn built_in(package: &str) -> PathBuf {
    let mut command = cargo();
    command
        .current_dir(root())
        .args(["rustc", "--offline", "--locked", "--lib"]);
    run(command.args(["--crate-type", "cdylib", "-p", package]));
    third_party_target().join("debug").join(file(package))
}

/// The mill's file without the table `section` and those below it.
pub fn mill_without(section: &str) -> String {
    let (text, table) = (
        std::fs::read_to_string(mill()).unwrap(),
        format!("[{section}"),
    );
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
