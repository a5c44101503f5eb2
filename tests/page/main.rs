//! The operator's page in a real browser: each test runs a case of `run.mjs` with playwright-core and Chromium on a controller of
//! its own. Where one of them is not to be had the test says so and is over.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::{Mutex, PoisonError};

/// A browser alone takes most of a small computer: one case at a time.
static ONE: Mutex<()> = Mutex::new(());

const ROOT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../..");

/// Where the modules lie, or what is missing.
fn modules() -> Result<PathBuf, String> {
    if !Path::new("/usr/bin/chromium").exists() {
        return Err("/usr/bin/chromium is not installed".to_string());
    }
    let node = Command::new("node").arg("--version").output();
    if !node.is_ok_and(|node| node.status.success()) {
        return Err("node is not installed".to_string());
    }
    let named = std::env::var_os("TANDEM_NODE_MODULES").map(PathBuf::from);
    let folder = named.unwrap_or_else(|| Path::new(ROOT).join("target/npm/node_modules"));
    for module in ["playwright-core", "axe-core"] {
        if !folder.join(module).exists() {
            return Err(format!(
                "{module} is not in {}: npm install --prefix target/npm playwright-core@1.65 axe-core@4",
                folder.display()
            ));
        }
    }
    Ok(folder)
}

fn case(arguments: &[&str]) {
    let modules = match modules() {
        Ok(modules) => modules,
        Err(why) => {
            eprintln!("skipped: {why}");
            return;
        }
    };
    let _one = ONE.lock().unwrap_or_else(PoisonError::into_inner);
    let ran = Command::new("node")
        .arg("tests/page/run.mjs")
        .args(arguments)
        .current_dir(ROOT)
        .env("TANDEM", env!("CARGO_BIN_EXE_tandem"))
        .env("CHROMIUM", "/usr/bin/chromium")
        .env("MODULES", modules)
        .output()
        .unwrap();
    let words = String::from_utf8_lossy(&ran.stdout);
    print!("{words}");
    assert!(
        ran.status.success(),
        "{arguments:?}: {words}{}",
        String::from_utf8_lossy(&ran.stderr)
    );
}

macro_rules! cases {
    ($($name:ident: $arguments:expr;)*) => {
        $(#[test]
        fn $name() {
            case(&$arguments);
        })*
    };
}

cases! {
    a_jog_ends_when_the_key_is_released: ["jog", "released"];
    a_jog_ends_when_the_release_goes_elsewhere: ["jog", "pointer-up-lost"];
    a_jog_ends_when_the_page_is_hidden: ["jog", "hidden"];
    a_jog_ends_when_the_page_is_busy: ["jog", "busy"];
    a_jog_ends_when_the_page_is_stopped: ["jog", "stopped"];
    a_jog_ends_when_the_page_is_killed: ["jog", "killed"];
    a_program_runs_by_one_page_while_another_looks_on: ["program"];
    a_click_on_hold_is_with_the_fine_loop_at_once: ["hold"];
    lines_offsets_tools_and_overrides_by_hand: ["hand"];
    the_software_stop_needs_no_control_and_says_what_to_do: ["stop"];
    every_error_of_a_program_stands_at_its_line: ["errors"];
    a_page_without_the_token_of_this_process_is_refused: ["token"];
    a_page_that_reads_too_slowly_says_so_and_nobody_waits_for_it: ["slow"];
    three_hundred_thousand_lines_are_drawn: ["many"];
    eight_pages_with_a_scope_cost_the_machine_nothing: ["tabs"];
    a_parameter_of_the_policy_is_turned_and_the_next_run_compared: ["bench"];
    a_capture_around_a_trigger_stands_until_it_is_let_go: ["capture"];
    an_alarm_stays_until_it_was_seen_and_the_machine_says_what_it_is: ["alarms"];
    a_token_that_lets_look_lets_nothing_else: ["looker"];
    nobody_is_kept_out_by_contrast_size_or_the_want_of_a_mouse: ["access"];
}
