//! The WASM engine: what modules may use, and compiled modules by their bytes.

use std::collections::hash_map::DefaultHasher;
use std::hash::{Hash, Hasher};
use std::sync::{Arc, Mutex, PoisonError};

use wasmtime::{Config, Module, Store};

use crate::budget::{MAX_BYTES, SOFT_STACK_BYTES};
use crate::error::Refusal;
use crate::script::Script;

/// Compiled scripts that are kept.
const KEPT: usize = 4;

/// A compiler of policy scripts. Clones share it and what it has compiled.
#[derive(Clone)]
pub struct Engine {
    engine: wasmtime::Engine,
    compiled: Arc<Mutex<Vec<Compiled>>>,
}

struct Compiled {
    hash: u64,
    bytes: Vec<u8>,
    script: Script,
}

impl Engine {
    /// An engine for deterministic modules: fuel counted, NaN canonical, no threads, no vectors.
    ///
    /// # Errors
    /// This computer's processor is not known to the compiler.
    pub fn new() -> Result<Self, Refusal> {
        let engine =
            wasmtime::Engine::new(&config()).map_err(|e| Refusal::NotAModule(format!("{e:#}")))?;
        warm_up(&engine);
        Ok(Self {
            engine,
            compiled: Arc::default(),
        })
    }

    /// Compiles `bytes`, a module or the text of one (WAT), and checks its exports. The same bytes are compiled once.
    /// Allocates, and takes milliseconds: not for the loops.
    ///
    /// # Errors
    /// What is wrong with the module.
    pub fn compile(&self, bytes: &[u8]) -> Result<Script, Refusal> {
        if bytes.len() > MAX_BYTES {
            return Err(Refusal::TooLarge {
                bytes: bytes.len(),
                most: MAX_BYTES,
            });
        }
        let mut hasher = DefaultHasher::new();
        bytes.hash(&mut hasher);
        let hash = hasher.finish();
        let mut kept = self.compiled.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(found) = kept.iter().find(|c| c.hash == hash && c.bytes == bytes) {
            return Ok(found.script.clone());
        }
        let module = Module::new(&self.engine, bytes)
            .map_err(|e| Refusal::NotAModule(one_line(&format!("{e:#}"))))?;
        let script = Script::new(module)?;
        if kept.len() == KEPT {
            kept.remove(0);
        }
        kept.push(Compiled {
            hash,
            bytes: bytes.to_vec(),
            script: script.clone(),
        });
        Ok(script)
    }
}

fn config() -> Config {
    let mut config = Config::new();
    config.consume_fuel(true);
    config.cranelift_nan_canonicalization(true);
    config.max_wasm_stack(SOFT_STACK_BYTES);
    config.wasm_backtrace_max_frames(None);
    // Vectors and tail calls are deterministic too, but no policy needs them, and what is off cannot be attacked.
    config.wasm_relaxed_simd(false);
    config.wasm_simd(false);
    config.wasm_tail_call(false);
    config.wasm_multi_memory(false);
    config.wasm_memory64(false);
    // A reservation of gigabytes would count against locked memory.
    config.memory_reservation(0);
    config.memory_reservation_for_growth(1 << 20);
    config.memory_guard_size(1 << 16);
    config
}

/// The first trap of a process takes a third of a millisecond: have it now.
fn warm_up(engine: &wasmtime::Engine) {
    let Ok(module) = Module::new(engine, r#"(module (func (export "trap") unreachable))"#) else {
        return;
    };
    let mut store = Store::new(engine, ());
    let _ = store.set_fuel(1000);
    if let Ok(instance) = wasmtime::Instance::new(&mut store, &module, &[])
        && let Ok(trap) = instance.get_typed_func::<(), ()>(&mut store, "trap")
    {
        let _ = trap.call(&mut store, ());
    }
}

/// Text of the engine on one line, shortened.
fn one_line(text: &str) -> String {
    let words: Vec<&str> = text.split_whitespace().collect();
    words
        .join(" ")
        .chars()
        .filter(|c| !c.is_control())
        .take(300)
        .collect()
}
