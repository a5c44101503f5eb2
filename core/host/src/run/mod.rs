//! One run of one program on one machine.
//!
//! # The first and the last sample
//!
//! Tick 0 is the rest before motion. Motion starts when the drives hold and enough is queued; fine periods before that
//! are neither counted nor recorded, so that a trace does not depend on how long drives and ring took. The end of the
//! program is an event in the ring; the period that reaches it ends the record. A trace therefore has the same rows on
//! both clocks.

mod summarise;

use std::sync::Arc;
use std::sync::atomic::Ordering::Relaxed;
use std::time::Instant;

use tandem_fine::{Fault, FineLoop, Left};
use tandem_gcode::{CheckReport, Program};
use tandem_machine::{Analog, Machine};
use tandem_recorder::{LatenessUs, Monitor, PageFaults, Summary};
use tandem_rings::{HostEnd, Sizes, Switched, bridge};
use tandem_rough::{RoughConfig, RoughLoop, Source};
use tandem_sdk::{AxisVector, MAX_AXES, PluginError};

use crate::clock::exchange_time::{self, ExchangeTimes};
use crate::clock::periods::Timing;
use crate::clock::virtual_clock;
use crate::clock::wall_clock;
use crate::clock::wall_clock::Periods;
use crate::drives::Roster;
use crate::error::HostError;
use crate::joints::JointSpace;
use crate::messages::fault_text::{Known, describe};
use crate::plugins::hang::HangWatch;
use crate::plugins::plugin_log::drain_plugin_log;
use crate::plugins::registry::Registry;
use crate::policy::{PolicyHost, Reloader};
use crate::setup::parts;
use crate::setup::ready::Ready;
use crate::setup::rules;
use crate::soft::command::Timed;
use crate::soft::soft_loop::{RunObserver, SoftLoop};
use crate::soft::strategy::FeedRunner;
use crate::soft::waits::Waits;
use crate::switches::{Clock, Lead, Switches};
use summarise::summarise;

/// A run that is ready: the program is checked, the plugins are open, nothing has moved.
pub struct Run {
    machine: Machine,
    program: String,
    rough: RoughLoop,
    fine: FineLoop,
    host: HostEnd,
    feed: Option<FeedRunner>,
    policy: Option<PolicyHost>,
    /// Steps of the velocity that the planner makes use of where blocks meet, per axis, mm/s.
    speed_difference_mm_per_s: [f64; MAX_AXES],
    leaves_path: bool,
    uses_time_constants: bool,
    joints: Arc<JointSpace>,
    exchange: Arc<ExchangeTimes>,
    switches: Switches,
    watch: Option<HangWatch>,
    clock: Clock,
    /// Who is who among the drivers.
    roster: Roster,
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
        Self::open(Ready::of_program(machine, registry, program, switches, true)?)
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
        Self::open(Ready::of_source(machine, registry, Some(name), behind, switches)?)
    }

    /// A run that homes the axes of [`Machine::homing`], which `homing` does, and nothing else. Its samples are in the coordinates of the
    /// drives, which homing does not change.
    ///
    /// # Errors
    /// Everything that refuses: plugins, what does not go together.
    pub fn home(machine: Machine, registry: &Registry, homing: Lead, switches: Switches) -> Result<Self, HostError> {
        // What it does not home stays as unknown as it is: nothing else moves.
        let switches = Switches { home: Some(homing), unhomed: true, ..switches };
        Self::open(Ready::of_source(machine, registry, None, |machine| homing(machine, None), switches)?)
    }

    /// Makes the loops around drives that are claimed.
    fn open(ready: Ready) -> Result<Self, HostError> {
        let Ready { watch, machine, program, source, policy, planner, claim, feed, joints, checked, switches, .. } =
            ready;
        let roster = claim.roster();
        let drives = roster.describe();
        let Some((driver, attached)) = claim.into_parts() else {
            return Err(HostError::System("the drives are not claimed".to_string()));
        };
        let description = planner.describe();
        let depth_s = parts::queue_depth_s(&machine, &joints, description.order);
        let cuts = 2.0 * depth_s / machine.rough_period_s;
        let segments = Sizes::segments_for(ready.entries as f64 + cuts);
        // As lockstep needs it: the samples of each rough period are taken behind it.
        let sizes = Sizes { samples: machine.fine_periods_per_rough as usize, segments };
        let (rough_end, fine_end, host) = bridge(sizes);
        let mut fine_config = parts::fine_config(&machine, &joints, &description, (&drives, &attached), switches);
        fine_config.record_drives = ready.records_drives;
        let unknown_axes = joints.axes_moved_by(!(attached.known | attached.homed));
        host.status.hexadecimal_codes.store(drives.hexadecimal_codes != 0, Relaxed);
        host.controls.optional_stop.store(switches.optional_stop, Relaxed);
        let mut rough_config = RoughConfig::new(machine.rough_period_s, machine.fine_period_s);
        rough_config.advance_s = parts::advance_s(machine.rough_period_s, depth_s, segments);
        rough_config.awaits_drives = true;
        for limits in fine_config.limits.axes() {
            rough_config.count_steps_of(limits.acceleration_mm_per_s2, limits.jerk_mm_per_s3);
        }
        let exchange = Arc::new(ExchangeTimes::default());
        let driver = Box::new(exchange_time::Timed::new(driver, machine.fine_period_s, Arc::clone(&exchange)));
        let mut fine = FineLoop::new(&fine_config, fine_end, driver, ready.kinematics);
        fine.reset();
        Ok(Self {
            watch,
            rough: RoughLoop::new(rough_config, source, planner, rough_end),
            fine,
            machine,
            program,
            host,
            feed,
            policy,
            switches,
            speed_difference_mm_per_s: description.speed_difference_mm_per_s,
            leaves_path: description.leaves_path != 0,
            uses_time_constants: description.uses_time_constants != 0,
            joints,
            exchange,
            checked,
            clock: switches.clock.unwrap_or(if drives.simulated == 0 { Clock::Wall } else { Clock::Virtual }),
            roster,
            unknown_axes,
        })
    }

    /// What is on when the run begins: what the run before it in a session has left. Host, before it is driven.
    pub fn begin_switched(&mut self, switched: &Switched) {
        self.fine.begin_switched(switched);
    }

    /// The operator's end of the run, to give commands from other threads.
    pub fn controls(&self) -> Arc<tandem_rings::Controls> {
        Arc::clone(&self.host.controls)
    }

    /// The fine loop's status, to look at from other threads.
    pub fn status(&self) -> Arc<tandem_rings::Status> {
        Arc::clone(&self.host.status)
    }

    /// The clock that was asked for, or else the one that the driver goes with: real drives live in real time.
    pub fn clock(&self) -> Clock {
        self.clock
    }

    /// Bit per axis of which the drives did not know where it is when they were attached.
    pub fn unknown_axes(&self) -> u32 {
        self.unknown_axes
    }

    /// Whether the planner makes use of velocity steps where blocks meet.
    pub fn allows_steps(&self) -> bool {
        self.speed_difference_mm_per_s.iter().any(|step| *step > 0.0)
    }

    /// Whether the planner drives each block with the time constant that it states.
    pub fn uses_time_constants(&self) -> bool {
        self.uses_time_constants
    }

    /// Names of the feed strategy's signals, and after them those of the analog inputs.
    pub fn signals(&self) -> Vec<String> {
        let own = self.feed.as_ref().map_or(&[][..], FeedRunner::signals);
        own.iter().map(|name| (*name).to_string()).chain(self.machine.analog.iter().map(Analog::signal)).collect()
    }

    /// Whether the drivers go with this clock; slow ones get their threads.
    fn begin(&self, clock: Clock) -> Result<(), HostError> {
        match (clock, self.roster.real()) {
            (Clock::Virtual, Some(real)) => Err(rules::refuse_virtual(&self.machine, real)),
            (Clock::Virtual, None) => Ok(()),
            (Clock::Wall, _) => {
                let begun = self.roster.begin_threads();
                begun.map_err(|error| HostError::System(format!("a slow driver has no thread: {error}")))
            }
        }
    }

    /// Drives the run to its end. `commands` are given on the virtual clock at their ticks.
    ///
    /// # Errors
    /// The computer refuses: a thread cannot be started. Real drives are refused on the virtual clock.
    pub fn drive(self, clock: Clock, commands: &[Timed], observer: &mut dyn RunObserver) -> Result<Outcome, HostError> {
        let started = Instant::now();
        if let Err(refused) = self.begin(clock) {
            let _ = self.fine.into_driver().stop();
            return Err(refused);
        }
        let machine = self.machine;
        if let Some(watch) = &self.watch {
            watch.begin(Arc::clone(&self.host.controls), Arc::clone(&self.host.status));
        }
        let mut fine = self.fine;
        let mut monitor = Monitor::new(&machine, self.leaves_path);
        monitor.worst.allow_steps(&self.speed_difference_mm_per_s);
        monitor.joints = self.joints.watch(machine.fine_period_s);
        let mut reloader = self.policy.clone().map(Reloader::new);
        if let (Clock::Wall, Some(reloader)) = (clock, &mut reloader)
            && let Err(note) = reloader.watch()
        {
            observer.note(&note);
        }
        let mut soft_loop = SoftLoop::new(self.rough, self.host, self.feed, reloader, monitor, observer);
        soft_loop.waits = Some(Waits::new(&machine));
        soft_loop.skips_homing = self.switches.home.is_some();
        soft_loop.analog = machine.analog.iter().map(|analog| analog.input as usize).collect();
        soft_loop.on_record_error = machine.on_record_error;
        soft_loop.planner.clone_from(&machine.planner.plugin);
        let mut measured = None;
        self.exchange.measures.store(clock == Clock::Wall, Relaxed);
        match clock {
            Clock::Virtual => virtual_clock::drive(&mut soft_loop, &mut fine, machine.fine_periods_per_rough, commands),
            Clock::Wall => {
                let watch = self.watch.as_ref().map(HangWatch::for_fine);
                let timed = wall_clock::drive(&mut soft_loop, fine, periods(&machine), watch)?;
                (fine, measured) = (timed.body, Some((timed.timing, timed.page_faults)));
            }
        }
        soft_loop.tell_policy_notes();
        soft_loop.tell_plugin_log();
        let fault = fine.fault();
        let mut summary = summarise(&machine, &self.program, clock, &soft_loop, &fine);
        summary.dry_run = self.switches.dry_run;
        summary.policy = self.policy.as_ref().map(PolicyHost::summary);
        summary.stopped = soft_loop.aborted.map(|rest| stopped(rest.line));
        tell_times(&mut summary, measured.as_ref(), &self.exchange);
        let late = summary.late_cause();
        let known = Known {
            soft: soft_loop.soft_cause(),
            driver: fine.plugin_error(),
            drives: fine.driver(),
            roster: &self.roster,
            late: late.as_deref(),
        };
        summary.fault = fault.map(|fault| describe(&machine, &self.joints, &fault, known));
        // Who homes first in the next run as well begins where the drives are, whatever the axes were called.
        let sent = self.switches.home.is_some() || fine.joints_went_alone();
        let position = if sent { fine.sent() } else { soft_loop.monitor.position };
        let left = fine.left();
        let stopped = fine.into_driver().stop();
        drop(soft_loop);
        if let Err(error) = stopped {
            not_let_go(&self.roster, &error, &mut summary, observer);
        }
        // What plugins say when they are stopped and dropped.
        drain_plugin_log(&mut |line| observer.note(line));
        summary.wall_time_s = started.elapsed().as_secs_f64();
        Ok(Outcome { summary, fault, position, left })
    }
}

/// Where the operator's abort has stopped the program.
fn stopped(line: u32) -> String {
    match line {
        0 => "stopped by the operator before the first line".to_string(),
        line => format!("stopped by the operator at line {line}"),
    }
}

/// What was `measured` in real time, where it was.
fn tell_times(summary: &mut Summary, measured: Option<&(Timing, PageFaults)>, exchange: &ExchangeTimes) {
    let Some((timing, page_faults)) = measured else { return };
    summary.overruns = timing.overruns;
    summary.lateness_us = Some(LatenessUs::from(&timing.lateness));
    summary.page_faults = Some(*page_faults);
    summary.exchange_us = Some(exchange.read());
}

/// The driver could not release the drives: that is the fault of a run that has no other, and is told beside any other.
fn not_let_go(roster: &Roster, error: &PluginError, summary: &mut Summary, observer: &mut dyn RunObserver) {
    let words = format!("driver {}: the drives were not let go of: {error}", roster.titles());
    match &summary.fault {
        None => summary.fault = Some(words),
        Some(_) => observer.note(&format!("error: {words}")),
    }
}

fn periods(machine: &Machine) -> Periods {
    let ns = |seconds: f64| (seconds * 1e9).round() as i64;
    Periods {
        rough_ns: ns(machine.rough_period_s),
        fine_ns: ns(machine.fine_period_s),
        fine_thread: machine.fine_thread,
    }
}
