//! Feed override: a cap on the path speed, not a scale on the corners.

use crate::harness::{Scenario, root};

#[test]
fn half_the_override_is_half_the_feed_and_the_same_corners() {
    let program = root().join("examples/programs/square.ngc");
    let free = Scenario::of(&program).run();
    let done = Scenario::of(&program)
        .commands("0,feed-override,0.5\n")
        .run();
    done.assert_within_limits();
    let top = |feed: Vec<f64>| feed.into_iter().fold(0.0, f64::max);
    let top_mm_per_s = top(done.column("feed_mm_s"));
    assert!(
        (top_mm_per_s / (5000.0 / 120.0) - 1.0).abs() < 1e-6,
        "{top_mm_per_s}"
    );
    let (half_s, full_s) = (done.number("motion_time_s"), free.number("motion_time_s"));
    assert!(
        half_s < 1.9 * full_s,
        "corners are not slowed: {half_s} against {full_s}"
    );
}

#[test]
fn steps_of_the_override_keep_the_limits() {
    for program in ["square.ngc", "serpentine.ngc"] {
        let path = root().join("examples/programs").join(program);
        for shift in (0..200).step_by(23) {
            let steps = [0.3, 1.0, 0.0, 0.8, 0.1, 1.0].iter().enumerate();
            let lines: Vec<String> = steps
                .map(|(i, r)| format!("{},feed-override,{r}", 50 + shift + 150 * i))
                .collect();
            Scenario::of(&path)
                .commands(&lines.join("\n"))
                .run()
                .assert_within_limits();
        }
    }
}

#[test]
fn the_program_can_forbid_the_override() {
    let text = "G21 G90\nM49\nF3000\nG1 X20\nM2\n";
    let free = Scenario::text(text).run();
    let done = Scenario::text(text).commands("0,feed-override,0.5\n").run();
    done.assert_within_limits();
    assert_eq!(done.column("x_cmd_mm"), free.column("x_cmd_mm"));
}

#[test]
fn the_rapid_override_slows_rapids_only() {
    let text = "G21 G90\nF3000\nG1 X20\nG0 X-60\nG1 X-50\nM2\n";
    let done = Scenario::text(text)
        .commands("0,rapid-override,0.25\n")
        .run();
    done.assert_within_limits();
    let (feed, line) = (done.column("feed_mm_s"), done.column("line"));
    let top = |number: f64| {
        feed.iter()
            .zip(&line)
            .filter(|(_, l)| **l == number)
            .map(|(f, _)| *f)
            .fold(0.0, f64::max)
    };
    assert!((top(3.0) - 50.0).abs() < 1e-6);
    assert!(top(4.0) <= 0.25 * 250.0 + 1e-6, "{}", top(4.0));
}

#[test]
fn a_feed_override_above_one_acts_where_the_machine_plans_for_it() {
    let text = "G21 G90\nF3000\nG1 X60\nM2\n";
    let with = ["--set", "motion.max_feed_ratio=1.5"];
    let done = Scenario::text(text)
        .with(&with)
        .commands("300,feed-override,1.5\n")
        .run();
    assert_eq!(done.status(), 0, "{}", done.errors());
    let verdict = done.judge(|options| options.max_ratio = 1.5);
    assert!(verdict.passed(), "{verdict}");
    let feed = done.column("feed_mm_s");
    assert!(
        (feed[299] - 50.0).abs() < 1e-6,
        "before the command {}",
        feed[299]
    );
    assert!(feed[301] > 50.0, "it acts at once: {}", feed[301]);
    let top = feed.into_iter().fold(0.0, f64::max);
    assert!((top - 75.0).abs() < 1e-6, "{top}");
}

#[test]
fn an_override_beyond_the_machine_is_refused_with_its_line() {
    let text = "G21 G90\nG0 X60\nM2\n";
    let done = Scenario::text(text)
        .commands("0,hold\n5,feed-override,1.2\n9,rapid-override,1.5\n")
        .run();
    assert_eq!(done.status(), 1, "{}", done.errors());
    let said = done.errors();
    assert!(
        said.contains(":2: a feed override of 1.2 is above motion.max_feed_ratio, which is 1"),
        "{said}"
    );
    assert!(
        said.contains(
            ":3: a rapid override of 1.5 is above 1: rapids run at the axes' rapid feeds"
        ),
        "{said}"
    );
}

#[test]
fn a_lower_feed_is_met_where_it_begins_also_below_full_override() {
    let text = "G21 G90 G64\nF6000\nG1 X30\nF900\nX60\nF3000\nX75\nF600\nX90 Y5\nM2\n";
    let feeds = [(3.0, 100.0), (5.0, 15.0), (7.0, 50.0), (9.0, 10.0)];
    for ratio in [0.2, 0.5, 0.9] {
        let done = Scenario::text(text)
            .commands(&format!("0,feed-override,{ratio}\n"))
            .run();
        done.assert_within_limits();
        let (feed, line) = (done.column("feed_mm_s"), done.column("line"));
        for (at, most) in feeds {
            // The first sample of a line covers the end of the line before.
            let inside = feed.iter().zip(&line).filter(|(_, l)| **l == at).skip(1);
            let top = inside.fold(0.0f64, |top, (f, _)| top.max(*f));
            // Where the plan reaches its feed inside a period the rate of that period ends lower, as far as the axes can.
            assert!(
                top <= ratio * most * (1.0 + 1e-3),
                "line {at} at {ratio}: {top} above {}",
                ratio * most
            );
            assert!(
                top >= ratio * most * 0.999,
                "line {at} at {ratio}: {top} never reaches {}",
                ratio * most
            );
        }
    }
}
