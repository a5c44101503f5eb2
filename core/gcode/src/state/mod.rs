//! What is in force between two lines, as parts that each own their state.

pub(crate) mod coordinates;
pub(crate) mod letters;
pub(crate) mod parameters;
pub(crate) mod path;
pub(crate) mod tools;

use tandem_sdk::{Block, PathMode};

use crate::config::Config;
use crate::words::Word;
use crate::words::compensation::Compensation;
use crate::words::coolant::Coolant;
use crate::words::curve::Curves;
use crate::words::cycles::Cycles;
use crate::words::modal::SavedStates;
use crate::words::modes::Modes;
use crate::words::outputs::Outputs;
use crate::words::overrides::Permits;
use crate::words::spindle::Spindle;
use crate::words::subprogram::Subprograms;

use coordinates::Coordinates;
use path::Path;
use tools::Tools;

/// What axis words without a motion word do.
#[derive(Clone, Copy)]
pub(crate) enum MotionMode {
    /// After power-on and G80: nothing, they are an error.
    None,
    /// After a refused motion word: they are passed over, the refusal has been reported.
    Refused,
    /// What this motion word does.
    Word(&'static Word),
}

/// Everything modal.
#[derive(Clone)]
pub(crate) struct State {
    /// The line that is read, from 1.
    pub line: u32,
    pub motion: MotionMode,
    pub modes: Modes,
    pub coordinates: Coordinates,
    pub path: Path,
    pub tools: Tools,
    pub spindle: Spindle,
    pub coolant: Coolant,
    pub permits: Permits,
    pub outputs: Outputs,
    pub curves: Curves,
    pub compensation: Compensation,
    /// What M70 and M73 have saved.
    pub saved: SavedStates,
    pub cycles: Cycles,
    pub subprograms: Subprograms,
    /// The program is over.
    pub ended: bool,
}

impl MotionMode {
    /// The word, where one is in force.
    pub fn code(self) -> Option<&'static str> {
        match self {
            Self::Word(word) => Some(word.code),
            Self::None | Self::Refused => None,
        }
    }
}

impl State {
    /// Whether modes, offsets and tools are those of `other`, wherever the path has come to.
    pub fn is_as(&self, other: &Self) -> bool {
        self.motion.code() == other.motion.code()
            && self.modes.is_as(&other.modes)
            && self.coordinates == other.coordinates
            && self.tools.is_as(&other.tools)
            && self.spindle == other.spindle
            && self.coolant == other.coolant
            && self.permits == other.permits
            && self.outputs == other.outputs
            && self.cycles == other.cycles
    }

    pub fn new(config: &Config) -> Self {
        let letters = letters::Letters::new(&config.axes);
        let linear = |letter| {
            letters
                .axis(letter)
                .filter(|axis| !letters.is_rotary(*axis))
        };
        let plane = linear(b'X').zip(linear(b'Y')).map(|(x, y)| [x, y]);
        Self {
            line: 0,
            motion: MotionMode::None,
            modes: Modes::default(),
            coordinates: Coordinates::new(config.reference, plane),
            path: Path::new(config.start),
            tools: Tools::new(config),
            spindle: Spindle::default(),
            coolant: Coolant::default(),
            permits: Permits::default(),
            outputs: Outputs::default(),
            curves: Curves::default(),
            compensation: Compensation::default(),
            saved: SavedStates::default(),
            cycles: Cycles::default(),
            subprograms: Subprograms::default(),
            ended: false,
        }
    }

    /// The motion mode as `#<_motion_mode>` has it: the number of its word in tenths, 800 for none.
    pub fn motion_code(&self) -> f64 {
        match self.motion {
            MotionMode::Word(word) => f64::from(word.tenths),
            MotionMode::None | MotionMode::Refused => 800.0,
        }
    }

    /// The position in program coordinates and program units.
    pub fn program_position(&self, letters: &letters::Letters, axis: usize) -> f64 {
        self.coordinates.to_program(&self.path.position)[axis] / self.modes.scale(letters, axis)
    }

    /// The block that comes next, at rest where the last one ended, with all that is in force.
    #[inline]
    pub fn blank_block(&self) -> Block {
        let mut block = Block::at(self.path.last_end);
        if self.modes.exact_stop {
            block.path_mode = PathMode::ExactStop;
        }
        block.line = self.line;
        block.index = self.path.next_index;
        block.time_constant_s = self.modes.time_constant_s;
        block.path_tolerance_mm = self.modes.tolerance_mm;
        block.offset = *self.coordinates.total();
        block.tool = self.tools.in_spindle;
        block.override_enabled = u32::from(self.permits.feed_override());
        block.spindle_rad_per_s = self.spindle.command_rad_per_s();
        block
    }
}
