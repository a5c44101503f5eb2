// Blocks with a sharp turn at either end are driven at most at a feed of the machine's own.
import { Block, each, parameter } from "./tandem-policy";
export { tandem_policy_v2 } from "./tandem-policy";

// [policy.parameters] of the machine file: name, default, lowest, highest, what it means.
const turn = parameter("sharp_turn_deg", 30, 1, 180, "Turn from which a corner counts as sharp, in degrees");
const feed = parameter("sharp_feed_mm_per_min", 1200, 1, 100000, "Highest feed beside a sharp corner, in mm/min");

// Called for every block, in the order of the program. What is not asked for stays as it is.
function tune(block: Block): void {
  if (!block.cuts) return;
  const sharpest = Math.max(block.turn_in_rad, block.turn_out_rad);
  if (sharpest >= (turn.value * Math.PI) / 180) block.ask_feed_cap_mm_per_s = feed.value / 60;
}

export function on_blocks(window: usize, count: i32): void {
  each(window, count, tune);
}
