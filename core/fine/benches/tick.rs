//! The cost of one fine tick: `cargo bench -p tandem-fine`. An item is a tick, with the host's taking of its sample.

use std::sync::atomic::Ordering::Relaxed;

use divan::counter::ItemsCount;
use tandem_fine::{FineConfig, FineLoop, GuardMode};
use tandem_rig::Echo;
use tandem_rings::{HostEnd, MachineState, Queued, RoughEnd, Sizes, bridge};
use tandem_sdk::{AxisLimits, AxisVector, Limits, Segment, SegmentFlags};

const TICKS: usize = 1000;
const FEED_MM_PER_S: f64 = 50.0;

fn main() {
    divan::main();
}

/// A fine loop with a queue that lasts for [`TICKS`] ticks and a few more.
struct Bench {
    fine: FineLoop,
    host: HostEnd,
    /// Keeps the ring alive.
    _rough: RoughEnd,
}

impl Bench {
    /// Segments of `duration_s`, each turned by `turn_rad` against the one before.
    fn new(duration_s: f64, turn_rad: f64) -> Self {
        Self::of_order(2, duration_s, turn_rad)
    }

    fn of_order(order: u32, duration_s: f64, turn_rad: f64) -> Self {
        let (mut rough, end, host) = bridge(Sizes {
            segments: 2048,
            samples: 64,
        });
        let mut at = AxisVector::ZERO;
        for number in 0..((TICKS + 16) as f64 * 1e-3 / duration_s).ceil() as u32 {
            let queued = segment(&mut at, f64::from(number), duration_s, turn_rad);
            rough.segments.push(queued).unwrap();
        }
        rough.depth.wall_s.store(f64::INFINITY);
        rough.depth.required_s.store(0.0);
        let mut this = Self {
            fine: FineLoop::new(&config(order), end, Box::new(Echo::default()), None),
            host,
            _rough: rough,
        };
        this.fine.reset();
        while this.fine.counters().samples == 0 {
            this.run(1);
            assert!(this.fine.fault().is_none());
        }
        this
    }

    /// [`TICKS`] ticks in `state`. A loop that waits is quick: each tick has to give its sample.
    fn measure(&mut self, state: MachineState) {
        let before = self.fine.counters().samples;
        self.run(TICKS);
        assert_eq!(self.fine.counters().samples - before, TICKS as u64);
        assert_eq!(self.host.status.state.load(Relaxed), state as u32);
        assert!(self.fine.fault().is_none());
    }

    fn run(&mut self, ticks: usize) {
        for tick in 0..ticks {
            self.fine.tick();
            if tick % 8 == 7 {
                while let Ok(sample) = self.host.samples.pop() {
                    divan::black_box(&sample);
                }
            }
        }
    }
}

fn segment(at: &mut AxisVector, number: f64, duration_s: f64, turn_rad: f64) -> Queued {
    let (sin, cos) = (number * turn_rad).sin_cos();
    let direction = AxisVector::from_slice(&[0.8 * cos, 0.8 * sin, 0.6]);
    let mut segment = Segment::rest(at, duration_s);
    segment.flags = SegmentFlags::default();
    segment.feed_mm_per_s = FEED_MM_PER_S;
    segment.stop_deceleration_mm_per_s2 = 1000.0;
    segment.path[0] = number * duration_s * FEED_MM_PER_S;
    segment.path[1] = FEED_MM_PER_S;
    for axis in 0..3 {
        segment.coefficients[axis][1] = FEED_MM_PER_S * direction[axis];
    }
    *at += direction * (FEED_MM_PER_S * duration_s);
    Queued::Segment {
        start_s: number * duration_s,
        segment,
    }
}

fn config(order: u32) -> FineConfig {
    let axis = AxisLimits {
        min_mm: -1e6,
        max_mm: 1e6,
        feed_mm_per_s: 250.0,
        rapid_mm_per_s: 250.0,
        acceleration_mm_per_s2: 1000.0,
        jerk_mm_per_s3: if order == 3 { 20_000.0 } else { f64::INFINITY },
        speed_difference_mm_per_s: 0.0,
    };
    FineConfig {
        // The queue starts at speed: the guard is to look at it, not to stop it.
        speed_difference_mm_per_s: [1000.0; 8],
        order,
        guard: if order == 3 {
            GuardMode::Count
        } else {
            GuardMode::Stop
        },
        ..FineConfig::new(1e-3, Limits::new(&[axis; 3]).unwrap())
    }
}

fn bench(bencher: divan::Bencher, state: MachineState, make: impl Fn() -> Bench) {
    bencher
        .counter(ItemsCount::new(TICKS))
        .with_inputs(make)
        .bench_local_refs(|bench| bench.measure(state));
}

/// Segments of a rough period each, as long lines give them.
#[divan::bench]
fn long_lines(bencher: divan::Bencher) {
    bench(bencher, MachineState::Running, || Bench::new(8e-3, 0.0));
}

/// Chords of 0.05 mm at F3000: a segment a tick.
#[divan::bench]
fn chords(bencher: divan::Bencher) {
    bench(bencher, MachineState::Running, || Bench::new(1e-3, 0.01));
}

/// Feed hold: stopping on the path, then standing there.
#[divan::bench]
fn hold(bencher: divan::Bencher) {
    bench(bencher, MachineState::Holding, || {
        let bench = Bench::new(1e-3, 0.01);
        bench.host.controls.hold.store(true, Relaxed);
        bench
    });
}

/// Segments of a fine period each on a straight line with a jerk limit.
#[divan::bench]
fn jerk_limited(bencher: divan::Bencher) {
    bench(bencher, MachineState::Running, || {
        Bench::of_order(3, 1e-3, 0.0)
    });
}

/// The same, at half the feed.
#[divan::bench]
fn jerk_limited_override(bencher: divan::Bencher) {
    bench(bencher, MachineState::Running, || {
        let bench = Bench::of_order(3, 1e-3, 0.0);
        bench.host.controls.feed_override.store(0.5);
        bench
    });
}
