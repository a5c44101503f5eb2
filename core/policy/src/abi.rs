//! The ABI between host and module, version 1: names of the exports, and where each number lies in linear memory.
//!
//! `docs/policies.md` holds the same as a table. All numbers are little-endian. Every structure begins with its size, so
//! that a later version can append to it.

/// Version of the ABI.
pub const VERSION: u32 = 1;
/// Name of the export that gives the address of the [`layout`]; its number is the version of the ABI.
pub const LAYOUT_EXPORT: &str = "tandem_policy_v1";
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
