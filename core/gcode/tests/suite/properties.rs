//! Properties that hold for every program, tried on random ones.

use crate::common;

use std::f64::consts::TAU;
use std::fmt::Write as _;

use common::{blocks, mill, only_blocks, run_on};
use proptest::prelude::*;
use tandem_gcode::{Diagnostic, Interpreter, Item, ProbeResult, Program, Stream, check};
use tandem_sdk::{Block, BlockKind};

/// An expression as a tree, with an evaluator that shares nothing with the interpreter.
#[derive(Clone, Debug)]
enum Tree {
    Value(f64),
    Call(&'static str, Box<Tree>),
    Pair(&'static str, u8, Box<Tree>, Box<Tree>),
}

const OPERATORS: [(&str, u8); 15] = [
    ("**", 5),
    ("*", 4),
    ("/", 4),
    ("MOD", 4),
    ("+", 3),
    ("-", 3),
    ("EQ", 2),
    ("NE", 2),
    ("GT", 2),
    ("GE", 2),
    ("LT", 2),
    ("LE", 2),
    ("AND", 1),
    ("OR", 1),
    ("XOR", 1),
];

fn tree() -> impl Strategy<Value = Tree> {
    let value = (0..2000u32).prop_map(|n| Tree::Value(f64::from(n) / 8.0));
    value.prop_recursive(5, 40, 2, |inner| {
        let call = prop::sample::select(vec!["ABS", "SIN", "COS", "FIX", "FUP", "ROUND", "SQRT"]);
        prop_oneof![
            (call, inner.clone()).prop_map(|(name, tree)| Tree::Call(name, tree.into())),
            (
                prop::sample::select(OPERATORS.to_vec()),
                inner.clone(),
                inner
            )
                .prop_map(|((name, strength), a, b)| Tree::Pair(
                    name,
                    strength,
                    a.into(),
                    b.into()
                )),
        ]
    })
}

/// Writes with as few brackets as the precedence allows.
fn write(tree: &Tree, least: u8, text: &mut String) {
    match tree {
        Tree::Value(value) => write!(text, "{value}").unwrap(),
        Tree::Call(name, tree) => {
            write!(text, "{name}[").unwrap();
            write(tree, 1, text);
            text.push(']');
        }
        Tree::Pair(name, strength, a, b) => {
            let bracket = *strength < least;
            text.push_str(if bracket { "[" } else { "" });
            write(a, *strength, text);
            write!(text, " {name} ").unwrap();
            write(b, strength + 1, text);
            text.push_str(if bracket { "]" } else { "" });
        }
    }
}

/// `None` where there is no finite value.
fn evaluate(tree: &Tree) -> Option<f64> {
    let value = match tree {
        Tree::Value(value) => *value,
        Tree::Call(name, tree) => {
            let x = evaluate(tree)?;
            match *name {
                "ABS" => x.abs(),
                "SIN" => x.to_radians().sin(),
                "COS" => x.to_radians().cos(),
                "FIX" => x.floor(),
                "FUP" => x.ceil(),
                "ROUND" => (x.abs() + 0.5).floor() * x.signum(),
                _ => (x >= 0.0).then(|| x.sqrt())?,
            }
        }
        Tree::Pair(name, _, a, b) => pair(name, evaluate(a)?, evaluate(b)?)?,
    };
    value.is_finite().then_some(value)
}

/// Whether the last bit of something reckoned decides what it is rounded to: nobody says which of two numbers is right.
fn is_at_an_edge(tree: &Tree) -> bool {
    match tree {
        Tree::Value(_) => false,
        Tree::Call(name, inner) => {
            let edge = match *name {
                "ROUND" => 0.5,
                "FIX" | "FUP" => 0.0,
                _ => return is_at_an_edge(inner),
            };
            let is_near = |x: f64| ((x - edge) - (x - edge).round()).abs() < 1e-9;
            let is_reckoned = !matches!(**inner, Tree::Value(_));
            is_at_an_edge(inner) || is_reckoned && evaluate(inner).is_some_and(is_near)
        }
        Tree::Pair(_, _, a, b) => is_at_an_edge(a) || is_at_an_edge(b),
    }
}

fn pair(name: &str, a: f64, b: f64) -> Option<f64> {
    let truth = |yes: bool| if yes { 1.0 } else { 0.0 };
    Some(match name {
        "**" => a.powf(b),
        "*" => a * b,
        "/" => (b != 0.0).then(|| a / b)?,
        "MOD" => {
            let rest = (b != 0.0).then(|| a % b)?;
            if rest < 0.0 { rest + b.abs() } else { rest }
        }
        "+" => a + b,
        "-" => a - b,
        "EQ" => truth((a - b).abs() < 1e-4),
        "NE" => truth((a - b).abs() >= 1e-4),
        "GT" => truth(a > b),
        "GE" => truth(a >= b),
        "LT" => truth(a < b),
        "LE" => truth(a <= b),
        "AND" => truth(a != 0.0 && b != 0.0),
        "OR" => truth(a != 0.0 || b != 0.0),
        _ => truth((a != 0.0) != (b != 0.0)),
    })
}

/// Words that make sense often enough to reach deep, and bytes that do not.
fn line() -> impl Strategy<Value = Vec<u8>> {
    let codes = "G0 G1 G2 G3 G4 G10 G17 G18 G19 G20 G21 G28 G28.1 G30 G40 G43 G49 G53 G54 G59.3 G61 G64 G80 \
        G90 G91 G31 G38.2 G38.3 G38.4 G90.1 G91.1 G92 G92.1 G92.2 G92.3 G93 G94 M0 M1 M3 M4 M5 M6 M7 M8 M9 M48 M49 M50 M62 M63 M66 TA \
        #7 X#7 X#5061 % / ( ) ; G41 G81 M98 O";
    let codes: Vec<_> = codes.split(' ').collect();
    let letters = prop::sample::select("XYZABIJKRPQLHFSTNE#".chars().collect::<Vec<_>>());
    let word = (letters, -3000..3000i32).prop_map(|(letter, n)| match letter {
        'P' | 'L' | 'H' | 'T' | 'F' | 'S' => format!("{letter}{}", n.abs() % 12),
        '#' => format!("#{}=[{n}/16]", n.abs() % 40 + 1),
        _ => format!("{letter}{}", f64::from(n) / 16.0),
    });
    let expression = tree().prop_map(|t| {
        let mut text = String::from("X[");
        write(&t, 1, &mut text);
        text + "]"
    });
    let piece = prop_oneof![
        8 => prop::sample::select(codes).prop_map(|c| c.as_bytes().to_vec()),
        12 => word.prop_map(String::into_bytes),
        1 => expression.prop_map(String::into_bytes),
        1 => prop::collection::vec(any::<u8>(), 0..6),
    ];
    prop::collection::vec(piece, 0..6).prop_map(|pieces| pieces.join(&b' '))
}

/// Straight lines, some of them wrong.
fn straight_line() -> impl Strategy<Value = Vec<u8>> {
    r"(G[01] ?)?([XYZA]-?[0-9]{1,2}(\.[0-9]{0,5})? ?){1,4}".prop_map(String::into_bytes)
}

/// O-words with few labels, so that they often belong together.
fn o_line() -> impl Strategy<Value = Vec<u8>> {
    let keywords = "sub endsub return call if elseif else endif while endwhile do repeat endrepeat break continue";
    let keyword = prop::sample::select(keywords.split(' ').collect::<Vec<_>>());
    let value = prop::sample::select(vec![
        "",
        " [#1 LT 3]",
        " [1]",
        " [0]",
        " [#31]",
        " [2] [3]",
        " [1/0]",
        " x",
    ]);
    (1..4, keyword, value)
        .prop_map(|(label, keyword, value)| format!("o{label} {keyword}{value}").into_bytes())
}

/// Counts, and moves a little.
fn step() -> impl Strategy<Value = Vec<u8>> {
    Just(b"#1=[#1+1] #31=1 G91 G0 X0.1".to_vec())
}

fn point(block: &Block, share: f64) -> [f64; 2] {
    let angle = block.arc.start_angle_rad + share * block.arc.sweep_rad;
    let [a, b] = block.arc.center_mm;
    [
        a + block.arc.radius_mm * angle.cos(),
        b + block.arc.radius_mm * angle.sin(),
    ]
}

/// What the planner may rely on.
fn assert_sound(blocks: &[Block], gaps: bool) {
    for (n, block) in blocks.iter().enumerate() {
        assert_eq!(block.index, n as u64);
        assert!(block.start.is_finite() && block.end.is_finite() && block.length_mm.is_finite());
        assert_eq!(
            block.length_mm > 0.0,
            block.kind != BlockKind::Dwell,
            "{block:?}"
        );
        assert!(block.feed_mm_per_s > 0.0 && block.dwell_s >= 0.0);
        assert!(block.time_constant_s.is_nan() || block.time_constant_s > 0.0);
        assert!(block.path_tolerance_mm.is_nan() || block.path_tolerance_mm >= 0.0);
        assert!(gaps || n == 0 || blocks[n - 1].end == block.start);
        if block.kind == BlockKind::Arc {
            let [a, b] = block.arc.plane.map(|axis| axis as usize);
            let scale = 1e-9
                * (1.0
                    + block.arc.radius_mm
                    + block.arc.center_mm[0].abs()
                    + block.arc.center_mm[1].abs());
            for (share, end) in [(0.0, block.start), (1.0, block.end)] {
                let [x, y] = point(block, share);
                assert!(
                    (x - end[a]).hypot(y - end[b]) < scale * (1.0 + block.arc.sweep_rad.abs()),
                    "{block:?}"
                );
            }
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 2000, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn no_line_panics_and_every_block_is_sound(lines in prop::collection::vec(line(), 0..40)) {
        let mut interpreter = Interpreter::new(mill());
        let (mut items, mut errors) = (Vec::new(), 0);
        for (number, line) in (1..).zip(&lines) {
            if let Err(error) = interpreter.line(number, line, &mut items) {
                errors += 1;
                prop_assert!(error.column <= error.end_column && error.to_string().contains("error: "));
            }
        }
        errors += u32::from(interpreter.finish(&mut items).is_err());
        assert_sound(&only_blocks(&items), errors > 0);
    }

    /// A line that holds nothing but where it goes straight is executed in a shorter way than one with a comment.
    #[test]
    fn a_comment_behind_a_line_changes_nothing(
        lines in prop::collection::vec(prop_oneof![2 => straight_line(), 1 => line()], 0..40),
        straight in prop::collection::vec(straight_line(), 1..20),
    ) {
        let (mut plain, mut commented) = (Interpreter::new(mill()), Interpreter::new(mill()));
        let (mut items, mut expected) = (Vec::new(), Vec::new());
        let setting = [b"F100 G1".to_vec()];
        for (number, line) in (1..).zip(setting.iter().chain(&lines).chain(&straight)) {
            let with_comment = [line, &b";"[..]].concat();
            let goes_straight = line.iter().all(|b| b"GXYZA0123456789 .-".contains(b));
            let other = if goes_straight { &with_comment } else { line };
            let said = |result: Result<(), Diagnostic>| {
                result.map_err(|error| (error.code, error.column, error.end_column, error.message))
            };
            prop_assert_eq!(
                said(plain.line(number, line, &mut items)),
                said(commented.line(number, other, &mut expected))
            );
            prop_assert_eq!(plain.position(), commented.position());
        }
        prop_assert_eq!(format!("{items:?}"), format!("{expected:?}"));
    }

    #[test]
    fn any_bytes_are_read_or_refused(bytes in prop::collection::vec(any::<u8>(), 0..400)) {
        let mut program = Program::spool("bytes", &bytes[..]).unwrap();
        let report = check(&mut program, &mill(), &mut |_, _| Ok(())).unwrap();
        if report.is_ok() {
            let mut stream = Stream::new(program, &mill()).unwrap();
            let mut items = Vec::new();
            while stream.next_items(&mut items).unwrap() {}
            prop_assert_eq!(only_blocks(&items).len() as u64, report.blocks);
        }
    }

    #[test]
    fn a_checked_program_runs_or_is_refused_whatever_its_probes_touch(
        lines in prop::collection::vec(line(), 0..40), share in prop::option::of(0.0..1.0f64),
    ) {
        let text = [&b"F100\nG38.3 X9 Y-7\n#7=#5061\n"[..], &lines.join(&b'\n')].concat();
        let mut program = Program::spool("lines", &text[..]).unwrap();
        let report = check(&mut program, &mill(), &mut |_, _| Ok(())).unwrap();
        if report.is_ok() {
            let mut stream = Stream::new(program, &mill()).unwrap();
            let mut items = Vec::new();
            while let Ok(true) = stream.next_items(&mut items) {
                let probe = items.iter().rfind(|item| item.is_probe());
                if let Some(Item::Block(block, _)) = probe {
                    let at = block.start + (block.end - block.start) * share.unwrap_or(1.0);
                    stream.provide_probe(&ProbeResult { touched: share.map(|_| at), rest: at });
                }
                stream.provide_input(1.0);
            }
            assert_sound(&only_blocks(&items), true);
        }
    }

    #[test]
    fn o_words_in_any_order_end_and_run_as_they_were_checked(
        lines in prop::collection::vec(prop_oneof![1 => line(), 1 => step(), 4 => o_line()], 0..40),
    ) {
        let mut config = mill();
        config.max_steps = 2000;
        let mut program = Program::spool("o-words", &lines.join(&b'\n')[..]).unwrap();
        let report = check(&mut program, &config, &mut |_, _| Ok(())).unwrap();
        if report.is_ok() && report.seen_to.is_none() && report.open_lines == 0 {
            let mut stream = Stream::new(program, &config).unwrap();
            let mut items = Vec::new();
            while let Ok(true) = stream.next_items(&mut items) {
                if items.last().is_some_and(Item::is_probe) {
                    return Ok(());
                }
                stream.provide_input(1.0);
            }
            let curves = items.iter().filter(|item| matches!(item, Item::Block(_, Some(_)))).count();
            prop_assert_eq!((only_blocks(&items).len() + curves) as u64, report.blocks);
        }
    }

    #[test]
    fn expressions_are_what_another_evaluator_says(tree in tree()) {
        prop_assume!(!is_at_an_edge(&tree));
        let mut text = String::from("#1=[");
        write(&tree, 1, &mut text);
        text += "]\nG0 Y1 X[#1 * 0 + FIX[#1 / 1000] MOD 200] Z[#1 MOD 100]";
        let (items, errors) = run_on(mill(), &text);
        match evaluate(&tree) {
            None => prop_assert!(!errors.is_empty(), "{}", text),
            Some(value) => {
                prop_assert!(errors.is_empty(), "{}: {}", text, errors[0]);
                let near = |a: f64, b: f64| (a - b).abs() <= 1e-9 * (1.0 + value.abs());
                let end = only_blocks(&items)[0].end;
                prop_assert!(near(end[2], value.rem_euclid(100.0)) || near((end[2] - value.rem_euclid(100.0)).abs(), 100.0));
            }
        }
    }

    #[test]
    fn arcs_end_where_they_are_programmed(
        r in 0.5..100.0f64, a in 0.0..TAU, sweep in 0.1..6.2f64, clockwise: bool, inch: bool, plane in 0..3usize,
    ) {
        let unit = if inch { 25.4 } else { 1.0 };
        let round = |v: f64| (v / unit * 10_000.0).round() / 10_000.0;
        let b = if clockwise { a - sweep } else { a + sweep };
        let (first, second, i, j) = [('X', 'Y', 'I', 'J'), ('Z', 'X', 'K', 'I'), ('Y', 'Z', 'J', 'K')][plane];
        let [x, y] = [r * b.cos() - r * a.cos(), r * b.sin() - r * a.sin()].map(round);
        let [ci, cj] = [-r * a.cos(), -r * a.sin()].map(round);
        let (g, units) = (if clockwise { 2 } else { 3 }, if inch { 20 } else { 21 });
        let text = format!("G{units} G{} F100\nG{g} {first}{x} {second}{y} {i}{ci} {j}{cj}", 17 + plane);
        let mut config = mill();
        config.travel_mm = [(f64::NEG_INFINITY, f64::INFINITY); 8];
        let (items, errors) = run_on(config, &text);
        prop_assert!(errors.is_empty(), "{}", errors[0]);
        let arcs = only_blocks(&items);
        let block = *arcs.last().unwrap();
        let swept: f64 = arcs.iter().map(|b| b.arc.sweep_rad.abs()).sum();
        let axes = block.arc.plane.map(|axis| axis as usize);
        prop_assert_eq!([block.end[axes[0]], block.end[axes[1]]], [x * unit, y * unit]);
        prop_assert!((swept - sweep).abs() < 0.01, "{} {}", swept, sweep);
        for (n, arc) in arcs.iter().enumerate().filter(|_| sweep > 1.0) {
            prop_assert!((arc.arc.radius_mm - r).abs() < 0.01, "{} {} {}", n, arc.arc.radius_mm, r);
        }
        assert_sound(&arcs, false);
    }

    #[test]
    fn offsets_shift_and_units_scale(
        x in -50.0..50.0f64, g54 in -50.0..50.0f64, g92 in -50.0..50.0f64, tool in 0..3u32, inch: bool,
    ) {
        let unit = if inch { 25.4 } else { 1.0 };
        let lines = format!("G10 L2 P1 Z{g54:.3}\nG43 H{tool}\nG92 Z{g92:.3}\nG92.2\nG92.3\nG2{} G0 Z{:.4} X1", u8::from(!inch), x / unit);
        let mut config = mill();
        config.travel_mm[2] = (-500.0, 500.0);
        let (items, errors) = run_on(config, &lines);
        prop_assert!(errors.is_empty());
        // The machine stood at zero when G92 called that place `g92`, whatever the other offsets were.
        let (wanted, end) = (x - g92, only_blocks(&items)[0].end[2]);
        prop_assert!((end - wanted).abs() < 0.003, "{} {}", end, wanted);
        prop_assert!((only_blocks(&items)[0].offset[2] + g92).abs() < 0.001);
    }

    #[test]
    fn inverse_time_takes_its_time(x in 0.1..100.0f64, a in 0.0..90.0f64, f in 0.1..100.0f64) {
        let block = blocks(&format!("G93 G1 X{x:.3} A{a:.3} F{f:.4}"))[0];
        let wanted = 60.0 / format!("{f:.4}").parse::<f64>().unwrap();
        prop_assert!((block.length_mm / block.feed_mm_per_s - wanted).abs() < 1e-9 * wanted);
    }
}
