//! The tool table of a run, and which tool is where.

use crate::config::{Config, Tool};

/// Most rows of the tool table, so that memory stays bounded.
const MAX_TOOLS: usize = 10_000;

/// The tools.
#[derive(Clone, Debug)]
pub(crate) struct Tools {
    table: Vec<Tool>,
    /// Number of the tool in the spindle, 0 for none.
    pub in_spindle: u32,
    /// What T has selected.
    pub selected: Option<u32>,
    /// The first line that has taken the length of a tool as zero, because there is no table.
    pub assumed_zero: Option<u32>,
}

impl Tools {
    pub fn new(config: &Config) -> Self {
        Self { table: config.tools.clone(), in_spindle: config.tool_in_spindle, selected: None, assumed_zero: None }
    }

    /// The tool called `number`.
    pub fn find(&self, number: u32) -> Option<&Tool> {
        self.table.iter().find(|tool| tool.number == number)
    }

    /// Adds or replaces a row; false where the table is full.
    pub fn set(&mut self, tool: Tool) -> bool {
        if let Some(row) = self.table.iter_mut().find(|row| row.number == tool.number) {
            *row = tool;
        } else if self.table.len() < MAX_TOOLS {
            self.table.push(tool);
        } else {
            return false;
        }
        true
    }
}
