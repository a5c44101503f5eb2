//! Chromium without a window, for tests that open a page in it. Tests of several packages include this file by its path.

use std::path::Path;
use std::process::Command;

const CHROMIUM: &str = "/usr/bin/chromium";

/// Whether there is none; says so then.
pub fn is_missing() -> bool {
    let missing = !Path::new(CHROMIUM).exists();
    if missing {
        println!("skipped: chromium is not installed (apt-get install chromium)");
    }
    missing
}

/// Chromium with the state of its own in `profile`. A page has `budget_ms` of virtual time, which passes as fast as it can.
pub fn headless(profile: &Path, budget_ms: u32) -> Command {
    let mut command = Command::new(CHROMIUM);
    command
        .args([
            "--headless",
            "--no-sandbox",
            "--disable-gpu",
            "--no-first-run",
            "--disable-background-networking",
            "--disable-component-update",
            "--disable-sync",
            "--window-size=1280,900",
        ])
        .arg(format!("--virtual-time-budget={budget_ms}"))
        .arg(format!("--user-data-dir={}", profile.display()));
    command
}
