//! Whoever looks on changes nothing of what is driven.

use std::os::unix::net::UnixStream;
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};

use serde_json::json;
use tandem_session::controller::NoPersistence;

use crate::doors::{Client, with_controller};
use crate::support::machine;

/// What the scope shows of every fine period.
pub const SIGNALS: [&str; 8] = [
    "x_cmd_mm",
    "y_cmd_mm",
    "z_cmd_mm",
    "x_fb_mm",
    "y_fb_mm",
    "feed_mm_s",
    "sigma",
    "line",
];
/// Watchers at 50 Hz beside one operator and one scope: as many as there are places.
const WATCHERS: usize = 14;
/// How often a computer that is too busy to plan in time is asked again.
const TRIES: usize = 5;

/// So many chords of a circle, of which 200 are driven in 1.5 s or so.
pub fn chords(count: i32) -> String {
    let chord = |nth: i32| {
        let (sin, cos) = (f64::from(nth) * 0.02).sin_cos();
        format!("X{:.4} Y{:.4}\n", 20.0 * cos - 20.0, 20.0 * sin)
    };
    let chords: String = (1..=count).map(chord).collect();
    format!("G21 G90 G1 F3000\n{chords}M2\n")
}

/// Those who look on: most at 50 Hz, one with a scope of eight signals of every fine period.
fn come_to_watch(socket: &Path) -> Vec<Client<UnixStream>> {
    let on_watch = |request: &str, with: serde_json::Value| {
        let mut client = Client::at(socket);
        client.ok(request, with);
        client
    };
    let statuses = (0..WATCHERS).map(|_| on_watch("subscribe", json!({ "rate_hz": 50 })));
    let mut watchers: Vec<_> = statuses.collect();
    watchers.push(on_watch("scope", json!({ "signals": SIGNALS, "every": 1 })));
    watchers
}

/// The columns of the commands, period by period, without those that tell of the computer; none where the rough loop was late.
fn driven(folder: &Path, is_watched: bool) -> Option<Vec<String>> {
    let frames = AtomicUsize::new(0);
    let mut starvations = 0;
    with_controller(
        &machine("mill-3axis.toml"),
        Box::new(NoPersistence),
        |options| options.record = Some(folder.to_path_buf()),
        |socket, _| {
            let mut operator = Client::in_control(socket);
            operator.ok("load", json!({ "text": chords(200), "name": "circle.ngc" }));
            let watchers = if is_watched {
                come_to_watch(socket)
            } else {
                vec![]
            };
            std::thread::scope(|scope| {
                for mut watcher in watchers {
                    let frames = &frames;
                    // Each looks until it is told that the job is over.
                    scope.spawn(move || {
                        loop {
                            let told = watcher.hear();
                            frames.fetch_add(usize::from(told["event"] == "scope"), Relaxed);
                            if told["event"] == "job" {
                                break;
                            }
                        }
                    });
                }
                operator.ok("start", json!({}));
                let told = operator.wait(|told| told["event"] == "job");
                assert_eq!(told["job"]["outcome"], "done", "{told}");
                starvations = told["summary"]["starvations"].as_u64().unwrap();
            });
        },
    );
    assert_eq!(frames.load(Relaxed) > 0, is_watched);
    let trace = std::fs::read_to_string(folder.join("000001-program/trace.csv")).unwrap();
    let row = |line: &str| line.split(',').take(5).collect::<Vec<_>>().join(",");
    (starvations == 0).then(|| trace.lines().map(row).collect())
}

#[test]
fn sixteen_clients_at_50_hz_and_a_scope_at_1_khz_change_no_command() {
    for attempt in 0..TRIES {
        let folder = tempfile::tempdir().unwrap();
        let [alone, watched] = ["alone", "watched"].map(|name| folder.path().join(name));
        let (Some(alone), Some(watched)) = (driven(&alone, false), driven(&watched, true)) else {
            println!("attempt {attempt}: the rough loop was late");
            continue;
        };
        assert!(alone.len() > 1000, "{} periods", alone.len());
        assert!(alone == watched, "the commands differ");
        return;
    }
    println!("skipped: this computer is too busy to plan in time");
}
