//! What the fine loop knows of the machine.

use tandem_sdk::{Attached, AxisVector, JointLanes, Limits, MAX_AXES};

use crate::roles::Roles;

/// What the guard does with a sample beyond a limit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum GuardMode {
    /// Does not send it: the machine ramps out and faults.
    #[default]
    Stop,
    /// Sends and counts it. Simulated drivers only; the host sees to that.
    Count,
}

/// How the joints hang on the axes, and what of them lies behind the axes in every vector of the fine loop.
#[derive(Clone, Copy, Debug, Default)]
pub enum Joints {
    /// Each joint is an axis, or one scaled: nothing.
    #[default]
    Axes,
    /// Some are sums of axes: a lane each, which segments carry and which is limited like an axis.
    Sums(&'static JointLanes),
    /// Their place is no linear function of the axes: all joints, as the kinematics give them. The guard alone sees them.
    Curved {
        /// Number of axes.
        axes: usize,
    },
}

/// How many fine periods may go by in motion without a sample; more are a fault.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MissedLimits {
    /// In a row.
    pub in_a_row: u64,
    /// Share of the periods of a sliding second; 1 for no limit.
    pub share: f64,
}

impl Default for MissedLimits {
    /// Two in a row, and 1 % of a second.
    fn default() -> Self {
        Self {
            in_a_row: 2,
            share: 0.01,
        }
    }
}

/// A home switch.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct HomeSwitch {
    /// Its digital input, 0 to 63.
    pub input: u32,
    /// The input is 0 on the switch.
    pub inverted: bool,
}

impl HomeSwitch {
    /// Whether it is on, where the inputs are `inputs`.
    #[inline]
    pub fn is_on(&self, inputs: u64) -> bool {
        (inputs >> self.input.min(63) & 1 == 1) != self.inverted
    }
}

/// Everything the fine loop is told before it runs.
#[derive(Clone, Copy, Debug)]
#[allow(clippy::struct_excessive_bools)] // independent facts of the machine and the run
pub struct FineConfig {
    /// Fine period, s.
    pub period_s: f64,
    /// Limits of the axes, and of what `joints` puts behind them.
    pub limits: Limits,
    /// Bit per linear axis: where any of them moves, a feed is their speed alone.
    pub linear: u32,
    /// How the joints hang on the axes.
    pub joints: Joints,
    /// Allowable speed difference that the planner makes use of, per axis, mm/s.
    pub speed_difference_mm_per_s: [f64; MAX_AXES],
    /// Order of the limits that the planner keeps: 2 velocity and acceleration, 3 also jerk.
    pub order: u32,
    /// What the guard does.
    pub guard: GuardMode,
    /// Where the machine stands, with what `joints` puts behind the axes.
    pub position: AxisVector,
    /// Highest feed ratio that can be asked: the planner plans at it.
    pub max_feed_ratio: f64,
    /// Fine periods over which a ratio of strategy or policy is led over to the next: those of a rough period.
    pub ratio_periods: u32,
    /// The ratios of the strategy count an operator's feed override above 1 already.
    pub strategy_takes_override: bool,
    /// Largest distance between the command and the feedback of a period, per joint, mm or rad; infinite for none.
    pub max_following_error_mm: AxisVector,
    /// Which missed periods are a fault.
    pub missed: MissedLimits,
    /// Outputs that a fault and an emergency stop leave as they are, a bit each. Coolant is never among them.
    pub kept_outputs: u64,
    /// M0 and M6 wait for the operator; M1 does where the operator's switch is on.
    pub pause_at_stops: bool,
    /// Spindle, coolant and user outputs are not switched, and nothing waits for the operator.
    pub dry_run: bool,
    /// Bit per axis that is to be homed first: its travel does not count until then, and no sample is published before
    /// all of them are homed.
    pub unhomed: u32,
    /// Bit per joint whose drive keeps to a torque limit while its axis is not homed.
    pub homing_limits: u32,
    /// The home switch of each axis, for motion that waits for those of several ([`tandem_sdk::StopOn::home_switches`]).
    pub home_switches: [HomeSwitch; MAX_AXES],
    /// Samples are published from the start, and in the coordinates of the drives: a record of homing itself.
    pub record_drives: bool,
    /// Where the joints stand, as the driver has told.
    pub attached: Attached,
    /// Most fine periods that enabling the joints may take.
    pub enable_periods: u64,
    /// Most fine periods that disabling them may take.
    pub disable_periods: u64,
    /// Faults of the drives are reset before they are enabled.
    pub reset_drives: bool,
    /// The rest at which all joints are enabled ends an epoch ([`tandem_rings::RestCause::Attached`]), so that planning starts
    /// where they really stand. Without it, what is queued begins at `position`.
    pub plans_from_rest: bool,
    /// Time that the spindle has to come to the speed that it was told while a cut waits for it, s.
    pub at_speed_within_s: f64,
    /// Inputs that mean something.
    pub roles: Roles,
}

impl FineConfig {
    /// A machine whose joints are its axes, at rest at zero, with a plan of order 2 that steps nowhere; nothing is switched,
    /// awaited or judged beyond `limits`, and what is queued begins there. Host; does not allocate.
    pub fn new(period_s: f64, limits: Limits) -> Self {
        Self {
            period_s,
            limits,
            linear: u32::MAX,
            joints: Joints::Axes,
            speed_difference_mm_per_s: [0.0; MAX_AXES],
            order: 2,
            guard: GuardMode::Stop,
            position: AxisVector::ZERO,
            max_feed_ratio: 1.0,
            ratio_periods: 1,
            strategy_takes_override: false,
            max_following_error_mm: AxisVector([f64::INFINITY; MAX_AXES]),
            missed: MissedLimits::default(),
            kept_outputs: 0,
            pause_at_stops: false,
            dry_run: false,
            unhomed: 0,
            homing_limits: 0,
            home_switches: [HomeSwitch::default(); MAX_AXES],
            record_drives: false,
            attached: Attached::default(),
            enable_periods: 5000,
            disable_periods: 5000,
            reset_drives: false,
            plans_from_rest: false,
            at_speed_within_s: f64::INFINITY,
            roles: Roles::default(),
        }
    }

    /// Number of axes.
    pub fn axis_count(&self) -> usize {
        match self.joints {
            Joints::Axes => self.lane_count(),
            Joints::Sums(lanes) => lanes.first(),
            Joints::Curved { axes } => axes,
        }
    }

    /// Number of entries that are limited: the axes, and what `joints` puts behind them.
    pub fn lane_count(&self) -> usize {
        self.limits.count as usize
    }

    /// `vector` without what lies behind the axes.
    #[inline]
    pub fn axes_alone(&self, vector: &AxisVector) -> AxisVector {
        match self.joints {
            Joints::Axes => *vector,
            _ => AxisVector::from_slice(&vector.0[..self.axis_count()]),
        }
    }
}
