//! What a script costs, layer by layer: `cargo bench -p tandem-policy`.
//!
//! *call* is the script alone, on a window that lies in its memory; *window* writes the window and reads the answers too;
//! *decide* is everything from blocks to what they get: turns, curvature, the call, the bounds.

use divan::Bencher;
use divan::counter::ItemsCount;
use tandem_policy::abi::block as at;
use tandem_policy::{Bounds, Budget, Engine, Facts, Instance, Period, Policy, Record};
use tandem_sdk::{AxisVector, Block, BlockKind};

const SCRIPTS: [&str; 9] = [
    "nothing",
    "half-feed",
    "v1/gentle-start",
    "gentle-start",
    "v1/material-feed",
    "material-feed",
    "v1/corner-time-constant",
    "corner-time-constant",
    "gentle-plunge",
];

fn main() {
    divan::main();
}

/// The bytes of a script: a built one, one of version 1 of the ABI, or a fixture in text form.
fn bytes(name: &str) -> Vec<u8> {
    let root = concat!(env!("CARGO_MANIFEST_DIR"), "/../..");
    let built = std::fs::read(format!("{root}/scripts/policies/{name}.wasm"));
    let old = || std::fs::read(format!("{root}/tests/fixtures/policies/{name}.wasm"));
    built.or_else(|_| old()).unwrap_or_else(|_| {
        std::fs::read(format!("{root}/tests/fixtures/policies/good/{name}.wat")).unwrap()
    })
}

fn policy(name: &str) -> Policy {
    let script = Engine::new().unwrap().compile(&bytes(name)).unwrap();
    Policy::new(
        script,
        vec![],
        Budget::default(),
        Bounds::default(),
        &Facts::default(),
    )
    .unwrap()
}

/// Lines of a spiral in chords, as CAM writes them.
fn blocks(count: usize) -> Vec<Block> {
    let at = |index: usize| {
        let turn = index as f64 * 0.1;
        AxisVector::from_slice(&[
            (10.0 + turn) * turn.cos(),
            (10.0 + turn) * turn.sin(),
            -0.01 * turn,
        ])
    };
    let line = |index: usize| {
        let ends = Block {
            end: at(index + 1),
            ..Block::at(at(index))
        };
        Block {
            kind: BlockKind::Line,
            feed_mm_per_s: 50.0,
            length_mm: 1.0,
            line: index as u32 + 1,
            ..ends
        }
    };
    (0..count).map(line).collect()
}

/// A line as it crosses into a script.
fn record(index: usize) -> Record {
    let mut record = [0; at::BYTES];
    for (place, number) in [
        (at::SIZE, at::BYTES as u32),
        (at::LINE, index as u32 + 1),
        (at::KIND, 1),
        (at::TOOL, 1),
    ] {
        record[place..place + 4].copy_from_slice(&number.to_le_bytes());
    }
    let numbers = [
        (at::LENGTH, 1.0),
        (at::FEED, 50.0),
        (at::TURN_IN, 0.1),
        (at::TURN_OUT, 0.1),
        (at::CURVATURE, 0.0),
    ];
    let force = [
        (at::TIME_CONSTANT, 0.05),
        (at::TOLERANCE, 0.01),
        (at::FEED_CAP, f64::INFINITY),
    ];
    let asks =
        [at::ASK_TIME_CONSTANT, at::ASK_TOLERANCE, at::ASK_FEED_CAP].map(|place| (place, f64::NAN));
    for (place, number) in numbers.into_iter().chain(force).chain(asks) {
        record[place..place + 8].copy_from_slice(&f64::to_le_bytes(number));
    }
    record
}

fn decide_all(policy: &mut Policy, blocks: &[Block]) {
    for block in blocks {
        policy.offer(block, None);
    }
    policy.decide(None);
}

#[divan::bench(args = SCRIPTS, consts = [1, 64], sample_size = 256)]
fn decide<const BLOCKS: usize>(bencher: Bencher, name: &str) {
    let (mut policy, blocks) = (policy(name), blocks(BLOCKS));
    bencher
        .counter(ItemsCount::new(BLOCKS))
        .bench_local(|| decide_all(&mut policy, divan::black_box(&blocks)));
    assert_eq!(policy.counters().troubles(), 0);
}

#[divan::bench(args = SCRIPTS, consts = [1, 64], sample_size = 256)]
fn window<const BLOCKS: usize>(bencher: Bencher, name: &str) {
    let script = Engine::new().unwrap().compile(&bytes(name)).unwrap();
    let mut instance = Instance::new(&script, &Budget::default(), &[]).unwrap();
    let records: Vec<_> = (0..BLOCKS).map(record).collect();
    let (sights, geometries) = (vec![[0; 72]; BLOCKS], vec![[0; 448]; BLOCKS]);
    let mut asks = Vec::with_capacity(64);
    bencher.counter(ItemsCount::new(BLOCKS)).bench_local(|| {
        asks.clear();
        instance
            .blocks(divan::black_box(&records), &sights, &geometries, &mut asks)
            .unwrap();
    });
}

#[divan::bench(args = ["v1/load-feed", "load-feed", "keep-contour"], sample_size = 256)]
fn period(bencher: Bencher, name: &str) {
    let mut policy = policy(name);
    let means = Period {
        duration_s: 0.008,
        cutting_torque_nm: 2.0,
        reference_torque_nm: 2.0,
        ..Period::default()
    };
    bencher.bench_local(|| policy.period(divan::black_box(&means)));
}

#[divan::bench(args = ["gentle-start", "material-feed", "corner-time-constant", "load-feed"])]
fn compile(bencher: Bencher, name: &str) {
    let bytes = bytes(name);
    bencher
        .with_inputs(|| Engine::new().unwrap())
        .bench_local_values(|engine| engine.compile(&bytes).unwrap());
}

#[divan::bench(args = ["gentle-start", "corner-time-constant"])]
fn compile_again(bencher: Bencher, name: &str) {
    let (engine, bytes) = (Engine::new().unwrap(), bytes(name));
    engine.compile(&bytes).unwrap();
    bencher.bench_local(|| engine.compile(&bytes).unwrap());
}
