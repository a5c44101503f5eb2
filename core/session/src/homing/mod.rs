//! Homing: each axis looks for its switch, takes the place of its edge, and goes home. A stream of blocks that goes on by
//! what the machine answers, in front of the program's.

mod axis;
#[cfg(test)]
mod tests;

use std::collections::VecDeque;

use tandem_gcode::{Input, InputMode, InputWait, Item};
use tandem_host::Lead;
use tandem_machine::{AxisHoming, Machine, SwitchHoming};
use tandem_rings::{Rest, RestCause};
use tandem_rough::Source;
use tandem_sdk::{AxisVector, Block, BlockKind, Edge, Event, EventKind, PathMode, StopOn};

use axis::{Axis, Step};

/// How long a switch may bounce behind the back-off, s.
const BOUNCE_S: f64 = 0.2;

/// Homes the axes of [`Machine::homing`], then hands out the program, if any: for [`tandem_host::Switches::home`].
pub const HOMING: Lead =
    |machine, program| Box::new(Homing::new(machine, &machine.homing, program));

/// Homes axes one after the other, then hands out another stream.
pub struct Homing {
    axes: VecDeque<Axis>,
    position: AxisVector,
    step: Step,
    /// The machine is to answer before anything follows.
    awaiting: bool,
    failure: Option<String>,
    /// The rest at which the last axis got its place: the program is told of it.
    corrected: Option<Rest>,
    /// Blocks handed out so far.
    blocks: u64,
    program: Option<Box<dyn Source + Send>>,
}

impl Homing {
    /// Homes the axes of `plan` on `machine`, then hands out `program`, if any.
    pub fn new(
        machine: &Machine,
        plan: &[AxisHoming],
        program: Option<Box<dyn Source + Send>>,
    ) -> Self {
        let axes: VecDeque<_> = plan
            .iter()
            .map(|homing| Axis::new(machine, homing))
            .collect();
        Self {
            step: axes.front().map_or(Step::Look, Axis::first),
            axes,
            position: machine.start,
            awaiting: false,
            failure: None,
            corrected: None,
            blocks: 0,
            program,
        }
    }

    /// Hands out the next step of `axis`.
    fn begin(&mut self, axis: &Axis, items: &mut Vec<Item>) {
        let plan = &axis.plan;
        let (trip, release) = if plan.inverted {
            (Edge::Falling, Edge::Rising)
        } else {
            (Edge::Rising, Edge::Falling)
        };
        let (fast, slow) = (plan.search_mm_per_s.abs(), plan.latch_mm_per_s);
        self.awaiting = true;
        match self.step {
            Step::HandOver => {
                let within_s = axis.drive.map_or(0.0, |drive| drive.within_s);
                items.push(self.event(EventKind::HomeByDrive, axis, within_s));
            }
            Step::Look => items.push(self.read(plan, InputMode::Immediate, 0.0)),
            Step::Search => self.travel(axis, axis.search_mm(), fast, trip, items),
            Step::Leave => self.travel(axis, -axis.search_mm(), fast, release, items),
            Step::BackOff => {
                self.travel(
                    axis,
                    -axis.direction() * plan.back_off_mm,
                    fast,
                    Edge::None,
                    items,
                );
                let released = if plan.inverted {
                    InputMode::High
                } else {
                    InputMode::Low
                };
                items.push(self.read(plan, released, BOUNCE_S));
            }
            Step::Latch => self.travel(axis, axis.latch_mm(), slow, trip, items),
            Step::Correct { by_mm } => items.push(self.event(EventKind::Correct, axis, by_mm)),
            Step::GoHome => {
                self.travel(
                    axis,
                    axis.home_mm - self.position[axis.index],
                    f64::INFINITY,
                    Edge::None,
                    items,
                );
                // The end is the home position itself, whatever the rounding of the way there.
                self.position[axis.index] = axis.home_mm;
                if let Some(Item::Block(block, _)) = items.last_mut() {
                    block.end[axis.index] = axis.home_mm;
                }
                items.push(self.event(EventKind::Homed, axis, 0.0));
                self.axes.pop_front();
                (self.step, self.awaiting) =
                    (self.axes.front().map_or(Step::Look, Axis::first), false);
            }
        }
    }

    fn read(&self, plan: &SwitchHoming, mode: InputMode, timeout_s: f64) -> Item {
        Item::Wait(InputWait {
            line: 0,
            before_block: self.blocks,
            input: Input::Digital(plan.input),
            mode,
            timeout_s,
        })
    }

    fn event(&self, kind: EventKind, axis: &Axis, value: f64) -> Item {
        Item::Event(Event::new(
            kind,
            0,
            self.blocks,
            (axis.index as u32).cast_signed(),
            value,
        ))
    }

    /// A straight line of one axis; at an infinite feed a rapid.
    fn travel(
        &mut self,
        axis: &Axis,
        by_mm: f64,
        feed_mm_per_s: f64,
        edge: Edge,
        items: &mut Vec<Item>,
    ) {
        if by_mm == 0.0 {
            return;
        }
        let mut block = Block::at(self.position);
        block.end[axis.index] += by_mm;
        block.kind = if feed_mm_per_s.is_finite() {
            BlockKind::Line
        } else {
            BlockKind::Rapid
        };
        block.path_mode = PathMode::ExactStop;
        (block.index, block.length_mm, block.feed_mm_per_s) =
            (self.blocks, by_mm.abs(), feed_mm_per_s);
        block.stop_on = StopOn {
            input: axis.plan.input,
            edge,
            miss_is_fault: 0,
        };
        if edge == Edge::None {
            block.stop_on = StopOn::default();
            self.position = block.end;
        }
        self.blocks += 1;
        items.push(Item::Block(block, None));
    }

    fn fail(&mut self, why: String) {
        self.failure = Some(why);
    }

    /// The program's items, numbered on.
    fn program_items(&mut self, items: &mut Vec<Item>) -> Result<bool, String> {
        let Some(program) = &mut self.program else {
            return Ok(false);
        };
        if let Some(rest) = self.corrected.take() {
            program.provide_rest(&Rest {
                position: self.position,
                ..rest
            });
        }
        let before = items.len();
        let more = program.next_items(items)?;
        for item in &mut items[before..] {
            match item {
                Item::Block(block, _) => block.index += self.blocks,
                Item::Event(event) => event.before_block += self.blocks,
                Item::Wait(wait) => wait.before_block += self.blocks,
                Item::Command(command) => command.before_block += self.blocks,
                Item::End => {}
            }
        }
        Ok(more)
    }
}

impl Source for Homing {
    fn next_items(&mut self, items: &mut Vec<Item>) -> Result<bool, String> {
        if let Some(failure) = &self.failure {
            return Err(failure.clone());
        }
        if self.awaiting {
            return Ok(true);
        }
        match self.axes.front().copied() {
            Some(axis) => self.begin(&axis, items),
            None => return self.program_items(items),
        }
        Ok(true)
    }

    fn period(&mut self) {
        self.program.iter_mut().for_each(Source::period);
    }

    fn is_waiting(&self) -> bool {
        self.program.as_ref().is_some_and(Source::is_waiting)
    }

    fn may_go_on(&mut self, driven: bool) -> bool {
        let program = self.program.as_mut().filter(|_| self.axes.is_empty());
        program.is_none_or(|program| program.may_go_on(driven))
    }

    fn provide_input(&mut self, value: f64) {
        let Some(axis) = self.axes.front() else {
            return self
                .program
                .iter_mut()
                .for_each(|program| program.provide_input(value));
        };
        self.awaiting = false;
        match axis.after_input(self.step, value) {
            Ok(step) => self.step = step,
            Err(why) => self.fail(why),
        }
    }

    fn provide_rest(&mut self, rest: &Rest) -> bool {
        let Some(axis) = self.axes.front() else {
            return self
                .program
                .as_mut()
                .is_none_or(|program| program.provide_rest(rest));
        };
        self.position = rest.position;
        self.awaiting = false;
        if rest.cause == RestCause::Attached {
            return true;
        }
        if rest.cause == RestCause::Corrected {
            self.corrected = Some(*rest);
        }
        match axis.after_rest(self.step, rest) {
            Ok(step) => self.step = step,
            Err(why) => self.fail(why),
        }
        rest.cause != RestCause::Abort
    }
}
