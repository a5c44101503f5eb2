//! A drive by CiA 402: its states, what it is told in every period, what is made of its answers.

use tandem_sdk::{Feedback, JointState, Latch, Setpoint};

use crate::map::{Entry, Map, i32_at, put, u16_at};
use crate::options::{DeviceOptions, SpindleMode};
use crate::probe::Probe;
use crate::words::own;

/// Modes of operation (6060).
const CYCLIC_POSITION: i8 = 8;
const HOMING: i8 = 6;
const CYCLIC_VELOCITY: i8 = 9;
const PROFILE_VELOCITY: i8 = 3;

/// Bits of the control word (6040).
const FAULT_RESET: u16 = 0x80;
const START_HOMING: u16 = 0x10;
const QUICK_STOP: u16 = 0x02;

/// Bits of the status word (6041).
const REACHED: u16 = 1 << 10;
const ATTAINED: u16 = 1 << 12;
const HOMING_ERROR: u16 = 1 << 13;

/// How long a reset is held, s: drives look at the edge in loops of up to 10 ms.
const RESET_S: f64 = 0.05;

/// How long a drive may show another mode than it was asked for while it is enabled, s.
const MODE_S: f64 = 1.0;

/// Exchanges behind the start of a homing in which the status may still be of the one before: one on the way to the drive, one in
/// it, one back.
const STALE_EXCHANGES: u32 = 4;

/// What a drive moves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Moves {
    /// The joint of this number.
    Joint(usize),
    /// The spindle.
    Spindle { mode: i8, at_speed_share: f64 },
}

/// What was asked of its homing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum HomingPhase {
    Idle,
    /// The mode is asked for.
    Mode,
    /// It moves; so many exchanges ago it was started.
    Moving(u32),
    /// Back to positions.
    Back,
    /// It is homed.
    Done,
}

/// Where its objects lie.
#[derive(Clone, Copy, Debug, Default)]
struct Places {
    control: Option<usize>,
    mode: Option<usize>,
    target: Option<usize>,
    target_velocity: Option<usize>,
    velocity_offset: Option<usize>,
    torque_offset: Option<usize>,
    max_torque: Option<usize>,
    probe: Option<usize>,
    status: Option<usize>,
    mode_shown: Option<usize>,
    position: Option<usize>,
    velocity: Option<usize>,
    torque: Option<usize>,
    error: Option<usize>,
    probe_status: Option<usize>,
    rising: Option<usize>,
    falling: Option<usize>,
    inputs: Option<usize>,
}

/// What it is told once, from options and its own objects.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Constants {
    pub(crate) moves: Moves,
    /// Counts for a mm or rad, negative where it counts the other way round.
    pub(crate) counts_per_unit: f64,
    pub(crate) zero_counts: i64,
    /// Its units of velocity for one count/s.
    pub(crate) velocity_scale: f64,
    pub(crate) torque_permille_per_acceleration: f64,
    /// Current at rated torque, A.
    pub(crate) rated_current_a: f64,
    /// Torque limit that it has by itself, and that it is homed with, permille.
    pub(crate) max_torque: u16,
    pub(crate) homing_torque: u16,
    pub(crate) period_s: f64,
    /// How long it may take to be enabled, s, before that is a fault of its own.
    pub(crate) enable_s: f64,
}

/// One drive.
#[derive(Clone, Debug)]
#[allow(clippy::struct_excessive_bools, reason = "each is asked for by itself")]
pub(crate) struct Drive {
    constants: Constants,
    places: Places,
    status: u16,
    mode_shown: i8,
    error: u16,
    raw: i32,
    count: i64,
    count_before: i64,
    velocity: f64,
    torque: f64,
    pub(crate) digital: u32,
    control: u16,
    mode: i8,
    /// What it is told to be at.
    target: i64,
    wanted: bool,
    /// Whether it was reported as enabled in the last exchange: from then on its setpoint counts.
    follows: bool,
    /// Whether it has been enabled since it was last told to be.
    was_enabled: bool,
    quick: bool,
    reset_left: u32,
    mode_waits: u32,
    enable_waits: u32,
    code: u32,
    homing: HomingPhase,
    probe: Option<Probe>,
    latch: Option<Latch>,
}

/// The objects that a drive is to map, towards it and from it.
pub(crate) fn wanted(device: &DeviceOptions, limits_torque: bool) -> [Vec<Entry>; 2] {
    let mut out = vec![Entry::new(0x6040, 16)];
    let mut back = vec![
        Entry::new(0x6041, 16),
        Entry::new(0x6064, 32),
        Entry::new(0x606C, 32),
    ];
    if device.spindle.is_some() {
        out.push(Entry::new(0x60FF, 32));
    } else {
        out.push(Entry::new(0x607A, 32));
        if device.feed_forward {
            out.push(Entry::new(0x60B1, 32));
        }
        if device.torque_permille_per_acceleration != 0.0 {
            out.push(Entry::new(0x60B2, 16));
        }
        if limits_torque {
            out.push(Entry::new(0x6072, 16));
        }
    }
    back.extend([Entry::new(0x6077, 16), Entry::new(0x603F, 16)]);
    if let Some(probe) = device.probe {
        out.push(Entry::new(0x60B8, 16));
        let [rising, falling] = Probe::objects(probe.latch);
        back.extend([
            Entry::new(0x60B9, 16),
            Entry::new(rising, 32),
            Entry::new(falling, 32),
        ]);
    }
    if !device.inputs.is_empty() {
        back.push(Entry::new(0x60FD, 32));
    }
    // Bytes come last, so that everything else lies at even places.
    out.push(Entry::new(0x6060, 8));
    back.push(Entry::new(0x6061, 8));
    [out, back]
}

/// The mode that a spindle's drive is asked for.
pub(crate) fn spindle_mode(mode: SpindleMode) -> i8 {
    match mode {
        SpindleMode::Csv => CYCLIC_VELOCITY,
        SpindleMode::Pv => PROFILE_VELOCITY,
    }
}

impl Drive {
    /// A drive with its process data as they are mapped.
    pub(crate) fn new(constants: Constants, device: &DeviceOptions, maps: [&Map; 2]) -> Self {
        let [out, back] = maps;
        let probe_objects = device.probe.map(|probe| Probe::objects(probe.latch));
        let edge = |n: usize| probe_objects.and_then(|objects| back.place(objects[n], 32));
        let places = Places {
            control: out.place(0x6040, 16),
            mode: out.place(0x6060, 8),
            target: out.place(0x607A, 32),
            target_velocity: out.place(0x60FF, 32),
            velocity_offset: out.place(0x60B1, 32),
            torque_offset: out.place(0x60B2, 16),
            max_torque: out.place(0x6072, 16),
            probe: out.place(0x60B8, 16),
            status: back.place(0x6041, 16),
            mode_shown: back.place(0x6061, 8),
            position: back.place(0x6064, 32),
            velocity: back.place(0x606C, 32),
            torque: back.place(0x6077, 16),
            error: back.place(0x603F, 16),
            probe_status: back.place(0x60B9, 16),
            rising: edge(0),
            falling: edge(1),
            inputs: back.place(0x60FD, 32),
        };
        let mode = match constants.moves {
            Moves::Joint(_) => CYCLIC_POSITION,
            Moves::Spindle { mode, .. } => mode,
        };
        Self {
            constants,
            places,
            status: 0,
            mode_shown: 0,
            error: 0,
            raw: 0,
            count: 0,
            count_before: 0,
            velocity: 0.0,
            torque: 0.0,
            digital: 0,
            control: 0,
            mode,
            target: 0,
            wanted: false,
            follows: false,
            was_enabled: false,
            quick: false,
            reset_left: 0,
            mode_waits: 0,
            enable_waits: 0,
            code: 0,
            homing: HomingPhase::Idle,
            probe: device.probe.map(Probe::new),
            latch: None,
        }
    }

    /// What is missing of what it has to be told and to tell; none where nothing is.
    pub(crate) fn missing(&self, device: &DeviceOptions) -> Option<u16> {
        let joint = matches!(self.constants.moves, Moves::Joint(_));
        let places = &self.places;
        let needs = [
            (0x6040, true, places.control),
            (0x6041, true, places.status),
            (0x6060, true, places.mode),
            (0x607A, joint, places.target),
            (0x6064, joint, places.position),
            (0x60FF, !joint, places.target_velocity),
            (0x606C, !joint, places.velocity),
            (0x60B1, joint && device.feed_forward, places.velocity_offset),
            (0x60B8, device.probe.is_some(), places.probe),
            (0x60B9, device.probe.is_some(), places.probe_status),
            (0x60FD, !device.inputs.is_empty(), places.inputs),
        ];
        needs
            .into_iter()
            .find(|(_, needed, place)| *needed && place.is_none())
            .map(|(index, ..)| index)
    }

    pub(crate) fn moves(&self) -> Moves {
        self.constants.moves
    }

    /// Its status word, as it came last.
    pub(crate) fn status(&self) -> u16 {
        self.status
    }

    /// Where the first answer finds it: its count is what its encoder says.
    pub(crate) fn begin(&mut self, inputs: &[u8]) {
        self.answer(inputs);
        self.count = i64::from(self.raw);
        self.count_before = self.count;
        self.target = self.count;
    }

    /// The drives are to come to rest by their own means, until they are let go or reset.
    pub(crate) fn quick_stop(&mut self) {
        self.quick = true;
    }

    /// The host tells nothing any more: a joint that moves is brought to rest by its drive.
    pub(crate) fn fall_silent(&mut self, moving: bool) {
        if moving && self.follows {
            self.quick = true;
            self.code = own::SILENT_HOST;
        }
    }

    fn is_in_fault(&self) -> bool {
        matches!(self.status & 0x4f, 0x08 | 0x0f)
    }

    fn is_operation_enabled(&self) -> bool {
        self.status & 0x6f == 0x27
    }

    /// Lays out what it is told in this period.
    pub(crate) fn command(&mut self, setpoint: &Setpoint, out: &mut [u8]) {
        self.take(setpoint);
        let place = self.places;
        put(out, place.control, &self.control.to_le_bytes());
        put(out, place.mode, &[self.mode.cast_unsigned()]);
        match self.constants.moves {
            Moves::Joint(joint) => self.command_joint(joint, setpoint, out),
            Moves::Spindle { .. } => {
                let counts_per_s = setpoint.spindle_rad_per_s * self.constants.counts_per_unit;
                let velocity = if self.wanted {
                    (counts_per_s * self.constants.velocity_scale).round()
                } else {
                    0.0
                };
                put(out, place.target_velocity, &(velocity as i32).to_le_bytes());
            }
        }
    }

    fn command_joint(&mut self, joint: usize, setpoint: &Setpoint, out: &mut [u8]) {
        let (place, constants) = (self.places, self.constants);
        let counts = constants.counts_per_unit;
        let mut velocity = 0.0;
        let mut torque = 0.0;
        if self.follows && self.homing_is_over() {
            self.target =
                (setpoint.position[joint] * counts).round() as i64 + constants.zero_counts;
            velocity = setpoint.velocity[joint] * counts * constants.velocity_scale;
            torque = setpoint.acceleration[joint]
                * constants.torque_permille_per_acceleration
                * counts.signum();
        } else {
            self.target = self.count;
        }
        // The drive counts in 32 bits and past their end.
        put(out, place.target, &(self.target as i32).to_le_bytes());
        put(
            out,
            place.velocity_offset,
            &(velocity.round() as i32).to_le_bytes(),
        );
        put(
            out,
            place.torque_offset,
            &(torque.round() as i16).to_le_bytes(),
        );
        let limited = setpoint.limited >> joint & 1 == 1;
        let max_torque = if limited {
            constants.homing_torque
        } else {
            constants.max_torque
        };
        put(out, place.max_torque, &max_torque.to_le_bytes());
        if let Some(probe) = &mut self.probe {
            put(
                out,
                place.probe,
                &probe.function(setpoint.arm).to_le_bytes(),
            );
        }
    }

    fn homing_is_over(&self) -> bool {
        matches!(self.homing, HomingPhase::Idle | HomingPhase::Done)
    }

    /// What the setpoint asks of its state.
    fn take(&mut self, setpoint: &Setpoint) {
        let wanted = setpoint.enable != 0;
        if !wanted || setpoint.reset != 0 {
            self.quick = false;
        }
        if !wanted {
            self.was_enabled = false;
            self.mode_waits = 0;
            self.enable_waits = 0;
        }
        self.wanted = wanted;
        if setpoint.reset != 0 {
            self.code = 0;
            self.was_enabled = false;
            self.mode_waits = 0;
            self.enable_waits = 0;
            self.reset_left = (RESET_S / self.constants.period_s).ceil() as u32;
        }
        if let Moves::Joint(joint) = self.constants.moves {
            self.lead_homing(setpoint.homing >> joint & 1 == 1);
        }
        self.control = self.control_word();
    }

    fn control_word(&mut self) -> u16 {
        if self.is_in_fault() {
            self.reset_left = self.reset_left.saturating_sub(1);
            return if self.reset_left > 0 { FAULT_RESET } else { 0 };
        }
        self.reset_left = 0;
        let quick_stop_active = self.status & 0x6f == 0x07;
        if self.quick {
            return if self.is_operation_enabled() || quick_stop_active {
                QUICK_STOP
            } else {
                0
            };
        }
        if !self.wanted || self.code != 0 {
            return match self.status & 0x6f {
                0x27 => 0x07,
                0x23 => 0x06,
                _ => 0,
            };
        }
        match (self.status & 0x4f, self.status & 0x6f) {
            (0x40, _) => 0x06,
            (_, 0x21) => 0x07,
            (_, 0x23) => 0x0f,
            (_, 0x27) => {
                0x0f | if matches!(self.homing, HomingPhase::Moving(_)) {
                    START_HOMING
                } else {
                    0
                }
            }
            _ => 0,
        }
    }

    /// Leads a homing from one exchange to the next.
    fn lead_homing(&mut self, asked: bool) {
        self.homing = match self.homing {
            HomingPhase::Idle if asked && self.follows => HomingPhase::Mode,
            HomingPhase::Mode | HomingPhase::Moving(_)
                if !asked || !self.is_operation_enabled() =>
            {
                HomingPhase::Back
            }
            HomingPhase::Mode if self.mode_shown == HOMING => HomingPhase::Moving(0),
            HomingPhase::Moving(exchanges) if exchanges >= STALE_EXCHANGES => match self.status {
                status if status & HOMING_ERROR != 0 => {
                    self.code = own::HOMING;
                    HomingPhase::Back
                }
                status if status & (REACHED | ATTAINED) == REACHED | ATTAINED => HomingPhase::Back,
                _ => HomingPhase::Moving(exchanges),
            },
            HomingPhase::Moving(exchanges) => HomingPhase::Moving(exchanges + 1),
            HomingPhase::Back if self.mode_shown != HOMING => {
                // It calls the same place otherwise now.
                self.count = i64::from(self.raw);
                self.count_before = self.count;
                if asked && self.code == 0 {
                    HomingPhase::Done
                } else {
                    HomingPhase::Idle
                }
            }
            HomingPhase::Done if !asked => HomingPhase::Idle,
            phase => phase,
        };
        self.mode = if matches!(self.homing, HomingPhase::Mode | HomingPhase::Moving(_)) {
            HOMING
        } else {
            CYCLIC_POSITION
        };
    }

    /// Takes in its answer.
    pub(crate) fn answer(&mut self, inputs: &[u8]) {
        let place = self.places;
        let long = |at: Option<usize>| at.map_or(0, |at| i32_at(inputs, at));
        let word = |at: Option<usize>| at.map_or(0, |at| u16_at(inputs, at));
        self.status = word(place.status);
        self.error = word(place.error);
        self.mode_shown = match place.mode_shown.and_then(|at| inputs.get(at)) {
            Some(mode) => mode.cast_signed(),
            None => self.mode,
        };
        let raw = long(place.position);
        self.count_before = self.count;
        self.count += i64::from(raw.wrapping_sub(self.raw));
        self.raw = raw;
        self.velocity = f64::from(long(place.velocity)) / self.constants.velocity_scale;
        self.torque = f64::from(word(place.torque).cast_signed());
        self.digital = long(place.inputs).cast_unsigned();
        self.latch = None;
        if let (Some(probe), Moves::Joint(joint)) = (&mut self.probe, self.constants.moves) {
            let edges = [long(place.rising), long(place.falling)];
            if let Some((input, edge, at)) = probe.answer(word(place.probe_status), edges) {
                let behind = f64::from(raw.wrapping_sub(at));
                self.latch = Some(self.latch_of(joint, input, edge, behind));
            }
        }
        self.watch();
    }

    /// The latch of a position so many counts behind the one that was just read.
    fn latch_of(&self, joint: usize, input: u32, edge: u32, behind: f64) -> Latch {
        let moved = (self.count - self.count_before) as f64;
        let periods = if moved == 0.0 {
            0.0
        } else {
            (behind / moved).clamp(0.0, 3.0)
        };
        let mut latch = Latch {
            input,
            edge,
            joints: 1 << joint,
            before_s: periods * self.constants.period_s,
            ..Latch::default()
        };
        latch.position[joint] = self.position() - behind / self.constants.counts_per_unit;
        latch
    }

    /// What it does unasked is a fault of its own.
    fn watch(&mut self) {
        if !self.wanted || self.is_in_fault() || self.code != 0 || self.quick {
            return;
        }
        if self.is_operation_enabled() {
            self.was_enabled = true;
            let wrong = self.mode_shown != self.mode;
            self.mode_waits = if wrong { self.mode_waits + 1 } else { 0 };
            if f64::from(self.mode_waits) * self.constants.period_s > MODE_S {
                self.code = own::MODE;
            }
        } else if self.was_enabled {
            self.code = own::LET_GO;
        } else {
            self.enable_waits += 1;
            if f64::from(self.enable_waits) * self.constants.period_s > self.constants.enable_s {
                self.code = own::NEVER_ENABLED | u32::from(self.status & 0xff);
            }
        }
    }

    /// Where it stands, mm or rad.
    pub(crate) fn position(&self) -> f64 {
        (self.count - self.constants.zero_counts) as f64 / self.constants.counts_per_unit
    }

    fn speed(&self) -> f64 {
        self.velocity / self.constants.counts_per_unit
    }

    /// Its state, and the code that says why.
    pub(crate) fn state(&self) -> (JointState, u32) {
        if self.is_in_fault() {
            return (JointState::Fault, u32::from(self.error));
        }
        if self.code != 0 {
            return (JointState::Fault, self.code);
        }
        let enabled = self.is_operation_enabled();
        let state = match (self.wanted, enabled) {
            _ if self.status & 0x6f == 0x07 => JointState::QuickStop,
            (_, true) if self.quick => JointState::QuickStop,
            (false, true) => JointState::QuickStop,
            (true, true) if !self.homing_is_over() => JointState::Homing,
            (true, true) if self.mode_shown == self.mode => JointState::Enabled,
            (true, _) if !self.quick => JointState::Enabling,
            _ => JointState::Disabled,
        };
        (state, 0)
    }

    /// Writes what is known of it; `lost` is the code of a joint that is not reached any more.
    pub(crate) fn report(&mut self, lost: Option<u32>, feedback: &mut Feedback) {
        let (state, code) = lost.map_or_else(|| self.state(), |code| (JointState::Lost, code));
        self.follows = state == JointState::Enabled;
        match self.constants.moves {
            Moves::Joint(joint) => {
                feedback.state[joint] = state;
                feedback.fault_code[joint] = code;
                feedback.position[joint] = self.position();
                feedback.speed[joint] = self.speed();
                feedback.current_a[joint] = self.torque / 1000.0
                    * self.constants.rated_current_a
                    * self.constants.counts_per_unit.signum();
                let bit = u32::from(self.homing == HomingPhase::Done) << joint;
                feedback.homed = feedback.homed & !(1 << joint) | bit;
            }
            Moves::Spindle { .. } => {
                feedback.spindle_rad_per_s = self.speed();
                feedback.spindle_angle_rad = self.position();
            }
        }
    }

    /// Whether a spindle turns as fast as `wanted_rad_per_s`.
    pub(crate) fn is_at_speed(&self, wanted_rad_per_s: f64, share: f64) -> bool {
        // A turn a second is the least that counts as turning.
        let band = (wanted_rad_per_s.abs() * share).max(std::f64::consts::TAU * share);
        (self.speed() - wanted_rad_per_s).abs() <= band
    }

    /// The position that it caught in the answer that came last.
    pub(crate) fn take_latch(&mut self) -> Option<Latch> {
        self.latch.take()
    }

    /// No answer came: a latch is told once.
    pub(crate) fn miss(&mut self) {
        self.latch = None;
    }
}
