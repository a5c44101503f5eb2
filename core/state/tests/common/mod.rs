//! Writes that can be seen to be whole: several rows of several tables that all say the same number.
#![allow(dead_code, reason = "each test file uses its own part")]

use std::sync::Arc;

use tandem_sdk::{Axes, AxisVector};
use tandem_state::{Change, LastingState, Owner, Tool};

pub fn axes() -> Axes {
    Axes::new(&[('X', false), ('Y', false), ('Z', false), ('A', true)]).unwrap()
}

/// Changes after which all rows say `n`.
pub fn all_say(n: u64) -> Vec<Change> {
    let value = n as f64;
    let same = AxisVector::from_slice(&[value; 4]);
    let tool = Tool { number: 7, offset: same, wear: same, diameter_mm: value, ..Tool::default() };
    let mut state = LastingState::default();
    state.offsets.origins[0] = same;
    state.offsets.rotations_rad[0] = value;
    state.parameters = [(100, value), (500, value), (999, value)].into();
    vec![change(&state), Change::Tool(Box::new(tool))]
}

/// That programs see `state`.
pub fn change(state: &LastingState) -> Change {
    Change::Program(Arc::new(state.to_program(&AxisVector::ZERO)))
}

pub fn owner(axes: &Axes) -> Owner<'_> {
    Owner { machine: "mill", axes, home: AxisVector::ZERO }
}

/// What a recorder is told of `n`: a parameter that lasts because it is listed.
pub fn recorded(n: u64) -> Change {
    Change::ListParameter { number: 100, value: n as f64 }
}

/// What all rows say; none where they do not say the same.
pub fn said(state: &LastingState) -> Option<u64> {
    let value = state.parameters.get(&500).copied().unwrap_or(0.0);
    let same = AxisVector::from_slice(&[value; 4]);
    let tool = state.tools.get(&7).cloned().unwrap_or_default();
    let whole = state.offsets.origins[0] == same
        && state.offsets.rotations_rad[0] == value
        && state.parameters.get(&999).copied().unwrap_or(0.0) == value
        && (tool.offset, tool.wear, tool.diameter_mm) == (same, same, value);
    whole.then_some(value as u64)
}
