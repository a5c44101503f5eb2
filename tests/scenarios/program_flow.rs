//! Stops, dwells, outputs and inputs: what a program does beside moving.

use std::fmt::Write;

use crate::harness::Scenario;

/// A plate of pockets: loops, calls of both kinds, modal words that change nothing, and a cycle.
const PLATE: &str = "G21 G90 G17 G64\nF2400\no<corner> sub\nG1 X[#1] Y[#2] F2400 M9\nG64\nG90 G1 X[#1 + 4] T0\n\
    G3 X[#1 + 8] Y[#2 + 4] J4\no<corner> endsub\n#5=0\no1 while [#5 LT 6]\no<corner> call [#5 * 8] [#5 * 4]\n\
    #5=[#5 + 1]\no1 endwhile\nM98 P20 L5\nG99 G81 X60 Y30 Z-3 R1\nX70\nG80\nM30\nO20\nG91 G1 X3 Y0.5\nX3 Y-0.5\nG90\nM99\n";

/// The feed does not dip at a call, a return, a turn of a loop or a word: the run takes as long as its moves written out.
#[test]
fn calls_loops_and_modal_words_take_no_time() {
    let mut plain = String::from("G21 G90 G17 G64\nF2400\n");
    for n in 0..6 {
        let (x, y) = (n * 8, n * 4);
        writeln!(
            plain,
            "G1 X{x} Y{y}\nX{}\nG3 X{} Y{} J4",
            x + 4,
            x + 8,
            y + 4
        )
        .unwrap();
    }
    for n in 0..5 {
        writeln!(plain, "G1 X{} Y24.5\nX{} Y24", 51 + 6 * n, 54 + 6 * n).unwrap();
    }
    plain += "G61\nG0 Z1\nG0 X60 Y30\nG1 Z-3\nG0 Z1\nG0 X70\nG1 Z-3\nG0 Z1\nM30\n";
    for planner in ["look-ahead", "smooth"] {
        let planner = format!("planner.plugin={planner}");
        let [called, written] =
            [PLATE, &plain].map(|text| Scenario::text(text).with(&["--set", &planner]).run());
        for done in [&called, &written] {
            assert_eq!(done.status(), 0, "{}", done.errors());
        }
        // The oracle reads plain lines only; what it says of them counts for the same samples.
        if planner.ends_with("look-ahead") {
            written.assert_within_limits();
        }
        let [called, written] =
            [called, written].map(|done| (done.number("samples"), done.column("x_cmd_mm")));
        assert_eq!(called.0, written.0, "{planner}");
        assert!(
            called.1 == written.1,
            "{planner}: the samples are not the same"
        );
    }
}

const STOPS: &str = "G21 G90\nT1\nF3000\nG1 X10\nM0\nG1 X20\nM6\nG1 X30\nM1\nG1 X40\nM2\n";

#[test]
fn stops_without_an_operator_are_logged_and_the_run_goes_on() {
    let done = Scenario::text(STOPS).run();
    done.assert_within_limits();
    for words in ["line 5: M0", "line 7: M6", "line 9: M1"] {
        assert!(done.errors().contains(words), "{}", done.errors());
    }
}

#[test]
fn with_pause_they_wait_for_enter() {
    let free = Scenario::text(STOPS).run();
    let done = Scenario::text(STOPS)
        .with(&["--pause"])
        .typing("\n\n\n")
        .run();
    done.assert_within_limits();
    assert_eq!(
        done.errors().matches("Enter goes on").count(),
        3,
        "{}",
        done.errors()
    );
    assert!(done.cells("state").iter().any(|s| s == "holding"));
    assert!(done.number("samples") > free.number("samples"));
}

#[test]
fn where_nobody_can_press_enter_the_program_ends_at_its_stop() {
    let done = Scenario::text(STOPS).with(&["--pause"]).typing("\n").run();
    assert_eq!(done.status(), 3);
    assert!(
        done.errors()
            .contains("line 7: the program waits for an operator"),
        "{}",
        done.errors()
    );
    assert_eq!(done.column("x_cmd_mm").pop(), Some(20.0));
}

#[test]
fn a_hold_that_nobody_ends_is_given_up_on_the_path() {
    let done = Scenario::text("G21 G90\nF3000\nG1 X50\nM2\n")
        .commands("200,hold\n")
        .run();
    assert_eq!(done.status(), 3);
    assert!(
        done.errors().contains("no command is left"),
        "{}",
        done.errors()
    );
    let verdict = done.judge(|options| options.ends_early = true);
    assert!(verdict.passed(), "{verdict}");
}

#[test]
fn a_dwell_lasts_as_long_as_it_says() {
    let run = |dwell: &str| {
        Scenario::text(&format!(
            "G21 G90\nF3000\nG1 X10\nG4 P{dwell}\nG1 X20\nM2\n"
        ))
        .run()
    };
    let (short, long) = (run("0.1"), run("0.6"));
    short.assert_within_limits();
    long.assert_within_limits();
    assert_eq!(long.number("samples") - short.number("samples"), 500.0);
}

#[test]
fn an_input_is_waited_for_and_changes_the_path() {
    // Input 0 of the simulated drives is 1 while X stands above 12.5 mm.
    let switch = "driver.options={switches=[{input=0,joint=0,above_mm=12.5}]}";
    let text = "G21 G90\nF3000\nG1 X10\nM66 P0 L0\n#1=#5399\nG1 X20\nM66 P0 L3 Q1\nG1 X[30+#5399+#1]\nM2\n";
    let done = Scenario::text(text).with(&["--set", switch]).run();
    assert_eq!(done.status(), 0, "{}", done.errors());
    assert_eq!(done.column("x_cmd_mm").pop(), Some(31.0));
    let waited = Scenario::text("G21 G90\nF3000\nG1 X10\nM66 P0 L3 Q1\nG1 X[20+#5399]\nM2\n")
        .with(&["--set", switch])
        .run();
    assert_eq!(
        waited.column("x_cmd_mm").pop(),
        Some(19.0),
        "{}",
        waited.errors()
    );
    assert!(
        waited.number("samples") > 1200.0,
        "it waited for its second"
    );
}

#[test]
fn exact_stops_are_sampled_at_the_programmed_position() {
    let done =
        Scenario::text("G21 G90\nG61\nF3000\nG1 X10.123456 Y3\nG1 X20 Y-7.7\nG64\nG1 X0 Y0\nM2\n")
            .run();
    done.assert_within_limits();
    let (x, y) = (done.column("x_cmd_mm"), done.column("y_cmd_mm"));
    for (px, py) in [(10.123_456, 3.0), (20.0, -7.7), (0.0, 0.0)] {
        assert!(
            x.iter().zip(&y).any(|(x, y)| *x == px && *y == py),
            "({px}, {py}) is in no sample"
        );
    }
}

#[test]
fn m1_waits_while_the_optional_stop_is_on() {
    let waits = |arguments: &[&str], commands: &str| {
        let done = Scenario::text(STOPS)
            .with(arguments)
            .commands(commands)
            .typing("\n\n\n")
            .run();
        done.assert_within_limits();
        let errors = done.errors();
        (3..=9)
            .filter(|line| errors.contains(&format!("line {line}: the program waits")))
            .collect::<Vec<i32>>()
    };
    assert!(waits(&[], "").is_empty());
    assert_eq!(waits(&["--optional-stop"], ""), [9]);
    assert_eq!(waits(&[], "100,optional-stop,1"), [9]);
    assert_eq!(waits(&["--pause"], ""), [5, 7, 9]);
    assert_eq!(waits(&["--pause"], "100,optional-stop,0"), [5, 7]);
}

const CUT: &str =
    "G21 G90\nS1000 M3\nM8\nF600\nG1 X20\nM64 P3\nG0 X0\nM0\nG93\nG1 X20 F30\nG94 F600\nM1\nM2\n";

#[test]
fn a_dry_run_drives_the_path_at_its_own_feed_and_switches_nothing() {
    let feed = "operator.dry_run_feed_mm_per_min=3000";
    let done = Scenario::text(CUT)
        .with(&["--dry-run", "--set", feed])
        .run();
    assert_eq!(done.status(), 0, "{}", done.errors());
    for words in [
        "line 8: M0, program stop: a dry run",
        "line 12: M1, optional stop: a dry run",
    ] {
        assert!(done.errors().contains(words), "{}", done.errors());
    }
    assert_eq!(done.summary()["dry_run"], true);
    assert!(String::from_utf8_lossy(&done.output.stdout).starts_with("dry run of "));
    let (feed, line) = (done.column("feed_mm_s"), done.column("line"));
    let top = |number: f64| {
        feed.iter()
            .zip(&line)
            .filter(|(_, l)| **l == number)
            .map(|(f, _)| *f)
            .fold(0.0, f64::max)
    };
    assert!(
        (top(5.0) - 50.0).abs() < 1e-6 && (top(10.0) - 50.0).abs() < 1e-6,
        "{} {}",
        top(5.0),
        top(10.0)
    );
    assert!(top(7.0) > 100.0, "rapids stay rapids");
    let programmed = Scenario::text(CUT).with(&["--dry-run"]).run();
    programmed.assert_within_limits();
    assert!(
        programmed
            .column("feed_mm_s")
            .iter()
            .zip(programmed.column("line"))
            .all(|(f, l)| l != 5.0 || *f < 10.001)
    );
}

#[test]
fn m64_comes_to_rest_and_m62_does_not() {
    for (word, rests) in [("M62", false), ("M64", true)] {
        let text = format!("G21 G90 G64\nF3000\nG1 X10\n{word} P3\nX20\n{word} P3\nX30\nM2\n");
        let done = Scenario::text(&text).run();
        done.assert_within_limits();
        let (feed, x) = (done.column("feed_mm_s"), done.column("x_cmd_mm"));
        let slowest = |at: f64| {
            let near = feed
                .iter()
                .zip(&x)
                .filter(|(_, x)| (**x - at).abs() < 2.0)
                .map(|(feed, _)| *feed);
            near.fold(f64::INFINITY, f64::min)
        };
        assert_eq!(slowest(10.0) < 1.0, rests, "{word}: {}", slowest(10.0));
        assert_eq!(x.contains(&10.0), rests, "{word}");
        assert!(slowest(20.0) > 49.0, "{word}: it is on already");
    }
}
