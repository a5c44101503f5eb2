//! Blocks with a sharp turn at either end are driven at most at a feed of the machine's own.
#![no_std]

mod tandem_policy;

use tandem_policy::{Block, Parameter, parameter, policy};

/// `[policy.parameters]` of the machine file: name, default, lowest, highest, what it means.
static PARAMETERS: [Parameter; 2] = [
    parameter("sharp_turn_deg", 30.0, 1.0, 180.0, "Turn from which a corner counts as sharp, in degrees"),
    parameter("sharp_feed_mm_per_min", 1200.0, 1.0, 100000.0, "Highest feed beside a sharp corner, in mm/min"),
];

policy!(PARAMETERS, blocks: tune);

/// Called for every block, in the order of the program. What is not asked for stays as it is.
fn tune(block: &mut Block) {
    let sharpest = block.turn_in_rad.max(block.turn_out_rad);
    if block.cuts() && sharpest.to_degrees() >= PARAMETERS[0].value() {
        block.ask_feed_cap_mm_per_s = PARAMETERS[1].value() / 60.0;
    }
}
