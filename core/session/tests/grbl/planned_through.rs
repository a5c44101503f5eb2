//! A sender that is faster than the machine, but not by much: its lines are planned through from the first on, without a rest between
//! them.

use tandem_oracle::{Row, Trace};
use tandem_rig::Random;

use crate::speak::{
    Streamer, alone_s, assert_as_long_as_a_run, chords, jobs, machine, serve, serve_recorded,
};

/// Times at which the machine slows down to a tenth of its feed between the first and the last motion, s.
fn slow_s(trace: &Trace, feed_mm_per_s: f64) -> Vec<f64> {
    let speed = |pair: &[Row]| {
        let squares = pair[0].command.iter().zip(&pair[1].command);
        let square: f64 = squares.map(|(from, to)| (to - from).powi(2)).sum();
        square.sqrt() / (pair[1].t_s - pair[0].t_s)
    };
    let speeds: Vec<f64> = trace.rows.windows(2).map(speed).collect();
    let is_fast = |speed: &f64| *speed > feed_mm_per_s / 10.0;
    let first = speeds.iter().position(is_fast).unwrap();
    let last = speeds.iter().rposition(is_fast).unwrap();
    let slow = (first..last).filter(|at| is_fast(&speeds[*at]) && !is_fast(&speeds[at + 1]));
    slow.map(|at| trace.rows[at].t_s).collect()
}

#[test]
fn a_sender_that_never_fills_the_planner_makes_no_rests() {
    planned_through("mill-3axis.toml");
}

#[test]
fn nor_does_it_where_jerk_is_limited() {
    planned_through("mill-3axis-smooth.toml");
}

/// An acceleration, and a jerk that builds it up in a tenth of a second or less, the same for the axes that move.
fn drawn_limits(random: &mut Random) -> Vec<(String, String)> {
    let acceleration = random.between(300.0, 3000.0);
    let jerk = acceleration / random.between(0.01, 0.1);
    println!("{acceleration} mm/s², {jerk} mm/s³");
    let of_axis = |axis: &str| {
        [
            ("acceleration_mm_per_s2", acceleration),
            ("jerk_mm_per_s3", jerk),
        ]
        .map(|(key, value)| (format!("axes.{axis}.max_{key}"), value.to_string()))
    };
    ["x", "y"].into_iter().flat_map(of_axis).collect()
}

/// Streams a slow sender's lines to an example's machine: one job, no slower than a tenth of the feed on the way, and as long as a run.
fn planned_through(example: &str) {
    let seed = std::env::var("TANDEM_SEED").map_or(1, |seed| seed.parse().unwrap());
    println!("TANDEM_SEED={seed}");
    let mut random = Random::new(seed);
    let all = chords(2000);
    let lines: Vec<String> = all
        .lines()
        .take(400)
        .map(|line| format!("{line}\n"))
        .collect();
    let text = lines.concat();
    let limits = drawn_limits(&mut random);
    let limits: Vec<_> = limits
        .iter()
        .map(|(key, value)| (&**key, &**value))
        .collect();
    let machine = machine(example, &limits);
    let alone_s = alone_s(&machine, &text);
    // 100 lines are driven in a second; six fit in 127 bytes.
    let every = 5 + random.below(26);
    let (mut streamer, seen) = Streamer::new(&text, 127, 200, 1);
    streamer.every = every;
    let folder = tempfile::tempdir().unwrap();
    let told = serve_recorded(&machine, vec![streamer], vec![], Some(folder.path()));
    assert_eq!(seen.lock().unwrap().errors, [""; 0]);
    let jobs = jobs(&told);
    assert_eq!(jobs.len(), 1, "{jobs:?}");
    let trace = Trace::read(&folder.path().join("000001-mdi/trace.csv")).unwrap();
    let slow_s = slow_s(&trace, 50.0);
    assert!(
        slow_s.is_empty(),
        "lines every {every} ms: it slows down at {slow_s:?} s"
    );
    assert_as_long_as_a_run(&jobs, alone_s, &format!("lines every {every} ms"));
}

/// A script sees a program from above, and a sender's lines have no above: they are driven as on a machine without it, in one go.
#[test]
fn a_policy_script_leaves_the_lines_of_a_sender_alone() {
    let script = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../scripts/policies/material-feed.wasm"
    );
    let keys = [
        ("policy.script", script),
        ("policy.parameters.material", "1"),
        ("policy.parameters.scale", "0.5"),
    ];
    let all = chords(2000);
    let text: String = all.split_inclusive('\n').take(200).collect();
    let with_script = machine("mill-3axis.toml", &keys);
    let without_s = alone_s(&machine("mill-3axis.toml", &[]), &text);
    let tuned_s = alone_s(&with_script, &text);
    assert!(
        tuned_s > 1.2 * without_s,
        "the script slows the same lines of a file: {tuned_s} s for {without_s}"
    );
    let (streamer, seen) = Streamer::new(&text, 127, 200, 1);
    let told = serve(&with_script, vec![streamer], vec![]);
    assert_eq!(seen.lock().unwrap().errors, [""; 0]);
    let jobs = jobs(&told);
    assert_eq!(jobs.len(), 1, "{jobs:?}");
    assert_as_long_as_a_run(&jobs, without_s, "with a policy script");
}
