//! `tandem script build`.

use std::path::{Path, PathBuf};
use std::process::Command;

use tandem_policy::{Budget, Engine, Instance};

use super::toolchain::{self, INSTALL_AS, INSTALL_C, INSTALL_RUST};

/// Builds `source`, a `.ts`, a `.c` or the folder of a Rust crate, to `out`, or beside the source; then starts it once.
pub fn build(source: &Path, out: Option<&Path>) -> Result<u8, String> {
    let out = out.map_or_else(|| source.with_extension("wasm"), Path::to_owned);
    let ending = source
        .extension()
        .map(|e| e.to_string_lossy().into_owned())
        .unwrap_or_default();
    match ending.as_str() {
        _ if source.is_dir() => rust(source, &out)?,
        "ts" => assembly_script(source, &out)?,
        "c" => c(source, &out)?,
        _ => {
            return Err(format!(
                "{}: not a .ts, a .c or the folder of a Rust crate",
                source.display()
            ));
        }
    }
    let bytes = std::fs::read(&out).map_err(|e| format!("{}: {e}", out.display()))?;
    let script = Engine::new().and_then(|engine| engine.compile(&bytes));
    let started = script.and_then(|script| Instance::new(&script, &Budget::default(), &[]));
    started.map_err(|e| format!("{}: {e}", out.display()))?;
    say!("{}: {} bytes", out.display(), bytes.len());
    Ok(0)
}

fn assembly_script(source: &Path, out: &Path) -> Result<(), String> {
    let near = source
        .parent()
        .filter(|p| !p.as_os_str().is_empty())
        .unwrap_or(Path::new("."));
    let asc = toolchain::asc(near).ok_or(format!(
        "the AssemblyScript compiler is missing: {INSTALL_AS}"
    ))?;
    let fixed = [
        "-O3",
        "--runtime",
        "stub",
        "--use",
        "abort=",
        "--noAssert",
        "-o",
    ];
    // The compiler takes only paths below its folder, and the SDK may lie beside the folder of the script.
    let source = absolute(source)?;
    let out = std::path::absolute(out).map_err(|e| format!("{}: {e}", out.display()))?;
    run(Command::new(asc).arg(source).args(fixed).arg(out))
}

fn c(source: &Path, out: &Path) -> Result<(), String> {
    let missing = || format!("a C compiler for WASM is missing: {INSTALL_C}");
    let (clang, ld) = toolchain::clang()
        .zip(toolchain::wasm_ld())
        .ok_or_else(missing)?;
    let object = out.with_extension("o");
    let fixed = [
        "--target=wasm32",
        "-O2",
        "-ffreestanding",
        "-fno-builtin-memset",
        "-nostdlib",
        "-Wall",
        "-c",
        "-o",
    ];
    run(Command::new(clang).args(fixed).arg(&object).arg(source))?;
    let fixed = ["--no-entry", "-z", "stack-size=8192", "--strip-all", "-o"];
    let linked = run(Command::new(ld).args(fixed).arg(out).arg(&object));
    let _ = std::fs::remove_file(&object);
    linked
}

fn rust(folder: &Path, out: &Path) -> Result<(), String> {
    let cargo =
        toolchain::cargo().ok_or(format!("Rust's WASM target is missing: {INSTALL_RUST}"))?;
    let target = absolute(folder)?.join("target");
    let fixed = [
        "build",
        "--quiet",
        "--release",
        "--target",
        "wasm32-unknown-unknown",
        "--manifest-path",
    ];
    // What the caller's own cargo was told is not meant for this build.
    let mut command = Command::new(cargo);
    command
        .args(fixed)
        .arg(folder.join("Cargo.toml"))
        .arg("--target-dir")
        .arg(&target)
        .env_remove("RUSTFLAGS");
    run(&mut command)?;
    let modules = target.join("wasm32-unknown-unknown/release");
    let made = modules
        .read_dir()
        .into_iter()
        .flatten()
        .flatten()
        .map(|entry| entry.path());
    let module = made
        .into_iter()
        .find(|path| path.extension().is_some_and(|e| e == "wasm"));
    let module = module.ok_or_else(|| {
        format!(
            "{}: the crate makes no module: is it a cdylib?",
            folder.display()
        )
    })?;
    std::fs::copy(&module, out)
        .map(drop)
        .map_err(|e| format!("{}: {e}", out.display()))
}

fn absolute(path: &Path) -> Result<PathBuf, String> {
    path.canonicalize()
        .map_err(|e| format!("{}: {e}", path.display()))
}

/// Runs a compiler; its words go to standard error.
fn run(command: &mut Command) -> Result<(), String> {
    let name = command.get_program().to_string_lossy().into_owned();
    let output = command.output().map_err(|e| format!("{name}: {e}"))?;
    for text in [&output.stdout, &output.stderr] {
        let text = String::from_utf8_lossy(text);
        if !text.trim().is_empty() {
            say!("{}", text.trim_end());
        }
    }
    if output.status.success() {
        Ok(())
    } else {
        Err(format!("{name}: {}", output.status))
    }
}
