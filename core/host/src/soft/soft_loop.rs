//! The soft side of one run: rough loop, strategy, recorder, in the order that both clocks share.

use std::sync::atomic::Ordering::Relaxed;
use std::time::Instant;

use tandem_machine::RecordErrorMode;
use tandem_recorder::{Lateness, Monitor, PolicySummary};
use tandem_rings::{HostEnd, OperatorInputs, Rest, RestCause, Sample};
use tandem_rough::{Observer, RoughLoop};
use tandem_sdk::{Block, BlockReport, Curve, Event, MAX_SIGNALS};

use crate::plugins::plugin_log::drain_plugin_log;
use crate::policy::Reloader;
use crate::soft::command::{Command, Timed};
use crate::soft::command_log::CommandLog;
use crate::soft::strategy::FeedRunner;
use crate::soft::waits::Waits;

/// What is to happen where the program waits at rest for the operator.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StopAnswer {
    /// It goes on.
    GoOn,
    /// No answer yet: the loops keep running, and the question comes again after a rough period.
    Wait,
    /// There is nobody to answer: the run ends.
    Nobody,
}

/// Is told of everything that happens in a run, on the soft side.
pub trait RunObserver {
    /// The computer did not grant something that the wall clock asks for.
    fn note(&mut self, _note: &str) {}

    /// A block is planned for good, along `curve` where it is a NURBS.
    fn block(&mut self, _block: &Block, _curve: Option<Curve<'_>>, _report: &BlockReport) {}

    /// A non-motion word is planned.
    fn event(&mut self, _event: &Event) {}

    /// The program waits at rest on `line` for the operator. On the virtual clock machine time stands still until this
    /// returns; on the wall clock nothing is planned or recorded meanwhile, so that a long wait is a [`StopAnswer::Wait`].
    fn program_stop(&mut self, _line: u32) -> StopAnswer {
        StopAnswer::GoOn
    }

    /// Whether somebody may still give commands: on the virtual clock a machine that stands then waits in real time.
    fn is_attended(&self) -> bool {
        false
    }

    /// A rough period is over, on a machine that stays.
    fn period(&mut self) {}

    /// In lockstep on a machine that stays: the fine period of this number, counted from its attachment, follows.
    fn before_tick(&mut self, _uptime_periods: u64) {}

    /// The machine came to a rest that ends an epoch: a probe touched, or the operator aborted.
    fn rest(&mut self, _rest: &Rest) {}

    /// A command of the operator, or of the command file, acts in its tick; told before the sample of that tick.
    fn command(&mut self, _command: &Timed) {}

    /// What the policy script did until now: told now and then, and where there is a note on it.
    fn policy(&mut self, _summary: &PolicySummary) {}

    /// A file that the observer writes cannot be written any further, in words; told once. The motion does what
    /// `[recorder]` of the machine file says.
    fn broken_record(&mut self) -> Option<String> {
        None
    }

    /// Whether the distance from the path is to be exact in each sample, and not only where it is the largest so far: looking for the
    /// nearest block takes its time.
    fn needs_each_deviation(&self) -> bool {
        false
    }

    /// A sample was sent, `deviation_mm` off the programmed path; `signals` are the strategy's last values.
    fn sample(&mut self, _sample: &Sample, _deviation_mm: f64, _signals: &[f64]) {}
}

impl RunObserver for () {}

/// Rough loop, strategy and recorder.
pub struct SoftLoop<'a> {
    rough: RoughLoop,
    pub host: HostEnd,
    feed: Option<FeedRunner>,
    reloader: Option<Reloader>,
    pub monitor: Monitor,
    observer: &'a mut dyn RunObserver,
    /// The defect on the soft side that ends the run, in words.
    soft_error: Option<String>,
    /// The rest of the operator's abort.
    pub aborted: Option<Rest>,
    /// Moves of homing, which have no program line, are neither counted nor recorded.
    pub skips_homing: bool,
    /// The planner's name, or the file that it came from: for a fault's words.
    pub planner: String,
    /// Numbers of the analog inputs that have a name.
    pub analog: Vec<usize>,
    /// What the machine waits for before it moves.
    pub waits: Option<Waits>,
    /// What a file that cannot be written any further does to the motion.
    pub on_record_error: RecordErrorMode,
    commands: CommandLog,
    /// Time of each rough period, and of all of them, ns.
    pub planning: Lateness,
    pub planning_ns: u128,
    /// Rough periods since the observer was told of the policy.
    untold: u32,
}

/// Rough periods between two reports of what the policy did.
const TOLD_EVERY: u32 = 32;

impl<'a> SoftLoop<'a> {
    pub fn new(
        rough: RoughLoop,
        host: HostEnd,
        feed: Option<FeedRunner>,
        reloader: Option<Reloader>,
        monitor: Monitor,
        observer: &'a mut dyn RunObserver,
    ) -> Self {
        let commands = CommandLog::new(OperatorInputs::of(&host.controls));
        Self {
            rough,
            host,
            feed,
            reloader,
            monitor,
            observer,
            soft_error: None,
            aborted: None,
            skips_homing: false,
            planner: String::new(),
            analog: vec![],
            waits: None,
            on_record_error: RecordErrorMode::default(),
            commands,
            planning: Lateness::new(),
            planning_ns: 0,
            untold: TOLD_EVERY,
        }
    }

    /// One rough period.
    pub fn step(&mut self) {
        if self.soft_error.is_some() {
            return;
        }
        let started = Instant::now();
        tandem_sdk::abi::beat();
        self.serve_policy();
        self.tell_plugin_log();
        self.tell_waits();
        let (rough, mut tee) = self.with_tee();
        if let Err(error) = rough.step(&mut tee) {
            let words = error.with_planner(&self.planner);
            self.fail(words);
        }
        let taken_ns = started.elapsed().as_nanos();
        self.planning.record_many(taken_ns as u64, 1);
        self.planning_ns += taken_ns;
    }

    /// The rough loop, and who looks at what it does.
    fn with_tee(&mut self) -> (&mut RoughLoop, Tee<'_>) {
        let aborted = &mut self.aborted;
        let skips_homing = self.skips_homing;
        (
            &mut self.rough,
            Tee {
                monitor: &mut self.monitor,
                observer: self.observer,
                aborted,
                skips_homing,
            },
        )
    }

    /// Takes the rests that have been reported, where no rough period follows to do it: the machine may be over.
    pub fn take_rests(&mut self) {
        let (rough, mut tee) = self.with_tee();
        if let Err(error) = rough.take_rests(&mut tee) {
            let words = error.with_planner(&self.planner);
            self.fail(words);
        }
    }

    /// Puts a new policy script in place, if there is one.
    fn serve_policy(&mut self) {
        let asked = self.host.controls.reload_policy.swap(false, Relaxed);
        let Some(reloader) = &self.reloader else {
            return;
        };
        reloader.serve(asked);
        self.tell_policy_notes();
    }

    /// Tells what the policy script did since the last time.
    pub fn tell_policy_notes(&mut self) {
        let Some(reloader) = &self.reloader else {
            return;
        };
        let notes = reloader.take_notes();
        for note in &notes {
            self.observer.note(note);
        }
        self.untold = if notes.is_empty() {
            self.untold + 1
        } else {
            TOLD_EVERY
        };
        if self.untold >= TOLD_EVERY {
            self.observer.policy(&reloader.summary());
            self.untold = 0;
        }
    }

    /// Tells what plugins have written to the log.
    pub fn tell_plugin_log(&mut self) {
        drain_plugin_log(&mut |line| self.observer.note(line));
    }

    /// Tells what the machine waits for, where that takes long enough for somebody to wonder.
    fn tell_waits(&mut self) {
        if let Some(note) = self.waits.as_mut().and_then(|waits| waits.look(&self.host)) {
            self.observer.note(&note);
        }
    }

    /// Tells the observer that a rough period is over.
    pub fn period(&mut self) {
        self.observer.period();
    }

    /// Tells the observer which fine period follows.
    pub fn before_tick(&mut self, uptime_periods: u64) {
        self.observer.before_tick(uptime_periods);
    }

    /// Passes a note on to the observer.
    pub fn note(&mut self, note: &str) {
        self.observer.note(note);
    }

    /// Gives a command of the command file to the fine loop, or does what it says of the rough loop.
    pub fn give(&mut self, timed: &Timed) {
        timed.command.give(&self.host.controls);
        if matches!(
            timed.command,
            Command::StallRough(_) | Command::ReloadPolicy
        ) {
            self.observer.command(timed);
        }
    }

    /// Takes the samples that have come. They are looked at where they lie: a sample is large.
    pub fn drain(&mut self) {
        let HostEnd {
            samples,
            ratios,
            requests,
            ..
        } = &mut self.host;
        let Ok(come) = samples.read_chunk(samples.slots()) else {
            return;
        };
        let (first, second) = come.as_slices();
        let each_deviation = self.observer.needs_each_deviation();
        let mut values = [0.0; MAX_SIGNALS];
        for sample in first.iter().chain(second) {
            if let Some(commands) = self.commands.sample(sample) {
                commands.for_each(|command| self.observer.command(&command));
            }
            let deviation_mm = self.monitor.sample(sample, each_deviation);
            let signals = signals(self.feed.as_ref(), &self.analog, sample, &mut values);
            self.observer.sample(sample, deviation_mm, signals);
            if let (Some(feed), None) = (&mut self.feed, &self.soft_error)
                && let Some(note) = feed.sample(sample, ratios, requests)
            {
                self.observer.note(&note);
            }
        }
        come.commit_all();
        self.serve_broken_record();
    }

    /// Where a file cannot be written any further: the motion goes on, or stops on the path, as the machine file says. Who
    /// is there may resume it; without anybody the run ends at that rest.
    fn serve_broken_record(&mut self) {
        let Some(words) = self.observer.broken_record() else {
            return;
        };
        match self.on_record_error {
            RecordErrorMode::Continue => {
                self.observer.note(
                    "the motion goes on without that file (recorder.on_error = \"continue\")",
                );
            }
            RecordErrorMode::Hold if self.observer.is_attended() => {
                self.host.controls.hold.store(true, Relaxed);
                self.observer.note(
                    "feed hold (recorder.on_error = \"hold\"): a resume goes on without that file",
                );
            }
            RecordErrorMode::Hold => self.fail(format!("recorder: {words}")),
        }
    }

    /// Asks the operator where the program has stopped for one, then goes on.
    pub fn serve_stop(&mut self) {
        let status = &self.host.status;
        let controls = &self.host.controls;
        if controls.program_hold.load(Relaxed) && status.feed_mm_per_s.load() == 0.0 {
            let line = status.line.load(Relaxed);
            match self.observer.program_stop(line) {
                StopAnswer::Wait => return,
                StopAnswer::GoOn => {}
                StopAnswer::Nobody => {
                    self.fail(format!(
                        "line {line}: the program waits for an operator, and there is none"
                    ));
                }
            }
            self.host.controls.program_hold.store(false, Relaxed);
        }
    }

    /// Nothing will move any more, and nothing is left that could change that.
    pub fn give_up(&mut self) {
        self.fail(
            "nothing has moved for a minute of machine time, and no command is left to change that"
                .to_string(),
        );
    }

    /// Whether an operator may still change something.
    pub fn is_attended(&self) -> bool {
        self.observer.is_attended()
    }

    /// Fine period, s.
    pub fn period_s(&self) -> f64 {
        self.monitor.period_s()
    }

    /// Whether the program waits for an input.
    pub fn is_waiting(&self) -> bool {
        self.rough.is_waiting()
    }

    /// Why the soft side stops the machine, in words.
    pub fn soft_cause(&self) -> Option<&str> {
        let of_strategy = || self.feed.as_ref()?.fault.as_deref();
        self.soft_error.as_deref().or_else(of_strategy)
    }

    /// A defect on the soft side: the fine loop stops on the path.
    fn fail(&mut self, cause: String) {
        self.soft_error.get_or_insert(cause);
        self.host.controls.soft_fault.store(true, Relaxed);
    }
}

/// Writes the strategy's last signals, and after them the `analog` inputs that have a name; gives what was written.
#[inline]
fn signals<'a>(
    feed: Option<&FeedRunner>,
    analog: &[usize],
    sample: &Sample,
    values: &'a mut [f64; MAX_SIGNALS],
) -> &'a [f64] {
    let mut own = 0;
    if let Some(feed) = feed {
        own = feed.signals().len();
        *values = feed.answer.map_or([0.0; MAX_SIGNALS], |a| a.signals);
    }
    let count = (own + analog.len()).min(MAX_SIGNALS);
    for (to, from) in values[own..count].iter_mut().zip(analog) {
        *to = sample.analog[*from];
    }
    &values[..count]
}

struct Tee<'a> {
    monitor: &'a mut Monitor,
    observer: &'a mut dyn RunObserver,
    aborted: &'a mut Option<Rest>,
    skips_homing: bool,
}

impl Observer for Tee<'_> {
    fn block(&mut self, block: &Block, curve: Option<Curve<'_>>, report: &BlockReport) {
        if self.skips_homing && block.line == 0 {
            return;
        }
        self.monitor.block(block, curve, report);
        self.observer.block(block, curve, report);
    }

    fn event(&mut self, event: &Event) {
        self.observer.event(event);
    }

    fn rest(&mut self, rest: &Rest) {
        if rest.cause == RestCause::Abort {
            *self.aborted = Some(*rest);
        }
        self.observer.rest(rest);
    }
}
