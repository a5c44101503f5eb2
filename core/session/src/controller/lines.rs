//! Lines by hand as they come: each is judged by itself, and those that come in time are planned through.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use tandem_gcode::{Interpreter, Item, Lasting, Ledger, Moment, ProbeResult};
use tandem_machine::Machine;
use tandem_rings::{Rest, RestCause};
use tandem_rough::Source;
use tandem_sdk::{AxisVector, Planner};

use crate::judge::LineJudge;
use crate::standing::Standing;

/// Lines that may wait before they are planned.
const MAX_WAITING: usize = 1000;

/// A line that was judged: whose it is, and the block behind it.
#[derive(Clone, Copy, Debug)]
pub struct Judged {
    /// The client.
    pub client: u64,
    /// Its request.
    pub id: u64,
    /// The line is driven when this block begins.
    behind: u64,
}

/// What is true between jobs, and the lines that are read ahead of it. Shared by who judges and who drives.
pub struct Lines {
    judge: LineJudge,
    /// Modes, offsets, parameters and tools as the path has made them true.
    standing: Interpreter,
    /// The same behind the last line that was judged.
    ahead: Interpreter,
    told: Option<Moment>,
    /// What programs and lines change, until the path reaches it.
    pub ledger: Ledger,
    waiting: VecDeque<Vec<Item>>,
    judged: VecDeque<Judged>,
    count: u32,
    /// The machine has to answer (M66, a probe) before another line is judged.
    asks: bool,
    /// A job takes lines.
    open: bool,
    /// A job of lines is driven, whether it takes more or comes to its end.
    driving: bool,
    stands: Standing,
}

/// Shared lines.
pub type SharedLines = Arc<Mutex<Lines>>;

/// Locks them.
pub fn lock(lines: &SharedLines) -> MutexGuard<'_, Lines> {
    // What lies in it is whole after every statement.
    lines.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Lines {
    /// Nothing was said yet; `standing` is what has lasted. Host; allocates.
    pub fn new(machine: &Machine, judge: Box<dyn Planner>, mut standing: Interpreter) -> Self {
        standing.set_file("input");
        Self {
            judge: LineJudge::new(machine.clone(), judge),
            ahead: standing.clone(),
            standing,
            told: None,
            ledger: Ledger::default(),
            waiting: VecDeque::new(),
            judged: VecDeque::new(),
            count: 0,
            asks: false,
            open: false,
            driving: false,
            stands: Standing::default(),
        }
    }

    /// Modes, offsets, parameters and tools as they are.
    pub fn standing(&self) -> &Interpreter {
        &self.standing
    }

    /// What lasts is otherwise from here on; nothing is driven.
    pub fn set_lasting(&mut self, lasting: &Lasting) {
        self.standing.set_lasting(lasting);
        self.ahead = self.standing.clone();
    }

    /// What would last behind a line that is driven nowhere, such as G10, in millimetres and absolute.
    ///
    /// # Errors
    /// What is wrong with the line.
    pub fn lasting_behind(&self, line: &str) -> Result<Lasting, String> {
        let mut tried = self.standing.clone();
        tried.reset_modes();
        tried
            .line(1, line.as_bytes(), &mut vec![])
            .map_err(|e| e.message)?;
        Ok(tried.lasting())
    }

    /// Judges a line and takes it; whether a job is to begin for it.
    ///
    /// # Errors
    /// What is wrong with it: nothing has changed.
    pub fn judge(&mut self, client: u64, id: u64, text: &str) -> Result<bool, String> {
        if self.asks {
            return Err(
                "the line before waits for an input or a probe: send this one when it is driven"
                    .to_string(),
            );
        }
        if self.waiting.len() >= MAX_WAITING {
            return Err(format!(
                "{MAX_WAITING} lines wait already: send this one when they are driven"
            ));
        }
        let begins = !self.driving && self.waiting.is_empty();
        if begins {
            self.ahead = self.standing.clone();
            self.ahead.number_anew();
            self.ahead.keep_moments();
            (self.count, self.told) = (0, None);
        }
        let number = self.count + 1;
        let first_block = self.ahead.next_block();
        let (mut tried, items) = self.judge.judge(&self.ahead, number, text)?;
        self.asks = items
            .iter()
            .any(|item| matches!(item, Item::Wait(_)) || item.is_probe());
        if let Some(moment) = tried.moment_since(&mut self.told) {
            self.ledger.push(first_block, moment);
        }
        self.ahead = tried;
        self.count = number;
        self.judged.push_back(Judged {
            client,
            id,
            behind: self.ahead.next_block(),
        });
        self.waiting.push_back(items);
        Ok(begins)
    }

    /// Whether lines wait for a job.
    pub fn are_waiting(&self) -> bool {
        !self.waiting.is_empty()
    }

    /// The path has begun `block`: lines that are driven by now.
    pub fn reach(&mut self, block: u64) -> Vec<Judged> {
        self.ledger.reach(block);
        let driven = self
            .judged
            .iter()
            .take_while(|line| line.behind <= block)
            .count();
        self.judged.drain(..driven).collect()
    }

    /// Takes up what the path has reached since; whether that is anything.
    pub fn settle(&mut self) -> bool {
        let reached = self.ledger.take();
        let is_any = reached.is_some();
        if let Some(moment) = reached {
            self.standing.take_up(moment);
        }
        is_any
    }

    /// The job is over, and the machine stands at `position`; `whole` where all that was read is driven, and `ended` where a
    /// program has come to its end, behind which modes are as at the start. What is on was `switched_off` otherwise. Lines that
    /// were taken: driven where whole, else not.
    pub fn end_job(
        &mut self,
        position: AxisVector,
        whole: bool,
        ended: bool,
        switched_off: bool,
    ) -> Vec<Judged> {
        let goes_on = whole && !self.waiting.is_empty();
        if whole && !goes_on {
            self.ledger.reach_all();
        } else if !whole {
            self.ledger.forget();
            self.waiting.clear();
        }
        self.settle();
        if ended {
            self.standing.reset_modes();
        }
        if switched_off {
            self.standing.set_switched_off();
        }
        self.standing.set_position(position);
        (self.open, self.driving) = (false, false);
        self.stands.moves();
        self.asks &= goes_on;
        if goes_on {
            return vec![];
        }
        self.ahead = self.standing.clone();
        self.judged.drain(..).collect()
    }
}

/// The lines as the rough loop pulls them.
pub struct LineSource(pub SharedLines);

impl LineSource {
    /// A job takes lines from here on.
    pub fn begin(lines: &SharedLines) -> Self {
        let mut inner = lock(lines);
        (inner.open, inner.driving) = (true, true);
        inner.stands.moves();
        drop(inner);
        Self(Arc::clone(lines))
    }
}

impl Source for LineSource {
    fn streams(&self) -> bool {
        true
    }

    fn may_go_on(&mut self, driven: bool) -> bool {
        let mut inner = lock(&self.0);
        inner.stands.look(driven);
        true
    }

    fn next_items(&mut self, items: &mut Vec<Item>) -> Result<bool, String> {
        let mut inner = lock(&self.0);
        while let Some(next) = inner.waiting.pop_front() {
            inner.stands.moves();
            items.extend(next);
            if !items.is_empty() {
                return Ok(true);
            }
        }
        inner.open = !inner.stands.is_still();
        Ok(inner.open)
    }

    fn provide_input(&mut self, value: f64) {
        let mut inner = lock(&self.0);
        // It is true now, and lasts behind the job.
        inner.standing.provide_input(value);
        inner.ahead.provide_input(value);
        inner.asks = false;
    }

    fn provide_rest(&mut self, rest: &Rest) -> bool {
        let mut inner = lock(&self.0);
        match rest.cause {
            RestCause::Attached => true,
            RestCause::Abort => {
                inner.waiting.clear();
                inner.open = false;
                false
            }
            RestCause::Corrected => {
                inner.ahead.set_position(rest.position);
                true
            }
            RestCause::Edge | RestCause::Missed | RestCause::Already => {
                let found = ProbeResult {
                    touched: rest.latch,
                    rest: rest.position,
                };
                inner.standing.provide_probe(&found);
                inner.ahead.provide_probe(&found);
                inner.asks = false;
                true
            }
        }
    }
}
