//! Words that move coordinate systems: G10, G43, G49, G92, and the reference positions of G28 and G30.

use tandem_sdk::AxisVector;

use crate::config::Tool;
use crate::fault::Checked;
use crate::interpreter::Interpreter;
use crate::item::Item;
use crate::letters::AXIS_MASK;
use crate::state::SYSTEMS;
use crate::table::Group;

/// Highest tool number.
const MAX_TOOL: u32 = 99_999;
/// Most rows of the tool table, so that memory stays bounded.
const MAX_TOOLS: usize = 10_000;

impl Interpreter {
    /// Non-modal words.
    pub(crate) fn non_modal(&mut self, out: &mut Vec<Item>) -> Checked<()> {
        match self.orders.get(Group::NonModal) {
            Some(40) => self.dwell(out),
            Some(100) => self.set_data(),
            Some(280) => self.go_to_reference(0, out),
            Some(300) => self.go_to_reference(1, out),
            Some(code @ (281 | 301)) => {
                self.state.reference[usize::from(code == 301)] = self.state.position;
                Ok(())
            }
            Some(920) => self.set_position_offset(),
            Some(code @ (921..=923)) => {
                self.change_position_offset(code);
                Ok(())
            }
            _ => Ok(()),
        }
    }

    /// The axes that the line names, with their values in inner units.
    pub(crate) fn named_axes(&self) -> impl Iterator<Item = (usize, f64)> + '_ {
        (0..self.letters.count()).filter_map(|axis| {
            let value = self.words.get(self.letters.letter(axis))?;
            Some((axis, value * self.state.scale(&self.letters, axis)))
        })
    }

    fn need_axes(&self, what: &str) -> Checked<()> {
        if self.words.present & AXIS_MASK != 0 {
            return Ok(());
        }
        Err(self.orders.fault(Group::NonModal, "axis-missing", format!("{what} needs at least one axis word")))
    }

    /// G92: the offset that gives the current position the named coordinates.
    fn set_position_offset(&mut self) -> Checked<()> {
        self.need_axes("G92")?;
        let mut g92 = self.state.offsets.g92;
        for (axis, value) in self.named_axes() {
            g92[axis] += self.state.position[axis] - self.state.offsets.total[axis] - value;
        }
        self.assume_offsets(true);
        self.state.offsets.g92 = g92;
        self.state.offsets.g92_stored = g92;
        self.state.offsets.sum_up();
        Ok(())
    }

    /// G92.1 clears, G92.2 suspends, G92.3 restores.
    fn change_position_offset(&mut self, code: u16) {
        let offsets = &mut self.state.offsets;
        offsets.g92 = if code == 923 { offsets.g92_stored } else { AxisVector::ZERO };
        if code == 921 {
            offsets.g92_stored = AxisVector::ZERO;
        }
        offsets.sum_up();
    }

    /// Whether the offsets of the named axes now follow from what the first pass has assumed.
    fn assume_offsets(&mut self, from_position: bool) {
        let named = self.letters.axes_of(self.words.present & AXIS_MASK);
        let of_position = if from_position { self.state.assumed.position | self.state.assumed.offsets } else { 0 };
        self.state.assumed.offsets |= named & if self.reads_assumed.get() { u32::MAX } else { of_position };
    }

    fn set_data(&mut self) -> Checked<()> {
        match self.words.integer(b'L', 0..=999)? {
            Some(1) => self.set_tool(),
            Some(2) => self.set_system(false),
            Some(20) => self.set_system(true),
            Some(other) => {
                let message = format!("G10 L{other} is not supported; L1 (tools), L2 and L20 (coordinate systems) are");
                Err(self.words.fault(b'L', "refused", message))
            }
            None => Err(self.orders.fault(Group::NonModal, "word-missing", "G10 needs L1, L2 or L20")),
        }
    }

    /// G10 L2 sets the origin of a system; L20 sets it so that the current position gets the named coordinates.
    fn set_system(&mut self, from_position: bool) -> Checked<()> {
        if self.words.get(b'R').is_some_and(|angle| angle != 0.0) {
            return Err(self.words.fault(b'R', "refused", "rotated coordinate systems (G10 R) are not supported"));
        }
        let number = self.words.integer(b'P', 0..=SYSTEMS as u32)?;
        let Some(number) = number else {
            return Err(self.orders.fault(
                Group::NonModal,
                "word-missing",
                "G10 needs P, the coordinate system (0 to 9)",
            ));
        };
        let system = if number == 0 { self.state.offsets.active } else { number as usize - 1 };
        let offsets = &self.state.offsets;
        let mut origin = offsets.systems[system];
        for (axis, value) in self.named_axes() {
            origin[axis] = if from_position {
                self.state.position[axis] - offsets.g92[axis] - offsets.tool[axis] - value
            } else if self.state.absolute {
                value
            } else {
                origin[axis] + value
            };
        }
        self.assume_offsets(from_position);
        self.state.offsets.systems[system] = origin;
        self.state.offsets.sum_up();
        Ok(())
    }

    /// G10 L1: a row of the tool table, for this run only.
    fn set_tool(&mut self) -> Checked<()> {
        let Some(number) = self.words.integer(b'P', 1..=MAX_TOOL)? else {
            return Err(self.orders.fault(Group::NonModal, "word-missing", "G10 L1 needs P, the number of the tool"));
        };
        let blank = Tool { number, pocket: None, offset: AxisVector::ZERO, diameter_mm: 0.0 };
        let mut tool = self.state.find_tool(number).copied().unwrap_or(blank);
        for (axis, value) in self.named_axes() {
            tool.offset[axis] = value;
        }
        self.assume_offsets(false);
        if let Some(radius) = self.words.not_negative(b'R')? {
            tool.diameter_mm = 2.0 * radius * self.state.unit_mm;
        }
        let rows = self.state.tools.len();
        match self.state.tools.iter_mut().find(|t| t.number == number) {
            Some(row) => *row = tool,
            None if rows < MAX_TOOLS => self.state.tools.push(tool),
            None => return Err(self.words.fault(b'P', "tool", "the tool table is full")),
        }
        Ok(())
    }

    /// G43 and G49. A later change of the tool or of its row acts with the next G43.
    pub(crate) fn set_tool_length(&mut self) -> Checked<()> {
        let Some(code) = self.orders.get(Group::ToolLength) else { return Ok(()) };
        let number = self.words.integer(b'H', 0..=MAX_TOOL)?.unwrap_or(self.state.tool);
        self.state.offsets.tool = match (code, number) {
            (490, _) | (_, 0) => AxisVector::ZERO,
            _ => self.state.find_tool(number).map(|tool| tool.offset).ok_or_else(|| self.no_tool(number))?,
        };
        self.state.offsets.sum_up();
        Ok(())
    }

    fn no_tool(&self, number: u32) -> crate::fault::Fault {
        self.orders.fault(Group::ToolLength, "tool", format!("the tool table has no tool {number}"))
    }
}
