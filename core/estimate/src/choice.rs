//! Which model.

use serde::Deserialize;
use tandem_machine::Machine;
use tandem_sdk::MAX_AXES;

use crate::junction::Rule;
use crate::look_ahead::LookAhead;
use crate::model::Model;
use crate::overlap::{Constants, Overlap};
use crate::planned::Planned;
use crate::regression::{Coefficients, Regression};

/// Names of the models that need no file.
pub const NAMES: [&str; 4] = ["simulate", "look-ahead", "overlap", "regression"];

/// Planners stay this far inside the limits.
const MARGIN: f64 = 0.999;

/// A model with its constants.
#[derive(Clone, Debug, PartialEq)]
pub enum Choice {
    /// The machine's own planner on the virtual clock.
    Simulate,
    /// Junction feeds; with the acceleration of rapids, mm/s², where it is not the machine's.
    LookAhead(Rule, Option<f64>),
    /// Blocks of at least a constant time.
    Overlap(Constants),
    /// The published regression.
    Regression(Coefficients),
    /// Another control as one of the planners here, on the virtual clock.
    Planned(Planned),
}

/// The one option of the look-ahead planner that the form depends on.
#[derive(Default, Deserialize)]
#[serde(default)]
struct PlannerOptions {
    junction: Option<String>,
}

impl Choice {
    /// The model called `name`, with the constants of `machine`; the regression has those of the paper.
    ///
    /// # Errors
    /// No model is called so.
    pub fn named(name: &str, machine: &Machine) -> Result<Self, String> {
        match name {
            "simulate" => Ok(Self::Simulate),
            "look-ahead" => Ok(Self::LookAhead(rule_of(machine), None)),
            "overlap" => Ok(Self::Overlap(Constants {
                time_constant_s: machine.motion.time_constant_s,
                obeys_program: true,
                tick_s: Some(machine.fine_period_s),
                rapid_acceleration_mm_per_s2: None,
            })),
            "regression" => Ok(Self::Regression(Coefficients::default())),
            _ => Err(format!(
                "no model is called {name}: there are {}; a file ends in .toml",
                NAMES.join(", ")
            )),
        }
    }

    /// Its name.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Simulate => "simulate",
            Self::LookAhead(..) => "look-ahead",
            Self::Overlap(_) => "overlap",
            Self::Regression(_) => "regression",
            Self::Planned(planned) => planned.kind.name(),
        }
    }

    /// The model at rest; none for what is simulated, which needs the whole machine.
    pub fn model(&self) -> Option<Box<dyn Model>> {
        match self {
            Self::Simulate | Self::Planned(_) => None,
            Self::LookAhead(rule, rapid) => Some(Box::new(LookAhead::new(rule.clone(), *rapid))),
            Self::Overlap(constants) => Some(Box::new(Overlap::new(*constants))),
            Self::Regression(coefficients) => Some(Box::new(Regression::new(coefficients.clone()))),
        }
    }
}

/// The junction rule of a machine: the published one where its planner's options ask for it, else the rule by axes.
fn rule_of(machine: &Machine) -> Rule {
    let options: PlannerOptions = toml::from_str(&machine.planner.options).unwrap_or_default();
    let axes = &machine.limits.axes;
    if options.junction.as_deref() == Some("tangent") {
        let steps = machine
            .limits
            .axes()
            .iter()
            .map(|axis| axis.speed_difference_mm_per_s);
        let speed_difference_mm_per_s = steps.fold(f64::INFINITY, f64::min);
        return Rule::Tangent {
            acceleration_mm_per_s2: None,
            period_s: machine.fine_period_s,
            speed_difference_mm_per_s,
        };
    }
    Rule::Axis {
        acceleration_mm_per_s2: std::array::from_fn::<_, MAX_AXES, _>(|i| {
            MARGIN * axes[i].acceleration_mm_per_s2
        }),
        speed_difference_mm_per_s: std::array::from_fn(|i| {
            MARGIN * axes[i].speed_difference_mm_per_s
        }),
    }
}
