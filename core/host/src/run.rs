//! One run of one program on one machine.

use std::sync::Arc;
use std::sync::atomic::Ordering::Relaxed;
use std::time::Instant;

use tandem_fine::{Fault, FineLoop};
use tandem_gcode::{CheckReport, Program, Stream, check};
use tandem_machine::{JerkMode, Machine};
use tandem_rings::{HostEnd, Sizes, bridge};
use tandem_rough::{RoughConfig, RoughLoop, Source};
use tandem_sdk::{AxisVector, Block, Driver, Planner, PluginError};

use crate::command::Timed;
use crate::error::HostError;
use crate::fault_text::describe;
use crate::homing::Homing;
use crate::joints::{JointSpace, JointWatch};
use crate::monitor::Monitor;
use crate::plugin_log::drain_plugin_log;
use crate::policy::PolicyHost;
use crate::pump::{Pump, RunObserver};
use crate::record::limited_by;
use crate::registry::Registry;
use crate::strategy::FeedRunner;
use crate::summary::{FORMAT, LatenessUs, PlanningUs, Summary};
use crate::wall_clock::Periods;
use crate::{faults, rules, setup, virtual_clock, wall_clock};

/// Which clock drives the loops.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Clock {
    /// Lockstep, as fast as the processor allows.
    Virtual,
    /// Real time.
    Wall,
}

/// The switches of the operator's panel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[allow(clippy::struct_excessive_bools)] // independent switches of a panel
pub struct Switches {
    /// Lines that begin with `/` are left out.
    pub block_delete: bool,
    /// M0 and M6 wait for the operator.
    pub pause_at_stops: bool,
    /// M1 waits for the operator, until the switch is turned off.
    pub optional_stop: bool,
    /// No spindle, coolant or user output is switched, nothing waits for the operator, and feed motion runs at the
    /// machine's dry-run feed.
    pub dry_run: bool,
    /// The axes that the machine file tells how to are homed before the program.
    pub home: bool,
}

/// A run that is ready: the program is checked, the plugins are open, nothing has moved.
pub struct Run {
    machine: Machine,
    program: String,
    rough: RoughLoop,
    fine: FineLoop,
    host: HostEnd,
    feed: Option<FeedRunner>,
    policy: Option<PolicyHost>,
    steps: bool,
    leaves_path: bool,
    uses_time_constants: bool,
    joints: Arc<JointSpace>,
    switches: Switches,
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
}

/// Runs the whole program through interpreter and planner; nothing moves.
///
/// # Errors
/// The program cannot be read; a plugin refuses. What is wrong with the program is in the report.
pub fn check_program(
    machine: &Machine,
    registry: &Registry,
    program: &mut Program,
    switches: Switches,
) -> Result<CheckReport, HostError> {
    let planner = setup::planner(machine, registry)?;
    first_pass(machine, planner.as_ref(), program, switches)
}

/// Hands every block of the program to `per_block`, in order; nothing moves, and no plugin is asked.
///
/// # Errors
/// The program cannot be read. What is wrong with the program is in the report.
pub fn each_block(
    machine: &Machine,
    program: &mut Program,
    switches: Switches,
    per_block: &mut dyn FnMut(&Block),
) -> Result<CheckReport, HostError> {
    let config = setup::interpreter_config(machine, switches);
    Ok(check(program, &config, &mut |block| {
        per_block(block);
        Ok(())
    })?)
}

/// The whole program through the interpreter and `planner`, which stays as it was.
fn first_pass(
    machine: &Machine,
    planner: &dyn Planner,
    program: &mut Program,
    switches: Switches,
) -> Result<CheckReport, HostError> {
    let config = setup::interpreter_config(machine, switches);
    Ok(check(program, &config, &mut |block| check_block(machine, planner, block))?)
}

/// Whether the machine and its planner can drive `block`.
pub(crate) fn check_block(machine: &Machine, planner: &dyn Planner, block: &Block) -> Result<(), String> {
    let spindle_rad_per_s = machine.spindle.max_rad_per_s;
    if block.spindle_rad_per_s.abs() > spindle_rad_per_s {
        return Err(spindle_too_fast(block.spindle_rad_per_s, spindle_rad_per_s));
    }
    planner.check(block).map_err(|e| e.to_string())
}

impl Run {
    /// Checks the whole program and opens the plugins.
    ///
    /// # Errors
    /// Everything that refuses: the program's errors, plugins, what does not go together.
    pub fn prepare(
        machine: Machine,
        registry: &Registry,
        mut program: Program,
        switches: Switches,
    ) -> Result<Self, HostError> {
        let planner = setup::planner(&machine, registry)?;
        let driver = setup::driver(&machine, registry)?;
        // The program first: where it needs another planner, what is wrong with this one does not matter.
        let checked = first_pass(&machine, planner.as_ref(), &mut program, switches)?;
        if !checked.is_ok() {
            return Err(HostError::Check(Box::new(checked)));
        }
        rules::check(&machine, &planner.describe(), driver.describe())?;
        rules::check_homing(&machine, &JointSpace::of(&machine, registry)?, switches)?;
        let name = program.name().to_string();
        let stream = Stream::new(program, &setup::interpreter_config(&machine, switches))?;
        let policy = PolicyHost::open(&machine)?;
        let source = setup::source(&machine, registry, stream, switches, policy.as_ref())?;
        Self::assemble(machine, registry, Some(name), source, policy, planner, driver, checked, switches)
    }

    /// A run of what `source` gives, which sees to it that every block is one that the planner takes.
    pub(crate) fn of_source(
        machine: Machine,
        registry: &Registry,
        name: String,
        source: Box<dyn Source + Send>,
        switches: Switches,
    ) -> Result<Self, HostError> {
        let planner = setup::planner(&machine, registry)?;
        let driver = setup::driver(&machine, registry)?;
        rules::check(&machine, &planner.describe(), driver.describe())?;
        rules::check_homing(&machine, &JointSpace::of(&machine, registry)?, switches)?;
        let source = setup::behind_homing(&machine, source, switches);
        Self::assemble(machine, registry, Some(name), source, None, planner, driver, CheckReport::default(), switches)
    }

    /// A run that homes the axes of [`Machine::homing`] and nothing else. Its samples are in the coordinates of the
    /// drives, which homing does not change.
    ///
    /// # Errors
    /// Everything that refuses: plugins, what does not go together.
    pub fn home(machine: Machine, registry: &Registry) -> Result<Self, HostError> {
        let switches = Switches { home: true, ..Switches::default() };
        let planner = setup::planner(&machine, registry)?;
        let driver = setup::driver(&machine, registry)?;
        rules::check(&machine, &planner.describe(), driver.describe())?;
        rules::check_homing(&machine, &JointSpace::of(&machine, registry)?, switches)?;
        let source = Box::new(Homing::new(&machine, &machine.homing, None));
        let checked = CheckReport::default();
        Self::assemble(machine, registry, None, source, None, planner, driver, checked, switches)
    }

    #[allow(clippy::too_many_arguments)] // the parts made by `prepare`, each once
    fn assemble(
        machine: Machine,
        registry: &Registry,
        program: Option<String>,
        source: Box<dyn Source + Send>,
        policy: Option<PolicyHost>,
        planner: Box<dyn Planner>,
        mut driver: Box<dyn Driver>,
        checked: CheckReport,
        switches: Switches,
    ) -> Result<Self, HostError> {
        let joints = Arc::new(JointSpace::of(&machine, registry)?);
        let feed = setup::feed(&machine, registry, &joints, policy.as_ref(), checked.length_mm)?;
        rules::check_signals(&machine, feed.as_ref().map_or(&[][..], FeedRunner::signals))?;
        driver = faults::wrap(&machine, driver, &joints)?;
        setup::open(&machine, driver.as_mut(), &joints)?;
        // As lockstep needs it: the samples of each rough period are taken behind it.
        let sizes = Sizes { samples: machine.fine_periods_per_rough as usize, ..Sizes::default() };
        let (rough_end, fine_end, host) = bridge(sizes);
        let description = planner.describe();
        let mut fine_config = setup::fine_config(&machine, &joints, &description, switches);
        fine_config.record_drives = program.is_none();
        host.controls.optional_stop.store(switches.optional_stop, Relaxed);
        let rough_config = RoughConfig::new(machine.rough_period_s);
        let mut fine =
            FineLoop::new(&fine_config, fine_end, driver, JointSpace::of(&machine, registry)?.into_kinematics());
        fine.reset();
        Ok(Self {
            rough: RoughLoop::new(rough_config, source, planner, rough_end),
            fine,
            machine,
            program: program.unwrap_or_else(|| HOMING.to_string()),
            host,
            feed,
            policy,
            switches,
            steps: description.speed_difference_mm_per_s.iter().any(|step| *step > 0.0),
            leaves_path: description.leaves_path != 0,
            uses_time_constants: description.uses_time_constants != 0,
            joints,
            checked,
        })
    }

    /// The operator's end of the run, to give commands from other threads.
    pub fn controls(&self) -> Arc<tandem_rings::Controls> {
        Arc::clone(&self.host.controls)
    }

    /// The fine loop's status, to look at from other threads.
    pub fn status(&self) -> Arc<tandem_rings::Status> {
        Arc::clone(&self.host.status)
    }

    /// Whether the planner makes use of velocity steps where blocks meet.
    pub fn allows_steps(&self) -> bool {
        self.steps
    }

    /// Whether the planner drives each block with the time constant that it states.
    pub fn uses_time_constants(&self) -> bool {
        self.uses_time_constants
    }

    /// Names of the feed strategy's signals, and after them those of the analog inputs.
    pub fn signals(&self) -> Vec<&str> {
        let own = self.feed.as_ref().map_or(&[][..], FeedRunner::signals);
        own.iter().copied().chain(self.machine.analog.iter().map(String::as_str)).collect()
    }

    /// Drives the run to its end. `commands` are given on the virtual clock at their ticks.
    ///
    /// # Errors
    /// The computer refuses: a thread cannot be started.
    pub fn drive(self, clock: Clock, commands: &[Timed], observer: &mut dyn RunObserver) -> Result<Outcome, HostError> {
        let started = Instant::now();
        let machine = self.machine;
        let mut fine = self.fine;
        let mut monitor = Monitor::new(&machine, self.leaves_path);
        monitor.joints = JointWatch::new(&self.joints, machine.fine_period_s);
        let mut reloader = self.policy.as_ref().map(PolicyHost::reloader);
        if let (Clock::Wall, Some(reloader)) = (clock, &mut reloader)
            && let Err(note) = reloader.watch()
        {
            observer.note(&note);
        }
        let mut pump = Pump::new(self.rough, self.host, self.feed, reloader, monitor, observer);
        (pump.skips_homing, pump.analog) = (self.switches.home, machine.analog.len());
        pump.planner.clone_from(&machine.planner.plugin);
        let mut measured = None;
        match clock {
            Clock::Virtual => virtual_clock::drive(&mut pump, &mut fine, machine.fine_periods_per_rough, commands),
            Clock::Wall => {
                let timed = wall_clock::drive(&mut pump, fine, periods(&machine))?;
                (fine, measured) = (timed.body, Some((timed.timing, timed.page_faults)));
            }
        }
        pump.tell_policy_notes();
        pump.tell_plugin_log();
        let fault = fine.fault();
        let text = fault.map(|f| describe(&machine, &self.joints, &f, pump.soft_cause(), fine.plugin_error()));
        let mut summary = summarise(&machine, &self.program, clock, &pump, &fine);
        summary.dry_run = self.switches.dry_run;
        summary.policy = self.policy.as_ref().map(PolicyHost::summary);
        summary.fault = text;
        summary.stopped = pump.aborted.map(|rest| format!("stopped by the operator at line {}", rest.line));
        if let Some((timing, page_faults)) = measured {
            summary.overruns = timing.overruns;
            summary.lateness_us = Some(LatenessUs::from(&timing.lateness));
            summary.page_faults = Some(page_faults);
        }
        // Who homes first in the next run as well begins where the drives are, whatever the axes were called.
        let sent = self.switches.home || fine.joints_went_alone();
        let position = if sent { fine.sent() } else { pump.monitor.position };
        let stopped = fine.into_driver().stop();
        drop(pump);
        if let Err(error) = stopped {
            not_let_go(&machine, &error, &mut summary, observer);
        }
        // What plugins say when they are stopped and dropped.
        drain_plugin_log(&mut |line| observer.note(line));
        summary.wall_time_s = started.elapsed().as_secs_f64();
        Ok(Outcome { summary, fault, position })
    }
}

/// The driver could not release the drives: that is the fault of a run that has no other, and is told beside any other.
fn not_let_go(machine: &Machine, error: &PluginError, summary: &mut Summary, observer: &mut dyn RunObserver) {
    let words = format!("driver {}: the drives were not let go of: {error}", machine.driver.plugin);
    match &summary.fault {
        None => summary.fault = Some(words),
        Some(_) => observer.note(&format!("error: {words}")),
    }
}

/// What stands for the name of a program in a run that only homes.
const HOMING: &str = "(homing)";

fn spindle_too_fast(asked_rad_per_s: f64, most_rad_per_s: f64) -> String {
    let rpm = |rad_per_s: f64| rad_per_s.abs() * 30.0 / std::f64::consts::PI;
    format!("the spindle is asked for {:.0} rpm; it turns at most at {:.0}", rpm(asked_rad_per_s), rpm(most_rad_per_s))
}

fn periods(machine: &Machine) -> Periods {
    let ns = |seconds: f64| (seconds * 1e9).round() as i64;
    Periods {
        rough_ns: ns(machine.rough_period_s),
        fine_ns: ns(machine.fine_period_s),
        max_missed: u64::from(machine.max_missed_periods),
        fine_thread: machine.fine_thread,
    }
}

fn summarise(machine: &Machine, program: &str, clock: Clock, pump: &Pump<'_>, fine: &FineLoop) -> Summary {
    let (monitor, counters) = (&pump.monitor, fine.counters());
    let each = |values: &AxisVector| {
        let shown = |i: usize| if machine.axes.is_rotary(i) { values[i].to_degrees() } else { values[i] };
        (0..machine.axes.count()).map(|i| (machine.axes.letter(i).to_lowercase().to_string(), shown(i))).collect()
    };
    Summary {
        format: FORMAT,
        program: program.to_string(),
        machine: machine.name.clone(),
        planner: machine.planner.plugin.clone(),
        clock: if clock == Clock::Virtual { "virtual" } else { "wall" }.to_string(),
        dry_run: false,
        blocks: monitor.blocks,
        length_mm: monitor.length_mm,
        nominal_time_s: monitor.nominal_s,
        motion_time_s: monitor.samples.saturating_sub(1) as f64 * machine.fine_period_s,
        reference_time_s: None,
        time_ratio: None,
        fine_period_s: machine.fine_period_s,
        rough_period_s: machine.rough_period_s,
        samples: counters.samples,
        max_velocity_mm_s: each(&monitor.peaks[0]),
        max_acceleration_mm_s2: each(&monitor.peaks[1]),
        max_jerk_mm_s3: each(&monitor.peaks[2]),
        joints: monitor.joints.as_ref().map(JointWatch::peaks),
        max_path_deviation_mm: monitor.max_path_deviation_mm(),
        jerk: if machine.motion.jerk == JerkMode::Limit { "limit" } else { "report" }.to_string(),
        limit_violations: counters.limit_violations,
        guard_stops: counters.guard_stops,
        governed_samples: counters.governed_samples,
        jerk_relaxed_samples: counters.jerk_relaxed_samples,
        overruns: 0,
        missed_periods: counters.missed_periods,
        lateness_us: None,
        page_faults: None,
        starvations: counters.starvations,
        late_ratios: counters.late_ratios,
        lost_samples: pump.host.status.lost_samples.load(Relaxed),
        end_position_mm: each(&monitor.position),
        wall_time_s: 0.0,
        planning_ns_per_block: pump.planning_ns as f64 / monitor.blocks.max(1) as f64,
        planning_us: PlanningUs::from(&pump.planning),
        limited_by_s: monitor.limited_by_s.iter().map(|(by, time_s)| (limited_by(*by).to_string(), *time_s)).collect(),
        policy: None,
        stops: monitor.stops.stops.clone(),
        stop_count: monitor.stops.count,
        fault: None,
        stopped: None,
    }
}
