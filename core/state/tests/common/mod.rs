//! Writes that can be seen to be whole: several rows of several tables that all say the same number.
#![allow(dead_code, reason = "each test file uses its own part")]

use std::sync::Arc;

use tandem_rig::Random;
use tandem_sdk::{Axes, AxisVector, MAX_AXES};
use tandem_state::{Change, Owner, PersistentState, Tool, ToolLife, WorkOffsets};

pub fn axes() -> Axes {
    Axes::new(&[('X', false), ('Y', false), ('Z', false), ('A', true)]).unwrap()
}

/// Changes after which all rows say `n`.
pub fn all_say(n: u64) -> Vec<Change> {
    let value = n as f64;
    let same = AxisVector::from_slice(&[value; 4]);
    let tool = Tool {
        number: 7,
        offset: same,
        wear: same,
        diameter_mm: value,
        ..Tool::default()
    };
    let mut state = PersistentState::default();
    state.offsets.origins[0] = same;
    state.offsets.rotations_rad[0] = value;
    state.parameters = [(100, value), (500, value), (999, value)].into();
    vec![change(&state), Change::Tool(Box::new(tool))]
}

/// That programs see `state`.
pub fn change(state: &PersistentState) -> Change {
    Change::Program(Arc::new(state.to_program(&AxisVector::ZERO)))
}

pub fn owner(axes: &Axes) -> Owner<'_> {
    Owner {
        machine: "mill",
        axes,
        home: AxisVector::ZERO,
    }
}

/// What a recorder is told of `n`: a parameter that lasts because it is listed.
pub fn recorded(n: u64) -> Change {
    Change::ListParameter {
        number: 100,
        value: n as f64,
    }
}

/// What all rows say; none where they do not say the same.
pub fn said(state: &PersistentState) -> Option<u64> {
    let value = state.parameters.get(&500).copied().unwrap_or(0.0);
    let same = AxisVector::from_slice(&[value; 4]);
    let tool = state.tools.get(&7).cloned().unwrap_or_default();
    let whole = state.offsets.origins[0] == same
        && state.offsets.rotations_rad[0] == value
        && state.parameters.get(&999).copied().unwrap_or(0.0) == value
        && (tool.offset, tool.wear, tool.diameter_mm) == (same, same, value);
    whole.then_some(value as u64)
}

/// A machine of any axes in any order.
pub fn machine_of(random: &mut Random) -> Axes {
    let mut letters = ['X', 'Y', 'Z', 'A', 'B', 'C', 'U', 'V', 'W']
        .map(|letter| (letter, random.unit() < 0.4))
        .to_vec();
    for last in (1..letters.len()).rev() {
        letters.swap(last, random.below(last as u64 + 1) as usize);
    }
    letters.truncate(1 + random.below(MAX_AXES as u64) as usize);
    Axes::new(&letters).unwrap()
}

fn any_vector(random: &mut Random, axes: &Axes) -> AxisVector {
    let mut vector = AxisVector::ZERO;
    for axis in 0..axes.count() {
        vector[axis] = (random.unit() - 0.5) * 10f64.powi(random.below(12) as i32 - 6);
    }
    vector
}

pub fn any_tool(random: &mut Random, axes: &Axes, number: u32) -> Tool {
    Tool {
        number,
        pocket: (random.unit() < 0.5).then(|| random.below(100) as u32),
        name: "end mill Ø6 \"x\"; DROP TABLE tool".into(),
        offset: any_vector(random, axes),
        wear: any_vector(random, axes),
        diameter_mm: random.unit() * 20.0,
        wear_diameter_mm: -random.unit(),
        corner_radius_mm: random.unit(),
        front_angle_deg: random.unit() * 90.0,
        back_angle_deg: -random.unit(),
        orientation: random.below(10) as u32,
        life: ToolLife {
            used_s: random.unit() * 1e5,
            limit_s: (random.unit() < 0.5).then(|| random.unit()),
            uses: random.below(1 << 40),
            limit_uses: (random.unit() < 0.5).then(|| random.below(99)),
        },
        remark: "für Alu".into(),
    }
}

pub fn any_state(random: &mut Random, axes: &Axes) -> PersistentState {
    let mut state = PersistentState {
        offsets: WorkOffsets {
            origins: std::array::from_fn(|_| any_vector(random, axes)),
            rotations_rad: std::array::from_fn(|_| random.unit() - 0.5),
            active_system: random.below(9) as usize,
            g92: any_vector(random, axes),
            g92_stored: any_vector(random, axes),
        },
        reference: std::array::from_fn(|_| (random.unit() < 0.5).then(|| any_vector(random, axes))),
        tool_in_spindle: random.below(100_000) as u32,
        last_position: (random.unit() < 0.5).then(|| any_vector(random, axes)),
        ..PersistentState::default()
    };
    for _ in 0..random.below(20) {
        state
            .parameters
            .insert(31 + random.below(4970) as usize, random.unit() * 1e9 - 5e8);
        let number = 1 + random.below(99_999) as u32;
        let tool = any_tool(random, axes, number);
        state.tools.insert(number, tool);
        state
            .policy_parameters
            .insert(format!("p{}", random.below(1000)), random.unit());
    }
    for axis in 0..axes.count() {
        state.turns[axis] = random.below(1 << 50).cast_signed() - (1 << 49);
    }
    state
}
