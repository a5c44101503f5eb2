//! What the interpreter must know of the machine.

use std::path::PathBuf;
use std::sync::Arc;

use tandem_sdk::{Axes, AxisVector, MAX_AXES};

use crate::persistent::{PersistentData, SwitchedOn};
use crate::stated::Watched;

/// One row of the tool table.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tool {
    /// Number by which T and H call it; not 0, which is the empty spindle.
    pub number: u32,
    /// Pocket of the magazine, where there is one.
    pub pocket: Option<u32>,
    /// Length offset per axis, mm or rad: added to programmed coordinates while G43 is on.
    pub offset: AxisVector,
    /// Diameter, mm.
    pub diameter_mm: f64,
}

/// What M6 does before the tool is another one, beside resting and stopping the spindle.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ToolChange {
    /// Machine coordinate of Z to which the tool is taken up by a rapid, where it stands lower, mm.
    pub retract_z_mm: Option<f64>,
    /// The subroutine that changes the tool, by the name of its file; where there is none, whoever operates the machine does.
    pub sub: Option<String>,
}

/// The input of the probe, for G31 and G38.2 to G38.5.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ProbeInput {
    /// Number of the digital input, 0 to 63.
    pub input: u32,
    /// The input is 0 where the probe touches.
    pub inverted: bool,
}

/// Lines of one direction that somebody has: the others are wired to nobody.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Lines {
    /// Bit n is line n.
    pub mask: u64,
    /// What there is, in words: numbers, and names where they have one.
    pub shown: String,
}

impl Lines {
    /// All of them.
    pub fn all() -> Self {
        Self {
            mask: u64::MAX,
            shown: String::new(),
        }
    }

    /// None of them.
    pub fn none() -> Self {
        Self {
            mask: 0,
            shown: String::new(),
        }
    }

    /// Why line `number` cannot be used, where nobody has it; `what` it is, as in "output".
    pub(crate) fn refusal(&self, what: &str, number: u32) -> Option<String> {
        let there = if self.shown.is_empty() {
            "there is none".to_owned()
        } else {
            format!("there are {}", self.shown)
        };
        (self.mask >> number & 1 == 0).then(|| format!("no driver has {what} {number}; {there}"))
    }
}

/// The machine as a part program sees it. A run starts from this alone and writes nothing back.
#[derive(Clone, Debug)]
pub struct Config {
    /// The axes.
    pub axes: Axes,
    /// Lowest and highest machine coordinate per axis, mm or rad; infinite where there is no limit.
    pub travel_mm: [(f64, f64); MAX_AXES],
    /// Where the machine stands when the program starts, machine coordinates, mm or rad.
    pub start: AxisVector,
    /// Reference positions of G28 and G30 before the program stores others, machine coordinates, mm or rad.
    pub reference: [AxisVector; 2],
    /// The tool table. Where it is empty any T number is accepted.
    pub tools: Vec<Tool>,
    /// Where the tool table is empty: G43 H takes the length of every tool as zero, instead of being refused.
    pub zero_length_without_table: bool,
    /// How tools are changed.
    pub tool_change: ToolChange,
    /// Tool in the spindle at the start, 0 for none.
    pub tool_in_spindle: u32,
    /// Least and greatest time constant that TA may ask for, s.
    pub time_constant_s: (f64, f64),
    /// Whether lines that begin with `/` are skipped.
    pub block_delete: bool,
    /// The probe, where the machine has one.
    pub probe: Option<ProbeInput>,
    /// Outputs that M62 to M65 may switch.
    pub outputs: Lines,
    /// Inputs that M66 may read.
    pub inputs: Lines,
    /// Analogue outputs that M67 and M68 may set.
    pub analog_outputs: Lines,
    /// Analogue inputs that M66 may read.
    pub analog_inputs: Lines,
    /// Somebody turns the spindle to an angle (M19).
    pub orients_spindle: bool,
    /// Numbers of the commands M100 to M199 that programs may use.
    pub user_commands: Vec<u32>,
    /// Folders in which the files of subroutines are looked up, the first first.
    pub subroutine_path: Vec<PathBuf>,
    /// How many lines a program with O-words may execute in the first pass, and in the second without an item.
    pub max_steps: u64,
    /// Names whose values in the program somebody watches for: each becomes an [`crate::Item::Stated`].
    pub watched: Vec<Watched>,
    /// What has lasted from the programs before; its tool table is to be that of `tools`. None where a program begins with
    /// nothing but this machine.
    pub persistent: Option<Arc<PersistentData>>,
    /// Spindle and coolant as they are when the program begins.
    pub on: SwitchedOn,
}

/// The first of the numbers of commands of the machine's own: M100.
pub const FIRST_USER_COMMAND: u32 = 100;
/// The last of them: M199.
pub const LAST_USER_COMMAND: u32 = 199;

/// Lines that a program with O-words may execute where the machine file does not say: some ten seconds.
pub const DEFAULT_MAX_STEPS: u64 = 50_000_000;

impl Config {
    /// A machine with `axes`, without travel limits and tools, standing at zero.
    pub fn new(axes: Axes) -> Self {
        Self {
            axes,
            travel_mm: [(f64::NEG_INFINITY, f64::INFINITY); MAX_AXES],
            start: AxisVector::ZERO,
            reference: [AxisVector::ZERO; 2],
            tools: Vec::new(),
            zero_length_without_table: false,
            tool_change: ToolChange::default(),
            tool_in_spindle: 0,
            time_constant_s: (0.0, f64::INFINITY),
            block_delete: false,
            probe: None,
            outputs: Lines::all(),
            inputs: Lines::all(),
            analog_outputs: Lines::all(),
            analog_inputs: Lines::all(),
            orients_spindle: true,
            user_commands: Vec::new(),
            subroutine_path: Vec::new(),
            max_steps: DEFAULT_MAX_STEPS,
            watched: Vec::new(),
            persistent: None,
            on: SwitchedOn::default(),
        }
    }
}
