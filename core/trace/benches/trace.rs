//! Cost of a record on the soft side, and of handing a sample over on the fine loop.

use divan::Bencher;
use tandem_rings::{MachineState, Sample, Sizes, bridge};
use tandem_sdk::{Axes, AxisVector};
use tandem_trace::{Header, Reader, Writer};

fn main() {
    divan::main();
}

const COUNT: u64 = 10_000;

fn header() -> Header {
    Header {
        fine_period_s: 0.001,
        axes: Axes::new(&[('X', false), ('Y', false), ('Z', false)]).expect("three letters"),
        machine: "mill".to_string(),
        program: "circle".to_string(),
        planner: "look-ahead".to_string(),
        dry_run: false,
        signals: vec![],
    }
}

fn sample(tick: u64) -> Sample {
    let angle = tick as f64 * 1e-3;
    let command = AxisVector::from_slice(&[20.0 * angle.cos(), 20.0 * angle.sin(), -1.0]);
    let state = MachineState::Running;
    Sample {
        tick,
        state,
        command,
        feedback: command,
        sigma: 1.0,
        ratio: 1.0,
        ..Sample::default()
    }
}

fn written(samples: &[Sample]) -> Vec<u8> {
    let mut writer = Writer::new(vec![], &header()).expect("a header");
    for sample in samples {
        writer.sample(sample, &[]).expect("memory");
    }
    writer.finish().expect("memory")
}

/// Ten thousand records to memory.
#[divan::bench]
fn write_10000(bencher: Bencher) {
    let samples: Vec<_> = (0..COUNT).map(sample).collect();
    bencher
        .counter(divan::counter::ItemsCount::new(COUNT))
        .bench_local(|| written(&samples));
}

/// Ten thousand records from memory.
#[divan::bench]
fn read_10000(bencher: Bencher) {
    let bytes = written(&(0..COUNT).map(sample).collect::<Vec<_>>());
    let count = || Reader::new(&bytes[..]).expect("a header").count();
    bencher
        .counter(divan::counter::ItemsCount::new(COUNT))
        .bench_local(count);
}

/// What recording costs the fine loop: one push, whatever the soft side does with it.
#[divan::bench]
fn push_100(bencher: Bencher) {
    let (_rough, mut fine, mut host) = bridge(Sizes::default());
    let samples: Vec<_> = (0..100).map(sample).collect();
    // Once round the ring, so that no page is touched for the first time: a run locks and touches its memory at start.
    for tick in 0..Sizes::default().samples as u64 {
        let _ = fine.samples.push(sample(tick));
    }
    bencher
        .counter(divan::counter::ItemsCount::new(100_u32))
        .with_inputs(|| while host.samples.pop().is_ok() {})
        .bench_local_values(|()| {
            samples
                .iter()
                .filter(|sample| fine.samples.push(**sample).is_ok())
                .count()
        });
}
