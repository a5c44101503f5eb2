//! The same samples on both clocks, and on every run.

use crate::harness::{Done, Scenario, root};

/// The command samples as they stand in the trace, byte for byte.
fn commands(done: &Done) -> Vec<[String; 4]> {
    let columns = ["t_s", "x_cmd_mm", "y_cmd_mm", "z_cmd_mm"].map(|name| done.cells(name));
    (0..columns[0].len()).map(|row| columns.each_ref().map(|column| column[row].clone())).collect()
}

fn run(clock: &str) -> Done {
    // On a computer without a real-time kernel periods are missed; that shifts the samples in time, not in value.
    let lenient = ["--set", "loops.max_missed_periods=1000000", "--clock", clock];
    let done = Scenario::of(&root().join("examples/programs/square.ngc")).with(&lenient).run();
    assert_eq!(done.status(), 0, "{}", done.errors());
    assert_eq!((done.number("starvations"), done.number("late_ratios")), (0.0, 0.0));
    done
}

#[test]
fn wall_and_virtual_clock_send_the_same_samples() {
    let (first, wall) = (commands(&run("virtual")), commands(&run("wall")));
    assert_eq!(first.len(), wall.len());
    assert!(first == wall);
}

#[test]
fn one_changed_bit_is_noticed() {
    let first = commands(&run("virtual"));
    let mut second = commands(&run("virtual"));
    assert!(first == second);
    let value: f64 = second[500][1].parse().unwrap();
    second[500][1] = format!("{:.16e}", f64::from_bits(value.to_bits() ^ 1));
    assert!(first != second);
}
