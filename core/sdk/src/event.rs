//! Events: non-motion words, tied to a place on the path.

/// What an event does. The meaning of [`Event::index`] and [`Event::value`] is given with each kind.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum EventKind {
    /// Spindle command: `value` in rad/s, positive clockwise, zero stops it.
    Spindle = 0,
    /// Mist coolant: `value` 1 on, 0 off.
    Mist = 1,
    /// Flood coolant: `value` 1 on, 0 off.
    Flood = 2,
    /// A tool is to be made ready (T): `index` is its number.
    ToolSelect = 3,
    /// The selected tool is changed in (M6): `index` is its number.
    ToolChange = 4,
    /// M0, or M60 where `index` is 60: wait for the operator.
    ProgramStop = 5,
    /// M1: wait for the operator where the optional stop is on.
    OptionalStop = 6,
    /// M2, M30: the program is over.
    ProgramEnd = 7,
    /// A digital output: `index` is its number (0 to 63), `value` 1 or 0 (M62 to M65).
    DigitalOutput = 8,
    /// Feed override permitted (M48 to M53): `value` 1 or 0.
    FeedOverride = 9,
    /// Spindle override permitted (M48, M49, M51): `value` 1 or 0.
    SpindleOverride = 10,
    /// Adaptive feed permitted (M52): `value` 1 or 0.
    AdaptiveFeed = 11,
    /// Feed-hold permitted (M53): `value` 1 or 0.
    FeedHold = 12,
    /// The position of axis `index` is set anew (homing): `value`, mm or rad, is added to its coordinate. Nothing moves. The
    /// machine is at rest.
    Correct = 13,
    /// Axis `index` is homed: its travel counts from here on.
    Homed = 14,
    /// Axis `index` is handed over to its drive, which homes it by its own means within `value` s. The machine is at rest.
    HomeByDrive = 15,
    /// An analogue output: `index` is its number (0 to 63), `value` what it is set to (M67, M68).
    AnalogOutput = 16,
    /// The spindle, which has stopped, is to turn to the angle `value`, rad, and hold it (M19). The machine is at rest. No driver is
    /// asked for it yet: a program for drives that move something is refused it.
    OrientSpindle = 17,
    /// A command of the machine's own: `index` is 100 for M100, `value` its P, or −1. The machine is at rest; who runs it
    /// is the soft side, this only tells.
    UserCommand = 18,
}

/// A non-motion word. It takes effect in the fine period in which the path reaches its place.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct Event {
    /// What it does.
    pub kind: EventKind,
    /// Line of the part program, from 1.
    pub line: u32,
    /// See [`EventKind`].
    pub index: i32,
    /// See [`EventKind`].
    pub value: f64,
    /// Epoch of the ring entry; see [`crate::Segment::epoch`].
    pub epoch: u32,
    /// The event takes effect before the block of this index moves.
    pub before_block: u64,
    /// Program time at which it takes effect, s; filled in when it enters the ring.
    pub program_time_s: f64,
}

impl Event {
    /// An event of `kind` on `line` that takes effect before block `before_block`.
    pub fn new(kind: EventKind, line: u32, before_block: u64, index: i32, value: f64) -> Self {
        Self {
            kind,
            line,
            index,
            value,
            epoch: 0,
            before_block,
            program_time_s: f64::NAN,
        }
    }
}
