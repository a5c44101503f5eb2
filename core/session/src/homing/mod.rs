//! Homing: each axis looks for its switch, takes the place of its edge, and goes home; those of one number at once. A stream of blocks that goes on by
//! what the machine answers, in front of the program's.

mod axis;
#[cfg(test)]
mod tests;
mod together;

use std::collections::VecDeque;

use tandem_gcode::{Input, InputMode, InputWait, Item};
use tandem_host::Lead;
use tandem_machine::{AxisHoming, Machine, SwitchHoming};
use tandem_rings::{Rest, RestCause};
use tandem_rough::Source;
use tandem_sdk::{Axes, AxisVector, Block, BlockKind, Edge, Event, EventKind, PathMode, StopOn};

use axis::{Axis, Step};
use together::{Ask, Together};

/// How long a switch may bounce behind the back-off, s.
const BOUNCE_S: f64 = 0.2;

/// Homes the axes of [`Machine::homing`], then hands out the program, if any: for [`tandem_host::Switches::home`].
pub const HOMING: Lead =
    |machine, program| Box::new(Homing::new(machine, &machine.homing, program));

/// Axes that home at a time.
enum Work {
    /// One, and its step.
    One(Axis, Step),
    /// Several, by switches.
    Several(Together),
}

impl Work {
    /// What is handed out before anything is known.
    fn begin_anew(&mut self) {
        match self {
            Self::One(axis, step) => *step = axis.first(),
            Self::Several(together) => together.begin_anew(),
        }
    }
}

/// Homes axes, those that go together at once and the others one after the other, then hands out another stream.
pub struct Homing {
    work: VecDeque<Work>,
    /// The machine's axes, for the length of a way of several.
    machine_axes: Axes,
    position: AxisVector,
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
        let mut groups: Vec<Vec<&AxisHoming>> = vec![];
        for homing in plan {
            match groups.last_mut() {
                Some(group) if group.iter().all(|other| homing.goes_with(other)) => {
                    group.push(homing);
                }
                _ => groups.push(vec![homing]),
            }
        }
        let work = groups.into_iter().map(|group| {
            let mut axes: Vec<_> = group
                .into_iter()
                .map(|homing| Axis::new(machine, homing))
                .collect();
            match axes.pop() {
                Some(axis) if axes.is_empty() => {
                    let first = axis.first();
                    Work::One(axis, first)
                }
                last => {
                    axes.extend(last);
                    Work::Several(Together::new(axes))
                }
            }
        });
        Self {
            work: work.collect(),
            machine_axes: machine.axes,
            position: machine.start,
            awaiting: false,
            failure: None,
            corrected: None,
            blocks: 0,
            program,
        }
    }

    /// Hands out what axes that home together ask for.
    fn begin_several(&mut self, together: &mut Together, items: &mut Vec<Item>) {
        self.awaiting = true;
        for ask in together.asks(&self.position) {
            match ask {
                Ask::Read { plan, on, within_s } => {
                    let mode = match (on, on == Some(plan.inverted)) {
                        (None, _) => InputMode::Immediate,
                        (_, true) => InputMode::Low,
                        (_, false) => InputMode::High,
                    };
                    items.push(self.read(&plan, mode, within_s));
                }
                Ask::Move {
                    end,
                    seconds,
                    stop_on,
                } => self.travel_together(&end, seconds, stop_on, items),
                Ask::Tell { kind, axis, value } => {
                    items.push(self.event(kind, axis, value));
                }
                Ask::Done => self.awaiting = false,
            }
        }
    }

    /// A straight line of several axes, which takes so many seconds; a rapid where it is to take as few as it can.
    fn travel_together(
        &mut self,
        end: &AxisVector,
        seconds: Option<f64>,
        stop_on: StopOn,
        items: &mut Vec<Item>,
    ) {
        let length_mm = self.machine_axes.path_length(&(*end - self.position));
        if length_mm == 0.0 {
            return;
        }
        let mut block = Block::at(self.position);
        block.end = *end;
        (block.kind, block.feed_mm_per_s) = match seconds {
            Some(seconds) => (BlockKind::Line, length_mm / seconds),
            None => (BlockKind::Rapid, f64::INFINITY),
        };
        block.path_mode = PathMode::ExactStop;
        block.index = self.blocks;
        block.length_mm = length_mm;
        block.stop_on = stop_on;
        if stop_on.edge == Edge::None {
            self.position = block.end;
        }
        self.blocks += 1;
        items.push(Item::Block(block, None));
    }

    /// Hands out the next step of `axis`; whether it is the last one.
    fn begin(&mut self, axis: &Axis, step: Step, items: &mut Vec<Item>) -> bool {
        let plan = &axis.plan;
        let (trip, release) = if plan.inverted {
            (Edge::Falling, Edge::Rising)
        } else {
            (Edge::Rising, Edge::Falling)
        };
        let (fast, slow) = (plan.search_mm_per_s.abs(), plan.latch_mm_per_s);
        self.awaiting = true;
        match step {
            Step::HandOver => {
                let within_s = axis.drive.map_or(0.0, |drive| drive.within_s);
                items.push(self.event(EventKind::HomeByDrive, axis.index, within_s));
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
            Step::Index => {
                let Some(index) = plan.index else {
                    return false;
                };
                let way_mm = axis.direction() * index.within_mm;
                self.travel_to(axis, way_mm, slow, (index.input, Edge::Rising), items);
            }
            Step::Correct { by_mm } => {
                items.push(self.event(EventKind::Correct, axis.index, by_mm));
            }
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
                items.push(self.event(EventKind::Homed, axis.index, 0.0));
                self.awaiting = false;
                return true;
            }
        }
        false
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

    fn event(&self, kind: EventKind, axis: usize, value: f64) -> Item {
        Item::Event(Event::new(
            kind,
            0,
            self.blocks,
            (axis as u32).cast_signed(),
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
        self.travel_to(axis, by_mm, feed_mm_per_s, (axis.plan.input, edge), items);
    }

    /// The same, until this edge.
    fn travel_to(
        &mut self,
        axis: &Axis,
        by_mm: f64,
        feed_mm_per_s: f64,
        (input, edge): (u32, Edge),
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
            input,
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
                Item::Stated { .. } | Item::End => {}
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
        let Some(mut work) = self.work.pop_front() else {
            return self.program_items(items);
        };
        let over = match &mut work {
            Work::One(axis, step) => self.begin(axis, *step, items),
            Work::Several(together) => {
                self.begin_several(together, items);
                together.is_over()
            }
        };
        if !over {
            self.work.push_front(work);
        }
        Ok(true)
    }

    fn streams(&self) -> bool {
        self.work.is_empty() && self.program.as_ref().is_some_and(Source::streams)
    }

    fn period(&mut self) {
        self.program.iter_mut().for_each(Source::period);
    }

    fn is_waiting(&self) -> bool {
        self.program.as_ref().is_some_and(Source::is_waiting)
    }

    fn may_go_on(&mut self, driven: bool) -> bool {
        let program = self.program.as_mut().filter(|_| self.work.is_empty());
        program.is_none_or(|program| program.may_go_on(driven))
    }

    fn provide_input(&mut self, value: f64) {
        let Some(work) = self.work.front_mut() else {
            return self
                .program
                .iter_mut()
                .for_each(|program| program.provide_input(value));
        };
        self.awaiting = false;
        let done = match work {
            Work::One(axis, step) => axis.after_input(*step, value).map(|next| *step = next),
            Work::Several(together) => together.after_input(value),
        };
        if let Err(why) = done {
            self.fail(why);
        }
    }

    fn provide_rest(&mut self, rest: &Rest) -> bool {
        let Some(work) = self.work.front_mut() else {
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
        if rest.cause == RestCause::Abort {
            work.begin_anew();
            return false;
        }
        let done = match work {
            Work::One(axis, step) => axis.after_rest(*step, rest).map(|next| *step = next),
            Work::Several(together) => together.after_rest(rest),
        };
        if let Err(why) = done {
            self.fail(why);
        }
        true
    }
}
