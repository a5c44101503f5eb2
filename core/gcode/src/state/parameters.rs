//! Numbered (`#1` to `#5602`) and named (`#<name>`) parameters.

use std::collections::HashMap;

use tandem_sdk::AxisVector;

use super::State;
use super::letters::{AXIS_LETTERS, Letters};

/// Highest number of a parameter.
pub(crate) const LAST: usize = 5602;
/// Most named parameters, so that memory stays bounded.
const MAX_NAMED: usize = 10_000;

/// A value, and whether it follows from what the first pass has assumed.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Value {
    pub number: f64,
    pub assumed: bool,
}

/// The values that the program has set.
#[derive(Clone)]
pub(crate) struct Parameters {
    numbered: Vec<Value>,
    named: HashMap<Box<[u8]>, Value>,
}

impl Parameters {
    pub fn new() -> Self {
        Self { numbered: vec![Value::default(); LAST + 1], named: HashMap::new() }
    }

    /// The value of parameter `number`, which lies within 1 to [`LAST`]; zero where it was never set.
    pub fn numbered(&self, number: usize, state: &State, letters: &Letters) -> Value {
        let kept = predefined(number, state, letters);
        let kept = kept.map(|value| Value { number: value, assumed: is_assumed(number, state, letters) });
        kept.unwrap_or(self.numbered[number])
    }

    /// The value of the parameter called `name` (lower case, without blanks).
    pub fn named(&self, name: &[u8], state: &State, letters: &Letters) -> Option<Value> {
        let own = || {
            Value { number: predefined_name(name, state, letters)?, assumed: is_position_assumed(name, state, letters) }
                .into()
        };
        self.named.get(name).copied().or_else(own)
    }

    pub fn set_numbered(&mut self, number: usize, value: f64, assumed: bool) {
        self.numbered[number] = Value { number: value, assumed };
    }

    /// The value of parameter `number` is only assumed.
    pub fn assume(&mut self, number: usize) {
        self.numbered[number].assumed = true;
    }

    /// Sets a named parameter; false where there are too many.
    pub fn set_named(&mut self, name: &[u8], value: f64, assumed: bool) -> bool {
        let value = Value { number: value, assumed };
        if let Some(slot) = self.named.get_mut(name) {
            *slot = value;
        } else if self.named.len() < MAX_NAMED {
            self.named.insert(name.into(), value);
        } else {
            return false;
        }
        true
    }
}

/// Why parameter `number` cannot be assigned.
pub(crate) fn read_only(number: usize) -> Option<&'static str> {
    match number {
        5061..=5070 => Some("it holds the result of probing"),
        5161..=5169 => Some("it holds the position of G28: use G28.1"),
        5181..=5189 => Some("it holds the position of G30: use G30.1"),
        5210..=5219 => Some("it holds the offset of G92: use G92"),
        5220 => Some("it holds the number of the coordinate system: use G54 to G59.3"),
        5221..=5390 => Some("it holds a coordinate system: use G10 L2 or L20"),
        5399 => Some("it holds the answer of M66"),
        5400..=5413 => Some("it holds the tool in the spindle"),
        5420..=5428 => Some("it holds the current position"),
        _ => None,
    }
}

/// Values that the interpreter keeps itself. Offsets and stored positions are in mm and degrees whatever the program's
/// units, the current position is in program units.
fn predefined(number: usize, state: &State, letters: &Letters) -> Option<f64> {
    let coordinates = &state.coordinates;
    let fixed = |vector: &AxisVector, nth: usize| Some(in_mm(letters, nth, |axis| vector[axis]));
    match number {
        5161..=5169 => fixed(&coordinates.reference[0], number - 5161),
        5181..=5189 => fixed(&coordinates.reference[1], number - 5181),
        5210 => Some(f64::from(u8::from(*coordinates.g92() != AxisVector::ZERO))),
        5211..=5219 => fixed(coordinates.g92_stored(), number - 5211),
        5220 => Some((coordinates.active() + 1) as f64),
        5221..=5390 => match (number - 5221) % 20 {
            nth @ 0..=8 => fixed(coordinates.origin((number - 5221) / 20), nth),
            _ => Some(0.0),
        },
        5399 => Some(state.outputs.answer),
        5400 => Some(f64::from(state.tools.in_spindle)),
        5401..=5409 => fixed(coordinates.tool(), number - 5401),
        5410 => Some(state.tools.find(state.tools.in_spindle).map_or(0.0, |tool| tool.diameter_mm)),
        5420..=5428 => Some(position(state, letters, number - 5420)),
        _ => None,
    }
}

/// Whether what the interpreter keeps as parameter `number` follows from an assumed answer.
fn is_assumed(number: usize, state: &State, letters: &Letters) -> bool {
    let axis = |nth: usize| AXIS_LETTERS.as_bytes().get(nth).and_then(|letter| letters.axis(*letter));
    let of = |mask: u32, nth: usize| axis(nth).is_some_and(|axis| mask >> axis & 1 != 0);
    let (offsets, position) = (state.coordinates.assumed, state.path.assumed);
    match number {
        5211..=5219 => of(offsets, number - 5211),
        5221..=5390 => of(offsets, (number - 5221) % 20),
        5399 => state.outputs.answer_assumed,
        5401..=5409 => of(offsets, number - 5401),
        5420..=5428 => of(offsets | position, number - 5420),
        _ => false,
    }
}

fn is_position_assumed(name: &[u8], state: &State, letters: &Letters) -> bool {
    let [b'_', letter] = name else { return false };
    let axis = letters.axis(letter.to_ascii_uppercase());
    axis.is_some_and(|axis| (state.coordinates.assumed | state.path.assumed) >> axis & 1 != 0)
}

/// A value of the `nth` of the letters XYZABCUVW in mm or degrees; zero where the machine lacks that axis.
fn in_mm(letters: &Letters, nth: usize, value: impl Fn(usize) -> f64) -> f64 {
    match letters.axis(AXIS_LETTERS.as_bytes()[nth]) {
        Some(axis) if letters.is_rotary(axis) => value(axis).to_degrees(),
        Some(axis) => value(axis),
        None => 0.0,
    }
}

fn position(state: &State, letters: &Letters, nth: usize) -> f64 {
    letters.axis(AXIS_LETTERS.as_bytes()[nth]).map_or(0.0, |axis| state.program_position(letters, axis))
}

/// Named values that the interpreter keeps itself.
pub(crate) fn predefined_name(name: &[u8], state: &State, letters: &Letters) -> Option<f64> {
    let flag = |on: bool| f64::from(u8::from(on));
    Some(match name {
        b"_line" => f64::from(state.line),
        b"_metric" => flag(state.modes.unit_mm == 1.0),
        b"_imperial" => flag(state.modes.unit_mm != 1.0),
        b"_absolute" => flag(state.modes.absolute),
        b"_incremental" => flag(!state.modes.absolute),
        b"_feed" => state.modes.feed.linear_mm_per_s * 60.0 / state.modes.unit_mm,
        b"_rpm" => state.spindle.speed_rad_per_s * 30.0 / std::f64::consts::PI,
        b"_coord_system" => 540.0 + 10.0 * state.coordinates.active() as f64,
        b"_current_tool" => f64::from(state.tools.in_spindle),
        b"_selected_tool" => state.tools.selected.map_or(-1.0, f64::from),
        [b'_', letter] => {
            let letter = letter.to_ascii_uppercase();
            let nth = AXIS_LETTERS.bytes().position(|l| l == letter)?;
            position(state, letters, nth)
        }
        _ => return None,
    })
}
