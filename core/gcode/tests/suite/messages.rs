//! The messages that people read.

use crate::common;

use common::{messages, mill, programs};
use tandem_gcode::{Program, check};

fn assert_messages(program: &str, expected: &[&str]) {
    assert_eq!(messages(program), expected, "{program}");
}

/// What `check` says of a fixture.
fn checked(name: &str) -> String {
    let mut program = Program::open(&programs().join("bad").join(name)).unwrap();
    let report = check(&mut program, &mill(), &mut |_, _| Ok(())).unwrap();
    let all: Vec<_> = report.diagnostics.iter().map(ToString::to_string).collect();
    let folder = format!("{}/", programs().join("bad").display());
    all.join("\n").replace(&folder, "")
}

#[test]
fn bad_input_is_named_with_place_and_cause() {
    let expected = "\
feed-missing.ngc:2:1: error: the feed is missing: no F has been set; G1, G2 and G3 need one
  G1 X10
  ^^
";
    assert_eq!(checked("feed-missing.ngc") + "\n", expected);
    let expected = "\
arc-radius.ngc:2:11: error: the arc does not fit: its radius is 4.0000 mm at the start and 6.0000 mm at the end
  G2 X10 Y0 I4 J0
            ^^^^^
";
    assert_eq!(checked("arc-radius.ngc") + "\n", expected);
    let expected = "\
axis-missing.ngc:2:7: error: this machine has no axis B; it has X Y Z A
  G0 X1 B90
        ^^^
";
    assert_eq!(checked("axis-missing.ngc") + "\n", expected);
    let expected = "\
binary.ngc:1:1: error: this is not a part program: it holds the byte 0x7f
  \\u{7f}ELF\\u{2}\\u{1}\\u{1}\\u{0}\\u{0}\\u{0}\\u{0}
  ^
";
    assert_eq!(checked("binary.ngc") + "\n", expected);
}

#[test]
fn truncated_files_are_recognised() {
    let expected = "\
truncated-word.ngc:4:4: error: Y has no value: a number, [expression], #parameter or function must follow
  G1 Y
     ^
";
    assert_eq!(checked("truncated-word.ngc") + "\n", expected);
    let expected = "\
truncated-comment.ngc:3:1: error: the comment is not closed: ) is missing
  (a comment that the end of the file cuts o
  ^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^
";
    assert_eq!(checked("truncated-comment.ngc") + "\n", expected);
    let expected = "truncated-percent.ngc:3:1: error: the program is truncated: % opened it, and neither %, M2 nor M30 ends it";
    assert_eq!(checked("truncated-percent.ngc"), expected);
}

#[test]
fn numbers_that_are_none() {
    let expected = "\
not-finite.ngc:2:5: error: NAN is not a number that can be driven
  G1 XNAN F100
      ^^^
not-finite.ngc:3:6: error: INF is not a number that can be driven
  G1 X-INF
       ^^^
not-finite.ngc:4:6: error: division by zero
  G1 X[1/0]
       ^^^
not-finite.ngc:5:5: error: INFINITY is not a number that can be driven
  G1 XINFINITY
      ^^^^^^^^
";
    assert_eq!(checked("not-finite.ngc") + "\n", expected);
}

#[test]
fn travel_counts_offsets_and_the_extent_of_arcs() {
    let expected = "\
travel.ngc:2:4: error: X would reach 300 mm, beyond its travel of -250 to 250 mm (machine coordinates)
  G0 X300
     ^^^^
travel.ngc:4:4: error: X would reach 260 mm, beyond its travel of -250 to 250 mm (machine coordinates)
  G3 X200 Y120 I0 J60
     ^^^^
travel.ngc:6:4: error: X would reach 260 mm, beyond its travel of -250 to 250 mm (machine coordinates; the offset in \
force is 200 mm)
  G1 X60
     ^^^
travel.ngc:7:12: error: Z would reach 127 mm, beyond its travel of -100 to 100 mm (machine coordinates)
  G20 G53 G0 Z5
             ^^
";
    assert_eq!(checked("travel.ngc") + "\n", expected);
}

#[test]
fn unknown_words() {
    let expected = "\
unknown-word.ngc:2:7: error: nothing in this line takes the word Q (G5, G6.2, G10, G64, G73, G83, M19, M61, M66, M67, M68, M100 would)
  G0 X1 Q3
        ^^
unknown-word.ngc:3:1: error: G123 is not known
  G123 X1
  ^^^^
unknown-word.ngc:4:1: error: M42 is not known
  M42
  ^^^
unknown-word.ngc:5:4: error: nothing in this line takes the word E (M66, M67, M68 would)
  G0 E4
     ^^
";
    assert_eq!(checked("unknown-word.ngc") + "\n", expected);
    assert_messages(
        "G0 X1e-5",
        &[
            "1:6 [unused-word] nothing in this line takes the word E (M66, M67, M68 would); numbers have no exponent",
        ],
    );
    assert_messages(
        "G0 D3",
        &[
            "1:4 [unused-word] nothing in this line takes the word D (G41, G41.1, G42, G42.1, G96 would)",
        ],
    );
}

#[test]
fn what_is_not_supported_is_refused_by_name_and_once() {
    let all = checked("refused.ngc");
    let first = "\
refused.ngc:2:1: error: G33 (synchronous motion): motion synchronous with the spindle is not supported
  G33 Z-1 K1
  ^^^
";
    assert!(all.starts_with(first), "{all}");
    for (line, word) in [(3, "G33.1"), (4, "G76"), (5, "G51"), (6, "G16"), (7, "G87")] {
        assert!(
            all.contains(&format!("refused.ngc:{line}:1: error: {word} (")),
            "{word}: {all}"
        );
    }
    for (line, word) in [
        (11, "M29"),
        (12, "G65"),
        (13, "G70"),
        (14, "G68"),
        (15, "G71"),
        (16, "M102"),
        (17, "G44"),
    ] {
        assert!(
            all.contains(&format!("refused.ngc:{line}:1: error: {word}")),
            "{word}: {all}"
        );
    }
    assert!(
        !all.contains("ngc:8:"),
        "the points of a refused cycle are not blamed again: {all}"
    );
}

#[test]
fn the_reader_says_where_and_what() {
    for (program, expected) in [
        (
            "G0 X",
            "1:4 [value-missing] X has no value: a number, [expression], #parameter or function must follow",
        ),
        (
            "G0 XY1",
            "1:4 [value-missing] X has no value: a number, [expression], #parameter or function must follow",
        ),
        (
            "G0 X1 2",
            "1:7 [unexpected] a number without a letter before it",
        ),
        (
            "G0 X1.2.3",
            "1:8 [number] a number has one decimal point only",
        ),
        ("G0 X1 X2", "1:7 [word-twice] X stands in this line twice"),
        (
            "G0 X[1+2",
            "1:5 [bracket] the [ is not closed: ] is missing",
        ),
        ("G0 X[1 2]", "1:8 [bracket] an operator or ] is missing"),
        ("G0 XSIN30", "1:8 [bracket] [ is missing"),
        (
            "G0 XFOO[1]",
            "1:5 [function] no function is called FOO; there are ABS ACOS ASIN ATAN COS EXISTS EXP FIX FUP LN ROUND SIN SQRT TAN",
        ),
        (
            "G0 XSQRT[-1]",
            "1:5 [arithmetic] SQRT needs a number that is not negative",
        ),
        (
            "G0 X[EXP[1000]]",
            "1:6 [arithmetic] the result is too large to be a number",
        ),
        (
            "G0 X#<never>",
            "1:5 [parameter-unset] parameter #<never> has never been set",
        ),
        (
            "G0 X#5603",
            "1:5 [parameter-number] there is no parameter #5603: the numbers go from 1 to 5602",
        ),
        (
            "#5220=3",
            "1:1 [read-only] parameter #5220 cannot be assigned: it holds the number of the coordinate system: use G54 to G59.3",
        ),
        (
            "#<_metric>=3",
            "1:1 [read-only] this parameter cannot be assigned: the interpreter keeps it itself",
        ),
        (
            "#1 G0",
            "1:1 [assignment] a parameter stands here for a word; an assignment needs =",
        ),
        (
            "G0 X99999999999",
            "1:4 [word-range] X is too large a number",
        ),
        (
            "G0 (a (b c)",
            "1:4 [comment] the comment is not closed: it holds more ( than )",
        ),
        (
            "G0 X1 )",
            "1:7 [unexpected] a comment ends here that has not begun",
        ),
        (
            "G0 X1 / Y1",
            "1:7 [unexpected] / (block delete) stands at the start of a line only",
        ),
        ("% G0", "1:1 [percent] % stands on a line of its own"),
        (
            "G0 X1 é",
            "1:7 [unexpected] only comments may hold characters outside ASCII",
        ),
        (
            "X1",
            "1:1 [motion-missing] no motion mode is in force: G0, G1, G2 or G3 is missing",
        ),
        (
            "G0 G1 X1",
            "1:4 [conflict] G1 and G0 exclude each other in a line (group: motion)",
        ),
        (
            "G90 G91",
            "1:5 [conflict] G91 and G90 exclude each other in a line (group: distance mode)",
        ),
        (
            "M3 M4",
            "1:4 [conflict] M4 and M3 exclude each other in a line (group: spindle)",
        ),
        (
            "M8 M9",
            "1:4 [conflict] M9 and M7 or M8 exclude each other in a line",
        ),
        (
            "G1 G92 X1",
            "1:1 [conflict] the axis words belong to G92, not to a motion: split the line",
        ),
        (
            "G4 P1 M62",
            "1:4 [ambiguous] M62 takes P, but so does another word of this line: split it",
        ),
        ("G92", "1:1 [axis-missing] G92 needs at least one axis word"),
        (
            "G10 P1",
            "1:1 [word-missing] G10 needs L: 1, 2, 10, 11 or 20",
        ),
        ("G4", "1:1 [word-missing] G4 needs P, the dwell in seconds"),
        ("G4 P-1", "1:4 [word-range] P must not be negative"),
        (
            "TA0",
            "1:1 [time-constant] TA (time constant, ms) must be greater than zero",
        ),
        (
            "G1 TA-5",
            "1:4 [time-constant] TA (time constant, ms) must be greater than zero",
        ),
        (
            "TA",
            "1:1 [value-missing] TA has no value: a number, [expression], #parameter or function must follow",
        ),
        ("T9", "1:1 [tool] the tool table has no tool 9"),
        ("G43 H9", "1:1 [tool] the tool table has no tool 9"),
        (
            "M66 P1 L3",
            "1:1 [input] M66 needs Q, the longest wait in seconds, greater than zero",
        ),
        ("F-1", "1:1 [word-range] F must not be negative"),
        (
            "F0\nG1 X1 F0",
            "2:1 [feed-missing] the feed is zero; G1, G2 and G3 need one",
        ),
        (
            "G93 F2\nG1 X1",
            "2:1 [feed-missing] with G93 every line with G1, G2 or G3 needs its F",
        ),
        (
            "F60 G2 X1",
            "1:5 [arc-centre] the arc has no centre (I J) and no radius (R)",
        ),
        (
            "F60 G2 X1 K1",
            "1:11 [arc-centre] K is no centre in this plane: I and J are (G17, G18, G19 choose)",
        ),
        (
            "F60 G2 X1 I1 R1",
            "1:14 [arc-centre] an arc has either R or I J K, not both",
        ),
        (
            "F60 G2 X9 R4",
            "1:11 [arc-radius] the radius 4 mm is too small: the ends of the arc are 9 mm apart",
        ),
        (
            "F60 G2 R4",
            "1:8 [arc-ends] an arc by radius (R) cannot end where it starts: a full circle needs I J K",
        ),
        (
            "F60 G2 X1 I0 J0",
            "1:11 [arc-radius] the arc does not fit: its radius is 0.0000 mm at the start and 1.0000 mm at the end",
        ),
        (
            "F60 G90.1 G2 X1 I0",
            "1:11 [arc-centre] with G90.1 an arc needs both coordinates of its centre",
        ),
        (
            "G91 G53 G0 X1",
            "1:5 [conflict] G53 does not go with G91: machine coordinates are absolute",
        ),
        (
            "F60 G53 G2 X1 R1",
            "1:5 [conflict] G53 goes with G0 and G1 only",
        ),
        (
            "G0 X1\nO5",
            "2:1 [o-word] an O-word stands in a line of its own of a program; manual input only calls subroutines",
        ),
    ] {
        assert_messages(program, &[expected]);
    }
}

#[test]
fn one_error_does_not_cause_others() {
    // The end of the bad line is known: the arc that follows starts there.
    assert_messages(
        "F60 G0 X300\nG2 X290 I-5 J0\nG0 X0",
        &[
            "1:8 [travel] X would reach 300 mm, beyond its travel of -250 to 250 mm (machine coordinates)",
            "2:4 [travel] X would reach 300 mm, beyond its travel of -250 to 250 mm (machine coordinates)",
        ],
    );
    // It is not: nothing is said of an arc whose start is unknown, until the position is known again.
    assert_messages(
        "F60 G0 X10 Y1..5\nG2 X20 Y3 I5 J0\nX20 Y3 I1\nX25 I9",
        &[
            "1:15 [number] a number has one decimal point only",
            "4:5 [arc-radius] the arc does not fit: its radius is 9.0000 mm at the start and 4.0000 mm at the end",
        ],
    );
    // Modes of a bad line hold, so the next lines are read as they were meant.
    assert_messages(
        "G1 G91 F60 Q1\nX1\nX1",
        &[
            "1:12 [unused-word] nothing in this line takes the word Q (G5, G6.2, G10, G64, G73, G83, M19, M61, M66, M67, M68, M100 would)",
        ],
    );
    // A feed that cannot be read is not missed in each line that needs one.
    assert_messages(
        "F#<_hal[a]>\nG1 X1\nX2\nG94\nX3",
        &[
            "1:2 [parameter-unset] parameter #<_hal[a]> would read a HAL pin, and there is no HAL: M66 reads inputs",
            "5:1 [feed-missing] the feed is missing: no F has been set; G1, G2 and G3 need one",
        ],
    );
    assert_messages(
        "#<a>=[1/0]\nG0 X#<a>",
        &["1:7 [arithmetic] division by zero"],
    );
}
