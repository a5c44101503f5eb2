//! What a machine waits for that does not move yet, said once where somebody may wonder.

use std::sync::atomic::Ordering::Relaxed;

use tandem_machine::Machine;
use tandem_rings::HostEnd;

use crate::messages::drive_states;
use crate::messages::roles;
use crate::messages::spindle;

/// Time for which nobody wonders why the drives do not hold yet, or a cut does not begin, s: contactors, brakes of small drives
/// and small spindles need less.
const UNNOTED_S: f64 = 0.5;

/// What was waited for when somebody last looked.
pub struct Waits {
    machine: Machine,
    /// Rough periods in which the drives were enabled.
    enabling_periods: u64,
    enabling: Option<String>,
    held_by: Option<String>,
    /// Rough periods in which a cut waited for the spindle.
    spindle_periods: u64,
}

impl Waits {
    /// Nothing yet. Host; allocates.
    pub fn new(machine: &Machine) -> Self {
        Self {
            machine: machine.clone(),
            enabling_periods: 0,
            enabling: None,
            held_by: None,
            spindle_periods: 0,
        }
    }

    /// A rough period: words, where what the machine waits for is new.
    pub fn look(&mut self, host: &HostEnd) -> Option<String> {
        let status = &host.status;
        let tripped = status.tripped.load(Relaxed);
        if tripped != 0 || self.held_by.is_some() {
            let held_by = roles::holding(&self.machine, tripped);
            let news = held_by.clone().filter(|_| held_by != self.held_by);
            self.held_by = held_by;
            if let Some(names) = news {
                return Some(format!(
                    "input {names} holds the machine: close it, then resume"
                ));
            }
        }
        let waits = status.spindle.waits.load(Relaxed);
        self.spindle_periods = if waits { self.spindle_periods + 1 } else { 0 };
        let unnoted_periods = (UNNOTED_S / self.machine.rough_period_s).ceil() as u64;
        if self.spindle_periods == unnoted_periods.max(1) {
            return spindle::awaited(status).map(|words| format!("waits for {words} …"));
        }
        if !status.enabling.load(Relaxed) {
            self.enabling_periods = 0;
            self.enabling = None;
            return None;
        }
        self.enabling_periods += 1;
        if self.enabling_periods as f64 * self.machine.rough_period_s < UNNOTED_S {
            return None;
        }
        let words = drive_states::enabling(&self.machine, status);
        let news = words.clone().filter(|_| words != self.enabling);
        self.enabling = words;
        news.map(|words| format!("{words} …"))
    }
}
