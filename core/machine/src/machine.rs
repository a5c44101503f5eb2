//! The whole machine.

use std::path::{Path, PathBuf};

use tandem_sdk::{Axes, AxisVector, Limits};

use crate::axes::AxisSet;
use crate::drivers::{self, DriverChoice, Wanted};
use crate::error::{MachineError, ValuePlace};
use crate::homing::{self, AxisHoming};
use crate::inputs::{self, Input};
use crate::joints::{self, Joint};
use crate::keys::keys;
use crate::load::Loader;
use crate::motion::{FineThread, Loops, Motion};
use crate::node::plain;
use crate::outputs::{self, Output};
use crate::overrides;
use crate::parts::{
    GuardMode, Operator, PluginChoice, Policy, RecordErrorMode, Spindle, analog_names, text,
};
use crate::places::Places;
use crate::probe::Probe;
use crate::problems::{Origin, Problems};
use crate::program::ProgramRules;
use crate::schema::check;
use crate::section::Section;
use crate::signals::{self, Analog};
use crate::tools::ToolTable;

/// A machine as `machine.toml` describes it, in internal units: mm, s, rad. A rotary axis is in rad wherever a name
/// says mm.
#[derive(Clone, Debug)]
pub struct Machine {
    /// Name in reports; the file's name where it states none.
    pub name: String,
    /// The file, as it was named.
    pub path: PathBuf,
    /// Period of the rough loop, s: [`Machine::fine_periods_per_rough`] fine periods.
    pub rough_period_s: f64,
    /// Period of the fine loop, s.
    pub fine_period_s: f64,
    /// How many fine periods a rough one has; at least 1.
    pub fine_periods_per_rough: u32,
    /// Fine periods missed in a row above which a machine that moves faults.
    pub max_missed_periods: u32,
    /// Share of the fine periods of a sliding second, missed in motion, above which it faults, 0 to 1.
    pub max_missed_share: f64,
    /// What the fine loop's thread asks of the computer.
    pub fine_thread: FineThread,
    /// Time without a period after which the fine loop counts as hung, s: the process ends, and the drives' watchdog acts.
    pub fine_hang_after_s: f64,
    /// The same for a call of a plugin on the soft side, and on the virtual clock, s.
    pub soft_hang_after_s: f64,
    /// How the machine moves where a block says nothing.
    pub motion: Motion,
    /// Axes, in the order of the file.
    pub axes: Axes,
    /// What each axis may do.
    pub limits: Limits,
    /// Largest distance between command and feedback of each axis, mm or rad; infinite where none is stated. A joint that
    /// moves an axis takes it from there.
    pub max_following_error_mm: AxisVector,
    /// Highest feed of each axis while it is neither known nor homed, mm/s or rad/s.
    pub unhomed_max_feed_mm_per_s: AxisVector,
    /// How far apart the joints of each axis may stand when their drives are claimed, mm or rad.
    pub max_skew_mm: AxisVector,
    /// Where a simulated machine stands at power-on, within the travel.
    pub start: AxisVector,
    /// Reference position, within the travel.
    pub home: AxisVector,
    /// The joints that the file states; none where the joints are the axes.
    pub joints: Vec<Joint>,
    /// Map between axes and joints.
    pub kinematics: PluginChoice,
    /// Planner.
    pub planner: PluginChoice,
    /// Feed strategy, if there is one.
    pub feed_strategy: Option<PluginChoice>,
    /// Drivers, at least one: either one that has the whole machine, or each with its part of it.
    pub drivers: Vec<DriverChoice>,
    /// Digital inputs that have a name.
    pub inputs: Vec<Input>,
    /// Digital outputs that the file names.
    pub outputs: Vec<Output>,
    /// Analog inputs that have a name, for trace and report, in the order of their numbers.
    pub analog: Vec<Analog>,
    /// Faults around the driver, as the file states them: the wrappers read them.
    pub faults: Option<toml::Table>,
    /// What the guard does.
    pub guard: GuardMode,
    /// What the motion does where a file that the run writes cannot be written any further.
    pub on_record_error: RecordErrorMode,
    /// Policy script, if there is one.
    pub policy: Option<Policy>,
    /// What the spindle may do.
    pub spindle: Spindle,
    /// How axes find their place, in the order in which they do; axes that are not in it know theirs.
    pub homing: Vec<AxisHoming>,
    /// A program is refused where they have not.
    pub require_homing: bool,
    /// The probe, if there is one.
    pub probe: Option<Probe>,
    /// What part programs may use.
    pub program: ProgramRules,
    /// What the operator's switches mean.
    pub operator: Operator,
    /// Tools; empty without a tool table.
    pub tools: ToolTable,
    effective: String,
    places: Places,
}

impl Machine {
    /// Whether a gantry is homed joint by joint, which squares it: its joints are axes of their own meanwhile.
    pub fn squares(&self) -> bool {
        self.homing.iter().any(|homing| homing.foot.is_some())
    }

    /// Reads the machine of `path`. `overrides` are dotted paths and values, as `--set path=value` gives them, the
    /// later ones on top; a value that is not TOML is a string.
    ///
    /// # Errors
    /// Everything that is wrong: what cannot be read or is not TOML, unknown keys with the nearest known one, missing
    /// keys, values of the wrong kind or beyond sense.
    pub fn read(path: &Path, overrides: &[(String, String)]) -> Result<Self, MachineError> {
        let problems = Problems::default();
        let Some(mut root) = Loader::new(&problems).machine(path, None) else {
            return problems.verdict(None);
        };
        for (key, value) in overrides {
            overrides::apply(&mut root, key, value, &problems);
        }
        check(keys(), &mut Vec::new(), &root, &problems);
        let section = Section::new(Vec::new(), Origin::default(), &root, &problems);
        let tables = Tables::read(&section);
        let moving = AxisSet::read(&section, &tables.motion);
        let moving = moving.map(|axes| Moving::read(&section, axes, &tables.motion, &problems));
        // Tables that are wrong themselves say nothing of each other.
        if let Some(moving) = moving.as_ref().filter(|_| problems.is_empty()) {
            inputs::check(
                &section,
                &tables.inputs,
                &moving.homing,
                tables.probe.as_ref(),
            );
        }
        if let Some(moving) = moving.as_ref().filter(|_| !section.has("driver")) {
            tables.wanted(&section, moving).check(&tables.drivers);
        }
        let effective = text(&section, "format", &root);
        let moving = problems.verdict(moving)?;
        Ok(tables.into_machine(
            path,
            moving,
            effective,
            Places::new(problems.into_sources(), &root),
        ))
    }

    /// The outputs that a fault and an emergency stop leave as they are, a bit each.
    pub fn kept_outputs(&self) -> u64 {
        self.outputs
            .iter()
            .filter(|output| output.kept)
            .fold(0, |bits, output| bits | 1 << output.output)
    }

    /// The configuration in force as TOML text: includes and overrides applied, files named absolutely. Reading it as
    /// a machine file gives this machine again.
    pub fn effective_toml(&self) -> &str {
        &self.effective
    }

    /// Whether the key at a dotted path was written.
    pub fn has(&self, key: &str) -> bool {
        self.places.has(key)
    }

    /// Where the key at a dotted path was written, else the table around it, else the beginning of the file: for
    /// refusals by those who read more than this crate does, such as a plugin its options.
    pub fn place(&self, key: &str) -> ValuePlace {
        self.places.of(key)
    }
}

/// What the axes say, and the tables that speak of axes.
struct Moving {
    axes: AxisSet,
    joints: Vec<Joint>,
    homing: Vec<AxisHoming>,
    tools: ToolTable,
}

impl Moving {
    fn read(root: &Section<'_>, axes: AxisSet, motion: &Motion, problems: &Problems) -> Self {
        let tools = Some(root.section("tools")).filter(Section::exists);
        let tools = tools.and_then(|section| ToolTable::read(&section, &axes.axes, problems));
        let joints = joints::read(root, &axes, motion);
        Self {
            homing: homing::read(root, &axes, &joints),
            joints,
            tools: tools.unwrap_or_default(),
            axes,
        }
    }

    /// Highest feeds of axes that do not know where they are. Who states a search feed has said how fast that axis may look for
    /// its place blindly; without one it is a tenth of the highest, at which a hand is quicker than the axis.
    fn unhomed_feed(&self) -> AxisVector {
        let switch = |axis: usize| {
            self.homing
                .iter()
                .find(|homing| homing.axis == axis)
                .and_then(AxisHoming::switch)
        };
        let search = |axis: usize| switch(axis).map(|switch| switch.search_mm_per_s.abs());
        AxisVector(std::array::from_fn(|axis| {
            match self.axes.limits.axes().get(axis) {
                Some(_) if self.axes.unhomed_feed[axis].is_finite() => self.axes.unhomed_feed[axis],
                Some(limits) => search(axis).unwrap_or(UNHOMED_SHARE * limits.feed_mm_per_s),
                None => 0.0,
            }
        }))
    }
}

/// Share of the highest feed for an axis that does not know where it is.
const UNHOMED_SHARE: f64 = 0.1;

/// What the other tables say. Where one is wrong, which is reported, something stands in for it.
struct Tables {
    name: Option<String>,
    require_homing: bool,
    loops: Loops,
    motion: Motion,
    kinematics: PluginChoice,
    planner: PluginChoice,
    feed_strategy: Option<PluginChoice>,
    drivers: Vec<DriverChoice>,
    inputs: Vec<Input>,
    outputs: Vec<Output>,
    analog: Vec<Analog>,
    faults: Option<toml::Table>,
    guard: GuardMode,
    on_record_error: RecordErrorMode,
    policy: Option<Policy>,
    spindle: Spindle,
    probe: Option<Probe>,
    program: ProgramRules,
    operator: Operator,
}

impl Tables {
    fn read(root: &Section<'_>) -> Self {
        let optional = |key: &str| Some(root.section(key)).filter(Section::exists);
        let required = |key: &str| {
            PluginChoice::read(&root.section(key)).unwrap_or_else(|| PluginChoice::named(""))
        };
        let kinematics = optional("kinematics").and_then(|s| PluginChoice::read(&s));
        Self {
            name: root.section("machine").text("name").map(str::to_owned),
            require_homing: root
                .section("machine")
                .truth("require_homing")
                .unwrap_or(false),
            loops: Loops::read(&root.section("loops")),
            motion: Motion::read(&root.section("motion")),
            kinematics: kinematics.unwrap_or_else(|| PluginChoice::named("identity")),
            planner: required("planner"),
            feed_strategy: optional("feed_strategy").and_then(|s| PluginChoice::read(&s)),
            drivers: drivers::read(root),
            inputs: inputs::read(root),
            outputs: outputs::read(root),
            analog: signals::analog(root, analog_names(&root.section("driver"))),
            faults: optional("faults").and_then(|s| s.table().map(plain)),
            guard: GuardMode::read(&root.section("guard")),
            on_record_error: RecordErrorMode::read(&root.section("recorder")),
            policy: optional("policy").and_then(|s| Policy::read(&s)),
            spindle: Spindle::read(&root.section("spindle")),
            probe: optional("probe").and_then(|s| Probe::read(&s)),
            program: ProgramRules::read(&root.section("program"), &root.section("user_commands")),
            operator: Operator::read(&root.section("operator")),
        }
    }

    /// What the drivers together must have.
    fn wanted<'a>(&self, root: &'a Section<'a>, moving: &Moving) -> Wanted<'a> {
        let letter = |axis| {
            moving
                .axes
                .axes
                .letter(axis)
                .to_ascii_lowercase()
                .to_string()
        };
        let axes: Vec<_> = (0..moving.axes.axes.count()).map(letter).collect();
        let homing = moving.homing.iter().flat_map(|homing| {
            let table = homing.table(&moving.axes.axes, &moving.joints);
            let switch = homing.switch();
            let index = switch.and_then(|switch| switch.index);
            let inputs = [switch.map(|of| of.input), index.map(|of| of.input)];
            inputs
                .into_iter()
                .flatten()
                .map(move |input| (input, format!("homing.{table}")))
        });
        let probe = self
            .probe
            .iter()
            .map(|probe| (probe.input, "probe".to_owned()));
        let named = self
            .inputs
            .iter()
            .map(|input| (input.input, format!("inputs.{}", input.name)));
        let outputs = self
            .outputs
            .iter()
            .map(|output| (output.output, format!("outputs.{}", output.name)));
        let analog = self
            .analog
            .iter()
            .map(|analog| (analog.input, format!("analog.{}", analog.name)));
        Wanted {
            joints: drivers::joint_names(
                &axes,
                &moving.joints,
                self.kinematics.plugin == "identity",
            ),
            inputs: homing.chain(probe).chain(named).collect(),
            outputs: outputs.collect(),
            analog: analog.collect(),
            root,
        }
    }

    fn into_machine(
        self,
        path: &Path,
        moving: Moving,
        effective: String,
        places: Places,
    ) -> Machine {
        let stem = || {
            path.file_stem()
                .unwrap_or_default()
                .to_string_lossy()
                .into_owned()
        };
        let unhomed_max_feed_mm_per_s = moving.unhomed_feed();
        let AxisSet {
            axes,
            limits,
            max_following_error,
            max_skew,
            start,
            home,
            ..
        } = moving.axes;
        Machine {
            name: self.name.unwrap_or_else(stem),
            path: path.to_owned(),
            rough_period_s: self.loops.rough_period_s,
            fine_period_s: self.loops.fine_period_s,
            fine_periods_per_rough: self.loops.fine_periods_per_rough,
            max_missed_periods: self.loops.max_missed_periods,
            max_missed_share: self.loops.max_missed_share,
            fine_thread: self.loops.fine_thread,
            fine_hang_after_s: self.loops.fine_hang_after_s,
            soft_hang_after_s: self.loops.soft_hang_after_s,
            motion: self.motion,
            axes,
            limits,
            max_following_error_mm: max_following_error,
            unhomed_max_feed_mm_per_s,
            max_skew_mm: max_skew,
            start,
            home,
            joints: moving.joints,
            homing: moving.homing,
            require_homing: self.require_homing,
            kinematics: self.kinematics,
            planner: self.planner,
            feed_strategy: self.feed_strategy,
            drivers: self.drivers,
            inputs: self.inputs,
            outputs: self.outputs,
            analog: self.analog,
            faults: self.faults,
            guard: self.guard,
            on_record_error: self.on_record_error,
            policy: self.policy,
            spindle: self.spindle,
            probe: self.probe,
            program: self.program,
            operator: self.operator,
            tools: moving.tools,
            effective,
            places,
        }
    }
}
