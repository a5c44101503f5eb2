//! A compiled module whose exports are those of a policy.

use wasmtime::{ExternType, Module, ValType};

use crate::abi;
use crate::error::Refusal;

/// Characters of a name of the module that a message repeats.
const MAX_SHOWN: usize = 64;

/// A compiled policy script. Clones share the code.
#[derive(Clone)]
pub struct Script {
    pub(crate) module: Module,
    /// The version of the ABI that it speaks.
    pub version: u32,
    /// Whether it tunes blocks.
    pub tunes_blocks: bool,
    /// Whether it answers rough periods.
    pub answers_periods: bool,
    /// Whether it hands over state at a reload.
    pub keeps_state: bool,
}

impl Script {
    /// Whether two scripts are the same compilation.
    pub fn is_same(&self, other: &Self) -> bool {
        Module::same(&self.module, &other.module)
    }

    /// Checks what the module imports and exports.
    pub(crate) fn new(module: Module) -> Result<Self, Refusal> {
        let imports: Vec<String> = module
            .imports()
            .map(|i| format!("{}.{}", shown(i.module()), shown(i.name())))
            .take(8)
            .collect();
        if !imports.is_empty() {
            return Err(Refusal::Imports(imports));
        }
        let version = version(&module)?;
        let mut wrong = vec![];
        let mut has = |name, wanted: &Wanted| look(&module, name, wanted, &mut wrong);
        has(abi::MEMORY_EXPORT, &Wanted::Memory);
        has(
            layout_export(version),
            &Wanted::Function(&[], &[Number::I32]),
        );
        let tunes_blocks = has(
            abi::BLOCKS_EXPORT,
            &Wanted::Optional(&[Number::I32, Number::I32], &[]),
        );
        let answers_periods = has(
            abi::PERIOD_EXPORT,
            &Wanted::Optional(&[Number::I32], &[Number::F64]),
        );
        let saves = has(abi::SAVE_EXPORT, &Wanted::Optional(&[], &[Number::I32]));
        let restores = has(abi::RESTORE_EXPORT, &Wanted::Optional(&[Number::I32], &[]));
        if saves != restores {
            wrong.push("save and restore go together, one of them is missing".to_string());
        }
        if !tunes_blocks && !answers_periods && wrong.is_empty() {
            wrong.push(
                "it exports neither on_blocks (i32, i32) nor on_period (i32) -> f64".to_string(),
            );
        }
        if wrong.is_empty() {
            Ok(Self {
                module,
                version,
                tunes_blocks,
                answers_periods,
                keeps_state: saves,
            })
        } else {
            Err(Refusal::Exports(wrong))
        }
    }
}

#[derive(Clone, Copy, PartialEq)]
enum Number {
    I32,
    F64,
}

impl Number {
    fn is(self, of: &ValType) -> bool {
        matches!(
            (self, of),
            (Self::I32, ValType::I32) | (Self::F64, ValType::F64)
        )
    }

    fn name(self) -> &'static str {
        if self == Self::I32 { "i32" } else { "f64" }
    }
}

enum Wanted<'a> {
    Memory,
    Function(&'a [Number], &'a [Number]),
    Optional(&'a [Number], &'a [Number]),
}

/// Whether the export is there; notes where it is missing though it must not be, or of another type.
fn look(module: &Module, name: &str, wanted: &Wanted<'_>, wrong: &mut Vec<String>) -> bool {
    match (module.get_export(name), wanted) {
        (None, Wanted::Optional(..)) => return false,
        (Some(ExternType::Memory(memory)), Wanted::Memory) if !memory.is_shared() => return true,
        (
            Some(ExternType::Func(function)),
            Wanted::Function(takes, gives) | Wanted::Optional(takes, gives),
        ) => {
            let same = |numbers: &[Number], of: &mut dyn ExactSizeIterator<Item = ValType>| {
                numbers.len() == of.len()
                    && numbers.iter().zip(of).all(|(number, of)| number.is(&of))
            };
            if same(takes, &mut function.params()) && same(gives, &mut function.results()) {
                return true;
            }
            wrong.push(format!(
                "its export {name} is not {}",
                signature(takes, gives)
            ));
        }
        (None, Wanted::Memory) => wrong.push(format!("the memory {name} is not exported")),
        (None, Wanted::Function(takes, gives)) => {
            wrong.push(format!(
                "the function {name} {} is not exported",
                signature(takes, gives)
            ));
        }
        (Some(_), Wanted::Memory) => {
            wrong.push(format!("its export {name} is no memory of its own"));
        }
        (Some(_), _) => wrong.push(format!("its export {name} is no function")),
    }
    false
}

fn signature(takes: &[Number], gives: &[Number]) -> String {
    let names = |numbers: &[Number]| {
        numbers
            .iter()
            .map(|n| n.name())
            .collect::<Vec<_>>()
            .join(", ")
    };
    if gives.is_empty() {
        format!("({})", names(takes))
    } else {
        format!("({}) -> {}", names(takes), names(gives))
    }
}

/// A name that a module states, made fit to stand in a message: it may hold line breaks, and be longer than the module's code.
fn shown(name: &str) -> String {
    name.escape_debug().take(MAX_SHOWN).collect()
}

/// Name of the export of the layout in `version`.
pub(crate) fn layout_export(version: u32) -> &'static str {
    abi::LAYOUT_EXPORTS[version as usize - 1]
}

/// The version that the module speaks, the latest where it has several. One that names another version says so before
/// anything else is looked at.
fn version(module: &Module) -> Result<u32, Refusal> {
    let spoken = (1..=abi::VERSION)
        .rev()
        .find(|version| module.get_export(layout_export(*version)).is_some());
    if let Some(version) = spoken {
        return Ok(version);
    }
    let other = module
        .exports()
        .find_map(|e| e.name().strip_prefix(abi::LAYOUT_PREFIX).map(str::to_owned));
    match other {
        Some(version) => Err(Refusal::OtherVersion(
            version.escape_debug().take(12).collect(),
        )),
        // What it lacks is told with what else it lacks.
        None => Ok(abi::VERSION),
    }
}
