//! Reading what a module says of itself in linear memory.

use crate::abi::{self, get_f64, get_u32};
use crate::error::Refusal;
use crate::inputs::{Input, InputKind, MAX_PROGRAM_VALUES, MAX_SCRIPT_SIGNALS};
use crate::parameters::Parameter;

/// Parameters that a module may declare.
const MAX_PARAMETERS: u32 = 64;
/// Inputs that a module may declare.
const MAX_INPUTS: u32 = 32;
/// Bytes of a name or description.
const MAX_TEXT: u32 = 2048;
/// Bytes of a structure in an array.
const MAX_STRIDE: u32 = 4096;
/// Bytes of state that survive a reload.
const MAX_STATE: u32 = 65_536;

/// Where a module wants its data.
#[derive(Clone, Debug)]
pub struct Layout {
    /// Address of the window.
    pub window: usize,
    /// Bytes from one block to the next.
    pub block_bytes: usize,
    /// Address of the period.
    pub period: usize,
    /// Address of the state buffer.
    pub state: usize,
    /// Bytes of the state buffer.
    pub state_bytes: usize,
    /// Address of the first parameter, and bytes from one to the next.
    parameters: (usize, usize),
    /// The parameters declared.
    pub declared: Vec<Parameter>,
    /// Address of the first input, and bytes from one to the next.
    input_table: (usize, usize),
    /// What the module wants to see.
    pub inputs: Vec<Input>,
}

impl Layout {
    /// Reads the layout at `address` of `memory` of a module that speaks `version` of the ABI.
    pub fn read(memory: &[u8], address: u32, version: u32) -> Result<Self, Refusal> {
        let at = |field: usize| -> Result<u32, Refusal> {
            get_u32(memory, address as usize + field)
                .ok_or_else(|| wrong("it lies outside of the memory"))
        };
        let (own, block, period) = match version {
            1 => (abi::layout::BYTES, abi::block::BYTES, abi::period::BYTES),
            _ => (
                abi::layout::BYTES_V2,
                abi::block::BYTES_SMALL,
                abi::period::BYTES_V2,
            ),
        };
        let size = at(abi::layout::SIZE)?;
        if (size as usize) < own {
            return Err(wrong(format!(
                "its size is {size} bytes, version {version} has {own}"
            )));
        }
        let stride = |bytes, least, what| stride(bytes, least, what, version);
        let block_bytes = stride(at(abi::layout::BLOCK_BYTES)?, block, "a block")?;
        let period_bytes = stride(at(abi::layout::PERIOD_BYTES)?, period, "the period")?;
        if (at(abi::layout::WINDOW_BLOCKS)? as usize) < abi::WINDOW_BLOCKS {
            return Err(wrong(format!(
                "the window holds fewer than {} blocks",
                abi::WINDOW_BLOCKS
            )));
        }
        let state_bytes = at(abi::layout::STATE_BYTES)?;
        if state_bytes > MAX_STATE {
            return Err(wrong(format!(
                "the state has {state_bytes} bytes, {MAX_STATE} are allowed"
            )));
        }
        let place = |address: u32, bytes: usize, what| region(memory, address, bytes, what);
        let table = Table::read(memory, &at, version)?;
        let (input_table, inputs) = if version == 1 {
            ((0, 0), vec![])
        } else {
            inputs(memory, &at)?
        };
        Ok(Self {
            window: place(
                at(abi::layout::WINDOW)?,
                block_bytes * abi::WINDOW_BLOCKS,
                "the window",
            )?,
            block_bytes,
            period: place(at(abi::layout::PERIOD)?, period_bytes, "the period")?,
            state: place(at(abi::layout::STATE)?, state_bytes as usize, "the state")?,
            state_bytes: state_bytes as usize,
            parameters: (table.address, table.stride),
            declared: table.parameters,
            input_table,
            inputs,
        })
    }

    /// Address at which input `index` is told its place.
    pub fn place_of_input(&self, index: usize) -> usize {
        self.input_table.0 + index * self.input_table.1 + abi::input::PLACE
    }

    /// Address of the value of parameter `index`.
    pub fn value(&self, index: usize) -> usize {
        self.parameters.0 + index * self.parameters.1 + abi::parameter::VALUE
    }
}

struct Table {
    address: usize,
    stride: usize,
    parameters: Vec<Parameter>,
}

impl Table {
    fn read(
        memory: &[u8],
        at: &impl Fn(usize) -> Result<u32, Refusal>,
        version: u32,
    ) -> Result<Self, Refusal> {
        let count = at(abi::layout::PARAMETER_COUNT)?;
        if count == 0 {
            return Ok(Self {
                address: 0,
                stride: 0,
                parameters: vec![],
            });
        }
        if count > MAX_PARAMETERS {
            return Err(wrong(format!(
                "{count} parameters, {MAX_PARAMETERS} are allowed"
            )));
        }
        let stride = stride(
            at(abi::layout::PARAMETER_BYTES)?,
            abi::parameter::BYTES,
            "a parameter",
            version,
        )?;
        let address = at(abi::layout::PARAMETERS)?;
        let start = region(
            memory,
            address,
            stride * count as usize,
            "the table of parameters",
        )?;
        let utf16 = at(abi::layout::TEXT)? == 1;
        let each = |index: usize| parameter(memory, start + index * stride, utf16);
        let parameters = (0..count as usize)
            .map(each)
            .collect::<Result<Vec<_>, _>>()?;
        for (index, parameter) in parameters.iter().enumerate() {
            if parameters[..index]
                .iter()
                .any(|other| other.name == parameter.name)
            {
                return Err(wrong(format!(
                    "two parameters are called {:?}",
                    parameter.name
                )));
            }
        }
        Ok(Self {
            address: start,
            stride,
            parameters,
        })
    }
}

/// The inputs that the layout names: address and stride of their table, and each of them.
fn inputs(
    memory: &[u8],
    at: &impl Fn(usize) -> Result<u32, Refusal>,
) -> Result<((usize, usize), Vec<Input>), Refusal> {
    let count = at(abi::layout::INPUT_COUNT)?;
    if count == 0 {
        return Ok(((0, 0), vec![]));
    }
    if count > MAX_INPUTS {
        return Err(wrong(format!("{count} inputs, {MAX_INPUTS} are allowed")));
    }
    let stride = stride(
        at(abi::layout::INPUT_BYTES)?,
        abi::input::BYTES,
        "an input",
        2,
    )?;
    let address = at(abi::layout::INPUTS)?;
    let start = region(
        memory,
        address,
        stride * count as usize,
        "the table of inputs",
    )?;
    let utf16 = at(abi::layout::TEXT)? == 1;
    let each = |index: usize| input(memory, start + index * stride, utf16);
    let inputs = (0..count as usize)
        .map(each)
        .collect::<Result<Vec<_>, _>>()?;
    for (index, input) in inputs.iter().enumerate() {
        let same = |other: &Input| (other.kind, &other.name) == (input.kind, &input.name);
        if inputs[..index].iter().any(same) {
            return Err(wrong(format!("two inputs are called {:?}", input.name)));
        }
    }
    let of = |kind| inputs.iter().filter(|input| input.kind == kind).count();
    let most = [
        (InputKind::Program, MAX_PROGRAM_VALUES, "of the program"),
        (InputKind::Signal, MAX_SCRIPT_SIGNALS, "that are signals"),
    ];
    if let Some((kind, most, what)) = most.into_iter().find(|(kind, most, _)| of(*kind) > *most) {
        return Err(wrong(format!(
            "{} inputs {what}, {most} are allowed",
            of(kind)
        )));
    }
    Ok(((start, stride), inputs))
}

fn input(memory: &[u8], at: usize, utf16: bool) -> Result<Input, Refusal> {
    let number = |field: usize| {
        get_u32(memory, at + field).ok_or_else(|| wrong("an input lies outside of the memory"))
    };
    let text =
        |address: usize, bytes: usize| read_text(memory, number(address)?, number(bytes)?, utf16);
    let name = text(abi::input::NAME, abi::input::NAME_BYTES)?;
    let kind = match number(abi::input::KIND)? {
        abi::input::PROGRAM => InputKind::Program,
        abi::input::SIGNAL => InputKind::Signal,
        abi::input::AXIS => InputKind::Axis,
        other => {
            return Err(wrong(format!(
                "{name:?} is an input of the kind {other}, which nobody knows"
            )));
        }
    };
    if !is_name(&name) {
        return Err(wrong(format!(
            "{name:?} is no name of an input: letters, digits and _ only"
        )));
    }
    let words = text(abi::input::WORDS, abi::input::WORDS_BYTES)?;
    let words: Vec<String> = words
        .split(',')
        .map(|word| word.trim().to_ascii_lowercase())
        .filter(|word| !word.is_empty())
        .collect();
    if kind != InputKind::Program && !words.is_empty() {
        return Err(wrong(format!(
            "{name:?} has words, which only what a program states can have"
        )));
    }
    // The signals of the machine file keep their units as they are written: `force_N`.
    let name = match kind {
        InputKind::Signal => name,
        InputKind::Program | InputKind::Axis => name.to_ascii_lowercase(),
    };
    Ok(Input {
        kind,
        name,
        words,
        is_optional: number(abi::input::OPTIONAL)? != 0,
    })
}

/// Whether `name` may name a parameter or an input.
fn is_name(name: &str) -> bool {
    let plain = |c: char| c.is_ascii_alphanumeric() || c == '_';
    !name.is_empty() && name.len() <= 64 && name.chars().all(plain)
}

fn parameter(memory: &[u8], at: usize, utf16: bool) -> Result<Parameter, Refusal> {
    let outside = || wrong("a parameter lies outside of the memory");
    let number = |field: usize| get_f64(memory, at + field).ok_or_else(outside);
    let text = |address: usize, bytes: usize| -> Result<String, Refusal> {
        let address = get_u32(memory, at + address).ok_or_else(outside)?;
        let bytes = get_u32(memory, at + bytes).ok_or_else(outside)?;
        read_text(memory, address, bytes, utf16)
    };
    let name = text(abi::parameter::NAME, abi::parameter::NAME_BYTES)?;
    let description = text(abi::parameter::TEXT, abi::parameter::TEXT_BYTES)?;
    let lowest = number(abi::parameter::LOWEST)?;
    let highest = number(abi::parameter::HIGHEST)?;
    let default = number(abi::parameter::DEFAULT)?;
    if !is_name(&name) {
        return Err(wrong(format!(
            "{name:?} is no name of a parameter: letters, digits and _ only"
        )));
    }
    if !(lowest.is_finite() && highest.is_finite() && lowest <= default && default <= highest) {
        return Err(wrong(format!(
            "parameter {name}: its default {default} is not within {lowest} to {highest}"
        )));
    }
    Ok(Parameter {
        name,
        description,
        lowest,
        highest,
        default,
    })
}

fn read_text(memory: &[u8], address: u32, bytes: u32, utf16: bool) -> Result<String, Refusal> {
    if bytes > MAX_TEXT {
        return Err(wrong(format!(
            "a text of {bytes} bytes, {MAX_TEXT} are allowed"
        )));
    }
    let start = region(memory, address, bytes as usize, "a text")?;
    let raw = &memory[start..start + bytes as usize];
    let read = if utf16 {
        let units: Vec<u16> = raw
            .chunks_exact(2)
            .map(|pair| u16::from_le_bytes([pair[0], pair[1]]))
            .collect();
        String::from_utf16(&units).ok()
    } else {
        String::from_utf8(raw.to_vec()).ok()
    };
    let read = read.ok_or_else(|| wrong("a text is not in the encoding that the layout states"))?;
    Ok(read
        .chars()
        .map(|c| if c.is_control() { ' ' } else { c })
        .collect())
}

fn stride(bytes: u32, least: usize, what: &str, version: u32) -> Result<usize, Refusal> {
    let fits = (least as u32..=MAX_STRIDE).contains(&bytes) && bytes.is_multiple_of(8);
    if fits {
        Ok(bytes as usize)
    } else {
        Err(wrong(format!(
            "{what} has {bytes} bytes, version {version} has {least}"
        )))
    }
}

fn region(memory: &[u8], address: u32, bytes: usize, what: &str) -> Result<usize, Refusal> {
    let start = address as usize;
    let inside = start
        .checked_add(bytes)
        .is_some_and(|end| end <= memory.len());
    if inside {
        Ok(start)
    } else {
        Err(wrong(format!("{what} lies outside of the memory")))
    }
}

fn wrong(what: impl Into<String>) -> Refusal {
    Refusal::Layout(what.into())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::abi::parameter as at;

    /// What is read of a parameter `gain` with these bounds.
    fn read([lowest, default, highest]: [f64; 3]) -> Result<Parameter, Refusal> {
        let mut memory = vec![0; at::BYTES];
        memory.extend(b"gain");
        for (field, value) in [(at::NAME, at::BYTES), (at::NAME_BYTES, 4)] {
            memory[field..field + 4].copy_from_slice(&(value as u32).to_le_bytes());
        }
        for (field, value) in [
            (at::LOWEST, lowest),
            (at::DEFAULT, default),
            (at::HIGHEST, highest),
        ] {
            memory[field..field + 8].copy_from_slice(&value.to_le_bytes());
        }
        parameter(&memory, 0, false)
    }

    #[test]
    fn the_default_of_a_parameter_lies_within_bounds_that_are_numbers() {
        for fits in [
            [0.0, 1.0, 2.0],
            [0.0, 0.0, 2.0],
            [0.0, 2.0, 2.0],
            [3.0, 3.0, 3.0],
        ] {
            let parameter = read(fits).unwrap_or_else(|why| panic!("{fits:?}: {why}"));
            let found = [parameter.lowest, parameter.default, parameter.highest];
            assert_eq!((found, parameter.name.as_str()), (fits, "gain"));
        }
        let (inf, nan) = (f64::INFINITY, f64::NAN);
        for wrong in [
            [0.0, -1.0, 2.0],
            [0.0, 3.0, 2.0],
            [2.0, 1.0, 0.0],
            [-inf, 1.0, 2.0],
            [0.0, 1.0, inf],
            [nan, 1.0, 2.0],
            [0.0, nan, 2.0],
            [0.0, 1.0, nan],
        ] {
            let why = read(wrong).err().map(|why| why.to_string());
            let says = why.is_some_and(|why| why.contains("parameter gain: its default"));
            assert!(says, "{wrong:?}");
        }
    }

    #[test]
    fn a_name_has_one_to_64_letters_digits_and_underscores() {
        for name in ["a", "_", "Gain_2", "x".repeat(64).as_str()] {
            assert!(is_name(name), "{name}");
        }
        for name in ["", "a b", "a-b", "\u{e4}", "x".repeat(65).as_str()] {
            assert!(!is_name(name), "{name}");
        }
    }

    /// Table of 32 inputs at the start of the memory: its last byte counts.
    #[test]
    fn a_table_of_inputs_lies_inside_the_memory_as_a_whole() {
        let at = |field: usize| {
            Ok(match field {
                abi::layout::INPUT_COUNT => MAX_INPUTS,
                abi::layout::INPUT_BYTES => abi::input::BYTES as u32,
                _ => 0,
            })
        };
        let whole = abi::input::BYTES * MAX_INPUTS as usize;
        for (bytes, is_inside) in [(whole - 1, false), (whole, true)] {
            let why = inputs(&vec![0; bytes], &at)
                .err()
                .map(|why| why.to_string());
            let is_outside = why.is_some_and(|why| why.contains("the table of inputs"));
            assert_eq!(is_outside, !is_inside, "{bytes} bytes");
        }
    }

    /// What is said of a table of so many parameters of so many bytes at the start of a memory of this size.
    fn refused(count: u32, bytes: u32, memory: usize) -> String {
        let at = |field: usize| {
            Ok(match field {
                abi::layout::PARAMETER_COUNT => count,
                abi::layout::PARAMETER_BYTES => bytes,
                _ => 0,
            })
        };
        Table::read(&vec![0; memory], &at, 1)
            .err()
            .map(|why| why.to_string())
            .unwrap_or_default()
    }

    #[test]
    fn a_table_of_parameters_has_as_many_as_are_allowed_and_lies_inside_the_memory() {
        let (bytes, most) = (at::BYTES as u32, MAX_PARAMETERS);
        let whole = at::BYTES * most as usize;
        let why = refused(most + 1, bytes, 2 * whole);
        assert!(why.contains("65 parameters, 64 are allowed"), "{why}");
        let why = refused(most, bytes, whole - 1);
        assert!(why.contains("the table of parameters"), "{why}");
        // Where the table fits what is in it is looked at: names of nothing.
        let why = refused(most, bytes, whole);
        assert!(!why.contains("table") && !why.contains("allowed"), "{why}");
    }
}
