//! The drives while they are claimed: brought up, told where they stand, and let go of whatever happens.

use tandem_machine::Machine;
use tandem_sdk::{Attached, AxisVector, Driver, DriverDescription, JointState, MAX_DELAY_PERIODS};

use crate::error::HostError;
use crate::joints::JointSpace;
use crate::rules::refusal;
use crate::run::Switches;
use crate::setup;

/// A driver, and what it said when its drives were claimed. A claim that is dropped stops the driver.
pub struct Claim {
    driver: Option<Box<dyn Driver>>,
    attached: Option<Attached>,
}

impl Claim {
    /// A driver whose drives are not claimed.
    pub fn new(driver: Box<dyn Driver>) -> Self {
        Self { driver: Some(driver), attached: None }
    }

    /// What the driver says of itself.
    pub fn describe(&self) -> DriverDescription {
        self.driver.as_ref().map_or(DriverDescription::real(), |driver| driver.describe())
    }

    /// Whether the drives could be claimed, as far as that can be told without them.
    ///
    /// # Errors
    /// What the driver refuses.
    pub fn check(&self, machine: &Machine, joints: &JointSpace) -> Result<(), HostError> {
        self.driver.as_ref().map_or(Ok(()), |driver| setup::check_driver(machine, driver.as_ref(), joints))
    }

    /// Puts something around the driver, before its drives are claimed.
    ///
    /// # Errors
    /// Those of `around`.
    pub fn wrap(
        &mut self,
        around: impl FnOnce(Box<dyn Driver>) -> Result<Box<dyn Driver>, HostError>,
    ) -> Result<(), HostError> {
        if let Some(driver) = self.driver.take() {
            self.driver = Some(around(driver)?);
        }
        Ok(())
    }

    /// Claims the drives, once: brings the bus up. The answer is where the axes stand, mm or rad.
    ///
    /// # Errors
    /// The drives cannot be reached, one of them has a fault that is not to be reset, or what the driver says of them makes no
    /// sense.
    pub fn attach(
        &mut self,
        machine: &Machine,
        joints: &JointSpace,
        switches: Switches,
    ) -> Result<AxisVector, HostError> {
        let Some(driver) = &mut self.driver else { return Ok(machine.start) };
        let attached = setup::open(machine, driver.as_mut(), joints)?;
        self.attached = Some(attached);
        let look = Look { machine, joints, attached: &attached, driver: driver.as_ref() };
        look.at_numbers()?;
        look.at_states(switches.reset)?;
        look.at_known(switches)?;
        Ok(look.axes())
    }

    /// The driver, and what it said.
    pub fn into_parts(mut self) -> Option<(Box<dyn Driver>, Attached)> {
        let attached = self.attached.take()?;
        self.driver.take().map(|driver| (driver, attached))
    }
}

impl Drop for Claim {
    fn drop(&mut self) {
        if let (Some(driver), Some(_)) = (&mut self.driver, &self.attached) {
            // What refuses the run is told; that the drives could not be let go of either would hide it.
            let _ = driver.stop();
        }
    }
}

/// Looks at what a driver says of its joints.
struct Look<'a> {
    machine: &'a Machine,
    joints: &'a JointSpace,
    attached: &'a Attached,
    driver: &'a dyn Driver,
}

impl Look<'_> {
    fn refuse(&self, cause: &str) -> HostError {
        refusal(self.machine, "driver.plugin", format!("driver {}: {cause}", self.machine.driver.plugin))
    }

    /// Names of the joints that `which` says, or none.
    fn named(&self, which: impl Fn(usize) -> bool) -> Option<String> {
        let names: Vec<_> = (0..self.joints.count()).filter(|i| which(*i)).map(|i| self.joints.name(i)).collect();
        (!names.is_empty()).then(|| names.join(", "))
    }

    fn at_numbers(&self) -> Result<(), HostError> {
        let attached = self.attached;
        if let Some(names) = self.named(|i| !attached.position[i].is_finite()) {
            return Err(self.refuse(&format!("its start gives no finite number as the position of {names}")));
        }
        if let Some(names) = self.named(|i| !attached.state[i].is_known()) {
            return Err(self.refuse(&format!("its start gives a number as the state of {names} that stands for none")));
        }
        if let Some(names) = self.named(|i| attached.delay_periods[i] > MAX_DELAY_PERIODS) {
            let cause = format!("the feedback of {names} is more than {MAX_DELAY_PERIODS} fine periods behind");
            return Err(self.refuse(&cause));
        }
        Ok(())
    }

    fn at_states(&self, reset: bool) -> Result<(), HostError> {
        let is = |state: JointState| self.named(|i| self.attached.state[i] == state);
        if let Some(names) = is(JointState::Lost) {
            return Err(self.refuse(&format!("the drive of {names} cannot be reached")));
        }
        let faulty = (0..self.joints.count()).find(|i| self.attached.state[*i] == JointState::Fault);
        if let Some(joint) = faulty.filter(|_| !reset) {
            let (name, code) = (self.joints.name(joint), self.attached.fault_code[joint]);
            let code = setup::code_text(self.driver, code);
            return Err(self.refuse(&format!("the drive of {name} stands in fault {code}; --reset clears it")));
        }
        Ok(())
    }

    /// Programs and lines are refused where it is not known where a joint is.
    fn at_known(&self, switches: Switches) -> Result<(), HostError> {
        let homing = self.machine.homing.iter().filter(|_| switches.home);
        // Where axes are homed, joints are axes.
        let homed = homing.fold(0, |joints, of| joints | 1 << of.axis);
        let known = self.attached.known | self.attached.homed | homed;
        let unknown = self.named(|i| known >> i & 1 == 0);
        match unknown.filter(|_| !switches.unhomed) {
            Some(names) if switches.home => {
                let cause = format!("it is not known where {names} stands, and no [homing.<axis>] table homes it");
                Err(self.refuse(&cause))
            }
            Some(names) => {
                let cause = format!("it is not known where {names} stands: home the machine first, or run with --home");
                Err(self.refuse(&cause))
            }
            None => Ok(()),
        }
    }

    /// Where the axes stand: where the machine file has them, if the joints are there.
    fn axes(&self) -> AxisVector {
        let expected = self.joints.to_joints(&self.machine.start);
        let count = self.joints.count();
        if expected.0[..count] == self.attached.position.0[..count] {
            return self.machine.start;
        }
        self.joints.to_axes(&self.attached.position)
    }
}
