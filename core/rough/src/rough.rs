//! The rough loop itself.

use tandem_gcode::{Input, InputMode, InputWait, Item};
use tandem_rings::RoughEnd;
use tandem_sdk::{Accepted, AxisLimits, Edge, Event, EventKind, MAX_AXES, NurbsData, Planner};

use crate::Observer;
use crate::depth::{QueueDepth, SERVED_FOR_PERIODS};
use crate::easing::Easing;
use crate::gather::{Gathering, Slowness};
use crate::junction_steps::{JunctionSteps, ROUNDING};
use crate::queue::Queue;
use crate::source::Source;

/// Shares of the limits of acceleration and of jerk from which on what samples show of a step counts: half of what the fine loop
/// leaves beside a governed rate, and of jerk half of what its guard forgives.
const COUNTS: [f64; 2] = [1e-3, 5e-3];

/// What the rough loop is told before it runs.
#[derive(Clone, Copy, Debug)]
pub struct RoughConfig {
    /// Rough period, s.
    pub rough_period_s: f64,
    /// Fine period, s.
    pub fine_period_s: f64,
    /// Program time that the planner is asked for at a time, s: a rough period, or more where the ring would not hold the
    /// worst stop of the machine in pieces that short.
    pub advance_s: f64,
    /// Nothing is planned before the joints are enabled, and then from where they stand ([`tandem_rings::RestCause::Attached`]).
    pub awaits_drives: bool,
    /// Share of the worst stop that the queue holds: 1, or the machine cannot use the speed that is planned. Tests show
    /// with less what the depth is for.
    pub depth_factor: f64,
    /// Axes and joints that are planned: the first ones of a segment.
    pub lanes: usize,
    /// Steps between segments up to these count as none: of velocity, mm/s, and of acceleration, mm/s².
    pub seam_rounding: [f64; 2],
    /// How slowly the linear axes change their speed: how long a sender's lines are gathered follows from it.
    pub slowness: Slowness,
    /// The jerk limits that a stop keeps.
    pub easing: Easing,
}

impl RoughConfig {
    /// The configuration of a machine with these periods, s.
    pub fn new(rough_period_s: f64, fine_period_s: f64) -> Self {
        Self {
            rough_period_s,
            fine_period_s,
            advance_s: rough_period_s,
            awaits_drives: false,
            depth_factor: 1.0,
            lanes: MAX_AXES,
            seam_rounding: ROUNDING,
            slowness: Slowness::NONE,
            easing: Easing::NONE,
        }
    }

    /// Makes the machine move only when as much has come from a sender as it needs, with a linear axis of these limits, to get up to
    /// speed and down again. Called for each of them. Host.
    pub fn gather_for(&mut self, limits: &AxisLimits) {
        self.slowness.count(limits);
    }

    /// Makes steps count of which samples of the fine period show a part of what an axis of these limits may: acceleration,
    /// mm/s², and jerk, mm/s³. Called for each axis. Host.
    pub fn count_steps_of(&mut self, acceleration_mm_per_s2: f64, jerk_mm_per_s3: f64) {
        let period_s = self.fine_period_s;
        let [acceleration, jerk] = [
            COUNTS[0] * acceleration_mm_per_s2,
            COUNTS[1] * jerk_mm_per_s3,
        ];
        let [of_velocity, of_acceleration] = &mut self.seam_rounding;
        *of_velocity = of_velocity
            .min(acceleration * period_s)
            .min(jerk * period_s * period_s);
        *of_acceleration = of_acceleration.min(jerk * period_s);
    }
}

/// How far the rough loop is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Progress {
    /// There is more to come.
    Working,
    /// Everything is queued, the end of the program included.
    Done,
}

/// What stops the rough loop.
#[derive(Debug, thiserror::Error)]
pub enum RoughError {
    /// The program cannot go on.
    #[error("{0}")]
    Program(String),
    /// The machine stands where the program cannot go on.
    #[error("line {line}: {cause}")]
    Stop {
        /// Program line of the block.
        line: u32,
        /// Why.
        cause: String,
    },
    /// The planner failed or refused what it had checked.
    #[error("planner: {}{cause}", at_line(*line))]
    Planner {
        /// Program line of the block that it was offered; none where it advances, which is about blocks before the last one.
        line: Option<u32>,
        /// The planner's words.
        cause: String,
    },
}

impl RoughError {
    /// The message, with the planner by its name.
    pub fn with_planner(&self, name: &str) -> String {
        match self {
            Self::Planner { line, cause } => format!("planner {name}: {}{cause}", at_line(*line)),
            _ => self.to_string(),
        }
    }
}

/// How often in one rough period a planner may emit less than half of what it is asked for, though more is to come.
const MAX_SHORT_ADVANCES: u32 = 1000;

/// Rough periods that are queued beyond what the worst stop asks for: the one until the rough loop comes again, and those by which it
/// may be late.
const MARGIN_PERIODS: f64 = 1.0 + SERVED_FOR_PERIODS;

/// The soft loop of one program run.
#[allow(clippy::struct_excessive_bools)] // independent facts about the stream
pub struct RoughLoop {
    config: RoughConfig,
    pub(crate) source: Box<dyn Source + Send>,
    pub(crate) planner: Box<dyn Planner>,
    pub(crate) queue: Queue,
    pub(crate) items: Vec<Item>,
    pub(crate) next: usize,
    /// The program gives nothing more.
    pub(crate) dry: bool,
    /// The planner has been told that nothing follows for now.
    pub(crate) finished: bool,
    /// The planner has emitted all of it.
    pub(crate) stretch_over: bool,
    pub(crate) waiting: Option<InputWait>,
    pub(crate) waited_s: f64,
    /// The last block waits for an edge: where it ends is not known before it has.
    pub(crate) edge_awaited: bool,
    /// More may come in time: the plan is left open.
    awaits_more: bool,
    /// The planner has room, and does not know whether more comes.
    has_room: bool,
    pub(crate) gathering: Gathering,
    line: u32,
    last_block: u64,
    pub(crate) done: bool,
    /// The joints are not enabled yet.
    pub(crate) awaits_drives: bool,
}

impl RoughLoop {
    /// A rough loop at the start of its program.
    pub fn new(
        config: RoughConfig,
        source: Box<dyn Source + Send>,
        planner: Box<dyn Planner>,
        end: RoughEnd,
    ) -> Self {
        Self {
            config,
            source,
            planner,
            queue: Queue::new(
                end,
                QueueDepth::new(
                    config.rough_period_s,
                    config.fine_period_s,
                    config.depth_factor,
                    config.easing,
                ),
                JunctionSteps::new(config.lanes, config.seam_rounding),
            ),
            items: Vec::new(),
            next: 0,
            dry: false,
            finished: false,
            stretch_over: false,
            waiting: None,
            waited_s: 0.0,
            edge_awaited: false,
            awaits_more: false,
            has_room: false,
            gathering: Gathering::new(config.slowness),
            line: 0,
            last_block: 0,
            done: false,
            awaits_drives: config.awaits_drives,
        }
    }

    /// One rough period: fills the planner, advances it until the fine loop has enough, queues what came out.
    ///
    /// # Errors
    /// The program or the planner cannot go on; what is queued is still driven to its end.
    pub fn step(&mut self, observer: &mut dyn Observer) -> Result<Progress, RoughError> {
        let rested = self.take_rests(observer);
        self.source.period();
        if self.awaits_drives && rested.is_ok() {
            return Ok(Progress::Working);
        }
        // What waits for room goes first: while some of it waits the planner is not advanced.
        self.queue.move_staged();
        let result = rested.and_then(|()| self.fill(observer));
        let over = self.stretch_over || result.is_err();
        // Where the ring was full it still counts as that, though the fine loop has just taken something.
        let full = !over && self.queue.is_waiting_for_room();
        self.queue.flush(over, full);
        self.queue.tell_of_blocks(observer);
        result?;
        self.answer_wait();
        Ok(if self.done {
            Progress::Done
        } else {
            Progress::Working
        })
    }

    /// Whether the program waits for an input (M66), or its source for time to pass.
    pub fn is_waiting(&self) -> bool {
        self.waiting.is_some() || self.source.is_waiting()
    }

    fn fill(&mut self, observer: &mut dyn Observer) -> Result<(), RoughError> {
        let (period_s, advance_s) = (self.config.rough_period_s, self.config.advance_s);
        let (mut short, mut timeless) = (0, 0);
        self.gathering.pass(period_s);
        if !self.done && self.source.streams() && self.queue.is_deep(MARGIN_PERIODS * period_s) {
            // A sender has few places to wait in: its lines go to the planner as they come, not when they are needed, or the planner
            // would see no further than those places and plan to a rest at the last of them.
            self.offer(observer)?;
        }
        while !self.done && !self.queue.is_deep(MARGIN_PERIODS * period_s) {
            let last_block = self.last_block;
            self.feed(observer)?;
            if self.awaits_more {
                return Ok(());
            }
            let before_s = self.queue.emitted_s();
            let advanced = self
                .planner
                .advance(advance_s, &mut self.queue)
                .map_err(|e| planner_error(None, &e.to_string()))?;
            if let Some(defect) = self.queue.defect() {
                return Err(planner_error(None, defect));
            }
            if advanced.done != 0 && !self.queue.plan_rests() {
                return Err(planner_error(
                    None,
                    "advance says that it is done, and the plan does not end at rest",
                ));
            }
            self.stretch_over = advanced.done != 0;
            if self.stretch_over {
                self.stretch_is_over();
                return Ok(());
            }
            self.queue.flush(false, false);
            // What came counts, not what the planner says of it.
            let emitted_s = self.queue.emitted_s() - before_s;
            if emitted_s > 0.0 {
                self.gathering.emitted(self.queue.is_deep(0.0));
            }
            if emitted_s == 0.0 && self.has_room {
                // All that is left of the plan depends on what follows.
                if self.gathering.may_wait(period_s) {
                    return Ok(());
                }
                self.finish();
                continue;
            }
            if emitted_s == 0.0 && !self.finished && self.last_block == last_block {
                return Err(planner_error(
                    Some(self.line),
                    "it is full, and advance emits nothing",
                ));
            }
            // Blocks that take no time, as dwells of nothing: they have made room, and the next ones are offered.
            timeless += u32::from(emitted_s == 0.0 && !self.finished);
            if timeless > MAX_SHORT_ADVANCES {
                return Ok(());
            }
            // A planner may wait for the next block, which its buffer has room for.
            short += u32::from(emitted_s < advance_s / 2.0 && self.last_block == last_block);
            if short > MAX_SHORT_ADVANCES {
                return Err(planner_error(
                    None,
                    "advance emits a little at a time, and hardly gets on",
                ));
            }
        }
        Ok(())
    }

    /// The planner has emitted all it was given: the program has ended, or it waits for an input.
    fn stretch_is_over(&mut self) {
        self.gathering.restart();
        self.queue.release_events();
        if !self.awaits_answer() && self.dry {
            self.queue.event(Event::new(
                EventKind::ProgramEnd,
                self.line,
                self.last_block + 1,
                0,
                0.0,
            ));
            self.queue.release_events();
            self.done = true;
        }
    }

    /// Offers blocks until the planner is full or the program gives no more for now: then it is told that nothing follows. Where
    /// somebody sends, more may come in time, and until it is late the planner plans what does not depend on that.
    fn feed(&mut self, observer: &mut dyn Observer) -> Result<(), RoughError> {
        (self.awaits_more, self.has_room) = (false, false);
        if self.offer(observer)? || self.finished {
            return Ok(());
        }
        if !self.source.streams() || self.dry || self.awaits_answer() {
            self.finish();
            return Ok(());
        }
        // What is queued lasts until more may have come: a rough period longer than a stop asks for.
        let period_s = self.config.rough_period_s;
        self.awaits_more = self.queue.is_deep(period_s) || self.gathering.goes_on(period_s);
        self.has_room = true;
        Ok(())
    }

    fn finish(&mut self) {
        self.planner.finish();
        self.finished = true;
    }

    /// Offers blocks until the planner is full, which is the answer, or the program gives no more for now.
    fn offer(&mut self, observer: &mut dyn Observer) -> Result<bool, RoughError> {
        while !self.awaits_answer() && self.load()? {
            match &self.items[self.next] {
                Item::Block(block, curve) => {
                    self.line = block.line;
                    self.last_block = block.index;
                    let accepted = self
                        .planner
                        .accept(block, curve.as_deref().map(NurbsData::curve));
                    if accepted.map_err(|e| planner_error(Some(block.line), &e.to_string()))?
                        == Accepted::Full
                    {
                        return Ok(true);
                    }
                    self.gathering.accepted(block);
                    self.edge_awaited = block.stop_on.edge != Edge::None;
                    self.queue.accepted(block, curve.as_ref());
                }
                Item::Event(event) if event.kind == EventKind::ProgramEnd => {}
                Item::Event(event) => {
                    observer.event(event);
                    self.queue.event(*event);
                }
                Item::Wait(wait) => self.waiting = Some(*wait),
                // Who runs commands takes them out of what they hand on.
                Item::Command(_) | Item::Stated { .. } => {}
                Item::End => self.dry = true,
            }
            self.finished = false;
            self.next += 1;
        }
        Ok(false)
    }

    /// Whether the program can go on only when the machine has answered: an input (M66), or where a probe has touched.
    fn awaits_answer(&self) -> bool {
        self.waiting.is_some() || self.edge_awaited
    }

    /// Sees to it that there is a next item; `false` where the program is over, or gives nothing for now.
    fn load(&mut self) -> Result<bool, RoughError> {
        while self.next == self.items.len() && !self.dry {
            if self.source.streams() && self.finished && !self.stretch_over {
                // What was given before is planned to its end first; what has come since goes on from there.
                return Ok(false);
            }
            let driven = self.finished && self.queue.is_driven();
            if !self.source.may_go_on(driven) {
                return Ok(false);
            }
            self.items.clear();
            self.next = 0;
            let more = self
                .source
                .next_items(&mut self.items)
                .map_err(RoughError::Program)?;
            if self.items.is_empty() {
                self.dry = !more;
                return Ok(false);
            }
        }
        Ok(self.next < self.items.len())
    }

    /// Answers M66 once the machine has come to rest.
    fn answer_wait(&mut self) {
        let Some(wait) = self.waiting else { return };
        if !self.finished || !self.queue.is_driven() {
            return;
        }
        let answer = read_input(&wait, self.queue.inputs());
        self.waited_s += self.config.rough_period_s;
        if let Some(value) = answer.or((self.waited_s > wait.timeout_s).then_some(-1.0)) {
            self.source.provide_input(value);
            (self.waiting, self.waited_s) = (None, 0.0);
        }
    }
}

/// The line as it stands in a message, with what divides it from the cause.
fn at_line(line: Option<u32>) -> String {
    line.map_or_else(String::new, |line| format!("line {line}: "))
}

fn planner_error(line: Option<u32>, cause: &str) -> RoughError {
    RoughError::Planner {
        line,
        cause: cause.to_string(),
    }
}

/// The answer of an input now, if what is waited for is there. Edges are taken as levels: the machine was at rest
/// before the wait began, and an edge shorter than a rough period is not promised to be seen.
fn read_input(wait: &InputWait, inputs: u64) -> Option<f64> {
    let Input::Digital(number) = wait.input else {
        // Only simulated drives are asked: their analogue inputs are 0.
        return Some(0.0);
    };
    let high = inputs >> number.min(63) & 1 == 1;
    let met = match wait.mode {
        InputMode::Immediate => true,
        InputMode::Rise | InputMode::High => high,
        InputMode::Fall | InputMode::Low => !high,
    };
    met.then_some(if high { 1.0 } else { 0.0 })
}

#[cfg(test)]
#[path = "rough_tests.rs"]
mod tests;

#[cfg(test)]
#[path = "stream_tests.rs"]
mod stream_tests;
