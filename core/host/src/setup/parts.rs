//! From a machine to the parts of a run.

use std::sync::Arc;

use tandem_fine::{FineConfig, HomeSwitch, MissedLimits};
use tandem_gcode::{Config, Lines, ProbeInput, Stream, Tool};
use tandem_machine::{GuardMode, Machine};
use tandem_rings::{STOP_JERK_SHARE, STOP_SHARE};
use tandem_rough::easing_s;
use tandem_rough::{Source, Tuned};
use tandem_sdk::{
    Attached, AxisLimits, AxisVector, DriverDescription, FeedStrategy, Limits, MAX_AXES, Name,
    Planner, PlannerContext, PlannerDescription, StrategyContext,
};

use crate::drives::driver_context;
use crate::error::HostError;
use crate::joints::{CoupledJoints, JointSpace};
use crate::messages::roles;
use crate::plugins::hang::HangWatch;
use crate::plugins::registry::Registry;
use crate::policy::{Means, PolicyHost, Tuner};
use crate::setup::commands::with_user_commands;
use crate::setup::dry_run::DryRun;
use crate::setup::lines;
use crate::setup::stand_in::AssumedEdges;
use crate::soft::strategy::FeedRunner;
use crate::switches::Switches;

/// Greatest time constant that a program may ask for where the machine states no range, s.
const MAX_TIME_CONSTANT_S: f64 = 1.0;

/// The interpreter's view of the machine. A length of zero would drive a tool into the table: where there is no tool table, only
/// `simulated` drives take it without being told.
pub fn interpreter_config(machine: &Machine, simulated: bool, switches: Switches) -> Config {
    let mut config = Config::new(machine.axes);
    config.start = start(machine, switches);
    config.block_delete = switches.block_delete;
    config.reference = [machine.home; 2];
    config.time_constant_s = machine
        .motion
        .time_constant_range_s
        .unwrap_or((machine.fine_period_s, MAX_TIME_CONSTANT_S));
    for (travel, axis) in config.travel_mm.iter_mut().zip(machine.limits.axes()) {
        *travel = (axis.min_mm, axis.max_mm);
    }
    config.probe = machine.probe.map(|probe| ProbeInput {
        input: probe.input,
        inverted: probe.inverted,
    });
    let (outputs, inputs) = lines::of(machine);
    (config.outputs, config.inputs) = (outputs, inputs);
    config.tools = machine.tools.tools.iter().map(tool).collect();
    config.zero_length_without_table =
        machine.tools.path.is_none() && (machine.tools.zero_without_table || simulated);
    config.tool_change.retract_z_mm = machine.tools.retract_z_mm;
    config.tool_change.sub.clone_from(&machine.tools.change_sub);
    // Drives that are simulated take what no real one is known to have.
    if !simulated {
        (config.analog_outputs, config.analog_inputs) = (Lines::none(), Lines::none());
        config.orients_spindle = false;
    }
    config.user_commands = machine.program.user_commands.keys().copied().collect();
    config.subroutine_path = machine.program.subroutine_path.iter().cloned().collect();
    config.max_steps = u64::from(machine.program.max_steps);
    config
}

/// Where the program starts: axes that are homed before it are at home.
fn start(machine: &Machine, switches: Switches) -> AxisVector {
    let mut start = machine.start;
    for homing in machine.homing.iter().filter(|_| switches.home.is_some()) {
        start[homing.axis] = machine.home[homing.axis];
    }
    start
}

/// What the rough loop pulls: the program, tuned by the policy where there is one, behind homing where that is asked for.
pub fn source(
    machine: &Machine,
    registry: &Registry,
    stream: Stream,
    switches: Switches,
    policy: Option<&PolicyHost>,
    joints: &Arc<JointSpace>,
) -> Result<Box<dyn Source + Send>, HostError> {
    let mut source = program(machine, stream, switches);
    if let Some(policy) = policy {
        source = Box::new(Tuned::new(
            source,
            Tuner::new(policy.clone(), planner_on(machine, registry, joints)?),
        ));
    }
    let source = with_user_commands(machine, registry, switches, source);
    Ok(behind_homing(machine, source, switches))
}

/// `source`, behind homing where that is asked for; a gantry squares itself by a job of its own.
pub fn behind_homing(
    machine: &Machine,
    source: Box<dyn Source + Send>,
    switches: Switches,
) -> Box<dyn Source + Send> {
    match switches.home {
        Some(homing) if !machine.squares() => homing(machine, Some(source)),
        _ => source,
    }
}

/// The program as the rough loop pulls it.
fn program(machine: &Machine, stream: Stream, switches: Switches) -> Box<dyn Source + Send> {
    if switches.assumes_edges {
        return as_dry_run(machine, switches, Box::new(AssumedEdges(stream)));
    }
    as_dry_run(machine, switches, Box::new(stream))
}

/// `source`, in a dry run at the machine's dry-run feed where it states one. Host; allocates.
pub fn as_dry_run(
    machine: &Machine,
    switches: Switches,
    source: Box<dyn Source + Send>,
) -> Box<dyn Source + Send> {
    let feed_mm_per_s = machine.operator.dry_run_feed_mm_per_s;
    match feed_mm_per_s.filter(|_| switches.dry_run) {
        Some(feed_mm_per_s) => Box::new(DryRun::new(source, machine.axes, feed_mm_per_s)),
        None => source,
    }
}

fn tool(tool: &tandem_machine::Tool) -> Tool {
    Tool {
        number: tool.number,
        pocket: Some(tool.pocket),
        offset: tool.offset,
        diameter_mm: tool.diameter_mm,
    }
}

/// Opens the machine's planner. It keeps the limits of the joints, and their travel. Host; allocates.
///
/// # Errors
/// The planner is not there or refuses its options; or what is wrong with the joints.
pub fn planner(machine: &Machine, registry: &Registry) -> Result<Box<dyn Planner>, HostError> {
    let _watch = HangWatch::of(machine);
    planner_on(
        machine,
        registry,
        &Arc::new(JointSpace::of(machine, registry)?),
    )
}

/// The same on joints that are there.
pub fn planner_on(
    machine: &Machine,
    registry: &Registry,
    joints: &Arc<JointSpace>,
) -> Result<Box<dyn Planner>, HostError> {
    let context = PlannerContext {
        axes: machine.axes,
        limits: joints.planned(),
        fine_period_s: machine.fine_period_s,
        rough_period_s: machine.rough_period_s,
        path_tolerance_mm: machine.motion.path_tolerance_mm,
        time_constant_s: machine.motion.time_constant_s,
        max_feed_ratio: machine.motion.max_feed_ratio,
        position: joints.with_lanes(&machine.start),
        joint_lanes: joints.lanes(),
    };
    let choice = &machine.planner;
    let planner = registry
        .planner(choice, &context)
        .map_err(|e| e.at(machine, "planner"))?;
    Ok(CoupledJoints::around(planner, joints, machine))
}

/// The limits of the machine's axes, as narrow as its joints make them. Host; allocates.
///
/// # Errors
/// What is wrong with the joints or their kinematics.
pub fn axis_limits(machine: &Machine, registry: &Registry) -> Result<Limits, HostError> {
    Ok(JointSpace::of(machine, registry)?.of_axes())
}

/// What asks feed strategy and policy once a rough period, where there is either. The program is `length_mm` long; feedback is
/// `delay_periods` behind the command.
pub fn feed(
    machine: &Machine,
    registry: &Registry,
    (joints, delay_periods): (&JointSpace, u32),
    policy: Option<&PolicyHost>,
    length_mm: f64,
) -> Result<Option<FeedRunner>, HostError> {
    let strategy = strategy(machine, registry, joints, delay_periods)?;
    if strategy.is_none() && policy.is_none() {
        return Ok(None);
    }
    let signals = strategy
        .as_ref()
        .map_or::<&[&str], _>(&[], |strategy| strategy.signals());
    let policy = policy.map(|p| (p.clone(), Means::new(machine, length_mm, signals)));
    let per_window = machine.fine_periods_per_rough as usize;
    let mut runner = FeedRunner::new(strategy, policy, per_window, machine.motion.max_feed_ratio);
    runner.name = machine
        .feed_strategy
        .as_ref()
        .map(|choice| choice.plugin.clone())
        .unwrap_or_default();
    Ok(Some(runner))
}

/// Opens the machine's policy script, if it names one. Host; allocates.
///
/// # Errors
/// The script is refused, or the strategy whose signals it may see.
pub fn policy(
    machine: &Machine,
    registry: &Registry,
    joints: &JointSpace,
) -> Result<Option<PolicyHost>, HostError> {
    if machine.policy.is_none() {
        return Ok(None);
    }
    PolicyHost::open(machine, strategy_signals_on(machine, registry, joints)?)
}

/// Names of the signals of the machine's feed strategy; none without one. Host; allocates.
///
/// # Errors
/// The strategy is refused, or the joints are.
pub fn strategy_signals(
    machine: &Machine,
    registry: &Registry,
) -> Result<&'static [&'static str], HostError> {
    strategy_signals_on(machine, registry, &JointSpace::of(machine, registry)?)
}

fn strategy_signals_on(
    machine: &Machine,
    registry: &Registry,
    joints: &JointSpace,
) -> Result<&'static [&'static str], HostError> {
    let strategy = strategy(machine, registry, joints, 0)?;
    Ok(strategy.map_or(&[], |strategy| strategy.signals()))
}

/// Makes the machine's feed strategy, if it names one.
fn strategy(
    machine: &Machine,
    registry: &Registry,
    joints: &JointSpace,
    delay_periods: u32,
) -> Result<Option<Box<dyn FeedStrategy>>, HostError> {
    let Some(choice) = &machine.feed_strategy else {
        return Ok(None);
    };
    let driven = driver_context(machine, joints);
    let mut context = StrategyContext {
        joints_are_axes: u32::from(joints.are_axes()),
        joint_count: driven.joint_count,
        limits: joints.of_axes(),
        joints: driven.joints,
        delay_periods,
        ..StrategyContext::new(
            machine.axes,
            machine.fine_period_s,
            machine.rough_period_s,
            machine.motion.max_feed_ratio,
        )
    };
    for analog in &machine.analog {
        context.analog[analog.input as usize] = Name::new(&analog.name);
    }
    for input in &machine.inputs {
        context.inputs[input.input as usize] = Name::new(&input.name);
    }
    let made = registry.strategy(choice, &context);
    made.map(Some).map_err(|e| e.at(machine, "feed_strategy"))
}

/// Share of an axis' acceleration that planners leave along the path where it turns, at least.
const LEFT_IN_TURNS: f64 = 0.6;

/// Program time that the queue has to hold for a stop from the machine's highest speeds at its lowest accelerations, s.
/// `order` is that of the limits that the planner keeps.
pub fn queue_depth_s(machine: &Machine, joints: &JointSpace, order: u32) -> f64 {
    let stop_s = |limits: &AxisLimits| {
        let speed = limits.feed_mm_per_s.max(limits.rapid_mm_per_s);
        let build_up_s = if order >= 3 {
            let ramp_s = limits.acceleration_mm_per_s2 / limits.jerk_mm_per_s3;
            2.0 * ramp_s / STOP_JERK_SHARE + easing_s(0.0, limits.jerk_mm_per_s3 / speed)
        } else {
            0.0
        };
        speed / (LEFT_IN_TURNS * STOP_SHARE * limits.acceleration_mm_per_s2) + build_up_s
    };
    let worst_s = joints
        .limits
        .axes()
        .iter()
        .map(stop_s)
        .filter(|stop_s| stop_s.is_finite())
        .fold(0.0, f64::max);
    worst_s + 5.0 * machine.rough_period_s + 3.0 * machine.fine_period_s
}

/// Program time that the planner is asked for at a time, s: whole rough periods, one where a ring of `segments` holds
/// `depth_s` in pieces that short. Each piece is a segment at least; a quarter of the ring is for these cuts.
pub fn advance_s(rough_period_s: f64, depth_s: f64, segments: usize) -> f64 {
    rough_period_s
        * (4.0 * depth_s / (rough_period_s * segments as f64))
            .ceil()
            .max(1.0)
}

/// The home switch of each axis that has one.
fn home_switches(machine: &Machine) -> [HomeSwitch; MAX_AXES] {
    let mut all = [HomeSwitch::default(); MAX_AXES];
    for homing in &machine.homing {
        if let Some(switch) = homing.switch() {
            all[homing.axis] = HomeSwitch {
                input: switch.input,
                inverted: switch.inverted,
            };
        }
    }
    all
}

/// The fine loop's view of the machine.
pub fn fine_config(
    machine: &Machine,
    joints: &JointSpace,
    planner: &PlannerDescription,
    (driver, attached): (&DriverDescription, &Attached),
    switches: Switches,
) -> FineConfig {
    let periods = |seconds: f64| (seconds / machine.fine_period_s).ceil() as u64;
    let limited = machine
        .homing
        .iter()
        .filter(|homing| homing.max_torque_percent.is_some());
    FineConfig {
        period_s: machine.fine_period_s,
        limits: joints.limits,
        linear: (0..machine.axes.count())
            .filter(|&i| !machine.axes.is_rotary(i))
            .fold(0, |mask, i| mask | 1 << i),
        joints: joints.fine(),
        speed_difference_mm_per_s: joints.speed_difference_mm_per_s(planner),
        order: planner.order,
        guard: match machine.guard {
            GuardMode::Stop => tandem_fine::GuardMode::Stop,
            GuardMode::Count => tandem_fine::GuardMode::Count,
        },
        position: joints.with_lanes(&machine.start),
        max_feed_ratio: machine.motion.max_feed_ratio,
        ratio_periods: machine.fine_periods_per_rough,
        strategy_takes_override: false,
        max_following_error_mm: joints.max_following_error_mm(),
        missed: MissedLimits {
            in_a_row: u64::from(machine.max_missed_periods),
            share: machine.max_missed_share,
        },
        kept_outputs: machine.kept_outputs(),
        pause_at_stops: switches.pause_at_stops,
        dry_run: switches.dry_run,
        unhomed: if switches.home.is_some() && joints.are_axes() {
            machine
                .homing
                .iter()
                .fold(0, |mask, homing| mask | 1 << homing.axis)
        } else {
            0
        },
        homing_limits: limited.fold(0, |mask, homing| mask | 1 << homing.axis),
        home_switches: home_switches(machine),
        record_drives: false,
        attached: *attached,
        enable_periods: periods(driver.enable_s),
        disable_periods: periods(driver.disable_s),
        reset_drives: switches.reset,
        plans_from_rest: true,
        at_speed_within_s: machine.spindle.at_speed_within_s,
        roles: roles::of(machine, switches),
    }
}
