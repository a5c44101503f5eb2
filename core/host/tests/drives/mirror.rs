//! Drivers that keep what they are told and answer what a test wants, and what each of them has of a machine.

use std::collections::BTreeMap;
use std::fmt::Write;
use std::sync::{Mutex, MutexGuard, PoisonError};

use tandem_rig::Random;
use tandem_sdk::{
    Attached, AxisVector, Driver, DriverContext, DriverDescription, Feedback, JointState, Latch,
    Plugin, PluginError, RawOptions, Setpoint, Words, local_plugin,
};

pub const AXES: [&str; 4] = ["x", "y", "z", "a"];

/// A driver that keeps what it is told, and answers what it is to.
#[derive(Clone, Debug, Default)]
pub struct Mirror {
    pub context: Option<DriverContext>,
    pub sent: Option<Setpoint>,
    pub sends: u32,
    pub told: Option<Setpoint>,
    /// It has nothing to begin before its exchange.
    pub sends_nothing: bool,
    pub attached: Attached,
    pub answer: Feedback,
    pub fails: bool,
    pub quick_stops: u32,
    pub stops: u32,
    pub explained: Option<u32>,
    /// Times that it states for enabling and disabling, s; those of a real driver where none.
    pub times_s: Option<[f64; 2]>,
}

static MIRRORS: Mutex<BTreeMap<String, Mirror>> = Mutex::new(BTreeMap::new());

pub fn mirrors() -> MutexGuard<'static, BTreeMap<String, Mirror>> {
    MIRRORS.lock().unwrap_or_else(PoisonError::into_inner)
}

struct Reflecting(String);

impl Reflecting {
    fn with<T>(&self, what: impl FnOnce(&mut Mirror) -> T) -> T {
        what(mirrors().entry(self.0.clone()).or_default())
    }
}

#[allow(clippy::unnecessary_wraps)] // the form of a constructor
fn made(options: &RawOptions) -> Result<Reflecting, PluginError> {
    Ok(Reflecting(
        options.0.split('"').nth(1).unwrap_or_default().to_string(),
    ))
}

fn plugin() -> Plugin {
    local_plugin!(driver "mirror" = made)
}

impl Driver for Reflecting {
    fn describe(&self) -> DriverDescription {
        let real = DriverDescription::real();
        let times_s = self.with(|mirror| mirror.times_s);
        let [enable_s, disable_s] = times_s.unwrap_or([real.enable_s, real.disable_s]);
        DriverDescription {
            watches_following: 1,
            enable_s,
            disable_s,
            ..real
        }
    }
    fn open(&mut self, context: &DriverContext) -> Result<(), PluginError> {
        self.with(|mirror| mirror.context = Some(*context));
        Ok(())
    }
    fn start(&mut self) -> Result<Attached, PluginError> {
        Ok(self.with(|mirror| mirror.attached))
    }
    fn send(&mut self, setpoint: &Setpoint) -> bool {
        self.with(|mirror| {
            mirror.sends += 1;
            mirror.sent = Some(*setpoint);
            !mirror.sends_nothing
        })
    }
    fn exchange(
        &mut self,
        setpoint: &Setpoint,
        feedback: &mut Feedback,
    ) -> Result<(), PluginError> {
        self.with(|mirror| {
            mirror.told = Some(*setpoint);
            if mirror.fails {
                return Err(PluginError::new(format!("the line of {} is cut", self.0)));
            }
            *feedback = mirror.answer;
            Ok(())
        })
    }
    fn quick_stop(&mut self) {
        self.with(|mirror| mirror.quick_stops += 1);
    }
    fn stop(&mut self) -> Result<(), PluginError> {
        self.with(|mirror| mirror.stops += 1);
        Err(PluginError::fixed("the brake is not on"))
    }
    fn explain(&self, joint: u32, _code: u32) -> Words {
        self.with(|mirror| mirror.explained = Some(joint));
        Words::new(format!("{} of {}", joint, self.0))
    }
}

/// What a driver has of the machine, by the machine's numbers.
#[derive(Clone, Debug, Default)]
pub struct Own {
    pub name: String,
    pub joints: Vec<usize>,
    pub inputs: Vec<u32>,
    pub outputs: Vec<u32>,
    pub analog: Vec<usize>,
    pub spindle: bool,
}

/// What is told and answered in one numbering, as sets and lists that know nothing of runs and masks.
impl Own {
    pub fn bits(&self, of: impl Fn(usize) -> bool) -> u32 {
        self.joints
            .iter()
            .enumerate()
            .fold(0, |bits, (own, joint)| bits | u32::from(of(*joint)) << own)
    }
    pub fn vector(&self, of: &AxisVector) -> AxisVector {
        let own: Vec<f64> = self.joints.iter().map(|joint| of[*joint]).collect();
        AxisVector::from_slice(&own)
    }
    pub fn lines(numbers: &[u32], of: u64) -> u64 {
        numbers
            .iter()
            .enumerate()
            .fold(0, |own, (i, number)| own | (of >> number & 1) << i)
    }
}

pub fn text(all: &[Own]) -> String {
    let mut text = String::new();
    for own in all {
        let joints: Vec<_> = own.joints.iter().map(|joint| AXES[*joint]).collect();
        let _ = writeln!(
            text,
            "[drivers.{}]\nplugin = \"mirror\"\noptions = {{ name = \"{}\" }}\njoints = {joints:?}\ninputs = {:?}\n\
             outputs = {:?}\nanalog = {:?}\nspindle = {}",
            own.name, own.name, own.inputs, own.outputs, own.analog, own.spindle
        );
    }
    text
}

pub fn drawn_answer(random: &mut Random) -> Feedback {
    let mut answer = Feedback {
        homed: random.below(256) as u32,
        inputs: random.below(u64::MAX),
        ..Feedback::default()
    };
    for joint in 0..8 {
        answer.state[joint] = random.pick(&[
            JointState::Enabled,
            JointState::Homing,
            JointState::QuickStop,
        ]);
        (answer.fault_code[joint], answer.age_periods[joint]) =
            (random.below(99) as u32, random.below(9) as u32);
        answer.position[joint] = random.unit();
        (answer.speed[joint], answer.current_a[joint]) = (random.unit(), random.unit());
    }
    answer.input_age_periods = std::array::from_fn(|_| random.below(9) as u16);
    answer.analog = std::array::from_fn(|_| random.unit());
    answer.latches[0] = Latch {
        input: random.below(20) as u32,
        edge: random.below(3) as u32,
        joints: random.below(16) as u32,
        position: AxisVector::from_slice(&[1.0, 2.0, 3.0, 4.0]),
        ..Latch::default()
    };
    (
        answer.spindle_rad_per_s,
        answer.spindle_angle_rad,
        answer.spindle_at_speed,
    ) = (random.unit(), random.unit(), 1);
    answer
}

pub fn registry() -> tandem_host::Registry {
    let mut registry = tandem_host::Registry::default();
    for plugin in [tandem_look_ahead::PLUGIN, plugin()] {
        registry.register(plugin).unwrap();
    }
    registry
}
