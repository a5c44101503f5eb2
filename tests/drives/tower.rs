//! The whole tower on the emulated mill of `examples/machines/ethercat.toml`: a day under the resident controller, and the cutting
//! torque held by what its drives tell.

use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value;

fn examples() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples")
}

/// What clients are told in a script of requests, on the example machine with these faults; and what became of the jobs.
struct Day {
    lines: Vec<Value>,
    text: String,
}

impl Day {
    fn of(faults: &str, script: &str) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let machine = folder.path().join("machine.toml");
        let text = std::fs::read_to_string(examples().join("machines/ethercat.toml")).unwrap();
        std::fs::write(&machine, text + faults).unwrap();
        let requests = folder.path().join("requests.jsonl");
        std::fs::write(&requests, script).unwrap();
        let output = Command::new(env!("CARGO_BIN_EXE_tandem"))
            .args(["serve", "--clock", "virtual", "--machine"])
            .arg(&machine)
            .arg("--requests")
            .arg(&requests)
            .arg("--programs")
            .arg(examples().join("programs"))
            .output()
            .unwrap();
        let text =
            String::from_utf8_lossy(&output.stdout) + String::from_utf8_lossy(&output.stderr);
        let lines = text
            .lines()
            .filter_map(|line| serde_json::from_str(line).ok())
            .collect();
        Self {
            lines,
            text: text.to_string(),
        }
    }

    /// Kind and outcome of each job, in their order.
    fn jobs(&self) -> Vec<(&str, &str)> {
        self.lines
            .iter()
            .filter(|line| line["told"]["event"] == "job")
            .map(|line| {
                let job = &line["told"]["job"];
                (
                    job["job"].as_str().unwrap_or_default(),
                    job["outcome"].as_str().unwrap_or_default(),
                )
            })
            .collect()
    }

    /// The answer to the request of this id.
    fn answer(&self, id: u64) -> &Value {
        let line = self
            .lines
            .iter()
            .find(|line| line["told"]["id"] == id && line["client"] == 1);
        &line.unwrap_or_else(|| panic!("{id} has no answer: {}", self.text))["told"]
    }
}

/// Homed by the drives, jogged, touched off by the probe, lines by hand, a program, a drive's fault in its middle, reset, the
/// program again: all in one process that keeps its drives.
#[test]
fn a_day_at_the_emulated_mill() {
    let script = r#"
{"tick":100,"client":1,"say":{"id":1,"request":"lease","how":"take"}}
{"tick":100,"client":1,"say":{"id":2,"request":"home"}}
{"tick":16000,"client":1,"say":{"id":3,"request":"jog","axis":"x","feed_mm_per_min":3000,"distance_mm":10}}
{"tick":17000,"client":1,"say":{"id":4,"request":"mdi","line":"G38.2 Z-40 F600"}}
{"tick":22000,"client":1,"say":{"id":5,"request":"touch-off","z_mm":0}}
{"tick":22100,"client":1,"say":{"id":6,"request":"mdi","line":"G0 Z5"}}
{"tick":24000,"client":1,"say":{"id":7,"request":"load","path":"square.ngc"}}
{"tick":24010,"client":1,"say":{"id":8,"request":"start"}}
{"tick":28000,"client":1,"say":{"id":9,"request":"start"}}
{"tick":28100,"client":1,"say":{"id":10,"request":"reset"}}
{"tick":32000,"client":1,"say":{"id":11,"request":"status"}}
{"tick":32010,"client":1,"say":{"id":12,"request":"start"}}
"#;
    let whole = Day::of("", script);
    let done =
        ["home", "jog", "mdi", "mdi", "program", "program", "program"].map(|job| (job, "done"));
    assert!(
        whole.answer(10)["error"].is_object(),
        "there is nothing to reset"
    );
    assert_eq!(whole.jobs(), done, "{}", whole.text);
    // The plate of the probe is at -20 mm; it was called 0 where the axis came to rest behind it.
    let z = whole.answer(11)["ok"]["offset"]["z_mm"].as_f64().unwrap();
    assert!((-20.2..-20.0).contains(&z), "{z}");

    let fault = "[[drivers.bus.options.emulated.faults]]\nat = { ms = 25000.0 }\n\
                 what = { kind = \"drive-fault\", device = 1, code = 0x7305 }\n";
    let day = Day::of(fault, script);
    let jobs = day.jobs();
    assert_eq!(jobs[..4], done[..4], "{}", day.text);
    assert_eq!(jobs[4], ("program", "fault"), "{}", day.text);
    assert!(
        day.text
            .contains("the drive of axis Y reports fault 0x7305 (device 1: encoder 1)"),
        "{}",
        day.text
    );
    // It has to be reset, and goes on then, where everything still stands as it was homed and touched off.
    assert_eq!(day.answer(9)["error"]["state"], "fault");
    assert!(day.answer(10)["ok"].is_object(), "{}", day.text);
    let status = &day.answer(11)["ok"];
    assert_eq!(
        (&status["state"], &status["not_homed"]),
        (&Value::from("ready"), &Value::Array(vec![]))
    );
    assert_eq!(status["offset"]["z_mm"].as_f64(), Some(z));
    assert_eq!(jobs.last(), Some(&("program", "done")), "{}", day.text);
}

/// The cable is pulled in mid-program: a reset says that nothing answers until it is plugged in again, and then finds the drives
/// where they came to rest by themselves, with what they count.
#[test]
fn a_bus_that_was_lost_comes_back_by_a_reset_where_its_drives_stand() {
    let pulled = "[[drivers.bus.options.emulated.faults]]\nat = { ms = 25000.0 }\nlasts = { ms = 2000.0 }\n\
                  what = { kind = \"cut\" }\n";
    let script = r#"
{"tick":100,"client":1,"say":{"id":1,"request":"lease","how":"take"}}
{"tick":100,"client":1,"say":{"id":2,"request":"home"}}
{"tick":16000,"client":1,"say":{"id":3,"request":"mdi","line":"G1 X10 F3000"}}
{"tick":22000,"client":1,"say":{"id":4,"request":"touch-off","z_mm":7}}
{"tick":24500,"client":1,"say":{"id":5,"request":"mdi","line":"G1 X60 F1800"}}
{"tick":28000,"client":1,"say":{"id":6,"request":"status"}}
{"tick":28100,"client":1,"say":{"id":7,"request":"reset"}}
{"tick":28200,"client":1,"say":{"id":8,"request":"reset"}}
{"tick":28300,"client":1,"say":{"id":9,"request":"reset"}}
{"tick":28400,"client":1,"say":{"id":10,"request":"reset"}}
{"tick":28500,"client":1,"say":{"id":11,"request":"reset"}}
{"tick":28600,"client":1,"say":{"id":12,"request":"reset"}}
{"tick":32000,"client":1,"say":{"id":14,"request":"status"}}
{"tick":32010,"client":1,"say":{"id":15,"request":"home"}}
{"tick":60000,"client":1,"say":{"id":16,"request":"mdi","line":"G1 X20 F3000"}}
{"tick":66000,"client":1,"say":{"id":17,"request":"status"}}
"#;
    let day = Day::of(pulled, script);
    let (lost, back) = (&day.answer(6)["ok"], &day.answer(14)["ok"]);
    let at = |status: &Value, axis: &str| status["position"][axis].as_f64().unwrap();
    assert_eq!(lost["state"], "fault", "{}", day.text);
    assert_eq!(lost["joints"][0]["state"], "lost", "{}", day.text);
    let refused = day.answer(7)["error"]["why"].as_str().unwrap_or_default();
    assert!(
        refused.contains("drivers.bus: driver bus (ethercat): ethercat: ")
            && refused.contains("is it powered, and the first cable at its input port?"),
        "{refused}"
    );
    let accepted = (8..=12).filter(|id| day.answer(*id)["ok"].is_object());
    assert_eq!(accepted.count(), 1, "{}", day.text);
    // They stand where they were when the cable was pulled: the ramp behind that is one that nobody heard. A bus that was given
    // its power anew would stand at 11.9 mm.
    assert_eq!(back["state"], "homing-needed", "{}", day.text);
    let (told, stands) = (at(lost, "x_mm"), at(back, "x_mm"));
    assert!(
        15.0 < stands && stands < told && told < 16.0,
        "{stands} {told}"
    );
    assert_eq!(back["offset"]["z_mm"].as_f64(), Some(-7.0));
    let jobs = [
        ("home", "done"),
        ("mdi", "done"),
        ("mdi", "fault"),
        ("home", "done"),
    ];
    assert_eq!(day.jobs()[..4], jobs, "{}", day.text);
    assert_eq!(day.jobs().last(), Some(&("mdi", "done")), "{}", day.text);
    assert_eq!(at(&day.answer(17)["ok"], "x_mm"), 20.0);
}

/// The force that the drives tell by 6077 is held by the feed, in a specimen whose steps take ever more of it.
#[test]
fn the_cutting_torque_is_held_by_what_the_drives_tell() {
    let folder = tempfile::tempdir().unwrap();
    let trace = folder.path().join("trace.csv");
    let output = Command::new(env!("CARGO_BIN_EXE_tandem"))
        .arg("run")
        .arg(examples().join("programs/force-drives.ngc"))
        .arg("--machine")
        .arg(examples().join("machines/ethercat-force.toml"))
        .args(["--home", "--trace"])
        .arg(&trace)
        .output()
        .unwrap();
    let told = String::from_utf8_lossy(&output.stdout) + String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(0), "{told}");
    let mut rows = csv::Reader::from_path(&trace).unwrap();
    let head = rows.headers().unwrap().clone();
    let place = |name: &str| head.iter().position(|column| column == name).unwrap();
    let (line, at, torque, feed) = (
        place("line"),
        place("x_fb_mm"),
        place("sig_torque_nm"),
        place("feed_mm_s"),
    );
    let rows: Vec<(f64, f64, f64)> = rows
        .records()
        .map(Result::unwrap)
        .filter(|row| &row[line] == "5")
        .map(|row| [at, torque, feed].map(|column| row[column].parse::<f64>().unwrap()))
        .map(|[at, torque, feed]| (at, torque, feed * 60.0))
        .collect();
    let mut feeds = vec![];
    for step_mm in [60.0, 80.0, 100.0] {
        // Behind the entry, where the law has had its time.
        let within = rows
            .iter()
            .filter(|row| (step_mm + 8.0..step_mm + 19.0).contains(&row.0));
        let (torques, speeds): (Vec<f64>, Vec<f64>) = within.map(|row| (row.1, row.2)).unzip();
        let mean = |of: &[f64]| of.iter().sum::<f64>() / of.len() as f64;
        let held = mean(&torques);
        assert!((held - 0.1).abs() < 0.005, "from {step_mm} mm: {held} N·m");
        feeds.push(mean(&speeds));
    }
    // 0.1 N·m is taken at 150, 100 and 75 mm/min.
    for (feed, expected) in feeds.iter().zip([150.0, 100.0, 75.0]) {
        assert!((feed / expected - 1.0_f64).abs() < 0.07, "{feeds:?}");
    }
    let air = rows
        .iter()
        .filter(|row| row.0 > 122.0)
        .map(|row| row.2)
        .fold(0.0, f64::max);
    assert!(
        air > 250.0,
        "behind the specimen it goes as fast as in air: {air}"
    );
}

/// Lost frames and the phase are in the trace, in the summary and in the report of a run.
#[test]
fn lost_frames_and_the_phase_are_in_what_a_run_leaves() {
    let folder = tempfile::tempdir().unwrap();
    let machine = folder.path().join("machine.toml");
    let text = std::fs::read_to_string(examples().join("machines/ethercat.toml")).unwrap();
    let text = text.replacen(
        "max_lost_frames = 2\n",
        "max_lost_frames = 2\nsync = \"dc\"\n",
        1,
    );
    let lost = "[[drivers.bus.options.emulated.faults]]\nat = { cycle = 1200 }\nlasts = { cycles = 2 }\n\
                what = { kind = \"lost-reply\" }\n";
    std::fs::write(&machine, text + lost).unwrap();
    let path = |name: &str| folder.path().join(name);
    let output = Command::new(env!("CARGO_BIN_EXE_tandem"))
        .arg("run")
        .arg(examples().join("programs/square.ngc"))
        .args(["--set", "machine.require_homing=false", "--machine"])
        .arg(&machine)
        .arg("--trace")
        .arg(path("trace.ttr"))
        .arg("--summary")
        .arg(path("summary.json"))
        .arg("--report")
        .arg(path("report.html"))
        .output()
        .unwrap();
    let told = String::from_utf8_lossy(&output.stdout) + String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(0), "{told}");
    let words = "what the drives tell was old in 2 samples, by 2 periods at most: frames were lost, or late";
    assert!(told.contains(words), "{told}");
    let export = Command::new(env!("CARGO_BIN_EXE_tandem"))
        .args(["trace", "export"])
        .arg(path("trace.ttr"))
        .arg("--csv")
        .arg(path("trace.csv"))
        .status();
    assert!(export.unwrap().success());
    let mut rows = csv::Reader::from_path(path("trace.csv")).unwrap();
    let head = rows.headers().unwrap().clone();
    let place = |name: &str| head.iter().position(|column| column == name).unwrap();
    let (age, phase, t_s) = (place("fb_age_periods"), place("phase_ns"), place("t_s"));
    let rows: Vec<_> = rows.records().map(Result::unwrap).collect();
    let ages: Vec<&str> = rows
        .iter()
        .map(|row| &row[age])
        .filter(|age| *age != "0")
        .collect();
    assert_eq!(ages, ["1", "2"]);
    for row in &rows {
        // Nothing is known of the phase of a frame that did not come back.
        assert_eq!(&row[phase] == "nan", &row[age] != "0", "{}", &row[t_s]);
    }
    let summary = std::fs::read_to_string(path("summary.json")).unwrap();
    let summary: Value = serde_json::from_str(&summary).unwrap();
    assert_eq!(
        (
            &summary["old_feedback_samples"],
            &summary["max_feedback_age_periods"]
        ),
        (&2.into(), &2.into())
    );
    let phase_us = summary["max_phase_us"].as_f64().unwrap();
    assert!((0.0..20.0).contains(&phase_us), "{phase_us}");
    let report = std::fs::read_to_string(path("report.html")).unwrap();
    for shown in [
        "age of feedback",
        "phase of the exchange",
        "largest phase of an exchange",
        words,
    ] {
        assert!(report.contains(shown), "the report has no {shown}");
    }
}
