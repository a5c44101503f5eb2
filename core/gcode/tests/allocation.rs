//! A steady state allocates nothing: neither lines to items, nor chunks to lines.

#[path = "../../../tests/counting_allocator.rs"]
mod counting_allocator;

use counting_allocator::{HeapUse, heap_use_of};
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
