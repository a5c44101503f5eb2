//! How long holds take under a jerk limit on random machines, against the shortest way found without the governor.

use crate::bench::{Bench, Ran};
use crate::optimal_jerk_stop::{JerkPlan, scalar_stop_s};
use crate::random::Random;
use crate::replay::for_each_seed;
use crate::walks_draw::{Draw, Lane};

/// Stops that take at least so many periods are compared without an allowance for whole periods.
const LONG_PERIODS: f64 = 20.0;
/// How much longer than the shortest a stop may be that the search finds: on lines, where it is known.
const SLACK: f64 = 1.08;
/// How much longer than the shortest a stop may be.
const MOST: f64 = 1.3;
/// A stop that takes so little longer than the bound is not searched for.
const NEAR: f64 = 1.1;
/// Holds for each program.
const HOLDS: u64 = 4;

/// A stop that was made.
struct Stop {
    /// Time taken in units of the shortest.
    ratio: f64,
    /// In units of what one lane alone needs.
    bound_ratio: f64,
    what: String,
}

fn on(draw: &Draw, folder: &std::path::Path) -> Bench {
    let (program, machine) = (folder.join("program.ngc"), folder.join("machine.toml"));
    std::fs::write(&program, &draw.program).unwrap();
    std::fs::write(&machine, &draw.machine).unwrap();
    Bench::of(&program).on(&machine)
}

/// Holds at random places of an undisturbed run.
fn stops(seed: u64, draw: &Draw, bench: &Bench, free: &Ran) -> Result<Vec<Stop>, String> {
    let mut random = Random::new(seed ^ 0x5709);
    let plan = JerkPlan::new(&free.segments, &draw.lanes);
    let mut stops = vec![];
    for _ in 0..HOLDS {
        let tick = 1 + random.below(free.samples.len() as u64 - 1) as usize;
        let stop = stop_at(tick, draw, bench, (free, &plan))?;
        stops.extend(stop.map(|stop| Stop {
            what: format!("seed {seed}, {}", stop.what),
            ..stop
        }));
    }
    Ok(stops)
}

/// A hold at `tick` of an undisturbed run, where it is one that says something.
fn stop_at(
    tick: usize,
    draw: &Draw,
    bench: &Bench,
    (free, plan): (&Ran, &JerkPlan),
) -> Result<Option<Stop>, String> {
    let path_mm: f64 = free.samples[..tick]
        .iter()
        .map(|sample| sample.feed_mm_per_s * draw.period_s)
        .sum();
    if free.samples[tick - 1].feed_mm_per_s == 0.0 || free.samples[tick].feed_mm_per_s == 0.0 {
        return Ok(None);
    }
    let p_s = plan.time_s(path_mm);
    let least = plan.crude_s(p_s) / draw.period_s;
    if least < LONG_PERIODS / 3.0 {
        return Ok(None);
    }
    let most = (25.0 * least) as usize + 100;
    let ran = bench
        .try_commands(&format!("{tick},hold\n{},abort\n", tick + most))
        .map_err(|e| e.to_string())?;
    if let Some(fault) = &ran.outcome.summary.fault {
        return Err(fault.clone());
    }
    let taken = ran.samples[tick..]
        .iter()
        .position(|sample| sample.feed_mm_per_s == 0.0)
        .unwrap_or(most) as f64;
    // Where the bound is near there is nothing to search for.
    let found = if taken <= NEAR * least {
        least
    } else {
        plan.stop_s(p_s, 1.0) / draw.period_s
    };
    let shortest = least.max(found / SLACK);
    Ok((shortest >= LONG_PERIODS).then(|| Stop {
        ratio: taken / shortest,
        bound_ratio: taken / least,
        what: format!("hold at {tick}: {taken} periods, found {found:.1}, at least {least:.1}"),
    }))
}

/// The place of that share of sorted stops. The last of a few is not it: one of them may be the one of a hundred.
fn share(stops: &[Stop], of: f64) -> usize {
    ((stops.len() as f64 * of) as usize).min(stops.len().saturating_sub(2))
}

/// Of `share_of` the stops none may take more than `MOST` times the shortest; docs/stopping.md says what the others are.
fn stops_are_short(planner: &str, test: &str, count: u64, share_of: f64) {
    let mut all = vec![];
    for_each_seed(test, count, |seed| {
        let draw = Draw::new(planner, seed);
        let folder = tempfile::tempdir().unwrap();
        let bench = on(&draw, folder.path());
        let free =
            std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| bench.try_commands("")));
        let Ok(Ok(free)) = free else { return Ok(()) };
        if free.outcome.summary.fault.is_some() || free.segments.is_empty() {
            return Ok(());
        }
        all.extend(stops(seed, &draw, &bench, &free)?);
        Ok(())
    });
    assert!(!all.is_empty(), "no stop is long enough to say anything");
    all.sort_by(|a, b| a.ratio.total_cmp(&b.ratio));
    let at = |of: f64| all[share(&all, of)].ratio;
    println!(
        "{test}: {} stops, median {:.3}, p90 {:.3}, p99 {:.3}",
        all.len(),
        at(0.5),
        at(0.9),
        at(0.99)
    );
    let bound = all
        .iter()
        .fold(0.0, |most: f64, stop| most.max(stop.bound_ratio));
    println!("  of the bound at most {bound:.2}");
    for stop in all.iter().rev().take(12) {
        println!("  {:.3}: {}", stop.ratio, stop.what);
    }
    assert!(
        at(share_of) <= MOST,
        "{} at the share {share_of}",
        at(share_of)
    );
}

#[test]
fn holds_on_smooth_take_little_more_than_the_shortest() {
    stops_are_short(
        "watched-smooth",
        "holds_on_smooth_take_little_more_than_the_shortest",
        6,
        0.99,
    );
}

#[test]
fn holds_on_nurbs_take_little_more_than_the_shortest() {
    stops_are_short(
        "watched-nurbs",
        "holds_on_nurbs_take_little_more_than_the_shortest",
        7,
        0.99,
    );
}

/// The plan gets slower and faster again by itself at two corners, with all of the jerk of an axis.
#[test]
fn a_plan_that_brakes_for_a_corner_is_not_taken_for_a_stop() {
    let draw = Draw::new("watched-smooth", 17);
    let folder = tempfile::tempdir().unwrap();
    let bench = on(&draw, folder.path());
    let free = bench.try_commands("").unwrap();
    let plan = JerkPlan::new(&free.segments, &draw.lanes);
    let stop = stop_at(86, &draw, &bench, (&free, &plan)).unwrap().unwrap();
    println!("{:.3}: {}", stop.ratio, stop.what);
    assert!(stop.ratio < MOST, "{:.3}: {}", stop.ratio, stop.what);
}

/// On a line at constant speed the shortest stop has a closed form.
#[test]
fn the_search_finds_the_shortest_stop_on_a_line() {
    for (speed, acceleration, jerk) in [
        (50.0, 1000.0, 20_000.0),
        (50.0, 300.0, 20_000.0),
        (10.0, 1000.0, 20_000.0),
    ] {
        let lane = Lane {
            name: "x".into(),
            parts: [1.0, 0.0, 0.0, 0.0],
            velocity: speed,
            acceleration,
            jerk,
        };
        let mut segment = tandem_sdk::Segment::rest(&tandem_sdk::AxisVector::ZERO, 0.0);
        (
            segment.duration_s,
            segment.coefficients[0][1],
            segment.path[1],
        ) = (10.0, speed, speed);
        let lanes = [lane];
        let plan = JerkPlan::new(&[segment], &lanes);
        let exact_s = scalar_stop_s(speed, 0.0, 1.002 * acceleration, 1.01 * jerk);
        for fineness in [1.0, 1.6] {
            let found_s = plan.stop_s(3.0, fineness);
            println!(
                "{speed} {acceleration} {jerk}: {:.4} of the closed form",
                found_s / exact_s
            );
            assert!(
                (0.999..SLACK).contains(&(found_s / exact_s)),
                "{found_s} for {exact_s}"
            );
        }
    }
}
