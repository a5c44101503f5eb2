//! `[inputs.*]`: digital inputs with a name, and what the fine loop does where one trips.

use crate::homing::AxisHoming;
use crate::probe::{LAST_INPUT, Probe};
use crate::section::Section;

/// Age above which an input counts as tripped where the file states none, ms. A few lost frames are not a door that opens;
/// and no operator waits longer for a hold than for the plan, which takes a rough period of 8 ms.
const DEFAULT_MAX_AGE_MS: f64 = 10.0;

/// Greatest age that can be stated, ms: drivers count ages in 65 535 periods at most, at any fine period down to 0.1 ms.
const MAX_AGE_MS: f64 = 5000.0;

/// What an input means to the fine loop.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// As the operator's emergency stop.
    EmergencyStop,
    /// The drives are ready, such as by a contactor: a fault where they no longer are.
    DrivesReady,
    /// A door: hold, and the spindle off, until it is closed and the operator resumes.
    Door,
    /// A feed hold, until it is released and the operator resumes.
    FeedHold,
    /// The end of an axis' way: a fault in motion.
    Limit,
    /// A home switch of `[homing.*]`.
    Home,
    /// The probe of `[probe]`.
    Probe,
}

/// The roles by the words of the file.
const ROLES: [(&str, Role); 7] = [
    ("emergency-stop", Role::EmergencyStop),
    ("drives-ready", Role::DrivesReady),
    ("door", Role::Door),
    ("feed-hold", Role::FeedHold),
    ("limit", Role::Limit),
    ("home", Role::Home),
    ("probe", Role::Probe),
];

impl Role {
    /// The word of the file.
    pub fn name(self) -> &'static str {
        ROLES
            .iter()
            .find(|(_, role)| *role == self)
            .map_or("", |(word, _)| word)
    }
}

/// A digital input with a name.
#[derive(Clone, Debug, PartialEq)]
pub struct Input {
    /// Its name.
    pub name: String,
    /// Its number, 0 to 63.
    pub input: u32,
    /// What it means to the fine loop, if anything.
    pub role: Option<Role>,
    /// It is 1 as long as nothing has tripped, so that a broken wire trips it.
    pub normally_closed: bool,
    /// Age above which it counts as tripped, s.
    pub max_age_s: f64,
}

/// Reads `[inputs.*]`; what is wrong is reported and left out.
pub(crate) fn read(root: &Section<'_>) -> Vec<Input> {
    let section = root.section("inputs");
    let mut all: Vec<Input> = vec![];
    for name in section.keys() {
        let table = section.section(name);
        let Some(input) = one(&table, name) else {
            continue;
        };
        let number = input.input;
        let same = all.iter().find(|other| other.input == input.input);
        match same.filter(|other| {
            other.role == input.role || other.normally_closed != input.normally_closed
        }) {
            Some(other) if other.role != input.role => {
                let closed = other.normally_closed;
                table.refuse(
                    "normally_closed",
                    format!("input {number} is inputs.{} too, with {closed}", other.name),
                );
            }
            Some(other) => {
                let role = input.role.map_or(String::new(), |role| {
                    format!(", with the role {}", role.name())
                });
                table.refuse(
                    "input",
                    format!("input {number} is inputs.{} already{role}", other.name),
                );
            }
            None => all.push(input),
        }
    }
    all
}

fn one(table: &Section<'_>, name: &str) -> Option<Input> {
    // Everything is read before the first failure ends it, so that all problems are told.
    let role = table
        .choice("role", &ROLES.map(|(word, role)| (word, Some(role))))
        .flatten();
    let normally_closed = table.truth("normally_closed").unwrap_or(true);
    let max_age_ms = table
        .at_least("max_age_ms", 0.0)
        .unwrap_or(DEFAULT_MAX_AGE_MS);
    if max_age_ms > MAX_AGE_MS {
        table.refuse(
            "max_age_ms",
            format!("must be at most {MAX_AGE_MS}, not {max_age_ms}"),
        );
    }
    let input = table.required("input", |table, key| table.whole(key, 0, LAST_INPUT))?;
    Some(Input {
        name: name.to_owned(),
        input,
        role,
        normally_closed,
        max_age_s: max_age_ms / 1e3,
    })
}

/// Reports inputs called home switch or probe that nobody homes or probes by, or that are read the other way round there.
pub(crate) fn check(
    root: &Section<'_>,
    inputs: &[Input],
    homing: &[AxisHoming],
    probe: Option<&Probe>,
) {
    let section = root.section("inputs");
    for input in inputs {
        let table = section.section(&input.name);
        let homes = || {
            let mut switches = homing.iter().filter_map(AxisHoming::switch);
            switches
                .find(|switch| switch.input == input.input)
                .map(|switch| switch.inverted)
        };
        let probes = || {
            probe
                .filter(|probe| probe.input == input.input)
                .map(|probe| probe.inverted)
        };
        let (used, by) = match input.role {
            Some(Role::Home) => (homes(), "[homing.*]"),
            Some(Role::Probe) => (probes(), "[probe]"),
            _ => continue,
        };
        match used {
            None => table.refuse(
                "role",
                format!("no {by} has input {}: nobody would look at it", input.input),
            ),
            Some(inverted) if inverted != input.normally_closed => {
                let (own, other) = (input.normally_closed, inverted);
                table.refuse(
                    "normally_closed",
                    format!("is {own}, and invert of {by} is {other}: they must be the same"),
                );
            }
            Some(_) => {}
        }
    }
}
