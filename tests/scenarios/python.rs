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
