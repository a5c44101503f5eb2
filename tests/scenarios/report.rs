//! The report of a real run, opened in a real browser.

use std::process::Stdio;

use crate::chromium;
use crate::harness::{Scenario, percent_binding, root};

#[test]
fn the_report_opens_in_a_browser() {
    let folder = tempfile::tempdir().unwrap();
    let page = folder.path().join("report.html");
    let path = page.to_string_lossy().into_owned();
    let done = Scenario::of(&root().join("examples/programs/serpentine.ngc"))
        .with(&["--report", &path])
        .run();
    done.assert_within_limits();
    let html = std::fs::read_to_string(&page).unwrap();
    // The licence of the plots' library says where it comes from; that is the only address in the page.
    let own = html.replacen("https://github.com/leeoniya/uPlot", "", 1);
    assert!(
        !own.contains("http://") && !own.contains("https://"),
        "the page fetches something"
    );
    if chromium::is_missing() {
        return;
    }
    let shown = chromium::headless(&folder.path().join("profile"), 8000)
        .arg("--dump-dom")
        .arg(format!("file://{path}"))
        .stdin(Stdio::null())
        .output()
        .unwrap();
    let dom = String::from_utf8_lossy(&shown.stdout);
    assert!(
        dom.contains("data-ready=\"1\""),
        "the page did not come up: {}",
        String::from_utf8_lossy(&shown.stderr)
    );
    assert!(!dom.contains("data-errors=\""), "script errors");
}

#[test]
fn report_and_summary_say_what_binds_and_what_planning_took() {
    let folder = tempfile::tempdir().unwrap();
    let page = folder.path().join("report.html");
    let path = page.to_string_lossy().into_owned();
    let machine = root().join("examples/machines/mill-3axis-smooth.toml");
    let program = root().join("examples/programs/serpentine.ngc");
    let done = Scenario::of(&program)
        .on(&machine)
        .with(&["--report", &path])
        .run();
    let html = std::fs::read_to_string(&page).unwrap();
    let [feed, jerk, tolerance] =
        ["feed", "jerk", "tolerance"].map(|limit| percent_binding(&html, limit));
    // The long straights and the wide arc are driven at the feed, the rest at the jerk limit.
    assert!(
        feed > 60.0 && jerk > 10.0 && tolerance > 0.0,
        "{feed} {jerk} {tolerance}"
    );
    let seconds = |by: &str| done.summary()["limited_by_s"][by].as_f64().unwrap();
    assert!(
        seconds("feed") > 1.5 && seconds("jerk") > 0.2,
        "{}",
        done.summary()["limited_by_s"]
    );
    let rows = done.summary()["planning_us"]["histogram"]
        .as_array()
        .unwrap()
        .clone();
    let periods: u64 = rows
        .iter()
        .map(|row| row["periods"].as_u64().unwrap())
        .sum();
    let driven = done.number("motion_time_s") / done.number("rough_period_s");
    assert!(
        periods as f64 >= driven,
        "{periods} periods are measured, {driven} were driven"
    );
}

#[test]
fn the_path_is_judged_by_the_tolerance_of_the_program() {
    let report = |text: &str| {
        let folder = tempfile::tempdir().unwrap();
        let page = folder.path().join("report.html");
        let path = page.to_string_lossy().into_owned();
        let done = Scenario::text(text)
            .with(&["--set", "planner.plugin=block-overlap", "--report", &path])
            .run();
        assert_eq!(done.status(), 0, "{}", done.errors());
        std::fs::read_to_string(&page).unwrap()
    };
    let wide = report("G21 G90 G64 P0.05\nF5000\nG1 X20\nG1 Y20\nM2\n");
    assert!(
        wide.contains("of 0.05 mm allowed") && !wide.contains("<li class=\"bad\">"),
        "a wide tolerance is kept"
    );
    let both = report("G21 G90 G64 P0.05\nF5000\nG1 X20\nG1 Y20\nG64 P0.002\nG1 X0\nG1 Y0\nM2\n");
    assert!(both.contains("of 0.002 to 0.05 mm allowed") && !both.contains("<li class=\"bad\">"));
}

#[test]
fn the_time_is_compared_with_a_known_one() {
    let folder = tempfile::tempdir().unwrap();
    let page = folder.path().join("report.html");
    let path = page.to_string_lossy().into_owned();
    let program = "F6000\nG1 X20\nM2\n";
    let done = Scenario::text(program)
        .with(&["--report", &path, "--reference-time-s", "0.25"])
        .run();
    let ratio = done.number("motion_time_s") / 0.25;
    assert_eq!(
        (done.number("reference_time_s"), done.number("time_ratio")),
        (0.25, ratio)
    );
    let words = format!("T/T_ref {ratio:.4}");
    assert!(
        String::from_utf8_lossy(&done.output.stdout)
            .lines()
            .next()
            .unwrap()
            .contains(&words),
        "{words}"
    );
    let html = std::fs::read_to_string(&page).unwrap();
    assert!(
        html.contains(&format!("T/T_ref<td>{ratio:.4} of 0.25 s")),
        "{words}"
    );

    let without = Scenario::text(program).run();
    assert!(!String::from_utf8_lossy(&without.output.stdout).contains("T_ref"));
    for key in ["reference_time_s", "time_ratio"] {
        assert!(
            without
                .summary()
                .get(key)
                .is_some_and(serde_json::Value::is_null),
            "{key}"
        );
    }
    let aborted = Scenario::text(program)
        .commands("40,abort\n")
        .with(&["--reference-time-s=0.25"])
        .run();
    assert_eq!(
        (aborted.status(), aborted.number("reference_time_s")),
        (3, 0.25),
        "{}",
        aborted.errors()
    );
    assert!(
        aborted.summary()["time_ratio"].is_null(),
        "it did not come to the end of the program"
    );
}

#[test]
fn a_time_that_cannot_be_is_a_wrong_command_line() {
    for time in ["0", "-1", "nan", "inf", "1e7", "soon"] {
        let done = Scenario::text("M2\n")
            .with(&["--reference-time-s", time])
            .run();
        let errors = done.errors();
        assert_eq!(done.status(), 2, "{time}: {errors}");
        assert!(
            errors.contains("--reference-time-s") && errors.contains("from 0.001 to 1000000"),
            "{errors}"
        );
        assert!(!done.file("summary.json").exists(), "{time}");
    }
}
