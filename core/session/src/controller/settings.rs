//! What clients set: offsets, tools, parameters.

use std::fmt::Write as _;
use std::sync::Arc;

use serde_json::{Value, json};
use tandem_gcode::{PersistentData, Tool, system_code};
use tandem_sdk::AxisVector;
use tandem_state::Change;

use super::dispatcher::Dispatcher;
use super::lines::lock;
use super::request::Asked;

impl Dispatcher {
    /// Changes what lasts; it is on disk when this returns.
    pub fn set(&self, asked: &Asked, name: &str) -> Result<Value, String> {
        let lines = lock(&self.lines);
        let axes = &self.machine.axes;
        self.check_axes(asked)?;
        // Axis words in mm and deg, as keys such as x_mm and a_deg.
        let mut words = String::new();
        for axis in 0..axes.count() {
            let letter = axes.letter(axis);
            if let Some(value) = asked.number_if_any(&self.axis_key(axis))? {
                // A string takes whatever is written to it.
                let _ = write!(words, " {letter}[{value:.9}]");
            }
        }
        let mut changes = vec![];
        let persistent = match name {
            "touch-off" | "set-offset" => {
                let system = match asked.with.get("system") {
                    None => 0,
                    Some(name) => (0..tandem_gcode::WORK_SYSTEMS)
                        .find(|i| Some(system_code(*i).as_str()) == name.as_str())
                        .map(|i| i + 1)
                        .ok_or_else(|| {
                            format!(
                                "{name} is no work coordinate system: G54 to G59, G59.1 to G59.3"
                            )
                        })?,
                };
                if words.is_empty() {
                    return Err(format!(
                        "{name} needs the coordinate of at least one axis, as in \"x_mm\""
                    ));
                }
                let number = if name == "touch-off" { 20 } else { 2 };
                lines.persistent_data_behind(&format!("G10 L{number} P{system}{words}"))?
            }
            "set-parameter" => {
                let (number, value) = (asked.number("number")?, asked.number("value")?);
                if !(31.0..=5000.0).contains(&number) || number.fract() != 0.0 {
                    return Err("a parameter that lasts has a number from 31 to 5000".to_string());
                }
                let mut persistent = lines.standing().persistent_data();
                persistent.parameters.insert(number as u32, value);
                // Beside those that last by themselves, those that somebody has set by hand do.
                changes.push(Change::ListParameter {
                    number: number as usize,
                    value,
                });
                persistent
            }
            _ => self.with_tool(lines.standing().persistent_data(), asked)?,
        };
        changes.push(Change::Program(Arc::new(persistent.clone())));
        // Nothing else changes meanwhile what lasts: nothing is driven, and nothing is begun.
        drop(lines);
        self.persistence.commit(changes)?;
        lock(&self.lines).set_persistent_data(&persistent);
        Ok(json!({ "set": name }))
    }

    fn with_tool(
        &self,
        mut persistent: PersistentData,
        asked: &Asked,
    ) -> Result<PersistentData, String> {
        let number = asked.number("number")?;
        if !(0.0..=99_999.0).contains(&number) || number.fract() != 0.0 {
            return Err("a tool has a number from 1 to 99999; 0 is the empty spindle".to_string());
        }
        let number = number as u32;
        if asked.is_on("in_spindle") {
            persistent.tool_in_spindle = number;
        }
        let at = persistent
            .tools
            .iter()
            .position(|tool| tool.number == number);
        let mut tool = at.map_or(
            Tool {
                number,
                pocket: None,
                offset: AxisVector::ZERO,
                diameter_mm: 0.0,
            },
            |at| persistent.tools[at],
        );
        for axis in 0..self.machine.axes.count() {
            if let Some(value) = asked.number_if_any(&self.axis_key(axis))? {
                tool.offset[axis] = if self.machine.axes.is_rotary(axis) {
                    value.to_radians()
                } else {
                    value
                };
            }
        }
        if let Some(mm) = asked.number_if_any("diameter_mm")? {
            tool.diameter_mm = mm;
        }
        match at {
            _ if number == 0 => {}
            Some(at) => persistent.tools[at] = tool,
            None => persistent.tools.push(tool),
        }
        Ok(persistent)
    }

    /// The key of an axis, such as `x_mm` or `a_deg`.
    fn axis_key(&self, axis: usize) -> String {
        let axes = &self.machine.axes;
        let unit = if axes.is_rotary(axis) { "deg" } else { "mm" };
        format!("{}_{unit}", axes.letter(axis).to_ascii_lowercase())
    }

    /// Refuses keys of axes that the machine does not have, or not in this unit.
    fn check_axes(&self, asked: &Asked) -> Result<(), String> {
        let known: Vec<String> = (0..self.machine.axes.count())
            .map(|axis| self.axis_key(axis))
            .collect();
        let is_axis = |key: &&String| {
            let (letter, unit) = key.split_once('_').unwrap_or_default();
            letter.len() == 1 && ["mm", "deg"].contains(&unit)
        };
        match asked
            .with
            .keys()
            .filter(is_axis)
            .find(|key| !known.contains(key))
        {
            Some(key) => Err(format!(
                "the machine has no axis with \"{key}\"; it has {}",
                known.join(", ")
            )),
            None => Ok(()),
        }
    }
}
