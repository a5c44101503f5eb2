//! Everything of a run that can be made and checked before the drives are claimed: what a run and a check share.

use std::sync::Arc;

use tandem_faults::{Faults, Joints};
use tandem_gcode::{
    CheckReport, Config, PersistentData, Program, StateTags, Stream, SwitchedOn, Watched, check,
};
use tandem_machine::Machine;
use tandem_rough::Source;
use tandem_sdk::{Block, Curve, Kinematics, Planner};

use crate::drives::{Drives, Roster};
use crate::error::{HostError, refusal};
use crate::joints::JointSpace;
use crate::plugins::hang::HangWatch;
use crate::plugins::registry::Registry;
use crate::policy::PolicyHost;
use crate::setup::claim::Claim;
use crate::setup::density::Density;
use crate::setup::parts;
use crate::setup::rules;
use crate::soft::strategy::FeedRunner;
use crate::switches::Switches;

/// Everything that a run needs, made and checked; the drives are not claimed. Whatever refuses a run without asking the
/// drives refuses it here, so that a check finds all of it.
pub struct Ready {
    /// Looks whether the threads of the run come back, from the first plugin that is made.
    pub watch: Option<HangWatch>,
    pub machine: Machine,
    /// The program's name, or what stands for it.
    pub program: String,
    /// What the rough loop pulls.
    pub source: Box<dyn Source + Send>,
    pub policy: Option<PolicyHost>,
    pub planner: Box<dyn Planner>,
    /// The driver with its faults around it, where the machine has any; its drives claimed where that was asked for.
    pub claim: Claim,
    pub feed: Option<FeedRunner>,
    pub joints: Arc<JointSpace>,
    /// The map of the joints for the fine loop to own, where they are not the axes.
    pub kinematics: Option<Box<dyn Kinematics>>,
    /// What the first pass found.
    pub checked: CheckReport,
    /// Entries of the ring of segments that hold the worst stop anywhere in the program.
    pub entries: usize,
    pub switches: Switches,
    /// Samples are in the coordinates of the drives: a run that only homes.
    pub records_drives: bool,
}

/// What a program on a machine that stays finds from the jobs before, and to whom it tells what it changes.
#[derive(Clone, Default)]
pub struct Memory {
    /// Offsets, parameters and tools as they are when the program begins.
    pub persistent: Arc<PersistentData>,
    /// What its lines change, until the path reaches them.
    pub state_tags: StateTags,
    /// Spindle and coolant as they are then.
    pub on: SwitchedOn,
}

impl Memory {
    /// The interpreter's view of the machine with it.
    pub fn config(&self, machine: &Machine, simulated: bool, switches: Switches) -> Config {
        let mut config = parts::interpreter_config(machine, simulated, switches);
        config.tools.clone_from(&self.persistent.tools);
        config.persistent = Some(Arc::clone(&self.persistent));
        config.on = self.on;
        config
    }
}

/// Joints, planner and driver of a machine, as they are made for a run.
pub struct Plugins {
    pub watch: Option<HangWatch>,
    /// Made once: the planner and the policy keep the travel of these.
    pub joints: Arc<JointSpace>,
    pub planner: Box<dyn Planner>,
    pub claim: Claim,
}

impl Plugins {
    /// Makes them. Host; allocates.
    ///
    /// # Errors
    /// One of them is not there, or refuses its options.
    pub fn of(machine: &Machine, registry: &Registry) -> Result<Self, HostError> {
        let watch = HangWatch::of(machine);
        let joints = Arc::new(JointSpace::of(machine, registry)?);
        let planner = parts::planner_on(machine, registry, &joints)?;
        let claim = Claim::new(Drives::of(machine, registry, &joints)?);
        Ok(Self {
            watch,
            joints,
            planner,
            claim,
        })
    }

    /// Makes those of a job on drives that are claimed, on a machine that stays. Host; allocates.
    ///
    /// # Errors
    /// One of them is not there, or refuses its options.
    fn on_drives(
        machine: &Machine,
        registry: &Registry,
        roster: &Roster,
    ) -> Result<Self, HostError> {
        let joints = Arc::new(JointSpace::of(machine, registry)?);
        let planner = parts::planner_on(machine, registry, &joints)?;
        Ok(Self {
            watch: None,
            joints,
            planner,
            claim: Claim::elsewhere(roster.clone()),
        })
    }

    /// Whether they go with each other, and with what is asked of them.
    ///
    /// # Errors
    /// What does not go together, with its place in the machine file.
    pub fn check(&self, machine: &Machine, switches: Switches) -> Result<(), HostError> {
        let joints = &self.joints;
        let drivers = self.claim.roster();
        rules::check(machine, &self.planner.describe(), &drivers)?;
        rules::check_homing(machine, joints, switches, self.claim.is_elsewhere())?;
        // A driver that has panicked says so here, and of what it is nothing is known.
        self.claim.check(machine, joints)?;
        rules::check_times(machine, &drivers)?;
        rules::check_real(machine, joints, &drivers, switches.clock)
    }

    /// The same for a machine that stays: whether its axes are homed is asked before each job.
    ///
    /// # Errors
    /// What does not go together, with its place in the machine file.
    pub fn check_staying(&self, machine: &Machine, switches: Switches) -> Result<(), HostError> {
        let mut machine = machine.clone();
        machine.require_homing = false;
        self.check(&machine, switches)
    }

    /// Puts the machine's faults around the driver.
    ///
    /// # Errors
    /// What `[faults]` says wrongly.
    pub fn add_faults(&mut self, machine: &Machine) -> Result<(), HostError> {
        let Some(table) = &machine.faults else {
            return Ok(());
        };
        let joints = Joints {
            rotary: self.joints.rotary(),
            count: self.joints.count(),
        };
        let faults = Faults::read(table, &joints)
            .map_err(|wrong| refusal(machine, &wrong.key, wrong.cause))?;
        self.claim.add_faults(faults);
        Ok(())
    }

    /// Claims the drives: the machine starts where they stand. Host; allocates.
    ///
    /// # Errors
    /// The drives cannot be reached, or are in no state to be enabled.
    pub fn attach(
        mut self,
        mut machine: Machine,
        registry: &Registry,
        switches: Switches,
    ) -> Result<(Machine, Self), HostError> {
        let stands = self.claim.attach(&machine, &self.joints, switches)?;
        if stands != machine.start {
            machine.start = stands;
            // Who is outside of the travel is led back by hand; before homing nobody knows who is.
            if !switches.unhomed && switches.home.is_none() {
                self.joints.check_start(&machine)?;
            }
            self.joints.check_health(&machine)?;
            self.planner = parts::planner_on(&machine, registry, &self.joints)?;
        }
        Ok((machine, self))
    }
}

impl Ready {
    /// Checks the whole program and makes everything for a run of it; `claims` says whether the drives are claimed, which is the
    /// last thing that may refuse but for a program that cannot begin where they stand. Host; allocates.
    ///
    /// # Errors
    /// Everything that refuses: the program's errors, plugins, policy, what does not go together.
    pub fn of_program(
        mut machine: Machine,
        registry: &Registry,
        mut program: Program,
        switches: Switches,
        claims: bool,
    ) -> Result<Self, HostError> {
        let mut plugins = Plugins::of(&machine, registry)?;
        plugins.joints.check_start(&machine)?;
        let simulated = plugins.claim.describe().simulated != 0;
        // What is wrong with it is told behind what is wrong with the program.
        let policy = parts::policy(&machine, registry, &plugins.joints);
        let watched = watched(&policy);
        let config = |machine: &Machine| Config {
            watched: watched.clone(),
            ..parts::interpreter_config(machine, simulated, switches)
        };
        // Only real drives know where a program on them begins.
        let asks_first = claims && !simulated;
        // The program first: where it needs another planner, what is wrong with this one does not matter.
        let mut passed = (!asks_first).then(|| {
            Passed::of(
                &machine,
                &plugins,
                &mut program,
                &config(&machine),
                &mut |_, _| (),
            )
        });
        if let Some(Err(refused)) = passed {
            return Err(refused);
        }
        plugins.check(&machine, switches)?;
        plugins.add_faults(&machine)?;
        let policy = policy?;
        feed(&machine, registry, &plugins, policy.as_ref(), 0.0)?;
        if claims {
            let start = machine.start;
            (machine, plugins) = plugins.attach(machine, registry, switches)?;
            passed = passed.filter(|_| machine.start == start);
        }
        let passed = match passed {
            Some(passed) => passed?,
            None => Passed::of(
                &machine,
                &plugins,
                &mut program,
                &config(&machine),
                &mut |_, _| (),
            )?,
        };
        let name = program.name().to_string();
        let stream = Stream::new(program, &config(&machine))?;
        let parts = (name, stream, plugins, policy);
        Self::of_stream(machine, registry, parts, passed, switches)
    }

    /// Checks the whole program and makes everything for it, on drives that another has claimed, from where the machine stands
    /// and with what has lasted from the jobs before. Every block goes to `see`. Host; allocates.
    ///
    /// # Errors
    /// Everything that refuses: the program's errors, plugins, policy, what does not go together.
    pub fn of_program_on(
        roster: &Roster,
        machine: Machine,
        registry: &Registry,
        mut program: Program,
        switches: Switches,
        memory: &Memory,
        see: &mut dyn FnMut(&Block, Option<Curve<'_>>),
    ) -> Result<Self, HostError> {
        let plugins = Plugins::on_drives(&machine, registry, roster)?;
        plugins.joints.check_start(&machine)?;
        let simulated = roster.describe().simulated != 0;
        let policy = parts::policy(&machine, registry, &plugins.joints);
        let config = Config {
            watched: watched(&policy),
            ..memory.config(&machine, simulated, switches)
        };
        let passed = Passed::of(&machine, &plugins, &mut program, &config, see)?;
        plugins.check(&machine, switches)?;
        let policy = policy?;
        feed(&machine, registry, &plugins, policy.as_ref(), 0.0)?;
        let name = program.name().to_string();
        let mut stream = Stream::new(program, &config)?;
        stream.tell(memory.state_tags.clone());
        let parts = (name, stream, plugins, policy);
        Self::of_stream(machine, registry, parts, passed, switches)
    }

    /// What both kinds of program have in common once everything was checked: the stream, under its name, becomes the source.
    fn of_stream(
        machine: Machine,
        registry: &Registry,
        parts: (String, Stream, Plugins, Option<PolicyHost>),
        passed: Passed,
        switches: Switches,
    ) -> Result<Self, HostError> {
        let (name, stream, plugins, policy) = parts;
        let source = parts::source(
            &machine,
            registry,
            stream,
            switches,
            policy.as_ref(),
            &plugins.joints,
        )?;
        let ready = Self::new(
            machine,
            registry,
            Some(name),
            source,
            policy,
            plugins,
            passed.report,
            switches,
        )?;
        Ok(Self {
            entries: passed.entries,
            ..ready
        })
    }

    /// Makes everything for a run of what `source` gives, which begins where the machine that it is given stands; the drives are
    /// claimed. Host; allocates.
    ///
    /// # Errors
    /// Plugins refuse, or do not go together.
    pub fn of_source(
        machine: Machine,
        registry: &Registry,
        name: Option<String>,
        source: impl FnOnce(&Machine) -> Box<dyn Source + Send>,
        switches: Switches,
    ) -> Result<Self, HostError> {
        let plugins = Plugins::of(&machine, registry)?;
        Self::of_source_with(plugins, machine, registry, name, source, switches)
    }

    /// The same on drives that another has claimed.
    ///
    /// # Errors
    /// Plugins refuse, or do not go together.
    pub fn of_source_on(
        roster: &Roster,
        machine: Machine,
        registry: &Registry,
        name: Option<String>,
        source: impl FnOnce(&Machine) -> Box<dyn Source + Send>,
        switches: Switches,
    ) -> Result<Self, HostError> {
        let plugins = Plugins::on_drives(&machine, registry, roster)?;
        Self::of_source_with(plugins, machine, registry, name, source, switches)
    }

    fn of_source_with(
        mut plugins: Plugins,
        machine: Machine,
        registry: &Registry,
        name: Option<String>,
        source: impl FnOnce(&Machine) -> Box<dyn Source + Send>,
        switches: Switches,
    ) -> Result<Self, HostError> {
        if !switches.unhomed {
            plugins.joints.check_start(&machine)?;
        }
        plugins.check(&machine, switches)?;
        plugins.add_faults(&machine)?;
        feed(&machine, registry, &plugins, None, 0.0)?;
        let (machine, plugins) = plugins.attach(machine, registry, switches)?;
        let source = source(&machine);
        Self::new(
            machine,
            registry,
            name,
            source,
            None,
            plugins,
            CheckReport::default(),
            switches,
        )
    }

    /// Makes what every run needs for the parts that differ between runs. Host; allocates.
    #[allow(clippy::too_many_arguments)] // the parts that differ between runs, each once
    fn new(
        machine: Machine,
        registry: &Registry,
        program: Option<String>,
        source: Box<dyn Source + Send>,
        policy: Option<PolicyHost>,
        plugins: Plugins,
        checked: CheckReport,
        switches: Switches,
    ) -> Result<Self, HostError> {
        let feed = feed(
            &machine,
            registry,
            &plugins,
            policy.as_ref(),
            checked.length_mm,
        )?;
        Ok(Self {
            // Its own: a plugin that panics on the soft side does not take the fine loop's with it.
            kinematics: JointSpace::of(&machine, registry)?.into_kinematics(),
            joints: plugins.joints,
            records_drives: program.is_none(),
            program: program.unwrap_or_else(|| HOMING.to_string()),
            watch: plugins.watch,
            planner: plugins.planner,
            machine,
            source,
            policy,
            claim: plugins.claim,
            feed,
            checked,
            entries: 0,
            switches,
        })
    }
}

/// A program that is sound from its first line to its last.
struct Passed {
    report: CheckReport,
    /// Entries of the ring of segments that hold the worst stop anywhere in it.
    entries: usize,
}

impl Passed {
    /// The whole program, which begins as `config` says, through the interpreter and the planner.
    fn of(
        machine: &Machine,
        plugins: &Plugins,
        program: &mut Program,
        config: &Config,
        see: &mut dyn FnMut(&Block, Option<Curve<'_>>),
    ) -> Result<Self, HostError> {
        let depth_s =
            parts::queue_depth_s(machine, &plugins.joints, plugins.planner.describe().order);
        let mut density = Density::new(machine, depth_s);
        let report = first_pass(
            machine,
            plugins.planner.as_ref(),
            program,
            config,
            &mut |block, curve| {
                density.block(block);
                see(block, curve);
            },
        )?;
        if report.is_ok() {
            Ok(Self {
                report,
                entries: density.entries(),
            })
        } else {
            Err(HostError::Check(Box::new(report)))
        }
    }
}

/// What the policy script, if there is one, wants to know of the program.
fn watched(policy: &Result<Option<PolicyHost>, HostError>) -> Vec<Watched> {
    let script = policy.as_ref().ok().and_then(Option::as_ref);
    script.map_or_else(Vec::new, PolicyHost::watched)
}

/// What asks feed strategy and policy, where there is either, for a program of `length_mm`.
fn feed(
    machine: &Machine,
    registry: &Registry,
    plugins: &Plugins,
    policy: Option<&PolicyHost>,
    length_mm: f64,
) -> Result<Option<FeedRunner>, HostError> {
    let joints = (plugins.joints.as_ref(), plugins.claim.delay_periods());
    let feed = parts::feed(machine, registry, joints, policy, length_mm)?;
    rules::check_signals(machine, feed.as_ref().map_or(&[][..], FeedRunner::signals))?;
    Ok(feed)
}

/// Prepares a run of the program as [`Run::prepare`] does, short of claiming the drives: nothing moves, and no driver is
/// opened.
///
/// # Errors
/// Everything that refuses: plugins and their options, policy, what does not go together; the program cannot be read. What
/// is wrong with the program is in the report.
pub fn check_program(
    machine: Machine,
    registry: &Registry,
    program: Program,
    switches: Switches,
) -> Result<CheckReport, HostError> {
    match Ready::of_program(machine, registry, program, switches, false) {
        Ok(ready) => Ok(ready.checked),
        Err(HostError::Check(report)) => Ok(*report),
        Err(refused) => Err(refused),
    }
}

/// Hands every block of the program to `per_block`, in order; nothing moves, and no plugin is asked.
///
/// # Errors
/// The program cannot be read. What is wrong with the program is in the report.
pub fn each_block(
    machine: &Machine,
    program: &mut Program,
    switches: Switches,
    per_block: &mut dyn FnMut(&Block, Option<Curve<'_>>),
) -> Result<CheckReport, HostError> {
    let config = parts::interpreter_config(machine, true, switches);
    Ok(check(program, &config, &mut |block, curve| {
        per_block(block, curve);
        Ok(())
    })?)
}

/// The whole program through the interpreter and `planner`, which stays as it was; every block goes to `see` first.
fn first_pass(
    machine: &Machine,
    planner: &dyn Planner,
    program: &mut Program,
    config: &Config,
    see: &mut dyn FnMut(&Block, Option<Curve<'_>>),
) -> Result<CheckReport, HostError> {
    Ok(check(program, config, &mut |block, curve| {
        see(block, curve);
        check_block(machine, planner, block, curve)
    })?)
}

/// Whether the machine and its planner can drive `block`.
///
/// # Errors
/// Why not.
pub fn check_block(
    machine: &Machine,
    planner: &dyn Planner,
    block: &Block,
    curve: Option<Curve<'_>>,
) -> Result<(), String> {
    let spindle_rad_per_s = machine.spindle.max_rad_per_s;
    if block.spindle_rad_per_s.abs() > spindle_rad_per_s {
        return Err(spindle_too_fast(block.spindle_rad_per_s, spindle_rad_per_s));
    }
    tandem_sdk::abi::beat();
    planner.check(block, curve).map_err(|e| e.to_string())
}

/// What stands for the name of a program in a run that only homes.
const HOMING: &str = "(homing)";

fn spindle_too_fast(asked_rad_per_s: f64, max_rad_per_s: f64) -> String {
    let rpm = |rad_per_s: f64| rad_per_s.abs() * 30.0 / std::f64::consts::PI;
    format!(
        "the spindle is asked for {:.0} rpm; it turns at most at {:.0}",
        rpm(asked_rad_per_s),
        rpm(max_rad_per_s)
    )
}
