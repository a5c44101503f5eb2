//! Faults in words.

use tandem_fine::{Breach, Fault, FaultKind};
use tandem_machine::Machine;
use tandem_sdk::PluginError;

/// What happened, who did it, where. `soft` is the cause of a fault on the soft side, `driver` what the driver said.
pub fn describe(machine: &Machine, fault: &Fault, soft: Option<&str>, driver: Option<&PluginError>) -> String {
    let t_s = fault.tick as f64 * machine.fine_period_s;
    format!("{} (line {}, tick {}, {t_s:.3} s)", cause(machine, &fault.kind, soft, driver), fault.line, fault.tick)
}

fn cause(machine: &Machine, kind: &FaultKind, soft: Option<&str>, driver: Option<&PluginError>) -> String {
    match kind {
        FaultKind::Guard { breach, axis, value, limit } => guard(machine, *breach, *axis, *value, *limit),
        FaultKind::Drive { joint, code } => {
            format!("driver {}: the drive of joint {joint} reports fault {code}", machine.driver.plugin)
        }
        FaultKind::Feedback { joint } => {
            let of = joint.map_or("the spindle".to_string(), |joint| format!("joint {joint}"));
            format!("driver {}: the feedback of {of} is not a finite number", machine.driver.plugin)
        }
        FaultKind::Following { joint, error_mm, limit_mm } => following(machine, *joint, *error_mm, *limit_mm),
        FaultKind::Driver => {
            let words = driver.map(|words| format!(": {words}")).unwrap_or_default();
            format!("driver {}: the exchange failed{words}", machine.driver.plugin)
        }
        FaultKind::EmergencyStop => "emergency stop".to_string(),
        FaultKind::Soft => soft.unwrap_or("stopped by the host").to_string(),
        FaultKind::MissedPeriods => {
            format!("more than {} fine periods were missed: the drives saw a step", machine.max_missed_periods)
        }
    }
}

fn following(machine: &Machine, joint: usize, error_mm: f64, limit_mm: f64) -> String {
    // A limit is stated only where joints are axes.
    let (error, limit, unit) = if machine.axes.is_rotary(joint) {
        (error_mm.to_degrees(), limit_mm.to_degrees(), "deg")
    } else {
        (error_mm, limit_mm, "mm")
    };
    format!(
        "driver {}: joint {joint} is {error:.6} {unit} away from its command, limit {limit:.6} {unit}",
        machine.driver.plugin
    )
}

fn guard(machine: &Machine, breach: Breach, axis: usize, value: f64, limit: f64) -> String {
    let letter = machine.axes.letter(axis);
    let (value, limit, unit) = if machine.axes.is_rotary(axis) {
        (value.to_degrees(), limit.to_degrees(), "deg")
    } else {
        (value, limit, "mm")
    };
    let what = match breach {
        Breach::NotFinite => format!("position {value}"),
        Breach::Position => format!("position {value:.6} {unit}, travel ends at {limit:.6} {unit}"),
        Breach::Velocity => format!("velocity {value:.6} {unit}/s, limit {limit:.6} {unit}/s"),
        Breach::Acceleration => {
            format!("acceleration {value:.3} {unit}/s² in a window already full, limit {limit:.3} {unit}/s²")
        }
        Breach::Jerk => format!("jerk {value:.1} {unit}/s³, limit {limit:.1} {unit}/s³"),
    };
    format!("guard: planner {} asks for axis {letter} {what}; the sample was not sent", machine.planner.plugin)
}
