//! Whether a motion stays within the travel of the axes.

use std::fmt::Write as _;

use crate::fault::{Checked, Fault, show};
use crate::interpreter::Interpreter;
use crate::table::Group;

/// Rounding that a travel limit forgives, mm or rad.
const TRAVEL_ROUNDING: f64 = 1e-9;

impl Interpreter {
    /// Whether `low` to `high`, machine coordinates, lies within the travel of `axis`.
    #[inline]
    pub(crate) fn check_travel(&self, axis: usize, low: f64, high: f64) -> Checked<()> {
        let (min, max) = self.config.travel_mm[axis];
        if low >= min - TRAVEL_ROUNDING && high <= max + TRAVEL_ROUNDING || self.state.uncertain >> axis & 1 != 0 {
            return Ok(());
        }
        Err(self.beyond_travel(axis, if high > max + TRAVEL_ROUNDING { high } else { low }))
    }

    #[cold]
    fn beyond_travel(&self, axis: usize, value: f64) -> Fault {
        let rotary = self.letters.is_rotary(axis);
        let shown = |v: f64| show(if rotary { v.to_degrees() } else { v });
        let (unit, letter) = (if rotary { "deg" } else { "mm" }, self.letters.letter(axis));
        let (min, max) = self.config.travel_mm[axis];
        let name = letter as char;
        let travel = format!("{} to {} {unit}", shown(min), shown(max));
        let mut message =
            format!("{name} would reach {} {unit}, beyond its travel of {travel} (machine coordinates", shown(value));
        let offset = self.state.offsets.total[axis];
        if offset != 0.0 {
            let _ = write!(message, "; the offset in force is {} {unit}", shown(offset));
        }
        message.push(')');
        if self.words.has(letter) {
            self.words.fault(letter, "travel", message)
        } else {
            self.whole_fault("travel", message)
        }
    }

    fn whole_fault(&self, code: &'static str, message: String) -> Fault {
        if self.orders.axes_taken {
            self.orders.fault(Group::NonModal, code, message)
        } else {
            self.motion_fault(code, message)
        }
    }
}
