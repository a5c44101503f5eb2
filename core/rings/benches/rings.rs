//! What crossing the bridge costs: `cargo bench -p tandem-rings`.

use divan::{Bencher, black_box};
use tandem_rings::{Queued, Sample, Sizes, bridge};
use tandem_sdk::{AxisVector, Segment};

fn main() {
    divan::main();
}

/// A sample out of the fine loop and into the host.
#[divan::bench]
fn sample(bencher: Bencher) {
    let (_rough, mut fine, mut host) = bridge(Sizes::default());
    let sample = Sample::default();
    bencher.bench_local(|| {
        fine.samples.push(black_box(sample)).unwrap();
        host.samples.pop().unwrap()
    });
}

/// A segment out of the rough loop and into the fine loop.
#[divan::bench]
fn segment(bencher: Bencher) {
    let (mut rough, mut fine, _host) = bridge(Sizes::default());
    let queued = Queued::Segment {
        start_s: 0.0,
        segment: Segment::rest(&AxisVector::ZERO, 0.001),
    };
    bencher.bench_local(|| {
        rough.segments.push(black_box(queued)).unwrap();
        fine.segments.pop().unwrap()
    });
}

/// Storing and reading how far the queue reaches.
#[divan::bench]
fn depth(bencher: Bencher) {
    let (rough, fine, _host) = bridge(Sizes::default());
    bencher.bench_local(|| {
        rough.depth.wall_s.store(black_box(1.0));
        fine.depth.may_start(black_box(0.5))
    });
}
