//! Scripts as a machine runs them: the built ones, refused ones, hostile ones.

mod generated;
mod hostile;
mod layouts;
mod refusals;
mod reload;
mod scripts;
mod sight;

use std::path::{Path, PathBuf};

use tandem_policy::{Bounds, Budget, Engine, Facts, Policy, Refusal, Script, Values};
use tandem_sdk::{AxisVector, Block, BlockKind};

/// The folder of the workspace.
fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../..")
        .canonicalize()
        .unwrap()
}

fn read(path: &str) -> Vec<u8> {
    std::fs::read(root().join(path)).unwrap_or_else(|e| panic!("{path}: {e}"))
}

/// Every file of a folder that ends in `.wat`: its name and its bytes.
fn each(folder: &str) -> Vec<(String, Vec<u8>)> {
    let entries = std::fs::read_dir(root().join(folder))
        .unwrap()
        .map(|entry| entry.unwrap().path());
    let mut files: Vec<_> = entries
        .filter(|path| path.extension().is_some_and(|e| e == "wat"))
        .collect();
    files.sort();
    let name = |path: &Path| path.file_stem().unwrap().to_string_lossy().into_owned();
    files
        .iter()
        .map(|path| (name(path), std::fs::read(path).unwrap()))
        .collect()
}

fn engine() -> Engine {
    Engine::new().unwrap()
}

fn compile(bytes: &[u8]) -> Result<Script, Refusal> {
    engine().compile(bytes)
}

fn values(stated: &[(&str, f64)]) -> Values {
    stated
        .iter()
        .map(|(name, value)| ((*name).to_string(), *value))
        .collect()
}

fn start(bytes: &[u8], stated: &[(&str, f64)]) -> Result<Policy, Refusal> {
    Policy::new(
        compile(bytes)?,
        values(stated),
        Budget::default(),
        Bounds::default(),
        &Facts::default(),
    )
}

/// A script of version 1 in text form whose window, period and state are where the fixtures have them, as one of version 2
/// that looks at the geometry of blocks.
fn as_version_2(module: &[u8]) -> Vec<u8> {
    let text = String::from_utf8(module.to_vec()).unwrap();
    let old = r"\30\00\00\00\78\00\00\00\00\04\00\00\40\00\00\00\b0\00\00\00\00\02\00\00";
    let new = r"\40\00\00\00\80\02\00\00\00\10\00\00\40\00\00\00\38\02\00\00\00\02\00\00";
    assert!(text.contains(old) && text.contains("tandem_policy_v1"));
    text.replace(old, new)
        .replace("tandem_policy_v1", "tandem_policy_v2")
        .replace("(i32.const 120)", "(i32.const 640)")
        .into_bytes()
}

/// A line of 10 mm that leaves `from` in the direction `degrees`, at 50 mm/s.
fn line(from: AxisVector, degrees: f64) -> Block {
    let (sin, cos) = degrees.to_radians().sin_cos();
    let end = from + AxisVector::from_slice(&[10.0 * cos, 10.0 * sin]);
    Block {
        kind: BlockKind::Line,
        end,
        feed_mm_per_s: 50.0,
        length_mm: 10.0,
        line: 7,
        tool: 3,
        ..Block::at(from)
    }
}

/// A chain of lines with these directions.
fn chain(degrees: &[f64]) -> Vec<Block> {
    let mut at = AxisVector::ZERO;
    let mut next = |degrees: &f64| {
        let block = line(at, *degrees);
        at = block.end;
        block
    };
    degrees.iter().map(&mut next).collect()
}

/// Hands a window over.
fn decide(policy: &mut Policy, blocks: &[Block]) {
    for block in blocks {
        policy.offer(block, None);
    }
    policy.decide(None);
}
