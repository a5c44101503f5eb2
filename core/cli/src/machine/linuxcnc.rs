//! The INI file of a LinuxCNC configuration.

use std::collections::BTreeMap;

use super::draft::{Draft, DraftAxis, DraftJoint, LETTERS, number as shown};
use super::new::number;
use super::{AtLine, Taken};

/// Travel of an axis that turns without end, where the file states none, deg.
const ENDLESS_DEG: f64 = 36_000.0;
/// Fine periods that the loops can keep, ms.
const FINE_PERIODS_MS: std::ops::RangeInclusive<f64> = 0.1..=100.0;

/// Sections that say nothing of the machine's motion, and why none of them is taken over.
const OTHER_SECTIONS: [(&str, &str); 9] = [
    (
        "DISPLAY",
        "how a user interface looks is a matter of the client",
    ),
    ("FILTER", "programs are made ready before they are loaded"),
    (
        "HAL",
        "pins and signals are a matter of the driver: docs/drives.md",
    ),
    (
        "HALUI",
        "pins and signals are a matter of the driver: docs/drives.md",
    ),
    ("TASK", "there is one process"),
    (
        "EMCIO",
        "the tool table is taken over by tandem state import --tools",
    ),
    ("APPLICATIONS", "nothing is started beside the controller"),
    ("PYTHON", "words are not remapped"),
    ("HOSTMOT2", "the driver has options of its own"),
];

/// A value, and where it stands.
#[derive(Clone, Debug)]
struct Entry {
    line: usize,
    value: String,
    used: bool,
}

/// Entries by section and key.
struct Ini {
    entries: BTreeMap<(String, String), Entry>,
    /// Sections, and the lines of their headers.
    sections: BTreeMap<String, usize>,
    wrong: Vec<AtLine>,
    left: Vec<AtLine>,
}

/// Reads an INI file.
///
/// # Errors
/// The lines that are wrong, and why.
pub fn read(text: &str, name: &str) -> Result<Taken, Vec<AtLine>> {
    let mut ini = Ini::parse(text);
    let name = ini
        .text("EMC", "MACHINE")
        .map_or_else(|| name.to_string(), |(_, name)| name);
    let mut draft = Draft::new(&name, "Taken over from LinuxCNC by tandem machine import.");
    let mm = ini.linear_unit();
    let letters = ini.coordinates();
    let caps = [
        ini.scaled("TRAJ", "MAX_LINEAR_VELOCITY", 60.0 * mm),
        ini.scaled("TRAJ", "MAX_LINEAR_ACCELERATION", mm),
    ];
    for (at, letter) in letters.iter().enumerate() {
        let joints: Vec<usize> = (0..letters.len())
            .filter(|joint| letters[*joint] == *letter)
            .collect();
        if joints[0] != at {
            continue;
        }
        if let Some(axis) = ini.axis(*letter, &joints, mm, caps) {
            draft.axes.push(axis);
        }
        if joints.len() > 1 {
            draft
                .joints
                .extend((1..=joints.len()).map(|count| DraftJoint {
                    name: format!("{letter}{count}"),
                    axis: *letter,
                }));
        }
    }
    draft.fine_period_ms = ini.fine_period_ms();
    draft.max_rpm = ini.scaled("SPINDLE_0", "MAX_FORWARD_VELOCITY", 1.0);
    draft.min_rpm = ini
        .scaled("SPINDLE_0", "MIN_FORWARD_VELOCITY", 1.0)
        .filter(|least| *least > 0.0 && draft.max_rpm.is_none_or(|most| *least < most));
    if !ini.wrong.is_empty() {
        ini.wrong.sort_by_key(|at| at.line);
        return Err(ini.wrong);
    }
    Ok(Taken {
        draft,
        left: ini.left(),
    })
}

impl Ini {
    fn parse(text: &str) -> Self {
        let mut this = Self {
            entries: BTreeMap::new(),
            sections: BTreeMap::new(),
            wrong: vec![],
            left: vec![],
        };
        let mut section = String::new();
        for (number, line) in (1..).zip(text.lines()) {
            let line = line.trim();
            if line.starts_with("#INCLUDE") {
                this.left.push(AtLine::new(
                    number,
                    format!("{line}: files that are included are not read"),
                ));
            } else if line.is_empty() || line.starts_with(['#', ';']) {
            } else if let Some(name) = line.strip_prefix('[') {
                let Some((name, _)) = name.split_once(']') else {
                    this.wrong
                        .push(AtLine::new(number, format!("{line:?} has no ]")));
                    continue;
                };
                section = name.trim().to_ascii_uppercase();
                this.sections.entry(section.clone()).or_insert(number);
            } else if let Some((key, value)) = line.split_once('=') {
                let value = value.split(" #").next().unwrap_or_default();
                let value = value.split(" ;").next().unwrap_or_default();
                let at = (section.clone(), key.trim().to_ascii_uppercase());
                let entry = Entry {
                    line: number,
                    value: value.trim().to_string(),
                    used: false,
                };
                // LinuxCNC takes the first of several, except of lists, which are none of ours.
                this.entries.entry(at).or_insert(entry);
            } else if !OTHER_SECTIONS.iter().any(|(name, _)| *name == section) {
                this.wrong.push(AtLine::new(
                    number,
                    format!("{line:?} is neither a [SECTION] nor KEY = VALUE"),
                ));
            }
        }
        if this.sections.is_empty() && this.wrong.is_empty() {
            this.wrong
                .push(AtLine::new(1, "there is no [SECTION]: this is no INI file"));
        }
        this
    }

    /// A text and its line.
    fn text(&mut self, section: &str, key: &str) -> Option<(usize, String)> {
        let entry = self
            .entries
            .get_mut(&(section.to_string(), key.to_string()))?;
        entry.used = true;
        Some((entry.line, entry.value.clone()))
    }

    /// A number times `scale`; what is none is noted.
    fn scaled(&mut self, section: &str, key: &str, scale: f64) -> Option<f64> {
        let (line, text) = self.text(section, key)?;
        // 1e99 and its like stand for no limit.
        let value: Result<f64, String> = match text.parse::<f64>() {
            Ok(value) if value.is_finite() && value.abs() > 1e9 => return None,
            _ => number(&text),
        };
        match value {
            Ok(value) => Some(value * scale),
            Err(why) => {
                self.wrong
                    .push(AtLine::new(line, format!("[{section}]{key}: {why}")));
                None
            }
        }
    }

    /// The linear unit of the file, mm.
    fn linear_unit(&mut self) -> f64 {
        match self.text("TRAJ", "LINEAR_UNITS") {
            None => 1.0,
            Some((line, unit)) => match unit.to_ascii_lowercase().as_str() {
                "mm" | "metric" => 1.0,
                "in" | "inch" | "imperial" => 25.4,
                other => {
                    let why = format!("[TRAJ]LINEAR_UNITS: {other:?} is neither mm nor inch");
                    self.wrong.push(AtLine::new(line, why));
                    1.0
                }
            },
        }
    }

    /// The axis of each joint.
    fn coordinates(&mut self) -> Vec<char> {
        let of_kinematics = self.text("KINS", "KINEMATICS").and_then(|(line, text)| {
            let mut words = text.split_whitespace();
            let module = words.next().unwrap_or_default().to_string();
            if module != "trivkins" {
                let why = format!(
                    "[KINS]KINEMATICS: {module}: only trivkins is taken over; docs/kinematics.md says what there is"
                );
                self.wrong.push(AtLine::new(line, why));
            }
            let coordinates =
                words.find_map(|word| Some(word.strip_prefix("coordinates=")?.to_string()));
            Some((line, coordinates?))
        });
        let trajectory = self.text("TRAJ", "COORDINATES");
        let (line, text) = of_kinematics
            .or(trajectory)
            .unwrap_or((1, "X Y Z".to_string()));
        let letters: Vec<char> = text
            .chars()
            .filter(|c| !c.is_whitespace())
            .map(|c| c.to_ascii_lowercase())
            .collect();
        if letters.is_empty() || letters.iter().any(|letter| !LETTERS.contains(*letter)) {
            let why = format!("{text:?} are no coordinates: letters of X Y Z A B C U V W");
            self.wrong.push(AtLine::new(line, why));
            return vec![];
        }
        letters
    }

    /// The narrowest of what an axis and its joints state, and its line.
    fn of_all(
        &mut self,
        letter: char,
        joints: &[usize],
        key: &str,
        scale: f64,
        narrower: fn(f64, f64) -> f64,
    ) -> Option<f64> {
        let axis = format!("AXIS_{}", letter.to_ascii_uppercase());
        let sections = joints.iter().map(|joint| format!("JOINT_{joint}"));
        let sections: Vec<String> = std::iter::once(axis).chain(sections).collect();
        sections
            .iter()
            .filter_map(|section| self.scaled(section, key, scale))
            .reduce(narrower)
    }

    fn axis(
        &mut self,
        letter: char,
        joints: &[usize],
        mm: f64,
        caps: [Option<f64>; 2],
    ) -> Option<DraftAxis> {
        let first = format!("JOINT_{}", joints[0]);
        let rotary = match self.text(&first, "TYPE") {
            Some((_, kind)) => kind.eq_ignore_ascii_case("ANGULAR"),
            None => "abc".contains(letter),
        };
        let unit = if rotary { 1.0 } else { mm };
        let line = self.section_line(letter, &first);
        let low = self.of_all(letter, joints, "MIN_LIMIT", unit, f64::max);
        let high = self.of_all(letter, joints, "MAX_LIMIT", unit, f64::min);
        let velocity = self.of_all(letter, joints, "MAX_VELOCITY", 60.0 * unit, f64::min);
        let acceleration = self.of_all(letter, joints, "MAX_ACCELERATION", unit, f64::min);
        let jerk = self.of_all(letter, joints, "MAX_JERK", unit, f64::min);
        let [cap_velocity, cap_acceleration] = if rotary { [None; 2] } else { caps };
        let least = |value: Option<f64>, cap: Option<f64>| match (value, cap) {
            (Some(value), Some(cap)) => Some(value.min(cap)),
            (value, cap) => value.or(cap),
        };
        let endless = |end: f64| if rotary { Some(end) } else { None };
        let low = low.or(endless(-ENDLESS_DEG));
        let high = high.or(endless(ENDLESS_DEG));
        let mut needed = |key: &str, value: Option<f64>| {
            if value.is_none() {
                let why = format!(
                    "axis {letter} has no {key}, neither in [AXIS_{}] nor in [{first}]",
                    letter.to_ascii_uppercase()
                );
                self.wrong.push(AtLine::new(line, why));
            }
            value
        };
        let low = needed("MIN_LIMIT", low);
        let high = needed("MAX_LIMIT", high);
        let velocity = needed("MAX_VELOCITY", least(velocity, cap_velocity));
        let acceleration = needed("MAX_ACCELERATION", least(acceleration, cap_acceleration));
        let (low, high, velocity, acceleration) = (low?, high?, velocity?, acceleration?);
        let values = [
            (
                low < high,
                format!("its travel, {low} to {high}, has no inside"),
            ),
            (
                velocity > 0.0,
                format!("its MAX_VELOCITY, {velocity}, is not above zero"),
            ),
            (
                acceleration > 0.0,
                format!("its MAX_ACCELERATION, {acceleration}, is not above zero"),
            ),
        ];
        for (_, why) in values.iter().filter(|(right, _)| !right) {
            self.wrong
                .push(AtLine::new(line, format!("axis {letter}: {why}")));
        }
        let mut axis = DraftAxis::new(letter, [low, high], velocity, acceleration);
        axis.rotary = rotary;
        axis.jerk = jerk.filter(|jerk| *jerk > 0.0);
        let home = self.scaled(&first, "HOME", unit);
        axis.home = home.filter(|home| (low..=high).contains(home));
        axis.following_error = self
            .of_all(letter, joints, "FERROR", unit, f64::min)
            .filter(|error| *error > 0.0);
        self.homing(&first, &mut axis, unit);
        Some(axis)
    }

    /// What is known of homing, for a table that still lacks the input.
    fn homing(&mut self, joint: &str, axis: &mut DraftAxis, unit: f64) {
        let name = if axis.rotary { "deg" } else { "mm" };
        for (theirs, ours, scale) in [
            ("HOME_SEQUENCE", "sequence".to_string(), 1.0),
            (
                "HOME_SEARCH_VEL",
                format!("search_{name}_per_min"),
                60.0 * unit,
            ),
            (
                "HOME_LATCH_VEL",
                format!("latch_{name}_per_min"),
                60.0 * unit,
            ),
            ("HOME_OFFSET", format!("switch_{name}"), unit),
        ] {
            if let Some(value) = self.scaled(joint, theirs, scale) {
                let value = if theirs == "HOME_LATCH_VEL" || theirs == "HOME_SEQUENCE" {
                    value.abs()
                } else {
                    value
                };
                axis.homing.push((ours, shown(value)));
            }
        }
    }

    fn section_line(&self, letter: char, joint: &str) -> usize {
        let axis = format!("AXIS_{}", letter.to_ascii_uppercase());
        let line = self.sections.get(&axis).or(self.sections.get(joint));
        line.copied().unwrap_or(1)
    }

    fn fine_period_ms(&mut self) -> Option<f64> {
        let (line, _) = self.text("EMCMOT", "SERVO_PERIOD")?;
        let period_ms = self.scaled("EMCMOT", "SERVO_PERIOD", 1e-6)?;
        if FINE_PERIODS_MS.contains(&period_ms) {
            Some(period_ms)
        } else {
            self.wrong.push(AtLine::new(
                line,
                format!("[EMCMOT]SERVO_PERIOD: {period_ms} ms is no period of the fine loop"),
            ));
            None
        }
    }

    /// What was not taken over, by line.
    fn left(mut self) -> Vec<AtLine> {
        let other = |section: &str| {
            OTHER_SECTIONS
                .iter()
                .find(|(name, _)| *name == section)
                .map(|(_, why)| *why)
        };
        for (section, line) in &self.sections {
            if let Some(why) = other(section) {
                self.left
                    .push(AtLine::new(*line, format!("[{section}]: {why}")));
            }
        }
        for ((section, key), entry) in &self.entries {
            if !entry.used && other(section).is_none() {
                let why = reason(section, key);
                self.left.push(AtLine::new(
                    entry.line,
                    format!("[{section}]{key} = {}: {why}", entry.value),
                ));
            }
        }
        // Homing is a remark in the file until somebody says which input the switch has.
        for ((section, key), entry) in &self.entries {
            if entry.used && key.starts_with("HOME_") {
                self.left.push(AtLine::new(
                    entry.line,
                    format!("[{section}]{key} = {}: a remark in the file; homing needs the input of the switch (docs/homing.md)", entry.value),
                ));
            }
        }
        self.left.sort_by_key(|at| at.line);
        self.left
    }
}

fn reason(section: &str, key: &str) -> &'static str {
    match key {
        "BACKLASH" | "COMP_FILE" | "COMP_FILE_TYPE" => {
            "backlash and screw errors are not compensated"
        }
        "MIN_FERROR" => "the following error has one limit at all speeds",
        "BIAS" | "P" | "I" | "D" | "FF0" | "FF1" | "FF2" | "DEADBAND" | "OUTPUT_SCALE"
        | "INPUT_SCALE" | "SCALE" | "STEPGEN_MAXACCEL" | "STEPGEN_MAXVEL" | "STEPLEN"
        | "STEPSPACE" | "DIRSETUP" | "DIRHOLD" | "ENCODER_SCALE" => {
            "scales and controllers of drives are a matter of the driver"
        }
        "PARAMETER_FILE" => "parameters are taken over by tandem state import --var",
        "SUBROUTINE_PATH" => "program.subroutine_path names the folder of subroutines",
        "USER_M_PATH" => "[user_commands] lists the commands that M100 to M199 run",
        "RS274NGC_STARTUP_CODE" => "modes are as at the start of every program (docs/gcode.md)",
        _ if key.starts_with("HOME_") => {
            "homing goes by a switch or by the drive itself (docs/homing.md)"
        }
        "LOCKING_INDEXER" | "LOCKING_INDEXER_JOINT" => "there are no locking indexers",
        _ if section.starts_with("JOINT_") || section.starts_with("AXIS_") => {
            "it has no counterpart here"
        }
        _ => "it says nothing of how the machine moves",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MILL: &str = "[EMC]
MACHINE = Portal \"one\"
[KINS]
KINEMATICS = trivkins coordinates=XYYZ
JOINTS = 4
[TRAJ]
LINEAR_UNITS = inch
MAX_LINEAR_VELOCITY = 2.0   # a second
[EMCMOT]
SERVO_PERIOD = 500000
[AXIS_X]
MIN_LIMIT = -1.0
MAX_LIMIT = 9.0
MAX_VELOCITY = 3.0
MAX_ACCELERATION = 20
[JOINT_0]
TYPE = LINEAR
MAX_VELOCITY = 1.5
BACKLASH = 0.001
HOME_SEARCH_VEL = -0.5
HOME_SEQUENCE = -1
[AXIS_Y]
MIN_LIMIT = 0
MAX_LIMIT = 10
MAX_VELOCITY = 1
MAX_ACCELERATION = 10
[JOINT_2]
MAX_ACCELERATION = 8
[AXIS_Z]
MIN_LIMIT = -4
MAX_LIMIT = 0
MAX_VELOCITY = 5
MAX_ACCELERATION = 10
[HAL]
HALFILE = mill.hal
";

    #[test]
    fn the_narrowest_limits_of_axes_and_joints_are_taken_over() {
        let Ok(Taken { draft, left }) = read(MILL, "file") else {
            panic!("it is refused")
        };
        assert_eq!(draft.name, "Portal \"one\"");
        assert_eq!(draft.fine_period_ms, Some(0.5));
        let axes: Vec<_> = draft
            .axes
            .iter()
            .map(|a| (a.letter, a.travel, a.feed, a.acceleration))
            .collect();
        let inch = 25.4;
        assert_eq!(
            axes,
            [
                ('x', [-inch, 9.0 * inch], 1.5 * 60.0 * inch, 20.0 * inch),
                ('y', [0.0, 10.0 * inch], 60.0 * inch, 8.0 * inch),
                ('z', [-4.0 * inch, 0.0], 2.0 * 60.0 * inch, 10.0 * inch),
            ]
        );
        let joints: Vec<_> = draft
            .joints
            .iter()
            .map(|j| (j.name.as_str(), j.axis))
            .collect();
        assert_eq!(joints, [("y1", 'y'), ("y2", 'y')]);
        assert!(
            left.iter()
                .any(|at| at.line == 19 && at.why.contains("BACKLASH")),
            "{left:?}"
        );
        assert!(
            left.iter()
                .any(|at| at.line == 34 && at.why.starts_with("[HAL]")),
            "{left:?}"
        );
    }

    #[test]
    fn what_is_wrong_is_said_with_its_line() {
        for (from, to, line, why) in [
            (
                "MAX_VELOCITY = 1\n",
                "MAX_VELOCITY = fast\n",
                25,
                "\"fast\" is no number",
            ),
            (
                "MAX_VELOCITY = 1\n",
                "MAX_VELOCITY = 0\n",
                22,
                "not above zero",
            ),
            ("MAX_LIMIT = 10\n", "\n", 22, "axis y has no MAX_LIMIT"),
            ("MAX_LIMIT = 10\n", "MAX_LIMIT = -10\n", 22, "has no inside"),
            ("inch", "furlong", 7, "neither mm nor inch"),
            ("trivkins", "5axiskins", 4, "only trivkins"),
            ("[EMCMOT]", "[EMCMOT", 9, "has no ]"),
            ("XYYZ", "XYQ", 4, "no coordinates"),
            ("500000", "5", 10, "no period"),
            ("JOINTS = 4", "JOINTS", 5, "neither a [SECTION] nor"),
        ] {
            let Err(wrong) = read(&MILL.replace(from, to), "file") else {
                panic!("{to:?} is taken")
            };
            assert!(
                wrong
                    .iter()
                    .any(|at| at.line == line && at.why.contains(why)),
                "{to:?}: {wrong:?}"
            );
        }
        assert!(read("hello", "file").is_err() && read("", "file").is_err());
    }
}
