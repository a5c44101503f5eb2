//! The Python client: its own tests, with the binary under test. They need nothing but Python's standard library.

use std::process::{Command, Stdio};

use crate::harness::root;

#[test]
fn the_python_client_passes_its_tests() {
    let version = "import sys; sys.exit(sys.version_info < (3, 9))";
    let python = Command::new("python3")
        .args(["-c", version])
        .stderr(Stdio::null())
        .status();
    if !python.is_ok_and(|status| status.success()) {
        println!("skipped: there is no Python 3.9 or newer");
        return;
    }
    let tests = Command::new("python3")
        .args(["-B", "-m", "unittest", "discover", "scripts/python/tests"])
        .current_dir(root())
        .env("TANDEM", env!("CARGO_BIN_EXE_tandem"))
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&tests.stderr);
    assert!(tests.status.success(), "{said}");
    assert!(said.contains("Ran 6 tests"), "{said}");
}

/// As `pip install scripts/python` does it, into an environment of its own, and without a network.
#[test]
fn pip_installs_the_client() {
    let folder = tempfile::TempDir::new().unwrap();
    let run = |program: &std::path::Path, arguments: &[&str]| {
        Command::new(program)
            .args(arguments)
            .current_dir(folder.path())
            .output()
            .map_err(|e| e.to_string())
    };
    let able = run(
        "python3".as_ref(),
        &["-c", "import ensurepip, venv, setuptools, wheel"],
    );
    if !able.is_ok_and(|output| output.status.success()) {
        println!("skipped: python3 has no ensurepip, venv, setuptools or wheel");
        return;
    }
    // A build writes beside its source.
    let copied = Command::new("cp")
        .arg("-r")
        .args([root().join("scripts/python"), folder.path().join("source")])
        .status()
        .unwrap();
    assert!(copied.success());
    let made = run(
        "python3".as_ref(),
        &["-m", "venv", "--system-site-packages", "venv"],
    )
    .unwrap();
    assert!(
        made.status.success(),
        "{}",
        String::from_utf8_lossy(&made.stderr)
    );
    let python = folder.path().join("venv/bin/python");
    let pip = [
        "-m",
        "pip",
        "install",
        "--no-index",
        "--no-build-isolation",
        "--no-deps",
        "./source",
    ];
    let installed = run(&python, &pip).unwrap();
    let said = String::from_utf8_lossy(&installed.stderr);
    assert!(installed.status.success(), "{said}");
    let found = run(
        &python,
        &[
            "-c",
            "import tandem_client; print(tandem_client.__file__, tandem_client.Client.__name__)",
        ],
    )
    .unwrap();
    let said = String::from_utf8_lossy(&found.stdout);
    assert!(
        said.contains("venv/lib") && said.ends_with("Client\n"),
        "{said}{}",
        String::from_utf8_lossy(&found.stderr)
    );
}

#[test]
fn its_types_are_right() {
    let mypy = Command::new("python3")
        .args(["-m", "mypy", "--version"])
        .output();
    if !mypy.is_ok_and(|output| output.status.success()) {
        println!("skipped: python3 has no mypy");
        return;
    }
    let folder = root().join("scripts/python");
    let checked = Command::new("python3")
        .args(["-m", "mypy", "--strict", "--cache-dir=/dev/null"])
        .args(["tandem_client", "examples", "tests"])
        .current_dir(folder)
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&checked.stdout);
    assert!(checked.status.success(), "{said}");
}
