//! The tool table of a run, and which tool is where.

use std::sync::Arc;

use crate::config::{Config, Tool};

/// Most rows of the tool table, so that memory stays bounded.
const MAX_TOOLS: usize = 10_000;

/// The tools.
#[derive(Clone, Debug)]
pub(crate) struct Tools {
    /// Shared by those who remember how things were.
    table: Arc<Vec<Tool>>,
    /// Number of the tool in the spindle, 0 for none.
    pub in_spindle: u32,
    /// What T has selected.
    pub selected: Option<u32>,
    /// The subroutine that changes tools is being executed: M6 in it is the change itself.
    pub changing: bool,
    /// The first line that has taken the length of a tool as zero, because there is no table.
    pub assumed_zero: Option<u32>,
}

impl Tools {
    pub fn new(config: &Config) -> Self {
        Self {
            table: Arc::new(config.tools.clone()),
            in_spindle: config.tool_in_spindle,
            selected: None,
            changing: false,
            assumed_zero: None,
        }
    }

    /// The tool called `number`.
    pub fn find(&self, number: u32) -> Option<&Tool> {
        self.table.iter().find(|tool| tool.number == number)
    }

    /// All rows.
    pub fn table(&self) -> &Vec<Tool> {
        &self.table
    }

    /// Replaces all rows, and the tool in the spindle.
    pub fn set_table(&mut self, tools: &[Tool], in_spindle: u32) {
        self.table = Arc::new(tools.to_vec());
        self.in_spindle = in_spindle;
    }

    /// Whether these are the same tools in the same places.
    pub fn is_as(&self, other: &Self) -> bool {
        (self.in_spindle, self.selected) == (other.in_spindle, other.selected)
            && (Arc::ptr_eq(&self.table, &other.table) || self.table == other.table)
    }

    /// Adds or replaces a row; false where the table is full.
    pub fn set(&mut self, tool: Tool) -> bool {
        let table = Arc::make_mut(&mut self.table);
        if let Some(row) = table.iter_mut().find(|row| row.number == tool.number) {
            *row = tool;
        } else if table.len() < MAX_TOOLS {
            table.push(tool);
        } else {
            return false;
        }
        true
    }
}
