//! The ABI between host and module, versions 1 and 2: names of the exports, and where each number lies in linear memory.
//!
//! `docs/policies.md` holds the same as a table. All numbers are little-endian. Every structure begins with its size, so
//! that a later version can append to it: version 2 is version 1 with more behind it, and a module of version 1 gets what
//! it always got.

/// Latest version of the ABI.
pub const VERSION: u32 = 2;
/// Names of the export that gives the address of the [`layout`], by version from 1 on.
pub const LAYOUT_EXPORTS: [&str; VERSION as usize] = ["tandem_policy_v1", "tandem_policy_v2"];
/// What that name begins with, whatever the version.
pub const LAYOUT_PREFIX: &str = "tandem_policy_v";
/// Name of the exported memory.
pub const MEMORY_EXPORT: &str = "memory";
/// `(address: i32, count: i32)`: tunes a window of blocks.
pub const BLOCKS_EXPORT: &str = "on_blocks";
/// `(address: i32) -> f64`: the feed ratio of a rough period; NaN where the script asks for none.
pub const PERIOD_EXPORT: &str = "on_period";
/// `() -> i32`: writes what must survive a reload into the state buffer, and gives the number of bytes.
pub const SAVE_EXPORT: &str = "save";
/// `(bytes: i32)`: reads that many bytes of the state buffer.
pub const RESTORE_EXPORT: &str = "restore";
/// Blocks in a full window.
pub const WINDOW_BLOCKS: usize = 64;

/// What a module says of itself, at the address that [`LAYOUT_EXPORT`] returns. All are `u32`.
pub mod layout {
    /// Size of the structure: at least [`BYTES`].
    pub const SIZE: usize = 0;
    /// Bytes from one block to the next.
    pub const BLOCK_BYTES: usize = 4;
    /// Address of the window.
    pub const WINDOW: usize = 8;
    /// Blocks that the window holds: at least 64.
    pub const WINDOW_BLOCKS: usize = 12;
    /// Bytes of the period.
    pub const PERIOD_BYTES: usize = 16;
    /// Address of the period.
    pub const PERIOD: usize = 20;
    /// Bytes from one parameter to the next.
    pub const PARAMETER_BYTES: usize = 24;
    /// Address of the first parameter.
    pub const PARAMETERS: usize = 28;
    /// Number of parameters.
    pub const PARAMETER_COUNT: usize = 32;
    /// Encoding of names and descriptions: 0 is UTF-8, 1 is UTF-16.
    pub const TEXT: usize = 36;
    /// Address of the state buffer.
    pub const STATE: usize = 40;
    /// Bytes of the state buffer; 0 where there is none.
    pub const STATE_BYTES: usize = 44;
    /// Size of the structure in version 1.
    pub const BYTES: usize = 48;
    /// Version 2: address of the first input.
    pub const INPUTS: usize = 48;
    /// Version 2: bytes from one input to the next.
    pub const INPUT_BYTES: usize = 52;
    /// Version 2: number of inputs.
    pub const INPUT_COUNT: usize = 56;
    /// Size of the structure in version 2; its last word is reserved.
    pub const BYTES_V2: usize = 64;
}

/// One input that a module of version 2 wants to see, by its name: a value that the part program states, a signal of the
/// machine, or an axis.
pub mod input {
    /// Size of the structure, `u32`.
    pub const SIZE: usize = 0;
    /// What it is, `u32`: [`PROGRAM`], [`SIGNAL`] or [`AXIS`].
    pub const KIND: usize = 4;
    /// Address of the name, `u32`.
    pub const NAME: usize = 8;
    /// Bytes of the name, `u32`.
    pub const NAME_BYTES: usize = 12;
    /// Address of the words that a program may state instead of numbers, separated by commas, `u32`.
    pub const WORDS: usize = 16;
    /// Bytes of the words, `u32`.
    pub const WORDS_BYTES: usize = 20;
    /// 1 where the module can do without, `u32`.
    pub const OPTIONAL: usize = 24;
    /// Where its value stands, `u32`, written by the host before the first call: index into [`super::block::PROGRAM`], into
    /// [`super::period::SIGNALS`], or of the axis. [`NOWHERE`] where this machine has none.
    pub const PLACE: usize = 28;
    /// Size of the structure.
    pub const BYTES: usize = 32;

    /// A value that the part program states: a named parameter, or `name = value` in a comment.
    pub const PROGRAM: u32 = 0;
    /// A signal of the feed strategy, an analog or a digital input, by its name in the machine file.
    pub const SIGNAL: u32 = 1;
    /// An axis, by its letter.
    pub const AXIS: u32 = 2;
    /// There is none.
    pub const NOWHERE: u32 = u32::MAX;
}

/// One parameter that a module declares.
pub mod parameter {
    /// Size of the structure, `u32`.
    pub const SIZE: usize = 0;
    /// Address of the name, `u32`.
    pub const NAME: usize = 4;
    /// Bytes of the name, `u32`.
    pub const NAME_BYTES: usize = 8;
    /// Address of the description, `u32`.
    pub const TEXT: usize = 12;
    /// Bytes of the description, `u32`.
    pub const TEXT_BYTES: usize = 16;
    /// Lowest value, `f64`.
    pub const LOWEST: usize = 24;
    /// Highest value, `f64`.
    pub const HIGHEST: usize = 32;
    /// Value where the machine file states none, `f64`.
    pub const DEFAULT: usize = 40;
    /// Value in force, `f64`: the host writes it before the first call.
    pub const VALUE: usize = 48;
    /// Size of the structure in version 1.
    pub const BYTES: usize = 56;
}

/// One block of a window.
pub mod block {
    /// Size of the structure, `u32`.
    pub const SIZE: usize = 0;
    /// Line of the part program, `u32`.
    pub const LINE: usize = 4;
    /// Kind, `u32`: 0 rapid, 1 line, 2 arc, 3 NURBS, 4 dwell.
    pub const KIND: usize = 8;
    /// Tool in the spindle, `u32`.
    pub const TOOL: usize = 12;
    /// [`STARTS_AT_REST`] and [`ENDS_AT_REST`], `u32`.
    pub const FLAGS: usize = 16;
    /// Length of the path, mm.
    pub const LENGTH: usize = 24;
    /// Feed that may be driven, mm/s; infinite for a rapid, 0 for a dwell.
    pub const FEED: usize = 32;
    /// Angle between the end of the block before and the start of this, rad, 0 to π.
    pub const TURN_IN: usize = 40;
    /// Angle between the end of this block and the start of the next, rad, 0 to π.
    pub const TURN_OUT: usize = 48;
    /// Largest curvature of the path, 1/mm; 0 for a line.
    pub const CURVATURE: usize = 56;
    /// Spindle speed commanded, rad/s.
    pub const SPINDLE: usize = 64;
    /// Time constant in force, s.
    pub const TIME_CONSTANT: usize = 72;
    /// Path tolerance in force, mm.
    pub const TOLERANCE: usize = 80;
    /// Feed cap in force, mm/s; infinite where there is none.
    pub const FEED_CAP: usize = 88;
    /// Time constant asked for, s; NaN on entry: leave it.
    pub const ASK_TIME_CONSTANT: usize = 96;
    /// Path tolerance asked for, mm; NaN on entry: leave it.
    pub const ASK_TOLERANCE: usize = 104;
    /// Feed cap asked for, mm/s; NaN on entry: leave it.
    pub const ASK_FEED_CAP: usize = 112;
    /// Size of the structure in version 1.
    pub const BYTES: usize = 120;
    /// Version 2: diameter of the tool in the spindle, mm; NaN where the tool table has none.
    pub const TOOL_DIAMETER: usize = 120;
    /// Version 2: what the program has stated of each input of the kind [`super::input::PROGRAM`], eight of them; NaN where
    /// nothing is in force.
    pub const PROGRAM: usize = 128;
    /// Size of the structure in version 2 for a module that does not look at the geometry behind it.
    pub const BYTES_SMALL: usize = 192;
    /// Version 2: where the block starts, machine coordinates per axis, mm or rad. This and what follows are eight each.
    pub const START: usize = 192;
    /// Version 2: where it ends.
    pub const END: usize = 256;
    /// Version 2: program coordinate = machine coordinate − offset.
    pub const OFFSET: usize = 320;
    /// Version 2: how far each axis moves for each mm of the path, at the start: the direction; 0 where nothing moves.
    pub const START_DIRECTION: usize = 384;
    /// Version 2: the same at the end.
    pub const END_DIRECTION: usize = 448;
    /// Version 2: the lowest that it is anywhere in the block, with its sign; of a curve at 17 places.
    pub const LOWEST_SHARE: usize = 512;
    /// Version 2: the highest.
    pub const HIGHEST_SHARE: usize = 576;
    /// Size of the structure in version 2.
    pub const BYTES_V2: usize = 640;

    /// Flag: the machine is at rest at the start of the block.
    pub const STARTS_AT_REST: u32 = 1;
    /// Flag: the machine is at rest at the end of the block.
    pub const ENDS_AT_REST: u32 = 2;
}

/// One rough period: means over its fine periods.
pub mod period {
    /// Size of the structure, `u32`.
    pub const SIZE: usize = 0;
    /// Line of the part program that moved last, `u32`.
    pub const LINE: usize = 4;
    /// Number of the rough period, `u64`.
    pub const PERIOD: usize = 8;
    /// Duration, s.
    pub const DURATION: usize = 16;
    /// Path speed commanded, mm/s.
    pub const FEED: usize = 24;
    /// Programmed feed, mm/s; infinite in a rapid, 0 where nothing moves.
    pub const PROGRAMMED_FEED: usize = 32;
    /// Distance between position commanded and measured over the linear axes, mean, mm.
    pub const FOLLOWING_ERROR: usize = 40;
    /// The same, its largest, mm.
    pub const MAX_FOLLOWING_ERROR: usize = 48;
    /// Signal `cutting_torque_nm` of the feed strategy, N·m; NaN where it has none.
    pub const CUTTING_TORQUE: usize = 56;
    /// Signal `reference_torque_nm`, N·m; NaN where there is none.
    pub const REFERENCE_TORQUE: usize = 64;
    /// Signal `spindle_load`, 1 at full load; NaN where there is none.
    pub const SPINDLE_LOAD: usize = 72;
    /// Spindle speed measured, rad/s.
    pub const SPINDLE: usize = 80;
    /// Length of the program that is still to be driven, mm.
    pub const DISTANCE_LEFT: usize = 88;
    /// Ratio that this script asked for last; 1 before the first.
    pub const RATIO: usize = 96;
    /// Ratio that the feed strategy asks for; 1 where there is none.
    pub const STRATEGY_RATIO: usize = 104;
    /// Magnitude of the motor current of each of the eight axes, A.
    pub const CURRENT: usize = 112;
    /// Size of the structure in version 1.
    pub const BYTES: usize = 176;
    /// Version 2: position commanded at the end of the period, per axis, mm or rad. This and the next four are eight each.
    pub const POSITION: usize = 176;
    /// Version 2: speed measured, mean, mm/s or rad/s.
    pub const SPEED: usize = 240;
    /// Version 2: position commanded less measured, mean, mm or rad.
    pub const AXIS_ERROR: usize = 304;
    /// Version 2: its largest magnitude.
    pub const MAX_AXIS_ERROR: usize = 368;
    /// Version 2: the signals of the inputs of the kind [`super::input::SIGNAL`], sixteen of them, means; of a digital input
    /// the share of the period in which it was 1.
    pub const SIGNALS: usize = 432;
    /// Version 2: rate of program time, mean, 0 to 1.
    pub const SIGMA: usize = 560;
    /// Size of the structure in version 2.
    pub const BYTES_V2: usize = 568;
}

/// Writes an unsigned number at `at`.
pub(crate) fn put_u32(bytes: &mut [u8], at: usize, value: u32) {
    bytes[at..at + 4].copy_from_slice(&value.to_le_bytes());
}

/// Writes a number at `at`.
pub(crate) fn put_f64(bytes: &mut [u8], at: usize, value: f64) {
    bytes[at..at + 8].copy_from_slice(&value.to_le_bytes());
}

/// Reads an unsigned number at `at`; `None` beyond the end.
pub(crate) fn get_u32(bytes: &[u8], at: usize) -> Option<u32> {
    Some(u32::from_le_bytes(
        bytes.get(at..at.checked_add(4)?)?.try_into().ok()?,
    ))
}

/// Reads a number at `at`; `None` beyond the end.
pub(crate) fn get_f64(bytes: &[u8], at: usize) -> Option<f64> {
    Some(f64::from_le_bytes(
        bytes.get(at..at.checked_add(8)?)?.try_into().ok()?,
    ))
}
