// The time constant of each corner from the error that it may have, for the planner block-overlap.
//
// Where two blocks of the feed F overlap for the time T at a turn of the angle a, the corner is rounded by
// F * T * sin(a / 2) / 4. So T = 4 * error / (F * sin(a / 2)) keeps the error. A block has one time constant, which its
// two corners share: the sharper turn decides. Where the axes cannot follow within T, the planner slows down by itself.
import { Block, each, parameter, withoutGeometry } from "../sdk/assemblyscript/tandem-policy";
export { tandem_policy_v2 } from "../sdk/assemblyscript/tandem-policy";

withoutGeometry();
const error = parameter("corner_error_um", 20, 0.5, 1000, "Largest error at a corner, in micrometres");
const longest = parameter("longest_ms", 50, 1, 1000, "Time constant on a straight path, in ms");

// What is asked for, less what the chord between two samples adds.
const AIM: f64 = 0.99;

function tune(block: Block): void {
  if (!block.cuts) return;
  const half = Math.sin(Math.max(block.turn_in_rad, block.turn_out_rad) / 2);
  const within = (AIM * 4e-3 * error.value) / (block.feed_mm_per_s * half);
  block.ask_time_constant_s = Math.min(longest.value * 1e-3, within);
}

export function on_blocks(window: usize, count: i32): void {
  each(window, count, tune);
}
