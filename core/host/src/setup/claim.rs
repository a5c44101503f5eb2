//! The drives while they are claimed: brought up, told where they stand, and let go of whatever happens.

use tandem_faults::Faults;
use tandem_machine::{AxisHoming, Machine};
use tandem_sdk::{
    Attached, AxisVector, Driver, DriverDescription, JointState, MAX_DELAY_PERIODS, Words,
};

use crate::drives::{Drives, Roster};
use crate::error::{HostError, refusal};
use crate::joints::JointSpace;
use crate::messages::drive_states::code_text;
use crate::switches::{Clock, Switches};

/// The drivers of a machine, and what they said when their drives were claimed. A claim that is dropped stops them.
pub struct Claim {
    drives: Option<Drives>,
    /// Who is who, where another has the drives: nothing is claimed here.
    elsewhere: Option<Roster>,
    faults: Option<Faults>,
    attached: Option<Attached>,
}

impl Claim {
    /// Drivers whose drives are not claimed.
    pub fn new(drives: Drives) -> Self {
        Self {
            drives: Some(drives),
            elsewhere: None,
            faults: None,
            attached: None,
        }
    }

    /// Drives that another has claimed, which this job is driven on.
    pub fn elsewhere(roster: Roster) -> Self {
        Self {
            drives: None,
            elsewhere: Some(roster),
            faults: None,
            attached: None,
        }
    }

    /// Whether another has the drives: whoever claimed them has seen to it that they may move.
    pub fn is_elsewhere(&self) -> bool {
        self.elsewhere.is_some()
    }

    /// Who is who among the drivers.
    pub fn roster(&self) -> Roster {
        let elsewhere = || {
            self.elsewhere
                .clone()
                .unwrap_or_else(|| Roster::of_one(DriverDescription::real()))
        };
        let roster = self.drives.as_ref().map_or_else(elsewhere, Drives::roster);
        match &self.attached {
            Some(attached) => {
                roster.behind_by(attached.delay_periods.into_iter().max().unwrap_or(0))
            }
            None => roster,
        }
    }

    /// Fine periods by which feedback is behind the command, of the joint where they are most; 0 until the drives are claimed.
    pub fn delay_periods(&self) -> u32 {
        self.roster().delay_periods
    }

    /// What the drivers together say of themselves.
    pub fn describe(&self) -> DriverDescription {
        self.roster().describe()
    }

    /// Whether the drives could be claimed, as far as that can be told without them.
    ///
    /// # Errors
    /// What a driver refuses.
    pub fn check(&self, machine: &Machine, joints: &JointSpace) -> Result<(), HostError> {
        self.drives
            .as_ref()
            .map_or(Ok(()), |drives| drives.check(machine, joints))
    }

    /// Puts `faults` around the drivers, once their drives are claimed.
    pub fn add_faults(&mut self, faults: Faults) {
        self.faults = Some(faults);
    }

    /// Claims the drives, once: brings the buses up. The answer is where the axes stand, mm or rad.
    ///
    /// # Errors
    /// The drives cannot be reached, one of them has a fault that is not to be reset, or what a driver says of them makes no
    /// sense.
    pub fn attach(
        &mut self,
        machine: &Machine,
        joints: &JointSpace,
        switches: Switches,
    ) -> Result<AxisVector, HostError> {
        let Some(drives) = &mut self.drives else {
            return Ok(machine.start);
        };
        let is_real = drives.roster().describe().simulated == 0;
        let real_time = switches.clock.map_or(is_real, |clock| clock == Clock::Wall);
        let attached = drives.open(machine, joints, real_time)?;
        self.attached = Some(attached);
        let look = Look {
            machine,
            joints,
            attached: &attached,
            explain: &|joint, code| drives.explain(joint, code),
            roster: drives.roster(),
        };
        look.at_all(switches)
    }

    /// The driver for the fine loop, and what the drives said.
    pub fn into_parts(mut self) -> Option<(Box<dyn Driver>, Attached)> {
        let attached = self.attached.take()?;
        let driver = self.drives.take()?.into_driver();
        match self.faults.take() {
            Some(faults) => Some((tandem_faults::wrap(driver, faults), attached)),
            None => Some((driver, attached)),
        }
    }
}

impl Drop for Claim {
    fn drop(&mut self) {
        if let (Some(drives), Some(_)) = (&mut self.drives, &self.attached) {
            // What refuses the run is told; that the drives could not be let go of either would hide it.
            let _ = drives.stop();
        }
    }
}

/// Where the axes stand, mm or rad, by what a `driver` said that has brought its bus up once more. Host; allocates.
///
/// # Errors
/// What it says makes no sense, or a drive cannot be reached.
pub fn stands(
    machine: &Machine,
    joints: &JointSpace,
    roster: &Roster,
    driver: &dyn Driver,
    attached: &Attached,
    switches: Switches,
) -> Result<AxisVector, HostError> {
    let look = Look {
        machine,
        joints,
        attached,
        explain: &|joint, code| driver.explain(joint as u32, code),
        roster: roster.clone(),
    };
    look.at_all(switches)
}

/// Looks at what the drivers say of the joints.
struct Look<'a> {
    machine: &'a Machine,
    joints: &'a JointSpace,
    attached: &'a Attached,
    /// What a code of the drive of a joint means.
    explain: &'a dyn Fn(usize, u32) -> Words,
    roster: Roster,
}

impl Look<'_> {
    /// Where the axes stand, where nothing is wrong with what is said.
    fn at_all(&self, switches: Switches) -> Result<AxisVector, HostError> {
        self.at_numbers()?;
        self.at_states(switches.reset)?;
        self.at_skew()?;
        self.at_known(switches)?;
        Ok(self.axes())
    }

    /// What is wrong with the joints that `which` says: `cause` makes a sentence of their names, for the driver of the first.
    fn refuse(
        &self,
        which: impl Fn(usize) -> bool,
        cause: impl Fn(&str) -> String,
    ) -> Result<(), HostError> {
        let Some(first) = (0..self.joints.count()).find(|i| which(*i)) else {
            return Ok(());
        };
        let driver = self.roster.of_joint(first);
        let of_driver =
            |joint: &usize| which(*joint) && self.roster.of_joint(*joint).section == driver.section;
        let names: Vec<_> = (0..self.joints.count())
            .filter(of_driver)
            .map(|i| self.joints.name(i))
            .collect();
        let words = format!("driver {}: {}", driver.title, cause(&names.join(", ")));
        Err(refusal(
            self.machine,
            &format!("{}.plugin", driver.section),
            words,
        ))
    }

    fn at_numbers(&self) -> Result<(), HostError> {
        let attached = self.attached;
        self.refuse(
            |i| !attached.position[i].is_finite(),
            |names| format!("its start gives no finite number as the position of {names}"),
        )?;
        self.refuse(
            |i| !attached.state[i].is_known(),
            |names| {
                format!("its start gives a number as the state of {names} that stands for none")
            },
        )?;
        self.refuse(
            |i| attached.delay_periods[i] > MAX_DELAY_PERIODS,
            |names| {
                format!(
                    "the feedback of {names} is more than {MAX_DELAY_PERIODS} fine periods behind"
                )
            },
        )
    }

    fn at_states(&self, reset: bool) -> Result<(), HostError> {
        let is = |state: JointState| move |i: usize| self.attached.state[i] == state;
        self.refuse(is(JointState::Lost), |names| {
            format!("the drive of {names} cannot be reached")
        })?;
        let faulty = (0..self.joints.count())
            .find(|i| is(JointState::Fault)(*i))
            .filter(|_| !reset);
        self.refuse(
            |i| Some(i) == faulty,
            |name| {
                let joint = faulty.unwrap_or_default();
                let hexadecimal = self.roster.of_joint(joint).description.hexadecimal_codes != 0;
                let code = self.attached.fault_code[joint];
                let code = code_text(hexadecimal, code, &(self.explain)(joint, code));
                format!("the drive of {name} stands in fault {code}; --reset clears it")
            },
        )
    }

    /// The joints of a gantry keep their skew until they are squared, unless it is so large that moving them would bend
    /// something.
    fn at_skew(&self) -> Result<(), HostError> {
        let known = |joint: usize| self.attached.known >> joint & 1 == 1;
        for axis in 0..self.machine.axes.count() {
            let moves =
                |joint: &usize| self.joints.joints[*joint].axis == Some(axis) && known(*joint);
            let joints: Vec<usize> = (0..self.joints.count()).filter(moves).collect();
            let at = |joint: &usize| self.attached.position[*joint];
            let low = joints.iter().min_by(|a, b| at(a).total_cmp(&at(b)));
            let high = joints.iter().max_by(|a, b| at(a).total_cmp(&at(b)));
            let (Some(low), Some(high)) = (low, high) else {
                continue;
            };
            if at(high) - at(low) > self.machine.max_skew_mm[axis]
                && self.joints.are_stated_by_axes()
            {
                return Err(self.too_skew(axis, *low, *high));
            }
        }
        Ok(())
    }

    fn too_skew(&self, axis: usize, low: usize, high: usize) -> HostError {
        let rotary = self.machine.axes.is_rotary(axis);
        let (scale, unit) = if rotary {
            (1f64.to_degrees(), "deg")
        } else {
            (1.0, "mm")
        };
        let letter = self.machine.axes.letter(axis).to_ascii_lowercase();
        let at = |joint: usize| {
            format!(
                "{} stands at {:.4} {unit}",
                self.joints.name(joint),
                self.attached.position[joint] * scale
            )
        };
        let most = self.machine.max_skew_mm[axis] * scale;
        let cause = format!(
            "the gantry is skew: {}, {}; at most {most} {unit} are allowed",
            at(low),
            at(high)
        );
        refusal(
            self.machine,
            &format!("axes.{letter}.max_skew_{unit}"),
            cause,
        )
    }

    /// Programs and lines are refused where it is not known where a joint is.
    fn at_known(&self, switches: Switches) -> Result<(), HostError> {
        let homing = self
            .machine
            .homing
            .iter()
            .filter(|_| switches.home.is_some());
        let stated = &self.machine.joints;
        let is_homed = |of: &AxisHoming, joint: usize| {
            let this = &self.joints.joints[joint];
            let foot = of.foot.and_then(|foot| stated.get(foot.joint));
            foot.map_or(this.axis == Some(of.axis), |foot| foot.name == this.name)
        };
        let homed = homing.fold(0, |mask, of| {
            let joints = (0..self.joints.count()).filter(|joint| is_homed(of, *joint));
            joints.fold(mask, |mask, joint| mask | 1 << joint)
        });
        let known = self.attached.known | self.attached.homed | homed;
        self.refuse(
            |i| known >> i & 1 == 0 && !switches.unhomed,
            |names| {
                if switches.home.is_some() {
                    format!("it is not known where {names} stands, and no [homing.<axis>] table homes it")
                } else {
                    format!("it is not known where {names} stands: home the machine first, or run with --home")
                }
            },
        )
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
