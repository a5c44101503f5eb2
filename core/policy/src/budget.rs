//! What a script may use.

/// Largest module, bytes.
pub const MAX_BYTES: usize = 1 << 20;
/// Stack that a script may use, bytes.
pub const SOFT_STACK_BYTES: usize = 128 * 1024;

/// Computing, memory and stack that one script may use. Fuel is counted in WASM instructions, so that the bound is the
/// same on every computer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Budget {
    /// Fuel of one call.
    pub fuel_per_call: u64,
    /// Fuel for each block of a window, on top.
    pub fuel_per_block: u64,
    /// Pages of linear memory, 64 KiB each.
    pub memory_pages: u32,
}

impl Default for Budget {
    fn default() -> Self {
        Self {
            fuel_per_call: 20_000,
            fuel_per_block: 1_000,
            memory_pages: 32,
        }
    }
}

impl Budget {
    /// Fuel for a window of `blocks`.
    pub fn window(&self, blocks: usize) -> u64 {
        self.fuel_per_call
            .saturating_add(self.fuel_per_block.saturating_mul(blocks as u64))
    }

    /// Fuel to start a module and to ask it for its layout: fifty calls.
    pub fn start(&self) -> u64 {
        self.fuel_per_call.saturating_mul(50)
    }

    /// Bytes of linear memory.
    pub fn memory_bytes(&self) -> usize {
        self.memory_pages as usize * 65_536
    }
}
