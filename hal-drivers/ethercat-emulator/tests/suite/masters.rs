//! Masters of others, in programs of their own, over a pair of virtual network interfaces in a namespace of their own. They
//! run on the wall clock, so they are smoke tests: what has to be exact is tested on virtual time.
//!
//! `pysoem` and `kickcat` come from PyPI into a folder below `target`, once. What is missing is said.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

const EMULATOR: &str = env!("CARGO_BIN_EXE_tandem-ethercat-emulator");

/// The Python that has a package, or why there is none.
fn python_with(package: &str, version: &str) -> Result<PathBuf, String> {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("python-{package}-{version}"));
    let python = folder.join("bin/python");
    let has = || {
        let found = Command::new(&python)
            .args(["-c", &format!("import {package}")])
            .output();
        found.is_ok_and(|found| found.status.success())
    };
    if !has() {
        let venv = Command::new("python3")
            .args(["-m", "venv"])
            .arg(&folder)
            .output();
        venv.map_err(|e| format!("no python3: {e}"))?;
        let install = [
            "-m",
            "pip",
            "install",
            "--quiet",
            "--disable-pip-version-check",
        ];
        let pip = Command::new(&python)
            .args(install)
            .arg(format!("{package}=={version}"))
            .output();
        let pip = pip.map_err(|e| format!("python3 makes no virtual environment: {e}"))?;
        if !pip.status.success() || !has() {
            let words = String::from_utf8_lossy(&pip.stderr);
            return Err(format!(
                "PyPI gives no {package} {version}: {}",
                words.lines().last().unwrap_or_default()
            ));
        }
    }
    Ok(python)
}

/// Runs a shell script in a network namespace with the two ends `veth-bus` and `veth-master` of a virtual cable.
fn in_namespace(script: &str) -> Result<Output, String> {
    let setup = "ip link add veth-bus type veth peer name veth-master && \
        for end in veth-bus veth-master; do \
          echo 1 > /proc/sys/net/ipv6/conf/$end/disable_ipv6; ip link set dev $end up || exit 99; \
        done || exit 99\n\
        fast=; chrt -f 50 true 2>/dev/null && fast='chrt -f 50'\n";
    let unshare = |options: &[&str]| {
        Command::new("unshare")
            .args(options)
            .args(["sh", "-c"])
            .arg(format!("{setup}{script}"))
            .output()
    };
    let output = unshare(&["--net"]).map_err(|e| format!("no unshare: {e}"))?;
    let refused = |output: &Output| {
        output.status.code() == Some(99)
            || String::from_utf8_lossy(&output.stderr).contains("unshare failed")
    };
    let output = if refused(&output) {
        unshare(&["--user", "--map-root-user", "--net"]).unwrap()
    } else {
        output
    };
    if refused(&output) {
        return Err(format!(
            "no network namespace: {}",
            String::from_utf8_lossy(&output.stderr).trim()
        ));
    }
    Ok(output)
}

fn bus() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/buses/mill.toml")
}

fn script_of(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("tests/suite")
        .join(name)
}

/// Runs a master against the emulator, up to three times: an ordinary kernel may stop either for longer than the master
/// waits. Answers what the last one printed, and what the emulator did.
fn master(package: &str, version: &str, script: &str) -> Result<(bool, String), String> {
    let python = python_with(package, version)?;
    let mut told = String::new();
    for _ in 0..3 {
        let shell = format!(
            "$fast {EMULATOR} {bus} --interface veth-bus --for 60 & emulator=$!; sleep 0.3; \
             $fast timeout 50 {python} {script} veth-master 2>&1; code=$?; kill $emulator; exit $code",
            bus = bus().display(),
            python = python.display(),
            script = script_of(script).display(),
        );
        let output = in_namespace(&shell)?;
        told = String::from_utf8_lossy(&output.stdout).to_string()
            + &String::from_utf8_lossy(&output.stderr);
        if output.status.success() {
            return Ok((true, told));
        }
    }
    Ok((false, told))
}

#[test]
fn soem_remaps_reads_long_objects_and_enables_four_drives() {
    match master("pysoem", "1.1.13", "pysoem_master.py") {
        Err(why) => println!("skipped: {why}"),
        Ok((good, told)) => assert!(good && told.contains("done"), "{told}"),
    }
}

#[test]
fn kickcat_comes_to_operational() {
    match master("kickcat", "2.5", "kickcat_master.py") {
        Err(why) => println!("skipped: {why}"),
        Ok((good, told)) => assert!(good && told.contains("done"), "{told}"),
    }
}

#[test]
fn a_master_that_is_killed_or_stopped_is_noticed_by_the_emulators_own_clock() {
    let python = match python_with("pysoem", "1.1.13") {
        Ok(python) => python,
        Err(why) => return println!("skipped: {why}"),
    };
    for signal in ["KILL", "STOP"] {
        let told = (0..3)
            .map(|_| killed(&python, signal))
            .find(|told| match told {
                Ok(told) => told.contains("enabled"),
                Err(_) => true,
            });
        let told = match told.unwrap_or(Ok(String::new())) {
            Ok(told) => told,
            Err(why) => return println!("skipped: {why}"),
        };
        let after = told
            .split("silent\n")
            .nth(1)
            .unwrap_or_else(|| panic!("the master never enabled the drives: {told}"));
        for drive in 0..4 {
            let stopped = |line: &str| {
                line.contains(&format!("device {drive} "))
                    && line.contains("SafeOp, error 0x001B, Fault")
            };
            assert!(
                after.lines().any(stopped),
                "{signal}: device {drive} did not stop: {told}"
            );
        }
    }
}

/// Lets a master enable the drives, ends or stops it, and answers what the emulator told before and after.
fn killed(python: &Path, signal: &str) -> Result<String, String> {
    let shell = format!(
        "$fast {EMULATOR} {bus} --interface veth-bus --for 60 & emulator=$!; sleep 0.3; \
         log=$(mktemp); $fast {python} {script} veth-master stay > $log 2>&1 & master=$!; \
         n=0; while ! grep -q enabled $log && [ $n -lt 200 ] && kill -0 $master 2>/dev/null; do sleep 0.1; n=$((n+1)); done; \
         sleep 0.5; cat $log; echo silent; kill -{signal} $master; sleep 1; \
         kill -KILL $master 2>/dev/null; kill $emulator; rm $log",
        bus = bus().display(),
        python = python.display(),
        script = script_of("pysoem_master.py").display(),
    );
    in_namespace(&shell).map(|output| String::from_utf8_lossy(&output.stdout).to_string())
}

#[test]
fn an_interface_that_is_not_there_or_not_allowed_is_refused_in_words() {
    let run = |interface: &str| {
        Command::new(EMULATOR)
            .arg(bus())
            .args(["--interface", interface, "--for", "0.1"])
            .output()
            .unwrap()
    };
    let output = run("tandem-nowhere");
    let words = String::from_utf8_lossy(&output.stderr).to_string();
    let allowed = !words.contains("CAP_NET_RAW");
    assert_eq!(output.status.code(), Some(1));
    assert!(
        !allowed || words.contains("there is no network interface tandem-nowhere"),
        "{words}"
    );
    // Without the capability, in a user namespace without one of the network.
    let shell = format!(
        "exec {EMULATOR} {} --interface lo --for 0.1",
        bus().display()
    );
    let outside = Command::new("unshare")
        .args(["--user", "sh", "-c", &shell])
        .output();
    match outside {
        Ok(output) if !String::from_utf8_lossy(&output.stderr).contains("unshare") => {
            let words = String::from_utf8_lossy(&output.stderr).to_string();
            assert!(
                words.contains("CAP_NET_RAW") && output.status.code() == Some(1),
                "{words}"
            );
        }
        _ => println!("skipped: no user namespace to be without permission in"),
    }
}
