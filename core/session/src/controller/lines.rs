//! Lines by hand as they come: each is judged by itself, and those that come in time are planned through.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use tandem_gcode::{Interpreter, Item, PersistentData, ProbeResult, StateTag, StateTags};
use tandem_machine::Machine;
use tandem_rings::{Rest, RestCause};
use tandem_rough::Source;
use tandem_sdk::{AxisVector, Block, BlockKind, EventKind, Planner};

use super::dispatcher::Order;
use crate::judge::{JudgedLine, LineJudge, Refusal};
use crate::standstill::Standstill;

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
#[allow(
    clippy::struct_excessive_bools,
    reason = "each is a question of its own about the job"
)]
pub struct Lines {
    judge: LineJudge,
    /// Judges lines that read files, while nobody holds the lines.
    files: Arc<Mutex<LineJudge>>,
    /// Grows whenever a line that is being judged would have to be judged anew.
    turn: u64,
    /// Modes, offsets, parameters and tools as the path has made them true.
    standing: Interpreter,
    /// The same behind the last line that was judged.
    ahead: Interpreter,
    told: Option<StateTag>,
    /// What programs and lines change, until the path reaches it.
    pub state_tags: StateTags,
    waiting: VecDeque<Vec<Item>>,
    judged: VecDeque<Judged>,
    count: u32,
    /// The machine has to answer (M66, a probe) before another line is judged.
    asks: bool,
    /// A job takes lines.
    open: bool,
    /// A job of lines is driven, whether it takes more or comes to its end.
    driving: bool,
    /// The lines are jogs: letting go stops them, and no other lines go with them.
    jogs: bool,
    /// What the last probe has found.
    probed: Option<Probed>,
    stands: Standstill,
}

/// A line that is being judged while nobody holds the lines.
pub struct Call {
    before: Interpreter,
    number: u32,
    turn: u64,
}

impl Call {
    /// Judges it. It reads files, and may take as long as they do.
    ///
    /// # Errors
    /// What is wrong with it.
    pub fn judge(&self, files: &Mutex<LineJudge>, text: &str) -> Result<JudgedLine, Refusal> {
        let judge = files.lock().unwrap_or_else(PoisonError::into_inner);
        judge.judge(&self.before, self.number, text)
    }
}

/// Where a probe has come to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Probed {
    /// Where it touched, else where the machine came to rest; machine coordinates, mm or rad.
    pub position: AxisVector,
    /// Whether it touched.
    pub touched: bool,
}

/// What is known of a line that was taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(clippy::struct_excessive_bools, reason = "independent facts of a line")]
pub struct TakenLine {
    /// A job is to begin for it.
    pub begins: bool,
    /// The machine rests in it or waits: for a time, the operator, an input, or at the end of a program.
    pub rests: bool,
    /// It probes.
    pub asks_probe: bool,
    /// It ends a program.
    pub ends: bool,
}

/// What a line asks for where it does not only move and switch.
fn rests(item: &Item) -> bool {
    match item {
        Item::Block(block, _) => block.dwell_s > 0.0 || item.is_probe(),
        Item::Event(event) => matches!(
            event.kind,
            EventKind::ProgramStop
                | EventKind::OptionalStop
                | EventKind::ToolChange
                | EventKind::ProgramEnd
        ),
        _ => true,
    }
}

/// Whether a line asks for a rest and nothing else: G4 P0, by which senders wait for the machine. Beside what it switches a rest is
/// only on the way.
fn only_rests(items: &[Item]) -> bool {
    let is_dwell =
        |item: &Item| matches!(item, Item::Block(block, _) if block.kind == BlockKind::Dwell);
    !items.is_empty() && items.iter().all(is_dwell)
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
    pub fn new(
        machine: &Machine,
        judges: [Box<dyn Planner>; 2],
        mut standing: Interpreter,
    ) -> Self {
        standing.set_file("input");
        let [judge, files] = judges.map(|judge| LineJudge::new(machine.clone(), judge));
        Self {
            judge,
            files: Arc::new(Mutex::new(files)),
            turn: 0,
            ahead: standing.clone(),
            standing,
            told: None,
            state_tags: StateTags::default(),
            waiting: VecDeque::new(),
            judged: VecDeque::new(),
            count: 0,
            asks: false,
            open: false,
            driving: false,
            jogs: false,
            probed: None,
            stands: Standstill::default(),
        }
    }

    /// Modes, offsets, parameters and tools behind the last line that was taken.
    pub fn ahead(&self) -> &Interpreter {
        if self.is_at_work() {
            &self.ahead
        } else {
            &self.standing
        }
    }

    /// Whether lines wait, or are driven.
    pub fn is_at_work(&self) -> bool {
        self.driving || !self.waiting.is_empty()
    }

    /// Whether they are jogs.
    pub fn are_jogs(&self) -> bool {
        self.jogs
    }

    /// How many lines wait for the planner to take them.
    pub fn count_waiting(&self) -> usize {
        self.waiting.len()
    }

    /// Whether a line was taken that the machine has to answer before another one is judged.
    pub fn awaits_answer(&self) -> bool {
        self.asks
    }

    /// What the last probe has found.
    pub fn probed(&self) -> Option<Probed> {
        self.probed
    }

    /// Lines that wait are never driven, and are the answer; what is driven goes on.
    #[must_use]
    pub fn forget_waiting(&mut self) -> Vec<Judged> {
        self.turn += 1;
        let forgotten = self.judged.split_off(self.count_taken());
        self.waiting.clear();
        self.asks &= self.driving;
        if !self.driving {
            self.state_tags.forget();
            self.ahead = self.standing.clone();
        }
        forgotten.into()
    }

    /// How many of the judged lines the planner has taken: those that wait are the last ones.
    fn count_taken(&self) -> usize {
        self.judged.len().saturating_sub(self.waiting.len())
    }

    /// Modes are as at the start of a program; nothing is driven.
    pub fn reset_modes(&mut self) {
        self.turn += 1;
        self.standing.reset_modes();
        self.ahead = self.standing.clone();
    }

    /// What was on is off; nothing is driven.
    pub fn set_switched_off(&mut self) {
        self.turn += 1;
        self.standing.set_switched_off();
        if !self.is_at_work() {
            self.ahead = self.standing.clone();
        }
    }

    /// Judges a line behind `before`, and drives nothing.
    ///
    /// # Errors
    /// What is wrong with it.
    pub fn check(&self, before: &Interpreter, text: &str) -> Result<Interpreter, Refusal> {
        checked(&self.judge, before, text)
    }

    /// Modes, offsets, parameters and tools as they are.
    pub fn standing(&self) -> &Interpreter {
        &self.standing
    }

    /// What lasts is otherwise from here on; nothing is driven.
    pub fn set_persistent_data(&mut self, persistent: &PersistentData) {
        self.turn += 1;
        self.standing.set_persistent_data(persistent);
        self.ahead = self.standing.clone();
    }

    /// What would last behind a line that is driven nowhere, such as G10, in millimetres and absolute.
    ///
    /// # Errors
    /// What is wrong with the line.
    pub fn persistent_data_behind(&self, line: &str) -> Result<PersistentData, String> {
        let mut tried = self.standing.clone();
        tried.reset_modes();
        tried
            .line(1, line.as_bytes(), &mut vec![])
            .map_err(|e| e.message)?;
        Ok(tried.persistent_data())
    }

    /// Judges a line and takes it.
    ///
    /// # Errors
    /// What is wrong with it: nothing has changed.
    pub fn judge(&mut self, client: u64, id: u64, text: &str) -> Result<TakenLine, Refusal> {
        let begins = self.prepare_line()?;
        let number = self.count + 1;
        let first_block = self.ahead.next_block();
        let judged = self.judge.judge(&self.ahead, number, text)?;
        self.jogs = false;
        self.take(client, id, first_block, judged, begins)
    }

    /// Whether a line calls a subroutine, whose file is read when it is judged.
    pub fn calls(&self, text: &str) -> bool {
        self.ahead.calls(text.as_bytes())
    }

    /// Who judges lines that read files.
    pub fn files(&self) -> Arc<Mutex<LineJudge>> {
        Arc::clone(&self.files)
    }

    /// Begins to judge a line that reads files: [`Call::judge`] goes on when nobody holds the lines.
    ///
    /// # Errors
    /// No line can be taken now.
    pub fn begin_call(&mut self) -> Result<Call, Refusal> {
        self.prepare_line()?;
        Ok(Call {
            before: self.ahead.clone(),
            number: self.count + 1,
            turn: self.turn,
        })
    }

    /// Takes a line that was judged by `call`; none where it is to be judged anew, behind what has come meanwhile.
    pub fn end_call(
        &mut self,
        (client, id): (u64, u64),
        call: &Call,
        judged: JudgedLine,
    ) -> Option<Result<TakenLine, Refusal>> {
        if self.turn != call.turn {
            return None;
        }
        let begins = !self.is_at_work();
        let first_block = call.before.next_block();
        self.jogs = false;
        Some(self.take(client, id, first_block, judged, begins))
    }

    /// A call judged where nothing is driven: what is true behind it.
    ///
    /// # Errors
    /// What is wrong with it.
    pub fn check_call(
        files: &Mutex<LineJudge>,
        before: &Interpreter,
        text: &str,
    ) -> Result<Interpreter, Refusal> {
        let judge = files.lock().unwrap_or_else(PoisonError::into_inner);
        checked(&judge, before, text)
    }

    /// Sees to it that a line that is no jog can be judged; whether a job is to begin for it.
    fn prepare_line(&mut self) -> Result<bool, Refusal> {
        if self.asks {
            let why =
                "the line before waits for an input or a probe: send this one when it is driven";
            return Err(Refusal::of("waits", why));
        }
        if self.jogs && self.is_at_work() {
            return Err(Refusal::of("jogs", "the machine is jogged"));
        }
        self.prepare()
    }

    /// Judges a jog, words as of G1 that hold for themselves alone, and takes it.
    ///
    /// # Errors
    /// What is wrong with it: nothing has changed.
    pub fn judge_jog(
        &mut self,
        client: u64,
        id: u64,
        words: &str,
        allows: impl Fn(&AxisVector, &Block) -> Result<(), Refusal>,
    ) -> Result<TakenLine, Refusal> {
        if !self.jogs && self.is_at_work() {
            return Err(Refusal::of(
                "not-idle",
                "lines are driven, which are no jogs",
            ));
        }
        let begins = self.prepare()?;
        let mut before = self.ahead.clone();
        before.keep_state_tags();
        let modes = before.state_tag_since(&mut None);
        let first_block = before.next_block();
        let text = format!("G94 G1 {words}");
        let mut judged = self.judge.judge(&before, self.count + 1, &text)?;
        let mut at = before.position();
        for item in &judged.items {
            if let Item::Block(block, _) = item {
                allows(&at, block)?;
                at = block.end;
            }
        }
        if let Some(modes) = modes {
            judged.behind.take_up(modes);
        }
        self.jogs = true;
        self.take(client, id, first_block, judged, begins)
    }

    /// Sees to it that a line can be judged; whether a job is to begin for it.
    fn prepare(&mut self) -> Result<bool, Refusal> {
        if self.waiting.len() >= MAX_WAITING {
            let why =
                format!("{MAX_WAITING} lines wait already: send this one when they are driven");
            return Err(Refusal::of("waits", why));
        }
        let begins = !self.is_at_work();
        if begins {
            self.ahead = self.standing.clone();
            self.ahead.number_anew();
            self.ahead.keep_state_tags();
            self.count = 0;
            self.told = None;
        }
        Ok(begins)
    }

    #[allow(clippy::unnecessary_wraps, reason = "both ways of judging end with it")]
    fn take(
        &mut self,
        client: u64,
        id: u64,
        first_block: u64,
        judged: JudgedLine,
        begins: bool,
    ) -> Result<TakenLine, Refusal> {
        self.turn += 1;
        let JudgedLine {
            behind: mut tried,
            items,
            ends,
        } = judged;
        let rests = items.iter().any(rests) || only_rests(&items);
        let asks_probe = items.iter().any(Item::is_probe);
        if ends {
            tried.reset_modes();
        }
        self.asks = items
            .iter()
            .any(|item| matches!(item, Item::Wait(_)) || item.is_probe());
        if let Some(tag) = tried.state_tag_since(&mut self.told) {
            self.state_tags.push(first_block, tag);
        }
        self.ahead = tried;
        self.count += 1;
        self.judged.push_back(Judged {
            client,
            id,
            behind: self.ahead.next_block(),
        });
        self.waiting.push_back(items);
        Ok(TakenLine {
            begins,
            rests,
            asks_probe,
            ends,
        })
    }

    /// Takes up the one line that waits, where it drives and switches nothing and nothing is driven: no job is to begin for it.
    pub fn take_up_at_rest(&mut self) -> bool {
        let is_empty = self.waiting.front().is_some_and(Vec::is_empty);
        let alone = !self.driving && self.waiting.len() == 1 && is_empty;
        if alone {
            self.waiting.clear();
            self.judged.clear();
            self.state_tags.reach_all();
            self.settle();
        }
        alone
    }

    /// What begins a job for lines that wait.
    pub fn next_order(&self) -> Option<Order> {
        let order = if self.jogs {
            Order::JogLines
        } else {
            Order::Mdi
        };
        (!self.waiting.is_empty()).then_some(order)
    }

    /// The path has begun `block`: lines that are driven by now.
    pub fn reach(&mut self, block: u64) -> Vec<Judged> {
        self.state_tags.reach(block);
        let driven = self
            .judged
            .iter()
            .take_while(|line| line.behind <= block)
            .count();
        self.judged.drain(..driven).collect()
    }

    /// Takes up what the path has reached since; whether that is anything.
    pub fn settle(&mut self) -> bool {
        let reached = self.state_tags.take();
        let is_any = reached.is_some();
        if let Some(tag) = reached {
            self.standing.take_up(tag);
        }
        is_any
    }

    /// The job is over, and the machine stands at `position`; `whole` where all that was read is driven, and `ended` where a
    /// program has come to its end, behind which modes are as at the start. What is on was `switched_off` otherwise. The answer
    /// are the lines that are over: driven where whole, else not.
    pub fn end_job(
        &mut self,
        position: AxisVector,
        whole: bool,
        ended: bool,
        switched_off: bool,
    ) -> Vec<Judged> {
        self.turn += 1;
        let goes_on = whole && !self.waiting.is_empty();
        if whole && !goes_on {
            self.state_tags.reach_all();
        } else if !whole {
            self.state_tags.forget();
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
        self.open = false;
        self.driving = false;
        self.stands.moves();
        self.asks &= goes_on;
        if goes_on {
            return self.judged.drain(..self.count_taken()).collect();
        }
        self.ahead = self.standing.clone();
        self.judged.drain(..).collect()
    }
}

/// Judges a line and drives nothing.
fn checked(judge: &LineJudge, before: &Interpreter, text: &str) -> Result<Interpreter, Refusal> {
    let JudgedLine {
        mut behind, items, ..
    } = judge.judge(before, 1, text)?;
    if items.iter().any(Item::is_probe) {
        // Nobody answers: the probe is taken to end where it is programmed to.
        let rest = behind.position();
        behind.provide_probe(&ProbeResult {
            touched: None,
            rest,
        });
    }
    Ok(behind)
}

/// The lines as the rough loop pulls them.
pub struct LineSource(pub SharedLines);

impl LineSource {
    /// A job takes lines from here on.
    pub fn begin(lines: &SharedLines) -> Self {
        let mut inner = lock(lines);
        inner.open = true;
        inner.driving = true;
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
        inner.turn += 1;
        // It is true now, and lasts behind the job.
        inner.standing.provide_input(value);
        inner.ahead.provide_input(value);
        inner.asks = false;
    }

    fn provide_rest(&mut self, rest: &Rest) -> bool {
        let mut inner = lock(&self.0);
        inner.turn += 1;
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
                inner.probed = Some(Probed {
                    position: rest.latch.unwrap_or(rest.position),
                    touched: rest.cause == RestCause::Edge,
                });
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
