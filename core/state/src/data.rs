//! What lasts, as plain data.

use std::collections::BTreeMap;

use tandem_gcode::{PersistentData, WORK_SYSTEMS};
use tandem_machine::Machine;
use tandem_sdk::{AxisVector, MAX_AXES};

/// First and last number of the parameters that last without being asked for, as on most controls.
pub const PERSISTENT_PARAMETERS: (usize, usize) = (500, 999);
/// First and last number of the parameters that are a program's own: those that the state lists already last too, as in
/// LinuxCNC's parameter file.
pub const USER_PARAMETERS: (usize, usize) = (31, 5000);

/// The offsets between program and machine coordinates, as [`PersistentData`] has them. Vectors in mm or rad.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct WorkOffsets {
    /// Origin of each coordinate system in machine coordinates, G54 first.
    pub origins: [AxisVector; WORK_SYSTEMS],
    /// Rotation of each coordinate system about its origin, from X to Y, rad.
    pub rotations_rad: [f64; WORK_SYSTEMS],
    /// Index of the coordinate system in force: 0 for G54.
    pub active_system: usize,
    /// The offset of G92 in force.
    pub g92: AxisVector,
    /// What G92.3 restores.
    pub g92_stored: AxisVector,
}

/// Everything that a machine knows from one session to the next, as far as a session needs it to begin. Vectors are in mm or
/// rad, in the order of the axes with which the store was opened.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PersistentState {
    /// G54 to G59.3, the one in force, and G92.
    pub offsets: WorkOffsets,
    /// The places of G28 and G30 in machine coordinates; none where nobody has stored one: the machine file's `home` counts.
    pub reference: [Option<AxisVector>; 2],
    /// Numbered parameters of [`USER_PARAMETERS`] that last.
    pub parameters: BTreeMap<usize, f64>,
    /// The tools, by their numbers.
    pub tools: BTreeMap<u32, Tool>,
    /// Number of the tool in the spindle, 0 for none.
    pub tool_in_spindle: u32,
    /// Whole turns of each rotary axis from where its drive counts.
    pub turns: [i64; MAX_AXES],
    /// Parameters of the policy script, by their names.
    pub policy_parameters: BTreeMap<String, f64>,
    /// Where the machine stood when it was last written, machine coordinates: history to be shown, never a position to be
    /// used.
    pub last_position: Option<AxisVector>,
    /// The line that was driven last.
    pub driven: Option<Driven>,
    /// Alarms that nobody has acknowledged, the oldest first.
    pub alarms: Vec<Alarm>,
}

impl PersistentState {
    /// What a machine begins with whose file is new: its tool table; nothing else is known.
    pub fn initial(machine: &Machine) -> Self {
        let tools = machine
            .tools
            .tools
            .iter()
            .map(|tool| (tool.number, Tool::from(tool)));
        Self {
            tools: tools.collect(),
            ..Self::default()
        }
    }

    /// All of it that a part program can see; `home` is the place of G28 and G30 where none was stored. No tool length is in
    /// force, as after power-on everywhere.
    pub fn to_program(&self, home: &AxisVector) -> PersistentData {
        let parameters = self.parameters.iter().filter(|(_, value)| **value != 0.0);
        PersistentData {
            origins: self.offsets.origins,
            rotations_rad: self.offsets.rotations_rad,
            active_system: self.offsets.active_system,
            g92: self.offsets.g92,
            g92_stored: self.offsets.g92_stored,
            reference: self.reference.map(|stored| stored.unwrap_or(*home)),
            tool_offset: AxisVector::ZERO,
            parameters: parameters
                .map(|(number, value)| (*number as u32, *value))
                .collect(),
            tools: self.tools.values().map(Tool::to_program).collect(),
            tool_in_spindle: self.tool_in_spindle,
        }
    }

    /// Whether a value of parameter `number` lasts: one of [`PERSISTENT_PARAMETERS`], or one that is listed already.
    pub fn keeps(&self, number: usize) -> bool {
        (PERSISTENT_PARAMETERS.0..=PERSISTENT_PARAMETERS.1).contains(&number)
            || self.parameters.contains_key(&number)
    }
}

/// A tool.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Tool {
    /// Number by which T calls it; never 0, which is no tool.
    pub number: u32,
    /// Pocket of the magazine, where it has one.
    pub pocket: Option<u32>,
    /// What people call it; may be empty.
    pub name: String,
    /// Offset per axis as it was measured, mm or rad.
    pub offset: AxisVector,
    /// What is added to the offset because the tool has worn, mm or rad.
    pub wear: AxisVector,
    /// Diameter as it was measured, mm; 0 where none is stated.
    pub diameter_mm: f64,
    /// What is added to the diameter because the tool has worn, mm.
    pub wear_diameter_mm: f64,
    /// Radius of the corner, or of the nose of a turning tool, mm; 0 where none is stated.
    pub corner_radius_mm: f64,
    /// Front angle of a turning tool, deg.
    pub front_angle_deg: f64,
    /// Back angle of a turning tool, deg.
    pub back_angle_deg: f64,
    /// Orientation of a turning tool, 0 to 9.
    pub orientation: u32,
    /// How much of it is used up.
    pub life: ToolLife,
    /// Free text, one line.
    pub remark: String,
}

impl Tool {
    /// The tool as part programs see it: wear added.
    pub fn to_program(&self) -> tandem_gcode::Tool {
        tandem_gcode::Tool {
            number: self.number,
            pocket: self.pocket,
            offset: self.offset + self.wear,
            diameter_mm: self.diameter_mm + self.wear_diameter_mm,
        }
    }

    /// Takes offset and diameter from what a part program has measured (G10 L1, L10, L11): a new measurement, from which wear
    /// is counted anew.
    pub fn measure(&mut self, measured: &tandem_gcode::Tool) {
        self.number = measured.number;
        self.pocket = self.pocket.or(measured.pocket);
        self.offset = measured.offset;
        self.wear = AxisVector::ZERO;
        self.diameter_mm = measured.diameter_mm;
        self.wear_diameter_mm = 0.0;
    }
}

impl From<&tandem_machine::Tool> for Tool {
    fn from(tool: &tandem_machine::Tool) -> Self {
        Self {
            number: tool.number,
            pocket: Some(tool.pocket),
            name: tool.name.clone(),
            offset: tool.offset,
            diameter_mm: tool.diameter_mm,
            ..Self::default()
        }
    }
}

/// Life counters of a tool.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ToolLife {
    /// Time in the cut, s.
    pub used_s: f64,
    /// Time after which it is worn out, s.
    pub limit_s: Option<f64>,
    /// How often it was taken into the spindle.
    pub uses: u64,
    /// Uses after which it is worn out.
    pub limit_uses: Option<u64>,
}

impl ToolLife {
    /// Whether a limit is reached.
    pub fn is_over(&self) -> bool {
        self.limit_s.is_some_and(|limit| self.used_s >= limit)
            || self.limit_uses.is_some_and(|limit| self.uses >= limit)
    }
}

/// What a job was.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum JobKind {
    /// A part program.
    Program,
    /// Lines by hand.
    Mdi,
    /// A jog.
    Jog,
    /// Homing.
    Homing,
}

impl JobKind {
    /// Each, with the word that stands for it in the file.
    pub const ALL: [(Self, &str); 4] = [
        (Self::Program, "program"),
        (Self::Mdi, "mdi"),
        (Self::Jog, "jog"),
        (Self::Homing, "homing"),
    ];

    /// The word that stands for it.
    pub fn word(self) -> &'static str {
        word_of(&Self::ALL, self)
    }

    /// The kind that a word stands for.
    pub fn of_word(word: &str) -> Option<Self> {
        of_word(&Self::ALL, word)
    }
}

/// How a job ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// It was driven to its end.
    Done,
    /// Somebody aborted it.
    Aborted,
    /// A fault ended it.
    Fault,
    /// An emergency stop ended it.
    EmergencyStop,
    /// The process ended before it did: nobody knows how far it came but by [`Driven`].
    Lost,
}

impl Outcome {
    /// Each, with the word that stands for it in the file.
    pub const ALL: [(Self, &str); 5] = [
        (Self::Done, "done"),
        (Self::Aborted, "aborted"),
        (Self::Fault, "fault"),
        (Self::EmergencyStop, "emergency-stop"),
        (Self::Lost, "lost"),
    ];

    /// The word that stands for it.
    pub fn word(self) -> &'static str {
        word_of(&Self::ALL, self)
    }

    /// The outcome that a word stands for.
    pub fn of_word(word: &str) -> Option<Self> {
        of_word(&Self::ALL, word)
    }
}

fn word_of<T: Copy + PartialEq>(all: &[(T, &'static str)], value: T) -> &'static str {
    all.iter()
        .find(|(known, _)| *known == value)
        .map_or("", |(_, word)| *word)
}

fn of_word<T: Copy>(all: &[(T, &'static str)], word: &str) -> Option<T> {
    all.iter()
        .find(|(_, known)| *known == word)
        .map(|(value, _)| *value)
}

/// A job of the history.
#[derive(Clone, Debug, PartialEq)]
pub struct Job {
    /// Its number, from [`crate::Store::next_job`].
    pub id: u64,
    /// What it was.
    pub kind: JobKind,
    /// The program's path or the line by hand.
    pub program: String,
    /// Hash of the program's text; empty where there is none.
    pub hash: String,
    /// When it began, ms since 1970 (UTC).
    pub started_unix_ms: i64,
    /// How it ended; none while it goes on.
    pub end: Option<JobEnd>,
}

/// The end of a job.
#[derive(Clone, Debug, PartialEq)]
pub struct JobEnd {
    /// When, ms since 1970 (UTC).
    pub at_unix_ms: i64,
    /// How.
    pub outcome: Outcome,
    /// From its first to its last sample, s.
    pub motion_s: f64,
    /// Where that time went by what limited the feed, s, as in the summary of a run.
    pub limited_by_s: BTreeMap<String, f64>,
    /// How often the motion stopped that no program asked for: holds, starvations.
    pub stops: u64,
}

/// Something that an operator must know of.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Alarm {
    /// Its number, from [`crate::Store::next_alarm`].
    pub id: u64,
    /// When it was raised, ms since 1970 (UTC).
    pub raised_unix_ms: i64,
    /// Its word, for programs.
    pub code: String,
    /// Its words, for people.
    pub text: String,
    /// The job in which it was raised.
    pub job: Option<u64>,
    /// When somebody acknowledged it, ms since 1970 (UTC).
    pub acknowledged_unix_ms: Option<i64>,
}

/// The line that is driven.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Driven {
    /// The job.
    pub job: u64,
    /// Hash of the program's text.
    pub hash: String,
    /// Line of the program, from 1.
    pub line: u32,
    /// Epoch of the fine loop, which a stop and a probe change.
    pub epoch: u64,
}
