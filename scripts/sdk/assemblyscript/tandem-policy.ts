// Tandem policy scripts in AssemblyScript: ABI version 2.
//
// A script imports what it needs from here, exports `tandem_policy_v2` again, and exports `on_blocks`, `on_period` or
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

/** Bytes of a structure of the ABI. */
const BLOCK: usize = 640;
const BLOCK_WITHOUT_GEOMETRY: usize = 192;
const PERIOD_BYTES: usize = 568;
const INPUT: usize = 32;

/** What the script looks at by name: a value of the program, a signal of the machine, or an axis. */
@unmanaged
export class Input {
  private size: u32;
  private kind: u32;
  private name: u32;
  private name_bytes: u32;
  private words: u32;
  private words_bytes: u32;
  private optional: u32;
  /** Where its value stands, from the first call on; beyond 64 where this machine has none. */
  place: u32;

  /** Whether this machine has it. */
  @inline get there(): bool {
    return this.place < 64;
  }

  /** Use `program`, `signal`, `optionalSignal` or `axis`. */
  static fill(at: usize, kind: u32, name: string, words: string, optional: u32): Input {
    const made = changetype<Input>(at);
    made.size = <u32>INPUT;
    made.kind = kind;
    made.name = <u32>changetype<usize>(name);
    made.name_bytes = <u32>(name.length << 1);
    made.words = <u32>changetype<usize>(words);
    made.words_bytes = <u32>(words.length << 1);
    made.optional = optional;
    made.place = <u32>-1;
    return made;
  }
}

/** Entry `place` of `count` numbers; NaN where it is none of them. */
@inline
function entry(at: usize, place: u32, count: u32): f64 {
  return place < count ? load<f64>(at + (<usize>place << 3)) : NaN;
}

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
  /** Diameter of the tool; NaN where the tool table has none. */
  @inline get tool_diameter_mm(): f64 {
    return load<f64>(changetype<usize>(this), 120);
  }
  /** What the program has stated of `input`; NaN where nothing is in force. */
  @inline program(input: Input): f64 {
    return entry(changetype<usize>(this) + 128, input.place, 8);
  }
  /** Where the block starts along `axis`, machine coordinates, mm or rad. NaN where the machine has no such axis, in all that
   * follow too. */
  @inline start(axis: Input): f64 {
    return entry(changetype<usize>(this) + 192, axis.place, 8);
  }
  /** Where it ends. */
  @inline end(axis: Input): f64 {
    return entry(changetype<usize>(this) + 256, axis.place, 8);
  }
  /** Program coordinate = machine coordinate - offset. */
  @inline offset(axis: Input): f64 {
    return entry(changetype<usize>(this) + 320, axis.place, 8);
  }
  /** How far the axis moves for each mm of the path at the start: the direction. */
  @inline start_direction(axis: Input): f64 {
    return entry(changetype<usize>(this) + 384, axis.place, 8);
  }
  /** The same at the end. */
  @inline end_direction(axis: Input): f64 {
    return entry(changetype<usize>(this) + 448, axis.place, 8);
  }
  /** The lowest that it is anywhere in the block, with its sign. */
  @inline lowest_share(axis: Input): f64 {
    return entry(changetype<usize>(this) + 512, axis.place, 8);
  }
  /** The highest. */
  @inline highest_share(axis: Input): f64 {
    return entry(changetype<usize>(this) + 576, axis.place, 8);
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

  /** Position commanded at the end of the period along `axis`, mm or rad. */
  @inline position(axis: Input): f64 {
    return entry(changetype<usize>(this) + 176, axis.place, 8);
  }
  /** Speed measured, mean. */
  @inline speed(axis: Input): f64 {
    return entry(changetype<usize>(this) + 240, axis.place, 8);
  }
  /** Position commanded less measured, mean. */
  @inline axis_error(axis: Input): f64 {
    return entry(changetype<usize>(this) + 304, axis.place, 8);
  }
  /** Its largest magnitude. */
  @inline max_axis_error(axis: Input): f64 {
    return entry(changetype<usize>(this) + 368, axis.place, 8);
  }
  /** A signal, mean; of a digital input the share of the period in which it was 1. NaN where nothing was heard of it. */
  @inline signal(input: Input): f64 {
    return entry(changetype<usize>(this) + 432, input.place, 16);
  }
  /** Rate of program time, mean, 0 to 1. */
  @inline get sigma(): f64 {
    return load<f64>(changetype<usize>(this), 560);
  }
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
const MOST_INPUTS: i32 = 32;
const LAYOUT: usize = memory.data(64, 8);
const WINDOW: usize = memory.data(64 * 640, 8);
const PERIOD: usize = memory.data(568, 8);
const PARAMETERS: usize = memory.data(32 * 56, 8);
const INPUTS: usize = memory.data(32 * 32, 8);
let declared: i32 = 0;
let looked_at: i32 = 0;
let block_bytes: usize = BLOCK;
let state: usize = 0;
let state_bytes: u32 = 0;

/** Declares a parameter of `[policy.parameters]`, once, outside of any function. At most 32. */
export function parameter(name: string, fallback: f64, lowest: f64, highest: f64, text: string): Parameter {
  if (declared == MOST_PARAMETERS) unreachable();
  const at = PARAMETERS + <usize>declared * 56;
  declared += 1;
  return Parameter.fill(at, name, fallback, lowest, highest, text);
}

function input(kind: u32, name: string, words: string, optional: u32): Input {
  if (looked_at == MOST_INPUTS) unreachable();
  const at = INPUTS + <usize>looked_at * INPUT;
  looked_at += 1;
  return Input.fill(at, kind, name, words, optional);
}

/** Looks at what the part program states: a named parameter `#<name>`, or `name = value` in a comment. `words`, separated by
 * commas, stand for 0, 1, 2 and so on. Once, outside of any function; so are those that follow. */
export function program(name: string, words: string = ""): Input {
  return input(0, name, words, 0);
}

/** Looks at a signal of the feed strategy, an analog or a digital input, by its name; a machine without it is refused. */
export function signal(name: string): Input {
  return input(1, name, "", 0);
}

/** The same where the script can do without. */
export function optionalSignal(name: string): Input {
  return input(1, name, "", 1);
}

/** Looks at an axis, by its letter; a machine without it is refused. */
export function axis(name: string): Input {
  return input(2, name, "", 0);
}

/** The same where the script can do without. */
export function optionalAxis(name: string): Input {
  return input(2, name, "", 1);
}

/** The script does not look at where blocks lie and which way they go: its calls cost less. */
export function withoutGeometry(): void {
  block_bytes = BLOCK_WITHOUT_GEOMETRY;
}

/** Names the buffer that `save` fills and `restore` reads. */
export function keepState(at: usize, bytes: u32): void {
  state = at;
  state_bytes = bytes;
}

/** Calls `tune` with each block of a window. */
@inline
export function each(window: usize, count: i32, tune: (block: Block) => void): void {
  for (let i = 0; i < count; i++) tune(changetype<Block>(window + <usize>i * block_bytes));
}

/** What the host asks for first; a script exports it again. */
export function tandem_policy_v2(): usize {
  store<u32>(LAYOUT, 64, 0);
  store<u32>(LAYOUT, <u32>block_bytes, 4);
  store<u32>(LAYOUT, <u32>WINDOW, 8);
  store<u32>(LAYOUT, 64, 12);
  store<u32>(LAYOUT, <u32>PERIOD_BYTES, 16);
  store<u32>(LAYOUT, <u32>PERIOD, 20);
  store<u32>(LAYOUT, 56, 24);
  store<u32>(LAYOUT, <u32>PARAMETERS, 28);
  store<u32>(LAYOUT, declared, 32);
  store<u32>(LAYOUT, 1, 36);
  store<u32>(LAYOUT, <u32>state, 40);
  store<u32>(LAYOUT, state_bytes, 44);
  store<u32>(LAYOUT, <u32>INPUTS, 48);
  store<u32>(LAYOUT, <u32>INPUT, 52);
  store<u32>(LAYOUT, looked_at, 56);
  return LAYOUT;
}
