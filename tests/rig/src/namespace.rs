//! A network namespace with both ends of a virtual Ethernet cable, for what has to be tried on real sockets.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// The end of the cable at which the emulated bus is.
pub const BUS_END: &str = "veth-bus";
/// The end of the cable at which the master is.
pub const MASTER_END: &str = "veth-master";

/// What a script ends with where the cable cannot be made.
const NO_CABLE: i32 = 99;

/// Runs a shell script in a namespace of its own, in which both ends of the cable are up. `$fast` in it is what gives a program
/// real-time priority, or nothing where the system grants none.
///
/// # Errors
/// Why there can be no such namespace here: a test says so, and is skipped.
pub fn with_cable(script: &str) -> Result<Output, String> {
    let script = format!(
        "ip link add {BUS_END} type veth peer name {MASTER_END} || exit {NO_CABLE}\n\
         for end in {BUS_END} {MASTER_END}; do\n\
           echo 1 > /proc/sys/net/ipv6/conf/$end/disable_ipv6; ip link set dev $end up || exit {NO_CABLE}\n\
         done\n\
         fast=; chrt -f 50 true 2>/dev/null && fast='chrt -f 50'\n{script}"
    );
    let mut refused = String::new();
    // Without the rights for the first, a namespace of users gives them for the second.
    for rights in [&["--net"][..], &["--user", "--map-root-user", "--net"]] {
        let output = Command::new("unshare")
            .args(rights)
            .args(["sh", "-c", &script])
            .output()
            .map_err(|error| format!("no unshare: {error}"))?;
        let told = String::from_utf8_lossy(&output.stderr).trim().to_string();
        if output.status.code() != Some(NO_CABLE) && !told.contains("unshare failed") {
            return Ok(output);
        }
        refused = told;
    }
    Err(format!("no network namespace can be made: {refused}"))
}

/// A program of the workspace that cargo has put beside the test that asks.
///
/// # Errors
/// It is not built: `cargo test --workspace` builds it, a test of one package need not.
pub fn program_beside(name: &str) -> Result<PathBuf, String> {
    let test = std::env::current_exe().map_err(|error| error.to_string())?;
    let folder = test.parent().and_then(Path::parent);
    let program = folder.map(|folder| folder.join(name)).unwrap_or_default();
    if program.exists() {
        Ok(program)
    } else {
        Err(format!(
            "{} is not built: cargo build -p {name}",
            program.display()
        ))
    }
}
