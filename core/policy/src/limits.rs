//! Memory and tables of one instance.

use wasmtime::{ResourceLimiter, Result, bail};

use crate::budget::Budget;

/// Elements of all tables together.
const MAX_ELEMENTS: usize = 4096;

/// What an instance has and may have; what it was refused last, for the message.
#[derive(Debug)]
pub struct Limits {
    memory_bytes: usize,
    /// What was asked for when more was refused.
    pub refused: Option<String>,
}

impl Limits {
    /// Nothing used yet.
    pub fn new(budget: &Budget) -> Self {
        Self {
            memory_bytes: budget.memory_bytes(),
            refused: None,
        }
    }

    fn refuse(&mut self, asked: String) -> Result<bool> {
        let refused = self.refused.insert(asked);
        bail!("refused: {refused}")
    }
}

impl ResourceLimiter for Limits {
    fn memory_growing(
        &mut self,
        _current: usize,
        desired: usize,
        _maximum: Option<usize>,
    ) -> Result<bool> {
        if desired <= self.memory_bytes {
            return Ok(true);
        }
        let pages = |bytes: usize| bytes / 65_536;
        self.refuse(format!(
            "{} pages of memory, {} are allowed",
            pages(desired),
            pages(self.memory_bytes)
        ))
    }

    fn table_growing(
        &mut self,
        _current: usize,
        desired: usize,
        _maximum: Option<usize>,
    ) -> Result<bool> {
        if desired <= MAX_ELEMENTS {
            return Ok(true);
        }
        self.refuse(format!(
            "a table of {desired} elements, {MAX_ELEMENTS} are allowed"
        ))
    }

    fn instances(&self) -> usize {
        1
    }

    fn memories(&self) -> usize {
        1
    }

    fn tables(&self) -> usize {
        4
    }
}
