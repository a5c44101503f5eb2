//! Canned cycles as blocks and events.

use crate::testing::{assert_items, ends, messages};

fn heights(program: &str) -> Vec<String> {
    ends(program).into_iter().map(|[_, _, z]| z).collect()
}

#[test]
fn a_hole_is_drilled_from_r_and_left_at_r() {
    assert_items(
        "F60 G0 Z9\nG99 G81 X2 Y1 Z-3 R1\nX4",
        &[
            "1: Rapid 0 to 0 0 9 0",
            "2: Rapid 1 to 2 1 9 0 exact",
            "2: Rapid 2 to 2 1 1 0 exact",
            "2: Line 3 to 2 1 -3 0 length 4 feed 1 exact",
            "2: Rapid 4 to 2 1 1 0 exact",
            "3: Rapid 5 to 4 1 1 0 exact",
            "3: Line 6 to 4 1 -3 0 length 4 feed 1 exact",
            "3: Rapid 7 to 4 1 1 0 exact",
            "End",
        ],
    );
}

#[test]
fn g98_returns_to_the_level_of_the_first_hole_or_to_r() {
    assert_eq!(
        heights("F60 G0 Z9\nG98 G81 X2 Z-3 R1\nX3 R4\nG80"),
        ["9", "9", "1", "-3", "9", "9", "4", "-3", "9"]
    );
    assert_eq!(
        heights("F60 G0 Z1\nG98 G81 X2 Z-3 R4\nX3"),
        ["1", "4", "4", "-3", "4", "4", "-3", "4"]
    );
}

#[test]
fn pecks_leave_the_hole_or_break_the_chip() {
    assert_eq!(
        heights("F60 G0 Z1\nG73 Z-4 R1 Q2"),
        ["1", "-1", "-0.746", "-3", "-2.746", "-4", "1"]
    );
    assert_eq!(
        heights("F60 G0 Z1\nG83 Z-2 R1 Q2"),
        ["1", "-1", "1", "-0.746", "-2", "1"]
    );
}

#[test]
fn incremental_cycles_repeat() {
    let all = ends("F60 G91 G81 X2 Y1 Z-2 R4 L2");
    let holes: Vec<_> = all.iter().filter(|end| end[2] == "2").collect();
    assert_eq!(
        holes,
        [
            &["2".to_string(), "1".into(), "2".into()],
            &["4".to_string(), "2".into(), "2".into()]
        ]
    );
}

#[test]
fn tapping_turns_the_spindle_round_without_overrides() {
    assert_items(
        "F60 S60 M3\nG84 Z-1 R0 P0.5",
        &[
            "1: Spindle 0 6.283 before 0",
            "2: FeedOverride 0 0 before 0",
            "2: SpindleOverride 0 0 before 0",
            "2: Line 0 to 0 0 -1 0 length 1 feed 1 exact",
            "2: Dwell 1 to 0 0 -1 0 for 0 exact",
            "2: Spindle 0 -6.283 before 2",
            "2: Dwell 2 to 0 0 -1 0 for 0.5 exact",
            "2: Line 3 to 0 0 0 0 length 1 feed 1 exact",
            "2: Dwell 4 to 0 0 0 0 for 0 exact",
            "2: Spindle 0 6.283 before 5",
            "2: FeedOverride 0 1 before 5",
            "2: SpindleOverride 0 1 before 5",
            "2: Spindle 0 0 before 5",
            "End",
        ],
    );
}

#[test]
fn what_a_cycle_lacks_is_named() {
    for (program, message) in [
        (
            "F9\nG81 X1 Z-1",
            "G81 needs R, the level from which the feed begins",
        ),
        ("F9\nG81 X1 R1", "G81 needs Z, the bottom of the hole"),
        ("F9\nG81 X1 R1 Z2", "R lies below the bottom of the hole"),
        ("F9\nG82 X1 R1 Z0", "G82 needs P, the dwell in seconds"),
        ("F9\nG83 X1 R1 Z0", "G83 needs Q, the depth of a peck"),
        (
            "F9\nG81 Z-1 R1\nG0 Z5\nG81 X1",
            "G81 needs R, the level from which the feed begins",
        ),
        (
            "F9\nG84 X1 R1 Z0",
            "G84 needs the spindle to turn clockwise (M3)",
        ),
        (
            "G81 X1 R1 Z0",
            "the feed is missing: no F has been set; G81 needs one",
        ),
        ("F9\nG83 X1 R1 Z-99 Q0.000001", "this line would make"),
    ] {
        let all = messages(program);
        assert!(
            all.iter().any(|m| m.contains(message)),
            "{program}: {all:?}"
        );
    }
}

#[test]
fn x_is_a_diameter_where_it_is_one() {
    assert_eq!(
        ends("G7 F60\nG81 X6 Y1 Z-1 R1"),
        ends("F60\nG81 X3 Y1 Z-1 R1")
    );
    assert_eq!(
        ends("G7 F60\nG91 G18 G81 X6 Y-1 Z2 R1 L2"),
        ends("F60\nG91 G18 G81 X3 Y-1 Z2 R1 L2")
    );
    assert_eq!(
        ends("G7 F60\nG19 G81 X6 Y1 Z-1 R7"),
        ends("F60\nG19 G81 X3 Y1 Z-1 R7")
    );
}
