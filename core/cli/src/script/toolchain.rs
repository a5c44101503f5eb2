//! Compilers that make WASM modules: where they are, and what to install where they are not.

use std::env;
use std::path::{Path, PathBuf};
use std::process::Command;

/// How to get each language's compiler.
pub const INSTALL_AS: &str =
    "npm install assemblyscript (beside the script), or npm install -g assemblyscript";
/// The same for C.
pub const INSTALL_C: &str = "apt-get install clang lld (or rustup, which brings a linker)";
/// The same for Rust.
pub const INSTALL_RUST: &str = "rustup target add wasm32-unknown-unknown";

/// The compiler of `AssemblyScript`: in a `node_modules` beside or above `near`, else on the path.
pub fn asc(near: &Path) -> Option<PathBuf> {
    let near = near.canonicalize().ok()?;
    let beside = near
        .ancestors()
        .map(|folder| folder.join("node_modules/.bin/asc"))
        .find(|asc| asc.is_file());
    beside.or_else(|| on_path("asc"))
}

/// A clang that knows WASM.
pub fn clang() -> Option<PathBuf> {
    let names = ["clang".to_string()]
        .into_iter()
        .chain((14..=22).rev().map(|v| format!("clang-{v}")));
    let knows = |clang: &PathBuf| {
        output(clang, &["--print-targets"]).is_some_and(|text| text.contains("wasm32"))
    };
    names.filter_map(|name| on_path(&name)).find(knows)
}

/// The linker of WASM modules: LLVM's, or the one that rustup ships.
pub fn wasm_ld() -> Option<PathBuf> {
    let mut names = ["wasm-ld".to_string()]
        .into_iter()
        .chain((14..=22).rev().map(|v| format!("wasm-ld-{v}")));
    names.find_map(|name| on_path(&name)).or_else(|| {
        let root = PathBuf::from(output(&on_path("rustc")?, &["--print", "sysroot"])?.trim());
        let hosts = root.join("lib/rustlib").read_dir().ok()?.flatten();
        hosts
            .map(|host| host.path().join("bin/gcc-ld/wasm-ld"))
            .find(|ld| ld.is_file())
    })
}

/// Cargo, where Rust's WASM target is installed.
pub fn cargo() -> Option<PathBuf> {
    let folder = output(
        &on_path("rustc")?,
        &[
            "--print",
            "target-libdir",
            "--target",
            "wasm32-unknown-unknown",
        ],
    )?;
    Path::new(folder.trim())
        .is_dir()
        .then(|| on_path("cargo"))?
}

/// What `program` prints, where it can be run and succeeds.
pub fn output(program: &Path, arguments: &[&str]) -> Option<String> {
    let output = Command::new(program).args(arguments).output().ok()?;
    output
        .status
        .success()
        .then(|| String::from_utf8_lossy(&output.stdout).into_owned())
}

fn on_path(name: &str) -> Option<PathBuf> {
    let folders = env::var_os("PATH")?;
    env::split_paths(&folders)
        .map(|folder| folder.join(name))
        .find(|file| file.is_file())
}
