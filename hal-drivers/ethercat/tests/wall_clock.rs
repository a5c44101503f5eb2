//! The driver at a network interface, over a pair of virtual ones in a namespace of their own, on the wall clock. A smoke test:
//! what has to be exact is tested on virtual time. Where a namespace cannot be made it says so.

use std::path::Path;
use std::process::Command;

use tandem_ethercat::Survey;
use tandem_rig::{BUS_END, MASTER_END, program_beside, with_cable};

/// Set in the process that is within the namespace.
const WITHIN: &str = "TANDEM_TEST_WITHIN_NAMESPACE";

/// Runs this test again within a namespace with the two ends of a virtual cable, an emulator at one of them; what it printed, or
/// why that cannot be.
fn within_namespace(test: &str, before: &str) -> Result<String, String> {
    let emulator = program_beside("tandem-ethercat-emulator")?;
    let bus = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/buses/mill.toml");
    let script = format!(
        "{} {} --interface {BUS_END} --for 60 & emulator=$!; sleep 0.5\n{before}\n\
         {WITHIN}=1 {} --exact {test} --nocapture; code=$?; kill $emulator; exit $code",
        emulator.display(),
        bus.display(),
        std::env::current_exe().unwrap().display()
    );
    let run = with_cable(&script)?;
    let told = String::from_utf8_lossy(&run.stdout) + String::from_utf8_lossy(&run.stderr);
    assert!(run.status.success(), "{told}");
    Ok(told.to_string())
}

fn is_within() -> bool {
    std::env::var_os(WITHIN).is_some()
}

#[test]
fn a_bus_behind_a_network_interface_is_scanned_read_and_written() {
    if !is_within() {
        match within_namespace(
            "a_bus_behind_a_network_interface_is_scanned_read_and_written",
            "",
        ) {
            Ok(told) => assert!(told.contains("8 devices seen"), "{told}"),
            Err(why) => println!("skipped: {why}"),
        }
        return;
    }
    let mut survey = Survey::open(MASTER_END, None).unwrap();
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
    let taken = Survey::open(MASTER_END, None).err().unwrap();
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

#[test]
fn an_interface_that_is_down_is_refused_in_words() {
    if !is_within() {
        let down = format!("ip link set dev {MASTER_END} down");
        match within_namespace("an_interface_that_is_down_is_refused_in_words", &down) {
            Ok(told) => assert!(told.contains("refused"), "{told}"),
            Err(why) => println!("skipped: {why}"),
        }
        return;
    }
    let refused = Survey::open(MASTER_END, None).err().unwrap();
    let words =
        format!("the network interface {MASTER_END} is down: `ip link set {MASTER_END} up`");
    assert!(refused.contains(&words), "{refused}");
    println!("refused");
}

/// Without the capability, in a namespace of users that gives none of the network.
#[test]
fn without_the_capability_for_raw_sockets_it_is_refused_in_words() {
    const TEST: &str = "without_the_capability_for_raw_sockets_it_is_refused_in_words";
    if is_within() {
        let refused = Survey::open("lo", None).err().unwrap();
        assert!(refused.contains("CAP_NET_RAW"), "{refused}");
        println!("refused");
        return;
    }
    let run = Command::new("unshare")
        .args(["--user", "--"])
        .arg(std::env::current_exe().unwrap())
        .args(["--exact", TEST, "--nocapture"])
        .env(WITHIN, "1")
        .output();
    let Ok(run) = run else {
        return println!("skipped: no unshare");
    };
    let told = String::from_utf8_lossy(&run.stdout) + String::from_utf8_lossy(&run.stderr);
    if told.contains("unshare failed") {
        return println!("skipped: no user namespace to be without permission in: {told}");
    }
    assert!(run.status.success() && told.contains("refused"), "{told}");
}
