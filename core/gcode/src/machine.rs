//! S, T and the M words: what the machine does beside moving.

use std::f64::consts::PI;

use tandem_sdk::{BlockKind, Event, EventKind};

use crate::fault::Checked;
use crate::interpreter::Interpreter;
use crate::item::Item;
use crate::table::Group;

/// The permissions of M48 to M53, in the order of the state.
const PERMITS: [EventKind; 4] =
    [EventKind::FeedOverride, EventKind::SpindleOverride, EventKind::AdaptiveFeed, EventKind::FeedHold];

impl Interpreter {
    /// S, T and M words other than the stops.
    pub(crate) fn machine_words(&mut self, out: &mut Vec<Item>) -> Checked<()> {
        self.select_tool(out)?;
        self.input_output(out)?;
        self.change_tool(out)?;
        self.set_spindle(out)?;
        self.set_coolant(out)?;
        self.set_permits(out)
    }

    pub(crate) fn event(&self, kind: EventKind, index: u32, value: f64, out: &mut Vec<Item>) {
        let event = Event::new(kind, self.state.line, self.state.next_index, index.cast_signed(), value);
        out.push(Item::Event(event));
    }

    /// Brings the machine to rest: an event that needs it follows.
    pub(crate) fn rest(&mut self, out: &mut Vec<Item>) {
        if !self.state.at_rest {
            self.push_dwell(0.0, out);
        }
    }

    fn push_dwell(&mut self, dwell_s: f64, out: &mut Vec<Item>) {
        let mut block = self.state.blank_block();
        block.kind = BlockKind::Dwell;
        block.dwell_s = dwell_s;
        out.push(Item::Block(block));
        self.state.next_index += 1;
        self.state.at_rest = true;
    }

    /// G4 P.
    pub(crate) fn dwell(&mut self, out: &mut Vec<Item>) -> Checked<()> {
        let dwell_s = self.dwell_s()?;
        self.push_dwell(dwell_s, out);
        Ok(())
    }

    pub(crate) fn dwell_s(&self) -> Checked<f64> {
        let missing = || self.orders.fault(Group::NonModal, "word-missing", "G4 needs P, the dwell in seconds");
        self.words.not_negative(b'P')?.ok_or_else(missing)
    }

    fn select_tool(&mut self, out: &mut Vec<Item>) -> Checked<()> {
        let Some(number) = self.words.integer(b'T', 0..=99_999)? else { return Ok(()) };
        if number != 0 && !self.config.tools.is_empty() && self.state.find_tool(number).is_none() {
            return Err(self.words.fault(b'T', "tool", format!("the tool table has no tool {number}")));
        }
        if self.state.selected_tool != Some(number) {
            self.state.selected_tool = Some(number);
            self.event(EventKind::ToolSelect, number, 0.0, out);
        }
        Ok(())
    }

    /// M6. The spindle stops, as in LinuxCNC: nobody changes the tool of a spindle that turns.
    fn change_tool(&mut self, out: &mut Vec<Item>) -> Checked<()> {
        if self.orders.get(Group::ToolChange).is_none() {
            return Ok(());
        }
        let Some(number) = self.state.selected_tool else {
            return Err(self.orders.fault(Group::ToolChange, "tool", "M6 has no tool to change to: T is missing"));
        };
        if number != self.state.tool {
            self.rest(out);
            self.stop_spindle(out);
            self.state.tool = number;
            self.event(EventKind::ToolChange, number, 0.0, out);
        }
        Ok(())
    }

    /// A change of direction needs rest, a change of speed does not.
    fn set_spindle(&mut self, out: &mut Vec<Item>) -> Checked<()> {
        let mut spindle = self.state.spindle;
        if let Some(speed) = self.words.not_negative(b'S')? {
            spindle.speed_rad_per_s = speed * PI / 30.0;
        }
        match self.orders.get(Group::Spindle) {
            Some(30) => spindle.direction = 1,
            Some(40) => spindle.direction = -1,
            Some(_) => spindle.direction = 0,
            None => {}
        }
        let turns = spindle.direction != self.state.spindle.direction;
        if turns {
            self.rest(out);
        }
        let changed = turns || spindle.command_rad_per_s() != self.state.spindle.command_rad_per_s();
        self.state.spindle = spindle;
        if changed {
            self.event(EventKind::Spindle, 0, spindle.command_rad_per_s(), out);
        }
        Ok(())
    }

    fn set_coolant(&mut self, out: &mut Vec<Item>) -> Checked<()> {
        let (mist, flood) = (self.orders.get(Group::Mist).is_some(), self.orders.get(Group::Flood).is_some());
        let off = self.orders.get(Group::CoolantOff).is_some();
        if off && (mist || flood) {
            return Err(self.orders.fault(
                Group::CoolantOff,
                "conflict",
                "M9 and M7 or M8 exclude each other in a line",
            ));
        }
        let wanted = |on: bool, now: bool| !off && (on || now);
        let (mist, flood) = (wanted(mist, self.state.mist), wanted(flood, self.state.flood));
        self.switch_coolant(mist, flood, out);
        Ok(())
    }

    fn switch_coolant(&mut self, mist: bool, flood: bool, out: &mut Vec<Item>) {
        let value = |on: bool| f64::from(u8::from(on));
        if mist != self.state.mist {
            self.event(EventKind::Mist, 0, value(mist), out);
        }
        if flood != self.state.flood {
            self.event(EventKind::Flood, 0, value(flood), out);
        }
        (self.state.mist, self.state.flood) = (mist, flood);
    }

    /// M48 to M53.
    fn set_permits(&mut self, out: &mut Vec<Item>) -> Checked<()> {
        let Some(code) = self.orders.get(Group::Override) else { return Ok(()) };
        let on = match code {
            480 => true,
            490 => false,
            _ => self.words.integer(b'P', 0..=1)?.unwrap_or(1) == 1,
        };
        let concerned = match code {
            480 | 490 => 0..2,
            _ => usize::from((code - 500) / 10)..usize::from((code - 500) / 10) + 1,
        };
        for which in concerned {
            if self.state.permits[which] != on {
                self.state.permits[which] = on;
                self.event(PERMITS[which], 0, f64::from(u8::from(on)), out);
            }
        }
        Ok(())
    }

    /// M0, M1, M2, M30: after the motion of the line.
    pub(crate) fn stop(&mut self, out: &mut Vec<Item>) {
        self.rest(out);
        match self.orders.get(Group::Stop) {
            Some(0) => self.event(EventKind::ProgramStop, 0, 0.0, out),
            Some(10) => self.event(EventKind::OptionalStop, 0, 0.0, out),
            _ => {
                self.switch_off(out);
                self.event(EventKind::ProgramEnd, 0, 0.0, out);
                self.end(out);
            }
        }
    }

    /// Stops spindle and coolant where they run.
    pub(crate) fn switch_off(&mut self, out: &mut Vec<Item>) {
        self.stop_spindle(out);
        self.switch_coolant(false, false, out);
    }

    fn stop_spindle(&mut self, out: &mut Vec<Item>) {
        if self.state.spindle.direction != 0 {
            self.rest(out);
            self.state.spindle.direction = 0;
            self.event(EventKind::Spindle, 0, 0.0, out);
        }
    }
}
