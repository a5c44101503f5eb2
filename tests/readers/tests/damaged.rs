//! Every reader on sound examples that were damaged at random. A failure prints the reader, and leaves its input in a file;
//! `TANDEM_SEED` drives the same inputs again, `TANDEM_SEEDS` asks for another number of inputs of each reader.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::sync::Mutex;
use std::thread;

use tandem_readers::{Damage, Reader, readers};
use tandem_rig::Random;

/// Inputs of each reader: some seconds of one processor in a build without optimisation.
const INPUTS: usize = 500;

#[test]
fn whatever_is_damaged_is_read_or_refused() {
    let asked = std::env::var("TANDEM_SEEDS");
    let inputs = asked.map_or(INPUTS, |count| count.parse().expect("a number"));
    let mut random = Random::from_the_clock();
    // Each with a seed of its own, so that they are damaged alike however many are judged at a time.
    let seeded = readers().into_iter().map(|reader| {
        let damage = Damage::new(&reader, random.below(1 << 31));
        (reader, damage)
    });
    let seeded = Mutex::new(seeded.collect::<Vec<_>>());
    let next = || seeded.lock().unwrap().pop();
    thread::scope(|scope| {
        for _ in 0..thread::available_parallelism().map_or(1, usize::from) {
            scope.spawn(|| {
                while let Some((reader, damage)) = next() {
                    judge_all(&reader, damage, inputs);
                }
            });
        }
    });
}

fn judge_all(reader: &Reader, mut damage: Damage, inputs: usize) {
    for index in 0..inputs {
        let input = damage.input();
        if catch_unwind(AssertUnwindSafe(|| (reader.judge)(&input))).is_err() {
            let kept = Path::new(env!("CARGO_TARGET_TMPDIR")).join(reader.name);
            std::fs::write(&kept, &input).expect("a file");
            panic!("{}: input {index}, see {}", reader.name, kept.display());
        }
    }
}

#[test]
fn every_example_is_sound() {
    for reader in readers() {
        let damage = Damage::new(&reader, 1);
        let needs_none = reader.name == "ethercat_frame";
        assert_eq!(damage.examples().is_empty(), needs_none, "{}", reader.name);
        damage
            .examples()
            .iter()
            .for_each(|bytes| (reader.judge)(bytes));
    }
}
