//! What each word does.

mod common;

use common::{blocks, mill, only_blocks, programs, run, run_on, short, shown};
use tandem_gcode::{Item, docs};
use tandem_sdk::{Block, PathMode};

fn assert_items(program: &str, expected: &[&str]) {
    assert_eq!(shown(&run(program)), expected, "{program}");
}

/// The ends of all blocks in X, Y, Z.
fn ends(program: &str) -> Vec<[String; 3]> {
    blocks(program).iter().map(|b| [b.end[0], b.end[1], b.end[2]].map(short)).collect()
}

fn last(program: &str) -> Block {
    *blocks(program).last().expect("a block")
}

#[test]
fn the_fixture_holds_every_word_that_works() {
    let text = std::fs::read_to_string(programs().join("every-word.ngc")).unwrap();
    run(&text);
    let words: Vec<_> = text.split(|c: char| !c.is_ascii_alphanumeric() && c != '.').collect();
    for row in docs().lines().filter(|row| row.ends_with("| works |")) {
        let word = row.split_whitespace().nth(1).unwrap();
        let alone = |w: &&str| **w == *word || matches!(w.strip_prefix(word), Some(rest) if rest.starts_with('X'));
        assert!(words.iter().any(alone) || matches!(word, "M2" | "M3" | "M6"), "{word} is missing");
    }
}

#[test]
fn blocks_are_numbered_and_joined() {
    let text = std::fs::read_to_string(programs().join("cam-fanuc.nc")).unwrap();
    let all = blocks(&text);
    for (n, block) in all.iter().enumerate() {
        assert_eq!(block.index, n as u64);
    }
    for pair in all.windows(2) {
        assert_eq!(pair[0].end, pair[1].start);
    }
    assert_eq!(all[9].line, 22);
    assert_eq!(
        (all[9].tool, short(all[9].spindle_rad_per_s), short(all[9].offset[2])),
        (2, "837.758".into(), "25".into())
    );
}

#[test]
fn a_modal_word_that_changes_nothing_leaves_no_trace() {
    assert_items(
        "F60 S60 M3 M8\nG1 X1 F60 S60 M3 M8\nX2 F60 S60 M3 M8 T0\nX3 T0 M9 M48 M62 P3\nX4 M9 M48 M62 P3 S60\nM5\nM5",
        &[
            "1: Spindle 0 6.283 before 0",
            "1: Flood 0 1 before 0",
            "2: Line 0 to 1 0 0 0 length 1 feed 1",
            "3: ToolSelect 0 0 before 1",
            "3: Line 1 to 2 0 0 0 length 1 feed 1",
            "4: DigitalOutput 3 1 before 2",
            "4: Flood 0 0 before 2",
            "4: Line 2 to 3 0 0 0 length 1 feed 1",
            "5: Line 3 to 4 0 0 0 length 1 feed 1",
            "6: Dwell 4 to 4 0 0 0 for 0",
            "6: Spindle 0 0 before 5",
            "End",
        ],
    );
}

#[test]
fn what_needs_rest_gets_it_and_the_rest_does_not() {
    assert_items(
        "G0 X1 S60\nM3\nG0 X2\nM0\nG0 X3 S30\nT1\nG0 X4 M6\nG4 P1.5\nM1\nG1 F60 X5\nM4\nM30",
        &[
            "1: Rapid 0 to 1 0 0 0",
            "2: Dwell 1 to 1 0 0 0 for 0",
            "2: Spindle 0 6.283 before 2",
            "3: Rapid 2 to 2 0 0 0",
            "4: Dwell 3 to 2 0 0 0 for 0",
            "4: ProgramStop 0 0 before 4",
            "5: Spindle 0 3.142 before 4",
            "5: Rapid 4 to 3 0 0 0",
            "6: ToolSelect 1 0 before 5",
            "7: Dwell 5 to 3 0 0 0 for 0",
            "7: Spindle 0 0 before 6",
            "7: ToolChange 1 0 before 6",
            "7: Rapid 6 to 4 0 0 0",
            "8: Dwell 7 to 4 0 0 0 for 1.5",
            "9: OptionalStop 0 0 before 8",
            "10: Line 8 to 5 0 0 0 length 1 feed 1",
            "11: Dwell 9 to 5 0 0 0 for 0",
            "11: Spindle 0 -3.142 before 10",
            "12: Spindle 0 0 before 10",
            "12: ProgramEnd 0 0 before 10",
            "End",
        ],
    );
}

#[test]
fn outputs_that_do_not_go_with_the_motion_switch_at_rest() {
    assert_items(
        "F60\nG1 X1\nM62 P1\nX2\nM64 P2\nX3\nM64 P2\nX4\nM63 P1\nX5\nM65 P2\nX6",
        &[
            "2: Line 0 to 1 0 0 0 length 1 feed 1",
            "3: DigitalOutput 1 1 before 1",
            "4: Line 1 to 2 0 0 0 length 1 feed 1",
            "5: Dwell 2 to 2 0 0 0 for 0",
            "5: DigitalOutput 2 1 before 3",
            "6: Line 3 to 3 0 0 0 length 1 feed 1",
            "8: Line 4 to 4 0 0 0 length 1 feed 1",
            "9: DigitalOutput 1 0 before 5",
            "10: Line 5 to 5 0 0 0 length 1 feed 1",
            "11: Dwell 6 to 5 0 0 0 for 0",
            "11: DigitalOutput 2 0 before 7",
            "12: Line 7 to 6 0 0 0 length 1 feed 1",
            "End",
        ],
    );
}

#[test]
fn inputs_are_waited_for_at_rest() {
    assert_items(
        "G0 X1\nM66 P3 L1 Q2\nM66 P1 L0\nG0 X#5399",
        &[
            "1: Rapid 0 to 1 0 0 0",
            "2: Dwell 1 to 1 0 0 0 for 0",
            "2: Wait Digital(3) Rise 2 before 2",
            "3: Wait Digital(1) Immediate 0 before 2",
            "4: Rapid 2 to 0 0 0 0",
            "End",
        ],
    );
}

#[test]
fn the_time_constant_goes_with_its_block_and_the_following() {
    let all = blocks("F600\nG1 X1\nTA 20 X2\nX3\nTA[2*5]\nG4 P0\nTA7.5\nX4");
    let shown: Vec<_> = all.iter().map(|b| short(b.time_constant_s * 1000.0)).collect();
    assert_eq!(shown, ["NaN", "20", "20", "10", "7.5"]);
    // T with a function is a tool all the same.
    assert!(shown_event("TABS[-2]").starts_with("1: ToolSelect 2"));
}

fn shown_event(program: &str) -> String {
    shown(&run(program)).remove(0)
}

#[test]
fn path_control_is_attached() {
    let all = blocks("F600\nG1 X1\nG64 P0.05 Q1\nX2\nG61\nX3\nG64\nX4\nG61.1\nX5\nG20 G64 P0.001\nX0.2");
    let modes: Vec<_> = all.iter().map(|b| (b.path_mode == PathMode::ExactStop, short(b.path_tolerance_mm))).collect();
    let expected = [(false, "NaN"), (false, "0.05"), (true, "NaN"), (false, "NaN"), (true, "NaN"), (false, "0.025")];
    assert!(last("G64 P0 G0 X1").path_tolerance_mm.is_nan());
    assert_eq!(modes, expected.map(|(exact, tolerance)| (exact, tolerance.to_owned())));
}

#[test]
fn offsets_add_up() {
    assert_eq!(ends("G10 L2 P1 X10 Y20\nG0 X1 Y1"), [["11", "21", "0"]]);
    assert_eq!(ends("G0 X50\nG10 L20 P1 X0\nG0 X1"), [["50", "0", "0"], ["51", "0", "0"]]);
    assert_eq!(ends("G10 L2 P9 X5\nG59.3 G0 X1\nG54 X1"), [["6", "0", "0"], ["1", "0", "0"]]);
    assert_eq!(ends("G91 G10 L2 P1 X5\nG10 L2 P0 X5\nG90 G0 X0"), [["10", "0", "0"]]);
    assert_eq!(
        ends("G43 H1 G0 Z0\nG49 Z1\nT2 M6\nG43 Z0"),
        [["0", "0", "20"], ["0", "0", "1"], ["0", "0", "1"], ["0", "0", "25"]]
    );
    assert_eq!(
        ends("G0 X10\nG92 X0 Y5\nX1 Y6\nG92.2\nX1\nG92.3\nX1\nG92.1\nX2")[1..],
        [["11", "1", "0"], ["1", "1", "0"], ["11", "1", "0"], ["2", "1", "0"]]
    );
    assert_eq!(ends("G10 L2 P1 X10\nG92 X5\nG53 G0 X7\nX0"), [["7", "0", "0"], ["-5", "0", "0"]]);
    // L20 leaves G92 and the tool out of the origin: the current position is what it says.
    assert_eq!(ends("G43 H1 G0 Z5\nG92 X3\nG10 L20 P1 X1 Z2\nG0 X2 Z4")[1..], [["1", "0", "27"]]);
    assert_eq!(short(last("G10 L2 P1 X10\nG92 Y5\nG43 H2 G0 X1").offset[2]), "25");
    assert_eq!(ends("G10 L1 P7 Z3 R4\nG43 H7 G0 Z#5410"), [["0", "0", "3"]]);
}

#[test]
fn reference_positions() {
    assert_eq!(ends("G0 X5 Y5 Z5\nG28.1\nG0 X9 Y9 Z9\nG28 Z20")[2..], [["9", "9", "20"], ["9", "9", "5"]]);
    assert_eq!(ends("G0 X5 Y5 Z5\nG30.1\nG0 X9\nG30")[2..], [["5", "5", "5"]]);
    assert_eq!(ends("G0 X5 Z5\nG91 G28 Z0")[1..], [["5", "0", "0"]]);
    // A motion word beside G28 only sets the mode.
    assert_eq!(ends("F60 G0 X5 Z5\nG1 G91 G28 Z0\nX1")[1..], [["5", "0", "0"], ["6", "0", "0"]]);
}

#[test]
fn units_and_distance_modes() {
    let block = last("G20 G91 G1 X1 A90 F10\nX1");
    assert_eq!((short(block.end[0]), short(block.end[3])), ("50.8".into(), "1.571".into()));
    assert_eq!(short(block.feed_mm_per_s), "4.233");
    let turning = last("F360 G1 A180");
    assert_eq!((short(turning.length_mm), short(turning.feed_mm_per_s)), ("3.142".into(), "0.105".into()));
    let both = last("F600 G1 A90 X3 Y4");
    assert_eq!((both.length_mm, both.feed_mm_per_s), (5.0, 10.0));
}

#[test]
fn inverse_time_gives_the_duration() {
    for program in ["G93 G1 X10 F30", "G93 G1 A90 F30", "G93 G2 X10 I5 F30", "G93 G3 I5 Z3 A720 F30"] {
        let block = last(program);
        assert!((block.length_mm / block.feed_mm_per_s - 2.0).abs() < 1e-12, "{program}");
    }
}

#[test]
fn helices_in_every_plane() {
    let helix = last("F60 G17 G2 X10 I5 Z4 A90 P2");
    assert_eq!((helix.arc.plane, short(helix.arc.sweep_rad.to_degrees())), ([0, 1], "-540".into()));
    assert!((helix.length_mm - (5.0 * helix.arc.sweep_rad).hypot(4.0)).abs() < 1e-12);
    // Seen from +Y, G3 turns from Z to X.
    let quarter = last("F60 G18 G0 Z10\nG3 X10 Z0 K-10");
    assert_eq!((quarter.arc.plane, short(quarter.arc.sweep_rad.to_degrees())), ([2, 0], "90".into()));
    let quarter = last("F60 G19 G0 Y10\nG3 Y0 Z10 R10");
    assert_eq!((quarter.arc.plane, short(quarter.arc.sweep_rad.to_degrees())), ([1, 2], "90".into()));
    let turning = last("F60 G2 I5 A360");
    assert_eq!(short(turning.length_mm), short(10.0 * std::f64::consts::PI));
}

#[test]
fn a_nearly_closed_helix_is_one_path_in_two_blocks() {
    let [first, second] = blocks("F60 G0 X10\nG2 X10.001 Y0.2 Z8 I-10")[1..] else { panic!("two arcs") };
    let swept = first.arc.sweep_rad + second.arc.sweep_rad;
    assert!((first.end[2] - 8.0 * first.arc.sweep_rad / swept).abs() < 1e-9);
    assert_eq!((first.end, second.end[0], second.end[1], second.end[2]), (second.start, 10.001, 0.2, 8.0));
    assert!((first.length_mm + second.length_mm - (10.0 * swept).hypot(8.0)).abs() < 0.01);
    assert_eq!((first.line, second.line, first.feed_mm_per_s), (2, 2, second.feed_mm_per_s));
}

#[test]
fn no_motion_no_block() {
    assert_items("F60 G1\nG1 X0 Y0\nG0 X0\nG91 X0\nG64 G17", &["End"]);
    // The rounding of offsets is no motion either.
    assert_eq!(blocks("G10 L2 P1 X0.1\nG92 Y1\nG0 X0.2\nG53 X0.3\nX0.2").len(), 1);
}

#[test]
fn parameters_take_effect_after_their_line() {
    assert_eq!(ends("#1=5\n#1=7 G0 X#1\nX#1"), [["5", "0", "0"], ["7", "0", "0"]]);
    assert_eq!(ends("#<Long Name>=3 #<_global>=4\nG0 X#<longname> Y#<_GLOBAL>"), [["3", "4", "0"]]);
    assert_eq!(ends("#2=3 #3=2\nG0 X##3 Y#[1+1] Z-#2"), [["3", "3", "-3"]]);
    assert_eq!(ends("G10 L2 P2 X5\nG55 G0 X1\nG0 Y#5420 Z#5241\nX#5220")[1..], [["6", "1", "5"], ["7", "1", "5"]]);
    assert_eq!(ends("G0 X3\n#1=#<_x>\nG0 Y[#1 + #<_line>]")[1], ["3", "6", "0"]);
    assert_eq!(ends("G0 X[EXISTS[#<no>] + 1]\n#<no>=1\nY[EXISTS[#<no>]]"), [["1", "0", "0"], ["1", "1", "0"]]);
}

#[test]
fn precedence_is_that_of_linuxcnc() {
    for (expression, value) in [
        ("2+3*2**2", 14.0),
        ("2**3**2", 64.0),
        ("-2**2", 4.0),
        ("7 MOD 4 * 2", 6.0),
        ("-7 MOD 4", 1.0),
        ("10-4-3", 3.0),
        ("1 + 1 EQ 2", 1.0),
        ("0 AND 1 OR 1", 1.0),
        ("1 OR 1 AND 0", 0.0),
        ("2 GT 1 XOR 0", 1.0),
        ("ATAN[1]/[-1]", 135.0),
        ("1+SIN[30]*2", 2.0),
        ("ROUND[-2.5] + FIX[-2.5] + FUP[-2.5]", -8.0),
        ("3GT2AND1", 1.0),
        ("-[3]+-ABS[-4]", -7.0),
    ] {
        let block = last(&format!("G0 X[{expression}] Y200"));
        assert!((block.end[0] - value).abs() < 1e-12, "[{expression}] = {}", block.end[0]);
    }
}

#[test]
fn lines_may_be_skipped_empty_or_commented() {
    let mut config = mill();
    config.block_delete = true;
    let program =
        "  /G0 X1\n\n  \t\n(only a comment, z = sin(x/7))\n; another\nN5\nG0 (here) X2 (there) ; end\n%\nG0 X3";
    let (items, errors) = run_on(config, program);
    assert!(errors.is_empty());
    assert_eq!(only_blocks(&items).len(), 1);
    assert_eq!(blocks(program).len(), 2);
    assert!(matches!(items.last(), Some(Item::End)));
}

#[test]
fn nothing_follows_the_end() {
    assert_items("M2\nG0 X1", &["1: ProgramEnd 0 0 before 0", "End"]);
    assert_items("%\nG0 X1\n%\nG41 nonsense", &["2: Rapid 0 to 1 0 0 0", "End"]);
    assert_items("", &["End"]);
}
