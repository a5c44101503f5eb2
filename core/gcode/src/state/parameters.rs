//! Numbered (`#1` to `#5602`) and named (`#<name>`) parameters.

use std::collections::{BTreeMap, HashMap};

use tandem_sdk::AxisVector;

use super::State;
use super::letters::{AXIS_LETTERS, Letters};
use crate::words::modes::{FeedMode, Plane};

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

/// Numbered parameters that each call of a subroutine has of its own: its arguments.
const LOCAL: usize = 30;

type Names = HashMap<Box<[u8]>, Value>;

/// Parameters that outlive the program that sets them: those of the user, and what probes have found.
const PERSISTENT: [std::ops::RangeInclusive<usize>; 2] = [LOCAL + 1..=5000, 5061..=5070];

/// A parameter that was set, and outlives its program.
#[derive(Clone, Debug)]
pub(crate) enum Written {
    Numbered(usize, f64),
    Named(Box<[u8]>, f64),
}

/// The values that the program has set.
#[derive(Clone)]
pub(crate) struct Parameters {
    numbered: Vec<Value>,
    /// Names that begin with `_`.
    global: Names,
    /// The other names, of the call that is executed.
    local: Names,
    /// What the callers have of their own.
    callers: Vec<Caller>,
    /// How many names there are in all.
    names: usize,
    /// What the last subroutine returned.
    returned: Option<Value>,
    /// What was set since somebody asked, where anybody does.
    log: Option<Vec<Written>>,
}

/// What a caller has of its own while a subroutine is executed.
#[derive(Clone)]
struct Caller {
    /// None where the called one shares them.
    numbered: Option<[Value; LOCAL]>,
    local: Names,
}

impl Parameters {
    pub fn new() -> Self {
        Self {
            numbered: vec![Value::default(); LAST + 1],
            global: Names::new(),
            local: Names::new(),
            callers: Vec::new(),
            names: 0,
            returned: None,
            log: None,
        }
    }

    /// From here on what is set is kept for [`Parameters::take_log`].
    pub fn keep_log(&mut self) {
        self.log = Some(vec![]);
    }

    /// What was set since this was asked last.
    pub fn take_log(&mut self) -> Vec<Written> {
        self.log.as_mut().map(std::mem::take).unwrap_or_default()
    }

    /// Sets what another has set.
    pub fn write(&mut self, written: Vec<Written>) {
        for one in written {
            match one {
                Written::Numbered(number, value) => self.set_numbered(number, value, false),
                Written::Named(name, value) => _ = self.set_named(&name, value, false),
            }
        }
    }

    /// Numbered parameters that last and are not zero.
    pub fn persistent_data(&self) -> BTreeMap<u32, f64> {
        let numbers = PERSISTENT.into_iter().flatten();
        let set = numbers.map(|number| (number as u32, self.numbered[number].number));
        set.filter(|(_, value)| *value != 0.0).collect()
    }

    /// Sets numbered parameters that last; those that are not named are zero. A number that is none of them is passed over.
    pub fn set_persistent_data(&mut self, values: &BTreeMap<u32, f64>) {
        for number in PERSISTENT.into_iter().flatten() {
            let number_value = values.get(&(number as u32)).copied().unwrap_or(0.0);
            self.set_numbered(number, number_value, false);
        }
    }

    /// A subroutine begins: #1 to #30 are its arguments, zero where there are fewer, and no local name exists.
    pub fn enter(&mut self, arguments: &[Value]) {
        let mut numbered = [Value::default(); LOCAL];
        numbered[..arguments.len()].copy_from_slice(arguments);
        numbered.swap_with_slice(&mut self.numbered[1..=LOCAL]);
        self.callers.push(Caller {
            numbered: Some(numbered),
            local: std::mem::take(&mut self.local),
        });
    }

    /// A subprogram begins: it shares #1 to #30 with its caller, and has local names of its own.
    pub fn enter_subprogram(&mut self) {
        self.callers.push(Caller {
            numbered: None,
            local: std::mem::take(&mut self.local),
        });
    }

    /// A subroutine ends, and returns a value or none; a subprogram returns nothing.
    pub fn leave(&mut self, value: Option<Value>) {
        let Some(caller) = self.callers.pop() else {
            return;
        };
        self.names -= self.local.len();
        if let Some(numbered) = caller.numbered {
            self.returned = value;
            self.numbered[1..=LOCAL].copy_from_slice(&numbered);
        }
        self.local = caller.local;
    }

    /// All calls are over, wherever they were.
    pub fn leave_all(&mut self) {
        while !self.callers.is_empty() {
            self.leave(None);
        }
    }

    /// What the calls say of themselves: `#<_value>`, `#<_value_returned>`, `#<_call_level>`.
    fn of_calls(&self, name: &[u8]) -> Option<Value> {
        let value = |number: f64| Value {
            number,
            assumed: self.returned.is_some_and(|value| value.assumed),
        };
        match name {
            b"_value" => Some(value(self.returned.map_or(0.0, |value| value.number))),
            b"_value_returned" => Some(value(f64::from(u8::from(self.returned.is_some())))),
            b"_call_level" => Some(Value {
                number: self.callers.len() as f64,
                assumed: false,
            }),
            _ => None,
        }
    }

    /// The value of parameter `number`, which lies within 1 to [`LAST`]; zero where it was never set.
    pub fn numbered(&self, number: usize, state: &State, letters: &Letters) -> Value {
        let kept = predefined(number, state, letters);
        let kept = kept.map(|value| Value {
            number: value,
            assumed: is_assumed(number, state, letters),
        });
        kept.unwrap_or(self.numbered[number])
    }

    /// The value of the parameter called `name` (lower case, without blanks).
    pub fn named(&self, name: &[u8], state: &State, letters: &Letters) -> Option<Value> {
        let own = || {
            Value {
                number: predefined_name(name, state, letters)?,
                assumed: is_position_assumed(name, state, letters),
            }
            .into()
        };
        self.names_of(name)
            .get(name)
            .copied()
            .or_else(|| self.of_calls(name))
            .or_else(own)
    }

    pub fn set_numbered(&mut self, number: usize, value: f64, assumed: bool) {
        self.numbered[number] = Value {
            number: value,
            assumed,
        };
        if let Some(log) = &mut self.log
            && PERSISTENT.iter().any(|range| range.contains(&number))
        {
            log.push(Written::Numbered(number, value));
        }
    }

    /// The value of parameter `number` is only assumed.
    pub fn assume(&mut self, number: usize) {
        self.numbered[number].assumed = true;
    }

    fn names_of(&self, name: &[u8]) -> &Names {
        if name.starts_with(b"_") {
            &self.global
        } else {
            &self.local
        }
    }

    /// Sets a named parameter; false where there are too many.
    pub fn set_named(&mut self, name: &[u8], value: f64, assumed: bool) -> bool {
        if let Some(log) = self.log.as_mut().filter(|_| name.starts_with(b"_")) {
            log.push(Written::Named(name.into(), value));
        }
        let value = Value {
            number: value,
            assumed,
        };
        let names = if name.starts_with(b"_") {
            &mut self.global
        } else {
            &mut self.local
        };
        if let Some(slot) = names.get_mut(name) {
            *slot = value;
        } else if self.names < MAX_NAMED {
            names.insert(name.into(), value);
            self.names += 1;
        } else {
            return false;
        }
        true
    }
}

/// Why parameter `number` cannot be assigned.
pub(crate) fn read_only(number: usize) -> Option<&'static str> {
    match number {
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
            9 => Some(coordinates.rotation((number - 5221) / 20).to_degrees()),
            _ => Some(0.0),
        },
        5399 => Some(state.outputs.answer),
        5400 => Some(f64::from(state.tools.in_spindle)),
        5401..=5409 => fixed(coordinates.tool(), number - 5401),
        5410 => Some(
            state
                .tools
                .find(state.tools.in_spindle)
                .map_or(0.0, |tool| tool.diameter_mm),
        ),
        5420..=5428 => Some(position(state, letters, number - 5420)),
        _ => None,
    }
}

/// Whether what the interpreter keeps as parameter `number` follows from an assumed answer.
fn is_assumed(number: usize, state: &State, letters: &Letters) -> bool {
    let axis = |nth: usize| {
        AXIS_LETTERS
            .as_bytes()
            .get(nth)
            .and_then(|letter| letters.axis(*letter))
    };
    let of = |mask: u32, nth: usize| axis(nth).is_some_and(|axis| mask >> axis & 1 != 0);
    let offsets = state.coordinates.assumed;
    let position = state.path.assumed;
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
    let ([b'_', letter] | [b'_', b'a', b'b', b's', b'_', letter]) = name else {
        return false;
    };
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
    letters
        .axis(AXIS_LETTERS.as_bytes()[nth])
        .map_or(0.0, |axis| state.program_position(letters, axis))
}

/// The pocket of a tool; −1 for no tool.
fn pocket(state: &State, tool: Option<u32>) -> f64 {
    let Some(number) = tool else { return -1.0 };
    f64::from(
        state
            .tools
            .find(number)
            .and_then(|tool| tool.pocket)
            .unwrap_or(0),
    )
}

/// Named values that the interpreter keeps itself.
pub(crate) fn predefined_name(name: &[u8], state: &State, letters: &Letters) -> Option<f64> {
    let flag = |on: bool| f64::from(u8::from(on));
    Some(match name {
        // What calls say of themselves has its value elsewhere; here it only cannot be assigned. There are no remaps. The LinuxCNC
        // whose language this is has the version 2.9.0.
        b"_value" | b"_value_returned" | b"_call_level" | b"_remap_level" | b"_vminor" => 0.0,
        b"_vmajor" => 2.9,
        // 0 in previews of LinuxCNC, which this interpreter has none of.
        b"_task" => 1.0,
        b"_line" => f64::from(state.line),
        b"_motion_mode" => state.motion_code(),
        b"_plane" => match state.modes.plane {
            Plane::Xy => 170.0,
            Plane::Zx => 180.0,
            Plane::Yz => 190.0,
        },
        b"_inverse_time" => flag(state.modes.feed.mode == FeedMode::InverseTime),
        b"_units_per_minute" => flag(state.modes.feed.mode == FeedMode::PerMinute),
        b"_units_per_rev" => flag(state.modes.feed.mode == FeedMode::PerRevolution),
        b"_spindle_css_mode" => flag(state.spindle.surface.is_some()),
        b"_spindle_rpm_mode" => flag(state.spindle.surface.is_none()),
        b"_lathe_diameter_mode" => flag(state.modes.diameter),
        b"_lathe_radius_mode" => flag(!state.modes.diameter),
        b"_ccomp" => f64::from(state.compensation.code()),
        b"_tool_offset" => flag(*state.coordinates.tool() != AxisVector::ZERO),
        b"_retract_r_plane" => flag(!state.cycles.return_to_initial()),
        b"_retract_old_z" => flag(state.cycles.return_to_initial()),
        b"_ijk_absolute_mode" => flag(state.modes.arc_absolute),
        b"_spindle_on" => flag(state.spindle.direction != 0),
        b"_spindle_cw" => flag(state.spindle.direction > 0),
        b"_mist" => flag(state.coolant.mist),
        b"_flood" => flag(state.coolant.flood),
        b"_feed_override" => flag(state.permits.feed_override()),
        b"_speed_override" => flag(state.permits.spindle_override()),
        b"_adaptive_feed" => flag(state.permits.adaptive_feed()),
        b"_feed_hold" => flag(state.permits.feed_hold()),
        b"_current_pocket" => pocket(state, Some(state.tools.in_spindle)),
        b"_selected_pocket" => pocket(state, state.tools.selected),
        [b'_', b'a', b'b', b's', b'_', letter] => {
            let letter = AXIS_LETTERS
                .bytes()
                .find(|l| *l == letter.to_ascii_uppercase())?;
            let axis = letters.axis(letter);
            axis.map_or(0.0, |axis| {
                state.path.position[axis] / state.modes.scale(letters, axis)
            })
        }
        b"_metric" => flag(state.modes.unit_mm == 1.0),
        b"_imperial" => flag(state.modes.unit_mm != 1.0),
        b"_absolute" => flag(state.modes.absolute),
        b"_incremental" => flag(!state.modes.absolute),
        b"_feed" => state.modes.feed.linear_mm_per_s * 60.0 / state.modes.unit_mm,
        b"_rpm" => state.spindle.speed_rad_per_s * 30.0 / std::f64::consts::PI,
        b"_coord_system" => match state.coordinates.active() {
            tenth @ 6.. => 590.0 + (tenth - 5) as f64,
            whole => 540.0 + 10.0 * whole as f64,
        },
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
