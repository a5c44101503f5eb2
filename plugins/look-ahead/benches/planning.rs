//! Planning throughput: blocks in, segments out, streaming, one core. `cargo bench -p tandem-look-ahead`.

#[path = "../tests/common/mod.rs"]
mod common;

use common::context;
use divan::counter::ItemsCount;
use tandem_look_ahead::{LookAhead, Options};
use tandem_rig::{Away, program, stream};
use tandem_sdk::{AxisVector, Planner};

fn main() {
    divan::main();
}

#[divan::bench(args = ["raster", "spiral"])]
fn look_ahead(bencher: divan::Bencher, name: &str) {
    let blocks = program(name);
    let mut planner =
        LookAhead::new(&Options::default(), &context(&[1000.0; 3], 100.0, 0.001)).unwrap();
    bencher
        .counter(ItemsCount::new(blocks.len()))
        .bench_local(|| {
            let mut away = Away::default();
            planner.reset(&AxisVector::ZERO);
            stream(&mut planner, &blocks, 0.008, &mut away);
            away.segments
        });
}
