//! Lines a second, on one core. `cargo bench -p tandem-gcode`.

use std::fmt::Write as _;
use std::hint::black_box;
use std::time::Instant;

use divan::counter::{BytesCount, ItemsCount};
use tandem_gcode::{Config, Interpreter, Item, Program, Stream, check};
use tandem_sdk::Axes;

const LINES: u32 = 100_000;

fn config() -> Config {
    let mut config =
        Config::new(Axes::new(&[('X', false), ('Y', false), ('Z', false)]).expect("three axes"));
    config.travel_mm[0] = (-250.0, 250.0);
    config.travel_mm[1] = (-250.0, 250.0);
    config
}

/// A sculptured raster as CAM systems write it.
fn raster() -> String {
    let mut text = String::from("G21 G90 G94 G17\nF3000\n");
    for n in 0..LINES {
        let x = f64::from(n % 400) * 0.2;
        let z = 3.0 * (x / 7.0).sin();
        let _ = writeln!(text, "G1X{x:.5}Y{:.5}Z{z:.5}", f64::from(n / 400) * 0.2);
    }
    text
}

fn arcs() -> String {
    let mut text = String::from("G21 G90 G94 G17 F3000 G0 X0 Y0\n");
    for n in 0..LINES {
        let (x, i) = if n % 2 == 0 { (1.0, 0.5) } else { (0.0, -0.5) };
        let _ = writeln!(text, "G2 X{x:.3} Y0 I{i:.3} J0 F{}", 1000 + n % 7);
    }
    text
}

fn interpret(text: &str, items: &mut Vec<Item>) -> usize {
    let mut interpreter = Interpreter::new(config());
    let mut count = 0;
    for (number, line) in (1..).zip(text.lines()) {
        items.clear();
        interpreter
            .line(number, line.as_bytes(), items)
            .expect("a good line");
        count += items.len();
    }
    count
}

#[divan::bench(args = ["raster", "arcs"])]
fn line(bencher: divan::Bencher, program: &str) {
    let text = if program == "raster" {
        raster()
    } else {
        arcs()
    };
    let mut items = Vec::with_capacity(16);
    bencher
        .counter(ItemsCount::new(LINES))
        .counter(BytesCount::of_str(&text))
        .bench_local(|| interpret(black_box(&text), &mut items));
}

#[divan::bench]
fn both_passes(bencher: divan::Bencher) {
    let text = raster();
    bencher.counter(ItemsCount::new(LINES)).bench_local(|| {
        let mut program = Program::spool("raster.ngc", text.as_bytes()).expect("a temporary file");
        assert!(
            check(&mut program, &config(), &mut |_, _| Ok(()))
                .expect("readable")
                .is_ok()
        );
        let mut stream = Stream::new(program, &config()).expect("checked");
        let mut items = Vec::with_capacity(16);
        while stream.next_items(&mut items).expect("unchanged") {
            black_box(&items);
            items.clear();
        }
    });
}

fn main() {
    divan::main();
    let text = raster();
    let mut items = Vec::new();
    let start = Instant::now();
    let blocks = interpret(&text, &mut items);
    let seconds = start.elapsed().as_secs_f64();
    println!(
        "{:.2} million lines a second ({blocks} blocks)",
        f64::from(LINES) / seconds / 1e6
    );
}
