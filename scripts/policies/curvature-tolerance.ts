// Small features are cut exactly, long sweeps smoothly: the path tolerance of a block is a share of its smallest radius, or of
// the radius that its corners have on the scale of its length. It never exceeds the tolerance in force, unless the machine
// file allows more by `policy.path_tolerance_mm`.
import { Block, each, parameter, withoutGeometry } from "../sdk/assemblyscript/tandem-policy";
export { tandem_policy_v2 } from "../sdk/assemblyscript/tandem-policy";

withoutGeometry();
const share = parameter("share_of_radius", 0.001, 0.00001, 0.1, "Path tolerance as a share of the smallest radius");
const finest = parameter("finest_um", 1, 0.1, 1000, "Smallest path tolerance, in micrometres");
const coarsest = parameter("coarsest_um", 50, 0.1, 1000, "Largest path tolerance, in micrometres");

function tune(block: Block): void {
  if (!block.cuts) return;
  // A polygon of chords of the length l that turns by a at each corner has the radius l / a.
  const turn = Math.max(block.turn_in_rad, block.turn_out_rad);
  const curvature = Math.max(block.curvature_per_mm, turn / Math.max(block.length_mm, 1e-6));
  const wanted = share.value / Math.max(curvature, 1e-9);
  block.ask_path_tolerance_mm = Math.max(finest.value, Math.min(coarsest.value, wanted * 1e3)) * 1e-3;
}

export function on_blocks(window: usize, count: i32): void {
  each(window, count, tune);
}
