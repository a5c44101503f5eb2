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

use tandem_report::{Axis, Report, Samples, Unit};

const CHROMIUM: &str = "/usr/bin/chromium";
const PATIENCE: Duration = Duration::from_mins(2);

#[test]
fn a_report_draws_without_errors() {
    if chromium_is_missing() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    for (name, broken, hash) in [("light", false, "theme=light"), ("zoomed", true, "theme=dark&t=0.5,0.9&view=XY")] {
        let page = folder.path().join(format!("{name}.html"));
        run::report(6, broken).write(&mut File::create(&page).unwrap()).unwrap();
        let address = format!("file://{}#{hash}", page.display());
        let dom = browse(folder.path(), &["--dump-dom"], &address);
        assert_ready(&dom);
        assert!(dom.contains("square &lt;and&gt; spiral.ngc"));
        let picture = folder.path().join(format!("{name}.png"));
        browse(folder.path(), &[&format!("--screenshot={}", picture.display())], &address);
        let colours = distinct_colours(&picture);
        assert!(colours > 200, "{name}: only {colours} colours");
    }
}

#[test]
fn a_run_with_little_to_show_draws() {
    if chromium_is_missing() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    for n in [0, 1, 2, 50] {
        let page = folder.path().join("lathe.html");
        lathe(n).write(&mut File::create(&page).unwrap()).unwrap();
        let dom = browse(folder.path(), &["--dump-dom"], &format!("file://{}", page.display()));
        assert_ready(&dom);
    }
}

#[test]
fn a_damaged_report_says_so() {
    if chromium_is_missing() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let mut html = Vec::new();
    lathe(50).write(&mut html).unwrap();
    let damaged = String::from_utf8(html).unwrap().replace("data-kind=\"f32\">", "data-kind=\"f32\">AAAA");
    let page = folder.path().join("damaged.html");
    fs::write(&page, damaged).unwrap();
    let dom = browse(folder.path(), &["--dump-dom"], &format!("file://{}", page.display()));
    assert!(root_of(&dom).contains("data-errors") && dom.contains("this file is damaged"));
}

/// Two linear axes and a rotary one, and none of the optional columns.
fn lathe(n: usize) -> Report {
    let ramp = |slope: f64| (0..n).map(|i| i as f64 * slope).collect::<Vec<f64>>();
    let axis = |letter, unit| Axis { letter, unit, max_velocity: 100.0, max_acceleration: 500.0, ..Axis::default() };
    Report {
        title: "lathe".into(),
        axes: vec![axis('X', Unit::Mm), axis('Z', Unit::Mm), axis('C', Unit::Deg)],
        fine_period_s: 0.001,
        samples: Samples {
            t_s: ramp(0.001),
            line: vec![1; n],
            command: vec![ramp(0.01), ramp(-0.02), ramp(0.05)],
            feed_mm_s: ramp(0.1),
            ..Samples::default()
        },
        ..Report::default()
    }
}

fn chromium_is_missing() -> bool {
    let missing = !Path::new(CHROMIUM).exists();
    if missing {
        println!("skipped: chromium is not installed (apt-get install chromium)");
    }
    missing
}

fn root_of(dom: &str) -> &str {
    dom.lines().find(|line| line.starts_with("<html")).unwrap_or_default()
}

/// The page says itself whether it is drawn and what went wrong.
fn assert_ready(dom: &str) {
    let root = root_of(dom);
    assert!(root.contains("data-ready=\"1\"") && !root.contains("data-errors"), "{root}");
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
