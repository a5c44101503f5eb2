//! Blocks and periods on which scripts are tried.

use tandem_policy::{InputKind, Instance, MAX_SCRIPT_SIGNALS, Period};
use tandem_sdk::{ArcGeometry, AxisVector, Block, BlockKind};

/// A window of 64 blocks: a rapid, a zigzag of lines with turns of every size, arcs between them.
pub fn window() -> Vec<Block> {
    let mut at = AxisVector::ZERO;
    let mut next = |index: u64| {
        let block = block(index, at);
        at = block.end;
        block
    };
    (0..64).map(&mut next).collect()
}

fn block(index: u64, start: AxisVector) -> Block {
    let angle = (index * index * 7 % 180) as f64 / 90.0;
    let length_mm = 0.5 + (index % 9) as f64;
    let end = start + AxisVector::from_slice(&[length_mm * angle.cos(), length_mm * angle.sin()]);
    let line = Block {
        kind: if index == 0 {
            BlockKind::Rapid
        } else {
            BlockKind::Line
        },
        index,
        line: index as u32 + 1,
        end,
        offset: AxisVector::from_slice(&[10.0, 20.0, 30.0]),
        length_mm,
        feed_mm_per_s: if index == 0 { f64::INFINITY } else { 40.0 },
        tool: 1 + index as u32 / 32,
        spindle_rad_per_s: 500.0,
        ..Block::at(start)
    };
    if index % 8 == 7 {
        half_turn(&line)
    } else {
        line
    }
}

/// The half circle over the chord of `line`.
fn half_turn(line: &Block) -> Block {
    let (center, ray) = ((line.start + line.end) * 0.5, (line.start - line.end) * 0.5);
    let arc = ArcGeometry {
        plane: [0, 1],
        center_mm: [center[0], center[1]],
        radius_mm: line.length_mm / 2.0,
        start_angle_rad: ray[1].atan2(ray[0]),
        sweep_rad: std::f64::consts::PI,
    };
    Block {
        kind: BlockKind::Arc,
        arc,
        length_mm: std::f64::consts::PI * arc.radius_mm,
        ..*line
    }
}

/// A rough period under a load that rises and falls with `index`.
pub fn period(index: u64) -> Period {
    let load = 1.0 + 0.5 * (index as f64 / 10.0).sin();
    Period {
        line: index as u32 + 1,
        period: index,
        duration_s: 0.008,
        feed_mm_per_s: 40.0,
        programmed_feed_mm_per_s: 40.0,
        following_error_mm: 0.01,
        max_following_error_mm: 0.02,
        cutting_torque_nm: load,
        reference_torque_nm: 1.0,
        spindle_load: 0.5 * load,
        spindle_rad_per_s: 500.0,
        distance_left_mm: 1000.0,
        current_a: AxisVector([load; 8]),
        position: AxisVector([index as f64; 8]),
        speed: AxisVector([20.0; 8]),
        axis_error: AxisVector([0.01 * load; 8]),
        max_axis_error: AxisVector([0.02 * load; 8]),
        signals: [50.0 * load; MAX_SCRIPT_SIGNALS],
        sigma: 1.0,
        ..Period::default()
    }
}

/// The signals that a script asks for, as though the machine had all of them.
pub fn signals(instance: &Instance) -> Vec<String> {
    let inputs = instance.inputs().iter();
    inputs
        .filter(|input| input.kind == InputKind::Signal)
        .map(|input| input.name.clone())
        .collect()
}
