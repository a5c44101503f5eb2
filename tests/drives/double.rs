//! A driver for tests: ideal drives that stand where they are told to from the start, do what their plan says, and write down
//! what they were told.

use std::collections::BTreeMap;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use serde::Deserialize;
use tandem_sdk::{
    Attached, AxisVector, Driver, DriverContext, DriverDescription, Feedback, JointState, Plugin,
    PluginError, RawOptions, Setpoint, Words, local_plugin, parse_options,
};

/// What the driver called `name` was told; tests use names of their own.
#[derive(Clone, Debug, Default)]
pub struct Log {
    pub checked: u32,
    pub opened: u32,
    pub started: u32,
    pub exchanges: u64,
    pub stopped: u32,
    /// Outputs and spindle speeds that ever were on.
    pub outputs: u64,
    pub turned: bool,
    /// Largest change of an enabled setpoint between two exchanges, mm or rad.
    pub largest_step: f64,
    /// Exchanges in which the drives were told to hold.
    pub enabled: u64,
    pub joints: u32,
    pub names: Vec<String>,
    pub positions: Vec<f64>,
    /// When each of the first exchanges began and ended.
    pub calls: Vec<(Instant, Instant)>,
}

/// Calls of a driver that are written down.
const MAX_CALLS: usize = 1000;

static LOGS: Mutex<BTreeMap<String, Log>> = Mutex::new(BTreeMap::new());

fn logs() -> MutexGuard<'static, BTreeMap<String, Log>> {
    LOGS.lock().unwrap_or_else(PoisonError::into_inner)
}

/// What `name` was told so far.
pub fn log(name: &str) -> Log {
    logs().get(name).cloned().unwrap_or_default()
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
#[allow(clippy::struct_excessive_bools)] // independent switches of a double
struct Plan {
    name: String,
    #[serde(default)]
    real: bool,
    /// Tick in which it begins to fail, and how: `exchange`, `fault` or `lost`.
    #[serde(default)]
    fails_at: Option<u64>,
    #[serde(default)]
    how: String,
    /// It cannot be started.
    #[serde(default)]
    refuses_to_start: bool,
    #[serde(default)]
    refuses_to_open: bool,
    /// Where its joints stand, mm or rad; without it where the machine file has them.
    #[serde(default)]
    stands_at: Option<Vec<f64>>,
    #[serde(default)]
    never_enables: bool,
    #[serde(default)]
    phase: bool,
    /// Time that an exchange takes, ms, and the number of exchanges after which none comes back for ten seconds.
    #[serde(default)]
    slow_ms: u64,
    #[serde(default)]
    silent_after: Option<u64>,
    /// A fault stands when it starts, until it is reset.
    #[serde(default)]
    faulty: bool,
    /// One exchange in mid-program takes so long, ms: the first in which the joints `rest`, or the first in which they move.
    #[serde(default)]
    stall_ms: u64,
    #[serde(default)]
    stalls_at_rest: bool,
    /// It measures what [`measured`] says.
    #[serde(default)]
    measures: bool,
}

/// Inputs that a driver measures, and what it says of them in the fine period `tick`, in its own numbers: their levels, the age
/// of each, an analog value, and the age of its first joint.
pub const MEASURED_INPUTS: usize = 3;
pub fn measured(tick: u64) -> (u64, [u16; MEASURED_INPUTS], f64, u32) {
    (
        tick & 7,
        std::array::from_fn(|input| ((tick + input as u64) % 3) as u16),
        0.5 * tick as f64,
        (tick % 4) as u32,
    )
}

pub struct Double {
    plan: Plan,
    joints: usize,
    position: AxisVector,
    faulty: bool,
    last: Option<AxisVector>,
    has_stalled: bool,
}

/// The driver as a plugin.
pub fn plugin() -> Plugin {
    local_plugin!(driver "double" = Double::made)
}

impl Double {
    fn made(options: &RawOptions) -> Result<Self, PluginError> {
        let plan: Plan = parse_options(&options.0)?;
        let faulty = plan.faulty;
        Ok(Self {
            plan,
            joints: 0,
            position: AxisVector::ZERO,
            faulty,
            last: None,
            has_stalled: false,
        })
    }

    /// Stays away once, where it is to.
    fn stall(&mut self, setpoint: &Setpoint) {
        let rests = setpoint.velocity == AxisVector::ZERO;
        if self.plan.stall_ms > 0
            && !self.has_stalled
            && setpoint.tick > 0
            && rests == self.plan.stalls_at_rest
        {
            self.has_stalled = true;
            thread::sleep(Duration::from_millis(self.plan.stall_ms));
        }
    }

    fn note(&self, what: impl FnOnce(&mut Log)) {
        let mut logs = logs();
        if !logs.contains_key(&self.plan.name) {
            // It never grows, so that who counts allocations sees none of this double.
            let log = Log {
                calls: Vec::with_capacity(MAX_CALLS),
                ..Log::default()
            };
            logs.insert(self.plan.name.clone(), log);
        }
        if let Some(log) = logs.get_mut(&self.plan.name) {
            what(log);
        }
    }
}

impl Driver for Double {
    fn describe(&self) -> DriverDescription {
        let description = if self.plan.real {
            DriverDescription::real()
        } else {
            DriverDescription::simulated()
        };
        let gives_phase = u32::from(self.plan.phase);
        let slow = u32::from(self.plan.slow_ms > 0);
        DriverDescription {
            slow,
            watches_following: 1,
            hexadecimal_codes: 1,
            enable_s: 0.1,
            gives_phase,
            ..description
        }
    }

    fn check(&self, _context: &DriverContext) -> Result<(), PluginError> {
        self.note(|log| log.checked += 1);
        Ok(())
    }

    fn open(&mut self, context: &DriverContext) -> Result<(), PluginError> {
        let joints = context.joint_count as usize;
        let names = context.joints[..joints]
            .iter()
            .map(|joint| joint.name.as_str().to_string())
            .collect();
        self.note(|log| {
            (log.opened, log.joints, log.names) = (log.opened + 1, context.joint_count, names);
        });
        if self.plan.refuses_to_open {
            return Err(PluginError::of_option("name", "it is not there"));
        }
        (self.joints, self.position) = (joints, context.start_position);
        if let Some(stands_at) = &self.plan.stands_at {
            self.position = AxisVector::from_slice(stands_at);
        }
        Ok(())
    }

    fn start(&mut self) -> Result<Attached, PluginError> {
        self.note(|log| log.started += 1);
        if self.plan.refuses_to_start {
            return Err(PluginError::fixed("the bus is down"));
        }
        let mut attached = Attached::at(self.position);
        if self.faulty {
            (attached.state[0], attached.fault_code[0]) = (JointState::Fault, 0x7210);
        }
        Ok(attached)
    }

    fn exchange(
        &mut self,
        setpoint: &Setpoint,
        feedback: &mut Feedback,
    ) -> Result<(), PluginError> {
        let began = Instant::now();
        let silent = self
            .plan
            .silent_after
            .is_some_and(|count| log(&self.plan.name).exchanges >= count);
        let takes_ms = if silent { 10_000 } else { self.plan.slow_ms };
        if takes_ms > 0 {
            thread::sleep(Duration::from_millis(takes_ms));
        }
        self.stall(setpoint);
        self.faulty &= setpoint.reset == 0;
        if setpoint.enable != 0 && !self.plan.never_enables {
            self.position = setpoint.position;
        }
        let step = (0..self.joints)
            .map(|i| (setpoint.position[i] - self.last.unwrap_or(self.position)[i]).abs());
        let step = step.fold(0.0, f64::max);
        self.last = Some(setpoint.position);
        let position = setpoint.position;
        let joints = self.joints;
        self.note(|log| {
            log.exchanges += 1;
            if log.calls.len() < MAX_CALLS {
                log.calls.push((began, Instant::now()));
            }
            log.enabled += u64::from(setpoint.enable);
            log.outputs |= setpoint.outputs;
            log.turned |= setpoint.spindle_rad_per_s != 0.0;
            log.largest_step = log
                .largest_step
                .max(if setpoint.enable == 0 { 0.0 } else { step });
            log.positions.clear();
            log.positions.extend_from_slice(&position.0[..joints]);
        });
        feedback.follow(setpoint, self.joints);
        feedback.position = self.position;
        (feedback.has_phase, feedback.phase_ns) = (u32::from(self.plan.phase), 0);
        if self.plan.measures {
            let (inputs, ages, analog, age) = measured(setpoint.tick);
            (feedback.inputs, feedback.analog[0], feedback.age_periods[0]) = (inputs, analog, age);
            feedback.input_age_periods[..MEASURED_INPUTS].copy_from_slice(&ages);
        }
        if self.plan.never_enables {
            feedback.state[..self.joints].fill(JointState::Enabling);
        }
        if self.faulty {
            (feedback.state[0], feedback.fault_code[0]) = (JointState::Fault, 0x7210);
        }
        let fails = self
            .plan
            .fails_at
            .is_some_and(|tick| setpoint.tick >= tick && setpoint.enable != 0);
        match self.plan.how.as_str() {
            _ if !fails => Ok(()),
            "exchange" => Err(PluginError::fixed("the line is cut")),
            "fault" => {
                (feedback.state[0], feedback.fault_code[0]) = (JointState::Fault, 0x7210);
                Ok(())
            }
            _ => {
                feedback.state[0] = JointState::Lost;
                Ok(())
            }
        }
    }

    fn quick_stop(&mut self) {}

    fn stop(&mut self) -> Result<(), PluginError> {
        self.note(|log| log.stopped += 1);
        Ok(())
    }

    fn explain(&self, joint: u32, code: u32) -> Words {
        let name = &self.plan.name;
        if code == 0x7210 {
            Words::new(format!("following error of amplifier {joint} of {name}"))
        } else {
            Words::default()
        }
    }
}
