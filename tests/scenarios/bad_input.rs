//! Bad input: a clear message, exit 1, nothing moved, nothing written.

use std::fmt::Write;

use crate::harness::Scenario;

fn refused(program: &[u8], expected: &[&str]) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("bad.ngc");
    std::fs::write(&path, program).unwrap();
    let done = Scenario::of(&path).run();
    let errors = done.errors();
    assert_eq!(done.status(), 1, "{errors}");
    for words in expected {
        assert!(errors.contains(words), "{words:?} is not in:\n{errors}");
    }
    for file in ["trace.csv", "summary.json", "blocks.csv"] {
        assert!(!done.file(file).exists(), "{file} was written");
    }
}

#[test]
fn programs_that_cannot_run_say_why() {
    refused(
        b"G21\nF100\nG1 X1\nG1 X9999\nM2\n",
        &["bad.ngc:4:", "X", "travel", "^"],
    );
    refused(b"G1 X1\n", &["bad.ngc:1:", "feed"]);
    refused(b"F100\nG2 X10 Y0 I3 J0\n", &["bad.ngc:2:", "radius"]);
    refused(b"F100\nG1 X1 C4\n", &["bad.ngc:2:7", "C"]);
    refused(b"F100\nG1 Xnan\n", &["bad.ngc:2:"]);
    refused(b"F100\nG1 X1e999\n", &["bad.ngc:2:"]);
    refused(b"F100\nG33 Z-1 K1\n", &["bad.ngc:2:1", "G33"]);
    refused(b"o100 sub\n", &["bad.ngc:1:1"]);
    refused(b"%\nF100\nG1 X1\n", &["%"]);
    refused(b"\x7fELF\x02\x01\x01\0\0\0\0", &["not a part program"]);
    refused(&vec![b'X'; 10_000_000], &["bad.ngc:1:", "line"]);
    refused(b"F100\nG1 X[1+\n", &["bad.ngc:2:"]);
}

/// The page of a program that is refused shows where the tool does not fit.
#[test]
fn the_report_draws_where_the_tool_does_not_fit() {
    let folder = tempfile::tempdir().unwrap();
    let page = folder.path().join("page.html");
    let done = Scenario::text("G21 G90 F600\nG41.1 D6 G1 X10\nX20\nY2\nX0\nG40 Y9\nM2\n")
        .with(&["--report", page.to_str().unwrap()])
        .run();
    assert_eq!(done.status(), 1, "{}", done.errors());
    assert!(
        done.errors().contains("moves of the lines 4 and 5"),
        "{}",
        done.errors()
    );
    let html = std::fs::read_to_string(page).unwrap();
    for text in [
        "moves of the lines 4 and 5",
        "<title>line 4</title>",
        "<title>line 5</title>",
        "radius 3 mm",
    ] {
        assert!(html.contains(text), "{text} is not in {html}");
    }
}

#[test]
fn all_errors_of_a_file_are_listed() {
    let mut program = "F100\n".to_string();
    for line in 0..50 {
        writeln!(program, "G1 X{}", if line % 2 == 0 { "9999" } else { "1" }).unwrap();
    }
    let done = Scenario::text(&program).run();
    assert_eq!(done.status(), 1);
    assert_eq!(done.errors().matches("error:").count(), 25);
}

#[test]
fn a_wrong_machine_key_names_the_nearest() {
    let done = Scenario::text("M2\n")
        .with(&["--set", "planner.plugn=look-ahead"])
        .run();
    assert_eq!(done.status(), 1);
    assert!(
        done.errors().contains("planner.plugin"),
        "{}",
        done.errors()
    );
    let done = Scenario::text("M2\n")
        .with(&["--set", "planner.plugin=look-ahed"])
        .run();
    assert_eq!(done.status(), 1);
    assert!(
        done.errors().contains("look-ahed") && done.errors().contains("look-ahead"),
        "{}",
        done.errors()
    );
}

#[test]
fn what_is_read_is_not_written_over_and_nothing_is_written_twice() {
    let folder = tempfile::tempdir().unwrap();
    let program = folder.path().join("p.ngc");
    std::fs::write(&program, "F600\nG1 X1\nM2\n").unwrap();
    let path = program.to_string_lossy().into_owned();
    let done = Scenario::of(&program).with(&["--report", &path]).run();
    assert_eq!(done.status(), 1);
    assert!(
        done.errors().contains("the run reads this file"),
        "{}",
        done.errors()
    );
    assert_eq!(
        std::fs::read_to_string(&program).unwrap(),
        "F600\nG1 X1\nM2\n"
    );
}

#[test]
fn a_device_is_written_and_not_replaced() {
    let device = std::path::Path::new("/dev/null");
    let done = Scenario::text("F600\nG1 X1\nM2\n")
        .with(&["--report", "/dev/null"])
        .run();
    assert_eq!(done.status(), 0, "{}", done.errors());
    assert!(!device.metadata().unwrap().is_file());
    assert!(!std::path::Path::new("/dev/null.part").exists());
}

#[test]
fn options_beyond_reason_are_refused() {
    let done = Scenario::text("M2\n")
        .with(&["--set", "planner.options.buffer_blocks=1000000000000"])
        .run();
    assert_eq!(done.status(), 1);
    assert!(
        done.errors().contains(
            "planner.options.buffer_blocks: planner look-ahead: 1000000000000: must be from 2"
        ),
        "{}",
        done.errors()
    );
}

#[test]
fn a_command_file_is_told_all_that_is_wrong_with_it() {
    let program = "G21 G90\nF3000\nG1 X20\nM2\n";
    let done = Scenario::text(program)
        .commands("# a comment\n5,hodl\n\n9,hold\nx,resume\n3,resume\n")
        .run();
    let errors = done.errors();
    let place = |line: u32, words: &str| errors.contains(&format!("commands.csv:{line}: {words}"));
    assert!(
        place(2, "no command is called \"hodl\"") && place(5, "\"x\" is not"),
        "{errors}"
    );
    assert!(place(6, "tick 3 comes after tick 9"), "{errors}");
    assert_eq!((done.status(), errors.lines().count()), (1, 3), "{errors}");
    let done = Scenario::text(program)
        .commands(&"1,hodl\n".repeat(250))
        .run();
    assert_eq!(done.errors().lines().count(), 101);
    assert!(
        done.errors().ends_with("and 150 more\n"),
        "{}",
        done.errors()
    );
}
