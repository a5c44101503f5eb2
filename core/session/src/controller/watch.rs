//! Who sees what a job does.

use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::atomic::Ordering::Relaxed;

use serde_json::json;
use tandem_host::{Clock, RunObserver, StopAnswer};
use tandem_rings::{MachineState, Rest, RestCause, Sample};
use tandem_sdk::{AxisVector, Block, BlockReport, Curve, Event};
use tandem_state::Driven;

use super::dispatcher::{Dispatcher, Mode};
use super::lines::lock;
use super::record::Recording;
use super::script::{Script, Tell};
use crate::jog::{JogController, JogInput, JogRest};

/// Takes notes only.
pub struct Notes<'a>(pub Tell<'a>);

impl RunObserver for Notes<'_> {
    fn note(&mut self, note: &str) {
        (self.0)(note);
    }
}

/// Sees what a job does, for the dispatcher; in lockstep it says what the script says.
pub struct Watch<'a> {
    dispatcher: &'a Arc<Dispatcher>,
    script: &'a mut Script,
    tell: Tell<'a>,
    mode: Mode,
    clock: Clock,
    length_mm: f64,
    driven_mm: f64,
    block: Option<u64>,
    /// The block that the path has begun, as far as lines were told of it.
    reached: Option<u64>,
    /// The last sample was of a machine that runs.
    ran: bool,
    /// Ends of the blocks that are planned and not driven.
    ends_of: VecDeque<(u64, AxisVector)>,
    /// Where the last sample was, for those who draw the path.
    place: Option<AxisVector>,
    /// The line that is driven, where it is another one than was told, and the epoch.
    line: Option<u32>,
    epoch: u64,
    /// What is driven has this number and hash.
    journal: Option<(u64, String)>,
    /// What the job leaves behind.
    pub recording: Option<Recording>,
    tick: u64,
    ends: bool,
}

impl<'a> Watch<'a> {
    pub fn new(
        dispatcher: &'a Arc<Dispatcher>,
        script: &'a mut Script,
        tell: Tell<'a>,
        mode: Mode,
        clock: Clock,
        length_mm: f64,
    ) -> Self {
        Self {
            dispatcher,
            script,
            tell,
            mode,
            clock,
            length_mm,
            driven_mm: 0.0,
            block: None,
            reached: None,
            ran: false,
            ends_of: VecDeque::new(),
            place: None,
            line: None,
            epoch: 0,
            journal: dispatcher.journal(),
            recording: None,
            tick: 0,
            ends: false,
        }
    }
}

impl RunObserver for Watch<'_> {
    fn note(&mut self, note: &str) {
        (self.tell)(note);
    }

    fn program_stop(&mut self, line: u32) -> StopAnswer {
        let hub = &self.dispatcher.hub;
        if hub.waits_on_line().is_none() {
            hub.begin_wait(line);
            self.dispatcher
                .send(None, &json!({ "event": "waits", "line": line }));
            return StopAnswer::Wait;
        }
        if hub.answered() {
            StopAnswer::GoOn
        } else {
            StopAnswer::Wait
        }
    }

    fn is_attended(&self) -> bool {
        self.clock == Clock::Wall || !self.script.is_over()
    }

    fn rest(&mut self, rest: &Rest) {
        self.epoch = u64::from(rest.epoch) + 1;
        self.dispatcher.hub.end_wait();
        if self.mode == Mode::Jog && rest.cause == RestCause::Abort {
            // It is let go; else it would be at every rest again.
            let jog = &self.dispatcher.hub.controls().jog;
            jog.let_go.store(false, Relaxed);
        }
    }

    fn block(&mut self, block: &Block, curve: Option<Curve<'_>>, report: &BlockReport) {
        if let Some(recording) = &mut self.recording {
            recording.block(block, report);
        }
        self.ends_of.push_back((block.index, block.end));
        if self.mode != Mode::Program {
            self.dispatcher.path().block(block, curve);
        }
    }

    fn event(&mut self, event: &Event) {
        if let Some(recording) = &mut self.recording {
            recording.event(event);
        }
    }

    fn sample(&mut self, sample: &Sample, _deviation_mm: f64, signals: &[f64]) {
        if let Some(recording) = &mut self.recording {
            recording.sample(sample, signals);
        }
        self.driven_mm += sample.feed_mm_per_s * self.dispatcher.machine.fine_period_s;
        let share = if self.length_mm > 0.0 {
            (self.driven_mm / self.length_mm).min(1.0)
        } else {
            0.0
        };
        self.dispatcher.hub.sample(sample, share);
        self.dispatcher.scope().sample(sample, signals);
        self.place = Some(sample.command);
        if sample.line != 0 {
            self.line = Some(sample.line);
        }
        let is_next = self.block != Some(sample.block);
        if is_next {
            while self
                .ends_of
                .front()
                .is_some_and(|(at, _)| *at < sample.block)
            {
                self.ends_of.pop_front();
            }
        }
        let mut seen = self.dispatcher.seen();
        if is_next {
            let end = self.ends_of.front().filter(|(at, _)| *at == sample.block);
            seen.block = sample.block;
            seen.end = end.map(|(_, end)| *end);
        }
        seen.switched = sample.switched;
        drop(seen);
        // A machine that stands at the first block has not begun it; what stops it there (M0) holds it from the second period on.
        let runs = sample.state == MachineState::Running;
        let has_begun = sample.block > 0 || runs && (self.ran || sample.feed_mm_per_s > 0.0);
        self.ran = runs;
        let reaches = has_begun && self.reached != Some(sample.block);
        if reaches && matches!(self.mode, Mode::Program | Mode::Mdi) {
            self.reached = Some(sample.block);
            let driven = lock(&self.dispatcher.lines).reach(sample.block);
            self.dispatcher.tell_driven(&driven, true);
        }
        self.block = Some(sample.block);
    }

    fn broken_record(&mut self) -> Option<String> {
        self.recording.as_mut()?.broken()
    }

    fn period(&mut self) {
        if let Some(recording) = &mut self.recording {
            recording.period();
        }
        if self.dispatcher.is_over() && !self.ends && self.mode != Mode::Idle {
            self.ends = true;
            self.dispatcher.hub.controls().abort.store(true, Relaxed);
        }
        if let Some(place) = self.place.take() {
            self.dispatcher.path().drive(&place);
        }
        if let (Some(line), Some((job, hash))) = (self.line.take(), &self.journal) {
            self.dispatcher.persistence.driven(Driven {
                job: *job,
                hash: hash.clone(),
                line,
                epoch: self.epoch,
            });
        }
        if self.mode != Mode::Idle {
            self.dispatcher.keep_reached();
        }
        self.dispatcher.send_scope(false);
        self.dispatcher.tell_state();
        self.script
            .flush(self.dispatcher, self.tick, self.clock, self.tell);
    }

    fn before_tick(&mut self, uptime_periods: u64) {
        self.tick = uptime_periods;
        let at_s = uptime_periods as f64 * self.dispatcher.machine.fine_period_s;
        self.dispatcher.set_replay_time(at_s);
        self.script
            .say_due(self.dispatcher, uptime_periods, self.tell);
    }
}

/// Tells everybody of jogs that could not begin.
pub struct Refusals(pub Arc<Dispatcher>);

impl JogInput for Refusals {
    fn period(&mut self, _jogs: &JogController) {}

    fn is_waiting(&self) -> bool {
        false
    }

    fn rested(&mut self, _jogs: &JogController, _rest: &JogRest) {}

    fn refused(&mut self, why: &str) {
        self.0.tell_refused("jogging", why);
    }
}
