//! What an enabled drive does with its axis, and what it tells of it.

use super::homing::{Homing, Step, Switches};
use super::objects::HOMING_SPEEDS;
use super::{Condition, Course, Drive, DriveState, FOLLOWING_ERROR, REST_COUNTS_PER_S, STEP_S};
use crate::firmware::dictionary::Dictionary;

/// Bits of the status word: voltage, led by the bus, target reached; by mode: follows or attained, error.
const VOLTAGE: u16 = 1 << 4;
const REMOTE: u16 = 1 << 9;
const REACHED: u16 = 1 << 10;
const MODE_BIT: u16 = 1 << 12;
const MODE_ERROR: u16 = 1 << 13;
/// The bit of the control word that starts a homing.
const START: u16 = 1 << 4;

impl Drive {
    /// Moves the demand by one step.
    pub(super) fn lead(&mut self, dictionary: &mut Dictionary) {
        if let Some(stop) = self.stop {
            self.axis.ramp(STEP_S, 0.0, stop.deceleration);
            self.feed_forward = self.axis.demand_velocity;
            if self.axis.demand_velocity == 0.0 && self.axis.velocity.abs() < REST_COUNTS_PER_S {
                self.stop = None;
                self.state = stop.then;
                self.course = Course::Hold;
            }
            return;
        }
        if self.state != DriveState::OperationEnabled {
            return;
        }
        self.begin_homing(dictionary);
        match &mut self.course {
            Course::Hold => {
                self.axis.demand_velocity = 0.0;
                self.feed_forward = 0.0;
            }
            Course::Cyclic { velocity, left_s } => {
                let now = STEP_S.min(*left_s);
                self.axis.demand += *velocity * now;
                self.axis.demand_velocity = *velocity;
                *left_s -= now;
            }
            Course::Velocity => self.lead_velocity(dictionary),
            Course::Homing(_) => self.lead_homing(dictionary),
        }
    }

    fn lead_velocity(&mut self, dictionary: &Dictionary) {
        let number = |slot| dictionary.signed(slot) as f64;
        let target = number(self.slots.target_velocity);
        let (target, acceleration) = if self.mode == 3 {
            let faster = target.abs() > self.axis.demand_velocity.abs();
            (
                target,
                number(if faster {
                    self.slots.acceleration
                } else {
                    self.slots.deceleration
                }),
            )
        } else {
            (target + number(self.slots.velocity_offset), f64::INFINITY)
        };
        self.axis.ramp(STEP_S, target, acceleration.max(1.0));
        self.feed_forward = self.axis.demand_velocity;
    }

    fn begin_homing(&mut self, dictionary: &Dictionary) {
        let control = dictionary.unsigned(self.slots.control) as u16;
        let starts = control & START != 0;
        if self.mode != 6 {
            return;
        }
        if !starts {
            if matches!(self.course, Course::Homing(_)) {
                self.begin_stop_of_homing();
            }
            self.homing_armed(true);
        } else if self.homing_armed(false) {
            self.homing_status = 0;
            let method = dictionary.signed(self.slots.homing_method) as i8;
            match Homing::begin(method, self.axis.place()) {
                Some(homing) => self.course = Course::Homing(homing),
                None => self.homing_status = MODE_ERROR,
            }
        }
    }

    /// A homing begins with a rising edge: answers whether there was none since, and sets whether the next may begin.
    fn homing_armed(&mut self, armed: bool) -> bool {
        std::mem::replace(&mut self.homing_ready, armed)
    }

    fn begin_stop_of_homing(&mut self) {
        self.course = Course::Hold;
        self.homing_status = 0;
    }

    fn lead_homing(&mut self, dictionary: &mut Dictionary) {
        let Course::Homing(mut homing) = self.course else {
            return;
        };
        let switches = self.switches();
        let at_rest =
            self.axis.demand_velocity == 0.0 && self.axis.velocity.abs() < REST_COUNTS_PER_S;
        let speed = |sub| dictionary.number(HOMING_SPEEDS, sub) as f64;
        let velocity = match homing.step(
            self.axis.place(),
            self.of.counts_per_turn,
            switches,
            at_rest,
        ) {
            Step::Fast(direction) => direction * speed(1),
            Step::Slow(direction) => direction * speed(2),
            Step::Found(place) => {
                let offset = dictionary.signed(self.slots.home_offset) as f64;
                self.axis.adopt(place, offset);
                self.homing_status = REACHED | MODE_BIT;
                self.course = Course::Hold;
                return;
            }
            Step::Failed => {
                self.homing_status = MODE_ERROR;
                self.course = Course::Hold;
                return;
            }
        };
        let acceleration = dictionary.unsigned(self.slots.homing_acceleration) as f64;
        self.axis.ramp(STEP_S, velocity, acceleration.max(1.0));
        self.feed_forward = self.axis.demand_velocity;
        self.course = Course::Homing(homing);
    }

    fn switches(&self) -> Switches {
        let place = self.axis.place();
        Switches {
            negative: self
                .of
                .negative_limit_counts
                .is_some_and(|edge| place < edge),
            positive: self
                .of
                .positive_limit_counts
                .is_some_and(|edge| place > edge),
            home: self.of.home_switch_counts.is_some_and(|edge| place > edge),
        }
    }

    /// Catches positions at the edges of the probes that lie within the step from `before`.
    pub(super) fn catch(&mut self, before: f64, dictionary: &Dictionary) {
        let function = dictionary.unsigned(self.slots.probe_function) as u16;
        for (number, probe) in self.probes.iter_mut().enumerate() {
            probe.arm((function >> (8 * number)) as u8);
            let Some(edge) = self.of.probes_counts[number] else {
                continue;
            };
            let edge = edge + self.axis.origin;
            let (from, to) = (before > edge, self.axis.position > edge);
            if from != to {
                self.probe_levels[number] = to;
                probe.follow(to, edge);
            }
        }
    }

    /// A position that stays too far from its demand for too long is a fault.
    pub(super) fn watch_following(&mut self, dictionary: &mut Dictionary) {
        let error = (self.axis.demand - self.axis.position).abs();
        let window = dictionary.unsigned(self.slots.window);
        let positioning = matches!(
            self.course,
            Course::Cyclic { .. } | Course::Homing(_) | Course::Hold
        );
        let judged =
            self.state == DriveState::OperationEnabled && positioning && window != 0xffff_ffff;
        if !judged || error <= window as f64 {
            self.late_s = 0.0;
            return;
        }
        self.late_s += STEP_S;
        if self.late_s * 1000.0 > dictionary.unsigned(self.slots.window_time) as f64 {
            self.fail(FOLLOWING_ERROR, dictionary);
        }
    }

    /// Puts what the master can read into the dictionary, before it is read: the drive's own loop looks at none of it.
    pub(crate) fn publish(&self, dictionary: &mut Dictionary) {
        let slots = self.slots;
        let switches = self.switches();
        let shown = |counts: f64| counts.round() as i64;
        dictionary.set(slots.status, i64::from(self.status()));
        dictionary.set(slots.mode_display, self.mode);
        dictionary.set(slots.demand, shown(self.axis.demand));
        dictionary.set(slots.position, shown(self.axis.position));
        dictionary.set(slots.velocity, shown(self.axis.velocity));
        dictionary.set(slots.torque, shown(self.axis.torque * 1000.0));
        dictionary.set(
            slots.following_error,
            shown(self.axis.demand - self.axis.position),
        );
        let levels = self.probes.map(|probe| probe.level());
        let inputs = i64::from(switches.negative)
            | i64::from(switches.positive) << 1
            | i64::from(switches.home) << 2
            | i64::from(levels[0]) << 16
            | i64::from(levels[1]) << 17;
        dictionary.set(slots.inputs, inputs);
        let caught = u16::from(self.probes[0].status()) | u16::from(self.probes[1].status()) << 8;
        dictionary.set(slots.probe_status, i64::from(caught));
        let edges = [
            (slots.probe1_rising, self.probes[0].rising),
            (slots.probe1_falling, self.probes[0].falling),
            (slots.probe2_rising, self.probes[1].rising),
            (slots.probe2_falling, self.probes[1].falling),
        ];
        for (slot, position) in edges {
            dictionary.set(slot, shown(position));
        }
    }

    fn status(&self) -> u16 {
        let mut status = self.state.bits() | REMOTE;
        if !self.trouble.has(Condition::TorqueOff) {
            status |= VOLTAGE;
        }
        let enabled = self.state == DriveState::OperationEnabled && self.stop.is_none();
        match self.mode {
            6 => status | self.homing_status,
            8 | 9 if enabled => status | MODE_BIT,
            3 if enabled && self.axis.demand_velocity == self.axis.velocity => status | REACHED,
            _ => status,
        }
    }
}
