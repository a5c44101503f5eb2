//! Spindle, coolant and outputs in the trace and in the file of events: who switched what, and when.

use std::f64::consts::PI;
use std::path::Path;
use std::process::Command;

use crate::harness::{Done, Scenario, mill};

/// Lines 6 and 7 move to and fro at 50 mm/s.
const PROGRAM: &str =
    "G21 G90 F3000\nM3 S1000\nM64 P3\nM64 P7\nM8\nG1 X10\nG1 X0\nM65 P3\nM4 S500\nG1 X5\nM2\n";

const KEPT: [&str; 2] = ["--set", "outputs.clamp={output=7,on_fault=\"keep\"}"];

/// Tick, line, word, value and who switched, of each row.
fn events(done: &Done) -> Vec<(u64, u32, String, f64, String)> {
    let mut reader = csv::Reader::from_path(done.file("events.csv")).unwrap();
    assert_eq!(
        reader.headers().unwrap(),
        &["time_s", "tick", "line", "word", "value", "by"][..]
    );
    let row = |row: csv::StringRecord| {
        let (time_s, tick): (f64, u64) = (row[0].parse().unwrap(), row[1].parse().unwrap());
        assert!((time_s - tick as f64 * 0.001).abs() < 1e-9);
        (
            tick,
            row[2].parse().unwrap(),
            row[3].to_string(),
            row[4].parse().unwrap(),
            row[5].to_string(),
        )
    };
    reader
        .records()
        .map(|record| row(record.unwrap()))
        .collect()
}

fn words(done: &Done) -> Vec<String> {
    events(done)
        .into_iter()
        .map(|(_, line, word, value, by)| format!("{line} {word} {value} {by}"))
        .collect()
}

/// What the program switches before it moves.
const BEFORE: [&str; 4] = [
    "2 spindle 1000 program",
    "3 output 3 1 program",
    "4 output 7 1 program",
    "5 flood 1 program",
];

fn assert_words(done: &Done, behind: &[&str]) {
    // Those of one tick stand in the order of the outputs.
    let (mut found, mut expected) = (words(done), [&BEFORE[..], behind].concat());
    found.sort();
    expected.sort_unstable();
    assert_eq!(found, expected, "{}", done.errors());
}

#[test]
fn what_a_program_switches_up_to_its_end() {
    let done = Scenario::text(PROGRAM).events().run();
    assert_eq!(done.status(), 0, "{}", done.errors());
    let ends = ["11 spindle 0 program", "11 flood 0 program"];
    assert_words(
        &done,
        &[
            &["8 output 3 0 program", "9 spindle -500 program"],
            &ends[..],
        ]
        .concat(),
    );
    let (outputs, coolant, rpm) = (
        done.cells("outputs"),
        done.cells("coolant"),
        done.column("spindle_set_rpm"),
    );
    let last = outputs.len() - 1;
    assert_eq!(
        (outputs[last].as_str(), coolant[last].as_str()),
        ("0x80", "flood")
    );
    assert!(
        (rpm[last] + 500.0).abs() < 1e-9 && outputs.iter().any(|bits| bits == "0x88"),
        "{}",
        rpm[last]
    );
    assert!(
        done.cells("phase_ns").iter().all(|phase| phase == "nan"),
        "no driver tells a phase"
    );
    // The period that ends the program has no sample, and switches.
    assert_eq!(events(&done).last().map(|row| row.0), Some(last as u64 + 1));
    let said = String::from_utf8_lossy(&done.output.stdout).into_owned();
    assert!(said.contains("\nevents: "), "{said}");
}

#[test]
fn words_that_no_sample_shows_have_rows_too() {
    let program = "G21 G90 F3000\nT1 M6\nM67 E1 Q4\nG1 X5\nM68 E0 Q2\nM19 R90\nM101 P3\nM2\n";
    let done = Scenario::text(program)
        .with(&["--set", "user_commands.M101=\"/bin/false\""])
        .events()
        .run();
    assert_eq!(
        done.status(),
        0,
        "simulations run no command: {}",
        done.errors()
    );
    let expected = [
        "2 tool made ready 1 program",
        "2 tool change 1 program",
        "3 analog output 1 4 program",
        "5 analog output 0 2 program",
        "6 spindle angle 90 program",
        "7 M101 3 program",
    ];
    assert_eq!(words(&done), expected);
}

#[test]
fn an_emergency_stop_switches_off_in_its_period() {
    let done = Scenario::text(PROGRAM)
        .with(&KEPT)
        .events()
        .commands("100,emergency-stop\n")
        .run();
    assert_eq!(done.status(), 3);
    let by = "emergency stop";
    let gone = ["spindle 0", "output 3 0", "flood 0"].map(|word| format!("6 {word} {by}"));
    assert_words(&done, &gone.each_ref().map(String::as_str));
    assert!(
        events(&done)
            .iter()
            .filter(|row| row.4 == by)
            .all(|row| row.0 == 100),
        "{:?}",
        events(&done)
    );
    assert_eq!(
        [99, 100].map(|tick| done.cells("outputs")[tick].clone()),
        ["0x88", "0x80"]
    );
    assert!(
        done.cells("state")
            .iter()
            .filter(|state| *state == "stopping")
            .count()
            > 20,
        "it moved for a while"
    );
}

#[test]
fn a_fault_switches_off_when_the_axes_are_at_rest() {
    let fault = ["--set", "faults.wrap=[{kind=\"fail\",at_call=100}]"];
    let done = Scenario::text(PROGRAM)
        .with(&KEPT)
        .with(&fault)
        .events()
        .run();
    assert_eq!(done.status(), 3);
    assert_words(
        &done,
        &["6 spindle 0 fault", "6 output 3 0 fault", "6 flood 0 fault"],
    );
    let states = done.cells("state");
    let rest = states.iter().position(|state| state == "fault").unwrap();
    assert!(
        states[..rest]
            .iter()
            .filter(|state| *state == "stopping")
            .count()
            > 20,
        "it moved for a while"
    );
    assert!(
        events(&done)
            .iter()
            .filter(|row| row.4 == "fault")
            .all(|row| row.0 == rest as u64),
        "{:?}",
        events(&done)
    );
    let x = done.column("x_cmd_mm");
    assert!(
        x[rest] == x[rest - 1] && (x[rest] - x[rest - 4]).abs() > 1e-6,
        "at rest, and no sooner than just before"
    );
}

#[test]
fn an_abort_leaves_outputs() {
    let done = Scenario::text(PROGRAM)
        .events()
        .commands("100,abort\n")
        .run();
    assert_words(&done, &["6 spindle 0 abort", "6 flood 0 abort"]);
}

#[test]
fn a_binary_trace_exports_the_same_columns() {
    let done = Scenario::text(PROGRAM).run();
    let program = done.file("program.ngc");
    std::fs::write(&program, PROGRAM).unwrap();
    let at = |name: &str| done.file(name);
    let run = |arguments: &[&Path]| {
        let output = Command::new(env!("CARGO_BIN_EXE_tandem"))
            .args(arguments)
            .output()
            .unwrap();
        assert_eq!(
            output.status.code(),
            Some(0),
            "{}",
            String::from_utf8_lossy(&output.stderr)
        );
    };
    let [go, on, to] = ["run", "--machine", "--trace"].map(Path::new);
    run(&[go, &program, on, &mill(), to, &at("same.ttr")]);
    run(&[
        "trace".as_ref(),
        "export".as_ref(),
        &at("same.ttr"),
        "--csv".as_ref(),
        &at("same.csv"),
    ]);
    assert!(std::fs::read(at("same.csv")).unwrap() == std::fs::read(at("trace.csv")).unwrap());
    run(&[
        "trace".as_ref(),
        "diff".as_ref(),
        &at("same.ttr"),
        &at("trace.csv"),
    ]);
}

/// Numbers alone could not tell outputs above 53 apart.
#[test]
fn what_is_switched_otherwise_is_a_difference_but_none_of_commands() {
    let other = PROGRAM
        .replace("M64 P3", "M64 P61")
        .replace("M65 P3", "M65 P61");
    let (a, b) = (Scenario::text(PROGRAM).run(), Scenario::text(&other).run());
    let diff = |options: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_tandem"));
        command
            .args(["trace", "diff"])
            .args(options)
            .arg(a.file("trace.csv"))
            .arg(b.file("trace.csv"));
        let output = command.output().unwrap();
        (
            output.status.code(),
            String::from_utf8_lossy(&output.stdout).into_owned(),
        )
    };
    let (status, said) = diff(&[]);
    assert!(
        status == Some(1) && said.contains("outputs: 0x88 in A, 0x2000000000000080 in B"),
        "{said}"
    );
    assert_eq!(diff(&["--commands-only"]).0, Some(0));
}

/// A spindle that needs 3.76 of its time constants of 0.2 s to 1000 rpm, and ten rapids of 5 mm do not take as long.
const SPUN: [&str; 2] = ["--set", "driver.options.spindle_time_constant_s=0.2"];

#[test]
fn a_cut_waits_for_the_spindle_on_both_clocks_and_its_time_is_told() {
    let text = "G21 G90 F3000\nM3 S1000\nG0 X5\nG1 X10\nG2 X20 I5\nM2\n";
    let plain = Scenario::text(text).events().run();
    let slow = Scenario::text(text).with(&SPUN).events().run();
    assert_eq!((plain.status(), slow.status()), (0, 0), "{}", slow.errors());
    let waits = |done: &Done| {
        events(done)
            .into_iter()
            .filter(|row| row.2 == "waits for spindle")
            .collect::<Vec<_>>()
    };
    assert!(waits(&plain).is_empty(), "a spindle that is there at once");
    let [begin, end] = &waits(&slow)[..] else {
        panic!("{:?}", events(&slow))
    };
    assert_eq!(
        (begin.3, end.3, begin.4.as_str(), begin.1),
        (1.0, 0.0, "spindle", 3)
    );
    let told = events(&slow)[0].0;
    // It says that it is there 2 % and ten turns a minute off.
    let spun_s = 0.2 * (1.0 / (0.02 + 1.0 / (1000.0 * PI / 30.0))).ln();
    assert_eq!(end.0 - told, (spun_s * 1000.0).ceil() as u64);
    let x = slow.column("x_cmd_mm");
    let stands = |from: u64, to: u64| x[from as usize..to as usize].iter().all(|x| *x == 5.0);
    assert!(
        begin.0 > told + 50 && stands(begin.0, end.0) && x[end.0 as usize + 1] > 5.0,
        "the rapid goes on, the cut does not"
    );
    // The wait is in the time of the run, and all parts of that are the whole.
    let by = slow.summary()["limited_by_s"].as_object().unwrap().clone();
    let sum: f64 = by.values().map(|part| part.as_f64().unwrap()).sum();
    let waited_s = (end.0 - begin.0) as f64 * 0.001;
    assert!(
        (by["spindle"].as_f64().unwrap() - waited_s).abs() < 1e-9
            && (sum - slow.number("motion_time_s")).abs() < 1e-6,
        "{by:?}"
    );
    assert!(
        (slow.number("motion_time_s") - plain.number("motion_time_s") - waited_s).abs() < 0.0021,
        "{by:?}"
    );
    assert!(slow.judge(|_| {}).passed());
    assert!(
        slow.errors().contains("waits for the spindle: "),
        "{}",
        slow.errors()
    );
    let unhurried = [
        "--set",
        "loops.max_missed_periods=1000",
        "--set",
        "loops.max_missed_share=1",
    ];
    let wall = Scenario::text(text)
        .with(&SPUN)
        .with(&unhurried)
        .with(&["--clock", "wall"])
        .run();
    assert!(
        wall.cells("x_cmd_mm") == slow.cells("x_cmd_mm"),
        "{}",
        wall.errors()
    );
    let program = slow.file("program.ngc");
    std::fs::write(&program, text).unwrap();
    let mut estimate = Command::new(env!("CARGO_BIN_EXE_tandem"));
    let output = estimate
        .arg("estimate")
        .arg(&program)
        .arg("--machine")
        .arg(mill())
        .args(SPUN)
        .arg("--json")
        .output();
    let told: serde_json::Value = serde_json::from_slice(&output.unwrap().stdout).unwrap();
    let estimated_s = told["estimated_s"]
        .as_f64()
        .or_else(|| told[0]["estimated_s"].as_f64())
        .unwrap();
    assert_eq!(estimated_s, slow.number("motion_time_s"));
}

#[test]
fn a_spindle_that_does_not_come_to_its_speed_ends_the_run_by_its_name() {
    let text = "G21 G90 F3000\nM3 S1000\nG1 X10\nM2\n";
    let never = [
        "--set",
        "driver.options.spindle_time_constant_s=60",
        "--set",
        "spindle.at_speed_within_s=1.5",
    ];
    let done = Scenario::text(text).with(&never).run();
    assert_eq!(done.status(), 3);
    let fault = done.summary()["fault"].as_str().unwrap().to_string();
    let expected = "driver sim: the spindle is not at speed within 1.5 s (spindle.at_speed_within_s): 25 of 1000 rpm";
    assert!(fault.starts_with(expected), "{fault}");
    assert!(done.column("x_cmd_mm").iter().all(|x| *x == 0.0));
    // A minute without motion is no reason to give up, and a dry run turns nothing that it could wait for.
    let long = [
        "--set",
        "driver.options.spindle_time_constant_s=60",
        "--set",
        "spindle.at_speed_within_s=300",
    ];
    let patient = Scenario::text(text).with(&long).run();
    assert!(
        patient.status() == 0 && patient.number("motion_time_s") > 180.0,
        "{}",
        patient.errors()
    );
    assert_eq!(
        Scenario::text(text)
            .with(&never)
            .with(&["--dry-run"])
            .run()
            .status(),
        0
    );
    for nonsense in ["0", "-1", "0.05", "601", "inf", "nan", "\"soon\""] {
        let refused = Scenario::text(text)
            .with(&["--set", &format!("spindle.at_speed_within_s={nonsense}")])
            .run();
        assert!(
            refused.status() == 1 && refused.errors().contains("spindle.at_speed_within_s"),
            "{}",
            refused.errors()
        );
    }
}

/// The simulated door stands in the way of X between 2 and 4 mm: input 5 is on there, which is open for a normally open one.
#[test]
fn a_door_that_stops_the_spindle_is_named() {
    let door = [
        "--set",
        "inputs.guard={input=5,role=\"door\",normally_closed=false}",
        "--set",
        "driver.options.switches=[{input=5,low_mm=[2,-1,-1],high_mm=[2.2,1,1]}]",
    ];
    let text = "G21 G90 F3000\nM3 S1000\nG1 X10\nM2\n";
    let done = Scenario::text(text)
        .with(&door)
        .events()
        .commands("400,resume\n")
        .run();
    assert_eq!(done.status(), 0, "{}", done.errors());
    let expected = [
        "2 spindle 1000 program",
        "3 spindle 0 door",
        "3 spindle 1000 door",
        "4 spindle 0 program",
    ];
    let switched = words(&done)
        .into_iter()
        .filter(|row| !row.contains("waits for"));
    assert_eq!(switched.collect::<Vec<_>>(), expected);
    assert_eq!(
        events(&done)
            .iter()
            .filter(|row| row.4 == "door")
            .nth(1)
            .unwrap()
            .0,
        400
    );
}
