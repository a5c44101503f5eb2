//! The machine as clients see it.

use std::sync::atomic::Ordering::Relaxed;

use serde::Serialize;
use serde_json::{Map, Value, json};
use tandem_gcode::system_code;
use tandem_recorder::rpm;
use tandem_rings::Switched;
use tandem_sdk::AxisVector;

use super::dispatcher::{Dispatcher, Inner, Mode};
use super::lines::lock;
use crate::operator::{Position, StatusLine};

/// Everything that can be seen, at one moment. It is written for each of many clients many times a second, so that it is made into
/// text without a tree of values in between.
#[derive(Serialize)]
pub struct Shown {
    /// What a run shows too; `state` and `fault` are those of the controller here.
    #[serde(flatten)]
    machine: StatusLine,
    loop_state: &'static str,
    job: Option<&'static str>,
    program: Option<String>,
    program_hash: Option<String>,
    block: Option<u64>,
    distance_to_go: Position,
    path: Value,
    bus: Option<Value>,
    inputs: Map<String, Value>,
    outputs: Map<String, Value>,
    coolant: &'static str,
    work_position: Position,
    not_homed: Vec<String>,
    modal: Vec<String>,
    system: String,
    offset: Position,
    g92: Position,
    tool: u32,
    tool_offset: Position,
    spindle_rpm: f64,
    spindle_turns_rpm: f64,
    block_delete: bool,
    alarms: Vec<Value>,
    job_number: Option<u64>,
    state_trouble: Option<String>,
}

impl Dispatcher {
    /// Everything that can be seen. Allocates.
    pub fn shown(&self) -> Shown {
        self.shown_of(&self.lock())
    }

    /// Everything that can be seen, for whoever picks of it. Allocates.
    pub fn status(&self) -> Value {
        self.status_of(&self.lock())
    }

    pub fn status_of(&self, inner: &Inner) -> Value {
        serde_json::to_value(self.shown_of(inner)).unwrap_or_default()
    }

    fn shown_of(&self, inner: &Inner) -> Shown {
        let axes = &self.machine.axes;
        let place = self.hub.position();
        let lines = lock(&self.lines);
        let standing = lines.standing();
        let in_force = standing.in_force();
        let modal = standing.modal_words();
        let work_position = standing.to_program(&place);
        drop(lines);
        let shown = |vector: &AxisVector| Position::new(axes, vector);
        let seen = *self.seen();
        let is_busy = inner.mode != Mode::Idle;
        let to_go = match seen.end {
            Some(end) if is_busy => end - place,
            _ => AxisVector::ZERO,
        };
        let letters = |mask: u32| -> Vec<String> {
            let of = (0..axes.count()).filter(|axis| mask >> axis & 1 == 1);
            of.map(|axis| axes.letter(axis).to_ascii_lowercase().to_string())
                .collect()
        };
        let mut machine = self.hub.status();
        let loop_state = std::mem::replace(&mut machine.state, self.state_of(inner).name());
        machine.fault = inner.fault.as_ref().map(|(words, _)| words.clone());
        let spindle = &self.status.spindle;
        Shown {
            machine,
            loop_state,
            job: is_busy.then(|| inner.mode.name()),
            program: inner.loaded.as_ref().map(|program| program.name.clone()),
            program_hash: inner.loaded.as_ref().map(|program| program.hash.clone()),
            block: is_busy.then_some(seen.block),
            distance_to_go: shown(&to_go),
            path: self.path().brief(),
            bus: self.has_bus.then(|| self.bus()),
            inputs: self.inputs(),
            outputs: self.outputs(&seen.switched),
            coolant: seen.switched.coolant(),
            work_position: shown(&work_position),
            not_homed: letters(inner.unknown_axes),
            modal,
            system: system_code(in_force.system),
            offset: shown(&in_force.origin),
            g92: shown(&in_force.g92),
            tool: in_force.tool_in_spindle,
            tool_offset: shown(&in_force.tool_offset),
            spindle_rpm: rpm(spindle.told_rad_per_s.load()),
            spindle_turns_rpm: rpm(spindle.turns_rad_per_s.load()),
            block_delete: inner.block_delete,
            alarms: inner.history.open_alarms(),
            job_number: inner.history.open(),
            state_trouble: self.persistence.trouble(),
        }
    }

    /// How well the drives are heard.
    fn bus(&self) -> Value {
        let bus = &self.status.bus;
        let phase_us = bus.phase_ns.load(Relaxed) as f64 / 1e3;
        json!({
            "feedback_age_periods": bus.age_periods.load(Relaxed),
            "old_feedback_periods": bus.old_periods.load(Relaxed),
            "phase_us": bus.has_phase.load(Relaxed).then_some(phase_us),
        })
    }

    /// The inputs that have a name, as they were read last.
    fn inputs(&self) -> Map<String, Value> {
        let inputs = self.status.inputs.load(Relaxed);
        let named = self.machine.inputs.iter();
        named
            .map(|of| (of.name.clone(), json!(inputs >> of.input & 1 == 1)))
            .collect()
    }

    /// The outputs that have a name, as they were sent last.
    fn outputs(&self, switched: &Switched) -> Map<String, Value> {
        let named = self.machine.outputs.iter();
        named
            .map(|of| (of.name.clone(), json!(switched.is_on(of.output))))
            .collect()
    }
}
