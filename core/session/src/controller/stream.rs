//! What senders ask of the dispatcher who stream lines and do not wait for answers in JSON: lines and jogs that are taken or come too
//! early, stops, and what they are shown.

use std::sync::Arc;
use std::sync::atomic::Ordering::Relaxed;

use tandem_gcode::Interpreter;
use tandem_host::Command;
use tandem_rings::Status;
use tandem_sdk::{AxisVector, Block};

use super::dispatcher::{Dispatcher, Inner, Mode, Order, RequestId, StateWrite};
use super::lines::{Lines, TakenLine, lock};
use super::states::{ControllerState, judge};
use crate::judge::Refusal;

/// Lines that wait for the planner to take them: more than it takes in a rough period, and few enough that a stop forgets little.
pub const PLACES: usize = 128;

/// Why a line was not taken.
pub enum NotTaken {
    /// It comes too early: say it again.
    NotYet,
    /// The state of the machine does not allow it, in words.
    Locked(String),
    /// It asks for a machine that stands.
    NotIdle,
    /// It is wrong.
    Refused(Refusal),
}

impl RequestId {
    /// Nobody waits for the answer.
    pub fn nobody() -> Self {
        Self { client: 0, id: 0 }
    }
}

impl Dispatcher {
    /// Judges a line of a sender and takes it.
    pub fn take_line(&self, from: RequestId, text: &str) -> Result<TakenLine, NotTaken> {
        let mut inner = self.lock();
        let mut lines = lock(&self.lines);
        self.may_take_line(&inner, &lines)?;
        let taken = lines
            .judge(from.client, from.id, text)
            .map_err(NotTaken::Refused)?;
        self.begin_for_line(&mut inner, &mut lines, taken);
        Ok(taken)
    }

    /// Whether a line calls a subroutine, whose file is read when it is judged.
    pub fn calls(&self, text: &str) -> bool {
        lock(&self.lines).calls(text)
    }

    /// The same for a line that calls a subroutine and came when so many stops had been asked for, where it `is_wanted` still. It
    /// reads files, and nothing is locked meanwhile.
    pub fn take_call(
        &self,
        from: RequestId,
        text: &str,
        stops: u64,
        is_wanted: impl Fn() -> bool,
    ) -> Result<TakenLine, NotTaken> {
        let files = lock(&self.lines).files();
        loop {
            let inner = self.lock();
            let mut lines = lock(&self.lines);
            self.may_take_line(&inner, &lines)?;
            let call = lines.begin_call().map_err(NotTaken::Refused)?;
            drop((lines, inner));
            let judged = call.judge(&files, text).map_err(NotTaken::Refused)?;
            let mut inner = self.lock();
            let mut lines = lock(&self.lines);
            if inner.stops != stops || !is_wanted() {
                let why = "the machine was stopped before the line was begun";
                return Err(NotTaken::Locked(why.to_string()));
            }
            self.may_take_line(&inner, &lines)?;
            let Some(taken) = lines.end_call((from.client, from.id), &call, judged) else {
                continue;
            };
            let taken = taken.map_err(NotTaken::Refused)?;
            self.begin_for_line(&mut inner, &mut lines, taken);
            return Ok(taken);
        }
    }

    /// Judges a call and drives nothing: what is true behind it. It reads files, and nothing is locked meanwhile.
    pub fn check_call(&self, before: &Interpreter, text: &str) -> Result<Interpreter, Refusal> {
        let files = lock(&self.lines).files();
        Lines::check_call(&files, before, text)
    }

    fn may_take_line(&self, inner: &Inner, lines: &Lines) -> Result<(), NotTaken> {
        let state = self.state_of(inner);
        match state {
            ControllerState::Ready | ControllerState::Mdi => {}
            ControllerState::Stopping | ControllerState::Held => return Err(NotTaken::NotYet),
            ControllerState::Manual if self.is_jog_ending() => return Err(NotTaken::NotYet),
            state => return Err(locked(state, "mdi")),
        }
        if inner.state_write == StateWrite::UnderWay
            || !matches!(inner.order, None | Some(Order::Mdi))
        {
            return Err(NotTaken::NotYet);
        }
        if lines.are_jogs() && lines.is_at_work() {
            return Err(locked(ControllerState::Manual, "mdi"));
        }
        if lines.awaits_answer() || lines.count_waiting() >= PLACES {
            return Err(NotTaken::NotYet);
        }
        Ok(())
    }

    /// A job for a line that was taken, where it needs one.
    fn begin_for_line(&self, inner: &mut Inner, lines: &mut Lines, taken: TakenLine) {
        if taken.begins && inner.mode == Mode::Idle {
            if lines.take_up_at_rest() {
                self.keep(lines.standing().persistent_data());
            } else {
                inner.order = Some(Order::Mdi);
            }
        }
    }

    /// Judges a jog, words as of G1, and takes it: it is planned through into those that follow in time.
    pub fn take_jog(&self, from: RequestId, words: &str) -> Result<TakenLine, NotTaken> {
        let mut inner = self.lock();
        match self.state_of(&inner) {
            ControllerState::Manual if self.is_jog_ending() => return Err(NotTaken::NotYet),
            ControllerState::Ready | ControllerState::HomingNeeded | ControllerState::Manual => {}
            ControllerState::Stopping => return Err(NotTaken::NotYet),
            ControllerState::Mdi | ControllerState::Held | ControllerState::Running => {
                return Err(NotTaken::NotIdle);
            }
            state => return Err(locked(state, "jog")),
        }
        let joins = matches!(inner.order, None | Some(Order::JogLines));
        if inner.state_write == StateWrite::UnderWay
            || !joins && !matches!(inner.order, Some(Order::Mdi))
        {
            return Err(NotTaken::NotYet);
        }
        let mut lines = lock(&self.lines);
        if lines.count_waiting() >= PLACES {
            return Err(NotTaken::NotYet);
        }
        let unknown = inner.unknown_axes;
        let allows = |from: &AxisVector, block: &Block| self.allows_unhomed(unknown, from, block);
        let taken = lines
            .judge_jog(from.client, from.id, words, allows)
            .map_err(|why| {
                if why.code == "not-idle" {
                    NotTaken::NotIdle
                } else {
                    NotTaken::Refused(why)
                }
            })?;
        if taken.begins && inner.mode == Mode::Idle {
            inner.order = Some(Order::JogLines);
        }
        Ok(taken)
    }

    /// Axes of which it is not known where they are keep to the feed that the machine file allows them.
    fn allows_unhomed(
        &self,
        unknown: u32,
        from: &AxisVector,
        block: &Block,
    ) -> Result<(), Refusal> {
        let length = self.machine.axes.path_length(&(block.end - *from));
        for axis in (0..self.machine.axes.count()).filter(|axis| unknown >> axis & 1 == 1) {
            let share = (block.end[axis] - from[axis]).abs() / length;
            let most = self.machine.unhomed_max_feed_mm_per_s[axis];
            if share * block.feed_mm_per_s > most * (1.0 + 1e-9) {
                let letter = self.machine.axes.letter(axis);
                let per_min = most * 60.0;
                return Err(Refusal::of(
                    "unhomed",
                    format!(
                        "it is not known where {letter} stands: until it is homed its feed is at most {per_min}/min"
                    ),
                ));
            }
        }
        Ok(())
    }

    fn is_jog_ending(&self) -> bool {
        self.hub.controls().jog.let_go.load(Relaxed)
    }

    /// Jogs come to rest on their path, and those that wait are forgotten.
    pub fn cancel_jogs(&self) {
        let inner = self.lock();
        let mut lines = lock(&self.lines);
        let of_lines = lines.are_jogs() && lines.is_at_work();
        if of_lines {
            self.tell_driven(&lines.forget_waiting(), false);
        }
        drop(lines);
        if of_lines && inner.mode == Mode::Jog {
            self.hub.controls().jog.let_go.store(true, Relaxed);
        } else {
            self.jogs.let_go();
        }
    }

    /// Feed hold of what is driven, or is about to be; whether there is anything of the kind.
    pub fn hold(&self) -> bool {
        let inner = self.lock();
        let works =
            inner.mode != Mode::Idle || inner.order.is_some() || lock(&self.lines).is_at_work();
        // A hold is never refused where something moves.
        works && self.hub.give(Command::Hold).is_ok()
    }

    /// Lines that wait are forgotten, and what is driven comes to rest on its path.
    pub fn stop(&self) {
        let mut inner = self.lock();
        let forgotten = lock(&self.lines).forget_waiting();
        self.tell_driven(&forgotten, false);
        if inner.is_about_to_move() {
            inner.aborting = true;
        }
        let drives = !matches!(inner.mode, Mode::Idle | Mode::Enabling);
        if drives && self.hub.give(Command::Abort).is_ok() {
            inner.aborting = true;
            self.jogs.forget();
        }
        inner.stops += 1;
    }

    /// Whether nothing is driven, and nothing is about to be.
    pub fn is_still(&self) -> bool {
        let inner = self.lock();
        inner.mode == Mode::Idle && inner.order.is_none() && !lock(&self.lines).is_at_work()
    }

    /// What is driven.
    pub fn mode(&self) -> Mode {
        self.lock().mode
    }

    /// The fault that the machine stands in, in words.
    pub fn fault_words(&self) -> Option<String> {
        self.lock().fault.as_ref().map(|(words, _)| words.clone())
    }

    /// What the fine loop says of itself.
    pub fn loop_status(&self) -> &Arc<Status> {
        &self.status
    }

    /// Whether the axes still move.
    pub fn moves(&self) -> bool {
        !self.hub.is_at_rest()
    }

    /// Looks at lines and at what is true between them.
    pub fn with_lines<T>(&self, look: impl FnOnce(&mut Lines) -> T) -> T {
        look(&mut lock(&self.lines))
    }

    /// Offsets and modes as the path has made them true. Allocates.
    pub fn standing(&self) -> Interpreter {
        lock(&self.lines).standing().clone()
    }
}

fn locked(state: ControllerState, request: &str) -> NotTaken {
    let why = judge(state, request).err().unwrap_or("not now");
    NotTaken::Locked(why.to_string())
}
