//! Helpers of the tests: a machine, and items as short text.
#![allow(dead_code, reason = "each test file uses its own part")]

use std::path::PathBuf;

use tandem_gcode::{Config, Diagnostic, Interpreter, Item, ProbeInput, ProbeResult, Program, Tool};
use tandem_sdk::{Axes, AxisVector, Block, BlockKind, Edge, NurbsData, PathMode};

/// X, Y ±250 mm, Z −100 to 100 mm, A without limits; two tools, a probe on
/// input 7.
pub fn mill() -> Config {
    let axes = Axes::new(&[('X', false), ('Y', false), ('Z', false), ('A', true)]).unwrap();
    let mut config = Config::new(axes);
    config.travel_mm[0] = (-250.0, 250.0);
    config.travel_mm[1] = (-250.0, 250.0);
    config.travel_mm[2] = (-100.0, 100.0);
    config.user_commands = vec![100, 101, 199];
    config.probe = Some(ProbeInput {
        input: 7,
        inverted: false,
    });
    for (number, length) in [(1, 20.0), (2, 25.0)] {
        let offset = AxisVector::from_slice(&[0.0, 0.0, length]);
        config.tools.push(Tool {
            number,
            pocket: Some(number),
            offset,
            diameter_mm: 6.0,
        });
    }
    config
}

/// A folder of subroutines, and a machine that knows it.
pub fn with_files(files: &[(&str, &str)]) -> (tempfile::TempDir, Config) {
    let folder = tempfile::tempdir().unwrap();
    for (name, text) in files {
        std::fs::write(folder.path().join(name), text).unwrap();
    }
    let mut config = mill();
    config.subroutine_path.push(folder.path().to_path_buf());
    (folder, config)
}

/// All items of a program without errors.
pub fn run(text: &str) -> Vec<Item> {
    let (items, errors) = run_on(mill(), text);
    assert!(errors.is_empty(), "{}", errors[0]);
    items
}

/// All items and all errors of a program. Every probe touches half way and rests there.
pub fn run_on(config: Config, text: &str) -> (Vec<Item>, Vec<Diagnostic>) {
    let mut interpreter = Interpreter::new(config);
    interpreter.set_file("t.ngc");
    let (mut items, mut errors) = (Vec::new(), Vec::new());
    for (number, line) in (1..).zip(text.lines()) {
        errors.extend(interpreter.line(number, line.as_bytes(), &mut items).err());
        if let Some(Item::Block(block, _)) = items.last().filter(|item| item.is_probe()) {
            let touched = (block.start + block.end) * 0.5;
            interpreter.provide_probe(&ProbeResult {
                touched: Some(touched),
                rest: touched,
            });
        }
    }
    errors.extend(interpreter.finish(&mut items).err());
    (items, errors)
}

/// The blocks of a program without errors.
/// What is wrong with a program, whose subprograms are driven too.
pub fn errors_of(text: &str) -> Vec<Diagnostic> {
    let mut program = Program::spool("program", text.as_bytes()).unwrap();
    let report = tandem_gcode::check(&mut program, &mill(), &mut |_, _| Ok(())).unwrap();
    report.diagnostics
}

pub fn blocks(text: &str) -> Vec<Block> {
    only_blocks(&run(text))
}

pub fn only_blocks(items: &[Item]) -> Vec<Block> {
    let block = |item: &Item| {
        if let Item::Block(block, _) = item {
            Some(*block)
        } else {
            None
        }
    };
    items.iter().filter_map(block).collect()
}

/// Compares the items of a program with one short line each.
pub fn assert_items(program: &str, expected: &[&str]) {
    assert_eq!(shown(&run(program)), expected, "{program}");
}

/// The ends of all blocks in X, Y, Z.
pub fn ends(program: &str) -> Vec<[String; 3]> {
    blocks(program)
        .iter()
        .map(|b| [b.end[0], b.end[1], b.end[2]].map(short))
        .collect()
}

/// The last block of a program.
pub fn last(program: &str) -> Block {
    *blocks(program).last().expect("a block")
}

/// The messages of a program, without the excerpts.
pub fn messages(text: &str) -> Vec<String> {
    let (_, errors) = run_on(mill(), text);
    errors
        .iter()
        .map(|e| format!("{}:{} [{}] {}", e.line, e.column, e.code, e.message))
        .collect()
}

/// One short line per item.
pub fn shown(items: &[Item]) -> Vec<String> {
    items.iter().map(show).collect()
}

fn show(item: &Item) -> String {
    match item {
        Item::Block(block, None) => show_block(block),
        Item::Block(block, Some(curve)) => show_curve(block, curve),
        Item::Event(e) => format!(
            "{}: {:?} {} {} before {}",
            e.line,
            e.kind,
            e.index,
            short(e.value),
            e.before_block
        ),
        Item::Wait(w) => {
            let (input, mode) = (w.input, w.mode);
            format!(
                "{}: Wait {input:?} {mode:?} {} before {}",
                w.line,
                short(w.timeout_s),
                w.before_block
            )
        }
        Item::Command(c) => format!(
            "{}: Command {} {:?} {:?} before {}",
            c.line, c.number, c.p, c.q, c.before_block
        ),
        Item::Stated { which, value } => format!("stated {which} {}", short(*value)),
        Item::End => "End".into(),
    }
}

fn show_curve(block: &Block, data: &NurbsData) -> String {
    let numbers = |values: &[f64]| {
        values
            .iter()
            .map(|v| short(*v))
            .collect::<Vec<_>>()
            .join(" ")
    };
    let points: Vec<_> = data
        .control_points
        .iter()
        .map(|p| numbers(&p.0[..3]))
        .collect();
    let block = show_block(block);
    let (degree, weights, knots) = (data.degree, numbers(&data.weights), numbers(&data.knots));
    format!(
        "{block} degree {degree} points {} weights {weights} knots {knots}",
        points.join(", ")
    )
}

fn show_block(block: &Block) -> String {
    let end: Vec<_> = block.end.0[..4].iter().map(|v| short(*v)).collect();
    let mut text = format!(
        "{}: {:?} {} to {}",
        block.line,
        block.kind,
        block.index,
        end.join(" ")
    );
    let how = match block.kind {
        BlockKind::Dwell => format!(" for {}", short(block.dwell_s)),
        BlockKind::Rapid => String::new(),
        _ => format!(
            " length {} feed {}",
            short(block.length_mm),
            short(block.feed_mm_per_s)
        ),
    };
    text += &how;
    if block.kind == BlockKind::Arc {
        let (arc, [a, b]) = (&block.arc, block.arc.center_mm.map(short));
        let (radius, sweep) = (short(arc.radius_mm), short(arc.sweep_rad.to_degrees()));
        text += &[
            " about ", &a, " ", &b, " radius ", &radius, " sweep ", &sweep,
        ]
        .concat();
    }
    if block.path_mode == PathMode::ExactStop {
        text += " exact";
    }
    let stop_on = &block.stop_on;
    if stop_on.edge != Edge::None {
        let fault = if stop_on.miss_is_fault == 1 {
            " or fault"
        } else {
            ""
        };
        text += &[
            " until ",
            &format!("{:?} {}", stop_on.edge, stop_on.input),
            fault,
        ]
        .concat();
    }
    text
}

pub fn short(value: f64) -> String {
    let text = format!("{value:.3}");
    let text = text.trim_end_matches('0').trim_end_matches('.').to_owned();
    if text == "-0" { "0".into() } else { text }
}

/// The folder of program fixtures.
pub fn programs() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../tests/fixtures/programs")
}
