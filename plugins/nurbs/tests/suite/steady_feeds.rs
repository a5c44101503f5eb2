//! Lines at a steady feed through many windows: no faster than programmed anywhere, and no rest before the end.

use crate::common;

use common::{context, run};
use tandem_sdk::{AxisVector, Block, BlockKind, SegmentFlags};

#[test]
fn the_feed_is_reached_and_never_exceeded() {
    for form in ["scan", "windowed"] {
        for feed in [0.5, 4.0, 8.0, 30.0, 250.0] {
            let mut block = Block::at(AxisVector::ZERO);
            block.end = AxisVector::from_slice(&[4.0 * feed, 3.0 * feed]);
            (block.kind, block.length_mm, block.feed_mm_per_s) =
                (BlockKind::Line, 5.0 * feed, feed);
            let blocks = [(block, None)];
            let driven = run(
                &format!("form = \"{form}\""),
                &context(AxisVector::ZERO),
                &blocks,
            );
            // Looked at much closer than the fine period.
            let path: Vec<f64> = driven
                .path_samples(1e-4)
                .into_iter()
                .map(|sample| sample.1)
                .collect();
            let most = path
                .windows(2)
                .map(|pair| (pair[1] - pair[0]) / 1e-4)
                .fold(0.0, f64::max);
            assert!(
                most <= feed * (1.0 + 1e-6) + 1e-9 && most > 0.99 * feed,
                "{form}, {feed} mm/s: {most}"
            );
            let rests = driven
                .segments
                .iter()
                .filter(|s| s.flags.contains(SegmentFlags::ENDS_AT_REST))
                .count();
            assert_eq!(rests, 1, "{form}, {feed} mm/s");
            assert!(
                driven.duration_s() < 5.13,
                "{form}, {feed} mm/s: {} s",
                driven.duration_s()
            );
        }
    }
}
