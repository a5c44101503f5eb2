//! The operator's page in a real browser: each test has `run.mjs` run a case with playwright-core and Chromium, on a controller of its
//! own and in one browser for all. Where one of them is not to be had the test says so and is over.

use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::sync::{Mutex, PoisonError};

/// A browser alone takes most of a small computer: one case at a time.
static RUNNER: Mutex<Option<Runner>> = Mutex::new(None);

/// What the line begins with that ends a case.
const DONE: char = '\u{4}';

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

/// Runs cases by their names, line by line. It ends, and the browser with it, when this process does.
struct Runner {
    _child: Child,
    names: ChildStdin,
    words: BufReader<ChildStdout>,
}

impl Runner {
    fn start(modules: &Path) -> Self {
        let mut child = Command::new("node")
            .arg("tests/page/run.mjs")
            .current_dir(ROOT)
            .env("TANDEM", env!("CARGO_BIN_EXE_tandem"))
            .env("CHROMIUM", "/usr/bin/chromium")
            .env("MODULES", modules)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        Self {
            names: child.stdin.take().unwrap(),
            words: BufReader::new(child.stdout.take().unwrap()),
            _child: child,
        }
    }

    /// What a case says, and whether it has passed; an error where it came to no end.
    fn run(&mut self, arguments: &[&str]) -> Result<(String, bool), String> {
        let name = arguments.join(" ");
        writeln!(self.names, "{name}").map_err(|error| error.to_string())?;
        let mut said = String::new();
        loop {
            let mut line = String::new();
            match self.words.read_line(&mut line) {
                Ok(1..) => {}
                Ok(0) => return Err(format!("{name} came to no end: {said}")),
                Err(error) => return Err(error.to_string()),
            }
            if let Some(end) = line.strip_prefix(DONE) {
                return Ok((said, end.trim() == "passed"));
            }
            said += &line;
        }
    }
}

fn case(arguments: &[&str]) {
    let modules = match modules() {
        Ok(modules) => modules,
        Err(why) => {
            eprintln!("skipped: {why}");
            return;
        }
    };
    let mut runner = RUNNER.lock().unwrap_or_else(PoisonError::into_inner);
    let ran = runner
        .get_or_insert_with(|| Runner::start(&modules))
        .run(arguments);
    if ran.is_err() {
        *runner = None;
    }
    drop(runner);
    let (words, passed) = ran.unwrap();
    print!("{words}");
    assert!(passed, "{arguments:?}: {words}");
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
    lines_are_the_same_with_a_graphics_unit_and_without: ["painters"];
    eight_pages_with_a_scope_cost_the_machine_nothing: ["tabs"];
    a_parameter_of_the_policy_is_turned_and_the_next_run_compared: ["bench"];
    a_capture_around_a_trigger_stands_until_it_is_let_go: ["capture"];
    an_alarm_stays_until_it_was_seen_and_the_machine_says_what_it_is: ["alarms"];
    a_token_that_lets_look_lets_nothing_else: ["looker"];
    pages_of_others_get_nothing_and_do_nothing: ["strangers"];
    what_is_no_program_leaves_nothing_in_the_folder: ["uploads"];
    nobody_is_kept_out_by_contrast_size_or_the_want_of_a_mouse: ["access"];
}

/// What page and server may add to the command.
const MAX_ADDED_BYTES: u64 = 3_000_000;

/// Two builds of a release take minutes: `TANDEM_BINARY=1` asks for them.
#[test]
fn the_command_is_hardly_larger_with_the_page() {
    if std::env::var_os("TANDEM_BINARY").is_none() {
        eprintln!("skipped: TANDEM_BINARY=1 builds the command without the page and compares");
        return;
    }
    let folder = Path::new(env!("CARGO_BIN_EXE_tandem"))
        .parent()
        .and_then(Path::parent)
        .unwrap();
    let size = |features: &str| {
        let built = Command::new(env!("CARGO"))
            .args([
                "build",
                "--release",
                "-p",
                "tandem",
                "--no-default-features",
            ])
            .args(["--features", features, "--target-dir"])
            .arg(folder)
            .current_dir(ROOT)
            .status();
        assert!(built.unwrap().success());
        std::fs::metadata(folder.join("release/tandem"))
            .unwrap()
            .len()
    };
    let without = size("ethercat,scripts");
    let with = size("ethercat,scripts,web");
    println!("{with} bytes with the page, {without} without");
    assert!(
        with <= without + MAX_ADDED_BYTES,
        "{} bytes more",
        with - without
    );
}
