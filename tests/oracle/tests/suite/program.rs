//! The program reader: every word it knows moves the path as it should, every other one is refused by name.

use crate::common;

use common::{assert_passes, at, smooth_machine, stop_at_all, trace, verdict};
use tandem_oracle::{Check, Kind, Options, Outcome, Position, judge};

#[track_caller]
fn visits(program: &str, points: &[Position]) {
    let verdict = verdict(&stop_at_all(points, 50.0, 990.0), program);
    assert_passes(&verdict);
    let moved: Vec<Position> = points
        .iter()
        .map(|point| at(point[0] + 0.1, point[1], point[2]))
        .collect();
    assert!(
        !judge(
            &trace(&stop_at_all(&moved, 50.0, 990.0)),
            program,
            &smooth_machine(),
            &Options::default()
        )
        .passed()
    );
}

#[track_caller]
fn is_not_judged(program: &str, reason: &str) {
    let verdict = verdict(&[at(0.0, 0.0, 0.0); 3], program);
    match &verdict.outcome {
        Outcome::NotJudged { reason: given } => assert_eq!(given, reason),
        other => panic!("{program}: {other:?}"),
    }
}

#[test]
fn numbers_comments_and_blanks() {
    visits(
        "%\n(a (nested) comment) N10 g1x+1.50y-.5 f3000 ; the rest X9\n/N20 G 1 X 1 0\n\n%\nX99\n",
        &[at(0.0, 0.0, 0.0), at(1.5, -0.5, 0.0), at(10.0, -0.5, 0.0)],
    );
    visits(
        "G1X0.20000Y0.00000Z0.08570F3000\nM30\nX5\n",
        &[at(0.0, 0.0, 0.0), at(0.2, 0.0, 0.0857)],
    );
}

/// A `%` that none had opened was passed over, and the lines behind it were read.
#[test]
fn a_percent_sign_ends_a_program_and_text_behind_one_that_none_opened_is_not_judged() {
    let line = [at(0.0, 0.0, 0.0), at(5.0, 0.0, 0.0)];
    visits("G1 X5 F3000\n%\n\n(end)\n%\n", &line);
    visits("\n(head)\n%(open)\nG1 X5 F3000\n%\nX99\n", &line);
    let reason = "program line 3: text behind the % that ends a program that none had opened";
    is_not_judged("G1 X5 F3000\n%\nX7\n", reason);
}

#[test]
fn words_that_move_nothing() {
    visits(
        "G40 G49 G80 G17 M3 S1000 T2 M6\nG4 P0.5\nM8\nG1 X5 F3000 TA30\nM62 P1\nS2000\nX7 M0\n",
        &[at(0.0, 0.0, 0.0), at(5.0, 0.0, 0.0), at(7.0, 0.0, 0.0)],
    );
}

#[test]
fn block_delete_is_off_unless_asked_for() {
    let samples = trace(&stop_at_all(
        &[at(0.0, 0.0, 0.0), at(5.0, 0.0, 0.0)],
        50.0,
        990.0,
    ));
    let program = "/G0 X5 Y5\nG1 X5 Y0 F3000\n";
    assert!(!judge(&samples, program, &smooth_machine(), &Options::default()).passed());
    let deleted = Options {
        block_delete: true,
        ..Options::default()
    };
    assert_passes(&judge(&samples, program, &smooth_machine(), &deleted));
}

#[test]
fn inches_and_increments() {
    visits(
        "G20 G91 G1 X1 F119\nG21 X1\nG90 X30\n",
        &[
            at(0.0, 0.0, 0.0),
            at(25.4, 0.0, 0.0),
            at(26.4, 0.0, 0.0),
            at(30.0, 0.0, 0.0),
        ],
    );
}

#[test]
fn offsets_add_up() {
    visits(
        "G10 L2 P2 X10 Y5\nG1 F3000 G55 X1 Y0\nG92 X0\nX2\nG53 G1 X20 Y1\nG92.1\nX2 Y2\nG54 X3 Y3\nG59.3 X4\n",
        &[
            at(0.0, 0.0, 0.0),
            at(11.0, 5.0, 0.0),
            at(13.0, 5.0, 0.0),
            at(20.0, 1.0, 0.0),
            at(12.0, 7.0, 0.0),
            at(3.0, 3.0, 0.0),
            at(4.0, 3.0, 0.0),
        ],
    );
}

#[test]
fn inverse_time_gives_the_feed() {
    let samples = trace(&stop_at_all(
        &[at(0.0, 0.0, 0.0), at(30.0, 40.0, 0.0)],
        50.0,
        800.0,
    ));
    let judged = |program: &str| judge(&samples, program, &smooth_machine(), &Options::default());
    // 50 mm in a sixtieth of a minute is 50 mm/s.
    assert_passes(&judged("G93 G1 X30 Y40 F60"));
    assert_eq!(judged("G93 G1 X30 Y40 F59").kinds(), [Kind::Feed]);
    assert!(judged("G93 G1 X30 Y40 F60\nX31").not_judged.is_some());
}

#[test]
fn a_feed_in_inches_and_the_faster_of_two_blocks() {
    let points = [at(0.0, 0.0, 0.0), at(20.0, 0.0, 0.0), at(40.0, 0.0, 0.0)];
    let through = trace(&stop_at_all(&[points[0], points[2]], 50.0, 990.0));
    let judged = |program: &str| judge(&through, program, &smooth_machine(), &Options::default());
    assert_passes(&judged("G20 F119\nG1 G21 X20\nX40"));
    let slower = judged("F3000 G1 X20\nF1500 X40");
    assert_eq!(slower.kinds(), [Kind::Feed]);
    assert!(
        slower
            .findings
            .iter()
            .all(|finding| (finding.limit - 25.0).abs() < 1e-9),
        "{slower}"
    );
    let lent = Options {
        feed_window_s: Some(10.0),
        ..Options::default()
    };
    assert_passes(&judge(
        &through,
        "F3000 G1 X20\nF1500 X40",
        &smooth_machine(),
        &lent,
    ));
    // Beside a rapid no feed is known, within the feed it is.
    assert_eq!(judged("G0 X20\nG1 F2940 X40").kinds(), [Kind::Feed]);
    assert_passes(&judged("G0 X20\nG1 F3000 X40"));
}

#[test]
fn a_tolerance_in_force_is_kept() {
    let mut samples = stop_at_all(&[at(0.0, 0.0, 0.0), at(20.0, 0.0, 0.0)], 50.0, 990.0);
    let middle = samples.len() / 2;
    samples[middle][1] = 0.003;
    let judged = |program: &str| {
        let verdict = judge(
            &trace(&samples),
            program,
            &smooth_machine(),
            &Options::only(&[Check::Path]),
        );
        assert!(
            (verdict.maxima.sample_deviation_mm - 0.003).abs() < 1e-6,
            "{verdict}"
        );
        verdict.kinds()
    };
    assert_eq!(judged("G1 X20 F3000"), []);
    assert_eq!(judged("G64 P0.004\nG1 X20 F3000"), []);
    assert_eq!(judged("G64 P0.002\nG1 X20 F3000"), [Kind::PathDeviation]);
    assert_eq!(judged("G64 P0.002\nG64 P0\nG1 X20 F3000"), []);
    assert_eq!(
        judged("G20 G64 P0.0001\nG21 G1 X20 F3000"),
        [Kind::PathDeviation]
    );
}

#[test]
fn what_is_not_known_is_not_judged() {
    is_not_judged("G21\nG33 X1 Y1\n", "program line 2: unknown word G33");
    is_not_judged("#1=5\n", "program line 1: unknown word #1=5");
    is_not_judged("G1 X[1+2] F100", "program line 1: unknown word X[1+2]F100");
    is_not_judged("O100 SUB", "program line 1: unknown word SUB");
    is_not_judged("M98 P1", "program line 1: unknown word M98");
    is_not_judged("G1 X1 F100 Q3", "program line 1: unknown word Q3");
    is_not_judged("G1 X1 X2 F100", "program line 1: word X twice");
    is_not_judged("G1 X1", "program line 1: motion without a feed");
    is_not_judged("X1", "program line 1: axis words without a motion word");
    is_not_judged("G0 B1", "program line 1: the machine has no axis B");
    is_not_judged("G0 X1 (open", "program line 1: comment without an end");
    is_not_judged("G0 X1 (a (b) X5", "program line 1: comment without an end");
    is_not_judged("G0 G1 X1", "program line 1: two motion words");
    is_not_judged(
        "G2 X1 F100",
        "program line 1: arc without a centre or radius",
    );
    is_not_judged(
        "G2 X10 R4 F100",
        "program line 1: arc radius 4 mm does not reach its end",
    );
    is_not_judged(
        "G3 X0.01 Y0.003 I0 J10 F100",
        "program line 1: the arc is nearly closed, and its end is off its circle",
    );
    is_not_judged("G43 H1", "program line 1: unknown word G43");
    is_not_judged("G92.2", "program line 1: unknown word G92.2");
}

#[test]
fn a_broken_limit_is_a_failure_even_where_the_program_is_not_known() {
    let verdict = verdict(&[at(0.0, 0.0, 0.0), at(1.0, 0.0, 0.0)], "G33 X1\n");
    assert_eq!(verdict.outcome, Outcome::Fail);
    assert!(verdict.not_judged.is_some());
}

#[test]
fn a_program_that_moves_nothing_wants_samples_that_stand() {
    assert_passes(&verdict(&[at(0.0, 0.0, 0.0); 3], "G4 P1\nM2\n"));
    let moved = stop_at_all(&[at(0.0, 0.0, 0.0), at(1.0, 0.0, 0.0)], 50.0, 990.0);
    assert_eq!(
        verdict(&moved, "G4 P1\nM2\n").kinds(),
        [Kind::PathDeviation, Kind::EndPoint]
    );
}

#[test]
fn a_probe_ends_where_the_trace_says_if_that_lies_on_its_line() {
    // The lines of the trace: 1 to the touch, 2 and 3 behind it.
    let drive = |points: &[Position]| {
        let mut samples = trace(&stop_at_all(points, 50.0, 990.0));
        let touch = points[1];
        let seen = samples
            .rows
            .iter()
            .position(|row| row.command == touch)
            .unwrap();
        for (index, row) in samples.rows.iter_mut().enumerate() {
            row.line = if index <= seen { 1 } else { 2 };
        }
        samples
    };
    let program = "G38.2 X10 F3000\nG91 G1 Y2\nG10 L20 P1 X1\nG90 G31 X3.5\n";
    let fair = [
        at(0.0, 0.0, 0.0),
        at(4.0, 0.0, 0.0),
        at(4.0, 2.0, 0.0),
        at(6.5, 2.0, 0.0),
    ];
    assert_passes(&judge(
        &drive(&fair),
        program,
        &smooth_machine(),
        &Options::default(),
    ));
    for (point, axis, value) in [(1, 1, 0.5), (2, 0, 4.5), (3, 0, 7.0)] {
        let mut wrong = fair;
        wrong[point][axis] = value;
        let verdict = judge(
            &drive(&wrong),
            program,
            &smooth_machine(),
            &Options::default(),
        );
        assert_eq!(verdict.outcome, Outcome::Fail, "point {point}");
    }
    is_not_judged(
        "G38.2 X1 F100\nG1 X#5061\n",
        "program line 2: unknown word X#5061",
    );
}

#[test]
fn the_mark_of_utf_8_is_no_word() {
    visits(
        "\u{feff}G1 X5 F3000\n",
        &[at(0.0, 0.0, 0.0), at(5.0, 0.0, 0.0)],
    );
}
