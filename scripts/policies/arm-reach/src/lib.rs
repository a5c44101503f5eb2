//! A SCARA arm whose tool passes near the edge of its reach, or near its own shoulder, is driven there only as fast as its joints
//! can turn: the nearer it is to being stretched or folded, the faster a joint turns for the same speed of the tool.
#![no_std]

#[path = "../../../sdk/rust/src/tandem_policy.rs"]
mod tandem_policy;

use tandem_policy::{Block, Input, LINE, Parameter, axis, parameter, policy};

static PARAMETERS: [Parameter; 5] = [
    parameter("upper_arm_mm", 250.0, 1.0, 10000.0, "Shoulder to elbow, in mm"),
    parameter("forearm_mm", 200.0, 1.0, 10000.0, "Elbow to tool, in mm"),
    parameter("shoulder_x_mm", 0.0, -10000.0, 10000.0, "The shoulder, machine coordinate, in mm"),
    parameter("shoulder_y_mm", 0.0, -10000.0, 10000.0, "The shoulder, machine coordinate, in mm"),
    parameter("joint_deg_per_s", 90.0, 0.1, 10000.0, "How fast shoulder and elbow may turn together, in degrees/s"),
];

static INPUTS: [Input; 2] = [axis("x"), axis("y")];

policy!(PARAMETERS, inputs: INPUTS, blocks: tune);

fn tune(block: &mut Block) {
    if !block.cuts() {
        return;
    }
    let [shoulder_x, shoulder_y] = [PARAMETERS[2].value(), PARAMETERS[3].value()];
    let at = |values: &[f64; 8]| [INPUTS[0].of(values) - shoulder_x, INPUTS[1].of(values) - shoulder_y];
    let (start, end) = (at(&block.start), at(&block.end));
    let way = [end[0] - start[0], end[1] - start[1]];
    let square = way[0] * way[0] + way[1] * way[1];
    // Where the chord is nearest to the shoulder.
    let share = if square > 0.0 { (-(start[0] * way[0] + start[1] * way[1]) / square).clamp(0.0, 1.0) } else { 0.0 };
    let near = length([start[0] + share * way[0], start[1] + share * way[1]]);
    let far = length(start).max(length(end));
    // No place of a curve is farther from its chord than half of its length.
    let away = if block.kind == LINE { 0.0 } else { 0.5 * block.length_mm };
    // Between a folded and a stretched arm the joints are the better for it: the ends are the worst.
    let most = mm_per_rad(near - away).min(mm_per_rad(far + away)) * PARAMETERS[4].value().to_radians();
    if most < block.feed_mm_per_s {
        // A tool that the arm cannot reach is for the kinematics to refuse.
        block.ask_feed_cap_mm_per_s = most.max(0.01);
    }
}

fn length([x, y]: [f64; 2]) -> f64 {
    square_root(x * x + y * y)
}

/// How far the tool moves at least while the joints turn by 1 rad together, with the tool `reach_mm` from the shoulder: the lesser
/// singular value of the arm's Jacobian.
fn mm_per_rad(reach_mm: f64) -> f64 {
    let [upper, fore] = [PARAMETERS[0].value(), PARAMETERS[1].value()];
    let cos = (reach_mm * reach_mm - upper * upper - fore * fore) / (2.0 * upper * fore);
    let determinant = upper * fore * square_root(1.0 - cos * cos);
    let squares = reach_mm * reach_mm + fore * fore;
    let spread = square_root(squares * squares - 4.0 * determinant * determinant);
    square_root(0.5 * (squares - spread))
}

/// The root of what is above zero, else 0: `core` has none.
fn square_root(value: f64) -> f64 {
    if value <= 0.0 {
        return 0.0;
    }
    // Half of the exponent, then Newton's steps.
    let mut root = f64::from_bits((value.to_bits() >> 1) + (1023 << 51));
    for _ in 0..5 {
        root = 0.5 * (root + value / root);
    }
    root
}
