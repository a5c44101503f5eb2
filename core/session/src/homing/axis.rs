//! One axis on its way home: which step follows which answer.

use tandem_machine::{AxisHoming, DriveHoming, Foot, Machine, SwitchHoming};
use tandem_rings::{Rest, RestCause};

/// Part of the travel that a search may go beyond it.
const MARGIN: f64 = 0.1;

/// What an axis does next.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Step {
    /// Is homed by its drive.
    HandOver,
    /// Reads the switch.
    Look,
    /// Goes towards the switch until it trips.
    Search,
    /// Stands on the switch: goes away until it is released.
    Leave,
    /// Goes off the switch, and waits until it does not bounce.
    BackOff,
    /// Goes slowly onto the switch: the position counts.
    Latch,
    /// Goes on to the index pulse behind it, whose position counts instead.
    Index,
    /// Its position is set anew.
    Correct {
        /// What is added to its coordinate, mm.
        by_mm: f64,
    },
    /// Goes to its home position.
    GoHome,
}

/// An axis to home.
#[derive(Clone, Debug)]
pub struct Axis {
    /// Its index.
    pub index: usize,
    /// The switch that it looks for; nothing in it counts where its drive homes it.
    pub plan: SwitchHoming,
    /// How its drive homes it, where it does.
    pub drive: Option<DriveHoming>,
    /// Where it goes in the end, mm.
    pub home_mm: f64,
    /// The gantry of which it is a joint.
    pub foot: Option<Foot>,
    /// As its table in the machine file is called.
    name: String,
    travel_mm: f64,
    acceleration_mm_per_s2: f64,
    /// mm a unit of messages: 1, or a degree in rad.
    unit: (f64, &'static str),
}

impl Axis {
    /// The axis of `plan` on `machine`.
    pub fn new(machine: &Machine, homing: &AxisHoming) -> Self {
        let index = homing.axis;
        let limits = &machine.limits.axes()[index];
        let rotary = machine.axes.is_rotary(index);
        Self {
            index,
            plan: homing.switch().copied().unwrap_or_default(),
            drive: homing.drive().copied(),
            home_mm: machine.home[index],
            foot: homing.foot,
            name: homing.table(&machine.axes, &machine.joints),
            travel_mm: limits.max_mm - limits.min_mm,
            acceleration_mm_per_s2: limits.acceleration_mm_per_s2,
            unit: if rotary {
                (1f64.to_radians(), "deg")
            } else {
                (1.0, "mm")
            },
        }
    }

    /// What it begins with.
    pub fn first(&self) -> Step {
        if self.drive.is_some() {
            Step::HandOver
        } else {
            Step::Look
        }
    }

    /// 1 or −1.
    pub fn direction(&self) -> f64 {
        self.plan.search_mm_per_s.signum()
    }

    /// The longest search, signed, mm.
    pub fn search_mm(&self) -> f64 {
        self.direction() * (self.travel_mm * (1.0 + MARGIN) + self.plan.back_off_mm)
    }

    /// The longest way back onto the switch: what it backed off, what the search ran past the edge, and as much again.
    pub fn latch_mm(&self) -> f64 {
        let overrun_mm = self.plan.search_mm_per_s.powi(2) / (2.0 * self.acceleration_mm_per_s2);
        self.direction() * 2.0 * (self.plan.back_off_mm + overrun_mm)
    }

    /// What follows the level of the switch.
    ///
    /// # Errors
    /// The switch does not let go.
    pub fn after_input(&self, step: Step, value: f64) -> Result<Step, String> {
        match step {
            Step::Look => Ok(if (value == 1.0) == self.plan.inverted {
                Step::Search
            } else {
                Step::Leave
            }),
            Step::HandOver => Ok(step),
            _ if value < 0.0 => Err(self.sticks()),
            _ => Ok(Step::Latch),
        }
    }

    /// What follows a rest.
    ///
    /// # Errors
    /// The switch did not change where it should have.
    pub fn after_rest(&self, step: Step, rest: &Rest) -> Result<Step, String> {
        let edge_mm = rest.latch.map(|latch| latch[self.index]);
        match (step, rest.cause, edge_mm) {
            (Step::Search | Step::Leave, RestCause::Edge, _) => Ok(Step::BackOff),
            (Step::Latch, RestCause::Edge, Some(_)) if self.plan.index.is_some() => Ok(Step::Index),
            (Step::Latch, RestCause::Edge, Some(edge_mm)) => Ok(Step::Correct {
                by_mm: self.plan.switch_mm - edge_mm,
            }),
            (Step::Index, RestCause::Edge, Some(pulse_mm)) => Ok(Step::Correct {
                by_mm: self.plan.index.map_or(0.0, |index| index.at_mm) - pulse_mm,
            }),
            (Step::Index, ..) => Err(self.no_pulse()),
            (Step::Correct { .. } | Step::HandOver, RestCause::Corrected, _) => Ok(Step::GoHome),
            (Step::Leave, ..) => Err(self.stays_on()),
            (Step::Search, ..) => Err(self.never_trips()),
            _ => Err(self.is_unsteady()),
        }
    }

    /// It still stands on its switch when it has backed off.
    pub fn sticks(&self) -> String {
        let back = self.shown(self.plan.back_off_mm);
        self.failure(&format!(
            "is still on {back} behind its edge: it sticks, or back_off is too short"
        ))
    }

    /// Its switch was not released.
    pub fn stays_on(&self) -> String {
        let way = self.shown(self.search_mm());
        self.failure(&format!(
            "is on and was not released within {way}: it sticks, or invert is wrong"
        ))
    }

    /// Its switch did not trip.
    pub fn never_trips(&self) -> String {
        let way = self.shown(self.search_mm());
        self.failure(&format!(
            "did not trip within {way}: it does not work, or the search goes away from it"
        ))
    }

    /// It would have to go on alone for longer than its gantry may be askew.
    pub fn is_askew(&self, max_skew_mm: f64) -> String {
        let most = self.shown(max_skew_mm);
        self.failure(&format!(
            "did not trip within {most} of where another joint of the gantry did: it does not work, or the gantry stands more \
             askew than max_skew allows"
        ))
    }

    /// Its switch trips now and then.
    pub fn is_unsteady(&self) -> String {
        self.failure("did not trip again: it does not work")
    }

    fn no_pulse(&self) -> String {
        let index = self.plan.index;
        let within = self.shown(index.map_or(0.0, |index| index.within_mm));
        format!(
            "homing {}: no index pulse came on input {} within {within} behind the switch",
            self.name,
            index.map_or(0, |index| index.input)
        )
    }

    fn failure(&self, what: &str) -> String {
        format!(
            "homing {}: the switch on input {} {what}",
            self.name, self.plan.input
        )
    }

    fn shown(&self, mm: f64) -> String {
        format!("{:.3} {}", mm.abs() / self.unit.0, self.unit.1)
    }
}
