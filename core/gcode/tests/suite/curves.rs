//! NURBS and Bezier curves of part programs.

use crate::common;

use common::{messages, mill, only_blocks, run, run_on, shown};
use std::sync::Arc;
use tandem_gcode::Item;

use tandem_sdk::{Block, NurbsData};

fn curves(program: &str) -> Vec<(Block, Arc<NurbsData>)> {
    let all = run(program).into_iter();
    all.filter_map(|item| {
        if let Item::Block(block, curve) = item {
            curve.map(|curve| (block, curve))
        } else {
            None
        }
    })
    .collect()
}

fn assert_messages(program: &str, expected: &[&str]) {
    assert_eq!(messages(program), expected, "{program}");
}

#[test]
fn linuxcnc_curve() {
    let items = shown(&run(
        "F60\nG0 X1\nG5.2 P2 L3\nX0 Y1 P1\n(in between)\nX2 Y2\nN7 X2 Y0 P3\nG5.3\nG1 X3",
    ));
    assert_eq!(
        items[1],
        "3: Nurbs 1 to 2 0 0 0 length 3.867 feed 1 degree 2 points 1 0 0, 0 1 0, 2 2 0, 2 0 0 weights 2 1 1 3 \
         knots 0 0 0 1 2 2 2"
    );
    assert_eq!(items[2], "9: Line 2 to 3 0 0 0 length 1 feed 1");
}

#[test]
fn linuxcnc_curve_with_a_point_in_its_first_line() {
    let made = curves("F60\nG91 G5.2 X1 Y1 P3 L4\nX1\nX1 Y-1\nG5.3");
    let data = &made[0].1;
    assert_eq!(
        (data.degree, data.weights.as_slice()),
        (3, &[1.0, 3.0, 1.0, 1.0][..])
    );
    assert_eq!(data.control_points[3].0[..2], [3.0, 0.0]);
    // Nothing is left of the curve's mode.
    assert!(messages("F60\nG5.2 X1 Y1\nX2\nG5.3\nX5")[0].contains("no motion mode"));
}

#[test]
fn fanuc_curve() {
    let items = shown(&run(
        "F60\nG06.2 P3 K0 X0 Y0 R1\nK0 X0 Y5\nK0. X5 Y5 R2\nK1 X9 Y5\nK3\nN9 K3\nK3\nG01 X10",
    ));
    assert_eq!(
        items[0],
        "2: Nurbs 0 to 9 5 0 0 length 12.65 feed 1 degree 2 points 0 0 0, 0 5 0, 5 5 0, 9 5 0 weights 1 1 2 1 \
         knots 0 0 0 1 3 3 3"
    );
    assert!(items[1].starts_with("9: Line 1 to 10 5"), "{}", items[1]);
    // Without a point in its first line the curve begins where the machine stands; without P it is cubic.
    assert_eq!(
        curves("F60\nG1 X1\nG6.2 K0\nK0 X2\nK0 X2 Y1\nK0 Y2\nK1\nK1\nK1\nK1")[0]
            .1
            .degree,
        3
    );
}

#[test]
fn a_wrong_word_is_one_message_whatever_the_curve_holds() {
    let fanuc = |first: &str, third: &str| {
        format!("F60\n{first}\nK0 X0 Y5\n{third}\nK1 X9 Y5\nK3\nK3\nK3\nG01 X9 Y9")
    };
    let linuxcnc = |first: &str, third: &str| {
        format!("F60\n{first}\nX0 Y5\n{third}\nX9 Y5\nX9 Y6\nG5.3\nG01 X9 Y9")
    };
    assert!(messages(&fanuc("G6.2 P3 Q2 K0", "K0 X5")).is_empty());
    for (program, place) in [
        (fanuc("G6.2 P3 K0 H2", "K0 X5"), "2:12 [unused-word]"),
        (fanuc("G6.2 P3 K0 Q4", "K0 X5"), "2:12 [word-range]"),
        (fanuc("G6.2 P3 K0 X1e5", "K0 X5"), "2:14 "),
        (fanuc("G6.2 P3 K0", "K0 X5 H1"), "4:7 [unused-word]"),
        (linuxcnc("G5.2 H2", "X5"), "2:6 [unused-word]"),
        (linuxcnc("G5.2 P-1", "X5"), "2:6 [nurbs]"),
        (linuxcnc("G5.2 G17 P2 L3 K1", "X5"), "2:16 [unused-word]"),
        (linuxcnc("G5.2", "X5 P"), "4:4 "),
    ] {
        let found = messages(&program);
        assert!(
            found.len() == 1 && found[0].starts_with(place),
            "{program}: {found:?}"
        );
    }
}

#[test]
fn bezier_curves() {
    let made = curves("F60\nG5 X3 Y0 I1 J1 P-1 Q1\nX6 P-1 Q-1\nG5.1 X8 I1");
    let points = |n: usize| {
        made[n]
            .1
            .control_points
            .iter()
            .map(|p| [p[0], p[1]])
            .collect::<Vec<_>>()
    };
    assert_eq!(points(0), [[0.0, 0.0], [1.0, 1.0], [2.0, 1.0], [3.0, 0.0]]);
    assert_eq!(
        points(1),
        [[3.0, 0.0], [4.0, -1.0], [5.0, -1.0], [6.0, 0.0]]
    );
    assert_eq!(points(2), [[6.0, 0.0], [7.0, 0.0], [8.0, 0.0]]);
    let inches = curves("G20 F60\nG5.1 X2 I1");
    assert!((inches[0].0.length_mm - 50.8).abs() < 1e-9 && inches[0].0.feed_mm_per_s == 25.4);
}

#[test]
fn inverse_time() {
    let made = curves("G93\nG5.2 F30 L2\nX3\nG5.3\nG5.1 X3 Y8 J4 F60");
    assert!((made[0].0.feed_mm_per_s - 1.5).abs() < 1e-9);
    assert!((made[1].0.feed_mm_per_s - 8.0).abs() < 1e-9);
}

#[test]
fn blocks_go_on_behind_a_curve() {
    let (items, errors) = run_on(mill(), "F60\nG1 X1\nG5.2 L2\nX2\nG5.3\nG1 X5\nX7");
    assert!(errors.is_empty());
    assert_eq!(
        only_blocks(&items)
            .iter()
            .map(|b| b.index)
            .collect::<Vec<_>>(),
        [0, 1, 2, 3]
    );
}

#[test]
fn faulty_knots_and_weights_are_named() {
    assert_messages(
        "F60\nG6.2 P3 K0 X0\nK0 X1\nK0 X2\nK2 X3\nK1 X4\nK3\nK3\nK3\nG1 X9",
        &["6:1 [nurbs] knot 1 is below the one before it, 2: knots never fall"],
    );
    assert_messages(
        "F60\nG6.2 P3 K0\nK1 X1\nK1 X2\nK2\nK2\nK2\nG1 X9",
        &["3:1 [nurbs] the first 3 knots are equal: the curve begins at its first control point"],
    );
    assert_messages(
        "F60\nG6.2 P3 K0\nK0 X1\nK0 X2\nK2\nK3\nK3\nG1 X9",
        &["6:1 [nurbs] the last 3 knots are equal: the curve ends at its last control point"],
    );
    assert_messages(
        "F60\nG6.2 P3 K0\nK0 X1 R0\nK0 X2\nK2\nK2\nK2",
        &["3:7 [nurbs] the weight R must be greater than zero"],
    );
    assert_messages(
        "F60\nG5.2 P-1\nX2\nG5.3",
        &["2:6 [nurbs] the weight P must be greater than zero"],
    );
    assert_messages(
        "F60\nG6.2 P7 K0",
        &["2:6 [word-range] P must be a whole number from 2 to 6"],
    );
    assert_messages(
        "F60\nG6.2 P2 X1 K0\nX2 K0\nK1\nK1",
        &[
            "2:9 [nurbs] the first control point is not where the machine stands (1 off): the curve begins there",
        ],
    );
}

#[test]
fn what_is_missing_is_named() {
    assert_messages(
        "F60\nG6.2 P3 K0\nK0 X1\nK0 X2\nK2\nK2\nG1 X9",
        &[
            "7:1 [nurbs] the curve that line 2 opens is not complete: of the 3 knots (K) that stand alone behind the last \
           control point 1 are missing",
        ],
    );
    assert_messages(
        "F60\nG6.2 P3 K0\nX1\nK0 X2\nK2\nK2\nK2",
        &["3:1 [nurbs] K, the knot of this line, is missing"],
    );
    assert_messages(
        "F60\nG5.2 L4\nX1\nX2\nG5.3\nG1 X9",
        &[
            "5:1 [nurbs] the curve that line 2 opens has 3 control points (the position before it is one), order 4 needs 4",
        ],
    );
    assert_messages(
        "F60\nG5.2\nX1\nX2\nG1 X9",
        &[
            "5:1 [nurbs] the curve that line 2 opens is not complete: G5.3, which ends it, is missing before this line",
        ],
    );
    for stray in [
        "F60\nG1 X1\nG5.3\nG1 X2",
        "F60\nG5.2 L2\nX2\nG5.3 (over)\n\nG5.3",
    ] {
        let line = stray.lines().count() - usize::from(stray.starts_with("F60\nG1"));
        assert_messages(
            stray,
            &[&format!(
                "{line}:1 [nurbs] G5.3 ends a curve, and none is open: G5.2 opens one"
            )],
        );
    }
    assert_messages(
        "F60\nG5.2\nX1",
        &["3:1 [nurbs] the program ends within the curve that line 2 opens"],
    );
    assert_messages(
        "F60\nG5.2\nX1 S300\nX2\nG5.3",
        &["3:4 [unused-word] S has no place in this line of a curve"],
    );
    assert_messages(
        "F60\nG5.2\nX1 $0\nX2\nG5.3",
        &["3:4 [unused-word] $ has no place in this line of a curve"],
    );
    assert_messages(
        "F60\nG5.2\nX1 B3\nX2\nG5.3",
        &["3:4 [axis] this machine has no axis B; it has X Y Z A"],
    );
    assert_messages(
        "F60\nG6.2 P3 K0\nK0 X1 R1e-3\nK0 X2\nK1\nK1\nK1",
        &["3:9 [unused-word] E has no place in this line of a curve; numbers have no exponent"],
    );
    assert_messages(
        "G5.2\nX1\nX2\nG5.3",
        &["1:1 [feed-missing] the feed is missing: no F has been set; G5.2 needs one"],
    );
    assert_messages(
        "G93\nG6.2 P3 K0\nK0 X1\nK0 X2\nK1\nK1\nK1",
        &["2:1 [feed-missing] with G93 every curve needs its F, in its first line"],
    );
    assert_messages(
        "F60\nG5.2\nX1\nX2\nG5.3 M8\nG1 X9",
        &["5:6 [nurbs] G5.3 ends a curve: no other G or M word stands in its line"],
    );
    assert_messages(
        "F60 G5 X1 I1 J1",
        &["1:5 [nurbs] G5 needs P and Q, the third control point from the end"],
    );
    assert_messages(
        "F60 G5 X1 P1 Q1",
        &[
            "1:5 [nurbs] G5 needs I and J, the second control point from the start: only a G5 behind another may lack them",
        ],
    );
    assert_messages(
        "F60 G18 G5.1 X1 I1",
        &["1:9 [nurbs] G5 and G5.1 need the plane XY (G17)"],
    );
    assert_messages(
        "F60\nG5.2\nX0\nX0\nG5.3",
        &[
            "5:1 [nurbs] the curve that line 2 opens: all control points coincide: the curve has no length",
        ],
    );
}

/// What shows only when the curve is complete is told where it stands.
#[test]
fn what_is_wrong_with_the_whole_points_at_the_word() {
    assert_messages(
        "F60\nG6.2 P3 K0\nK0 X1 R1000 (heavy)\nN9 K0 (R) x[1+1] R.0001\nK1 X3\nK2\nK2\nK2\nG1 X9",
        &[
            "4:18 [nurbs] the curve that line 2 opens: the largest weight is 1.0e7 times the smallest: at most 1e6 is \
           evaluated to its digits",
        ],
    );
    assert_messages(
        "F60\nG5.2\nX1 P1000\nX2\nX3 Y1 P0.000001\nX4\nG5.3",
        &[
            "5:7 [nurbs] the curve that line 2 opens: the largest weight is 1.0e9 times the smallest: at most 1e6 is \
           evaluated to its digits",
        ],
    );
    assert_messages(
        "F60\nG6.2 P3 K0\nK0 X1\nK0 X2\nX3 K0.00000000001\nK1\nK1\nK1",
        &[
            "5:4 [nurbs] the curve that line 2 opens: knots 2 and 3 differ by 1e-11 only: make them equal or keep them apart",
        ],
    );
    assert_messages(
        "F60\nG5.2 L3\nX1 A1\nX1 A2\nX1 A3\nX2\nG5.3",
        &[
            "4:1 [nurbs] the curve that line 2 opens: between the knots 1 and 2 only rotary axes move: a feed in mm says \
           nothing about them",
        ],
    );
    let excerpt = run_on(mill(), "F60\nG5.2\nX1 P1000\nX2 P0.0001\nX3\nG5.3").1[0].to_string();
    assert!(
        excerpt.ends_with("\n  X2 P0.0001\n     ^^^^^^^"),
        "{excerpt}"
    );
}

/// Knots that stand too often: the curve would not pass its ends, or falls apart.
#[test]
fn knots_that_stand_too_often() {
    let end = |line: u32, knot: &str, count: u32| {
        format!(
            "{line}:1 [nurbs] knot {knot} stands {count} times at an end of a curve of degree 2, 3 are the most: the \
             curve would not reach its control point there"
        )
    };
    assert_messages(
        "F60\nG6.2 P3 K0\nK0 X1\nK0 X2\nK0 X3\nK1\nK1\nK1\nG1 X9",
        &[&end(5, "0", 4)],
    );
    assert_messages(
        "F60\nG6.2 P3 K0\nK0 X1\nK0 X2\nK1 X3\nK1\nK1\nK1\nG1 X9",
        &[&end(6, "1", 4)],
    );
    assert_messages(
        "F60\nG6.2 P3 K0\nK0 X1\nK0 X2\nK1 X3\nK1 X4\nK1 X5\nK2\nK2\nK2",
        &[
            "7:1 [nurbs] knot 1 stands 3 times inside a curve of degree 2: the curve breaks in two there",
        ],
    );
    assert_messages(
        "F60\nG6.2 P3 K0\nK0 X1\nK0 X2\nK0\nK0\nK0",
        &["5:1 [nurbs] all knots that bound the curve are 0: the curve has no extent"],
    );
}

/// Only the curve itself has to stay within the travel, not its control points.
#[test]
fn travel() {
    assert!(messages("F60\nG5.2\nX240 Y100\nX0 Y251\nX-240 Y100\nG5.3").is_empty());
    let refused = messages("F60\nG5.2\nX240 Y100\nX0 Y600\nX-240 Y100\nG5.3");
    assert!(
        refused[0].starts_with("4:4 [travel] Y would reach 433.3333 mm"),
        "{refused:?}"
    );
    assert!(
        refused[0].ends_with("(machine coordinates); this control point draws the curve there"),
        "{refused:?}"
    );
    // Weights that rise a hundredfold: the curve goes out and back in a small part of its parameter.
    let uneven = "F60\nG6.2 P5 K0\nK0 X1200 R100\nK0 X-1200 R10000\nK0 X0 Y30 R1000000\nK0 X10 R1000000\nK1\nK1\nK1\nK1\nK1";
    let refused = messages(uneven);
    assert!(
        refused[0].starts_with("3:4 [travel] X would reach 32"),
        "{refused:?}"
    );
}
