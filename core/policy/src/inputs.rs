//! Inputs: what a script wants to see by name, and where on this machine that is.

use tandem_sdk::Axes;

use crate::abi::input;
use crate::error::Refusal;
use crate::nearest::nearest;

/// Values of the part program that a script may ask for.
pub const MAX_PROGRAM_VALUES: usize = 8;
/// Signals that a script may ask for.
pub const MAX_SCRIPT_SIGNALS: usize = 16;

/// What an input is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum InputKind {
    /// A value that the part program states.
    Program,
    /// A signal of the machine.
    Signal,
    /// An axis.
    Axis,
}

/// An input as a script declares it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Input {
    /// What it is.
    pub kind: InputKind,
    /// Its name, lower case.
    pub name: String,
    /// Words that a program may state for it: the first one is 0, the next 1. None: numbers only.
    pub words: Vec<String>,
    /// Whether the script can do without.
    pub is_optional: bool,
}

/// What there is to see in a run.
#[derive(Clone, Debug)]
pub struct Sights {
    axes: Axes,
    /// Names of signals, in the order in which [`crate::Policy::signals`] counts them.
    signals: Vec<String>,
    /// What is looked for in the program; the first script of a run decides it.
    pub program: Vec<Input>,
}

/// Where each input of a script is.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Places {
    /// As the script is told, in the order of its inputs.
    pub told: Vec<u32>,
    /// Which signals it sees, as indices of the run's, in the order of their places.
    pub signals: Vec<usize>,
}

impl Sights {
    /// What a run has on a machine with `axes` and `signals`, whose first script declares `inputs`.
    pub fn new(axes: Axes, signals: &[String], inputs: &[Input]) -> Self {
        let of_program = inputs
            .iter()
            .filter(|input| input.kind == InputKind::Program);
        Self {
            axes,
            signals: signals.to_vec(),
            program: of_program.cloned().collect(),
        }
    }

    /// Where `inputs` are.
    ///
    /// # Errors
    /// Each that is not there and must be, with the nearest name.
    pub fn places(&self, inputs: &[Input]) -> Result<Places, Refusal> {
        let mut places = Places::default();
        let mut missing = vec![];
        for input in inputs {
            let found = match input.kind {
                InputKind::Program => self
                    .program
                    .iter()
                    .position(|other| (&other.name, &other.words) == (&input.name, &input.words)),
                InputKind::Axis => letter(&input.name).and_then(|letter| self.axes.index(letter)),
                InputKind::Signal => self.signals.iter().position(|name| *name == input.name),
            };
            let place = match (input.kind, found) {
                (InputKind::Signal, Some(signal)) => {
                    places.signals.push(signal);
                    Some(places.signals.len() - 1)
                }
                (_, found) => found,
            };
            if place.is_none() && !input.is_optional {
                missing.push(self.complaint(input));
            }
            places
                .told
                .push(place.map_or(input::NOWHERE, |place| place as u32));
        }
        if missing.is_empty() {
            Ok(places)
        } else {
            Err(Refusal::Inputs(missing))
        }
    }

    fn complaint(&self, input: &Input) -> String {
        let name = &input.name;
        match input.kind {
            InputKind::Program => format!(
                "it reads {name:?} of the program, which the script that the run began with did not: that takes a new run"
            ),
            InputKind::Axis => format!("it looks at the axis {name:?}, which this machine has not"),
            InputKind::Signal => {
                let signals = self.signals.iter().map(String::as_str);
                let hint = nearest(name, signals, "it has none");
                format!("it looks at the signal {name:?}, which this machine has not; {hint}")
            }
        }
    }
}

/// The letter of an axis, as machines know it.
fn letter(name: &str) -> Option<char> {
    let mut letters = name.chars();
    let letter = letters.next()?.to_ascii_uppercase();
    letters.next().is_none().then_some(letter)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn input(kind: InputKind, name: &str) -> Input {
        Input {
            kind,
            name: name.to_string(),
            words: vec![],
            is_optional: false,
        }
    }

    fn sights(inputs: &[Input]) -> Sights {
        let axes = Axes::new(&[('X', false), ('Z', false)]).unwrap();
        let signals = ["cutting_torque_nm", "coolant_c", "door"].map(str::to_string);
        Sights::new(axes, &signals, inputs)
    }

    #[test]
    fn places_are_those_of_each_kind() {
        let inputs = [
            input(InputKind::Axis, "z"),
            input(InputKind::Signal, "door"),
            input(InputKind::Program, "material"),
            input(InputKind::Signal, "coolant_c"),
        ];
        let places = sights(&inputs).places(&inputs).unwrap();
        assert_eq!(places.told, [1, 0, 0, 1]);
        assert_eq!(places.signals, [2, 1]);
    }

    #[test]
    fn what_is_missing_is_refused_with_the_nearest_name_unless_the_script_can_do_without() {
        let wanted = |kind, name| sights(&[]).places(&[input(kind, name)]);
        let why = wanted(InputKind::Signal, "coolant_k").unwrap_err();
        assert_eq!(
            why.to_string(),
            "it looks at the signal \"coolant_k\", which this machine has not; the nearest is coolant_c"
        );
        let why = wanted(InputKind::Axis, "y").unwrap_err().to_string();
        assert!(why.contains("the axis \"y\""), "{why}");
        let why = wanted(InputKind::Program, "material").unwrap_err();
        assert!(why.to_string().contains("a new run"), "{why}");
        let optional = Input {
            is_optional: true,
            ..input(InputKind::Signal, "nothing")
        };
        let places = sights(&[]).places(&[optional]).unwrap();
        assert_eq!(
            (places.told, places.signals),
            (vec![input::NOWHERE], vec![])
        );
    }
}
