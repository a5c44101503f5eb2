//! Any module as a policy script: raw bytes, and modules of wasm-smith that are given a sound layout, so that their
//! functions are called. What they answer stays within the machine, and the same module gives the same answers again.

use std::sync::LazyLock;

use arbitrary::Unstructured;
use tandem_policy::{Bounds, Budget, Engine, Facts, Period, Policy, Script, Values, abi};
use tandem_sdk::{Axes, AxisVector, Block, BlockKind};
use wasm_encoder::reencode::{self, Reencode};
use wasm_encoder::{CodeSection, ConstExpr, DataSection, Function, Module};

static ENGINE: LazyLock<Engine> = LazyLock::new(|| Engine::new().expect("this processor is known"));

/// The exports of a policy, with every function that it may have.
const EXPORTS: &str = r#"(module
  (memory (export "memory") 2)
  (func (export "tandem_policy_v2") (result i32) i32.const 0)
  (func (export "on_blocks") (param i32 i32))
  (func (export "on_period") (param i32) (result f64) f64.const 0)
  (func (export "save") (result i32) i32.const 0)
  (func (export "restore") (param i32)))"#;

/// Where the layout lies, and what lies behind it.
const LAYOUT: u32 = 1024;

fn config() -> wasm_smith::Config {
    wasm_smith::Config {
        exports: Some(wat::parse_str(EXPORTS).expect("a module")),
        max_imports: 0,
        min_memories: 1,
        max_memories: 1,
        min_data_segments: 1,
        bulk_memory_enabled: true,
        simd_enabled: false,
        relaxed_simd_enabled: false,
        tail_call_enabled: false,
        threads_enabled: false,
        memory64_enabled: false,
        gc_enabled: false,
        exceptions_enabled: false,
        custom_page_sizes_enabled: false,
        wide_arithmetic_enabled: false,
        shared_everything_threads_enabled: false,
        allow_start_export: true,
        ..wasm_smith::Config::default()
    }
}

/// Gives a module the layout of a policy.
struct WithLayout {
    /// Number of the function that says where it is, among those with a body.
    locate: u32,
    next: u32,
}

impl Reencode for WithLayout {
    type Error = std::convert::Infallible;

    fn parse_function_body(
        &mut self,
        code: &mut CodeSection,
        body: wasmparser::FunctionBody<'_>,
    ) -> Result<(), reencode::Error<Self::Error>> {
        self.next += 1;
        if self.next - 1 == self.locate {
            let mut located = Function::new([]);
            located.instructions().i32_const(LAYOUT.cast_signed()).end();
            code.function(&located);
            return Ok(());
        }
        reencode::utils::parse_function_body(self, code, body)
    }

    fn data_count(&mut self, count: u32) -> Result<u32, reencode::Error<Self::Error>> {
        Ok(count + 1)
    }

    fn parse_data_section(
        &mut self,
        data: &mut DataSection,
        section: wasmparser::DataSectionReader<'_>,
    ) -> Result<(), reencode::Error<Self::Error>> {
        reencode::utils::parse_data_section(self, data, section)?;
        data.active(0, &ConstExpr::i32_const(LAYOUT.cast_signed()), layout());
        Ok(())
    }
}

/// A layout with a window and a period behind it, an axis that it looks at, and no parameters.
fn layout() -> Vec<u8> {
    let inputs = LAYOUT + abi::layout::BYTES_V2 as u32;
    let name = inputs + abi::input::BYTES as u32;
    let window = name + 8;
    let period = window + (abi::WINDOW_BLOCKS * abi::block::BYTES_V2) as u32;
    let state = period + abi::period::BYTES_V2 as u32;
    let fields = [
        (abi::layout::SIZE, abi::layout::BYTES_V2 as u32),
        (abi::layout::BLOCK_BYTES, abi::block::BYTES_V2 as u32),
        (abi::layout::WINDOW, window),
        (abi::layout::WINDOW_BLOCKS, abi::WINDOW_BLOCKS as u32),
        (abi::layout::PERIOD_BYTES, abi::period::BYTES_V2 as u32),
        (abi::layout::PERIOD, period),
        (abi::layout::PARAMETER_BYTES, abi::parameter::BYTES as u32),
        (abi::layout::STATE, state),
        (abi::layout::STATE_BYTES, 64),
        (abi::layout::INPUTS, inputs),
        (abi::layout::INPUT_BYTES, abi::input::BYTES as u32),
        (abi::layout::INPUT_COUNT, 1),
    ];
    let input = [
        (abi::input::SIZE, abi::input::BYTES as u32),
        (abi::input::KIND, abi::input::AXIS),
        (abi::input::NAME, name),
        (abi::input::NAME_BYTES, 1),
    ];
    let mut bytes = vec![0; (window - LAYOUT) as usize];
    let behind = input.map(|(place, value)| (abi::layout::BYTES_V2 + place, value));
    for (place, value) in fields.into_iter().chain(behind) {
        bytes[place..place + 4].copy_from_slice(&value.to_le_bytes());
    }
    bytes[(name - LAYOUT) as usize] = b'y';
    bytes
}

/// The number of the exported function `name` among those with a body: a module of wasm-smith imports nothing.
fn exported(module: &[u8], name: &str) -> Option<u32> {
    let sections = wasmparser::Parser::new(0).parse_all(module).flatten();
    let mut exports = sections.filter_map(|section| match section {
        wasmparser::Payload::ExportSection(exports) => Some(exports),
        _ => None,
    });
    exports
        .next()?
        .into_iter()
        .flatten()
        .find(|export| export.name == name)
        .map(|export| export.index)
}

/// A module of wasm-smith that is a policy.
fn policy_module(bytes: &[u8]) -> Option<Vec<u8>> {
    let module = wasm_smith::Module::new(config(), &mut Unstructured::new(bytes))
        .ok()?
        .to_bytes();
    let locate = exported(&module, abi::LAYOUT_EXPORTS[1])?;
    let mut made = Module::new();
    let mut with_layout = WithLayout { locate, next: 0 };
    with_layout
        .parse_core_module(&mut made, wasmparser::Parser::new(0), &module)
        .ok()?;
    Some(made.finish())
}

fn start(script: Script) -> Option<Policy> {
    let axes = Axes::new(&[('X', false), ('Y', false), ('Z', false)]).expect("three axes");
    let facts = Facts {
        axes,
        time_constant_s: 0.05,
        path_tolerance_mm: 0.01,
        rough_period_s: 0.008,
        tool_diameters_mm: vec![],
        signals: vec![],
    };
    Policy::new(
        script,
        Values::default(),
        Budget::default(),
        Bounds::default(),
        &facts,
    )
    .ok()
}

/// What a policy answers to a few windows and periods.
fn live(policy: &mut Policy) -> Vec<u64> {
    let end = AxisVector::from_slice(&[10.0, 5.0]);
    let start = Block::at(AxisVector::ZERO);
    let block = Block {
        kind: BlockKind::Line,
        end,
        feed_mm_per_s: 50.0,
        length_mm: 11.2,
        line: 7,
        ..start
    };
    let mut seen = vec![];
    for period in 0..3 {
        for _ in 0..4 {
            policy.offer(&block, None);
        }
        policy.decide(None);
        for index in 0..4 {
            let tuning = policy.tuning(index);
            let asked = [
                tuning.time_constant_s,
                tuning.path_tolerance_mm,
                tuning.feed_cap_mm_per_s,
            ];
            for value in asked.into_iter().flatten() {
                assert!(value.is_finite() && value > 0.0 && value <= 50.0, "{value}");
                seen.push(value.to_bits());
            }
        }
        let ratio = policy.period(&Period {
            period,
            duration_s: 0.008,
            ..Period::default()
        });
        if let Some(ratio) = ratio {
            assert!((0.0..=1.0).contains(&ratio), "{ratio}");
            seen.push(ratio.to_bits());
        }
    }
    seen
}

/// Judges one input.
///
/// # Panics
/// The reader broke what it promises.
pub fn judge(bytes: &[u8]) {
    // What is no module is refused, and nothing else happens.
    let _ = ENGINE.compile(bytes);
    let Some(script) = policy_module(bytes).and_then(|module| ENGINE.compile(&module).ok()) else {
        return;
    };
    let (Some(mut policy), Some(mut again)) = (start(script.clone()), start(script)) else {
        return;
    };
    assert_eq!(live(&mut policy), live(&mut again));
    assert_eq!(policy.counters(), again.counters());
}
