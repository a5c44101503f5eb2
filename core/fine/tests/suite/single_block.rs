//! Single-block operation: a feed hold at the end of every line, wherever the plan rests.

use std::sync::atomic::Ordering::Relaxed;

use tandem_fine::GuardMode;

use crate::common::Bench;
use crate::smooth::{LIMITS, Machine, Plan, profile};

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

#[test]
fn with_a_jerk_limit_the_machine_keeps_its_feed_until_the_stop_for_the_end_of_its_line_must_begin()
{
    let (feed, line_mm) = (80.0, 120.0);
    let pieces = profile(line_mm, feed, 0.9 * LIMITS.acceleration, 0.9 * LIMITS.jerk);
    let middle_s = pieces.iter().map(|(_, duration)| duration).sum::<f64>() / 2.0;
    // A segment begins every 4 ms.
    let from_s = 4e-3 * (middle_s / 4e-3).round();
    let place_mm = line_mm / 2.0 + feed * (from_s - middle_s);
    let plan = Plan::new(pieces, feed, |s| [s, 0.0]).with_next_line(from_s, 1.0);
    let mut machine = Machine::new(&plan);
    machine.host.controls.single_block.store(true, Relaxed);
    let mut periods = 0;
    while !machine.host.controls.hold.load(Relaxed) {
        machine.run(1);
        periods += 1;
        assert!(periods < 5000, "it never holds");
    }
    let (places, speeds) = (machine.x_mm(), machine.speeds());
    let held_mm = places[places.len() - 1];
    assert!(
        (held_mm - place_mm).abs() < 0.01,
        "{held_mm} of {place_mm} mm"
    );
    // What segments leave to brake with is half of the acceleration, and a tenth of the jerk is left out.
    let (braking, jerk) = (500.0, 0.9 * LIMITS.jerk);
    let way_mm = feed * (feed / braking + braking / jerk) / 2.0;
    let at_feed = speeds.iter().rposition(|speed| *speed > 0.999 * feed);
    let left_mm = place_mm - places[at_feed.expect("its feed is reached")];
    assert!(
        (way_mm..1.1 * way_mm).contains(&left_mm),
        "it begins to stop {left_mm} mm before the end, of {way_mm} mm that it takes"
    );
}
