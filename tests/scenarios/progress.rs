//! Program time gets on: whatever the machine, its periods and the feeds are, nothing stands still that nobody has stopped.

use std::fmt::Write;

use crate::bench::{Bench, Ran};
use crate::harness::root;
use crate::random::Random;
use crate::replay::{for_each, for_each_seed, some_of};

/// Settings as the machine file takes them.
fn settings(pairs: &[(&str, String)]) -> Vec<(String, String)> {
    pairs
        .iter()
        .map(|(key, value)| ((*key).to_string(), value.clone()))
        .collect()
}

/// Straight on along X, feed after feed, mm/min.
fn falling_and_rising(random: &mut Random) -> (Vec<f64>, String) {
    let count = 2 + random.below(3);
    let feeds: Vec<f64> = (0..count)
        .map(|_| 10f64.powf(random.between(0.5, 3.5)).round())
        .collect();
    let (mut x_mm, mut text) = (0.0, String::from("G21 G90 G94 G64\n"));
    for feed in &feeds {
        // Long enough to be driven at the feed for a while, short enough for a test.
        x_mm += feed / 60.0 * random.between(0.05, 0.4);
        writeln!(text, "G1 X{x_mm:.5} F{feed}").unwrap();
    }
    text.push_str("M2\n");
    (feeds, text)
}

/// Share of the speed asked for that a sample has at least. It is not 1 where a plan changes its speed by half within a period,
/// in which the rate of program time is linear: 0.88 is the least of these machines.
const MIN_SHARE: f64 = 0.8;

/// Between the first and the last sample at the least of the feeds asked for, none is slower.
fn expect_no_dip(ran: &Ran, feeds: &[f64], ratio: f64) -> Result<(), String> {
    let first_line = 2;
    let asked = |line: u32| {
        let at = (line - first_line) as usize;
        let near = &feeds[at.saturating_sub(1)..(at + 2).min(feeds.len())];
        ratio * near.iter().copied().fold(f64::INFINITY, f64::min) / 60.0
    };
    let moving: Vec<_> = ran
        .samples
        .iter()
        .filter(|sample| sample.line >= first_line)
        .collect();
    let reached =
        |sample: &&&tandem_rings::Sample| sample.feed_mm_per_s >= asked(sample.line) * (1.0 - 1e-6);
    let first = moving
        .iter()
        .position(|sample| reached(&sample))
        .ok_or("the feed asked for is never reached")?;
    let last = moving
        .iter()
        .rposition(|sample| reached(&sample))
        .unwrap_or(first);
    for sample in &moving[first..=last] {
        if sample.feed_mm_per_s < asked(sample.line) * MIN_SHARE {
            let (at, least) = (sample.feed_mm_per_s * 60.0, asked(sample.line) * 60.0);
            return Err(format!(
                "tick {}, line {}: {at:.3} mm/min, asked {least:.3}",
                sample.tick, sample.line
            ));
        }
    }
    Ok(())
}

#[test]
fn a_lower_feed_under_a_reduced_ratio_is_met_without_a_dip_on_any_machine() {
    for_each_seed(
        "a_lower_feed_under_a_reduced_ratio_is_met_without_a_dip_on_any_machine",
        50,
        |seed| {
            let mut random = Random::new(seed);
            let (feeds, text) = falling_and_rising(&mut random);
            let ratio = [1.0, 0.9, 0.5, 0.1, 0.01][random.below(5) as usize];
            let most = [1.0, 1.0, 1.2, 2.0][random.below(4) as usize];
            let acceleration = 10f64.powf(random.between(1.5, 4.5));
            let fine_ms = [0.125, 0.25, 0.37, 1.0, 1.25, 1.3, 2.0][random.below(7) as usize];
            let settings = settings(&[
                ("loops.fine_period_ms", fine_ms.to_string()),
                (
                    "loops.rough_period_ms",
                    (fine_ms * (1 + random.below(16)) as f64).to_string(),
                ),
                ("motion.max_feed_ratio", most.to_string()),
                (
                    "axes.x.max_acceleration_mm_per_s2",
                    acceleration.to_string(),
                ),
                (
                    "planner.plugin",
                    ["look-ahead", "block-overlap"][random.below(2) as usize].to_string(),
                ),
            ]);
            let about = format!("{settings:?}\nratio {ratio}\n{text}");
            let ran =
                Bench::text(&text).try_run_with(&settings, &format!("0,feed-override,{ratio}\n"));
            let ran = ran.map_err(|error| format!("{error}\n{about}"))?;
            ran.expect_clean()
                .and_then(|()| expect_no_dip(&ran, &feeds, ratio))
                .map_err(|cause| format!("{cause}\n{about}"))
        },
    );
}

/// Moves, dwells, words that switch, a probe and feeds that change, within a second.
const MIXTURE: &str = "G21 G90 G64\nF6000\nG1 X3.1\nG4 P0.05\nM64 P1\nG1 X1\nM8\nG38.2 Z-2 F1500\nG1 Z0 F3000\nG1 X1.5 F600\n\
    G1 X1.8 F200\nM9\nG4 P0.1\nM2\n";
const PROBE: &str = "{switches=[{input=3,joint=2,below_mm=-0.5}]}";
const PLANNERS: [&str; 5] = [
    "look-ahead",
    "block-overlap",
    "after-interpolation",
    "nurbs",
    "smooth",
];

#[test]
fn every_pair_of_periods_ends_with_every_planner() {
    let fine_ms = [
        0.125, 0.2, 0.25, 0.3, 0.37, 0.4, 0.5, 0.625, 0.75, 1.0, 1.25, 1.3, 2.0,
    ];
    let pairs = some_of(
        3,
        "every_pair_of_periods_ends_with_every_planner",
        0..fine_ms.len() * 21,
    );
    for_each(
        "TANDEM_PAIR",
        "every_pair_of_periods_ends_with_every_planner",
        pairs,
        |pair| {
            let (fine, ratio) = (fine_ms[pair / 21], pair % 21 + 1);
            PLANNERS.into_iter().try_for_each(|planner| {
                let smooth = ["nurbs", "smooth"].contains(&planner);
                let machine = if smooth {
                    "mill-3axis-smooth"
                } else {
                    "mill-3axis"
                };
                let guard = if planner == "after-interpolation" {
                    "count"
                } else {
                    "stop"
                };
                let settings = settings(&[
                    ("loops.fine_period_ms", fine.to_string()),
                    ("loops.rough_period_ms", (fine * ratio as f64).to_string()),
                    ("planner.plugin", planner.to_string()),
                    ("guard.mode", guard.to_string()),
                    ("probe.input", "3".to_string()),
                    ("driver.options", PROBE.to_string()),
                ]);
                let bench = Bench::text(MIXTURE)
                    .on(&root().join(format!("examples/machines/{machine}.toml")));
                let ran =
                    bench.try_run_with(&settings, "20,feed-override,0.4\n150,feed-override,1\n");
                let ran = ran.map_err(|error| error.to_string());
                ran.and_then(|ran| expect_end(&ran, fine))
                    .map_err(|cause| format!("{planner}, {settings:?}: {cause}"))
            })
        },
    );
}

#[test]
fn a_line_ends_where_building_up_the_acceleration_takes_thousands_of_rough_periods() {
    for planner in ["smooth", "nurbs"] {
        for jerk in [500, 2000] {
            let settings = settings(&[
                ("loops.fine_period_ms", "0.25".to_string()),
                ("loops.rough_period_ms", "0.25".to_string()),
                ("axes.x.max_jerk_mm_per_s3", jerk.to_string()),
                ("planner.plugin", planner.to_string()),
            ]);
            let ran = Bench::text("G21 G90\nG1 X10 F600\nM2\n")
                .on(&root().join("examples/machines/mill-3axis-smooth.toml"))
                .try_run_with(&settings, "")
                .unwrap_or_else(|error| panic!("{planner}, {jerk} mm/s³: {error}"));
            expect_end(&ran, 0.25)
                .unwrap_or_else(|cause| panic!("{planner}, {jerk} mm/s³: {cause}"));
            let end_mm = ran.samples.last().map(|sample| sample.command[0]);
            assert!(
                end_mm.is_some_and(|end_mm| (end_mm - 10.0).abs() < 1e-9),
                "{planner}, {jerk} mm/s³: {end_mm:?}"
            );
        }
    }
}

/// Nothing stopped it, and it took no longer than the program could.
fn expect_end(ran: &Ran, fine_ms: f64) -> Result<(), String> {
    let summary = &ran.outcome.summary;
    let time_s = ran.samples.len() as f64 * fine_ms / 1000.0;
    match summary.fault.as_ref().or(summary.stopped.as_ref()) {
        Some(ended_early) => Err(ended_early.clone()),
        None if time_s > 3.0 => Err(format!("it took {time_s} s")),
        None => Ok(()),
    }
}
