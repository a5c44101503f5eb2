//! What is asked of the machine, what moves, and what waits.

use std::collections::VecDeque;
use std::sync::atomic::Ordering::Relaxed;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use tandem_gcode::Item;
use tandem_host::check_block;
use tandem_machine::Machine;
use tandem_rings::{Controls, Rest};
use tandem_sdk::{AxisVector, Block, BlockKind, PathMode, Planner};

use super::message::{Jog, JogEnd, JogRest, Reach};

/// Steps that may wait behind the one that moves.
const MAX_WAITING: usize = 16;

/// The jogs of a machine. Keys, sockets and scripts share it; soft side, never waits for the fine loop.
pub struct JogController {
    machine: Machine,
    /// Fine periods without a beat after which a jog is let go.
    keep_alive_periods: u64,
    inner: Mutex<Inner>,
}

struct Inner {
    /// A planner that only judges blocks.
    judge: Box<dyn Planner>,
    /// The operator's atomics of the run; none while the machine is in fault.
    controls: Option<Arc<Controls>>,
    /// Where the machine rests, or rested last.
    position: AxisVector,
    moving: Option<Moving>,
    waiting: VecDeque<Jog>,
    /// The end of what moves was asked for.
    ended_by_word: bool,
    /// Bit per axis of which it is not known where it is.
    unknown: u32,
    /// Blocks made so far.
    blocks: u32,
    /// The machine stands and takes jogs: it is enabled, and homed where that was asked for.
    ready: bool,
    over: bool,
}

#[derive(Clone, Copy)]
struct Moving {
    jog: Jog,
    end: AxisVector,
}

impl JogController {
    /// Nothing asked yet; `judge` is a planner that only judges blocks.
    pub(crate) fn new(machine: &Machine, judge: Box<dyn Planner>) -> Self {
        let inner = Inner {
            judge,
            controls: None,
            position: machine.start,
            moving: None,
            waiting: VecDeque::new(),
            ended_by_word: false,
            unknown: 0,
            blocks: 0,
            ready: false,
            over: false,
        };
        let periods = (machine.operator.jog_keep_alive_s / machine.fine_period_s).round();
        Self {
            machine: machine.clone(),
            keep_alive_periods: periods.max(1.0) as u64,
            inner: Mutex::new(inner),
        }
    }

    /// The machine that is jogged.
    pub fn machine(&self) -> &Machine {
        &self.machine
    }

    /// Asks for a jog. The same jog again, while it moves on, keeps it alive; another one stops what moves first. Steps
    /// wait for each other.
    ///
    /// # Errors
    /// The jog is refused, in words; what moves goes on as it was.
    pub fn ask(&self, jog: Jog) -> Result<(), String> {
        let mut inner = self.lock();
        self.judge_feed(&jog, inner.unknown)?;
        let Some(controls) = inner.controls.clone().filter(|_| !inner.over) else {
            return Err(
                "the machine is not enabled: it is in fault, or the session is over".to_string(),
            );
        };
        if !inner.ready {
            return Err("the machine is not ready: it homes".to_string());
        }
        let judged = match jog.reach {
            Reach::On { .. } => self.go_on(&mut inner, &controls, jog)?,
            Reach::By { .. } => self.step(&mut inner, &controls, jog)?,
        };
        if let Some(replaces) = judged {
            if replaces {
                inner.waiting.clear();
                inner.stop();
            }
            inner.waiting.push_back(jog);
        }
        Ok(())
    }

    /// Keeps a jog alive, and begins none: a beat that was on its way for too long finds that the machine has stopped, and it
    /// stays so.
    ///
    /// # Errors
    /// The jog neither moves nor waits any more; nothing is changed.
    pub fn keep_alive(&self, jog: Jog) -> Result<(), String> {
        let inner = self.lock();
        let lives = inner.controls.as_ref().filter(|controls| {
            let moves = inner.moving.is_some_and(|moving| moving.jog == jog);
            let waits = inner.waiting.front() == Some(&jog);
            (moves && !controls.jog.let_go.load(Relaxed)) || waits
        });
        let Some(controls) = lives else {
            return Err("the jog is over: what would keep it alive came too late".to_string());
        };
        controls.jog.beats.fetch_add(1, Relaxed);
        Ok(())
    }

    /// Lets go of what moves, and forgets what waits.
    pub fn let_go(&self) {
        let mut inner = self.lock();
        inner.waiting.clear();
        inner.stop();
    }

    /// The operator has aborted, which stops the machine: what waits is forgotten.
    pub fn forget(&self) {
        let mut inner = self.lock();
        inner.waiting.clear();
        inner.ended_by_word = true;
    }

    /// Nothing more is asked: the session ends when the machine rests.
    pub fn end(&self) {
        let mut inner = self.lock();
        inner.over = true;
        inner.waiting.clear();
        inner.stop();
    }

    /// Whether jogs are taken: the machine is enabled, and homed where that was asked for.
    pub fn is_ready(&self) -> bool {
        self.lock().ready
    }

    /// Whether nothing moves and nothing waits.
    pub fn is_still(&self) -> bool {
        let inner = self.lock();
        inner.moving.is_none() && inner.waiting.is_empty()
    }

    /// `value` of an axis in words, mm or deg.
    pub fn shown(&self, axis: usize, value: f64) -> String {
        let (value, unit) = if self.machine.axes.is_rotary(axis) {
            (value.to_degrees(), "deg")
        } else {
            (value, "mm")
        };
        format!("{} {unit}", (value * 1e6).round() / 1e6)
    }

    /// Name of an axis.
    pub fn name(&self, axis: usize) -> char {
        self.machine.axes.letter(axis).to_ascii_lowercase()
    }

    /// A run begins with these atomics; it homes first, or is `ready`. Of the axes `unknown`, a bit each, it is not known where
    /// they are, nor will it be then.
    pub(crate) fn enable(&self, controls: Arc<Controls>, ready: bool, unknown: u32) {
        let mut inner = self.lock();
        inner.controls = Some(controls);
        inner.ready = ready;
        inner.unknown = unknown;
    }

    /// The run is over: the machine stands at `position`.
    pub(crate) fn disable(&self, position: AxisVector) {
        let mut inner = self.lock();
        inner.controls = None;
        inner.moving = None;
        inner.position = position;
        inner.ready = false;
        inner.waiting.clear();
    }

    /// Jogs that have come too late for what is driven to take them up: they begin something of their own.
    pub(crate) fn take_waiting(&self) -> Vec<Jog> {
        self.lock().waiting.drain(..).collect()
    }

    /// Everything is driven and the machine stands: whether a jog is over by that.
    pub(crate) fn arrived(&self) -> Option<JogRest> {
        let mut inner = self.lock();
        let moved = inner.moving.take()?;
        inner.disarm();
        inner.position = moved.end;
        Some(moved.rest(moved.end, JogEnd::LetGo))
    }

    /// The fine loop has reported a rest on the path: whether a jog is over by that.
    pub(crate) fn rests(&self, rest: &Rest) -> Option<JogRest> {
        let mut inner = self.lock();
        let moved = inner.moving.take();
        inner.disarm();
        inner.position = rest.position;
        let end = if inner.ended_by_word {
            JogEnd::LetGo
        } else {
            JogEnd::Late
        };
        moved.map(|moved| moved.rest(rest.position, end))
    }

    /// At rest: the next jog as a block, with the words for those that cannot be; `false` where nothing more will come.
    pub(crate) fn next(&self, items: &mut Vec<Item>) -> (bool, Vec<String>) {
        let mut inner = self.lock();
        inner.ready = true;
        let mut refused = vec![];
        while let Some(jog) = inner.waiting.pop_front() {
            match self.begin(&mut inner, jog) {
                Ok(block) => {
                    items.push(Item::Block(block, None));
                    return (true, refused);
                }
                Err(why) => refused.push(why),
            }
        }
        (!inner.over, refused)
    }

    /// `None` where the jog is kept alive by this; else whether it takes the place of all that moves and waits.
    fn go_on(
        &self,
        inner: &mut Inner,
        controls: &Controls,
        jog: Jog,
    ) -> Result<Option<bool>, String> {
        if inner.moving.is_none() && inner.waiting.is_empty() {
            self.target(&jog, &inner.position)?;
        }
        let stops = controls.jog.let_go.load(Relaxed);
        controls.jog.beats.fetch_add(1, Relaxed);
        let moves = !stops && inner.moving.is_some_and(|moving| moving.jog == jog);
        let waits = inner.waiting.front() == Some(&jog);
        Ok(if moves || waits { None } else { Some(true) })
    }

    fn step(
        &self,
        inner: &mut Inner,
        controls: &Controls,
        jog: Jog,
    ) -> Result<Option<bool>, String> {
        let goes_on = |jog: &Jog| matches!(jog.reach, Reach::On { .. });
        if inner.moving.is_some_and(|moving| goes_on(&moving.jog))
            || inner.waiting.front().is_some_and(goes_on)
        {
            // Where it starts is known when what moves has come to rest: it is judged then.
            return Ok(Some(true));
        }
        if inner.waiting.len() >= MAX_WAITING {
            return Err(format!("{MAX_WAITING} steps wait already"));
        }
        if !controls.jog.let_go.load(Relaxed) {
            let start = inner.moving.map_or(inner.position, |moving| moving.end);
            let start = inner
                .waiting
                .iter()
                .try_fold(start, |at, step| self.target(step, &at))?;
            self.target(&jog, &start)?;
        }
        Ok(Some(false))
    }

    fn begin(&self, inner: &mut Inner, jog: Jog) -> Result<Block, String> {
        let Some(controls) = inner.controls.clone() else {
            return Err("the machine is not enabled".to_string());
        };
        let end = self.target(&jog, &inner.position)?;
        let block = Block {
            kind: BlockKind::Line,
            path_mode: PathMode::ExactStop,
            line: inner.blocks + 1,
            index: u64::from(inner.blocks),
            end,
            length_mm: (end[jog.axis] - inner.position[jog.axis]).abs(),
            feed_mm_per_s: jog.feed_mm_per_s,
            ..Block::at(inner.position)
        };
        check_block(&self.machine, inner.judge.as_ref(), &block, None)?;
        inner.blocks += 1;
        inner.moving = Some(Moving { jog, end });
        inner.ended_by_word = false;
        controls.jog.let_go.store(false, Relaxed);
        let most = if matches!(jog.reach, Reach::On { .. }) {
            self.keep_alive_periods
        } else {
            0
        };
        controls.jog.max_periods.store(most, Relaxed);
        Ok(block)
    }

    /// Where a jog from `start` ends.
    fn target(&self, jog: &Jog, start: &AxisVector) -> Result<AxisVector, String> {
        let limits = &self.machine.limits.axes()[jog.axis];
        let low = limits.min_mm;
        let high = limits.max_mm;
        let at = start[jog.axis];
        let name = self.name(jog.axis);
        let end = match jog.reach {
            Reach::On { positive: true } => high,
            Reach::On { positive: false } => low,
            Reach::By { distance_mm } => at + distance_mm,
        };
        if let Reach::On { positive } = jog.reach
            && (if positive { at >= high } else { at <= low })
        {
            let where_it_is = if at == end { "at" } else { "beyond" };
            return Err(format!(
                "{name} stands {where_it_is} its travel limit, {}",
                self.shown(jog.axis, end)
            ));
        }
        // Who stands outside of the travel may go inward, as far as he likes.
        if !(low.min(at)..=high.max(at)).contains(&end) {
            let [end, low, high] = [end, low, high].map(|value| self.shown(jog.axis, value));
            return Err(format!(
                "{name} would reach {end}, beyond its travel of {low} to {high} (machine coordinates)"
            ));
        }
        let mut target = *start;
        target[jog.axis] = end;
        Ok(target)
    }

    fn judge_feed(&self, jog: &Jog, unknown: u32) -> Result<(), String> {
        let slowest = self.machine.unhomed_max_feed_mm_per_s[jog.axis];
        if unknown >> jog.axis & 1 == 1 && jog.feed_mm_per_s > slowest * (1.0 + 1e-12) {
            let [asked, slowest] =
                [jog.feed_mm_per_s, slowest].map(|feed| self.shown(jog.axis, feed * 60.0));
            let name = self.name(jog.axis);
            return Err(format!(
                "it is not known where {name} stands: until it is homed its feed is at most {slowest}/min, not {asked}/min"
            ));
        }
        let most = self.machine.limits.axes()[jog.axis].feed_mm_per_s;
        // Minutes, seconds and radians cost a digit.
        if jog.feed_mm_per_s <= most * (1.0 + 1e-12) {
            return Ok(());
        }
        let [asked, most] = [jog.feed_mm_per_s, most].map(|feed| self.shown(jog.axis, feed * 60.0));
        Err(format!(
            "a feed of {asked}/min is above the highest of {}, {most}/min",
            self.name(jog.axis)
        ))
    }

    fn lock(&self) -> MutexGuard<'_, Inner> {
        // What lies in it is whole after every statement.
        self.inner.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Inner {
    fn stop(&mut self) {
        if let (Some(_), Some(controls)) = (&self.moving, &self.controls) {
            controls.jog.let_go.store(true, Relaxed);
            self.ended_by_word = true;
        }
    }

    /// Nothing moves: nothing needs to be kept alive, and nothing to be let go.
    fn disarm(&self) {
        if let Some(controls) = &self.controls {
            controls.jog.max_periods.store(0, Relaxed);
            controls.jog.let_go.store(false, Relaxed);
        }
    }
}

impl Moving {
    /// The end of the jog at `position`: `early`, unless it has come to where it went.
    fn rest(&self, position: AxisVector, early: JogEnd) -> JogRest {
        let end = match self.jog.reach {
            _ if position != self.end => early,
            Reach::On { .. } => JogEnd::AtLimit,
            Reach::By { .. } => JogEnd::Arrived,
        };
        JogRest {
            axis: self.jog.axis,
            end,
            position,
        }
    }
}
