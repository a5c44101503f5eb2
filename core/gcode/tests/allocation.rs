//! A steady state allocates nothing: neither lines to items, nor chunks to lines.

#[path = "../../../tests/counting_allocator.rs"]
mod counting_allocator;

use counting_allocator::{HeapUse, heap_use_of, peak_bytes_of};
use tandem_gcode::{Config, Program, Stream, check};
use tandem_sdk::Axes;

#[test]
fn a_steady_state_allocates_nothing() {
    let line = "N5 G1 X[#1 + 0.5] Y0.25 F1000 S500 M8 (along)\n#1=[#1 + 0.001] #<depth>=[#1 * 2]\nG2 X0 Y0 R40\nG4 P0.1\n";
    let text = "M3 S500 TA 20\n".to_owned() + &line.repeat(10_000);
    let config = Config::new(Axes::new(&[('X', false), ('Y', false)]).unwrap());
    let mut program = Program::spool("steady.ngc", text.as_bytes()).unwrap();
    assert!(
        check(&mut program, &config, &mut |_, _| Ok(()))
            .unwrap()
            .is_ok()
    );
    let mut stream = Stream::new(program, &config).unwrap();
    let mut items = Vec::with_capacity(100);
    for _ in 0..100 {
        stream.next_items(&mut items).unwrap();
        items.clear();
    }
    let used = heap_use_of(|| {
        while stream.next_items(&mut items).unwrap() {
            items.clear();
        }
    });
    assert_eq!(used, HeapUse::default());
}

/// The most that is held while `text` is checked, and driven where it is sound.
fn peak_of(text: &str) -> usize {
    let config = Config::new(Axes::new(&[('X', false), ('Y', false)]).unwrap());
    let mut program = Program::spool("long.ngc", text.as_bytes()).unwrap();
    peak_bytes_of(|| {
        let report = check(&mut program, &config, &mut |_, _| Ok(())).unwrap();
        if !report.is_ok() {
            return;
        }
        let mut stream = Stream::new(program, &config).unwrap();
        let mut items = Vec::new();
        while stream.next_items(&mut items).unwrap() {
            items.clear();
        }
    })
}

/// O-words are indexed, and lines are not kept: four times as many lines need a few bytes more for each 64 KiB of text.
#[test]
fn memory_does_not_grow_with_the_lines() {
    let plain = "G1 X1 Y2 F1000\nX2 Y3\n(a remark that is no motion)\n";
    let called = "o<hop> sub\nG91 G0 X#1\nG90\no<hop> endsub\no1 repeat [2]\no<hop> call [1]\n";
    for (begin, line, end) in [
        ("", plain, "M2\n"),
        (called, plain, "o1 endrepeat\nM2\n"),
        // What is one too many, or wrong, is not kept either.
        ("G0 X1\n", "o1 if [1]\n", ""),
        ("G0 X1\n", "O7\n", ""),
        ("G0 X1\n", "o<\n", ""),
        ("G0 X1\n", "o1 endif\n", ""),
    ] {
        let text = |count| [begin, &line.repeat(count), end].concat();
        let (some, many) = (text(25_000), text(100_000));
        let (peak, peak_of_many) = (peak_of(&some), peak_of(&many));
        let chunks = (many.len() - some.len()) / 65_536 + 1;
        println!("{line:?}: {peak} and {peak_of_many} bytes");
        assert!(
            peak_of_many < peak + 40 * chunks + 1000,
            "{line:?}: {peak} bytes of {} lines, {peak_of_many} of four times as many",
            some.lines().count()
        );
    }
}

#[test]
fn an_o_word_too_many_is_named() {
    let text = "G0 X1\n".to_owned() + &"o1 if [1]\no1 endif\n".repeat(10_001);
    let config = Config::new(Axes::new(&[('X', false)]).unwrap());
    let mut program = Program::spool("many.ngc", text.as_bytes()).unwrap();
    let report = check(&mut program, &config, &mut |_, _| Ok(())).unwrap();
    let first = &report.diagnostics[0];
    assert_eq!(
        (first.line, first.message.as_str()),
        (20_002, "a file holds at most 20000 O-words")
    );
}
