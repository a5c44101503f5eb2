//! G38.2 to G38.5 and G31: what they order, what they refuse, and what the program knows afterwards.

use crate::common;

use common::{blocks, messages, mill, only_blocks, run, shown};
use tandem_gcode::{Config, Item, ProbeInput, ProbeResult, Program, ProgramError, Stream, check};
use tandem_sdk::{AxisVector, Block, Edge};

/// Both passes; each probe touches at `share` of its way and comes to rest 0.25 mm further along Z.
fn drive(config: &Config, text: &str, share: Option<f64>) -> Result<Vec<Item>, ProgramError> {
    let mut program = Program::spool("t.ngc", text.as_bytes()).unwrap();
    let report = check(&mut program, config, &mut |_, _| Ok(())).unwrap();
    assert!(report.is_ok(), "{}", report.diagnostics[0]);
    let mut stream = Stream::new(program, config)?;
    let mut items = Vec::new();
    while stream.next_items(&mut items)? {
        if let Some(Item::Block(block, _)) = items.last().filter(|item| item.is_probe()) {
            stream.provide_probe(&result(block, share));
        }
    }
    Ok(items)
}

fn result(block: &Block, share: Option<f64>) -> ProbeResult {
    let Some(share) = share else {
        return ProbeResult {
            touched: None,
            rest: block.end,
        };
    };
    let at = block.start + (block.end - block.start) * share;
    let mut rest = at;
    rest[2] -= 0.25;
    ProbeResult {
        touched: Some(at),
        rest,
    }
}

fn ends(items: &[Item]) -> Vec<[f64; 3]> {
    let round = |v: f64| (v * 1e6).round() / 1e6;
    only_blocks(items)
        .iter()
        .map(|b| [b.end[0], b.end[1], b.end[2]].map(round))
        .collect()
}

fn diagnostics(config: &Config, text: &str) -> Vec<String> {
    let mut program = Program::spool("t.ngc", text.as_bytes()).unwrap();
    let report = check(&mut program, config, &mut |_, _| Ok(())).unwrap();
    report
        .diagnostics
        .iter()
        .map(|d| format!("{}:{} {}", d.line, d.column, d.message))
        .collect()
}

#[test]
fn a_probe_lies_between_two_rests_and_is_waited_for() {
    assert_eq!(
        shown(&run("F60 G1 X1\nG38.2 Z-8\nG4 P0\nG31 Z-9 F30\nX2")),
        [
            "1: Line 0 to 1 0 0 0 length 1 feed 1",
            "2: Dwell 1 to 1 0 0 0 for 0",
            "2: Line 2 to 1 0 -8 0 length 8 feed 1 until Rising 7 or fault",
            "3: Dwell 3 to 1 0 -4 0 for 0",
            "4: Line 4 to 1 0 -9 0 length 5 feed 0.5 until Rising 7",
            // G31 holds for its line only: the mode is still that of G38.2.
            "5: Line 5 to 2 0 -6.5 0 length 1 feed 0.5 until Rising 7 or fault",
            "End",
        ]
    );
}

#[test]
fn each_word_waits_for_its_edge() {
    let stop_on = |word: &str, inverted: bool| {
        let mut config = mill();
        config.probe = Some(ProbeInput { input: 3, inverted });
        let items = drive(&config, &format!("{word} Z-1 F60"), None).unwrap();
        let stop_on = only_blocks(&items)[0].stop_on;
        assert_eq!(stop_on.input, 3);
        (stop_on.edge, stop_on.miss_is_fault)
    };
    for (word, edge, must) in [
        ("G38.2", Edge::Rising, 1),
        ("G38.3", Edge::Rising, 0),
        ("G38.4", Edge::Falling, 1),
        ("G38.5", Edge::Falling, 0),
        ("G31", Edge::Rising, 0),
    ] {
        let other = if edge == Edge::Rising {
            Edge::Falling
        } else {
            Edge::Rising
        };
        assert_eq!(
            [stop_on(word, false), stop_on(word, true)],
            [(edge, must), (other, must)],
            "{word}"
        );
    }
    assert!(
        blocks("G1 X1 F60\nG0 X2\nG2 I5")
            .iter()
            .all(|b| b.stop_on.edge == Edge::None)
    );
}

#[test]
fn the_result_is_in_program_coordinates_and_units() {
    let program = "G10 L2 P1 X10 Z-2\nG38.2 Z-8 X4 F60\nG1 X#5061 Y[#5063 * 10] Z#5070\n";
    let items = drive(&mill(), program, Some(0.5)).unwrap();
    // From (0, 0, 0) to (14, 0, −10): touched at (7, 0, −5), which the program calls (−3, 0, −3).
    assert_eq!(ends(&items), [[14.0, 0.0, -10.0], [7.0, -30.0, -1.0]]);
    let inch = drive(
        &mill(),
        "G20 G38.3 Z-2 F10\nG1 X#5063 Y[#5061+#5070]",
        Some(0.5),
    )
    .unwrap();
    assert_eq!(ends(&inch)[1], [-25.4, 25.4, -25.65]);
    let turned = drive(&mill(), "G38.3 A90 F600\nG0 X#5064", Some(0.5)).unwrap();
    assert_eq!(ends(&turned)[1][0], 45.0);
}

#[test]
fn a_miss_leaves_the_programmed_end_and_zero() {
    let items = drive(&mill(), "G38.3 Z-8 F60\nG0 X[#5063 + 1] Y#5070", None).unwrap();
    assert_eq!(ends(&items)[1], [-7.0, 0.0, -8.0]);
}

#[test]
fn the_program_goes_on_from_where_the_machine_rests() {
    let items = drive(
        &mill(),
        "G38.2 Z-8 F60\nG91 G1 Z1\nG90 X[#5063 - #5422]",
        Some(0.5),
    )
    .unwrap();
    let all = only_blocks(&items);
    assert_eq!((all[1].start[2], all[1].end[2]), (-4.25, -3.25));
    assert_eq!(ends(&items)[2], [-0.75, 0.0, -3.25]);
}

#[test]
fn what_does_not_go_with_a_probe_is_refused() {
    let refused = [
        (
            "G38.2 F60",
            "1:1 [axis-missing] G38.2 needs at least one axis word",
        ),
        (
            "G1 F60\n G31",
            "2:2 [axis-missing] G31 needs at least one axis word",
        ),
        (
            "G38.2 Z0 F60",
            "1:1 [probe-distance] G38.2 would not move: the probe stands where it is to end",
        ),
        (
            "G91 G38.3 X0 F60",
            "1:5 [probe-distance] G38.3 would not move: the probe stands where it is to end",
        ),
        (
            "G38.2 Z-1",
            "1:1 [feed-missing] the feed is missing: no F has been set; G38.2 needs one",
        ),
        (
            "G31 Z-1 F0",
            "1:1 [feed-missing] the feed is zero; G31 needs one",
        ),
        (
            "G93 G38.4 Z-1 F10",
            "1:5 [conflict] G38.4 does not go with G93: where it ends is not known, so its time is not either",
        ),
        (
            "G53 G38.2 Z-1 F10",
            "1:1 [conflict] G53 goes with G0 and G1 only",
        ),
        (
            "G38.2 G28 Z-1 F10",
            "1:1 [conflict] the axis words belong to G28, not to a motion: split the line",
        ),
        (
            "G38.2 G92 F10",
            "1:1 [conflict] the axis words belong to G92, not to a motion: split the line",
        ),
        (
            "G38.2 M66 P1 L0 Z-1 F10",
            "1:1 [conflict] G38.2 and M66 each wait for an input: split the line",
        ),
        (
            "G38.2 G1 Z-1 F10",
            "1:7 [conflict] G1 and G38.2 exclude each other in a line (group: motion)",
        ),
        (
            "G38.2 Z-101 F10",
            "1:7 [travel] Z would reach -101 mm, beyond its travel of -100 to 100 mm (machine coordinates)",
        ),
        (
            "G38.2 Z-1 Q2 F10",
            "1:11 [unused-word] nothing in this line takes the word Q (G5, G6.2, G10, G64, G73, G83, M19, M61, M66, M67, M68, M100 would)",
        ),
    ];
    for (program, expected) in refused {
        assert_eq!(messages(program), [expected], "{program}");
    }
    let mut config = mill();
    config.probe = None;
    assert_eq!(
        diagnostics(&config, "F60 G31 Z-1\n"),
        ["1:5 G31: this machine has no probe: its file has no [probe]"]
    );
}

#[test]
fn nothing_is_read_ahead_of_a_probe() {
    let mut program = Program::spool("t.ngc", &b"G38.2 Z-8 F60\nG0 X1\n"[..]).unwrap();
    check(&mut program, &mill(), &mut |_, _| Ok(())).unwrap();
    let mut stream = Stream::new(program, &mill()).unwrap();
    let mut items = Vec::new();
    assert!(stream.next_items(&mut items).unwrap());
    let refused = stream.next_items(&mut items).unwrap_err();
    assert_eq!(
        refused.to_string(),
        "t.ngc: the program waits for the result of a probe"
    );
    assert_eq!(items.len(), 1);
    stream.provide_probe(&ProbeResult {
        touched: None,
        rest: AxisVector::ZERO,
    });
    assert!(stream.next_items(&mut items).unwrap());
}

#[test]
fn what_follows_from_a_result_is_left_to_the_run() {
    // The surface is unknown: at the programmed end, Z −100, none of this would fit.
    let program = "G38.2 Z-100 F60\nG10 L20 P1 Z0\nG1 Z-5\n\
        G91 Z-1\n#1=[0 / [#5063 + 100]]\nG90 G2 X[#5063 + 60] I[#5063 / -10] Y#1\nG53 G0 Z-3";
    assert_eq!(diagnostics(&mill(), program), Vec::<String>::new());
    let items = drive(&mill(), program, Some(0.5)).unwrap();
    assert_eq!(ends(&items)[1..3], [[0.0, 0.0, -55.25], [0.0, 0.0, -56.25]]);
    // The run judges it: 5 mm below where the machine rests is too low here.
    let refused = drive(&mill(), program, Some(0.96)).unwrap_err().to_string();
    assert!(
        refused.starts_with("t.ngc:3:4: error: Z would reach -101.25 mm, beyond its travel"),
        "{refused}"
    );
}

#[test]
fn what_does_not_follow_from_a_result_is_judged_at_once() {
    let program = "G38.2 Z-100 F60\nG1 X300\nG53 G1 Z-101\nG44 Z#5063\nG1 Z50\nZ120";
    let found = diagnostics(&mill(), program);
    let lines: Vec<_> = found.iter().map(|text| &text[..2]).collect();
    assert_eq!(lines, ["2:", "3:", "4:", "6:"], "{found:?}");
    let mut program = Program::spool(
        "t.ngc",
        &b"G38.2 Z-9 F60\nG0 X#5063\nX1\nM66 P1 L0\nX#5399\nG38.3 Z-1"[..],
    )
    .unwrap();
    let report = check(&mut program, &mill(), &mut |_, _| Ok(())).unwrap();
    assert_eq!((report.is_ok(), report.open_lines), (true, 3));
}
