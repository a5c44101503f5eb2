//! Opens a report in a real browser: it draws, and its script raises no error.

#[path = "../examples/demo/run.rs"]
mod run;

use std::collections::HashSet;
use std::fs::{self, File};
use std::io::BufReader;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::thread;
use std::time::{Duration, Instant};

const CHROMIUM: &str = "/usr/bin/chromium";
const PATIENCE: Duration = Duration::from_secs(120);

#[test]
fn a_report_draws_without_errors() {
    if !Path::new(CHROMIUM).exists() {
        println!("skipped: chromium is not installed (apt-get install chromium)");
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    for (name, broken, hash) in [("light", false, "theme=light"), ("zoomed", true, "theme=dark&t=0.5,0.9&view=XY")] {
        let page = folder.path().join(format!("{name}.html"));
        run::report(6, broken).write(&mut File::create(&page).unwrap()).unwrap();
        let address = format!("file://{}#{hash}", page.display());
        assert_ready(&browse(folder.path(), &["--dump-dom"], &address));
        let picture = folder.path().join(format!("{name}.png"));
        browse(folder.path(), &[&format!("--screenshot={}", picture.display())], &address);
        let colours = distinct_colours(&picture);
        assert!(colours > 200, "{name}: only {colours} colours");
    }
}

/// The page says itself whether it is drawn and what went wrong.
fn assert_ready(dom: &str) {
    let root = dom.lines().find(|line| line.starts_with("<html")).unwrap_or_default();
    assert!(root.contains("data-ready=\"1\"") && !root.contains("data-errors"), "{root}");
    assert!(dom.contains("square &lt;and&gt; spiral.ngc"));
}

/// Runs the browser on an address; answers what it prints. Ends it when it takes too long.
fn browse(folder: &Path, options: &[&str], address: &str) -> String {
    let profile = tempfile::tempdir_in(folder).unwrap();
    let output: PathBuf = profile.path().join("output");
    let mut browser = Command::new(CHROMIUM)
        .args(["--headless", "--no-sandbox", "--disable-gpu", "--no-first-run", "--disable-background-networking"])
        .args(["--disable-component-update", "--disable-sync", "--window-size=1280,900", "--virtual-time-budget=5000"])
        .arg(format!("--user-data-dir={}", profile.path().display()))
        .args(options)
        .arg(address)
        .stdin(Stdio::null())
        .stdout(File::create(&output).unwrap())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let start = Instant::now();
    let status = loop {
        if let Some(status) = browser.try_wait().unwrap() {
            break status;
        }
        if start.elapsed() > PATIENCE {
            browser.kill().unwrap();
            browser.wait().unwrap();
            panic!("the browser took longer than {PATIENCE:?}");
        }
        thread::sleep(Duration::from_millis(20));
    };
    assert!(status.success(), "the browser ended with {status}");
    fs::read_to_string(output).unwrap()
}

fn distinct_colours(picture: &Path) -> usize {
    let mut reader = png::Decoder::new(BufReader::new(File::open(picture).unwrap())).read_info().unwrap();
    let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
    let info = reader.next_frame(&mut pixels).unwrap();
    assert_eq!((info.width, info.height), (1280, 900));
    let samples = info.color_type.samples();
    pixels[..info.buffer_size()].chunks(samples).collect::<HashSet<_>>().len()
}
