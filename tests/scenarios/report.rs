//! The report of a real run, opened in a real browser.

use std::path::Path;
use std::process::{Command, Stdio};

use crate::harness::{Scenario, root};

const BROWSER: &str = "/usr/bin/chromium";

#[test]
fn the_report_opens_in_a_browser() {
    let folder = tempfile::tempdir().unwrap();
    let page = folder.path().join("report.html");
    let path = page.to_string_lossy().into_owned();
    let done = Scenario::of(&root().join("examples/programs/serpentine.ngc")).with(&["--report", &path]).run();
    done.assert_within_limits();
    let html = std::fs::read_to_string(&page).unwrap();
    assert!(!html.contains("http://") && !html.contains("https://"), "the page fetches something");
    if !Path::new(BROWSER).exists() {
        println!("skipped: chromium is not installed (apt-get install chromium)");
        return;
    }
    let shown = Command::new(BROWSER)
        .args(["--headless", "--no-sandbox", "--disable-gpu", "--no-first-run", "--disable-background-networking"])
        .args(["--disable-component-update", "--disable-sync", "--window-size=1280,900", "--virtual-time-budget=8000"])
        .arg(format!("--user-data-dir={}", folder.path().join("profile").display()))
        .arg("--dump-dom")
        .arg(format!("file://{path}"))
        .stdin(Stdio::null())
        .output()
        .unwrap();
    let dom = String::from_utf8_lossy(&shown.stdout);
    assert!(dom.contains("data-ready=\"1\""), "the page did not come up: {}", String::from_utf8_lossy(&shown.stderr));
    assert!(!dom.contains("data-errors=\""), "script errors");
}

#[test]
fn the_path_is_judged_by_the_tolerance_of_the_program() {
    let report = |text: &str| {
        let folder = tempfile::tempdir().unwrap();
        let page = folder.path().join("report.html");
        let path = page.to_string_lossy().into_owned();
        let done = Scenario::text(text).with(&["--set", "planner.plugin=block-overlap", "--report", &path]).run();
        assert_eq!(done.status(), 0, "{}", done.errors());
        std::fs::read_to_string(&page).unwrap()
    };
    let wide = report("G21 G90 G64 P0.05\nF5000\nG1 X20\nG1 Y20\nM2\n");
    assert!(wide.contains("of 0.05 mm allowed") && !wide.contains("<li class=\"bad\">"), "a wide tolerance is kept");
    let both = report("G21 G90 G64 P0.05\nF5000\nG1 X20\nG1 Y20\nG64 P0.002\nG1 X0\nG1 Y0\nM2\n");
    assert!(both.contains("of 0.002 to 0.05 mm allowed") && !both.contains("<li class=\"bad\">"));
}
