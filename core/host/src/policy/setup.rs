//! What the machine file says of its policy script.

use tandem_machine::{Analog, Machine, Policy};
use tandem_policy::{Bounds, Budget, Facts, Values};
use toml::Value;

use crate::error::{HostError, refusal};

/// Parameters, budget, bounds and what the script is told of the machine.
#[derive(Clone, Debug, Default)]
pub struct PolicySetup {
    /// Parameters by name.
    pub values: Values,
    /// What the script may use.
    pub budget: Budget,
    /// What it may ask for.
    pub bounds: Bounds,
    /// The machine as it needs it.
    pub facts: Facts,
}

impl PolicySetup {
    /// As `machine` states it, or by default; its feed strategy has `strategy_signals`.
    ///
    /// # Errors
    /// A parameter is not a number, with its place.
    pub fn of(machine: &Machine, strategy_signals: &[&str]) -> Result<Self, HostError> {
        let facts = Facts {
            axes: machine.axes,
            time_constant_s: machine.motion.time_constant_s,
            path_tolerance_mm: machine.motion.path_tolerance_mm,
            rough_period_s: machine.rough_period_s,
            tool_diameters_mm: diameters(machine),
            signals: signals(machine, strategy_signals),
        };
        let bounds = Bounds {
            max_feed_ratio: machine.motion.max_feed_ratio,
            ..Bounds::default()
        };
        let this = Self {
            bounds,
            facts,
            ..Self::default()
        };
        let Some(policy) = &machine.policy else {
            return Ok(this);
        };
        let values = values(machine, &policy.parameters)?;
        Ok(Self {
            values,
            budget: budget(policy),
            bounds: stated(policy, bounds),
            ..this
        })
    }
}

/// The tools of the table that have a diameter.
fn diameters(machine: &Machine) -> Vec<(u32, f64)> {
    let tools = machine.tools.tools.iter();
    tools
        .filter(|tool| tool.diameter_mm > 0.0)
        .map(|tool| (tool.number, tool.diameter_mm))
        .collect()
}

/// Names of what a script can ask for, as [`super::Means`] gives it: signals of the strategy, analog and digital inputs.
pub fn signals(machine: &Machine, strategy_signals: &[&str]) -> Vec<String> {
    let own = strategy_signals.iter().map(|name| (*name).to_string());
    let analog = machine.analog.iter().map(Analog::signal);
    let inputs = machine.inputs.iter().map(|input| input.name.clone());
    own.chain(analog).chain(inputs).collect()
}

/// The parameters of the machine file as numbers; true and false are 1 and 0.
fn values(machine: &Machine, table: &toml::Table) -> Result<Values, HostError> {
    let number = |(name, value): (&String, &Value)| {
        let number = match value {
            Value::Float(number) => *number,
            Value::Integer(number) => *number as f64,
            Value::Boolean(truth) => f64::from(u8::from(*truth)),
            _ => {
                let key = format!("policy.parameters.{name}");
                return Err(refusal(
                    machine,
                    &key,
                    "a parameter is a number, or true or false",
                ));
            }
        };
        Ok((name.clone(), number))
    };
    table.iter().map(number).collect()
}

fn budget(policy: &Policy) -> Budget {
    Budget {
        fuel_per_call: u64::from(policy.fuel_per_call),
        fuel_per_block: u64::from(policy.fuel_per_block),
        memory_pages: policy.memory_pages,
    }
}

fn stated(policy: &Policy, default: Bounds) -> Bounds {
    let tolerance_mm = policy
        .path_tolerance_mm
        .map(|(smallest, largest)| (smallest, Some(largest)));
    Bounds {
        time_constant_s: policy.time_constant_s,
        path_tolerance_mm: tolerance_mm.unwrap_or(default.path_tolerance_mm),
        lowest_feed_ratio: policy.lowest_feed_ratio,
        ratio_change_per_s: policy.ratio_change_per_s,
        ..default
    }
}
