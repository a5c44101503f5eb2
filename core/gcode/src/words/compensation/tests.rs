//! Moves beside their path.

use crate::testing::{blocks, ends, messages, short};

/// Ends of the blocks in X and Y; an arc with its radius.
fn path(program: &str) -> String {
    let shown = |b: &tandem_sdk::Block| {
        let arc = if b.kind == tandem_sdk::BlockKind::Arc {
            format!(" r{}", short(b.arc.radius_mm))
        } else {
            String::new()
        };
        format!("{},{}{arc}", short(b.end[0]), short(b.end[1]))
    };
    blocks(program)
        .iter()
        .map(shown)
        .collect::<Vec<_>>()
        .join(" ")
}

#[test]
fn inside_corners_are_cut_short_and_outside_ones_rounded() {
    // A tool of radius 1 left of the path: up is inside, down outside.
    let entry = "F60\nG41.1 D2 G1 X10\nX20";
    assert_eq!(
        path(&format!("{entry}\nY10\nG40 X40")),
        "10,1 19,1 19,10 40,10"
    );
    assert_eq!(
        path(&format!("{entry}\nY-10\nG40 X40")),
        "10,1 20,1 21,0 r1 21,-10 40,-10"
    );
    assert_eq!(
        path("F60\nG42.1 D2 G1 X10\nX20\nY-10\nG40 X40"),
        "10,-1 19,-1 19,-10 40,-10"
    );
    // Straight on there is no corner; the last move ends beside its end.
    assert_eq!(path(&format!("{entry}\nX30")), "10,1 20,1 30,1");
}

#[test]
fn arcs_keep_their_centres() {
    let entry = "F60\nG41.1 D2 G1 X10\nX20";
    assert_eq!(
        path(&format!("{entry}\nG3 X30 Y10 J10\nG1 Y20\nG40 X0")),
        "10,1 20,1 29,10 r9 29,20 0,20"
    );
    assert_eq!(
        path(&format!("{entry}\nG2 X30 Y-10 J-10\nG1 Y-20\nG40 X0")),
        "10,1 20,1 31,-10 r11 31,-20 0,-20"
    );
    // The line ends where it meets the circle: at 30 - √(11² - 1).
    assert_eq!(
        path(&format!("{entry}\nG2 X40 I10\nG40 G1 X60")),
        "10,1 19.046,1 41,0 r11 60,0"
    );
}

#[test]
fn what_stands_between_two_moves_waits_with_the_first() {
    let program = "F60 S60\nG41.1 D2 G1 X10\nX20\nZ-3\nM3\nM62 P1\nY10\nG40 X40";
    let shown = crate::testing::shown(&crate::testing::run(program));
    let expected = [
        "2: Line 0 to 10 1 0 0",
        "3: Line 1 to 19 1 0 0",
        "4: Line 2 to 19 1 -3 0",
        "5: Dwell 3 to 19 1 -3 0",
        "5: Spindle 0 6.283 before 4",
        "6: DigitalOutput 1 1 before 4",
        "7: Line 4 to 19 10 -3 0",
        "8: Line 5 to 40 10 -3 0",
    ];
    for (found, expected) in shown.iter().zip(expected) {
        assert!(found.starts_with(expected), "{found}: {expected}");
    }
    let all = blocks(program);
    for (n, pair) in all.windows(2).enumerate() {
        assert_eq!((pair[0].end, pair[0].index), (pair[1].start, n as u64));
    }
}

#[test]
fn what_would_cut_into_the_part_is_refused_with_both_lines() {
    let slot = messages("F60\nG41.1 D6 G1 X10\nX20\nY2\nX0\nG40 Y9");
    assert!(
        slot[0].starts_with("5:1 [gouge]") && slot[0].contains("moves of the lines 4 and 5"),
        "{}",
        slot[0]
    );
    assert_eq!(slot.len(), 1, "what follows is not blamed: {slot:?}");
    let arc = messages("F60\nG41.1 D6 G1 X10\nX20\nG3 X24 Y2 I2 J1\nG40 G1 X0");
    assert!(
        arc[0].contains("is not greater than that of the tool"),
        "{arc:?}"
    );
    let entry = messages("F60\nG41.1 D6 G1 X2\nG40");
    assert!(
        entry[0].contains("must be longer than the radius"),
        "{entry:?}"
    );
}

#[test]
fn the_place_where_the_tool_does_not_fit_is_drawn() {
    let sketch = |program: &str| {
        let (_, errors) = crate::testing::run_on(crate::testing::mill(), program);
        errors[0].sketch.clone().unwrap()
    };
    let slot = sketch("F60\nG41.1 D6 G1 X10\nX20\nY2\nX0\nG40 Y9");
    assert_eq!(slot.axes, ['X', 'Y']);
    assert_eq!(
        slot.moves,
        [
            (4, vec![[20.0, 0.0], [20.0, 2.0]]),
            (5, vec![[20.0, 2.0], [0.0, 2.0]])
        ]
    );
    assert_eq!((slot.tool_at_mm, slot.tool_radius_mm), ([17.0, 2.0], 3.0));
    let arc = sketch("F60\nG41.1 D6 G1 X10\nX20\nG3 X24 Y0 I2 J0\nG40 G1 X0");
    let (line, points) = arc.moves.last().unwrap();
    let [from, to] = [points[0], points[points.len() - 1]];
    assert!(*line == 4 && (from[0] - 20.0).abs() < 1e-9 && (to[0] - 24.0).abs() < 1e-9);
    assert!(
        points
            .iter()
            .all(|[x, y]| ((x - 22.0).hypot(*y) - 2.0).abs() < 1e-9 && *y < 1e-9)
    );
    assert_eq!(arc.tool_at_mm, [20.0, 3.0]);
}

#[test]
fn what_does_not_go_with_compensation_is_refused() {
    for other in [
        "G20",
        "G18",
        "G55",
        "G43 H1",
        "T1 M6",
        "G28",
        "G92 X1",
        "G53 G0 X1",
        "G38.2 X1",
        "G81 X1 Z-1 R1",
        "G42 D1",
        "M66 P1",
    ] {
        let found = messages(&format!("F60\nG41.1 D2 G1 X10\nX20\n{other}\nG40"));
        assert!(
            found.len() == 1 && found[0].starts_with("4:") && found[0].contains("[compensation]"),
            "{other}: {found:?}"
        );
    }
    for wrong in ["G41.1", "G41 D9", "G19 G41 D1", "G18 G41.1 D2 L1"] {
        assert_eq!(messages(wrong).len(), 1, "{wrong}");
    }
    // What is so already may be said again.
    assert_eq!(
        ends("F60 G41 D1 G1 X10\nG21 G17 G54 X20\nG40 G49 G1 X30 Y0").len(),
        3
    );
}
