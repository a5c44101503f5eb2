//! Any bytes as a part program: both passes, on a machine with four axes.

use tandem_gcode::Tool;
use tandem_gcode::{Config, Item, ProbeInput, ProbeResult, Program, ProgramError, Stream, check};
use tandem_sdk::{Axes, AxisVector, Block, BlockKind, Curve};

fn config() -> Config {
    let axes =
        Axes::new(&[('X', false), ('Y', false), ('Z', false), ('A', true)]).expect("four axes");
    let mut config = Config::new(axes);
    config.travel_mm[0] = (-1000.0, 1000.0);
    config.probe = Some(ProbeInput {
        input: 0,
        inverted: false,
    });
    config.tool_change.retract_z_mm = Some(50.0);
    config.max_steps = 10_000;
    config.user_commands.extend([101, 150]);
    for number in [1, 2] {
        let offset = AxisVector::from_slice(&[0.0, 0.0, 20.0]);
        config.tools.push(Tool {
            number,
            pocket: Some(number),
            offset,
            diameter_mm: 2.0,
        });
    }
    config
}

/// What a planner relies on.
fn assert_sound(block: &Block) {
    assert!(
        block.start.is_finite() && block.end.is_finite() && block.length_mm.is_finite(),
        "{block:?}"
    );
    assert_eq!(
        block.length_mm > 0.0,
        block.kind != BlockKind::Dwell,
        "{block:?}"
    );
    assert!(
        block.feed_mm_per_s > 0.0 && block.dwell_s >= 0.0,
        "{block:?}"
    );
    if block.kind == BlockKind::Arc {
        assert!(
            block.arc.radius_mm > 0.0
                && block.arc.sweep_rad.is_finite()
                && block.arc.sweep_rad != 0.0,
            "{block:?}"
        );
    }
}

/// Judges one input.
///
/// # Panics
/// The reader broke what it promises.
pub fn judge(bytes: &[u8]) {
    let mut program = Program::spool("fuzz", bytes).expect("a temporary file");
    let report = check(
        &mut program,
        &config(),
        &mut |block: &Block, _: Option<Curve<'_>>| {
            assert_sound(block);
            Ok(())
        },
    )
    .expect("readable");
    for diagnostic in &report.diagnostics {
        assert!(
            diagnostic.to_string().len() < 2000 && diagnostic.line <= report.lines.max(1) + 65_536
        );
    }
    if !report.is_ok() {
        return;
    }
    let mut stream = Stream::new(program, &config()).expect("checked");
    let (mut items, mut blocks, mut probed) = (Vec::new(), 0, false);
    loop {
        items.clear();
        match stream.next_items(&mut items) {
            Ok(true) => {}
            Ok(false) => break,
            // What a probe touches decides whether the rest can be driven.
            Err(ProgramError::Text(_)) if probed || report.seen_to.is_some() => return,
            Err(error) => panic!("{error}"),
        }
        blocks += items
            .iter()
            .filter(|item| matches!(item, Item::Block(..)))
            .count() as u64;
        if items.iter().any(|item| matches!(item, Item::Wait(_))) {
            stream.provide_input(-1.0);
        }
        if let Some(Item::Block(block, _)) = items.iter().find(|item| item.is_probe()) {
            probed = true;
            let at = (block.start + block.end) * 0.5;
            stream.provide_probe(&ProbeResult {
                touched: Some(at),
                rest: at,
            });
        }
    }
    assert!(probed || report.seen_to.is_some() || blocks == report.blocks);
}
