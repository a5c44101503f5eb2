//! Opens a report in a real browser: it draws, and its script raises no error.

#[path = "../../../tests/chromium.rs"]
mod chromium;
#[path = "../examples/demo/run.rs"]
mod run;

use std::collections::HashSet;
use std::fs::{self, File};
use std::io::BufReader;
use std::path::{Path, PathBuf};
use std::process::Stdio;
use std::thread;
use std::time::{Duration, Instant};

use tandem_report::{Axis, Ended, Report, Samples, Unit};

const PATIENCE: Duration = Duration::from_mins(2);

#[test]
fn a_report_draws_without_errors() {
    if chromium::is_missing() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    for (name, broken, hash) in [
        ("light", false, "theme=light"),
        ("zoomed", true, "theme=dark&t=0.5,0.9&view=XY"),
    ] {
        let page = folder.path().join(format!("{name}.html"));
        run::report(6, broken)
            .write(&mut File::create(&page).unwrap())
            .unwrap();
        let address = format!("file://{}#{hash}", page.display());
        let dom = browse(folder.path(), &["--dump-dom"], &address);
        assert_ready(&dom);
        assert!(dom.contains("square &lt;and&gt; spiral.ngc"));
        let picture = folder.path().join(format!("{name}.png"));
        browse(
            folder.path(),
            &[&format!("--screenshot={}", picture.display())],
            &address,
        );
        let colours = distinct_colours(&picture);
        assert!(colours > 200, "{name}: only {colours} colours");
    }
}

#[test]
fn a_run_with_little_to_show_draws() {
    if chromium::is_missing() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    for n in [0, 1, 2, 50] {
        let page = folder.path().join("lathe.html");
        lathe(n).write(&mut File::create(&page).unwrap()).unwrap();
        let dom = browse(
            folder.path(),
            &["--dump-dom"],
            &format!("file://{}", page.display()),
        );
        assert_ready(&dom);
    }
}

/// The strip at the top of a faulted run showed nothing of it, and a green 0 stood beside a jerk above its limit.
#[test]
fn the_strip_says_that_a_run_ended_in_a_fault_and_is_green_only_where_nothing_is_above_a_limit() {
    let html = |report: &Report| {
        let mut html = Vec::new();
        report.write(&mut html).unwrap();
        let html = String::from_utf8(html).unwrap();
        html.split("<ul class=\"verdict\">")
            .nth(1)
            .unwrap()
            .split("</ul>")
            .next()
            .unwrap()
            .to_string()
    };
    let whole = html(&lathe(50));
    assert!(
        !whole.contains("ended in")
            && whole.contains("<li class=\"good\"><i>limit violations</i><b>0</b>"),
        "{whole}"
    );
    let fault = Report {
        ended: Some(Ended::Fault("guard: X <too> fast".into())),
        ..lathe(50)
    };
    let strip = html(&fault);
    assert!(
        strip.starts_with("<li class=\"bad ended\"><i>the run</i><b>ended in a fault</b>"),
        "{strip}"
    );
    assert!(strip.contains("guard: X &lt;too&gt; fast"), "{strip}");
    let stopped = html(&Report {
        ended: Some(Ended::Stopped("at line 3".into())),
        ..lathe(50)
    });
    assert!(
        stopped.starts_with("<li class=\"warn ended\"><i>the run</i><b>was stopped</b>"),
        "{stopped}"
    );
    // 0.2 % above is within what the judge lets pass: no violation, and not green either.
    for (judged, state, words) in [
        (true, "warn", "jerk; jerk of X 0.2 % above<"),
        (false, "good", "acceleration<"),
    ] {
        let mut report = Report {
            jerk_is_judged: judged,
            ..lathe(50)
        };
        // The jerk of a start with 10 mm/s² in one period.
        let since = |i: i32| (i - 5).max(0);
        report.samples.command[0] = (0..50)
            .map(|i| f64::from(since(i) * (since(i) - 1)) * 0.5e-5)
            .collect();
        report.axes[0].max_jerk = Some(10_000.0 / 1.002);
        let strip = html(&report);
        let chip = format!("<li class=\"{state}\"><i>limit violations</i><b>0</b>");
        assert!(strip.contains(&chip) && strip.contains(words), "{strip}");
    }
}

/// What the page shows where a script types into it and looks at it.
#[test]
fn a_line_that_is_not_there_is_answered_and_names_of_what_binds_do_not_overlap() {
    if chromium::is_missing() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let probe = "<script>
        const until = setInterval(() => {
          if (!document.documentElement.dataset.ready) return;
          clearInterval(until);
          const field = document.getElementById('go-to-line'), said = [];
          for (const text of ['4000', '1.5', '', '10']) {
            field.value = text;
            field.dispatchEvent(new KeyboardEvent('keydown', { key: 'Enter' }));
            const answer = document.getElementById('line-answer');
            said.push(answer.hidden ? 'gone there' : answer.textContent);
          }
          const band = document.querySelector('[aria-label=\"What binds\"]');
          said.push('row ' + Math.floor(band.clientHeight / about.binding.length));
          // A graphics unit draws; where there is none, the page puts the pixels there itself.
          const canvas = document.getElementById('path-lines'), plain = canvas.getContext('2d');
          const pixels = plain ? plain.getImageData(0, 0, canvas.width, canvas.height).data : [1];
          const seen = { left: Infinity, right: -1, top: Infinity, bottom: -1 };
          for (let at = 3; at < pixels.length; at += 4) {
            if (pixels[at] === 0) continue;
            const x = (at >> 2) % canvas.width, y = Math.floor((at >> 2) / canvas.width);
            seen.left = Math.min(seen.left, x);
            seen.right = Math.max(seen.right, x);
            seen.top = Math.min(seen.top, y);
            seen.bottom = Math.max(seen.bottom, y);
          }
          const share = Math.max((seen.right - seen.left) / (canvas.width - 80), (seen.bottom - seen.top) / (canvas.height - 104));
          said.push('fits ' + (!plain || share > 0.9));
          const shown = document.createElement('pre');
          shown.id = 'probe';
          shown.textContent = said.join('|');
          document.body.append(shown);
        }, 20);
        </script></body>";
    let mut html = Vec::new();
    run::report(6, false).write(&mut html).unwrap();
    let page = folder.path().join("probed.html");
    fs::write(
        &page,
        String::from_utf8(html).unwrap().replace("</body>", probe),
    )
    .unwrap();
    let dom = browse(
        folder.path(),
        &["--dump-dom"],
        &format!("file://{}", page.display()),
    );
    assert_ready(&dom);
    let said = dom
        .split("<pre id=\"probe\">")
        .nth(1)
        .unwrap_or_default()
        .split("</pre>")
        .next()
        .unwrap_or_default();
    let said: Vec<_> = said.split('|').collect();
    assert!(
        said[0].starts_with("nothing moves on line 4000; the next that move: "),
        "{said:?}"
    );
    assert_eq!(
        said[1..4],
        [
            "a line is a whole number from 1 on",
            "a line is a whole number from 1 on",
            "gone there"
        ]
    );
    let row: u32 = said[4].strip_prefix("row ").unwrap().parse().unwrap();
    assert!(row >= 12, "names of 11 px need rows of at least 12: {row}");
    assert_eq!(said[5], "fits true");
}

#[test]
fn a_damaged_report_says_so() {
    if chromium::is_missing() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let mut html = Vec::new();
    lathe(50).write(&mut html).unwrap();
    let damaged = String::from_utf8(html)
        .unwrap()
        .replace("data-kind=\"f32\">", "data-kind=\"f32\">AAAA");
    let page = folder.path().join("damaged.html");
    fs::write(&page, damaged).unwrap();
    let dom = browse(
        folder.path(),
        &["--dump-dom"],
        &format!("file://{}", page.display()),
    );
    assert!(root_of(&dom).contains("data-errors") && dom.contains("this file is damaged"));
}

/// Two linear axes and a rotary one, and none of the optional columns.
fn lathe(n: usize) -> Report {
    let ramp = |slope: f64| (0..n).map(|i| i as f64 * slope).collect::<Vec<f64>>();
    let axis = |letter, unit| Axis {
        letter,
        unit,
        max_velocity: 100.0,
        max_acceleration: 500.0,
        ..Axis::default()
    };
    Report {
        title: "lathe".into(),
        axes: vec![
            axis('X', Unit::Mm),
            axis('Z', Unit::Mm),
            axis('C', Unit::Deg),
        ],
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

fn root_of(dom: &str) -> &str {
    dom.lines()
        .find(|line| line.starts_with("<html"))
        .unwrap_or_default()
}

/// The page says itself whether it is drawn and what went wrong.
fn assert_ready(dom: &str) {
    let root = root_of(dom);
    assert!(
        root.contains("data-ready=\"1\"") && !root.contains("data-errors"),
        "{root}"
    );
}

/// Runs the browser on an address; answers what it prints. Ends it when it takes too long.
fn browse(folder: &Path, options: &[&str], address: &str) -> String {
    let profile = tempfile::tempdir_in(folder).unwrap();
    let output: PathBuf = profile.path().join("output");
    let mut browser = chromium::headless(profile.path(), 5000)
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
    let mut reader = png::Decoder::new(BufReader::new(File::open(picture).unwrap()))
        .read_info()
        .unwrap();
    let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
    let info = reader.next_frame(&mut pixels).unwrap();
    assert_eq!((info.width, info.height), (1280, 900));
    let samples = info.color_type.samples();
    pixels[..info.buffer_size()]
        .chunks(samples)
        .collect::<HashSet<_>>()
        .len()
}
