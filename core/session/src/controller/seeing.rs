//! The machine as clients see it.

use std::sync::atomic::Ordering::Relaxed;

use serde_json::{Map, Value, json};
use tandem_gcode::system_code;
use tandem_rings::Switched;
use tandem_sdk::AxisVector;

use super::desk::{Desk, Inner, Mode};
use super::lines::lock;
use crate::operator::Position;

impl Desk {
    /// Everything that can be seen. Allocates.
    pub fn status(&self) -> Value {
        self.status_of(&self.lock())
    }

    pub fn status_of(&self, inner: &Inner) -> Value {
        let mut status = serde_json::to_value(self.hub.status()).unwrap_or_default();
        let lines = lock(&self.lines);
        let standing = lines.standing();
        let lasting = standing.lasting();
        let axes = &self.machine.axes;
        let place = self.hub.position();
        let shown = |vector: &AxisVector| {
            serde_json::to_value(Position::new(axes, vector)).unwrap_or_default()
        };
        let seen = *self.seen();
        let to_go = match seen.end {
            Some(end) if inner.mode != Mode::Idle => end - place,
            _ => AxisVector::ZERO,
        };
        let letters = |mask: u32| -> Vec<String> {
            let of = (0..axes.count()).filter(|axis| mask >> axis & 1 == 1);
            of.map(|axis| axes.letter(axis).to_ascii_lowercase().to_string())
                .collect()
        };
        let more = json!({
            "state": self.state_of(inner).name(),
            "loop_state": status["state"],
            "job": (inner.mode != Mode::Idle).then(|| inner.mode.name()),
            "program": inner.loaded.as_ref().map(|program| program.name.clone()),
            "program_hash": inner.loaded.as_ref().map(|program| program.hash.clone()),
            "block": (inner.mode != Mode::Idle).then_some(seen.block),
            "distance_to_go": shown(&to_go),
            "path": self.path().brief(),
            "bus": self.has_bus.then(|| self.bus()),
            "inputs": self.inputs(),
            "outputs": self.outputs(&seen.switched),
            "coolant": seen.switched.coolant(),
            "work_position": shown(&standing.to_program(&place)),
            "not_homed": letters(inner.unknown_axes),
            "modal": standing.modal_words(),
            "system": system_code(lasting.active_system),
            "offset": shown(&lasting.origins[lasting.active_system]),
            "g92": shown(&lasting.g92),
            "tool": lasting.tool_in_spindle,
            "tool_offset": shown(&lasting.tool_offset),
            "spindle_rpm": self.status.spindle.told_rad_per_s.load() * 30.0 / std::f64::consts::PI,
            "spindle_turns_rpm": self.status.spindle.turns_rad_per_s.load() * 30.0 / std::f64::consts::PI,
            "block_delete": inner.block_delete,
            "fault": inner.fault.as_ref().map(|(words, _)| words.clone()),
            "alarms": inner.history.open_alarms(),
            "job_number": inner.history.open(),
            "state_trouble": self.keeper.trouble(),
        });
        if let (Value::Object(all), Value::Object(more)) = (&mut status, more) {
            all.extend(more);
        }
        status
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
