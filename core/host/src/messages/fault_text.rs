//! Faults in words.

use tandem_fine::{Breach, Fault, FaultKind};
use tandem_machine::Machine;
use tandem_sdk::{Driver, JointState, PluginError};

use crate::drives::Roster;
use crate::joints::JointSpace;
use crate::messages::drive_states::{code_text, state_text};
use crate::messages::roles;
use crate::messages::spindle;

/// Who is meant by the numbers of a fault.
struct Names<'a> {
    machine: &'a Machine,
    joints: &'a JointSpace,
    drives: &'a dyn Driver,
    roster: &'a Roster,
}

/// What others know of a fault.
#[derive(Clone, Copy)]
pub struct Known<'a> {
    /// The cause of a fault on the soft side.
    pub soft: Option<&'a str>,
    /// What the driver or the kinematics said.
    pub driver: Option<&'a PluginError>,
    /// Knows what the drives' codes mean.
    pub drives: &'a dyn Driver,
    /// Who is who among the drivers.
    pub roster: &'a Roster,
    /// What made the fine loop late.
    pub late: Option<&'a str>,
}

/// What happened, who did it, where.
pub fn describe(machine: &Machine, joints: &JointSpace, fault: &Fault, known: Known<'_>) -> String {
    let names = Names {
        machine,
        joints,
        drives: known.drives,
        roster: known.roster,
    };
    let t_s = fault.tick as f64 * machine.fine_period_s;
    format!(
        "{} (line {}, tick {}, {t_s:.3} s)",
        cause(&names, &fault.kind, known),
        fault.line,
        fault.tick
    )
}

fn cause(names: &Names<'_>, kind: &FaultKind, known: Known<'_>) -> String {
    let machine = names.machine;
    let Known {
        soft, driver, late, ..
    } = known;
    match kind {
        FaultKind::Guard {
            breach,
            axis,
            value,
            limit,
        } => names.guard(*breach, *axis, *value, *limit),
        FaultKind::Drive { joint, code } => {
            let driver = names.driver(*joint);
            let named = names.joint(*joint);
            let code = names.code(*joint, *code);
            format!("driver {driver}: the drive of {named} reports fault {code}")
        }
        FaultKind::Lost { joint, code } => {
            let driver = names.driver(*joint);
            let named = names.joint(*joint);
            let code = names.code_if_any(*joint, *code);
            format!(
                "driver {driver}: the drive of {named} is lost: the driver does not reach it{code}"
            )
        }
        FaultKind::LetGo { joint, state } => {
            let driver = names.driver(*joint);
            let named = names.joint(*joint);
            let state = state_text(*state);
            format!("driver {driver}: the drive of {named} has let go: it is {state}")
        }
        FaultKind::NotEnabled { joint, state, code } => {
            let driver = names.driver(*joint);
            let named = names.joint(*joint);
            let code = names.code_if_any(*joint, *code);
            let within_s = names.drives.describe().enable_s;
            let state = state_text(*state);
            format!(
                "driver {driver}: {named} was not enabled within {within_s} s: its drive is {state}{code}"
            )
        }
        FaultKind::NotHomed {
            joint,
            state,
            code,
            within_s,
        } => names.not_homed(*joint, *state, *code, *within_s),
        FaultKind::State { joint, number } => names.no_state(*joint, *number),
        FaultKind::Feedback { joint: Some(joint) } => {
            let (driver, named) = (names.driver(*joint), names.joint(*joint));
            format!("driver {driver}: the feedback of {named} is not a finite number")
        }
        FaultKind::Feedback { joint: None } => {
            names.spindle("the feedback of the spindle is not a finite number")
        }
        FaultKind::Following {
            joint,
            error_mm,
            limit_mm,
        } => names.following(*joint, *error_mm, *limit_mm),
        FaultKind::Kinematics { joint } => {
            let joint = names.joint(*joint);
            let plugin = &machine.kinematics.plugin;
            let words = driver.map(|words| format!(": {words}")).unwrap_or_default();
            format!("kinematics {plugin}: the position of {joint} is not a finite number{words}")
        }
        FaultKind::WayBack { axis } => {
            let axis = machine.axes.letter(*axis);
            let plugin = &machine.kinematics.plugin;
            let words = driver.map(|words| format!(": {words}")).unwrap_or_default();
            format!(
                "kinematics {plugin}: the position of axis {axis} is not a finite number{words}"
            )
        }
        FaultKind::Driver => {
            let words = driver.map(|words| format!(": {words}")).unwrap_or_default();
            format!(
                "driver {}: the exchange failed{words}",
                names.roster.failed().title
            )
        }
        FaultKind::EmergencyStop => "emergency stop".to_string(),
        FaultKind::Input { role, input, old } => roles::fault_text(machine, *role, *input, *old),
        FaultKind::SpindleSlow {
            within_s,
            told_rad_per_s,
            turns_rad_per_s,
        } => names.spindle_slow(*within_s, *told_rad_per_s, *turns_rad_per_s),
        FaultKind::Soft => soft.unwrap_or("stopped by the host").to_string(),
        FaultKind::NoProgress {
            periods,
            grown_s,
            asked,
        } => format!(
            "the machine stands still though nothing stops it: in {periods} fine periods program time passed by {grown_s:e} s, \
             at a rate of {asked:.6} asked for, on the plan of planner {}",
            machine.planner.plugin
        ),
        FaultKind::MissedPeriods {
            missed,
            most,
            of_last,
        } => {
            let late = late.unwrap_or("the computer was late");
            let (which, key) = match of_last {
                None => (
                    format!("{missed} fine periods in a row"),
                    "max_missed_periods",
                ),
                Some(of) => (
                    format!("{missed} of the last {of} fine periods"),
                    "max_missed_share",
                ),
            };
            format!(
                "{late}: {which} went by without a sample while the machine moved, loops.{key} allows {most}; \
                 `tandem latency` shows what this computer keeps"
            )
        }
    }
}

impl Names<'_> {
    /// What the driver of a joint is called.
    fn driver(&self, joint: usize) -> &str {
        &self.roster.of_joint(joint).title
    }

    /// A code of a joint's drive, with the words for it.
    fn code(&self, joint: usize, code: u32) -> String {
        let hexadecimal = self.roster.of_joint(joint).description.hexadecimal_codes != 0;
        code_text(hexadecimal, code, &self.drives.explain(joint as u32, code))
    }

    /// The code of a drive behind other words; nothing where it has none.
    fn code_if_any(&self, joint: usize, code: u32) -> String {
        if code == 0 {
            String::new()
        } else {
            format!(", fault {}", self.code(joint, code))
        }
    }

    /// A joint as the machine file has it: the axis that it is, or its number with its name.
    fn joint(&self, joint: usize) -> String {
        match self
            .joints
            .joints
            .get(joint)
            .filter(|_| !self.machine.joints.is_empty())
        {
            Some(named) => format!("joint {joint} ({})", named.name),
            None if joint < self.machine.axes.count() && self.joints.are_axes() => {
                format!("axis {}", self.machine.axes.letter(joint))
            }
            None => format!("joint {joint}"),
        }
    }

    /// What is wrong with the spindle, behind its driver's name.
    fn spindle(&self, what: &str) -> String {
        format!("driver {}: {what}", self.roster.of_spindle().title)
    }

    fn spindle_slow(&self, within_s: f64, told_rad_per_s: f64, turns_rad_per_s: f64) -> String {
        let of = spindle::speeds(turns_rad_per_s, told_rad_per_s);
        self.spindle(&format!(
            "the spindle is not at speed within {within_s} s (spindle.at_speed_within_s): {of}"
        ))
    }

    fn no_state(&self, joint: usize, number: u32) -> String {
        let (driver, joint) = (self.driver(joint), self.joint(joint));
        let known = "0 (disabled) to 6 (lost) are known";
        format!("driver {driver}: its exchange gives {number} as the state of {joint}: {known}")
    }

    fn not_homed(&self, joint: usize, state: JointState, code: u32, within_s: f64) -> String {
        let driver = self.driver(joint);
        let code = self.code_if_any(joint, code);
        let joint = self.joint(joint);
        let state = state_text(state);
        format!(
            "driver {driver}: {joint} was not homed by its drive within {within_s} s: it is {state}{code}"
        )
    }

    fn following(&self, joint: usize, error_mm: f64, limit_mm: f64) -> String {
        let turns = self
            .joints
            .joints
            .get(joint)
            .is_some_and(|joint| joint.rotary);
        let (error, limit, unit) = if turns {
            (error_mm.to_degrees(), limit_mm.to_degrees(), "deg")
        } else {
            (error_mm, limit_mm, "mm")
        };
        let (driver, joint) = (self.driver(joint), self.joint(joint));
        format!(
            "driver {driver}: {joint} is {error:.6} {unit} away from its command, limit {limit:.6} {unit}"
        )
    }

    fn guard(&self, breach: Breach, entry: usize, value: f64, limit: f64) -> String {
        let axes = &self.machine.axes;
        let (who, turns, lacks) = match self.joints.behind(entry) {
            Some((joint, lacks)) => (format!("joint {}", joint.name), joint.rotary, lacks),
            None => (
                format!("axis {}", axes.letter(entry)),
                axes.is_rotary(entry),
                0.0,
            ),
        };
        let lacks = if breach == Breach::Position {
            lacks
        } else {
            0.0
        };
        let (value, limit) = (value + lacks, limit + lacks);
        let (value, limit, unit) = if turns {
            (value.to_degrees(), limit.to_degrees(), "deg")
        } else {
            (value, limit, "mm")
        };
        let what = match breach {
            Breach::NotFinite => format!("position {value}"),
            Breach::Position => {
                format!("position {value:.6} {unit}, travel ends at {limit:.6} {unit}")
            }
            Breach::Velocity => format!("velocity {value:.6} {unit}/s, limit {limit:.6} {unit}/s"),
            Breach::Acceleration => {
                format!(
                    "acceleration {value:.3} {unit}/s² in a window already full, limit {limit:.3} {unit}/s²"
                )
            }
            Breach::Jerk => format!("jerk {value:.1} {unit}/s³, limit {limit:.1} {unit}/s³"),
        };
        let planner = &self.machine.planner.plugin;
        if self.joints.are_curved() && entry >= axes.count() {
            let kinematics = &self.machine.kinematics.plugin;
            return format!(
                "guard: kinematics {kinematics} asks for {who} {what}; the sample of planner {planner} was not sent"
            );
        }
        format!("guard: planner {planner} asks for {who} {what}; the sample was not sent")
    }
}
