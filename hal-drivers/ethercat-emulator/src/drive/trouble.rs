//! What is wrong with a drive.

/// Troubles of a drive, as faults set them.
#[derive(Clone, Debug, Default)]
pub(crate) struct Trouble {
    /// A fault that comes up now.
    pub(crate) fault: Option<u16>,
    /// It switches itself off now.
    pub(crate) disable: bool,
    /// The mode that it shows and is in, whatever is asked.
    pub(crate) mode_shown: Option<i8>,
    /// Time until the brake is open, in ms.
    pub(crate) brake_ms: Option<f64>,
    conditions: Vec<Condition>,
}

/// A trouble that is there or not.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Condition {
    /// A reset does not help.
    FaultStays,
    /// It never gets beyond *Switched on*.
    NeverEnables,
    /// Safe torque off.
    TorqueOff,
    /// The axis does not move.
    Blocked,
}

impl Trouble {
    pub(crate) fn has(&self, trouble: Condition) -> bool {
        self.conditions.contains(&trouble)
    }

    pub(crate) fn set(&mut self, trouble: Condition, on: bool) {
        self.conditions.retain(|other| *other != trouble);
        if on {
            self.conditions.push(trouble);
        }
    }
}
