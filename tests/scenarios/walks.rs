//! Walks of the override, holds and stalls on random machines under a jerk limit: every sample keeps every limit.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

use tandem_rings::Sample;

use crate::bench::{Bench, Ran};
use crate::harness::root;
use crate::replay::for_each_seed;
use crate::walks_draw::{Draw, Lane};

/// The largest of a derivative of a lane in units of its limit, and where.
#[derive(Clone, Copy, Debug, Default)]
struct Worst {
    share: f64,
    tick: u64,
    lane: usize,
}

/// Worst velocity, acceleration and jerk of all samples, by the finite differences of what was sent.
fn worst(lanes: &[Lane], period_s: f64, samples: &[Sample]) -> [Worst; 3] {
    let mut found = [Worst::default(); 3];
    for (number, lane) in lanes.iter().enumerate() {
        let at = |sample: &Sample| {
            (0..4)
                .map(|axis| lane.parts[axis] * sample.command[axis])
                .sum::<f64>()
        };
        for (order, found) in found.iter_mut().enumerate() {
            for n in 0..samples.len() {
                let back = |by: usize| at(&samples[n.saturating_sub(by)]);
                let (difference, limit) = difference(order, back, lane, period_s);
                let rounding =
                    f64::from(8 << order) * f64::EPSILON * at(&samples[n]).abs().max(1.0)
                        / [period_s, period_s.powi(2), period_s.powi(3)][order];
                let share = (difference.abs() - rounding) / limit;
                if share > found.share {
                    *found = Worst {
                        share,
                        tick: samples[n].tick,
                        lane: number,
                    };
                }
            }
        }
    }
    found
}

fn difference(order: usize, back: impl Fn(usize) -> f64, lane: &Lane, period_s: f64) -> (f64, f64) {
    match order {
        0 => ((back(0) - back(1)) / period_s, lane.velocity),
        1 => (
            (back(0) - 2.0 * back(1) + back(2)) / period_s.powi(2),
            lane.acceleration,
        ),
        _ => (
            (back(0) - 3.0 * back(1) + 3.0 * back(2) - back(3)) / period_s.powi(3),
            lane.jerk,
        ),
    }
}

/// What became of a run.
enum Became {
    Refused,
    Ran(Box<(Ran, [Worst; 3])>),
}

/// A run in `folder`; `Err` where it panics or does not end.
fn driven(draw: &Draw, folder: &Path, commands: &str) -> Result<Became, String> {
    let (program, machine) = (folder.join("program.ngc"), folder.join("machine.toml"));
    std::fs::write(&program, &draw.program).unwrap();
    std::fs::write(&machine, &draw.machine).unwrap();
    std::fs::write(folder.join("commands.csv"), commands).unwrap();
    let run = || Bench::of(&program).on(&machine).try_commands(commands);
    match catch_unwind(AssertUnwindSafe(run)) {
        Err(_) => Err("it panics or does not end".into()),
        Ok(Err(_)) => Ok(Became::Refused),
        Ok(Ok(ran)) => {
            let worst = worst(&draw.lanes, draw.period_s, &ran.samples);
            Ok(Became::Ran(Box::new((ran, worst))))
        }
    }
}

/// Every sample within velocity, acceleration and jerk, whatever the guard or the governor say of it.
fn within(lanes: &[Lane], ran: &Ran, worst: &[Worst; 3]) -> Result<(), String> {
    if let Some(fault) = &ran.outcome.summary.fault {
        return Err(fault.clone());
    }
    for ((what, most), found) in [("velocity", EXACT), ("acceleration", EXACT), ("jerk", 1.01)]
        .into_iter()
        .zip(worst)
    {
        if found.share > most {
            let (lane, tick) = (&lanes[found.lane].name, found.tick);
            return Err(format!(
                "{what} of {lane} {:.4} of its limit at tick {tick}",
                found.share
            ));
        }
    }
    Ok(())
}

/// What rounding leaves of a limit that is kept.
const EXACT: f64 = 1.0 + 1e-6;

/// Where the planner does not keep the limits by itself, undisturbed, nothing can be said of the governor.
fn walks_keep_every_limit(planner: &str, test: &str, count: u64) {
    let (mut ran_count, mut refused, mut planners, mut relaxed) = (0, 0, 0, 0);
    let tried = for_each_seed(test, count, |seed| {
        let draw = Draw::new(planner, seed);
        let kept = std::env::var("TANDEM_KEEP")
            .map(|folder| Path::new(&folder).join(format!("{planner}-{seed}")));
        let temporary = tempfile::tempdir().unwrap();
        let folder = kept.unwrap_or_else(|_| temporary.path().to_owned());
        std::fs::create_dir_all(&folder).unwrap();
        match driven(&draw, &folder, "") {
            Ok(Became::Ran(free)) if within(&draw.lanes, &free.0, &free.1).is_ok() => {}
            Ok(Became::Refused) => {
                refused += 1;
                return Ok(());
            }
            _ => {
                planners += 1;
                return Ok(());
            }
        }
        let Became::Ran(walked) = driven(&draw, &folder, &draw.commands)? else {
            return Err("refused".into());
        };
        ran_count += 1;
        relaxed += walked.0.outcome.summary.jerk_relaxed_samples;
        within(&draw.lanes, &walked.0, &walked.1)
    });
    println!(
        "{test}: {ran_count} walked, {refused} refused, {planners} beyond a limit undisturbed, {relaxed} relaxed"
    );
    assert!(
        std::env::var("TANDEM_SEED").is_ok() || 2 * ran_count > tried,
        "too few runs say anything"
    );
}

#[test]
fn walks_on_smooth_keep_every_limit() {
    walks_keep_every_limit("smooth", "walks_on_smooth_keep_every_limit", 20);
}

#[test]
fn walks_on_nurbs_keep_every_limit() {
    walks_keep_every_limit("nurbs", "walks_on_nurbs_keep_every_limit", 20);
}

/// Overrides of nothing and resumes on arcs of a wrapped axis: the rate comes back to 1 while the arc turns at the limit.
#[test]
fn the_rate_of_program_time_comes_to_the_end_of_its_range_without_a_step() {
    let folder = root().join("tests/fixtures/walks/wrapped-arc");
    let commands = std::fs::read_to_string(folder.join("commands.csv")).unwrap();
    let ran = Bench::of(&folder.join("program.ngc"))
        .on(&folder.join("machine.toml"))
        .try_commands(&commands)
        .unwrap();
    let lane = |name: &str, parts, velocity, acceleration, jerk| Lane {
        name: name.into(),
        parts,
        velocity,
        acceleration,
        jerk,
    };
    let lanes = [
        lane("x", [1.0, 0.0, 0.0, 0.0], 125.8, 1258.739, 28498.29),
        lane("y", [0.0, 1.0, 0.0, 0.0], 47.17, 54.8587, 297.3755),
    ];
    let worst = worst(&lanes, 0.0005, &ran.samples);
    within(&lanes, &ran, &worst).unwrap();
    assert_eq!(ran.outcome.summary.jerk_relaxed_samples, 0);
}
