//! LinuxCNC's two files of what lasts: the parameters (`.var`) and the tool table (`tool.tbl`).

use std::collections::BTreeSet;
use std::fmt::Write as _;

use tandem_gcode::WORK_SYSTEMS;
use tandem_sdk::{Axes, AxisVector};

use crate::data::{PersistentState, Tool};
use crate::write::{MAX_TOOL_NUMBER, is_user_parameter};

/// The order of LinuxCNC's axes in its parameters.
const LETTERS: &str = "XYZABCUVW";
/// First parameters of the places of G28 and G30.
const REFERENCES: [usize; 2] = [5161, 5181];
/// Whether an offset of G92 is in force, and its first value.
const G92_IN_FORCE: usize = 5210;
const G92: usize = 5211;
/// Number of the coordinate system in force, from 1.
const ACTIVE: usize = 5220;
/// First parameter of G54; each system has twenty, of which the tenth is its rotation.
const SYSTEMS: usize = 5221;
const OF_A_SYSTEM: usize = 20;
const ROTATION: usize = 9;

/// The linear unit of a machine at LinuxCNC (`[TRAJ]LINEAR_UNITS`): its files are in it. Angles are in degrees.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LinearUnit {
    /// Millimetres.
    Mm,
    /// Inches.
    Inch,
}

impl LinearUnit {
    fn mm(self) -> f64 {
        match self {
            Self::Mm => 1.0,
            Self::Inch => 25.4,
        }
    }
}

/// A line of a file that cannot be read, or that was not taken over.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AtLine {
    /// The line, from 1.
    pub line: u32,
    /// Why.
    pub why: String,
}

/// What both files are read and written with.
#[derive(Clone, Copy, Debug)]
pub struct LinuxCnc<'a> {
    /// The axes, with which vectors are ordered.
    pub axes: &'a Axes,
    /// The unit of the files.
    pub unit: LinearUnit,
}

impl LinuxCnc<'_> {
    /// The state as a parameter file; `home` is the place of G28 and G30 where none is stored.
    pub fn variables(&self, state: &PersistentState, home: &AxisVector) -> String {
        let offsets = &state.offsets;
        let mut rows: Vec<_> = state
            .parameters
            .iter()
            .map(|(number, value)| (*number, *value))
            .collect();
        let mut vector = |first: usize, vector: &AxisVector| {
            rows.extend((0..LETTERS.len()).map(|nth| (first + nth, self.value(nth, vector))));
        };
        for (first, place) in REFERENCES.iter().zip(&state.reference) {
            vector(*first, place.as_ref().unwrap_or(home));
        }
        vector(G92, &offsets.g92_stored);
        for (system, origin) in offsets.origins.iter().enumerate() {
            vector(SYSTEMS + OF_A_SYSTEM * system, origin);
        }
        let rotations = offsets.rotations_rad.iter().enumerate();
        rows.extend(
            rotations.map(|(system, turn)| {
                (SYSTEMS + OF_A_SYSTEM * system + ROTATION, turn.to_degrees())
            }),
        );
        rows.push((
            G92_IN_FORCE,
            f64::from(u8::from(offsets.g92 != AxisVector::ZERO)),
        ));
        rows.push((ACTIVE, (offsets.active_system + 1) as f64));
        // LinuxCNC refuses a file that is not in order.
        rows.sort_unstable_by_key(|row| row.0);
        rows.iter()
            .fold(String::new(), |mut text, (number, value)| {
                let _ = writeln!(text, "{number}\t{value:.9}");
                text
            })
    }

    /// The tools as a tool table: wear is added to what was measured, because LinuxCNC has no place for it.
    pub fn tools(&self, state: &PersistentState) -> String {
        let mut text = String::new();
        for tool in state.tools.values() {
            let seen = tool.to_program();
            let _ = write!(
                text,
                "T{} P{}",
                tool.number,
                tool.pocket.unwrap_or(tool.number)
            );
            for (nth, letter) in LETTERS.char_indices() {
                let value = self.value(nth, &seen.offset);
                if value != 0.0 {
                    let _ = write!(text, " {letter}{value:.9}");
                }
            }
            let _ = write!(text, " D{:.9}", seen.diameter_mm / self.unit.mm());
            for (letter, value) in [('I', tool.front_angle_deg), ('J', tool.back_angle_deg)] {
                if value != 0.0 {
                    let _ = write!(text, " {letter}{value:.9}");
                }
            }
            let _ = if tool.orientation == 0 {
                Ok(())
            } else {
                write!(text, " Q{}", tool.orientation)
            };
            let remark = if tool.remark.is_empty() {
                &tool.name
            } else {
                &tool.remark
            };
            let _ = writeln!(text, " ;{}", remark.replace(['\n', '\r'], " "));
        }
        text
    }

    /// The value of the `nth` letter in the unit of the files; zero where the machine has no such axis.
    fn value(&self, nth: usize, vector: &AxisVector) -> f64 {
        match self.axes.index(letter(nth)) {
            Some(axis) if self.axes.is_rotary(axis) => vector[axis].to_degrees(),
            Some(axis) => vector[axis] / self.unit.mm(),
            None => 0.0,
        }
    }

    /// Puts the value of the `nth` letter in; why not, where the machine has no such axis and the value says something.
    fn put(&self, nth: usize, value: f64, vector: &mut AxisVector) -> Result<(), String> {
        match self.axes.index(letter(nth)) {
            Some(axis) if self.axes.is_rotary(axis) => vector[axis] = value.to_radians(),
            Some(axis) => vector[axis] = value * self.unit.mm(),
            None if value == 0.0 => {}
            None => return Err(format!("the machine has no axis {}", letter(nth))),
        }
        Ok(())
    }

    /// Reads a parameter file into `state`. What was not taken over.
    ///
    /// # Errors
    /// A line that is no number with its value; `state` is then as far as the line before.
    pub fn read_variables(
        &self,
        text: &str,
        state: &mut PersistentState,
    ) -> Result<Vec<AtLine>, AtLine> {
        let mut left = Vec::new();
        let mut last = 0;
        let mut in_force = None;
        for (line, text) in (1..).zip(text.lines()) {
            if text.trim().is_empty() {
                continue;
            }
            let wrong = |why: String| AtLine { line, why };
            let mut words = text.split_whitespace();
            let (Some(number), Some(value)) = (words.next(), words.next()) else {
                return Err(wrong(format!(
                    "a line has the number of a parameter and its value, not \"{}\"",
                    shown(text)
                )));
            };
            let number: usize = number
                .parse()
                .map_err(|_| wrong(format!("\"{}\" is no number of a parameter", shown(number))))?;
            let value = finite(value).map_err(wrong)?;
            if number <= last {
                return Err(wrong(format!(
                    "#{number} stands behind #{last}: a parameter file is in order"
                )));
            }
            last = number;
            if number == G92_IN_FORCE {
                in_force = Some(value != 0.0);
            } else if let Err(why) = self.variable(number, value, state) {
                left.push(AtLine {
                    line,
                    why: format!("#{number} = {value} was not taken over: {why}"),
                });
            }
        }
        let offsets = &mut state.offsets;
        // Files of old versions do not say it: what is stored was in force.
        offsets.g92 = if in_force == Some(false) {
            AxisVector::ZERO
        } else {
            offsets.g92_stored
        };
        Ok(left)
    }

    fn variable(
        &self,
        number: usize,
        value: f64,
        state: &mut PersistentState,
    ) -> Result<(), String> {
        let offsets = &mut state.offsets;
        let nth = |first: usize| number.checked_sub(first).filter(|nth| *nth < LETTERS.len());
        if let Some((which, nth)) = (0..2).find_map(|which| Some((which, nth(REFERENCES[which])?)))
        {
            return self.put(
                nth,
                value,
                state.reference[which].get_or_insert(AxisVector::ZERO),
            );
        }
        if let Some(nth) = nth(G92) {
            return self.put(nth, value, &mut offsets.g92_stored);
        }
        if number == ACTIVE {
            let systems = 1.0..=WORK_SYSTEMS as f64;
            if value.fract() != 0.0 || !systems.contains(&value) {
                return Err(format!("the systems are 1 to {WORK_SYSTEMS}"));
            }
            offsets.active_system = value as usize - 1;
            return Ok(());
        }
        if (SYSTEMS..SYSTEMS + OF_A_SYSTEM * WORK_SYSTEMS).contains(&number) {
            let system = (number - SYSTEMS) / OF_A_SYSTEM;
            let nth = (number - SYSTEMS) % OF_A_SYSTEM;
            if nth < LETTERS.len() {
                return self.put(nth, value, &mut offsets.origins[system]);
            }
            if nth == ROTATION {
                offsets.rotations_rad[system] = value.to_radians();
                return Ok(());
            }
        }
        if is_user_parameter(number) {
            state.parameters.insert(number, value);
            return Ok(());
        }
        if value == 0.0 {
            Ok(())
        } else {
            Err("it does not last".into())
        }
    }

    /// Reads a tool table into `state`: tools are added, or take the place of those with their number, of which name, corner
    /// radius and life stay. What was not taken over.
    ///
    /// # Errors
    /// A line that cannot be read; `state` is then as far as the line before.
    pub fn read_tools(
        &self,
        text: &str,
        state: &mut PersistentState,
    ) -> Result<Vec<AtLine>, AtLine> {
        let mut left = Vec::new();
        let mut seen = BTreeSet::new();
        for (line, text) in (1..).zip(text.lines()) {
            let (words, remark) = text.split_once(';').unwrap_or((text, ""));
            if words.trim().is_empty() {
                continue;
            }
            let wrong = |why: String| AtLine { line, why };
            let mut not_taken = Vec::new();
            let read = self.tool(words, &mut not_taken).map_err(wrong)?;
            left.extend(not_taken.into_iter().map(|why| AtLine { line, why }));
            if read.number == 0 {
                let why = "tool 0 was not taken over: it is the empty spindle".into();
                left.push(AtLine { line, why });
                continue;
            }
            if !seen.insert(read.number) {
                return Err(wrong(format!("tool {} is listed twice", read.number)));
            }
            let before = state.tools.remove(&read.number).unwrap_or_default();
            let (name, life, corner_radius_mm) =
                (before.name, before.life, before.corner_radius_mm);
            let remark = remark.trim().to_owned();
            state.tools.insert(
                read.number,
                Tool {
                    name,
                    corner_radius_mm,
                    life,
                    remark,
                    ..read
                },
            );
        }
        Ok(left)
    }

    fn tool(&self, words: &str, left: &mut Vec<String>) -> Result<Tool, String> {
        let mut tool = Tool::default();
        let mut has_number = false;
        for word in words.split_whitespace() {
            let letter = word.chars().next().unwrap_or_default();
            let upper = letter.to_ascii_uppercase();
            let value = finite(&word[letter.len_utf8()..]).map_err(|why| {
                format!(
                    "{why} in \"{}\": a word is a letter with a number, as in T1 or Z+20.5",
                    shown(word)
                )
            })?;
            let whole = |most: u32| {
                let whole =
                    Some(value).filter(|v| v.fract() == 0.0 && (0.0..=f64::from(most)).contains(v));
                whole.map(|v| v as u32).ok_or_else(|| {
                    format!("{upper} is a whole number from 0 to {most}, not {value}")
                })
            };
            match upper {
                'T' => {
                    tool.number = whole(MAX_TOOL_NUMBER)?;
                    has_number = true;
                }
                'P' => tool.pocket = Some(whole(MAX_TOOL_NUMBER)?),
                'D' => tool.diameter_mm = value * self.unit.mm(),
                'I' => tool.front_angle_deg = value,
                'J' => tool.back_angle_deg = value,
                'Q' => tool.orientation = whole(9)?,
                _ => match LETTERS.find(upper) {
                    Some(nth) => {
                        if let Err(why) = self.put(nth, value, &mut tool.offset) {
                            left.push(format!("{word} was not taken over: {why}"));
                        }
                    }
                    None => {
                        return Err(format!(
                            "\"{}\" is no word of a tool table: those are T P X Y Z A B C U V W D I J Q",
                            shown(word)
                        ));
                    }
                },
            }
        }
        if has_number {
            Ok(tool)
        } else {
            Err("T, the number of the tool, is missing".into())
        }
    }
}

/// The `nth` letter.
fn letter(nth: usize) -> char {
    char::from(LETTERS.as_bytes()[nth])
}

fn finite(text: &str) -> Result<f64, String> {
    let value = text.parse().ok().filter(|value: &f64| value.is_finite());
    value.ok_or_else(|| format!("\"{}\" is no number", shown(text)))
}

/// The beginning of what may be long.
fn shown(text: &str) -> String {
    text.chars().take(40).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mill() -> Axes {
        Axes::new(&[('X', false), ('Y', false), ('Z', false), ('A', true)]).unwrap()
    }

    fn read(variables: bool, text: &str) -> Result<(PersistentState, Vec<String>), String> {
        let axes = mill();
        let files = LinuxCnc {
            axes: &axes,
            unit: LinearUnit::Inch,
        };
        let mut state = PersistentState::default();
        let read = if variables {
            files.read_variables(text, &mut state)
        } else {
            files.read_tools(text, &mut state)
        };
        let shown = |at: AtLine| format!("{}: {}", at.line, at.why);
        read.map(|left| (state, left.into_iter().map(shown).collect()))
            .map_err(shown)
    }

    #[test]
    fn what_a_shop_has_is_read_and_the_rest_is_said() {
        let text = "31\t7\n5061 0\n5070 1.0\n5161\t1.0\n5210 0\n5211 2.0\n5220 3.0\n5221\t-1\n5224 90\n5225 4\n5230 45\n5399 0\n";
        let (state, left) = read(true, text).unwrap();
        assert_eq!(state.reference[0], Some(AxisVector::from_slice(&[25.4])));
        assert_eq!(
            (state.offsets.g92, state.offsets.g92_stored[0]),
            (AxisVector::ZERO, 50.8)
        );
        assert_eq!(state.offsets.active_system, 2);
        let right = std::f64::consts::FRAC_PI_2;
        assert_eq!(
            state.offsets.origins[0],
            AxisVector::from_slice(&[-25.4, 0.0, 0.0, right])
        );
        assert_eq!(state.offsets.rotations_rad[0], right / 2.0);
        assert_eq!(state.parameters, [(31, 7.0)].into());
        let expected = [
            "3: #5070 = 1 was not taken over: it does not last",
            "10: #5225 = 4 was not taken over: the machine has no axis B",
        ];
        assert_eq!(left, expected);

        let text = "; my tools\nT1 P2 Z+1.5 d0.5 ;drill \"a\"\n\nT0 P0 B2\nT7 P3 A90 I5 J-5 Q2\n";
        let (state, left) = read(false, text).unwrap();
        let drill = &state.tools[&1];
        assert_eq!(
            (drill.offset[2], drill.diameter_mm, drill.pocket),
            (1.5 * 25.4, 12.7, Some(2))
        );
        assert_eq!(drill.remark, "drill \"a\"");
        let turning = &state.tools[&7];
        assert_eq!(
            (
                turning.offset[3],
                turning.orientation,
                turning.back_angle_deg
            ),
            (right, 2, -5.0)
        );
        let expected = [
            "4: B2 was not taken over: the machine has no axis B",
            "4: tool 0 was not taken over: it is the empty spindle",
        ];
        assert_eq!(left, expected);
    }

    #[test]
    fn what_cannot_be_read_is_named_by_its_line() {
        for (variables, text, why) in [
            (
                true,
                "5161 1\nhello\n",
                "2: a line has the number of a parameter and its value, not \"hello\"",
            ),
            (true, "5161 nan\n", "1: \"nan\" is no number"),
            (true, "-3 1\n", "1: \"-3\" is no number of a parameter"),
            (
                true,
                "5162 1\n5161 1\n",
                "2: #5161 stands behind #5162: a parameter file is in order",
            ),
            (false, "T1 P1\nT1 P2", "2: tool 1 is listed twice"),
            (false, "P1 Z2", "1: T, the number of the tool, is missing"),
            (
                false,
                "T1 Zx",
                "1: \"x\" is no number in \"Zx\": a word is a letter with a number, as in T1 or Z+20.5",
            ),
            (
                false,
                "T1.5",
                "1: T is a whole number from 0 to 99999, not 1.5",
            ),
            (
                false,
                "POC FMS",
                "1: \"OC\" is no number in \"POC\": a word is a letter with a number, as in T1 or Z+20.5",
            ),
            (
                false,
                "T1 ü5",
                "1: \"ü5\" is no word of a tool table: those are T P X Y Z A B C U V W D I J Q",
            ),
        ] {
            assert_eq!(read(variables, text).unwrap_err(), why, "{text}");
        }
    }
}
