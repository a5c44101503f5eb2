//! What is in force between two lines.

use std::f64::consts::PI;

use tandem_sdk::{AxisVector, Block, PathMode};

use crate::config::{Config, Tool};
use crate::letters::Letters;

/// Number of work coordinate systems, G54 to G59.3.
pub(crate) const SYSTEMS: usize = 9;
/// Millimetres an inch.
pub(crate) const INCH_MM: f64 = 25.4;

/// What axis words without a motion code do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Motion {
    /// After power-on and G80: nothing, they are an error.
    None,
    /// After a refused motion code: they are passed over, the refusal has been reported.
    Refused,
    Rapid,
    Line,
    ArcClockwise,
    ArcCounterclockwise,
    /// G5, G5.1, G5.2 and G6.2, by their number in tenths.
    Curve(u16),
    /// G31 and G38.2 to G38.5, by their number in tenths.
    Probe(u16),
}

/// The plane of arcs, by the letters of its two axes in the order that makes counter-clockwise positive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Plane {
    Xy,
    Zx,
    Yz,
}

/// The offsets between program and machine coordinates.
#[derive(Clone, Debug)]
pub(crate) struct Offsets {
    pub systems: [AxisVector; SYSTEMS],
    /// Index of the system in force.
    pub active: usize,
    pub g92: AxisVector,
    /// What G92.3 restores.
    pub g92_stored: AxisVector,
    pub tool: AxisVector,
    /// The sum in force.
    pub total: AxisVector,
}

impl Offsets {
    /// Must follow every change of a part.
    pub fn sum_up(&mut self) {
        self.total = self.systems[self.active] + self.g92 + self.tool;
    }
}

/// What the first pass has had to assume: the answers of probes and inputs, and all that follows from them.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Assumed {
    /// Bit per axis whose position follows from an assumed answer.
    pub position: u32,
    /// Bit per axis whose offset does.
    pub offsets: u32,
    /// The answer of the last M66 is assumed.
    pub input: bool,
}

/// The feed: F is kept in both units, because an axis that turns reads it in degrees.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Feed {
    /// G93: F is the inverse of the line's duration.
    pub inverse_time: bool,
    pub linear_mm_per_s: f64,
    pub rotary_rad_per_s: f64,
}

/// Speed and direction of the spindle.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Spindle {
    /// 1 clockwise, −1 counter-clockwise, 0 stopped.
    pub direction: i8,
    pub speed_rad_per_s: f64,
}

impl Spindle {
    /// The speed commanded, positive clockwise.
    pub fn command_rad_per_s(self) -> f64 {
        match self.direction {
            0 => 0.0,
            direction => f64::from(direction) * self.speed_rad_per_s,
        }
    }
}

/// Everything modal.
#[derive(Clone, Debug)]
#[allow(clippy::struct_excessive_bools, reason = "independent modes, each on or off")]
pub(crate) struct State {
    pub line: u32,
    pub motion: Motion,
    pub plane: Plane,
    /// Millimetres a program unit of length.
    pub unit_mm: f64,
    pub absolute: bool,
    pub arc_absolute: bool,
    pub feed: Feed,
    pub path_mode: PathMode,
    pub tolerance_mm: f64,
    pub time_constant_s: f64,
    pub offsets: Offsets,
    /// G28 and G30, machine coordinates.
    pub reference: [AxisVector; 2],
    /// The programmed position, machine coordinates.
    pub position: AxisVector,
    /// Where the last block ended: the programmed position but for moves too short to be blocks.
    pub last_end: AxisVector,
    /// Bit per axis whose position an erroneous line has left unknown.
    pub uncertain: u32,
    pub assumed: Assumed,
    pub spindle: Spindle,
    pub mist: bool,
    pub flood: bool,
    /// Feed override, spindle override, adaptive feed, feed hold.
    pub permits: [bool; 4],
    /// Digital outputs that the program has set, and to what.
    pub outputs_set: u64,
    pub outputs: u64,
    pub tools: Vec<Tool>,
    pub tool: u32,
    pub selected_tool: Option<u32>,
    /// Answer of the last M66 (#5399).
    pub input: f64,
    /// Number of the next block.
    pub next_index: u64,
    /// The last block was rest, or there was none.
    pub at_rest: bool,
}

impl State {
    pub fn new(config: &Config) -> Self {
        let zero = AxisVector::ZERO;
        Self {
            line: 0,
            motion: Motion::None,
            plane: Plane::Xy,
            unit_mm: 1.0,
            absolute: true,
            arc_absolute: false,
            feed: Feed::default(),
            path_mode: PathMode::Continuous,
            tolerance_mm: f64::NAN,
            time_constant_s: f64::NAN,
            offsets: Offsets {
                systems: [zero; SYSTEMS],
                active: 0,
                g92: zero,
                g92_stored: zero,
                tool: zero,
                total: zero,
            },
            reference: config.reference,
            position: config.start,
            last_end: config.start,
            uncertain: 0,
            assumed: Assumed::default(),
            spindle: Spindle::default(),
            mist: false,
            flood: false,
            permits: [true, true, false, true],
            outputs_set: 0,
            outputs: 0,
            tools: config.tools.clone(),
            tool: config.tool_in_spindle,
            selected_tool: None,
            input: 0.0,
            next_index: 0,
            at_rest: true,
        }
    }

    /// Inner units (mm, rad) a program unit (mm or inch, degree) of `axis`.
    #[inline]
    pub fn scale(&self, letters: &Letters, axis: usize) -> f64 {
        if letters.is_rotary(axis) { PI / 180.0 } else { self.unit_mm }
    }

    /// The position in program coordinates and program units.
    pub fn program_position(&self, letters: &Letters, axis: usize) -> f64 {
        (self.position[axis] - self.offsets.total[axis]) / self.scale(letters, axis)
    }

    /// The tool called `number`.
    pub fn find_tool(&self, number: u32) -> Option<&Tool> {
        self.tools.iter().find(|tool| tool.number == number)
    }

    /// The block that comes next, at rest where the last one ended, with all that is in force.
    pub fn blank_block(&self) -> Block {
        Block {
            path_mode: self.path_mode,
            line: self.line,
            index: self.next_index,
            time_constant_s: self.time_constant_s,
            path_tolerance_mm: self.tolerance_mm,
            offset: self.offsets.total,
            tool: self.tool,
            override_enabled: u32::from(self.permits[0]),
            spindle_rad_per_s: self.spindle.command_rad_per_s(),
            ..Block::at(self.last_end)
        }
    }
}
