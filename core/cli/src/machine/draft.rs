//! A machine that is being written down, and the file that it becomes.

use std::fmt::Write as _;

/// The time in which the proposed jerk reaches the acceleration, s: what a machine of ordinary stiffness bears, and short against
/// the way to a usual feed.
const JERK_TIME_S: f64 = 0.05;
/// Letters of the axes, in their order; those in the middle turn.
pub const LETTERS: &str = "xyzabcuvw";

/// Whether the axis of a letter turns, where nothing else is said.
pub fn turns(letter: char) -> bool {
    "abc".contains(letter)
}

/// An axis.
#[derive(Clone, Debug, PartialEq)]
pub struct DraftAxis {
    pub letter: char,
    pub rotary: bool,
    /// Lowest and highest position, mm or deg; the other keys are per minute, per s² and per s³ of these.
    pub travel: [f64; 2],
    pub feed: f64,
    pub rapid: Option<f64>,
    pub acceleration: f64,
    pub jerk: Option<f64>,
    pub home: Option<f64>,
    pub following_error: Option<f64>,
    /// What is known of homing, as keys and values: which input the switch has is not.
    pub homing: Vec<(String, String)>,
}

impl DraftAxis {
    /// An axis with its required keys.
    pub fn new(letter: char, travel: [f64; 2], feed: f64, acceleration: f64) -> Self {
        Self {
            letter,
            rotary: turns(letter),
            travel,
            feed,
            rapid: None,
            acceleration,
            jerk: None,
            home: None,
            following_error: None,
            homing: vec![],
        }
    }

    /// The jerk that is proposed for it.
    pub fn proposed_jerk(&self) -> f64 {
        two_digits(self.acceleration / JERK_TIME_S)
    }
}

/// A second joint of an axis that two drives move.
#[derive(Clone, Debug, PartialEq)]
pub struct DraftJoint {
    pub name: String,
    pub axis: char,
}

/// A machine.
#[derive(Clone, Debug, PartialEq)]
pub struct Draft {
    pub name: String,
    /// Where it comes from, for the first line of the file.
    pub origin: String,
    pub axes: Vec<DraftAxis>,
    /// Joints, where some axis has two.
    pub joints: Vec<DraftJoint>,
    pub fine_period_ms: Option<f64>,
    pub min_rpm: Option<f64>,
    pub max_rpm: Option<f64>,
}

impl Draft {
    /// A machine without axes.
    pub fn new(name: &str, origin: &str) -> Self {
        Self {
            name: name.to_string(),
            origin: origin.to_string(),
            axes: vec![],
            joints: vec![],
            fine_period_ms: None,
            min_rpm: None,
            max_rpm: None,
        }
    }

    /// Every axis without a jerk gets the one that is proposed.
    pub fn propose_jerk(&mut self) {
        for axis in &mut self.axes {
            axis.jerk = axis.jerk.or(Some(axis.proposed_jerk()));
        }
    }

    /// The planner: the one that keeps a jerk limit where every axis has one. Elsewhere the one that needs no allowed speed
    /// difference: look-ahead without one stops at every chord.
    pub fn planner(&self) -> &'static str {
        if self.axes.iter().all(|axis| axis.jerk.is_some()) {
            "smooth"
        } else {
            "block-overlap"
        }
    }

    /// The machine file.
    pub fn text(&self) -> String {
        let mut out = String::new();
        // A string takes whatever is written to it.
        let _ = self.write(&mut out);
        out
    }

    fn write(&self, out: &mut String) -> std::fmt::Result {
        writeln!(out, "# {}", self.origin)?;
        writeln!(
            out,
            "# docs/machine-toml.md lists all keys. Simulated drives move it until [driver] says otherwise."
        )?;
        writeln!(
            out,
            "format = 1\n\n[machine]\nname = {}\n",
            quoted(&self.name)
        )?;
        if let Some(period_ms) = self.fine_period_ms {
            writeln!(out, "[loops]\nfine_period_ms = {}", number(period_ms))?;
            // The rough period is a whole multiple, near the usual one.
            let rough = (8.0 / period_ms).round().max(2.0) * period_ms;
            writeln!(out, "rough_period_ms = {}\n", number(rough))?;
        }
        writeln!(out, "[motion]")?;
        writeln!(
            out,
            "path_tolerance_mm = 0.01         # how far corners may be rounded where a program says nothing (G64 P)"
        )?;
        if self.axes.iter().any(|axis| axis.jerk.is_some()) && self.planner() != "smooth" {
            writeln!(
                out,
                "jerk = \"report\"                  # the planner keeps no jerk: it is shown, not kept"
            )?;
        }
        for axis in &self.axes {
            axis_table(out, axis)?;
        }
        for joint in &self.joints {
            writeln!(
                out,
                "\n[joints.{}]                      # one of the drives of axis {}",
                joint.name, joint.axis
            )?;
            writeln!(out, "axis = \"{}\"", joint.axis)?;
        }
        if self.min_rpm.is_some() || self.max_rpm.is_some() {
            writeln!(out, "\n[spindle]")?;
            for (key, value) in [("min_rpm", self.min_rpm), ("max_rpm", self.max_rpm)] {
                if let Some(value) = value {
                    writeln!(out, "{key} = {}", number(value))?;
                }
            }
        }
        writeln!(out, "\n[planner]")?;
        if self.planner() == "smooth" {
            writeln!(
                out,
                "plugin = \"smooth\"                # keeps velocity, acceleration and jerk of each axis"
            )?;
        } else {
            writeln!(
                out,
                "# Keeps velocity and acceleration. With a max_jerk for each axis \"smooth\" keeps that too, and is gentler on"
            )?;
            writeln!(out, "# the machine.")?;
            writeln!(out, "plugin = \"block-overlap\"")?;
        }
        writeln!(
            out,
            "\n[driver]\nplugin = \"sim\"                   # docs/drives.md: real drives"
        )
    }
}

fn axis_table(out: &mut String, axis: &DraftAxis) -> std::fmt::Result {
    let unit = if axis.rotary { "deg" } else { "mm" };
    writeln!(out, "\n[axes.{}]", axis.letter)?;
    let mut line = |key: String, value: String, remark: &str| -> std::fmt::Result {
        let stated = format!("{key} = {value}");
        if remark.is_empty() {
            writeln!(out, "{stated}")
        } else {
            writeln!(out, "{stated:<32} # {remark}")
        }
    };
    if axis.rotary {
        line("kind".into(), "\"rotary\"".into(), "")?;
    }
    let [low, high] = axis.travel;
    line(
        format!("travel_{unit}"),
        format!("[{}, {}]", number(low), number(high)),
        "lowest and highest position, machine coordinates",
    )?;
    if !(low..=high).contains(&0.0) {
        let start = axis.home.unwrap_or(if low > 0.0 { low } else { high });
        line(
            format!("start_{unit}"),
            number(start),
            "where the simulated machine stands",
        )?;
    }
    if let Some(home) = axis.home {
        line(
            format!("home_{unit}"),
            number(home),
            "where G28 and homing go",
        )?;
    }
    line(format!("max_feed_{unit}_per_min"), number(axis.feed), "")?;
    if let Some(rapid) = axis.rapid {
        line(format!("max_rapid_{unit}_per_min"), number(rapid), "")?;
    }
    line(
        format!("max_acceleration_{unit}_per_s2"),
        number(axis.acceleration),
        "",
    )?;
    match axis.jerk {
        Some(jerk) if jerk == axis.proposed_jerk() => line(
            format!("max_jerk_{unit}_per_s3"),
            number(jerk),
            "proposed: the acceleration is reached in 50 ms",
        )?,
        Some(jerk) => line(format!("max_jerk_{unit}_per_s3"), number(jerk), "")?,
        None => line(
            format!("# max_jerk_{unit}_per_s3"),
            number(axis.proposed_jerk()),
            "proposed: the acceleration is reached in 50 ms",
        )?,
    }
    if let Some(error) = axis.following_error {
        line(format!("max_following_error_{unit}"), number(error), "")?;
    }
    if !axis.homing.is_empty() {
        writeln!(
            out,
            "\n# Homing: which digital input the switch has is for you to say (docs/homing.md)."
        )?;
        writeln!(out, "# [homing.{}]\n# input = …", axis.letter)?;
        for (key, value) in &axis.homing {
            writeln!(out, "# {key} = {value}")?;
        }
    }
    Ok(())
}

/// A number as people write it, without the noise of units that were converted.
pub fn number(value: f64) -> String {
    let rounded: f64 = format!("{value:.9e}").parse().unwrap_or(value);
    let text = format!("{rounded}");
    if text == "-0" { "0".to_string() } else { text }
}

fn two_digits(value: f64) -> f64 {
    format!("{value:.1e}").parse().unwrap_or(value)
}

/// A text as TOML has it.
fn quoted(text: &str) -> String {
    toml::Value::String(text.replace(char::is_control, " ")).to_string()
}
