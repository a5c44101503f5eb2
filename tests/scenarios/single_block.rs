//! Single-block operation: the machine rests at the end of every line, and goes on at the operator's word.

use crate::harness::{Done, Scenario, root};

/// Lines that the plan drives through without a rest, and one that follows a rest.
const TEXT: &str = "G21 G90 G64\nF3000\nG1 X10\nX20\nX30 Y1\nG2 X40 Y11 J10\nG0 X0 Y0\nG1 X5\nM2\n";

/// The line and the place at which each rest begins.
fn rests(done: &Done) -> Vec<(f64, f64, f64)> {
    let (feed, line) = (done.column("feed_mm_s"), done.column("line"));
    let (x, y) = (done.column("x_cmd_mm"), done.column("y_cmd_mm"));
    let begins = |i: &usize| feed[*i] == 0.0 && feed[i - 1] > 0.0;
    (1..feed.len())
        .filter(begins)
        .map(|i| (line[i], x[i], y[i]))
        .collect()
}

fn run(commands: &str) -> Done {
    let done = Scenario::text(TEXT).commands(commands).run();
    done.assert_within_limits();
    done
}

#[test]
fn every_line_ends_at_a_rest() {
    let resumes: Vec<String> = (1..8).map(|n| format!("{},resume", 1500 * n)).collect();
    let done = run(&format!("0,single-block,1\n{}\n", resumes.join("\n")));
    let ends = [
        (10.0, 0.0),
        (20.0, 0.0),
        (30.0, 1.0),
        (40.0, 11.0),
        (0.0, 0.0),
        (5.0, 0.0),
    ];
    let rests = rests(&done);
    assert_eq!(rests.len(), ends.len(), "{rests:?}");
    for ((line, x, y), (end_x, end_y)) in rests.iter().zip(ends) {
        let off = (x - end_x).hypot(y - end_y);
        assert!(off < 0.011, "line {line} rests {off} mm off its end");
    }
}

#[test]
fn switched_on_in_motion_it_stops_at_the_first_line_end_that_can_be_met() {
    for tick in (10..900).step_by(37) {
        let done = run(&format!(
            "{tick},single-block,1\n2500,single-block,0\n2501,resume\n"
        ));
        let (x, y) = (done.column("x_cmd_mm")[2400], done.column("y_cmd_mm")[2400]);
        let ends = [
            (10.0, 0.0),
            (20.0, 0.0),
            (30.0, 1.0),
            (40.0, 11.0),
            (0.0, 0.0),
        ];
        assert!(
            ends.iter().any(|(a, b)| (x - a).hypot(y - b) < 0.011),
            "{tick}: at {x} {y}"
        );
    }
}

#[test]
fn short_lines_are_passed_until_one_can_be_met() {
    let lines: Vec<String> = (1..400)
        .map(|n| format!("G1 X{:.3}", 0.05 * f64::from(n)))
        .collect();
    let text = format!("G21 G90 G64\nF3000\n{}\nM2\n", lines.join("\n"));
    let done = Scenario::text(&text)
        .commands("200,single-block,1\n1000,single-block,0\n1001,resume\n")
        .run();
    done.assert_within_limits();
    let x = done.column("x_cmd_mm")[900];
    let from_end = (x / 0.05 - (x / 0.05).round()).abs() * 0.05;
    assert!(from_end < 0.011 && x < 19.0, "{x}");
}

/// Lines, arcs and curves that run into each other without a corner, and where each ends.
const TANGENT: &str = "F6000\nG1 X20\nG2 X30 Y-10 R10\nG1 Y-30\nG3 X40 Y-40 R10\nG1 X60\nG5 I5 J0 P0 Q-5 X80 Y-30\nG1 Y-10\n\
    G5.2 P1 L4\nY0\nX90 Y10\nX100 Y10\nG5.3\nG1 X120\nM2\n";
const TANGENT_ENDS: [(f64, f64); 8] = [
    (20.0, 0.0),
    (30.0, -10.0),
    (30.0, -30.0),
    (40.0, -40.0),
    (60.0, -40.0),
    (80.0, -30.0),
    (80.0, -10.0),
    (100.0, 10.0),
];

#[test]
fn with_a_jerk_limit_it_rests_at_every_line_too() {
    let resumes: Vec<String> = (1..12).map(|n| format!("{},resume", 500 * n)).collect();
    let commands = format!("0,single-block,1\n{}\n", resumes.join("\n"));
    for form in ["scan", "windowed"] {
        let machine = root().join("examples/machines/nurbs-demo.toml");
        let form = format!("planner.options.form={form}");
        let done = Scenario::text(TANGENT)
            .on(&machine)
            .with(&["--set", &form])
            .commands(&commands)
            .run();
        done.assert_within_limits();
        let (x, y) = (done.column("x_cmd_mm"), done.column("y_cmd_mm"));
        for (n, (end_x, end_y)) in TANGENT_ENDS.iter().enumerate() {
            // Just before it goes on.
            let off = (x[500 * (n + 1) - 5] - end_x).hypot(y[500 * (n + 1) - 5] - end_y);
            assert!(
                off < 0.002,
                "{form}: rest {n} is {off} mm off the end of its line"
            );
        }
    }
}
