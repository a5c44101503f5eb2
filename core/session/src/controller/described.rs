//! What a client has to know of the machine before it can show it: axes with their limits, and what lasts, as tables.

use serde_json::{Map, Value, json};
use tandem_gcode::{PersistentData, WORK_SYSTEMS, system_code};
use tandem_host::JobOutcome;
use tandem_machine::Machine;

use super::states::{ControllerState, judge, requests};
use super::words::WORDS;
use crate::operator::Position;

/// What became of a job, where the machine stands, and the job as numbers: a summary without its lists, which may be long.
/// Allocates.
pub fn job_event(machine: &Machine, job: &Value, outcome: &JobOutcome) -> Value {
    let mut summary = serde_json::to_value(&outcome.summary).unwrap_or_default();
    if let Value::Object(keys) = &mut summary {
        keys.remove("stops");
        keys.remove("planning_us");
    }
    let position = Position::new(&machine.axes, &outcome.position);
    json!({ "event": "job", "job": job, "position": position, "summary": summary })
}

/// The machine as its file says, and which requests are refused in which state, with the reasons. Feeds are per minute, the
/// rest per second; what is not limited is null. Allocates.
pub fn machine(machine: &Machine) -> Value {
    let axes: Vec<Value> = (0..machine.axes.count())
        .map(|axis| {
            let limits = &machine.limits.axes()[axis];
            let is_rotary = machine.axes.is_rotary(axis);
            let (unit, scale) = if is_rotary {
                ("deg", 1_f64.to_degrees())
            } else {
                ("mm", 1.0)
            };
            let shown = |value: f64, factor: f64| {
                let shown = (value * scale * factor * 1e6).round() / 1e6;
                value.is_finite().then_some(shown)
            };
            json!({
                "axis": machine.axes.letter(axis).to_ascii_lowercase().to_string(),
                "unit": unit,
                "min": shown(limits.min_mm, 1.0),
                "max": shown(limits.max_mm, 1.0),
                "max_feed_per_min": shown(limits.feed_mm_per_s, 60.0),
                "max_rapid_per_min": shown(limits.rapid_mm_per_s, 60.0),
                "max_unhomed_feed_per_min": shown(machine.unhomed_max_feed_mm_per_s[axis], 60.0),
                "max_acceleration_per_s2": shown(limits.acceleration_mm_per_s2, 1.0),
                "max_jerk_per_s3": shown(limits.jerk_mm_per_s3, 1.0),
                "homes": machine.homing.iter().any(|homing| homing.axis == axis),
            })
        })
        .collect();
    let refused: Map<String, Value> = ControllerState::ALL
        .iter()
        .map(|state| {
            let reasons = requests().filter_map(|request| {
                let why = judge(*state, request).err()?;
                Some((request.to_string(), json!(why)))
            });
            (state.name().to_string(), Value::Object(reasons.collect()))
        })
        .collect();
    let roles: Map<String, Value> = WORDS
        .iter()
        .map(|word| (word.name.to_string(), json!(word.role.name())))
        .collect();
    let plugin = |what: &str, name: &str| json!({ "what": what, "plugin": name });
    let mut plugins = vec![
        plugin("planner", &machine.planner.plugin),
        plugin("kinematics", &machine.kinematics.plugin),
    ];
    let strategy = machine.feed_strategy.iter();
    plugins.extend(strategy.map(|of| plugin("feed strategy", &of.plugin)));
    plugins.extend(machine.drivers.iter().map(|driver| {
        let name = driver.name.as_ref();
        let what = name.map_or("driver".to_string(), |name| format!("driver {name}"));
        plugin(&what, &driver.choice.plugin)
    }));
    let script = machine.policy.iter();
    plugins.extend(script.map(|of| plugin("policy", &of.script.display().to_string())));
    let inputs: Vec<_> = machine.inputs.iter().map(|input| &input.name).collect();
    let outputs: Vec<_> = machine.outputs.iter().map(|output| &output.name).collect();
    json!({
        "machine": machine.name,
        "axes": axes,
        "plugins": plugins,
        "fine_period_s": machine.fine_period_s,
        "jog_keep_alive_s": machine.operator.jog_keep_alive_s,
        "max_feed_ratio": machine.motion.max_feed_ratio,
        "inputs": inputs,
        "outputs": outputs,
        "requests": requests().collect::<Vec<_>>(),
        "roles": roles,
        "refused": refused,
    })
}

/// Work offsets and tools, all of them. Allocates.
pub fn tables(machine: &Machine, persistent: &PersistentData) -> Value {
    let axes = &machine.axes;
    let offsets: Map<String, Value> = (0..WORK_SYSTEMS)
        .map(|system| {
            let origin = Position::new(axes, &persistent.origins[system]);
            (system_code(system), json!(origin))
        })
        .collect();
    let tools: Vec<Value> = persistent
        .tools
        .iter()
        .map(|tool| {
            json!({
                "number": tool.number,
                "pocket": tool.pocket,
                "diameter_mm": tool.diameter_mm,
                "offset": Position::new(axes, &tool.offset),
            })
        })
        .collect();
    json!({ "offsets": offsets, "tools": tools })
}
