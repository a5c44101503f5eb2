//! What lines do whatever their words: the tests of the words stand beside them in `src/words`.

use crate::common;

use common::{
    assert_items, blocks, ends, errors_of, last, mill, only_blocks, programs, run_on, short,
};
use tandem_gcode::{Item, docs};

/// The fixture is a program for tests of whole runs: it must keep up with the words.
#[test]
fn the_fixture_holds_every_word_that_works() {
    let text = std::fs::read_to_string(programs().join("every-word.ngc")).unwrap();
    let errors = errors_of(&text);
    assert!(errors.is_empty(), "{errors:?}");
    let words: Vec<_> = text
        .split(|c: char| !c.is_ascii_alphanumeric() && c != '.')
        .collect();
    for row in docs().lines().filter(|row| row.ends_with("| works |")) {
        let word = row.split_whitespace().nth(1).unwrap();
        let alone = |w: &&str| {
            **w == *word || matches!(w.strip_prefix(word), Some(rest) if rest.starts_with('X'))
        };
        assert!(
            words.iter().any(alone) || matches!(word, "M2" | "M3" | "M6"),
            "{word} is missing"
        );
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
        (
            all[9].tool,
            short(all[9].spindle_rad_per_s),
            short(all[9].offset[2])
        ),
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
fn parameters_take_effect_after_their_line() {
    assert_eq!(
        ends("#1=5\n#1=7 G0 X#1\nX#1"),
        [["5", "0", "0"], ["7", "0", "0"]]
    );
    assert_eq!(
        ends("#<Long Name>=3 #<_global>=4\nG0 X#<longname> Y#<_GLOBAL>"),
        [["3", "4", "0"]]
    );
    assert_eq!(ends("#2=3 #3=2\nG0 X##3 Y#[1+1] Z-#2"), [["3", "3", "-3"]]);
    assert_eq!(
        ends("G10 L2 P2 X5\nG55 G0 X1\nG0 Y#5420 Z#5241\nX#5220")[1..],
        [["6", "1", "5"], ["7", "1", "5"]]
    );
    assert_eq!(
        ends("G0 X3\n#1=#<_x>\nG0 Y[#1 + #<_line>]")[1],
        ["3", "6", "0"]
    );
    // Where the touched position and more were kept can be assigned before it is.
    assert_eq!(
        ends("#5061=4 #5070=2\nG0 X#5061 Y#5070 Z[EXISTS[#99999]]"),
        [["4", "2", "0"]]
    );
    let named =
        "G0 X#<_abs_x> Y[#<_plane> - #<_motion_mode> / 10] Z[#<_absolute> + #<_spindle_on>]";
    assert_eq!(
        ends(&format!("G54 G92 X-7\nS1 M3 G18\n{named}"))[0],
        ["7", "100", "2"]
    );
    assert_eq!(
        ends("G0 X[EXISTS[#<no>] + 1]\n#<no>=1\nY[EXISTS[#<no>]]"),
        [["1", "0", "0"], ["1", "1", "0"]]
    );
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
        assert!(
            (block.end[0] - value).abs() < 1e-12,
            "[{expression}] = {}",
            block.end[0]
        );
    }
}

#[test]
fn lines_may_be_skipped_empty_or_commented() {
    let mut config = mill();
    config.block_delete = true;
    let program = "  /G0 X1\n\n  \t\n(only a comment, z = sin(x/7))\n; another\nN5\nG0 (here) X2 (there) ; end\n%\nG0 X3";
    let (items, errors) = run_on(config, program);
    assert!(errors.is_empty());
    assert_eq!(only_blocks(&items).len(), 1);
    assert_eq!(blocks(program).len(), 2);
    assert!(matches!(items.last(), Some(Item::End)));
}
