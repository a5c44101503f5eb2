//! The controller as a service of the computer: killed as nothing can prevent, started again, told by systemd's protocol when it
//! is ready and that it is to end.

use std::os::linux::net::SocketAddrExt as _;
use std::os::unix::net::{SocketAddr, UnixDatagram};
use std::process::Command;
use std::time::Duration;

use rustix::process::{Pid, Signal, kill_process};
use serde_json::json;
use tempfile::TempDir;

use crate::clients::Served;
use crate::harness::{mill, root};

/// A line that takes ten seconds, and two that write behind it.
const PART: &str =
    "G21 G90\nG1 X1 F6000\n#500 = 7\nG10 L2 P3 X4\nG1 X2\nG1 X90 F540\n#501 = 8\nM2\n";

/// Truth after trouble, last row: what was acknowledged and what the path had reached is there, what it had not is not, the job is
/// lost and says where, and where the machine stands is asked of its drives.
#[test]
fn a_controller_that_is_killed_shows_what_is_true_when_it_is_started_again() {
    let folder = TempDir::new().unwrap();
    let state = ["--state", "state.sqlite"];
    let served = Served::with(folder, &mill(), &state, |_| ());
    let answers = served.ask(&[
        json!({ "request": "lease", "how": "take" }),
        json!({ "request": "set-tool", "number": 3, "diameter_mm": 6.0, "in_spindle": true }),
        json!({ "request": "touch-off", "system": "G55", "x_mm": -12.5 }),
        json!({ "request": "load", "text": PART, "name": "part.ngc" }),
        json!({ "request": "start" }),
    ]);
    let hash = answers[3]["hash"].clone();
    let moving = served.wait("on its long line", |status| {
        status["line"] == 6 && status["position"]["x_mm"].as_f64() > Some(5.0)
    });
    assert_eq!(moving["state"], "running");
    // The journal is written four times a second, off the loops.
    std::thread::sleep(Duration::from_millis(600));
    let folder = served.kill();

    let served = Served::with(folder, &mill(), &state, |_| ());
    let answers = served.ask(&[
        json!({ "request": "status" }),
        json!({ "request": "tables" }),
        json!({ "request": "history" }),
        json!({ "request": "lease", "how": "take" }),
        json!({ "request": "mdi", "line": "G1 X[#500] Y[#501 + 1] F6000" }),
    ]);
    let (status, tables, history) = (&answers[0], &answers[1], &answers[2]);
    // Simulated drives stand at their start when they are switched on, wherever those before them have gone.
    assert_eq!(
        (&status["position"]["x_mm"], &status["state"]),
        (&json!(0.0), &json!("ready"))
    );
    assert_eq!(
        (&status["tool"], &status["spindle_rpm"], &status["line"]),
        (&json!(3), &json!(0.0), &json!(0))
    );
    assert_eq!(status["job"], json!(null));
    let text = tables.to_string();
    assert!(text.contains("12.5") && text.contains("G56"), "{text}");
    let job = &history["jobs"][0];
    assert_eq!(
        (&job["name"], &job["outcome"], &job["hash"]),
        (&json!("part.ngc"), &json!("lost"), &hash)
    );
    let driven = &history["driven_before"];
    assert_eq!(
        (&driven["line"], &driven["hash"]),
        (&json!(6), &hash),
        "{history}"
    );
    // #500 was reached, #501 was not.
    served.wait("at #500 and behind no #501", |status| {
        status["position"]["x_mm"] == 7.0 && status["position"]["y_mm"] == 1.0
    });
}

/// A machine with incremental encoders is to be homed again, though it was.
#[test]
fn what_was_homed_is_not_believed_to_be_behind_a_kill() {
    let machine = root().join("examples/machines/mill-homing.toml");
    let state = [
        "--state",
        "state.sqlite",
        "--set",
        "driver.options.unknown_start_mm=1",
    ];
    let fast: Vec<&str> = ["x", "y", "z"]
        .iter()
        .flat_map(|axis| match *axis {
            "z" => ["--set", "homing.z.switch_mm=101.5"],
            "x" => ["--set", "homing.x.search_mm_per_min=-14000"],
            _ => ["--set", "homing.y.search_mm_per_min=-14000"],
        })
        .chain([
            "--set",
            "homing.x.back_off_mm=40",
            "--set",
            "homing.y.back_off_mm=40",
        ])
        .chain([
            "--set",
            "homing.x.latch_mm_per_min=1500",
            "--set",
            "homing.y.latch_mm_per_min=1500",
        ])
        .collect();
    let arguments: Vec<&str> = state.into_iter().chain(fast).collect();
    let served = Served::with(TempDir::new().unwrap(), &machine, &arguments, |_| ());
    served.ask(&[
        json!({ "request": "lease", "how": "take" }),
        json!({ "request": "home" }),
    ]);
    served.wait("homed", |status| status["state"] == "ready");
    let served = Served::with(served.kill(), &machine, &arguments, |_| ());
    let status = &served.ask(&[json!({ "request": "status" })])[0];
    assert_eq!(
        (&status["state"], &status["not_homed"]),
        (&json!("homing-needed"), &json!(["x", "y", "z"]))
    );
}

/// What `sd_notify` would say: one datagram for each word, over a socket in a folder or with an abstract name.
#[test]
fn systemd_is_told_when_the_doors_are_open_and_that_the_machine_is_being_stopped() {
    for is_abstract in [false, true] {
        let folder = TempDir::new().unwrap();
        let path = folder.path().join("notify");
        let name = format!("tandem-test-{}", std::process::id());
        let (systemd, place) = if is_abstract {
            let address = SocketAddr::from_abstract_name(name.as_bytes()).unwrap();
            (
                UnixDatagram::bind_addr(&address).unwrap(),
                format!("@{name}"),
            )
        } else {
            (
                UnixDatagram::bind(&path).unwrap(),
                path.to_str().unwrap().to_string(),
            )
        };
        systemd
            .set_read_timeout(Some(Duration::from_mins(1)))
            .unwrap();
        let hear = || {
            let mut bytes = [0; 256];
            let count = systemd.recv(&mut bytes).unwrap();
            String::from_utf8_lossy(&bytes[..count]).into_owned()
        };
        let state = ["--state", "state.sqlite"];
        let mut served = Served::with(folder, &mill(), &state, |command| {
            command.env("NOTIFY_SOCKET", place);
        });
        assert_eq!(hear(), "READY=1");
        served.ask(&[
            json!({ "request": "lease", "how": "take" }),
            json!({ "request": "set-parameter", "number": 600, "value": 2.5 }),
            json!({ "request": "mdi", "line": "G1 X90 F600" }),
        ]);
        served.wait("moving", |status| {
            status["position"]["x_mm"].as_f64() > Some(1.0)
        });
        let pid = Pid::from_child(&served.child);
        kill_process(pid, Signal::TERM).unwrap();
        assert_eq!(hear(), "STOPPING=1");
        assert_eq!(served.child.wait().unwrap().code(), Some(0));
        // It has come to rest on the path, and what it did is written.
        let folder = served.kill();
        let served = Served::with(folder, &mill(), &state, |_| ());
        let history = &served.ask(&[json!({ "request": "history" })])[0];
        assert_eq!(history["jobs"][0]["outcome"], "aborted", "{history}");
    }
}

/// The unit file goes with what the command takes.
#[test]
fn the_unit_file_starts_the_command_with_options_that_it_has() {
    let unit = std::fs::read_to_string(root().join("scripts/package/tandem@.service")).unwrap();
    let start = unit
        .lines()
        .find_map(|line| line.strip_prefix("ExecStart="))
        .unwrap();
    let help = Command::new(env!("CARGO_BIN_EXE_tandem"))
        .args(["serve", "--help"])
        .output()
        .unwrap();
    let help = String::from_utf8_lossy(&help.stdout);
    let mut options = start
        .split(' ')
        .filter(|word| word.starts_with("--"))
        .peekable();
    assert!(options.peek().is_some(), "{start}");
    for option in options {
        assert!(help.contains(&format!("{option} ")), "{option}: {help}");
    }
    assert!(unit.contains("Type=notify") && unit.contains("StateDirectory=tandem"));
}

/// What the package is made of is there, or is made by the script that packs it; paths are those that cargo-deb takes.
#[test]
fn every_file_of_the_package_is_there_or_made_by_its_script() {
    let manifest = std::fs::read_to_string(root().join("core/cli/Cargo.toml")).unwrap();
    let script = std::fs::read_to_string(root().join("scripts/package/deb")).unwrap();
    let (_, assets) = manifest.split_once("\nassets = [\n").unwrap();
    let sources: Vec<&str> = assets
        .lines()
        .map_while(|line| line.trim().strip_prefix("[\"")?.split('"').next())
        .collect();
    assert!(sources.len() > 8, "{sources:?}");
    for source in sources {
        if source == "target/release/tandem" {
            continue;
        }
        let place = source
            .strip_prefix("../../")
            .unwrap_or_else(|| panic!("{source}"));
        let is_made = place.starts_with("target/") && script.contains(&format!("> {place}\n"));
        let is_there = root().join(place.trim_end_matches('*')).exists();
        assert!(
            is_made || is_there && !place.starts_with("target/"),
            "{source}"
        );
    }
}
