//! Tandem policy scripts in Rust: ABI version 2. A `no_std` crate holds this file as a module and calls [`policy!`] once.
//!
//! `docs/policies.md` explains every number.
#![allow(dead_code, unused_macros, unused_imports)]

use core::cell::UnsafeCell;

/// Kinds of a block.
pub const RAPID: u32 = 0;
/// A straight line.
pub const LINE: u32 = 1;
/// An arc or helix.
pub const ARC: u32 = 2;
/// A NURBS curve.
pub const NURBS: u32 = 3;
/// No path.
pub const DWELL: u32 = 4;

/// One block. What begins with `ask_` is the answer; what is not written stays as it is.
#[repr(C)]
pub struct Block {
    pub size: u32,
    pub line: u32,
    pub kind: u32,
    pub tool: u32,
    pub flags: u32,
    reserved: u32,
    pub length_mm: f64,
    pub feed_mm_per_s: f64,
    pub turn_in_rad: f64,
    pub turn_out_rad: f64,
    pub curvature_per_mm: f64,
    pub spindle_rad_per_s: f64,
    pub time_constant_s: f64,
    pub path_tolerance_mm: f64,
    pub feed_cap_mm_per_s: f64,
    pub ask_time_constant_s: f64,
    pub ask_path_tolerance_mm: f64,
    pub ask_feed_cap_mm_per_s: f64,
    /// NaN where the tool table has none.
    pub tool_diameter_mm: f64,
    program: [f64; 8],
    /// Machine coordinates per axis, mm or rad.
    pub start: [f64; 8],
    pub end: [f64; 8],
    /// Program coordinate = machine coordinate − offset.
    pub offset: [f64; 8],
    /// How far each axis moves for each mm of the path.
    pub start_direction: [f64; 8],
    pub end_direction: [f64; 8],
    /// The lowest that it is anywhere in the block, with its sign.
    pub lowest_share: [f64; 8],
    pub highest_share: [f64; 8],
}

impl Block {
    /// Whether the block is cut at a feed: a line, an arc or a curve.
    pub fn cuts(&self) -> bool {
        self.kind != RAPID && self.kind != DWELL
    }

    /// What the program has stated of an input; NaN where nothing is in force.
    pub fn program(&self, input: &Input) -> f64 {
        input.of(&self.program)
    }
}

/// Means over one rough period. What the machine does not know is NaN.
#[repr(C)]
pub struct Period {
    pub size: u32,
    pub line: u32,
    pub period: u64,
    pub duration_s: f64,
    pub feed_mm_per_s: f64,
    pub programmed_feed_mm_per_s: f64,
    pub following_error_mm: f64,
    pub max_following_error_mm: f64,
    pub cutting_torque_nm: f64,
    pub reference_torque_nm: f64,
    pub spindle_load: f64,
    pub spindle_rad_per_s: f64,
    pub distance_left_mm: f64,
    pub ratio: f64,
    pub strategy_ratio: f64,
    pub current_a: [f64; 8],
    /// Commanded at the end of the period, per axis.
    pub position: [f64; 8],
    /// Measured, mean.
    pub speed: [f64; 8],
    /// Commanded less measured, mean.
    pub axis_error: [f64; 8],
    /// Its largest magnitude.
    pub max_axis_error: [f64; 8],
    signals: [f64; 16],
    /// Rate of program time, 0 to 1.
    pub sigma: f64,
}

impl Period {
    /// A signal; NaN where nothing was heard of it.
    pub fn signal(&self, input: &Input) -> f64 {
        input.of(&self.signals)
    }
}

/// What the script looks at by name.
#[repr(C)]
pub struct Input {
    size: u32,
    kind: u32,
    name: *const u8,
    name_bytes: u32,
    words: *const u8,
    words_bytes: u32,
    optional: u32,
    place: UnsafeCell<u32>,
}

// A module has one thread.
unsafe impl Sync for Input {}

impl Input {
    /// Its entry in an array with one a place, as an axis has in every array of eight; NaN where this machine has none.
    pub fn of(&self, values: &[f64]) -> f64 {
        // The host writes it between calls only.
        let place = unsafe { self.place.get().read_volatile() };
        values.get(place as usize).copied().unwrap_or(f64::NAN)
    }
}

const fn input(kind: u32, name: &'static str, words: &'static str, optional: u32) -> Input {
    Input {
        size: size_of::<Input>() as u32,
        kind,
        name: name.as_ptr(),
        name_bytes: name.len() as u32,
        words: words.as_ptr(),
        words_bytes: words.len() as u32,
        optional,
        place: UnsafeCell::new(u32::MAX),
    }
}

/// What the part program states: a named parameter `#<name>`, or `name = value` in a comment. `words`, separated by commas, stand
/// for 0, 1, 2 and so on.
pub const fn program(name: &'static str, words: &'static str) -> Input {
    input(0, name, words, 0)
}

/// A signal of the feed strategy, an analog or a digital input; a machine without it is refused.
pub const fn signal(name: &'static str) -> Input {
    input(1, name, "", 0)
}

/// The same where the script can do without.
pub const fn optional_signal(name: &'static str) -> Input {
    input(1, name, "", 1)
}

/// An axis, by its letter; a machine without it is refused.
pub const fn axis(name: &'static str) -> Input {
    input(2, name, "", 0)
}

/// The same where the script can do without.
pub const fn optional_axis(name: &'static str) -> Input {
    input(2, name, "", 1)
}

/// A parameter of the machine file.
#[repr(C)]
pub struct Parameter {
    size: u32,
    name: *const u8,
    name_bytes: u32,
    text: *const u8,
    text_bytes: u32,
    reserved: u32,
    lowest: f64,
    highest: f64,
    fallback: f64,
    value: UnsafeCell<f64>,
}

// A module has one thread.
unsafe impl Sync for Parameter {}

impl Parameter {
    /// The value in force, from the first call on.
    pub fn value(&self) -> f64 {
        // The host writes it between calls only.
        unsafe { self.value.get().read_volatile() }
    }
}

/// Declares a parameter: name, default, lowest, highest, what it means.
pub const fn parameter(name: &'static str, fallback: f64, lowest: f64, highest: f64, text: &'static str) -> Parameter {
    Parameter {
        size: size_of::<Parameter>() as u32,
        name: name.as_ptr(),
        name_bytes: name.len() as u32,
        text: text.as_ptr(),
        text_bytes: text.len() as u32,
        reserved: 0,
        lowest,
        highest,
        fallback,
        value: UnsafeCell::new(fallback),
    }
}

/// What the host asks for first.
#[repr(C)]
pub struct Layout {
    pub size: u32,
    pub block_bytes: u32,
    pub window: *mut Block,
    pub window_blocks: u32,
    pub period_bytes: u32,
    pub period: *mut Period,
    pub parameter_bytes: u32,
    pub parameters: *const Parameter,
    pub parameter_count: u32,
    pub text: u32,
    pub state: u32,
    pub state_bytes: u32,
    pub inputs: *const Input,
    pub input_bytes: u32,
    pub input_count: u32,
    pub reserved: u32,
}

unsafe impl Sync for Layout {}

/// Room for a window and a period.
#[repr(C, align(8))]
pub struct Room(UnsafeCell<[u8; 64 * 640 + 568]>);

unsafe impl Sync for Room {}

impl Room {
    pub const fn new() -> Self {
        Self(UnsafeCell::new([0; 64 * 640 + 568]))
    }

    /// The layout over this room.
    pub const fn layout(&'static self, parameters: &'static [Parameter], inputs: &'static [Input]) -> Layout {
        let start = self.0.get().cast::<u8>();
        Layout {
            size: size_of::<Layout>() as u32,
            block_bytes: size_of::<Block>() as u32,
            window: start.cast(),
            window_blocks: 64,
            period_bytes: size_of::<Period>() as u32,
            period: start.wrapping_add(64 * 640).cast(),
            parameter_bytes: size_of::<Parameter>() as u32,
            parameters: parameters.as_ptr(),
            parameter_count: parameters.len() as u32,
            text: 0,
            state: 0,
            state_bytes: 0,
            inputs: inputs.as_ptr(),
            input_bytes: size_of::<Input>() as u32,
            input_count: inputs.len() as u32,
            reserved: 0,
        }
    }
}

#[cfg(target_arch = "wasm32")]
#[panic_handler]
fn panic(_: &core::panic::PanicInfo) -> ! {
    core::arch::wasm32::unreachable()
}

/// Exports a policy: its parameters, its inputs where it has any, a function of one block, a function of a rough period that
/// returns the feed ratio (NaN for none), or both.
macro_rules! policy {
    ($parameters:expr, inputs: $inputs:expr, blocks: $tune:path, period: $ratio:path) => {
        $crate::tandem_policy::policy!(@layout $parameters, $inputs);
        $crate::tandem_policy::policy!(@blocks $tune);
        $crate::tandem_policy::policy!(@period $ratio);
    };
    ($parameters:expr, inputs: $inputs:expr, blocks: $tune:path) => {
        $crate::tandem_policy::policy!(@layout $parameters, $inputs);
        $crate::tandem_policy::policy!(@blocks $tune);
    };
    ($parameters:expr, inputs: $inputs:expr, period: $ratio:path) => {
        $crate::tandem_policy::policy!(@layout $parameters, $inputs);
        $crate::tandem_policy::policy!(@period $ratio);
    };
    ($parameters:expr, $($calls:tt)+) => {
        static TANDEM_INPUTS: [$crate::tandem_policy::Input; 0] = [];
        $crate::tandem_policy::policy!($parameters, inputs: TANDEM_INPUTS, $($calls)+);
    };
    (@layout $parameters:expr, $inputs:expr) => {
        static TANDEM_ROOM: $crate::tandem_policy::Room = $crate::tandem_policy::Room::new();

        /// Tells the host where everything lies.
        #[unsafe(no_mangle)]
        pub extern "C" fn tandem_policy_v2() -> *const $crate::tandem_policy::Layout {
            static LAYOUT: $crate::tandem_policy::Layout = TANDEM_ROOM.layout(&$parameters, &$inputs);
            &LAYOUT
        }
    };
    (@blocks $tune:path) => {
        /// Called by the host with a window that it has laid out.
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn on_blocks(window: *mut $crate::tandem_policy::Block, count: i32) {
            for index in 0..count {
                $tune(unsafe { &mut *window.offset(index as isize) });
            }
        }
    };
    (@period $ratio:path) => {
        /// Called by the host once a rough period.
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn on_period(period: *const $crate::tandem_policy::Period) -> f64 {
            $ratio(unsafe { &*period })
        }
    };
}
pub(crate) use policy;
