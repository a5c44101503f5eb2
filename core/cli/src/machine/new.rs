//! A machine of options.

use std::collections::BTreeMap;

use crate::args::NewMachine;

use super::draft::{Draft, DraftAxis, LETTERS};
use super::questions::{self, Answers};

/// The greatest number that is taken, in any unit: beyond it a zero too many was typed.
const MAX_VALUE: f64 = 1e9;

/// The machine that options describe; where no axis is given, that of the answers on standard input.
///
/// # Errors
/// The option and what is wrong with it.
pub fn draft(options: &NewMachine) -> Result<Draft, String> {
    let name = options.name.clone().unwrap_or_else(|| {
        let stem = options.out.file_stem().unwrap_or_default();
        stem.to_string_lossy().into_owned()
    });
    let mut draft = Draft::new(&name, "Written by tandem machine new.");
    if options.axes.is_empty() {
        draft.axes = questions::axes(&mut Answers::of_standard_input())?;
        return Ok(draft);
    }
    let feeds = PerAxis::read("--feed", &options.feeds)?;
    let rapids = PerAxis::read("--rapid", &options.rapids)?;
    let accelerations = PerAxis::read("--acceleration", &options.accelerations)?;
    let jerks = PerAxis::read("--jerk", &options.jerks)?;
    for text in &options.axes {
        let (letter, travel) = axis(text).map_err(|why| format!("--axis {text}: {why}"))?;
        if draft.axes.iter().any(|axis| axis.letter == letter) {
            return Err(format!("--axis {text}: there is an axis {letter} already"));
        }
        let missing = |option: &str| {
            format!(
                "axis {letter} has no {option}: {option} VALUE gives it to all axes, {option} {letter}=VALUE to this one"
            )
        };
        let feed = feeds.of(letter)?.ok_or_else(|| missing("--feed"))?;
        let acceleration = accelerations
            .of(letter)?
            .ok_or_else(|| missing("--acceleration"))?;
        let mut axis = DraftAxis::new(letter, travel, feed, acceleration);
        axis.rapid = rapids.of(letter)?;
        axis.jerk = if jerks.text(letter).is_some_and(|text| text == "none") {
            None
        } else {
            jerks.of(letter)?.or(Some(axis.proposed_jerk()))
        };
        draft.axes.push(axis);
    }
    for values in [&feeds, &rapids, &accelerations, &jerks] {
        values.only_of(&draft.axes)?;
    }
    Ok(draft)
}

/// `x=-250:250`.
fn axis(text: &str) -> Result<(char, [f64; 2]), String> {
    let (name, travel) = text
        .split_once('=')
        .ok_or("it has the form x=LOW:HIGH, as in x=-250:250")?;
    let (low, high) = travel
        .split_once(':')
        .ok_or("its travel has the form LOW:HIGH, as in -250:250")?;
    Ok((letter(name)?, travel_of(low, high)?))
}

/// A travel, lowest and highest.
///
/// # Errors
/// It is none.
pub fn travel_of(low: &str, high: &str) -> Result<[f64; 2], String> {
    let travel = [number(low)?, number(high)?];
    if travel[0] >= travel[1] {
        return Err(format!(
            "the lowest position, {}, is not below the highest, {}",
            travel[0], travel[1]
        ));
    }
    Ok(travel)
}

/// The letter of an axis, in lower case.
///
/// # Errors
/// There is no such axis.
pub fn letter(name: &str) -> Result<char, String> {
    let lower = name.trim().to_ascii_lowercase();
    let mut letters = lower.chars();
    letters
        .next()
        .filter(|letter| letters.next().is_none() && LETTERS.contains(*letter))
        .ok_or_else(|| format!("{name:?} is no axis: x, y, z, a, b, c, u, v or w"))
}

/// A number.
///
/// # Errors
/// It is none, or one that no machine has.
pub fn number(text: &str) -> Result<f64, String> {
    let value: Option<f64> = text.trim().parse().ok();
    value
        .filter(|value| value.abs() <= MAX_VALUE)
        .ok_or_else(|| format!("{:?} is no number that a machine has", text.trim()))
}

/// A number above zero.
///
/// # Errors
/// It is none.
pub fn positive(text: &str) -> Result<f64, String> {
    number(text).and_then(|value| {
        if value > 0.0 {
            Ok(value)
        } else {
            Err(format!("{value} is not above zero"))
        }
    })
}

/// The values of an option, for all axes or for one.
struct PerAxis {
    option: &'static str,
    all: Option<String>,
    one: BTreeMap<char, String>,
}

impl PerAxis {
    fn read(option: &'static str, texts: &[String]) -> Result<Self, String> {
        let mut this = Self {
            option,
            all: None,
            one: BTreeMap::new(),
        };
        for text in texts {
            let before = if let Some((name, value)) = text.split_once('=') {
                let letter = letter(name).map_err(|why| format!("{option} {text}: {why}"))?;
                this.one.insert(letter, value.to_string())
            } else {
                this.all.replace(text.clone())
            };
            if before.is_some() {
                return Err(format!("{option} {text}: it is given twice"));
            }
        }
        Ok(this)
    }

    fn text(&self, letter: char) -> Option<&str> {
        self.one
            .get(&letter)
            .or(self.all.as_ref())
            .map(String::as_str)
    }

    fn of(&self, letter: char) -> Result<Option<f64>, String> {
        self.text(letter)
            .map(|text| positive(text).map_err(|why| format!("{} {text}: {why}", self.option)))
            .transpose()
    }

    /// Refuses a value of an axis that there is not.
    fn only_of(&self, axes: &[DraftAxis]) -> Result<(), String> {
        let other = self
            .one
            .keys()
            .find(|letter| !axes.iter().any(|axis| axis.letter == **letter));
        other.map_or(Ok(()), |letter| {
            Err(format!(
                "{} {letter}=…: there is no --axis {letter}",
                self.option
            ))
        })
    }
}
