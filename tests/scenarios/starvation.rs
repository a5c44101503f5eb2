//! The rough loop is late: the machine stops on the path inside what is queued, and goes on without a jump.

use crate::harness::{Scenario, root};

#[test]
fn a_stalled_rough_loop_stops_the_machine_on_the_path() {
    for (program, step) in [("square.ngc", 57), ("serpentine.ngc", 211), ("spiral.ngc", 3001)] {
        let path = root().join("examples/programs").join(program);
        let free = Scenario::of(&path).run();
        let ticks = free.number("samples") as usize;
        let mut starved = 0.0;
        for tick in (20..ticks).step_by(step) {
            let done = Scenario::of(&path).commands(&format!("{tick},stall-rough,100\n")).run();
            done.assert_within_limits();
            assert_eq!(done.number("blocks"), free.number("blocks"));
            starved += done.number("starvations");
        }
        assert!(starved > 0.0, "{program}: no stall was long enough to matter");
    }
}

#[test]
fn a_short_stall_is_not_noticed() {
    let path = root().join("examples/programs/serpentine.ngc");
    let free = Scenario::of(&path).run();
    let done = Scenario::of(&path).commands("500,stall-rough,2\n").run();
    assert_eq!(done.number("starvations"), 0.0);
    assert_eq!(done.column("x_cmd_mm"), free.column("x_cmd_mm"));
}

#[test]
fn blocks_of_a_thousandth_do_not_starve() {
    let lines: Vec<String> = (1..4000).map(|i| format!("G1 X{:.4}", f64::from(i) * 0.001)).collect();
    let done = Scenario::text(&format!("G21 G90 G64\nF15000\n{}\nM2\n", lines.join("\n"))).run();
    done.assert_within_limits();
    assert_eq!(done.number("starvations"), 0.0);
}
