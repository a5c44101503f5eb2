//! One run of one program on one machine.
//!
//! # The first and the last sample
//!
//! Tick 0 is the rest before motion. Motion starts when the drives hold and enough is queued; fine periods before that
//! are neither counted nor recorded, so that a trace does not depend on how long drives and ring took. The end of the
//! program is an event in the ring; the period that reaches it ends the record. A trace therefore has the same rows on
//! both clocks.

pub mod job;
mod squaring;
mod summarise;

use std::sync::Arc;
use std::sync::atomic::Ordering::Relaxed;
use std::time::Instant;

use tandem_fine::{Fault, FineLoop, Left};
use tandem_gcode::{CheckReport, Program};
use tandem_machine::Machine;
use tandem_recorder::{LatenessUs, PageFaults, Summary};
use tandem_rings::{Controls, Status, Switched};
use tandem_rough::Source;
use tandem_sdk::{AxisVector, Driver, PluginError};

use crate::clock::exchange_time::{self, ExchangeTimes};
use crate::clock::periods::Timing;
use crate::clock::virtual_clock;
use crate::clock::wall_clock;
use crate::clock::wall_clock::Periods;
use crate::drives::{NoDriver, Roster};
use crate::error::HostError;
use crate::plugins::hang::HangWatch;
use crate::plugins::plugin_log::drain_plugin_log;
use crate::plugins::registry::Registry;
use crate::setup::claim::Claim;
use crate::setup::parts;
use crate::setup::ready::Ready;
use crate::setup::rules;
use crate::soft::command::Timed;
use crate::soft::soft_loop::RunObserver;
use crate::switches::{Clock, Lead, Switches};
use job::{Job, JobParts};
use squaring::{Squared, Squaring};

/// A run that is ready: the program is checked, the plugins are open, nothing has moved.
pub struct Run {
    job: Job,
    fine: Box<FineLoop>,
    /// What homes first, and has the drives until then, where a gantry squares itself.
    squaring: Option<Squaring>,
    exchange: Arc<ExchangeTimes>,
    watch: Option<HangWatch>,
    clock: Clock,
    /// Bit per axis of which the drives did not know where it is when they were attached.
    unknown_axes: u32,
    /// What the first pass found: totals.
    pub checked: CheckReport,
}

/// What a run did.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// Everything as numbers.
    pub summary: Summary,
    /// The fault that ended it.
    pub fault: Option<Fault>,
    /// Where the machine came to rest, mm or rad.
    pub position: AxisVector,
    /// What was switched last.
    pub left: Left,
}

impl Run {
    /// Checks the whole program and opens the plugins.
    ///
    /// # Errors
    /// Everything that refuses: the program's errors, plugins, what does not go together.
    pub fn prepare(
        machine: Machine,
        registry: &Registry,
        program: Program,
        switches: Switches,
    ) -> Result<Self, HostError> {
        let ready = Ready::of_program(machine, registry, program, switches, true)?;
        Self::open(ready, registry)
    }

    /// A run of what `source` gives, which sees to it that every block is one that the planner takes.
    ///
    /// # Errors
    /// Everything that refuses: plugins, what does not go together.
    pub fn of_source(
        machine: Machine,
        registry: &Registry,
        name: String,
        source: Box<dyn Source + Send>,
        switches: Switches,
    ) -> Result<Self, HostError> {
        let behind = |machine: &Machine| parts::behind_homing(machine, source, switches);
        let ready = Ready::of_source(machine, registry, Some(name), behind, switches)?;
        Self::open(ready, registry)
    }

    /// A run that homes the axes of [`Machine::homing`], which `homing` does, and nothing else. Its samples are in the coordinates of the
    /// drives, which homing does not change.
    ///
    /// # Errors
    /// Everything that refuses: plugins, what does not go together.
    pub fn home(
        machine: Machine,
        registry: &Registry,
        homing: Lead,
        switches: Switches,
    ) -> Result<Self, HostError> {
        // What it does not home stays as unknown as it is: nothing else moves.
        let switches = Switches {
            home: Some(homing),
            unhomed: true,
            ..switches
        };
        let alone = |machine: &Machine| homing(machine, None);
        Self::open(
            Ready::of_source(machine, registry, None, alone, switches)?,
            registry,
        )
    }

    /// Makes the loops around drives that are claimed.
    fn open(mut ready: Ready, registry: &Registry) -> Result<Self, HostError> {
        let elsewhere = Claim::elsewhere(ready.claim.roster());
        let claim = std::mem::replace(&mut ready.claim, elsewhere);
        let watch = ready.watch.take();
        let Some((driver, attached)) = claim.into_parts() else {
            return Err(HostError::System("the drives are not claimed".to_string()));
        };
        let exchange = Arc::new(ExchangeTimes::default());
        let driver = Box::new(exchange_time::Timed::new(
            driver,
            ready.machine.fine_period_s,
            Arc::clone(&exchange),
        ));
        let shared: (Arc<Controls>, Arc<Status>) = (Arc::default(), Arc::default());
        // What homes one joint of a gantry after the other is on the machine itself, whose joints are its axes there.
        let squares = ready.machine.squares() && !ready.joints.are_axes();
        let homing = ready.switches.home.filter(|_| squares);
        let mut driver: Box<dyn Driver> = driver;
        let mut squaring = None;
        if let Some(homing) = homing {
            let machine = &ready.machine;
            let roster = ready.claim.roster();
            squaring = Some(Squaring::of(
                machine,
                registry,
                (homing, ready.switches),
                (driver, &attached, &roster),
                shared.clone(),
            )?);
            driver = Box::new(NoDriver);
        }
        let parts = JobParts::of(ready, &attached, false, shared);
        let mut fine = Box::new(FineLoop::new(
            &parts.config,
            parts.end,
            driver,
            parts.kinematics,
        ));
        fine.reset();
        let job = parts.job;
        let simulated = job.roster.describe().simulated != 0;
        Ok(Self {
            watch,
            fine,
            squaring,
            clock: job.switches.clock.unwrap_or(if simulated {
                Clock::Virtual
            } else {
                Clock::Wall
            }),
            unknown_axes: job.joints.axes_moved_by(!(attached.known | attached.homed)),
            exchange,
            checked: job.checked.clone(),
            job,
        })
    }

    /// What is on when the run begins: what the run before it in a session has left. Host, before it is driven.
    pub fn begin_switched(&mut self, switched: &Switched) {
        let first = self.squaring.as_mut().map(|squaring| &mut squaring.fine);
        first.unwrap_or(&mut self.fine).begin_switched(switched);
    }

    /// The operator's end of the run, to give commands from other threads.
    pub fn controls(&self) -> Arc<Controls> {
        Arc::clone(&self.job.host.controls)
    }

    /// The fine loop's status, to look at from other threads.
    pub fn status(&self) -> Arc<Status> {
        Arc::clone(&self.job.host.status)
    }

    /// The clock that was asked for, or else the one that the driver goes with: real drives live in real time.
    pub fn clock(&self) -> Clock {
        self.clock
    }

    /// Bit per axis of which the drives did not know where it is when they were attached.
    pub fn unknown_axes(&self) -> u32 {
        self.unknown_axes
    }

    /// The machine as what homes it in front of the run sees it: the joints of a gantry that squares itself are axes there.
    pub fn homed(&self) -> &Machine {
        let squaring = self.squaring.as_ref();
        squaring.map_or(&self.job.machine, Squaring::machine)
    }

    /// Whether the planner makes use of velocity steps where blocks meet.
    pub fn allows_steps(&self) -> bool {
        self.job.allows_steps()
    }

    /// Whether the planner drives each block with the time constant that it states.
    pub fn uses_time_constants(&self) -> bool {
        self.job.uses_time_constants
    }

    /// Names of the feed strategy's signals, and after them those of the analog inputs.
    pub fn signals(&self) -> Vec<String> {
        self.job.signals()
    }

    /// Drives the run to its end. `commands` are given on the virtual clock at their ticks.
    ///
    /// # Errors
    /// The computer refuses: a thread cannot be started. Real drives are refused on the virtual clock.
    pub fn drive(
        self,
        clock: Clock,
        commands: &[Timed],
        observer: &mut dyn RunObserver,
    ) -> Result<Outcome, HostError> {
        let started = Instant::now();
        if let Err(refused) = begin(&self.job.machine, &self.job.roster, clock) {
            let squaring = self.squaring.map(|squaring| squaring.fine);
            let first = squaring.unwrap_or(*self.fine);
            let _ = first.into_driver().stop();
            return Err(refused);
        }
        if let Some(watch) = &self.watch {
            watch.begin(self.controls(), self.status());
        }
        self.exchange.measures.store(clock == Clock::Wall, Relaxed);
        let joints = Arc::clone(&self.job.joints);
        let mut job = self.job;
        let mut fine = self.fine;
        let periods = periods(&job.machine);
        let watch = self.watch.as_ref().map(HangWatch::for_fine);
        let first = match (self.squaring, clock) {
            (None, _) => Squared::Here(fine),
            (Some(squaring), Clock::Virtual) => squaring.in_lockstep(fine, observer),
            (Some(squaring), Clock::Wall) => {
                wall_clock::give_room(&mut job.host, &mut fine);
                squaring.in_real_time(fine, periods, watch.clone(), observer)?
            }
        };
        let (mut soft_loop, conclusion) = job.begin(clock, observer);
        let mut measured = None;
        let mut words = None;
        let fine = match (first, clock) {
            (Squared::Here(mut fine), Clock::Virtual) => {
                let per_rough = conclusion.machine.fine_periods_per_rough;
                virtual_clock::drive(&mut soft_loop, &mut fine, per_rough, commands);
                fine
            }
            (Squared::Here(fine), Clock::Wall) => {
                let timed = wall_clock::drive(&mut soft_loop, fine, periods, watch)?;
                measured = Some((timed.timing, timed.page_faults));
                timed.body
            }
            (Squared::Thread(thread), _) => {
                let timed = squaring::follow(&mut soft_loop, thread, periods)?;
                measured = Some((timed.timing, timed.page_faults));
                timed.body.running.fine
            }
            (Squared::Failed(fine, why), _) => {
                words = Some(why);
                fine
            }
        };
        let fault = fine.fault();
        let mut summary = conclusion.summary(&mut soft_loop, &fine.counters());
        tell_times(&mut summary, measured.as_ref(), &self.exchange);
        let late = summary.late_cause();
        summary.fault = fault.map(|fault| {
            words.unwrap_or_else(|| {
                conclusion.words(&fault, &fine, soft_loop.soft_cause(), late.as_deref())
            })
        });
        // Who homes first in the next run as well begins where the drives are, whatever the axes were called.
        let position = if conclusion.switches.home.is_some() && !joints.are_axes() {
            joints.to_axes(&fine.told_to_joints())
        } else if conclusion.switches.home.is_some() || fine.joints_went_alone() {
            fine.sent()
        } else {
            soft_loop.monitor.position
        };
        let left = fine.left();
        let stopped = fine.into_driver().stop();
        drop(soft_loop);
        if let Err(error) = stopped {
            not_let_go(&conclusion.roster, &error, &mut summary, observer);
        }
        // What plugins say when they are stopped and dropped.
        drain_plugin_log(&mut |line| observer.note(line));
        summary.wall_time_s = started.elapsed().as_secs_f64();
        Ok(Outcome {
            summary,
            fault,
            position,
            left,
        })
    }
}

/// Whether the drivers go with this clock; slow ones get their threads.
pub fn begin(machine: &Machine, roster: &Roster, clock: Clock) -> Result<(), HostError> {
    match (clock, roster.real()) {
        (Clock::Virtual, Some(real)) => Err(rules::refuse_virtual(machine, real)),
        (Clock::Virtual, None) => Ok(()),
        (Clock::Wall, _) => {
            let begun = roster.begin_threads();
            begun
                .map_err(|error| HostError::System(format!("a slow driver has no thread: {error}")))
        }
    }
}

/// What was `measured` in real time, where it was.
fn tell_times(
    summary: &mut Summary,
    measured: Option<&(Timing, PageFaults)>,
    exchange: &ExchangeTimes,
) {
    let Some((timing, page_faults)) = measured else {
        return;
    };
    summary.overruns = timing.overruns;
    summary.lateness_us = Some(LatenessUs::from(&timing.lateness));
    summary.page_faults = Some(*page_faults);
    summary.exchange_us = Some(exchange.read());
}

/// The driver could not release the drives: that is the fault of a run that has no other, and is told beside any other.
fn not_let_go(
    roster: &Roster,
    error: &PluginError,
    summary: &mut Summary,
    observer: &mut dyn RunObserver,
) {
    let words = format!(
        "driver {}: the drives were not let go of: {error}",
        roster.titles()
    );
    match &summary.fault {
        None => summary.fault = Some(words),
        Some(_) => observer.note(&format!("error: {words}")),
    }
}

/// The periods of both loops.
pub fn periods(machine: &Machine) -> Periods {
    let ns = |seconds: f64| (seconds * 1e9).round() as i64;
    Periods {
        rough_ns: ns(machine.rough_period_s),
        fine_ns: ns(machine.fine_period_s),
        fine_thread: machine.fine_thread,
    }
}
