//! The rough loop is late: the machine stops on the path inside what is queued, and goes on without a jump.

use std::fmt::Write;

use crate::bench::Bench;
use crate::harness::{Scenario, root};
use crate::random::Random;
use crate::replay::for_each_seed;

#[test]
fn a_stalled_rough_loop_stops_the_machine_on_the_path() {
    for (program, step) in [
        ("square.ngc", 57),
        ("serpentine.ngc", 211),
        ("spiral.ngc", 3001),
    ] {
        let path = root().join("examples/programs").join(program);
        let free = Scenario::of(&path).run();
        let ticks = free.number("samples") as usize;
        let mut starved = 0.0;
        for tick in (20..ticks).step_by(step) {
            let done = Scenario::of(&path)
                .commands(&format!("{tick},stall-rough,100\n"))
                .run();
            done.assert_within_limits();
            assert_eq!(done.number("blocks"), free.number("blocks"));
            starved += done.number("starvations");
        }
        assert!(
            starved > 0.0,
            "{program}: no stall was long enough to matter"
        );
    }
}

#[test]
fn a_short_stall_is_not_noticed() {
    let path = root().join("examples/programs/serpentine.ngc");
    let free = Scenario::of(&path).run();
    let done = Scenario::of(&path).commands("500,stall-rough,2\n").run();
    assert_eq!(done.number("starvations"), 0.0);
    assert_eq!(done.column("x_cmd_mm"), free.column("x_cmd_mm"));
}

#[test]
fn blocks_of_a_thousandth_do_not_starve() {
    let lines: Vec<String> = (1..4000)
        .map(|i| format!("G1 X{:.4}", f64::from(i) * 0.001))
        .collect();
    let done = Scenario::text(&format!("G21 G90 G64\nF15000\n{}\nM2\n", lines.join("\n"))).run();
    done.assert_within_limits();
    assert_eq!(done.number("starvations"), 0.0);
}

/// The built-in planners, and whether they keep every limit.
const PLANNERS: [(&str, bool); 5] = [
    ("look-ahead", true),
    ("block-overlap", true),
    ("smooth", true),
    ("nurbs", true),
    ("after-interpolation", false),
];

/// A run-up as long as the machine needs to its feed, and then a bend that costs no speed, in blocks that take a fraction
/// of a fine period each: a ring of a fixed size holds next to no program time of them.
fn tiny_chords(drawn: &Drawn, random: &mut Random) -> String {
    let chord_mm = drawn.feed_mm_per_s * drawn.fine_s / log_between(random, 3.0, 100.0);
    let blocks = (200.0 / chord_mm).min(8000.0) as u32;
    let radius_mm = drawn.feed_mm_per_s.powi(2) / (0.2 * drawn.acceleration_mm_per_s2);
    let mut text = format!(
        "G21 G90 G64 P{:.4}\nF{}\n",
        log_between(random, 1e-3, 0.1),
        drawn.feed_mm_per_s * 60.0
    );
    writeln!(text, "G0 X-240\nG1 X{}", drawn.run_up_mm - 240.0).unwrap();
    for block in 1..=blocks {
        let angle = f64::from(block) * chord_mm / radius_mm;
        let [x, y] = [angle.sin(), 1.0 - angle.cos()].map(|share| share * radius_mm);
        writeln!(text, "G1 X{:.7} Y{y:.7}", drawn.run_up_mm - 240.0 + x).unwrap();
    }
    text.push_str("M2\n");
    text
}

fn log_between(random: &mut Random, low: f64, high: f64) -> f64 {
    random.between(low.ln(), high.ln()).exp()
}

/// A machine: periods that are no round numbers, and an acceleration that takes a while to the feed.
struct Drawn {
    fine_s: f64,
    rough_periods: u64,
    feed_mm_per_s: f64,
    run_up_mm: f64,
    acceleration_mm_per_s2: f64,
    jerk_mm_per_s3: f64,
}

impl Drawn {
    fn new(random: &mut Random) -> Self {
        let fine_s = [125e-6, 250e-6, 370e-6, 1e-3, 1.3e-3, 2e-3][random.below(6) as usize];
        let (feed_mm_per_s, run_up_mm) = (
            log_between(random, 10.0, 500.0),
            log_between(random, 10.0, 150.0),
        );
        let acceleration_mm_per_s2 = feed_mm_per_s.powi(2) / (1.5 * run_up_mm);
        let jerk_mm_per_s3 =
            acceleration_mm_per_s2.powi(2) / feed_mm_per_s * log_between(random, 1.0, 100.0);
        let rough_periods = 1 + random.below(25);
        Self {
            fine_s,
            rough_periods,
            feed_mm_per_s,
            run_up_mm,
            acceleration_mm_per_s2,
            jerk_mm_per_s3,
        }
    }

    fn settings(&self, planner: &str) -> Vec<(String, String)> {
        let mut settings = vec![
            ("planner.plugin".to_string(), planner.to_string()),
            ("guard.mode".to_string(), "count".to_string()),
            ("motion.jerk".to_string(), "report".to_string()),
            (
                "loops.fine_period_ms".to_string(),
                format!("{}", self.fine_s * 1e3),
            ),
            (
                "loops.rough_period_ms".to_string(),
                format!("{}", self.fine_s * 1e3 * self.rough_periods as f64),
            ),
        ];
        for axis in ["x", "y", "z"] {
            for (key, value) in [
                ("max_feed_mm_per_min", 60.0 * self.feed_mm_per_s),
                ("max_rapid_mm_per_min", 60.0 * self.feed_mm_per_s),
                ("max_acceleration_mm_per_s2", self.acceleration_mm_per_s2),
                ("max_jerk_mm_per_s3", self.jerk_mm_per_s3),
            ] {
                settings.push((format!("axes.{axis}.{key}"), format!("{value}")));
            }
        }
        settings
    }
}

#[test]
fn no_planner_starves_on_any_machine_where_the_rough_loop_is_never_late() {
    for_each_seed(
        "no_planner_starves_on_any_machine_where_the_rough_loop_is_never_late",
        3,
        |seed| {
            let wrong: Vec<String> = PLANNERS
                .into_iter()
                .filter_map(|planner| starved(seed, planner).err())
                .collect();
            wrong.is_empty().then_some(()).ok_or(wrong.join("\n"))
        },
    );
}

fn starved(seed: u64, (planner, keeps_limits): (&str, bool)) -> Result<(), String> {
    let mut random = Random::new(seed);
    let drawn = Drawn::new(&mut random);
    let settings = drawn.settings(planner);
    let bench = Bench::text(&tiny_chords(&drawn, &mut random))
        .on(&root().join("examples/machines/mill-3axis-smooth.toml"));
    let ran = bench
        .try_run(&settings)
        .map_err(|e| format!("{planner}: {e}"))?;
    let summary = &ran.outcome.summary;
    println!(
        "seed {seed} {planner}: {:.3} s, {} of {} samples limited by the queue, {} starvations",
        summary.motion_time_s, summary.queue_limited_samples, summary.samples, summary.starvations
    );
    if let Some(fault) = &summary.fault {
        return Err(format!("{planner} {settings:?}: {fault}"));
    }
    let limits = if keeps_limits {
        summary.governed_samples
    } else {
        0
    };
    if summary.starvations + limits > 0 {
        return Err(format!(
            "{planner} {settings:?}: {} starvations, {limits} governed",
            summary.starvations
        ));
    }
    Ok(())
}
