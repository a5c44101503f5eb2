//! Faults of single drives, on purpose: at a tick or an exchange, with the code and the words of the drive's manual.

use serde::{Deserialize, Serialize};
use tandem_sdk::{MAX_AXES, PluginError, Words};

use crate::WATCHDOG_FAULT;
use crate::hard_stop::TORQUE_FAULT;
use crate::options::refusal;
use crate::power::Power;

/// One fault of one drive; it happens once after each start of the driver.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DriveFault {
    /// Number of the joint, from 0.
    pub joint: usize,
    /// The first tick at which it is there. Ticks count from the first motion on: while joints are enabled all are 0.
    pub tick: Option<u64>,
    /// The exchange behind which it is there, counted from 1 from the start of the driver on; 0: the drive stands in it already
    /// when it is attached.
    pub exchange: Option<u64>,
    /// The drive's code.
    #[serde(default)]
    pub code: u32,
    /// What the drive's manual says of the code.
    #[serde(default)]
    pub text: String,
    /// Whether the drive falls out of the bus in place of reporting a fault: nothing is heard of it until it is reset.
    #[serde(default)]
    pub lost: bool,
}

impl DriveFault {
    pub(crate) fn check(&self) -> Result<(), PluginError> {
        let refuse = |words: &str| Err(refusal("faults", words));
        if self.joint >= MAX_AXES {
            return refuse(&format!(
                "joint = {}: a machine has 8 joints at most",
                self.joint
            ));
        }
        match (self.tick, self.exchange, self.lost, self.code) {
            (None, None, ..) | (Some(_), Some(_), ..) => {
                refuse("a fault comes at a tick or at an exchange")
            }
            (.., true, code) if code != 0 => {
                refuse("nothing is heard of a drive that is lost: it has no code")
            }
            (.., false, 0) => refuse("a drive in fault has a code above 0"),
            _ => Ok(()),
        }
    }

    fn is_due(&self, tick: u64, exchange: u64) -> bool {
        self.tick.is_some_and(|at| exchange > 0 && tick >= at)
            || self.exchange.is_some_and(|at| exchange >= at)
    }

    fn happen(&self, powers: &mut [Power]) {
        let Some(power) = powers.get_mut(self.joint) else {
            return;
        };
        if self.lost {
            power.lose();
        } else {
            power.fail(self.code);
        }
    }
}

/// All faults that are to come.
#[derive(Clone, Debug)]
pub(crate) struct DriveFaults {
    faults: Vec<DriveFault>,
    happened: Vec<bool>,
}

impl DriveFaults {
    pub fn new(faults: &[DriveFault]) -> Self {
        Self {
            faults: faults.to_vec(),
            happened: vec![false; faults.len()],
        }
    }

    /// The driver is started: everything is to come once more.
    pub fn start(&mut self) {
        self.happened.fill(false);
    }

    /// The exchange of this number, with the setpoint of this tick: drives may go into their faults. Fine loop.
    pub fn step(&mut self, tick: u64, exchange: u64, powers: &mut [Power]) {
        for (fault, happened) in self.faults.iter().zip(&mut self.happened) {
            if !*happened && fault.is_due(tick, exchange) {
                *happened = true;
                fault.happen(powers);
            }
        }
    }

    /// What a code means.
    pub fn explain(&self, code: u32) -> Words {
        let stated = self
            .faults
            .iter()
            .find(|fault| fault.code == code && !fault.text.is_empty());
        match stated {
            Some(fault) => Words::new(fault.text.as_str()),
            None if code == WATCHDOG_FAULT => Words::fixed("the host was silent too long"),
            None if code == TORQUE_FAULT => {
                Words::fixed("more torque than it may have: something is in its way")
            }
            None => Words::default(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tandem_sdk::JointState;

    fn fault(joint: usize, tick: Option<u64>, exchange: Option<u64>, code: u32) -> DriveFault {
        DriveFault {
            joint,
            tick,
            exchange,
            code,
            text: format!("text {code}"),
            lost: code == 0,
        }
    }

    #[test]
    fn each_comes_once_at_its_time() {
        let list = [
            fault(0, Some(5), None, 9),
            fault(1, None, Some(3), 0),
            fault(2, None, Some(0), 7),
        ];
        let mut faults = DriveFaults::new(&list);
        let mut powers = [Power::new(0, 0); 3];
        let mut at = |tick, exchange, powers: &mut [Power; 3]| {
            faults.step(tick, exchange, powers);
            powers.map(|power| power.state())
        };
        let (off, fault, lost) = (JointState::Disabled, JointState::Fault, JointState::Lost);
        assert_eq!(at(0, 0, &mut powers), [off, off, fault]);
        assert_eq!(at(0, 3, &mut powers), [off, lost, fault]);
        powers.iter_mut().for_each(Power::reset);
        assert_eq!(
            at(6, 4, &mut powers),
            [fault, off, off],
            "a tick that never came is made up for"
        );
        powers.iter_mut().for_each(Power::reset);
        assert_eq!(at(7, 5, &mut powers), [off; 3]);
    }

    #[test]
    fn codes_have_the_words_that_were_stated() {
        let faults = DriveFaults::new(&[fault(0, Some(5), None, 9)]);
        assert_eq!(faults.explain(9).as_str(), "text 9");
        assert_eq!(faults.explain(10).as_str(), "");
        assert!(faults.explain(WATCHDOG_FAULT).as_str().contains("silent"));
    }
}
