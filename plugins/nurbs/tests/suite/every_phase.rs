//! Random machines and programs: every limit at every point and on the samples of every phase of the tick, the travel, and a
//! machine time that stands in a relation to the way. Judged by differences and points, not by what the planner bounds.
//!
//! `TANDEM_SEED=7` runs one seed, `TANDEM_SEEDS=500` so many.

use crate::common;

use std::fmt::Write;

use common::Collected;
use tandem_nurbs::{NurbsPlanner, Options};
use tandem_rig::{Given, Offer, Random, arc, line, numbered};
use tandem_sdk::{
    AxisLimits, AxisVector, Block, BlockKind, NurbsData, Planner, PlannerContext, Segment,
};

const AXES: usize = 4;
const PERIODS_MS: [f64; 7] = [0.125, 0.25, 0.37, 0.5, 1.0, 1.3, 2.0];
/// Phases of the tick that are looked at, and points of a segment.
const PHASES: u32 = 9;
const POINTS: u32 = 12;
/// What the guard and the governor allow for rounding, and the guard for jerk.
const ROUNDING: f64 = 1e-6;
const JERK: f64 = 1e-2;

/// A machine and a program.
struct Case {
    context: PlannerContext,
    blocks: Vec<Given>,
    form: &'static str,
}

fn limits(random: &mut Random, turn: bool) -> AxisLimits {
    let speed = random.length(2.0, 1000.0) * if turn { 0.02 } else { 1.0 };
    // Times to full speed and to full acceleration, so that four decades of either stay a machine.
    let acceleration = speed / random.length(0.002, 2.0);
    let jerk = acceleration / random.length(0.001, 0.5);
    AxisLimits {
        feed_mm_per_s: speed,
        rapid_mm_per_s: speed * random.pick(&[1.0, 1.0, 2.0]),
        jerk_mm_per_s3: jerk,
        ..tandem_rig::axis(acceleration)
    }
}

fn case(seed: u64) -> Case {
    let mut random = Random::new(seed);
    let alike = limits(&mut random, false);
    let same = random.below(3) == 0;
    let axes: [AxisLimits; AXES] = std::array::from_fn(|n| {
        if same && n < 3 {
            alike
        } else {
            limits(&mut random, n == 3)
        }
    });
    let period_s = random.pick(&PERIODS_MS) * 1e-3;
    let mut context = tandem_rig::context(&axes, period_s);
    context.rough_period_s = period_s * (1 + random.below(25)) as f64;
    context.max_feed_ratio = random.pick(&[1.0, 1.0, 1.2, 2.0]);
    let blocks = program(&mut random);
    let form = if random.below(2) == 0 {
        "scan"
    } else {
        "windowed"
    };
    Case {
        context,
        blocks,
        form,
    }
}

/// Lines that turn a little or much, arcs, curves, with and without the rotary axis.
fn program(random: &mut Random) -> Vec<Given> {
    let size = random.length(1e-4, 20.0);
    let feed = random.length(0.02, 300.0);
    let turns = random.below(4) == 0;
    let count = 2 + random.below(12);
    let (mut at, mut heading) = (AxisVector::ZERO, random.between(0.0, std::f64::consts::TAU));
    let mut blocks: Vec<(Block, Option<NurbsData>)> = Vec::new();
    for _ in 0..count {
        let length = size * random.length(0.1, 3.0);
        heading += match random.below(4) {
            0 => random.between(-3.0, 3.0),
            1 => 0.0,
            _ => random.length(1e-6, 3e-3) * random.pick(&[-1.0, 1.0]),
        };
        let mut to = at;
        to[0] += length * heading.cos();
        to[1] += length * heading.sin();
        to[2] += if random.below(3) == 0 {
            random.between(-0.5, 0.5) * length
        } else {
            0.0
        };
        if turns {
            to[3] += random.between(-1.0, 1.0) * random.pick(&[0.0, 0.01, 1.0]);
        }
        let feed = feed * random.length(0.3, 3.0);
        match random.below(8) {
            0 => {
                let radius = length * random.length(0.1, 2.0);
                let side = random.pick(&[-1.0, 1.0]);
                let center = [
                    at[0] - side * radius * heading.sin(),
                    at[1] + side * radius * heading.cos(),
                ];
                let sweep = side * random.between(0.1, 6.2);
                blocks.push((arc(&at, center, sweep, feed), None));
                heading += sweep;
            }
            1 => {
                // Path speed is that of the linear axes, and a rotary one may turn where they nearly stand still.
                to[3] = at[3];
                let mut points = vec![at];
                for n in 1..5 {
                    let mut point = at + (to - at) * (f64::from(n) / 5.0);
                    point[0] += random.between(-0.5, 0.5) * length;
                    point[1] += random.between(-0.5, 0.5) * length;
                    points.push(point);
                }
                points.push(to);
                let knots = [0.0, 0.0, 0.0, 0.0, 1.0, 2.0, 3.0, 3.0, 3.0, 3.0];
                let mut block = Block::at(at);
                (block.end, block.kind, block.length_mm, block.feed_mm_per_s) =
                    (to, BlockKind::Nurbs, length, feed);
                let data = NurbsData {
                    degree: 3,
                    weights: vec![1.0; points.len()],
                    control_points: points,
                    knots: knots.into(),
                };
                blocks.push((block, Some(data)));
            }
            2 => {
                let mut block = line(&at, &to, feed);
                block.kind = BlockKind::Rapid;
                blocks.push((block, None));
            }
            _ => blocks.push((line(&at, &to, feed), None)),
        }
        at = blocks[blocks.len() - 1].0.end;
    }
    let facts = numbered(blocks.iter().map(|(block, _)| *block).collect());
    facts
        .into_iter()
        .zip(blocks)
        .map(|(block, (_, data))| (block, data.map(Into::into)))
        .collect()
}

/// All that the planner makes of it, or why not.
fn drive(case: &Case) -> Result<Collected, String> {
    let options = Options::parse(&format!("form = \"{}\"", case.form)).unwrap();
    let mut planner = NurbsPlanner::new(&options, &case.context).unwrap();
    let mut waiting = case.blocks.iter().peekable();
    let mut collected = Collected::default();
    for _ in 0..3_000_000 {
        while let Some(block) = waiting.peek() {
            match block
                .offer(&mut planner)
                .map_err(|error| error.to_string())?
            {
                tandem_sdk::Accepted::Accepted => waiting.next(),
                tandem_sdk::Accepted::Full => break,
            };
        }
        if waiting.peek().is_none() {
            planner.finish();
        }
        let advanced = planner
            .advance(case.context.rough_period_s, &mut collected)
            .map_err(|error| error.to_string())?;
        if advanced.done != 0 {
            return Ok(collected);
        }
    }
    Err("it does not come to an end".to_string())
}

/// Says what is exceeded first.
struct Judge<'a> {
    case: &'a Case,
    found: String,
}

impl Judge<'_> {
    fn ask(&mut self, what: &str, axis: usize, line: u32, value: f64, limit: f64, noise: f64) {
        if value.abs() > limit + noise && self.found.len() < 400 {
            writeln!(
                self.found,
                "{what} of axis {axis} in line {line}: {value} of {limit} ({:.5})",
                value.abs() / limit
            )
            .unwrap();
        }
    }

    fn points(&mut self, segments: &[Segment]) {
        let axes = self.case.context.limits.axes;
        for segment in segments {
            let rapid = segment.flags.contains(tandem_sdk::SegmentFlags::RAPID);
            for n in 0..=POINTS {
                let t_s = segment.duration_s * f64::from(n) / f64::from(POINTS);
                let (x, v, a) = (
                    segment.position(t_s),
                    segment.velocity(t_s),
                    segment.acceleration(t_s),
                );
                for (axis, limits) in axes.iter().enumerate().take(AXES) {
                    let most = if rapid {
                        limits.rapid_mm_per_s
                    } else {
                        limits.feed_mm_per_s
                    };
                    self.ask(
                        "velocity",
                        axis,
                        segment.line,
                        v[axis],
                        most * (1.0 + ROUNDING),
                        0.0,
                    );
                    let acceleration = limits.acceleration_mm_per_s2 * (1.0 + ROUNDING);
                    self.ask(
                        "acceleration",
                        axis,
                        segment.line,
                        a[axis],
                        acceleration,
                        0.0,
                    );
                    let beyond = (limits.min_mm - x[axis]).max(x[axis] - limits.max_mm);
                    self.ask("travel", axis, segment.line, beyond.max(0.0), 1e-11, 0.0);
                }
            }
        }
    }

    /// Samples from rest to rest at a phase, and how they go on behind a rest: `all` are the samples of the run.
    fn samples(&mut self, all: &[(AxisVector, u32)]) {
        let (axes, period_s) = (
            self.case.context.limits.axes,
            self.case.context.fine_period_s,
        );
        for four in all.windows(4) {
            let at = |n: usize, axis: usize| four[n].0[axis];
            for (axis, limits) in axes.iter().enumerate().take(AXES) {
                let [d0, d1, d2] = [0, 1, 2].map(|n| at(n + 1, axis) - at(n, axis));
                let noise = 8.0 * f64::EPSILON * at(3, axis).abs().max(1.0);
                let top = limits.feed_mm_per_s.max(limits.rapid_mm_per_s) * (1.0 + ROUNDING);
                let (acceleration, jerk) = (
                    limits.acceleration_mm_per_s2 * (1.0 + ROUNDING),
                    limits.jerk_mm_per_s3 * (1.0 + JERK),
                );
                let line = four[3].1;
                self.ask(
                    "sampled velocity",
                    axis,
                    line,
                    d2 / period_s,
                    top,
                    noise / period_s,
                );
                self.ask(
                    "sampled acceleration",
                    axis,
                    line,
                    (d2 - d1) / period_s.powi(2),
                    acceleration,
                    noise / period_s.powi(2),
                );
                let value = (d2 - 2.0 * d1 + d0) / period_s.powi(3);
                self.ask(
                    "sampled jerk",
                    axis,
                    line,
                    value,
                    jerk,
                    2.0 * noise / period_s.powi(3),
                );
            }
        }
    }
}

/// The samples of the run undisturbed: a rest restarts the ticks. The first one of each motion comes `phase` of a period after
/// its start.
fn samples(segments: &[Segment], period_s: f64, phase: f64) -> Vec<(AxisVector, u32)> {
    let first = segments[0].position(0.0);
    let mut all = vec![(first, 0); 3];
    let mut next_s = phase * period_s;
    for segment in segments {
        while next_s < segment.duration_s {
            all.push((segment.position(next_s), segment.line));
            next_s += period_s;
        }
        next_s -= segment.duration_s;
        if segment.duration_s == 0.0 {
            all.push((segment.position(0.0), segment.line));
            next_s = if phase == 0.0 {
                period_s
            } else {
                phase * period_s
            };
        }
    }
    let last = all[all.len() - 1];
    all.extend([last; 3]);
    all
}

fn judge(case: &Case, collected: &Collected) -> String {
    let mut judge = Judge {
        case,
        found: String::new(),
    };
    judge.points(&collected.segments);
    for phase in 0..PHASES {
        judge.samples(&samples(
            &collected.segments,
            case.context.fine_period_s,
            f64::from(phase) / f64::from(PHASES),
        ));
    }
    let (end, programmed) = (collected.end(), case.blocks[case.blocks.len() - 1].0.end);
    if end != programmed {
        writeln!(judge.found, "it ends at {end:?}, not at {programmed:?}").unwrap();
    }
    judge.found
}

fn seeds(count: u64) -> Vec<u64> {
    let number = |name: &str| {
        std::env::var(name)
            .ok()
            .map(|text| text.parse::<u64>().unwrap())
    };
    match (number("TANDEM_SEED"), number("TANDEM_SEEDS")) {
        (Some(seed), None) => vec![seed],
        (Some(seed), Some(count)) => (seed..seed + count).collect(),
        (None, count_asked) => (1..=count_asked.unwrap_or(count)).collect(),
    }
}

#[test]
fn random_machines_keep_their_limits_on_samples_of_every_phase() {
    let mut failed = String::new();
    for seed in seeds(25) {
        let case = case(seed);
        let begun = std::time::Instant::now();
        let what = match drive(&case) {
            Ok(collected) => {
                if std::env::var("TANDEM_TIMES").is_ok() {
                    println!(
                        "seed {seed} {}: {:.3} s of motion, planned in {:.3} s, {} segments",
                        case.form,
                        collected.duration_s(),
                        begun.elapsed().as_secs_f64(),
                        collected.segments.len()
                    );
                }
                judge(&case, &collected)
            }
            Err(error) => format!("{error}\n"),
        };
        if !what.is_empty() {
            writeln!(failed, "TANDEM_SEED={seed} {}: {what}", case.form).unwrap();
        }
    }
    assert!(failed.is_empty(), "{failed}");
}
