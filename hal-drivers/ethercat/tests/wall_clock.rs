//! The driver at a network interface, over a pair of virtual ones in a namespace of their own, on the wall clock. A smoke test:
//! what has to be exact is tested on virtual time. Where a namespace cannot be made it says so.

use std::path::Path;
use std::process::Command;

use tandem_ethercat::Survey;

/// Set in the process that is within the namespace.
const WITHIN: &str = "TANDEM_TEST_WITHIN_NAMESPACE";
/// The master's end.
const MASTER: &str = "veth-master";

/// Runs this test again within a namespace with the two ends of a virtual cable, an emulator at one of them; what it printed, or
/// why that cannot be.
fn within_namespace(test: &str) -> Result<String, String> {
    let binary = std::env::current_exe().unwrap();
    // Beside the tests of this package: the workspace's programs.
    let emulator = binary
        .parent()
        .and_then(Path::parent)
        .unwrap()
        .join("tandem-ethercat-emulator");
    if !emulator.exists() {
        return Err(format!("{} is not built", emulator.display()));
    }
    let bus = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/buses/mill.toml");
    let script = format!(
        "ip link add veth-bus type veth peer name {MASTER} && ip link set veth-bus up && ip link set {MASTER} up || exit 99\n\
         {} {} --interface veth-bus --for 60 & emulator=$!; sleep 0.5\n\
         {WITHIN}=1 {} --exact {test} --nocapture; code=$?; kill $emulator; exit $code",
        emulator.display(),
        bus.display(),
        binary.display()
    );
    let mut refused = String::new();
    for namespace in [&["--net"][..], &["--user", "--map-root-user", "--net"]] {
        let run = Command::new("unshare")
            .args(namespace)
            .args(["sh", "-c", &script])
            .output();
        let run = run.map_err(|error| format!("no unshare: {error}"))?;
        let told = String::from_utf8_lossy(&run.stdout) + String::from_utf8_lossy(&run.stderr);
        let cannot = run.status.code() == Some(99) || told.contains("unshare failed");
        if !cannot {
            assert!(run.status.success(), "{told}");
            return Ok(told.to_string());
        }
        refused = told.to_string();
    }
    Err(format!("no network namespace: {}", refused.trim()))
}

fn is_within() -> bool {
    std::env::var_os(WITHIN).is_some()
}

#[test]
fn a_bus_behind_a_network_interface_is_scanned_read_and_written() {
    if !is_within() {
        match within_namespace("a_bus_behind_a_network_interface_is_scanned_read_and_written") {
            Ok(told) => assert!(told.contains("8 devices seen"), "{told}"),
            Err(why) => println!("skipped: {why}"),
        }
        return;
    }
    let mut survey = Survey::open(MASTER, None).unwrap();
    let found = survey.scan().unwrap();
    assert_eq!(found.len(), 8);
    assert_eq!(
        (found[0].identity.vendor, found[0].identity.product),
        (0x0E1A, 0x0402)
    );
    assert_eq!(found[0].modes, ["pv", "hm", "csp", "csv"]);
    let value = tandem_ethercat::Value {
        number: 12_345_678,
        bits: 32,
    };
    survey.write(1, 0x6085, 0, value).unwrap();
    assert_eq!(survey.read(1, 0x6085, 0).unwrap(), value);
    // The interface is this process's alone.
    let taken = Survey::open(MASTER, None).err().unwrap();
    assert!(
        taken.contains("another process drives the interface"),
        "{taken}"
    );
    println!("{} devices seen", found.len());
}

#[test]
fn an_interface_that_is_not_there_is_refused_in_words() {
    let refused = Survey::open("tandem-nowhere", None).err().unwrap();
    let known = [
        "there is no network interface tandem-nowhere",
        "CAP_NET_RAW",
    ];
    assert!(
        known.iter().any(|words| refused.contains(words)),
        "{refused}"
    );
}
