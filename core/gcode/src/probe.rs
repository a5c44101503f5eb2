//! G38.2 to G38.5 and G31: a straight line that the probe ends.

use tandem_sdk::{Block, BlockKind, Edge, StopOn};

use crate::fault::Checked;
use crate::interpreter::Interpreter;
use crate::item::{Item, ProbeResult};
use crate::letters::{AXIS_LETTERS, AXIS_MASK};
use crate::motion::NO_MOVE;
use crate::table::{Group, written};

/// First of the nine parameters of the touched position.
pub(crate) const TOUCHED: usize = 5061;
/// Whether the last probe touched (or let go).
pub(crate) const SUCCESS: usize = 5070;

impl Interpreter {
    /// A probe: rest, and the block that an edge ends.
    pub(crate) fn probe(&mut self, tenths: u16, out: &mut Vec<Item>) -> Checked<()> {
        let stop_on = self.stop_on(tenths)?;
        self.check_probe(tenths)?;
        let end = self.block_end();
        let displacement = end - self.state.last_end;
        let length_mm = self.config.axes.path_length(&displacement);
        if length_mm <= NO_MOVE {
            let message = format!("{} would not move: the probe stands where it is to end", written('G', tenths));
            return Err(self.motion_fault("probe-distance", message));
        }
        let feed_mm_per_s = self.feed(length_mm, self.moves_linear(&displacement))?;
        for axis in (0..self.letters.count()).filter(|axis| displacement[*axis] != 0.0) {
            self.check_travel(axis, end[axis], end[axis])?;
        }
        self.rest(out);
        let blank = self.state.blank_block();
        let block = Block { kind: BlockKind::Line, end, length_mm, feed_mm_per_s, stop_on, ..blank };
        self.push(block, out);
        self.state.at_rest = true;
        Ok(())
    }

    fn stop_on(&self, tenths: u16) -> Checked<StopOn> {
        let Some(probe) = self.config.probe else {
            let message = format!("{}: this machine has no probe: its file has no [probe]", written('G', tenths));
            return Err(self.motion_fault("refused", message));
        };
        let away = matches!(tenths, 384 | 385);
        let edge = if away == probe.inverted { Edge::Rising } else { Edge::Falling };
        Ok(StopOn { input: probe.input, edge, miss_is_fault: u32::from(matches!(tenths, 382 | 384)) })
    }

    /// What a probe does not go with.
    fn check_probe(&self, tenths: u16) -> Checked<()> {
        let word = written('G', tenths);
        if self.orders.get(Group::NonModal) == Some(530) {
            return Err(self.orders.fault(Group::NonModal, "conflict", "G53 goes with G0 and G1 only"));
        }
        if self.orders.get(Group::InputOutput) == Some(660) {
            let message = format!("{word} and M66 each wait for an input: split the line");
            return Err(self.motion_fault("conflict", message));
        }
        if self.words.present & AXIS_MASK == 0 {
            return Err(self.motion_fault("axis-missing", format!("{word} needs at least one axis word")));
        }
        if self.state.feed.inverse_time {
            let message = format!("{word} does not go with G93: where it ends is not known, so its time is not either");
            return Err(self.motion_fault("conflict", message));
        }
        Ok(())
    }

    /// What became of the probe. #5061 to #5069 get the touched position in program coordinates and units, the
    /// programmed end where nothing touched; #5070 says which. The program goes on from where the machine rests.
    pub fn provide_probe(&mut self, result: &ProbeResult) {
        let touched = result.touched.unwrap_or(self.state.position);
        for (nth, letter) in AXIS_LETTERS.bytes().enumerate() {
            let axis = self.letters.axis(letter);
            let value = axis.map_or(0.0, |axis| {
                (touched[axis] - self.state.offsets.total[axis]) / self.state.scale(&self.letters, axis)
            });
            self.parameters.set_numbered(TOUCHED + nth, value, false);
        }
        self.parameters.set_numbered(SUCCESS, f64::from(u8::from(result.touched.is_some())), false);
        self.set_position(result.rest);
    }

    /// The first pass: the probe is taken to touch at its end, and what follows from that to be unknown.
    pub(crate) fn assume_probe(&mut self) {
        let end = self.state.position;
        let axes = self.letters.axes_of(self.words.present & AXIS_MASK);
        let assumed = self.state.assumed.position | axes;
        self.provide_probe(&ProbeResult { touched: Some(end), rest: end });
        (TOUCHED..=SUCCESS).for_each(|number| self.parameters.assume(number));
        self.state.assumed.position = assumed;
    }
}
