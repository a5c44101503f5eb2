// Tandem policy scripts in AssemblyScript: ABI version 1.
//
// A script imports what it needs from here, exports `tandem_policy_v1` again, and exports `on_blocks`, `on_period` or
// both. `each` turns a window into calls of a function of one block. docs/policies.md explains every number.

/** Kinds of a block. */
export const RAPID: u32 = 0;
export const LINE: u32 = 1;
export const ARC: u32 = 2;
export const NURBS: u32 = 3;
export const DWELL: u32 = 4;

/** Flags of a block: the machine is at rest at its start, at its end. */
export const STARTS_AT_REST: u32 = 1;
export const ENDS_AT_REST: u32 = 2;

/** One block. What begins with `ask_` is the answer; what is not written stays as it is. */
@unmanaged
export class Block {
  private size: u32;
  /** Line of the part program. */
  line: u32;
  /** RAPID, LINE, ARC, NURBS or DWELL. */
  kind: u32;
  /** Tool in the spindle. */
  tool: u32;
  /** STARTS_AT_REST, ENDS_AT_REST. */
  flags: u32;
  private reserved: u32;
  /** Length of the path. */
  length_mm: f64;
  /** Feed that may be driven; infinite for a rapid. */
  feed_mm_per_s: f64;
  /** Angle between the block before and this: 0 is straight on, pi a reversal. */
  turn_in_rad: f64;
  /** Angle between this block and the next. */
  turn_out_rad: f64;
  /** Largest curvature; 0 for a line. */
  curvature_per_mm: f64;
  /** Spindle speed commanded. */
  spindle_rad_per_s: f64;
  /** Time constant in force. */
  time_constant_s: f64;
  /** Path tolerance in force. */
  path_tolerance_mm: f64;
  /** Feed cap in force; infinite where there is none. */
  feed_cap_mm_per_s: f64;
  /** Answer: time constant. */
  ask_time_constant_s: f64;
  /** Answer: path tolerance. */
  ask_path_tolerance_mm: f64;
  /** Answer: feed cap. */
  ask_feed_cap_mm_per_s: f64;

  /** Whether the block is cut at a feed: a line, an arc or a curve. */
  @inline get cuts(): bool {
    return this.kind != RAPID && this.kind != DWELL;
  }
}

/** Means over one rough period. What the machine does not know is NaN. */
@unmanaged
export class Period {
  private size: u32;
  /** Line of the part program that moved last. */
  line: u32;
  /** Number of the rough period. */
  period: u64;
  /** Its duration. */
  duration_s: f64;
  /** Path speed commanded. */
  feed_mm_per_s: f64;
  /** Programmed feed; infinite in a rapid. */
  programmed_feed_mm_per_s: f64;
  /** Distance between command and feedback, mean. */
  following_error_mm: f64;
  /** The same, its largest. */
  max_following_error_mm: f64;
  /** Estimated cutting torque. */
  cutting_torque_nm: f64;
  /** Its reference. */
  reference_torque_nm: f64;
  /** Spindle load, 1 at full load. */
  spindle_load: f64;
  /** Spindle speed measured. */
  spindle_rad_per_s: f64;
  /** Length of the program that is still to be driven. */
  distance_left_mm: f64;
  /** Ratio that this script asked for last. */
  ratio: f64;
  /** Ratio of the feed strategy; 1 without one. */
  strategy_ratio: f64;
  /** Magnitude of the motor currents, one axis after the other. */
  current_0_a: f64;
  current_1_a: f64;
  current_2_a: f64;
  current_3_a: f64;
  current_4_a: f64;
  current_5_a: f64;
  current_6_a: f64;
  current_7_a: f64;
}

/** A parameter of the machine file. Its value is there from the first call on. */
@unmanaged
export class Parameter {
  private size: u32;
  private name: u32;
  private name_bytes: u32;
  private text: u32;
  private text_bytes: u32;
  private reserved: u32;
  private lowest: f64;
  private highest: f64;
  private fallback: f64;
  /** The value in force. */
  value: f64;

  /** Use `parameter`. */
  static fill(at: usize, name: string, fallback: f64, lowest: f64, highest: f64, text: string): Parameter {
    const made = changetype<Parameter>(at);
    made.size = 56;
    made.name = <u32>changetype<usize>(name);
    made.name_bytes = <u32>(name.length << 1);
    made.text = <u32>changetype<usize>(text);
    made.text_bytes = <u32>(text.length << 1);
    made.lowest = lowest;
    made.highest = highest;
    made.fallback = fallback;
    made.value = fallback;
    return made;
  }
}

const MOST_PARAMETERS: i32 = 32;
const LAYOUT: usize = memory.data(48, 8);
const WINDOW: usize = memory.data(64 * 120, 8);
const PERIOD: usize = memory.data(176, 8);
const PARAMETERS: usize = memory.data(32 * 56, 8);
let declared: i32 = 0;
let state: usize = 0;
let state_bytes: u32 = 0;

/** Declares a parameter of `[policy.parameters]`, once, outside of any function. At most 32. */
export function parameter(name: string, fallback: f64, lowest: f64, highest: f64, text: string): Parameter {
  if (declared == MOST_PARAMETERS) unreachable();
  const at = PARAMETERS + <usize>declared * 56;
  declared += 1;
  return Parameter.fill(at, name, fallback, lowest, highest, text);
}

/** Names the buffer that `save` fills and `restore` reads. */
export function keepState(at: usize, bytes: u32): void {
  state = at;
  state_bytes = bytes;
}

/** Calls `tune` with each block of a window. */
@inline
export function each(window: usize, count: i32, tune: (block: Block) => void): void {
  for (let i = 0; i < count; i++) tune(changetype<Block>(window + <usize>i * 120));
}

/** What the host asks for first; a script exports it again. */
export function tandem_policy_v1(): usize {
  store<u32>(LAYOUT, 48, 0);
  store<u32>(LAYOUT, 120, 4);
  store<u32>(LAYOUT, <u32>WINDOW, 8);
  store<u32>(LAYOUT, 64, 12);
  store<u32>(LAYOUT, 176, 16);
  store<u32>(LAYOUT, <u32>PERIOD, 20);
  store<u32>(LAYOUT, 56, 24);
  store<u32>(LAYOUT, <u32>PARAMETERS, 28);
  store<u32>(LAYOUT, declared, 32);
  store<u32>(LAYOUT, 1, 36);
  store<u32>(LAYOUT, <u32>state, 40);
  store<u32>(LAYOUT, state_bytes, 44);
  return LAYOUT;
}
