//! Single-block operation: a feed hold at the end of every line, wherever the plan rests.

use std::sync::atomic::Ordering::Relaxed;

use tandem_fine::GuardMode;

use crate::common::Bench;

/// Where the machine is when it holds, mm; the hold is taken back.
fn next_hold(bench: &mut Bench) -> f64 {
    let mut x_mm = 0.0;
    for _ in 0..2000 {
        bench.fine.tick();
        while let Ok(sample) = bench.host.samples.pop() {
            x_mm = sample.command[0];
        }
        if bench.host.controls.hold.swap(false, Relaxed) {
            return x_mm;
        }
    }
    panic!("it never holds");
}

#[test]
fn the_machine_rests_at_the_end_of_a_line_that_the_plan_drives_through() {
    let mut bench = Bench::new(GuardMode::Stop);
    bench.host.controls.single_block.store(true, Relaxed);
    bench.accelerate();
    bench.cruise(0.2);
    let first_mm = bench.next_line();
    bench.cruise(0.3);
    let second_mm = bench.next_line();
    bench.brake();
    for end_mm in [first_mm, second_mm] {
        let held_mm = next_hold(&mut bench);
        assert!((held_mm - end_mm).abs() < 0.01, "{held_mm} of {end_mm} mm");
    }
}

#[test]
fn the_machine_holds_where_the_plan_rests_between_two_lines_and_not_within_one() {
    let mut bench = Bench::new(GuardMode::Stop);
    bench.host.controls.single_block.store(true, Relaxed);
    bench.peak(20.0);
    bench.peak(20.0);
    let end_mm = bench.next_line();
    bench.peak(20.0);
    let held_mm = next_hold(&mut bench);
    assert!((held_mm - end_mm).abs() < 1e-6, "{held_mm} of {end_mm} mm");
}
