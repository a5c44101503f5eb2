//! Programs whose feed changes from block to block: driving through costs no more than stopping, and a higher feed does not
//! cost time. A failure prints the seed of its program.

use crate::common;

use common::{context, run};
use tandem_block_overlap::{LimitMode, Options};
use tandem_rig::{Random, lines};
use tandem_sdk::{AxisVector, Block, PathMode, PlannerContext};

const PERIOD_S: f64 = 1e-3;

/// Lines, straight on or around corners, whose feeds change by up to 15 times.
fn program(seed: u64) -> Vec<Block> {
    let mut random = Random::new(seed);
    let (straight, tau_s) = (
        seed.is_multiple_of(3),
        random.between(1.0, 100.0).round() / 1e3,
    );
    let mut points = vec![AxisVector::ZERO];
    let (mut heading, mut feed, mut feeds) = (0.0, 1000.0, vec![]);
    for _ in 0..3 + (random.unit() * 12.0) as usize {
        if !straight {
            heading += random.pick(&[0.0, 0.01, 0.1, 0.5, 1.5, std::f64::consts::PI])
                * random.between(-1.0, 1.0);
        }
        let length = random.pick(&[0.3, 2.0, 10.0, 20.0, 60.0]) * random.between(0.5, 1.0);
        let step = [length * f64::cos(heading), length * f64::sin(heading)];
        points.push(*points.last().unwrap() + AxisVector::from_slice(&step));
        feed = (feed * 15f64.powf(random.between(-1.0, 1.0))).clamp(100.0, 15000.0);
        feeds.push(feed);
    }
    let mut blocks = lines(&points, |index| feeds[index]);
    for block in &mut blocks {
        block.time_constant_s = tau_s;
    }
    blocks
}

fn machine() -> PlannerContext {
    context(&[1000.0, 1000.0, 300.0], PERIOD_S)
}

fn options() -> [Options; 2] {
    [
        Options::default(),
        Options {
            limits: LimitMode::Stretch,
            ..Options::default()
        },
    ]
}

fn time_s(options: &Options, blocks: &[Block]) -> f64 {
    run(&machine(), options, blocks, 0.008).duration_s()
}

/// What a comparison of two plans may miss, s: 0.5 % and two fine periods.
fn slack_s(time_s: f64) -> f64 {
    0.005 * time_s + 2.0 * PERIOD_S
}

#[test]
fn driving_through_is_no_slower_than_stopping() {
    for seed in 1..=600 {
        let blocks = program(seed);
        let mut stops = blocks.clone();
        for block in &mut stops {
            block.path_mode = PathMode::ExactStop;
        }
        for options in options() {
            let [through_s, stopping_s] = [&blocks, &stops].map(|blocks| time_s(&options, blocks));
            assert!(
                through_s <= stopping_s + slack_s(stopping_s),
                "seed {seed}, {:?}: {through_s} s, {stopping_s} s with exact stops",
                options.limits
            );
        }
    }
}

/// Which junctions are passed in overlap is a choice that looks at pairs of blocks, so a few programs gain from a lower feed.
#[test]
fn a_higher_feed_hardly_ever_costs_time() {
    let (mut compared, mut slower) = (0, 0);
    for seed in 1..=300 {
        let mut blocks = program(seed);
        let raised = seed as usize % blocks.len();
        for options in options() {
            let mut last_s = f64::INFINITY;
            for feed in [600.0, 1500.0, 4000.0, 8000.0, 15000.0] {
                blocks[raised].feed_mm_per_s = feed / 60.0;
                let time_s = time_s(&options, &blocks);
                let place = format!(
                    "seed {seed}, {:?}: block {raised} at F{feed}",
                    options.limits
                );
                assert!(
                    time_s <= 1.02 * last_s,
                    "{place} takes {time_s} s instead of {last_s} s"
                );
                if time_s > last_s + slack_s(time_s) {
                    println!("{place} takes {time_s} s instead of {last_s} s");
                    slower += 1;
                }
                compared += 1;
                last_s = time_s.min(last_s);
            }
        }
    }
    assert!(slower <= compared / 200, "{slower} of {compared}");
}

/// Times with the feeds of the middle one of three lines on the X axis.
fn three_lines_s(lengths_mm: [f64; 3], feed: f64, middle: f64, tau_s: f64) -> f64 {
    let [first, second, third] = lengths_mm;
    let points =
        [0.0, first, first + second, first + second + third].map(|x| AxisVector::from_slice(&[x]));
    let mut blocks = lines(&points, |index| if index == 1 { middle } else { feed });
    for block in &mut blocks {
        block.time_constant_s = tau_s;
    }
    time_s(&Options::default(), &blocks)
}

#[test]
fn a_fast_line_between_slow_ones_is_driven_fast() {
    for (tau_s, stopping_s) in [(0.05, 1.792), (0.02, 1.748), (0.005, 1.743)] {
        let through_s = three_lines_s([10.0, 60.0, 10.0], 1000.0, 15000.0, tau_s);
        assert!(through_s <= stopping_s, "TA {tau_s}: {through_s} s");
    }
    let [slow_s, fast_s] =
        [8000.0, 15000.0].map(|middle| three_lines_s([20.0; 3], 600.0, middle, 0.005));
    assert!(
        fast_s <= slow_s + PERIOD_S && slow_s < 4.32,
        "F8000 {slow_s} s, F15000 {fast_s} s"
    );
}

/// Where the path may be left by as much as that, a block overlaps the next one by all of its time constant: it ends when that one has
/// its feed, and that one begins while it still has its own.
#[test]
fn blocks_that_overlap_by_a_time_constant_are_reported_to_begin_and_end_at_full_feed() {
    let feeds = [50.0, 30.0, 40.0];
    let points = [[0.0, 0.0], [20.0, 0.0], [20.0, 20.0], [40.0, 20.0]];
    let mut blocks = lines(&points.map(|at| AxisVector::from_slice(&at)), |index| {
        60.0 * feeds[index]
    });
    for block in &mut blocks {
        block.time_constant_s = 0.05;
        block.path_tolerance_mm = 10.0;
    }
    let context = context(&[1e5; 3], PERIOD_S);
    let reports = run(&context, &Options::default(), &blocks, 0.008).reports;
    let found: Vec<_> = reports
        .iter()
        .map(|it| [it.start_feed_mm_per_s, it.end_feed_mm_per_s])
        .collect();
    assert_eq!(found, [[0.0, 30.0], [50.0, 40.0], [30.0, 0.0]]);
}
