//! What `$$` lists: how reports look may be said here, everything else is what the machine file says.

use std::fmt::Write as _;
use std::sync::atomic::Ordering::Relaxed;
use std::sync::atomic::{AtomicBool, AtomicU8};

use tandem_machine::Machine;
use tandem_sdk::Axes;

/// Bit of `$10`: machine positions instead of work positions.
const MACHINE_POSITION: u8 = 1;
/// Bit of `$10`: free places of planner and buffer.
const BUFFERS: u8 = 2;

/// How reports look, for all senders, as long as the controller stays.
pub struct Settings {
    mask: AtomicU8,
    inches: AtomicBool,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            mask: AtomicU8::new(MACHINE_POSITION | BUFFERS),
            inches: AtomicBool::new(false),
        }
    }
}

impl Settings {
    /// Whether reports are in inches ($13).
    pub fn inches(&self) -> bool {
        self.inches.load(Relaxed)
    }

    /// Whether they have machine positions ($10).
    pub fn has_machine_position(&self) -> bool {
        self.mask.load(Relaxed) & MACHINE_POSITION != 0
    }

    /// Whether they have free places ($10).
    pub fn has_buffers(&self) -> bool {
        self.mask.load(Relaxed) & BUFFERS != 0
    }

    /// `$n=value`.
    ///
    /// # Errors
    /// Why not, in words.
    pub fn set(&self, machine: &Machine, number: &str, value: &str) -> Result<(), String> {
        let value: f64 = value
            .trim()
            .parse()
            .map_err(|_| format!("{value} is no number"))?;
        match number {
            "10" if (0.0..=255.0).contains(&value) && value.fract() == 0.0 => {
                self.mask.store(value as u8, Relaxed);
            }
            "13" if value == 0.0 || value == 1.0 => self.inches.store(value == 1.0, Relaxed),
            "10" | "13" => return Err(format!("{value} is not what ${number} can be")),
            _ => {
                let file = machine.path.display();
                return Err(format!(
                    "{file} says what the machine is: ${number} is not set here"
                ));
            }
        }
        Ok(())
    }

    /// The list, as `$$` prints it. What grbl says of step motors has no meaning here and is not in it. Allocates.
    pub fn list(&self, machine: &Machine) -> String {
        let mut text = String::new();
        let mut line = |number: usize, value: f64| {
            // A string takes whatever is written to it.
            let _ = write!(text, "${number}={}\r\n", shown(value));
        };
        let whole = |on: bool| f64::from(u8::from(on));
        let rpm = |rad_per_s: f64| rad_per_s * 30.0 / std::f64::consts::PI;
        line(10, f64::from(self.mask.load(Relaxed)));
        line(11, machine.motion.path_tolerance_mm);
        line(13, whole(self.inches()));
        line(20, 1.0);
        line(22, whole(!machine.homing.is_empty()));
        let spindle = &machine.spindle;
        if spindle.max_rad_per_s.is_finite() {
            line(30, rpm(spindle.max_rad_per_s).round());
            line(31, rpm(spindle.min_rad_per_s).round());
        }
        line(32, 0.0);
        let limits = machine.limits.axes();
        let axes = axes_shown(&machine.axes);
        let each = |of: &dyn Fn(usize) -> f64| -> Vec<f64> {
            axes.iter()
                .map(|axis| axis.map_or(0.0, |axis| of(axis) * per(machine, axis)))
                .collect()
        };
        let rapids = each(&|axis| limits[axis].rapid_mm_per_s * 60.0);
        let accelerations = each(&|axis| limits[axis].acceleration_mm_per_s2);
        let travels = each(&|axis| limits[axis].max_mm - limits[axis].min_mm);
        for (first, values) in [(110, rapids), (120, accelerations), (130, travels)] {
            for (nth, value) in values.iter().enumerate() {
                if value.is_finite() {
                    line(first + nth, *value);
                }
            }
        }
        text
    }
}

/// Degrees of a rotary axis for its rad.
fn per(machine: &Machine, axis: usize) -> f64 {
    if machine.axes.is_rotary(axis) {
        1.0_f64.to_degrees()
    } else {
        1.0
    }
}

fn shown(value: f64) -> String {
    if value.fract() == 0.0 {
        format!("{value:.0}")
    } else {
        format!("{value:.3}")
    }
}

/// The axes in the order in which senders expect them: X Y Z, whether the machine has them or not, and the others behind them.
pub fn axes_shown(axes: &Axes) -> Vec<Option<usize>> {
    let first = "XYZ".chars().map(|letter| axes.index(letter));
    let others = (0..axes.count())
        .filter(|axis| !"XYZ".contains(axes.letter(*axis)))
        .map(Some);
    first.chain(others).collect()
}
