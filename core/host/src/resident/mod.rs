//! A machine that stays: its drives are attached once, and driven by one job after the other.

mod claimed;
mod engine;

use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::Ordering::Relaxed;
use std::thread;
use std::time::{Duration, Instant};

use tandem_fine::{Fault, FineLoop, Left};
use tandem_gcode::{CheckReport, Program};
use tandem_machine::Machine;
use tandem_policy::Parameter as PolicyParameter;
use tandem_recorder::Summary;
use tandem_rings::{Controls, Status};
use tandem_rough::Source;
use tandem_sdk::{Attached, AxisVector, Block, Curve, Driver};

use crate::drives::{NoDriver, Roster};
use crate::error::HostError;
use crate::joints::JointSpace;
use crate::joints::apart::{Apart, Joined};
use crate::plugins::hang::HangWatch;
use crate::plugins::plugin_log::drain_plugin_log;
use crate::plugins::registry::Registry;
use crate::policy::PolicyHost;
use crate::run::job::{Conclusion, Job, JobParts};
use crate::run::periods;
use crate::setup::commands::with_user_commands;
use crate::setup::parts;
use crate::setup::ready::{Memory, Ready};
use crate::soft::soft_loop::{RunObserver, SoftLoop};
use crate::switches::{Clock, Lead, Switches};
use claimed::{Claimed, Gone, Nothing, Session, gone};
use engine::Engine;

/// Machine time, s, without any passing of program time after which a job to which nobody can say anything any more is given
/// up in lockstep.
const PATIENCE_S: f64 = 60.0;

/// A machine whose drives stay attached from job to job. Host.
pub struct Resident<'r> {
    /// The machine; it stands at its `start`.
    machine: Machine,
    registry: &'r Registry,
    clock: Clock,
    roster: Roster,
    attached: Attached,
    controls: Arc<Controls>,
    status: Arc<Status>,
    engine: Engine,
    watch: Option<HangWatch>,
    /// Bit per axis of which it is not known where it is.
    unknown_axes: u32,
    /// Fine periods of the process, and of what was before it, as far as somebody says so.
    uptime_periods: u64,
    /// The drives hold between jobs.
    enabled: bool,
    /// What is to be brought back before the drives can be enabled.
    lost: Option<Gone>,
    /// The driver between a fault and the start by which it finds its drives again.
    stopped: Option<Box<dyn Driver>>,
}

/// A job that is ready to be driven; nothing has moved.
pub struct PreparedJob {
    parts: Box<JobParts>,
    homes: u32,
    /// The gantries are apart meanwhile.
    apart: Option<Box<Apart>>,
}

/// What a job did.
#[derive(Clone, Debug)]
pub struct JobOutcome {
    /// Everything as numbers; the fault in words.
    pub summary: Summary,
    /// The fault that ended it; the drives have let go.
    pub fault: Option<Fault>,
    /// Where the machine came to rest, machine coordinates, mm or rad.
    pub position: AxisVector,
    /// What is on.
    pub left: Left,
    /// Whether the operator has stopped it.
    pub aborted: bool,
}

impl PreparedJob {
    /// What the first pass found: totals, and warnings.
    pub fn checked(&self) -> &CheckReport {
        &self.parts.job.checked
    }

    /// The job, for whoever records it.
    pub(crate) fn job(&self) -> &Job {
        &self.parts.job
    }

    /// Names of the feed strategy's signals, and after them those of the analog inputs.
    pub fn signals(&self) -> Vec<String> {
        self.job().signals()
    }
}

impl<'r> Resident<'r> {
    /// Claims the drives of `machine`; none is enabled. Host; allocates.
    ///
    /// # Errors
    /// Plugins refuse, the drives cannot be reached, or what is asked does not go together.
    pub fn attach(
        machine: Machine,
        registry: &'r Registry,
        clock: Clock,
    ) -> Result<Self, HostError> {
        let controls = Arc::<Controls>::default();
        let status = Arc::<Status>::default();
        let session = Session {
            registry,
            clock,
            controls: &controls,
            status: &status,
        };
        let claimed = Claimed::of(machine, &session)?;
        let mut this = Self {
            engine: Engine::Down(None),
            machine: claimed.machine,
            registry,
            clock,
            roster: claimed.roster,
            attached: claimed.attached,
            controls,
            status,
            watch: claimed.watch,
            unknown_axes: claimed.unknown_axes,
            uptime_periods: 0,
            enabled: false,
            lost: None,
            stopped: None,
        };
        this.engine = this.engine_of(claimed.fine, true)?;
        Ok(this)
    }

    /// Finds drives again that a driver has lost, by the same driver: the bus is brought up as at the start, and asked where
    /// everything stands. Where the driver itself could not go on, another one claims the drives. Host; allocates.
    ///
    /// # Errors
    /// The drives cannot be reached: nothing is claimed, and it can be tried again.
    fn attach_again(&mut self, gone: Gone) -> Result<(), HostError> {
        self.uptime_periods += self.engine.periods();
        let engine = std::mem::replace(&mut self.engine, Engine::Down(None));
        if let Some(fine) = engine.end()? {
            let mut driver = fine.into_driver();
            // Whether that lets go of what it does not reach says nothing.
            let _ = driver.stop();
            self.stopped = Some(driver);
        }
        let machine = self.machine.clone();
        let session = Session {
            registry: self.registry,
            clock: self.clock,
            controls: &self.controls,
            status: &self.status,
        };
        let claimed = if gone == Gone::Drives && self.stopped.is_some() {
            Claimed::again(machine, &session, self.roster.clone(), &mut self.stopped)?
        } else {
            self.stopped = None;
            self.watch = None;
            let mut claimed = Claimed::of(machine, &session)?;
            self.watch = claimed.watch.take();
            claimed
        };
        self.machine = claimed.machine;
        self.roster = claimed.roster;
        self.attached = claimed.attached;
        self.unknown_axes = claimed.unknown_axes;
        self.engine = self.engine_of(claimed.fine, true)?;
        self.lost = None;
        Ok(())
    }

    fn engine_of(&self, fine: Box<FineLoop>, told: bool) -> Result<Engine, HostError> {
        match self.clock {
            Clock::Virtual => Ok(Engine::Here(fine)),
            Clock::Wall => self.thread(fine, told),
        }
    }

    fn thread(&self, fine: Box<FineLoop>, told: bool) -> Result<Engine, HostError> {
        let watch = self.watch.as_ref().map(HangWatch::for_fine);
        Ok(Engine::start(fine, told, periods(&self.machine), watch)?.0)
    }

    /// The machine; it stands at its `start`.
    pub fn machine(&self) -> &Machine {
        &self.machine
    }

    /// Whether all drives are simulated.
    pub fn is_simulated(&self) -> bool {
        self.roster.describe().simulated != 0
    }

    /// Whether there are drives behind a bus, real ones or an emulator's, that may be heard late.
    pub fn has_bus(&self) -> bool {
        let all = self.roster.describe();
        all.simulated == 0 || all.gives_phase != 0
    }

    /// The operator's atomics, the same for all jobs.
    pub fn controls(&self) -> &Arc<Controls> {
        &self.controls
    }

    /// The fine loop's status, the same for all jobs.
    pub fn status(&self) -> &Arc<Status> {
        &self.status
    }

    /// Bit per axis of which it is not known where it is.
    pub fn unknown_axes(&self) -> u32 {
        self.unknown_axes
    }

    /// Whether the drives hold between jobs.
    pub fn is_enabled(&self) -> bool {
        self.enabled
    }

    /// Fine periods since the machine was attached, beside those of [`Resident::begin_at`].
    pub fn uptime_periods(&self) -> u64 {
        self.uptime_periods + self.engine.periods()
    }

    /// The process is so many fine periods old already, as tests say that ask whether that changes a job.
    pub fn begin_at(&mut self, uptime_periods: u64) {
        self.uptime_periods = uptime_periods;
    }

    /// The parameters of the policy script, as the next job has them; none without a script.
    pub fn policy_parameters(&self) -> BTreeMap<String, f64> {
        let policy = self.machine.policy.as_ref();
        policy.map_or_else(BTreeMap::new, |policy| policy.numbers().collect())
    }

    /// The parameters that the policy script declares, with their bounds; none without a script. Starts it to ask. Allocates.
    ///
    /// # Errors
    /// The script does not start.
    pub fn declared_parameters(&self) -> Result<Vec<PolicyParameter>, HostError> {
        let policy = self.policy_of(&self.machine)?;
        Ok(policy.map_or(vec![], |policy| policy.declared()))
    }

    /// The next job has `value` for the parameter `name` of the policy script. Allocates.
    ///
    /// # Errors
    /// There is no script, or it refuses the parameter; it is as it was.
    pub fn set_policy_parameter(&mut self, name: &str, value: f64) -> Result<(), HostError> {
        let mut machine = self.machine.clone();
        let Some(policy) = &mut machine.policy else {
            return Err(HostError::System(
                "the machine has no policy script".to_string(),
            ));
        };
        policy.set_number(name, value);
        self.policy_of(&machine)?;
        self.machine = machine;
        Ok(())
    }

    /// The policy script of `machine`, started, where it has one.
    fn policy_of(&self, machine: &Machine) -> Result<Option<PolicyHost>, HostError> {
        let joints = JointSpace::of(machine, self.registry)?;
        parts::policy(machine, self.registry, &joints)
    }

    /// Checks a program from where the machine stands, with what has lasted, and makes the job that drives it. Every block goes to
    /// `see`. Allocates.
    ///
    /// # Errors
    /// Everything that refuses: the program's errors, plugins, what does not go together.
    pub fn program(
        &self,
        program: Program,
        switches: Switches,
        memory: &Memory,
        see: &mut dyn FnMut(&Block, Option<Curve<'_>>),
    ) -> Result<PreparedJob, HostError> {
        let machine = self.machine.clone();
        let switches = self.on_clock(switches);
        let ready = Ready::of_program_on(
            &self.roster,
            machine,
            self.registry,
            program,
            switches,
            memory,
            see,
        )?;
        Ok(self.prepared(ready, 0))
    }

    /// The job of what `source` gives, which sees to it that every block is one that the planner takes. Allocates.
    ///
    /// # Errors
    /// Plugins refuse, or do not go together.
    pub fn source(
        &self,
        name: &str,
        source: Box<dyn Source + Send>,
        switches: Switches,
    ) -> Result<PreparedJob, HostError> {
        let machine = self.machine.clone();
        let switches = self.on_clock(switches);
        // Lines by hand run the machine's own commands too, and wait for them.
        let make = |machine: &Machine| with_user_commands(machine, self.registry, switches, source);
        let ready = Ready::of_source_on(
            &self.roster,
            machine,
            self.registry,
            Some(name.to_string()),
            make,
            switches,
        )?;
        Ok(self.prepared(ready, 0))
    }

    /// The job that homes the axes of the machine file, or the one `axis` alone, as `homing` does. Allocates.
    ///
    /// # Errors
    /// Plugins refuse, or the machine cannot be homed so.
    pub fn homing(&self, homing: Lead, axis: Option<usize>) -> Result<PreparedJob, HostError> {
        let mut machine = self.machine.clone();
        machine
            .homing
            .retain(|of| axis.is_none_or(|axis| of.axis == axis));
        let switches = Switches {
            home: Some(homing),
            unhomed: true,
            ..self.on_clock(Switches::default())
        };
        let homes = machine
            .homing
            .iter()
            .fold(0, |axes, of| axes | 1 << of.axis);
        let apart = Apart::of(&machine, self.registry)?;
        if let Some(apart) = &apart {
            machine = apart.machine.clone();
        }
        let name = Some("homing".to_string());
        let make = |machine: &Machine| homing(machine, None);
        let ready =
            Ready::of_source_on(&self.roster, machine, self.registry, name, make, switches)?;
        Ok(PreparedJob {
            apart: apart.map(Box::new),
            ..self.prepared(ready, homes)
        })
    }

    fn on_clock(&self, switches: Switches) -> Switches {
        Switches {
            clock: Some(self.clock),
            ..switches
        }
    }

    fn prepared(&self, ready: Ready, homes: u32) -> PreparedJob {
        let shared = (Arc::clone(&self.controls), Arc::clone(&self.status));
        let parts = JobParts::of(ready, &self.attached, self.clock == Clock::Wall, shared);
        PreparedJob {
            parts: Box::new(parts),
            homes,
            apart: None,
        }
    }

    /// Enables the drives where they stand; with `resets` their faults are reset first, and drives that were lost are claimed
    /// anew. The outcome's fault is that of a drive that does not hold, or an emergency stop that is in force: whoever takes that
    /// back does so before ([`Controls::emergency_stop`]), and knows of which one he speaks. Host.
    ///
    /// # Errors
    /// The computer refuses, or plugins do.
    pub fn enable(
        &mut self,
        resets: bool,
        observer: &mut dyn RunObserver,
    ) -> Result<JobOutcome, HostError> {
        let switches = Switches {
            unhomed: true,
            ..Switches::default()
        };
        if let Some(gone) = self.lost.filter(|_| resets) {
            self.attach_again(gone)?;
        }
        let job = self.source("enabling", Box::new(Nothing), switches)?;
        self.controls.drives_let_go.store(false, Relaxed);
        let outcome = self.drive_with(job, resets, observer)?;
        self.enabled = outcome.fault.is_none() && !outcome.aborted;
        Ok(outcome)
    }

    /// An abort where nothing is driven: the drives hold on, and what an abort switches off goes off. Host.
    ///
    /// # Errors
    /// The computer refuses, or plugins do.
    pub fn switch_off(&mut self, observer: &mut dyn RunObserver) -> Result<JobOutcome, HostError> {
        let switches = Switches {
            unhomed: true,
            ..Switches::default()
        };
        let job = self.source("stopping", Box::new(Nothing), switches)?;
        self.controls.abort.store(true, Relaxed);
        self.drive_with(job, false, observer)
    }

    /// Drives a job to its end; the drives are enabled. The machine stands where the outcome says. Host.
    ///
    /// # Errors
    /// The computer refuses: the machine is as it was.
    pub fn drive(
        &mut self,
        job: PreparedJob,
        observer: &mut dyn RunObserver,
    ) -> Result<JobOutcome, HostError> {
        self.drive_with(job, false, observer)
    }

    fn drive_with(
        &mut self,
        job: PreparedJob,
        resets: bool,
        observer: &mut dyn RunObserver,
    ) -> Result<JobOutcome, HostError> {
        let started = Instant::now();
        let PreparedJob {
            parts,
            homes,
            apart,
        } = job;
        let JobParts {
            job,
            config,
            end,
            kinematics,
        } = *parts;
        let driver = Box::new(NoDriver);
        let mut fine = Box::new(FineLoop::new(&config, end, driver, kinematics));
        fine.stay();
        fine.reset();
        self.engine.hand_over(fine, resets)?;
        if let Engine::Down(fine) = &mut self.engine {
            // A fault has ended the thread: it begins anew.
            let Some(fine) = fine.take() else {
                return Err(HostError::System("the fine loop is gone".to_string()));
            };
            self.engine = self.engine_of(fine, false)?;
        }
        let mut joined;
        let seen: &mut dyn RunObserver = match apart.as_deref() {
            Some(apart) => {
                joined = Joined {
                    observer: &mut *observer,
                    apart,
                };
                &mut joined
            }
            None => &mut *observer,
        };
        let (mut soft_loop, conclusion) = job.begin(self.clock, seen);
        let end = match self.clock {
            Clock::Virtual => self.in_lockstep(&mut soft_loop)?,
            Clock::Wall => self.in_real_time(&mut soft_loop)?,
        };
        soft_loop.drain();
        soft_loop.take_rests();
        let mut outcome = self.conclude(end, &mut soft_loop, &conclusion, started);
        if let Some(apart) = &apart {
            outcome.position = apart.joined(&outcome.position);
        }
        drop(soft_loop);
        drain_plugin_log(&mut |line| observer.note(line));
        self.clear_controls();
        self.machine.start = outcome.position;
        if outcome.fault.is_none() && !outcome.aborted {
            self.unknown_axes &= !homes;
        }
        self.enabled &= outcome.fault.is_none();
        if let Engine::Down(Some(fine)) = &self.engine {
            self.lost = gone(fine).or(self.lost);
        }
        Ok(outcome)
    }

    /// What was asked of the job that is over is not asked of the next one.
    fn clear_controls(&self) {
        let controls = &self.controls;
        for flag in [
            &controls.hold,
            &controls.program_hold,
            &controls.abort,
            &controls.soft_fault,
        ] {
            flag.store(false, Relaxed);
        }
        controls.jog.max_periods.store(0, Relaxed);
        controls.jog.let_go.store(false, Relaxed);
    }

    fn conclude(
        &self,
        end: Option<tandem_fine::JobEnd>,
        soft_loop: &mut SoftLoop<'_>,
        conclusion: &Conclusion,
        started: Instant,
    ) -> JobOutcome {
        let faulted = match &self.engine {
            Engine::Down(Some(fine)) if end.is_none() => Some(fine),
            _ => None,
        };
        let end = end
            .or_else(|| faulted.map(|fine| fine.job_end()))
            .unwrap_or_default();
        let mut summary = conclusion.summary(soft_loop, &end.counters);
        let fault = faulted.and_then(|fine| fine.fault());
        if let (Some(fine), Some(fault)) = (faulted, &fault) {
            let late = summary.late_cause();
            summary.fault =
                Some(conclusion.words(fault, fine, soft_loop.soft_cause(), late.as_deref()));
        }
        summary.wall_time_s = started.elapsed().as_secs_f64();
        let aborted = soft_loop.aborted.is_some();
        JobOutcome {
            summary,
            fault,
            position: end.position,
            left: end.left,
            aborted,
        }
    }

    /// Both loops in lockstep, to the end of the job; none where a fault ends it.
    fn in_lockstep(
        &mut self,
        soft_loop: &mut SoftLoop<'_>,
    ) -> Result<Option<tandem_fine::JobEnd>, HostError> {
        let patience = (PATIENCE_S / self.machine.fine_period_s) as u64;
        let mut passed_s = f64::NAN;
        let mut stuck = 0;
        while self.engine.is_attaching() {
            self.tick(soft_loop);
        }
        soft_loop.drain();
        loop {
            soft_loop.step();
            for _ in 0..self.machine.fine_periods_per_rough {
                if let Some(end) = self.engine.take_end() {
                    return Ok(Some(end));
                }
                self.tick(soft_loop);
                stuck += 1;
            }
            soft_loop.drain();
            soft_loop.serve_stop();
            if self.engine.fetch_faulted()?.is_some() {
                return Ok(None);
            }
            soft_loop.period();
            let now_s = self.status.program_time_s.load();
            let waits = soft_loop.is_waiting() || self.status.spindle.waits.load(Relaxed);
            if now_s != passed_s || waits || soft_loop.is_attended() {
                passed_s = now_s;
                stuck = 0;
            } else if stuck > patience {
                soft_loop.give_up();
            }
        }
    }

    fn tick(&mut self, soft_loop: &mut SoftLoop<'_>) {
        soft_loop.before_tick(self.uptime_periods);
        self.engine.tick();
        self.uptime_periods += 1;
    }

    /// The soft side in real time, to the end of the job; none where a fault ends it.
    fn in_real_time(
        &mut self,
        soft_loop: &mut SoftLoop<'_>,
    ) -> Result<Option<tandem_fine::JobEnd>, HostError> {
        loop {
            soft_loop.step();
            soft_loop.drain();
            soft_loop.serve_stop();
            soft_loop.period();
            if let Some(end) = self.engine.take_end() {
                return Ok(Some(end));
            }
            let before = self.engine.periods();
            if self.engine.fetch_faulted()?.is_some() {
                self.uptime_periods += before;
                return Ok(None);
            }
            thread::sleep(Duration::from_secs_f64(self.machine.rough_period_s));
        }
    }

    /// A rough period in which no job is driven: the drives hold, or are let go. The answer is a fault that has come meanwhile, in
    /// words. Host.
    ///
    /// # Errors
    /// The fine loop is gone: it panicked.
    pub fn idle(&mut self, observer: &mut dyn RunObserver) -> Result<Option<String>, HostError> {
        match self.clock {
            Clock::Virtual => {
                for _ in 0..self.machine.fine_periods_per_rough {
                    observer.before_tick(self.uptime_periods);
                    self.engine.tick();
                    self.uptime_periods += 1;
                }
            }
            Clock::Wall => thread::sleep(Duration::from_secs_f64(self.machine.rough_period_s)),
        }
        drain_plugin_log(&mut |line| observer.note(line));
        let before = self.engine.periods();
        let machine = &self.machine;
        let Some(fine) = self.engine.fetch_faulted()? else {
            return Ok(None);
        };
        let Some(fault) = fine.fault() else {
            return Ok(None);
        };
        let joints = JointSpace::of(machine, self.registry)?;
        self.lost = gone(fine).or(self.lost);
        let known = crate::messages::fault_text::Known {
            soft: None,
            driver: fine.plugin_error(),
            drives: fine.driver(),
            roster: &self.roster,
            late: None,
        };
        let words = crate::messages::fault_text::describe(machine, &joints, &fault, known);
        self.uptime_periods += before;
        self.enabled = false;
        self.clear_controls();
        Ok(Some(words))
    }

    /// Tells the drives to let go at the rest where the machine stands; whether they have. To be called until it says so, with
    /// [`Resident::idle`] in between. Host.
    pub fn disable(&mut self) -> bool {
        self.enabled = false;
        self.controls.drives_let_go.store(true, Relaxed);
        self.engine.is_released()
    }

    /// Lets go of the drives for good. Host.
    ///
    /// # Errors
    /// A driver could not release them, in words.
    pub fn stop(mut self, observer: &mut dyn RunObserver) -> Result<(), HostError> {
        let most =
            ((self.roster.describe().disable_s + 1.0) / self.machine.rough_period_s).ceil() as u64;
        for _ in 0..most {
            if self.disable() || self.idle(observer)?.is_some() {
                break;
            }
        }
        let Some(fine) = self.engine.end()? else {
            return Ok(());
        };
        let titles = self.roster.titles();
        let stopped = fine.into_driver().stop();
        drain_plugin_log(&mut |line| observer.note(line));
        stopped.map_err(|e| {
            HostError::System(format!(
                "driver {titles}: the drives were not let go of: {e}"
            ))
        })
    }
}
