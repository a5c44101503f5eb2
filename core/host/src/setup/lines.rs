//! Which digital outputs and inputs of a machine somebody has, for programs that switch and read them.

use std::collections::BTreeMap;

use tandem_gcode::Lines;
use tandem_machine::{Machine, Owned};

/// Outputs that a program may switch by their numbers are those below; mist and flood have words of their own.
const USER_OUTPUTS: u32 = 62;

/// Outputs and inputs that drivers have: all where one driver has the whole machine. Host; allocates.
pub fn of(machine: &Machine) -> (Lines, Lines) {
    let owned: Option<Vec<&Owned>> = machine
        .drivers
        .iter()
        .map(|driver| driver.owns.as_ref())
        .collect();
    let Some(owned) = owned else {
        return (Lines::all(), Lines::all());
    };
    let outputs = owned
        .iter()
        .flat_map(|owned| &owned.outputs)
        .copied()
        .filter(|output| *output < USER_OUTPUTS);
    let inputs = owned.iter().flat_map(|owned| &owned.inputs).copied();
    let named_outputs = machine
        .outputs
        .iter()
        .map(|named| (named.output, named.name.as_str()))
        .collect();
    let named_inputs = machine
        .inputs
        .iter()
        .map(|named| (named.input, named.name.as_str()))
        .collect();
    (lines(outputs, &named_outputs), lines(inputs, &named_inputs))
}

fn lines(numbers: impl Iterator<Item = u32>, names: &BTreeMap<u32, &str>) -> Lines {
    let mask = numbers.fold(0, |mask, number| mask | 1 << number.min(63));
    let shown = |number: u32| match names.get(&number) {
        Some(name) => format!("{number} ({name})"),
        None => number.to_string(),
    };
    let all: Vec<_> = (0..u64::BITS)
        .filter(|number| mask >> number & 1 == 1)
        .map(shown)
        .collect();
    Lines {
        mask,
        shown: all.join(", "),
    }
}
