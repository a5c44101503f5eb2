// The highest feed of a material, from this machine's table, and less of it in tight curves. The feed of the program
// stands where it is lower. The program says what the material is, `(material: steel)` or `#<material> = 2`; where it does
// not, the machine file does.
import { Block, each, parameter, program, withoutGeometry } from "../sdk/assemblyscript/tandem-policy";
export { tandem_policy_v2 } from "../sdk/assemblyscript/tandem-policy";

withoutGeometry();
const stated = program("material", "aluminium, brass, steel, stainless");
const material = parameter("material", 0, 0, 3, "0 aluminium, 1 brass, 2 steel, 3 stainless steel");
const scale = parameter("scale", 1, 0.1, 2, "Factor on the whole table");

// Highest feed on a straight path, mm/min, and the radius below which the feed falls with it, mm.
const FEED: StaticArray<f64> = [3000, 2400, 1200, 800];
const RADIUS: StaticArray<f64> = [2, 2, 4, 5];

function tune(block: Block): void {
  if (!block.cuts) return;
  const said = block.program(stated);
  const row = <i32>(said >= 0 && said <= 3 ? said : material.value);
  const straight = (FEED[row] * scale.value) / 60;
  const bend = Math.max(1, RADIUS[row] * block.curvature_per_mm);
  const most = straight / bend;
  if (most < block.feed_mm_per_s) block.ask_feed_cap_mm_per_s = most;
}

export function on_blocks(window: usize, count: i32): void {
  each(window, count, tune);
}
