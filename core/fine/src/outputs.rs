//! What events switch: outputs, spindle, permissions. They travel to the drives with the setpoint.

use tandem_rings::{FLOOD, MIST, OperatorInputs, Switched, SwitchedBy};
use tandem_sdk::{AxisVector, Event, EventKind, MAX_AXES};

/// Which words wait for the operator.
#[derive(Clone, Copy, Debug, Default)]
pub struct Waits {
    /// M0 and M6.
    pub program: bool,
    /// M1.
    pub optional: bool,
}

/// The switched state.
#[derive(Clone, Copy, Debug)]
#[allow(clippy::struct_excessive_bools)] // independent modal states of the program, as the program has them
pub struct Outputs {
    /// Digital outputs, bit n is output n.
    pub bits: u64,
    /// Spindle speed, rad/s.
    pub spindle_rad_per_s: f64,
    /// What switched last.
    pub by: SwitchedBy,
    /// The program permits the feed override.
    pub override_permitted: bool,
    /// The program permits the adaptive feed.
    pub adaptive_permitted: bool,
    /// The program has ended.
    pub ended: bool,
    /// The program asks to wait for the operator.
    pub stop_requested: bool,
    /// Axes whose position is set anew: what is added to their coordinates, mm or rad.
    pub correction: Option<AxisVector>,
    /// Joint that is to be handed over to its drive for homing, and the time that it has for it, s.
    pub hand_over: Option<(usize, f64)>,
    /// Bit per axis that is not homed.
    pub unhomed: u32,
    /// Spindle, coolant and user outputs stay as they are.
    dry_run: bool,
}

impl Outputs {
    /// All off, all permitted; `unhomed` are the axes to home.
    pub fn new(dry_run: bool, unhomed: u32) -> Self {
        Self {
            bits: 0,
            spindle_rad_per_s: 0.0,
            by: SwitchedBy::Program,
            override_permitted: true,
            adaptive_permitted: true,
            ended: false,
            stop_requested: false,
            correction: None,
            hand_over: None,
            unhomed,
            dry_run,
        }
    }

    /// The operator's feed override, where the program permits it.
    #[inline]
    pub fn permitted_override(&self, inputs: &OperatorInputs) -> f64 {
        if self.override_permitted {
            inputs.feed_override
        } else {
            1.0
        }
    }

    /// What is on.
    pub fn switched(&self) -> Switched {
        Switched {
            outputs: self.bits,
            spindle_rad_per_s: self.spindle_rad_per_s,
            by: self.by,
        }
    }

    /// Begins with what the job before has left on.
    pub fn take_over(&mut self, left: &Switched) {
        self.bits = left.outputs;
        self.spindle_rad_per_s = left.spindle_rad_per_s;
        self.by = left.by;
    }

    /// Takes an event that the path has reached.
    pub fn apply(&mut self, event: &Event, waits: Waits) {
        let on = event.value != 0.0;
        match event.kind {
            EventKind::Spindle | EventKind::Mist | EventKind::Flood | EventKind::DigitalOutput
                if self.dry_run => {}
            EventKind::Spindle => {
                self.spindle_rad_per_s = event.value;
                self.by = SwitchedBy::Program;
            }
            EventKind::Mist => self.switch_by(event, MIST),
            EventKind::Flood => self.switch_by(event, FLOOD),
            EventKind::DigitalOutput => {
                self.switch_by(event, event.index.clamp(0, 63).unsigned_abs());
            }
            EventKind::FeedOverride => self.override_permitted = on,
            EventKind::AdaptiveFeed => self.adaptive_permitted = on,
            EventKind::ProgramStop | EventKind::ToolChange => self.stop_requested |= waits.program,
            EventKind::OptionalStop => self.stop_requested |= waits.optional,
            EventKind::ProgramEnd => self.ended = true,
            EventKind::Correct => {
                let axis = (event.index.unsigned_abs() as usize).min(MAX_AXES - 1);
                self.correction.get_or_insert(AxisVector::ZERO)[axis] += event.value;
            }
            // Where drives home axes, joints are axes.
            EventKind::HomeByDrive => {
                self.hand_over = Some((
                    (event.index.unsigned_abs() as usize).min(MAX_AXES - 1),
                    event.value,
                ));
            }
            EventKind::Homed => self.unhomed &= !(1 << event.index.clamp(0, 31)),
            // The first two no drive has: programs for drives that move something are refused them.
            EventKind::AnalogOutput
            | EventKind::OrientSpindle
            | EventKind::UserCommand
            | EventKind::ToolSelect
            | EventKind::SpindleOverride
            | EventKind::FeedHold => {}
        }
    }

    /// After an abort: the spindle stops, the coolant goes off, nothing waits for the operator. User outputs stay.
    pub fn abort(&mut self) {
        self.spindle_rad_per_s = 0.0;
        self.switch(MIST, false);
        self.switch(FLOOD, false);
        self.by = SwitchedBy::Abort;
        self.stop_requested = false;
        (self.correction, self.hand_over) = (None, None);
    }

    /// After an emergency stop, or at rest after a fault: everything goes off but the outputs in `kept`, a bit each.
    pub fn switch_off(&mut self, kept: u64, by: SwitchedBy) {
        self.spindle_rad_per_s = 0.0;
        self.bits &= kept & !(1 << MIST | 1 << FLOOD);
        self.by = by;
    }

    /// A door stops the spindle, or lets it turn again: where it turns, that is what switches last.
    pub fn switch_by_door(&mut self) {
        if self.spindle_rad_per_s != 0.0 {
            self.by = SwitchedBy::Door;
        }
    }

    fn switch_by(&mut self, event: &Event, output: u32) {
        self.switch(output, event.value != 0.0);
        self.by = SwitchedBy::Program;
    }

    fn switch(&mut self, output: u32, on: bool) {
        self.bits = if on {
            self.bits | 1 << output
        } else {
            self.bits & !(1 << output)
        };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_abort_leaves_user_outputs_and_nothing_else() {
        let waits = Waits {
            program: true,
            optional: true,
        };
        let mut outputs = Outputs::new(false, 0);
        for (kind, index) in [
            (EventKind::Spindle, 0),
            (EventKind::Mist, 0),
            (EventKind::Flood, 0),
        ] {
            outputs.apply(&Event::new(kind, 1, 0, index, 30.0), waits);
        }
        outputs.apply(&Event::new(EventKind::DigitalOutput, 1, 0, 7, 1.0), waits);
        outputs.apply(&Event::new(EventKind::ProgramStop, 1, 0, 0, 0.0), waits);
        outputs.abort();
        assert_eq!(
            (
                outputs.bits,
                outputs.spindle_rad_per_s,
                outputs.stop_requested
            ),
            (1 << 7, 0.0, false)
        );
    }

    #[test]
    fn homing_corrects_an_axis_and_counts_down_to_none() {
        let mut outputs = Outputs::new(true, 0b101);
        outputs.apply(
            &Event::new(EventKind::Correct, 0, 0, 2, -3.5),
            Waits::default(),
        );
        assert_eq!(
            outputs.correction.map(|by| (by[0], by[2])),
            Some((0.0, -3.5))
        );
        outputs.apply(
            &Event::new(EventKind::Homed, 0, 0, 2, 0.0),
            Waits::default(),
        );
        assert_eq!(outputs.unhomed, 0b001);
        outputs.abort();
        assert_eq!((outputs.correction, outputs.unhomed), (None, 0b001));
    }

    #[test]
    fn a_dry_run_switches_nothing() {
        let mut outputs = Outputs::new(true, 0);
        for kind in [
            EventKind::Spindle,
            EventKind::Mist,
            EventKind::Flood,
            EventKind::DigitalOutput,
        ] {
            outputs.apply(&Event::new(kind, 1, 0, 7, 30.0), Waits::default());
        }
        outputs.apply(
            &Event::new(EventKind::FeedOverride, 1, 0, 0, 0.0),
            Waits::default(),
        );
        assert_eq!(
            (
                outputs.bits,
                outputs.spindle_rad_per_s,
                outputs.override_permitted
            ),
            (0, 0.0, false)
        );
    }

    #[test]
    fn each_stop_waits_where_it_is_to() {
        for (kind, waits) in [
            (
                EventKind::ProgramStop,
                Waits {
                    program: true,
                    optional: false,
                },
            ),
            (
                EventKind::ToolChange,
                Waits {
                    program: true,
                    optional: false,
                },
            ),
            (
                EventKind::OptionalStop,
                Waits {
                    program: false,
                    optional: true,
                },
            ),
        ] {
            let stops = |waits| {
                let mut outputs = Outputs::new(false, 0);
                // Where two of them come together, they are one stop.
                for _ in 0..2 {
                    outputs.apply(&Event::new(kind, 1, 0, 0, 0.0), waits);
                }
                outputs.stop_requested
            };
            assert!(
                stops(waits)
                    && !stops(Waits {
                        program: !waits.program,
                        optional: !waits.optional
                    })
            );
        }
    }

    /// An event for an axis or a joint that no machine has is one for the last there may be.
    #[test]
    fn an_axis_beyond_the_last_is_the_last() {
        let mut outputs = Outputs::new(false, 0);
        for kind in [EventKind::Correct, EventKind::HomeByDrive] {
            for index in [i32::try_from(MAX_AXES).unwrap(), 1000] {
                outputs.apply(&Event::new(kind, 1, 0, index, 2.0), Waits::default());
            }
        }
        let last = MAX_AXES - 1;
        assert_eq!(outputs.correction.map(|by| by[last]), Some(4.0));
        assert_eq!(outputs.hand_over, Some((last, 2.0)));
    }

    /// A program may say twice that an output is on, or off: the second time changes nothing.
    #[test]
    fn an_output_that_is_switched_as_it_is_stays_as_it_is() {
        let mut outputs = Outputs::new(false, 0);
        for on in [1.0, 1.0, 0.0, 0.0, 1.0] {
            for (kind, index) in [
                (EventKind::Mist, 0),
                (EventKind::Flood, 0),
                (EventKind::DigitalOutput, 9),
            ] {
                outputs.apply(&Event::new(kind, 1, 0, index, on), Waits::default());
            }
            let switched = 1 << MIST | 1 << FLOOD | 1 << 9;
            assert_eq!(outputs.bits, if on == 1.0 { switched } else { 0 });
        }
    }

    /// Coolant goes off with the spindle, whatever is to be kept; outputs of the user that are not to be, too.
    #[test]
    fn a_fault_keeps_no_more_than_outputs_of_the_user() {
        for kept in [u64::MAX, 1 << 9, 0] {
            let mut outputs = Outputs::new(false, 0);
            outputs.bits = 1 << MIST | 1 << FLOOD | 1 << 9 | 1 << 12;
            outputs.spindle_rad_per_s = 30.0;
            outputs.switch_off(kept, SwitchedBy::Fault);
            let left = outputs.switched();
            assert_eq!(left.outputs, (1 << 9 | 1 << 12) & kept);
            assert_eq!(left.spindle_rad_per_s, 0.0);
            assert_eq!(left.by, SwitchedBy::Fault);
        }
    }

    /// Opening a door switches a spindle that turns, and nothing where none does.
    #[test]
    fn a_door_is_what_switched_last_only_where_the_spindle_turns() {
        for (speed, by) in [(30.0, SwitchedBy::Door), (0.0, SwitchedBy::Program)] {
            let mut outputs = Outputs::new(false, 0);
            let spindle = Event::new(EventKind::Spindle, 1, 0, 0, speed);
            outputs.apply(&spindle, Waits::default());
            outputs.switch_by_door();
            assert_eq!(outputs.switched().by, by, "{speed} rad/s");
        }
    }
}
