//! A machine while it homes, whose gantries are apart: each joint is an axis of its own, so that a gantry can square itself.

use tandem_machine::{AxisHoming, Foot, Joint, Machine};
use tandem_rings::{Rest, Sample};
use tandem_sdk::{Axes, AxisVector, Block, BlockReport, Curve, Event, Limits, MAX_AXES};

use super::space::JointSpace;
use crate::error::{HostError, refusal};
use crate::plugins::registry::Registry;
use crate::soft::command::Timed;
use crate::soft::soft_loop::{RunObserver, StopAnswer};

/// The letters that further joints of an axis get, the likeliest to be free first: nobody is shown them.
const LETTERS: &str = "UVWABCXYZ";

/// The machine, and what its axes are on the real one.
#[derive(Clone, Debug)]
pub struct Apart {
    /// As homing sees it.
    pub machine: Machine,
    /// The axis of each joint.
    axis_of: Vec<usize>,
    axes: usize,
}

impl Apart {
    /// Takes the gantries of `machine` apart where their joints have switches of their own; none where no gantry has. Host;
    /// allocates.
    ///
    /// # Errors
    /// The joints are wrong, or more than there are letters for.
    pub fn of(machine: &Machine, registry: &Registry) -> Result<Option<Self>, HostError> {
        if !machine.squares() {
            return Ok(None);
        }
        let space = JointSpace::of(machine, registry)?;
        if !space.are_stated_by_axes() {
            let cause = "a gantry squares itself where its joints are moved by axes alone, without kinematics";
            return Err(refusal(machine, "kinematics.plugin", cause));
        }
        let axis_of: Vec<usize> = space
            .joints
            .iter()
            .map(|joint| joint.axis.unwrap_or(0))
            .collect();
        let mut free = LETTERS
            .chars()
            .filter(|letter| machine.axes.index(*letter).is_none());
        let mut letters: Vec<(char, bool)> = vec![];
        for (at, axis) in axis_of.iter().enumerate() {
            let is_first = !axis_of[..at].contains(axis);
            let own = is_first.then(|| machine.axes.letter(*axis));
            let Some(letter) = own.or_else(|| free.next()) else {
                return Err(refusal(
                    machine,
                    "joints",
                    "there are no letters for so many joints",
                ));
            };
            letters.push((letter, machine.axes.is_rotary(*axis)));
        }
        let wrong = |why: String| refusal(machine, "joints", why);
        let spread = |of: &AxisVector| {
            let mut all = AxisVector::ZERO;
            for (joint, axis) in axis_of.iter().enumerate() {
                all[joint] = of[*axis];
            }
            all
        };
        let limits: Vec<_> = axis_of
            .iter()
            .map(|axis| machine.limits.axes()[*axis])
            .collect();
        let mut following = AxisVector([f64::INFINITY; MAX_AXES]);
        for (at, joint) in space.joints.iter().enumerate() {
            following[at] = joint.max_following_error_mm;
        }
        let joint = |(at, joint): (usize, &super::joint::Joint)| Joint {
            name: joint.name.clone(),
            axis: Some(at),
            rotary: joint.rotary,
            limits: joint.limits,
            max_following_error_mm: joint.max_following_error_mm,
            home: machine.home[axis_of[at]],
        };
        // A joint that the file states is found by its name, an axis that is its own joint by its letter.
        let place = |homing: &AxisHoming| {
            let name = homing.table(&machine.axes, &machine.joints);
            let by_name = space.joints.iter().position(|joint| joint.name == name);
            by_name.or_else(|| axis_of.iter().position(|axis| *axis == homing.axis))
        };
        let home = |homing: &AxisHoming| {
            let axis = place(homing)?;
            let foot = homing.foot.map(|foot| Foot {
                joint: axis,
                ..foot
            });
            Some(AxisHoming {
                axis,
                foot,
                ..*homing
            })
        };
        let mut apart = machine.clone();
        apart.axes = Axes::new(&letters).map_err(wrong)?;
        apart.limits = Limits::new(&limits).map_err(wrong)?;
        apart.max_following_error_mm = following;
        apart.unhomed_max_feed_mm_per_s = spread(&machine.unhomed_max_feed_mm_per_s);
        apart.max_skew_mm = spread(&machine.max_skew_mm);
        apart.start = spread(&machine.start);
        apart.home = spread(&machine.home);
        apart.joints = space.joints.iter().enumerate().map(joint).collect();
        apart.homing = machine.homing.iter().filter_map(home).collect();
        // They speak of axes as programs do.
        apart.feed_strategy = None;
        apart.policy = None;
        Ok(Some(Self {
            machine: apart,
            axis_of,
            axes: machine.axes.count(),
        }))
    }

    /// Where the axes are whose joints are at `joints`: in their middle.
    pub fn joined(&self, joints: &AxisVector) -> AxisVector {
        let mut all = AxisVector::ZERO;
        for axis in 0..self.axes {
            let of = || {
                self.axis_of
                    .iter()
                    .enumerate()
                    .filter(|(_, of)| **of == axis)
            };
            let sum: f64 = of().map(|(joint, _)| joints[joint]).sum();
            all[axis] = sum / of().count().max(1) as f64;
        }
        all
    }
}

/// Tells an observer of the axes what happens to the joints of a machine that is apart.
pub struct Joined<'a> {
    /// Who is told.
    pub observer: &'a mut dyn RunObserver,
    /// The machine.
    pub apart: &'a Apart,
}

impl RunObserver for Joined<'_> {
    fn note(&mut self, note: &str) {
        self.observer.note(note);
    }

    fn block(&mut self, block: &Block, curve: Option<Curve<'_>>, report: &BlockReport) {
        let mut block = *block;
        block.start = self.apart.joined(&block.start);
        block.end = self.apart.joined(&block.end);
        self.observer.block(&block, curve, report);
    }

    fn event(&mut self, event: &Event) {
        self.observer.event(event);
    }

    fn program_stop(&mut self, line: u32) -> StopAnswer {
        self.observer.program_stop(line)
    }

    fn is_attended(&self) -> bool {
        self.observer.is_attended()
    }

    fn period(&mut self) {
        self.observer.period();
    }

    fn before_tick(&mut self, uptime_periods: u64) {
        self.observer.before_tick(uptime_periods);
    }

    fn rest(&mut self, rest: &Rest) {
        let rest = Rest {
            position: self.apart.joined(&rest.position),
            latch: rest.latch.map(|latch| self.apart.joined(&latch)),
            ..*rest
        };
        self.observer.rest(&rest);
    }

    fn command(&mut self, command: &Timed) {
        self.observer.command(command);
    }

    fn policy(&mut self, summary: &tandem_recorder::PolicySummary) {
        self.observer.policy(summary);
    }

    fn broken_record(&mut self) -> Option<String> {
        self.observer.broken_record()
    }

    fn needs_each_deviation(&self) -> bool {
        self.observer.needs_each_deviation()
    }

    fn sample(&mut self, sample: &Sample, deviation_mm: f64, signals: &[f64]) {
        let sample = Sample {
            command: self.apart.joined(&sample.command),
            feedback: self.apart.joined(&sample.feedback),
            ..*sample
        };
        self.observer.sample(&sample, deviation_mm, signals);
    }
}
