//! Random programs: within all limits every time. What they cost against a stop at every corner is printed.

use crate::common;

use common::programs::{KINDS, program};
use common::{context, judge, run, samples};
use tandem_sdk::{Block, PathMode};
use tandem_smooth::Options;

/// Programs in all.
const PROGRAMS: u64 = 208;

#[test]
fn random_programs_keep_all_limits() {
    let (mut stops, mut refused) = (0, 0);
    let mut ratios = [(0.0, 0); KINDS.len()];
    let first: u64 = std::env::var("SMOOTH_SEED")
        .ok()
        .and_then(|seed| seed.parse().ok())
        .unwrap_or(0);
    let count: u64 = std::env::var("SMOOTH_PROGRAMS")
        .ok()
        .and_then(|n| n.parse().ok())
        .unwrap_or(PROGRAMS);
    for seed in first..first + count {
        let (kind, blocks, points) = program(seed);
        let context = context(&points[0], 0.01);
        let (collected, effort) = run(&blocks, &Options::default(), &context);
        let peaks = judge(&samples(&collected.segments), &points);
        let what = format!("SMOOTH_SEED={seed} SMOOTH_PROGRAMS=1 ({kind}): {peaks:?}");
        let feed = blocks[0].feed_mm_per_s;
        assert!(
            peaks.axis_speed <= 250.0 && peaks.speed <= feed * (1.0 + 1e-6),
            "feed {feed}, {what}"
        );
        assert!(
            peaks.acceleration <= 1000.0 * (1.0 + 1e-6) && peaks.jerk <= 20_000.0 * 1.01,
            "{what}"
        );
        assert!(peaks.deviation_mm.iter().all(|off| *off <= 0.01), "{what}");
        assert_eq!(collected.reports.len(), blocks.len(), "{what}");
        (stops, refused) = (stops + effort.stops, refused + effort.rejected);
        let exact: Vec<Block> = blocks
            .iter()
            .map(|block| Block {
                path_mode: PathMode::ExactStop,
                ..*block
            })
            .collect();
        let stopping = run(&exact, &Options::default(), &context).0;
        let stopping_s = samples(&stopping.segments).len() as f64 * 1e-3;
        let (sum, count) = &mut ratios[(seed % KINDS.len() as u64) as usize];
        (*sum, *count) = (*sum + peaks.time_s / stopping_s, *count + 1);
    }
    println!(
        "seeds {first} to {}: {stops} stops inside, {refused} windows refused",
        first + count - 1
    );
    for (kind, (sum, count)) in KINDS.iter().zip(ratios) {
        println!(
            "{kind:16} {:.3} of the time with a stop at every corner",
            sum / f64::from(count.max(1))
        );
    }
}
