//! The order in which the words of a line take effect.

use std::f64::consts::PI;

use tandem_sdk::PathMode;

use crate::fault::Checked;
use crate::interpreter::Interpreter;
use crate::item::Item;
use crate::letters::AXIS_MASK;
use crate::orders::motion_of;
use crate::state::{Feed, INCH_MM, Motion, Plane};
use crate::table::Group;

impl Interpreter {
    /// Obeys the line in LinuxCNC's order, but that the units and the feed mode of a line hold for all its words:
    /// `G20 F10` is 10 inches a minute.
    #[inline]
    pub(crate) fn execute(&mut self, out: &mut Vec<Item>) -> Checked<()> {
        self.set_units();
        self.set_feed()?;
        self.set_time_constant()?;
        if !self.words.m.as_slice().is_empty() || self.words.has(b'S') || self.words.has(b'T') {
            self.machine_words(out)?;
        }
        if !self.words.g.as_slice().is_empty() {
            self.set_modes()?;
            self.set_path_control()?;
            self.non_modal(out)?;
            self.set_motion();
        }
        if let Some(motion) = self.orders.motion {
            self.motion(motion, out)?;
        }
        if self.orders.get(Group::Stop).is_some() {
            self.stop(out);
        }
        Ok(())
    }

    fn set_units(&mut self) {
        match self.orders.get(Group::Units) {
            Some(200) => self.state.unit_mm = INCH_MM,
            Some(_) => self.state.unit_mm = 1.0,
            None => {}
        }
        if let Some(mode) = self.orders.get(Group::FeedMode) {
            let inverse_time = mode == 930;
            if inverse_time != self.state.feed.inverse_time {
                self.state.feed = Feed { inverse_time, ..Feed::default() };
            }
        }
    }

    #[inline]
    fn set_feed(&mut self) -> Checked<()> {
        if let Some(feed) = self.words.not_negative(b'F')?
            && !self.state.feed.inverse_time
        {
            self.state.feed.linear_mm_per_s = feed * self.state.unit_mm / 60.0;
            self.state.feed.rotary_rad_per_s = feed * PI / 180.0 / 60.0;
        }
        Ok(())
    }

    #[inline]
    fn set_time_constant(&mut self) -> Checked<()> {
        if let Some((value_ms, span)) = self.words.time_constant {
            if value_ms <= 0.0 || !value_ms.is_finite() {
                let message = "TA (time constant, ms) must be greater than zero";
                return Err(crate::fault::Fault::new(span, "time-constant", message));
            }
            let (least_s, most_s) = self.config.time_constant_s;
            // The limits are in ms in the machine file too; a nanosecond is the rounding on the way.
            if value_ms < least_s * 1e3 - 1e-6 || value_ms > most_s * 1e3 + 1e-6 {
                let [least, most, asked] = [least_s * 1e3, most_s * 1e3, value_ms].map(crate::fault::show);
                let message = format!("TA {asked} is beyond the time constants of this machine, {least} to {most} ms");
                return Err(crate::fault::Fault::new(span, "time-constant", message));
            }
            self.state.time_constant_s = value_ms / 1000.0;
        }
        Ok(())
    }

    /// Modes that only change how later words are read.
    fn set_modes(&mut self) -> Checked<()> {
        if let Some(plane) = self.orders.get(Group::Plane) {
            self.state.plane = match plane {
                170 => Plane::Xy,
                180 => Plane::Zx,
                _ => Plane::Yz,
            };
        }
        if let Some(mode) = self.orders.get(Group::Distance) {
            self.state.absolute = mode == 900;
        }
        if let Some(mode) = self.orders.get(Group::ArcDistance) {
            self.state.arc_absolute = mode == 901;
        }
        self.set_tool_length()?;
        if let Some(system) = self.orders.get(Group::CoordinateSystem) {
            self.state.offsets.active = if system < 590 { system / 10 - 54 } else { system - 585 } as usize;
            self.state.offsets.sum_up();
        }
        Ok(())
    }

    /// G61, G61.1, G64 P Q. P0 is as good as no P: the machine's tolerance. Q, LinuxCNC's tolerance for joining collinear lines, has no effect: planners join what is
    /// collinear themselves.
    fn set_path_control(&mut self) -> Checked<()> {
        let Some(mode) = self.orders.get(Group::PathControl) else { return Ok(()) };
        self.words.not_negative(b'Q')?;
        self.state.tolerance_mm = f64::NAN;
        self.state.path_mode = if mode == 640 { PathMode::Continuous } else { PathMode::ExactStop };
        if mode == 640
            && let Some(tolerance) = self.words.not_negative(b'P')?
            && tolerance > 0.0
        {
            self.state.tolerance_mm = tolerance * self.state.unit_mm;
        }
        Ok(())
    }

    fn set_motion(&mut self) {
        if let Some(tenths) = self.orders.get(Group::Motion) {
            // G31 holds for its line only; so does what opens a curve.
            if !matches!(tenths, 310 | 52 | 62) {
                self.state.motion = motion_of(tenths);
            }
        } else if self.orders.get(Group::CannedCycle).is_some() {
            self.state.motion = Motion::None;
        }
    }

    /// After an erroneous line: takes over what can be, so that the next lines are judged fairly. `complete` says
    /// whether all words of the line have been read.
    #[cold]
    pub(crate) fn recover(&mut self, complete: bool) {
        self.assign_anyway();
        self.set_units();
        // Errors of what follows have been reported already, or do not matter now.
        let _ = self.set_feed().and_then(|()| self.set_modes());
        self.set_motion();
        if self.orders.motion == Some(Motion::Refused) {
            self.state.motion = Motion::Refused;
        }
        if !complete {
            self.state.uncertain |= (1 << self.letters.count()) - 1;
        }
        if self.orders.axes_taken {
            self.state.uncertain |= self.letters.axes_of(self.words.present & AXIS_MASK);
        } else if !self.moved {
            self.advance();
        }
    }
}
