//! What a sender is told of the machine: status reports, offsets, modes.

use std::fmt::Write as _;
use std::sync::atomic::Ordering::Relaxed;

use tandem_gcode::{Interpreter, system_code};
use tandem_machine::{Machine, Role};
use tandem_rings::Status;
use tandem_sdk::{Axes, AxisVector};

use super::settings::{Settings, axes_shown};
use crate::controller::{ControllerState, Dispatcher, Mode};

/// Reports between two that have the offset, or the overrides, at rest and in motion, as grbl has them.
const REFRESHES: [u32; 2] = [10, 30];

/// What grbl calls what the machine does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum GrblState {
    Idle,
    Run,
    /// At rest, or on the way to it.
    Hold {
        rests: bool,
    },
    /// As [`GrblState::Hold`], behind a door.
    Door {
        rests: bool,
    },
    Jog,
    Home,
    Check,
    Alarm,
    Sleep,
}

impl GrblState {
    fn word(self) -> &'static str {
        match self {
            Self::Idle => "Idle",
            Self::Run => "Run",
            Self::Hold { rests: true } => "Hold:0",
            Self::Hold { rests: false } => "Hold:1",
            Self::Door { rests: true } => "Door:0",
            Self::Door { rests: false } => "Door:2",
            Self::Jog => "Jog",
            Self::Home => "Home",
            Self::Check => "Check",
            Self::Alarm => "Alarm",
            Self::Sleep => "Sleep",
        }
    }
}

/// What a sender has said that changes what it is shown.
#[derive(Clone, Copy, Debug, Default)]
#[allow(
    clippy::struct_excessive_bools,
    reason = "independent words of a sender"
)]
pub struct Said {
    /// Hold, though nothing moves.
    pub holds: bool,
    /// The door is to count as open.
    pub door: bool,
    /// Out of the alarm, though the machine is to be homed.
    pub unlocked: bool,
    /// Sleep.
    pub asleep: bool,
    /// Check mode.
    pub checks: bool,
}

/// What the machine does, in grbl's words.
pub fn state_of(dispatcher: &Dispatcher, said: Said) -> GrblState {
    let rests = !dispatcher.moves();
    let held = |rests| {
        let has_door = |role: Option<Role>| role == Some(Role::Door);
        let tripped = dispatcher.loop_status().tripped.load(Relaxed);
        let open = dispatcher
            .machine
            .inputs
            .iter()
            .any(|input| has_door(input.role) && tripped >> input.input.min(63) & 1 == 1);
        if open || said.door {
            GrblState::Door { rests }
        } else {
            GrblState::Hold { rests }
        }
    };
    match dispatcher.state() {
        ControllerState::Disabled if said.asleep => GrblState::Sleep,
        ControllerState::EmergencyStop | ControllerState::Fault | ControllerState::Disabled => {
            GrblState::Alarm
        }
        ControllerState::HomingNeeded if !said.unlocked => GrblState::Alarm,
        ControllerState::Ready | ControllerState::HomingNeeded => {
            let works = !dispatcher.is_still();
            if said.holds {
                held(true)
            } else if works && dispatcher.with_lines(|lines| lines.are_jogs()) {
                GrblState::Jog
            } else if works {
                GrblState::Run
            } else if said.checks {
                GrblState::Check
            } else {
                GrblState::Idle
            }
        }
        ControllerState::Manual => GrblState::Jog,
        ControllerState::Running if dispatcher.mode() == Mode::Homing => GrblState::Home,
        ControllerState::Running | ControllerState::Mdi => GrblState::Run,
        ControllerState::Held => held(rests),
        ControllerState::Stopping => match dispatcher.mode() {
            Mode::Enabling | Mode::Idle => GrblState::Alarm,
            Mode::Jog => GrblState::Jog,
            _ if dispatcher.fault_words().is_some() => GrblState::Alarm,
            _ => GrblState::Hold { rests: false },
        },
    }
}

/// A place or an offset as senders read it: mm or inches, and degrees.
pub fn vector(axes: &Axes, of: &AxisVector, inches: bool) -> String {
    let shown: Vec<String> = axes_shown(axes)
        .into_iter()
        .map(|axis| {
            let value = axis.map_or(0.0, |axis| of[axis]);
            match axis {
                Some(axis) if axes.is_rotary(axis) => number(value.to_degrees(), false),
                _ => length(value, inches),
            }
        })
        .collect();
    shown.join(",")
}

/// A length in mm as it is shown.
pub fn length(value_mm: f64, inches: bool) -> String {
    if inches {
        number(value_mm / 25.4, true)
    } else {
        number(value_mm, false)
    }
}

fn number(value: f64, inches: bool) -> String {
    let text = if inches {
        format!("{value:.4}")
    } else {
        format!("{value:.3}")
    };
    // Less than is shown is nothing.
    if text
        .trim_start_matches('-')
        .bytes()
        .all(|byte| b"0.".contains(&byte))
    {
        text.trim_start_matches('-').to_string()
    } else {
        text
    }
}

/// The reports of one sender, which have now and then what changes rarely.
#[derive(Debug, Default)]
pub struct Reports {
    count: u32,
    offset: Option<AxisVector>,
    rare: Option<String>,
}

/// Free places of a sender's lines.
#[derive(Clone, Copy, Debug)]
pub struct Free {
    pub lines: usize,
    pub bytes: usize,
}

impl Reports {
    /// The next one has everything.
    pub fn renew(&mut self) {
        *self = Self::default();
    }

    /// One status report.
    pub fn next(
        &mut self,
        dispatcher: &Dispatcher,
        settings: &Settings,
        said: Said,
        free: Free,
    ) -> String {
        let state = state_of(dispatcher, said);
        let axes = &dispatcher.machine.axes;
        let inches = settings.inches();
        let machine = dispatcher.hub.position();
        let (work, words) = dispatcher.with_lines(|lines| {
            let standing = lines.standing();
            (standing.to_program(&machine), accessories(standing))
        });
        let status = dispatcher.loop_status();
        let mut text = format!("<{}|", state.word());
        // A string takes whatever is written to it.
        let _ = if settings.has_machine_position() {
            write!(text, "MPos:{}", vector(axes, &machine, inches))
        } else {
            write!(text, "WPos:{}", vector(axes, &work, inches))
        };
        if settings.has_buffers() {
            let _ = write!(text, "|Bf:{},{}", free.lines, free.bytes);
        }
        let feed_per_min = status.feed_mm_per_s.load() * 60.0;
        let feed_per_min = if inches {
            feed_per_min / 25.4
        } else {
            feed_per_min
        };
        let rpm = status.spindle.told_rad_per_s.load().abs() * 30.0 / std::f64::consts::PI;
        let _ = write!(text, "|FS:{feed_per_min:.0},{rpm:.0}");
        let pins = pins(&dispatcher.machine, status);
        if !pins.is_empty() {
            let _ = write!(text, "|Pn:{pins}");
        }
        let controls = dispatcher.hub.controls();
        let percent = |ratio: f64| (ratio * 100.0).round();
        let overrides = format!(
            "Ov:{},{},100",
            percent(controls.feed_override.load()),
            percent(controls.rapid_override.load())
        );
        let rare = if words.is_empty() {
            overrides
        } else {
            format!("{overrides}|A:{words}")
        };
        let offset = machine - work;
        let every = REFRESHES[usize::from(!matches!(state, GrblState::Idle))];
        if self.offset != Some(offset) || self.count.is_multiple_of(every) {
            let _ = write!(text, "|WCO:{}", vector(axes, &offset, inches));
            self.offset = Some(offset);
        } else if self.rare.as_ref() != Some(&rare) || self.count % every == 1 {
            let _ = write!(text, "|{rare}");
            self.rare = Some(rare);
        }
        self.count = self.count.wrapping_add(1);
        text.push_str(">\r\n");
        text
    }
}

/// Spindle and coolant that are on: S or C, F, M.
fn accessories(standing: &Interpreter) -> String {
    let words = standing.modal_words();
    let mut text = String::new();
    for (word, letter) in [("M3", 'S'), ("M4", 'C')] {
        if words.iter().any(|of| of == word) {
            text.push(letter);
        }
    }
    for (word, letter) in [("M8", 'F'), ("M7", 'M')] {
        if standing.coolant_words().contains(&word) {
            text.push(letter);
        }
    }
    text
}

/// Inputs that are tripped: P the probe, D a door, H a hold, R emergency stop and drives that are not ready, X Y Z the limits.
fn pins(machine: &Machine, status: &Status) -> String {
    let tripped = status.tripped.load(Relaxed);
    let mut text = String::new();
    let mut add = |letter: char| {
        if !text.contains(letter) {
            text.push(letter);
        }
    };
    for input in &machine.inputs {
        if tripped >> input.input.min(63) & 1 == 0 {
            continue;
        }
        match input.role {
            Some(Role::Limit) => {
                // Whose limit it is stands in its name, if anywhere.
                let named = input.name.to_ascii_uppercase();
                let axis = "XYZABC".chars().find(|axis| named.starts_with(*axis));
                add(axis.unwrap_or('X'));
            }
            Some(Role::Probe) => add('P'),
            Some(Role::Door) => add('D'),
            Some(Role::FeedHold) => add('H'),
            Some(Role::EmergencyStop | Role::DrivesReady) => add('R'),
            Some(Role::Home) | None => {}
        }
    }
    if let Some(probe) = machine.probe
        && (status.inputs.load(Relaxed) >> probe.input.min(63) & 1 == 1) != probe.inverted
    {
        add('P');
    }
    text
}

/// `$G`: modal words as grbl orders them.
pub fn modes(ahead: &Interpreter, inches: bool) -> String {
    let words = ahead.modal_words();
    let find = |of: &[&str], else_it_is: &str| {
        let found = words.iter().find(|word| of.contains(&word.as_str()));
        found.map_or(else_it_is.to_string(), Clone::clone)
    };
    let motion = words
        .first()
        .filter(|word| {
            !word.starts_with("G17") && !word.starts_with("G18") && !word.starts_with("G19")
        })
        .map_or("G80", String::as_str);
    let system = words
        .iter()
        .find(|word| word.starts_with("G5") && word.as_str() != "G5")
        .map_or("G54", String::as_str);
    let plane = find(&["G17", "G18", "G19"], "G17");
    let units = find(&["G20", "G21"], "G21");
    let distance = find(&["G90", "G91"], "G90");
    let feed_mode = find(&["G93", "G94", "G95"], "G94");
    let spindle = find(&["M3", "M4", "M5"], "M5");
    let coolant = ahead.coolant_words();
    let coolant = if coolant.is_empty() {
        "M9".to_string()
    } else {
        coolant.join(" ")
    };
    let feed_per_min = ahead.feed_mm_per_s() * 60.0;
    let feed = if inches {
        format!("{:.1}", feed_per_min / 25.4)
    } else {
        format!("{feed_per_min:.0}")
    };
    let rpm = ahead.spindle_speed_rad_per_s() * 30.0 / std::f64::consts::PI;
    let tool = ahead.selected_tool().unwrap_or(ahead.tool_in_spindle());
    format!(
        "[GC:{motion} {system} {plane} {units} {distance} {feed_mode} {spindle} {coolant} T{tool} F{feed} S{rpm:.0}]\r\n"
    )
}

/// `$#`: offsets, and what the last probe found.
pub fn offsets(dispatcher: &Dispatcher, inches: bool) -> String {
    let axes = &dispatcher.machine.axes;
    let (persistent, probed) =
        dispatcher.with_lines(|lines| (lines.ahead().persistent_data(), lines.probed()));
    let mut text = String::new();
    let mut line = |name: &str, of: &AxisVector, more: &str| {
        let _ = write!(text, "[{name}:{}{more}]\r\n", vector(axes, of, inches));
    };
    for (index, origin) in persistent.origins.iter().enumerate() {
        line(&system_code(index), origin, "");
    }
    line("G28", &persistent.reference[0], "");
    line("G30", &persistent.reference[1], "");
    line("G92", &persistent.g92, "");
    let found = probed.map_or(AxisVector::ZERO, |probed| probed.position);
    let touched = u8::from(probed.is_some_and(|probed| probed.touched));
    let tool = axes.index('Z').map_or(0.0, |z| persistent.tool_offset[z]);
    let _ = write!(text, "[TLO:{}]\r\n", length(tool, inches));
    let _ = write!(text, "[PRB:{}:{touched}]\r\n", vector(axes, &found, inches));
    text
}

/// `$I`: who this is, what it can do, and how much may be on the way.
pub fn build(machine: &Machine, lines: usize, bytes: usize) -> String {
    let letters: String = axes_shown(&machine.axes)
        .into_iter()
        .enumerate()
        .map(|(nth, axis)| {
            let absent = ['X', 'Y', 'Z'].get(nth).copied().unwrap_or('?');
            axis.map_or(absent, |axis| machine.axes.letter(axis))
        })
        .collect();
    let name: String = machine
        .name
        .chars()
        .filter(|c| c.is_ascii_graphic() && !"[]|<>:".contains(*c) || *c == ' ')
        .collect();
    let homes = if machine.homing.is_empty() { "" } else { "H" };
    format!(
        "[VER:1.1h.20190830:Tandem {name}]\r\n[OPT:VM{homes},{lines},{bytes}]\r\n[AXS:{}:{letters}]\r\n",
        letters.len()
    )
}
