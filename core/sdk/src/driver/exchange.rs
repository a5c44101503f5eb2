//! What goes to the drives and comes back in every fine period.

use crate::abi::layout::layout;
use crate::{AxisVector, JointState, MAX_AXES};

/// Most latches a driver reports at once.
pub const MAX_LATCHES: usize = 4;

/// Most analog inputs a driver reports.
pub const MAX_ANALOG: usize = 4;

/// Number of digital inputs, and of outputs.
pub const MAX_DIGITAL: usize = 64;

/// The input edge that drives are to catch positions at. Inputs have the driver's own numbers, from 0 in the order of its list. An index
/// pulse is an input like others: its level may never be seen in [`Feedback::inputs`], and its edge is told by a [`Latch`] alone.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(C)]
pub struct Arm {
    /// Number of the input.
    pub input: u32,
    /// 1 for a rising edge, 2 for a falling one, 0 where nothing is armed.
    pub edge: u32,
}

layout!(Arm { input, edge });

/// What the drives are told each fine period.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct Setpoint {
    /// 1 while the drives are to hold or move, 0 to let go. A drive that lets go holds its torque until its brake is closed.
    pub enable: u32,
    /// 1 for one period to reset the drives' faults; after an operator's reset and never else.
    pub reset: u32,
    /// Bit per joint that is handed over to its drive for homing, by the method of its description; until the drive says in
    /// [`Feedback::homed`] that it is, its setpoint does not count.
    pub homing: u32,
    /// Bit per joint that is being homed with a torque limit: its drive keeps to
    /// [`crate::JointDescription::homing_torque_percent`], and has its own limit back where the bit is 0.
    pub limited: u32,
    /// Number of the fine period. It is 0 while joints are enabled for the first time, and where it does not grow the host has not made
    /// a new setpoint: drives that watch their host go by that. What takes its time, as a brake, is counted in exchanges.
    pub tick: u64,
    /// Digital outputs, bit n is output n.
    pub outputs: u64,
    /// The edge to catch positions at: armed before a motion that waits for one begins, disarmed after it.
    pub arm: Arm,
    /// Position per joint, mm or rad. For a joint that is not [`JointState::Enabled`] yet, its own feedback.
    pub position: AxisVector,
    /// Velocity per joint, mm/s or rad/s: the difference to the last setpoint.
    pub velocity: AxisVector,
    /// Acceleration per joint, mm/s² or rad/s²: the second difference.
    pub acceleration: AxisVector,
    /// Spindle speed, rad/s, positive clockwise.
    pub spindle_rad_per_s: f64,
}

layout!(Setpoint {
    enable,
    reset,
    homing,
    limited,
    tick,
    outputs,
    arm,
    position,
    velocity,
    acceleration,
    spindle_rad_per_s
});

impl Default for Setpoint {
    fn default() -> Self {
        Self {
            enable: 0,
            reset: 0,
            homing: 0,
            limited: 0,
            tick: 0,
            outputs: 0,
            arm: Arm::default(),
            position: AxisVector::ZERO,
            velocity: AxisVector::ZERO,
            acceleration: AxisVector::ZERO,
            spindle_rad_per_s: 0.0,
        }
    }
}

/// A position caught by the drives on an input edge that was armed. A driver tells it in one exchange and clears it in the next; one
/// that was there before the edge was armed, and has not changed since, does not count.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(C)]
pub struct Latch {
    /// Number of the input.
    pub input: u32,
    /// 1 for a rising edge, 2 for a falling one, 0 for no latch.
    pub edge: u32,
    /// Bit per joint whose position was caught; the position of another one is not read.
    pub joints: u32,
    /// How long before the feedback of this exchange was taken the edge came, s; positions that were not caught are found between
    /// the feedback of this period and of those before by it. Drives without a time stamp take it from the speed, or leave 0.
    pub before_s: f64,
    /// Positions per joint at the edge, mm or rad.
    pub position: AxisVector,
}

layout!(Latch {
    input,
    edge,
    joints,
    before_s,
    position
});

/// What the drives report each fine period.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct Feedback {
    /// Bit per joint whose drive has found its reference in the homing that it was handed over for.
    pub homed: u32,
    /// State per joint.
    pub state: [JointState; MAX_AXES],
    /// Fault code per joint, the drive's own; 0 for none.
    pub fault_code: [u32; MAX_AXES],
    /// Age of what is reported of each joint, in fine periods: 0 is new. A driver that heard nothing in this exchange hands the
    /// old numbers out again, one older.
    pub age_periods: [u32; MAX_AXES],
    /// Position per joint, mm or rad.
    pub position: AxisVector,
    /// Speed per joint, mm/s or rad/s.
    pub speed: AxisVector,
    /// Mean motor current of the past period, A.
    pub current_a: AxisVector,
    /// Digital inputs, bit n is input n.
    pub inputs: u64,
    /// Age of each digital input, in fine periods; the greatest number stands for that and anything older.
    pub input_age_periods: [u16; MAX_DIGITAL],
    /// Analog inputs, in units that the machine's builder knows: a dynamometer, a spindle load.
    pub analog: [f64; MAX_ANALOG],
    /// Latched positions.
    pub latches: [Latch; MAX_LATCHES],
    /// Spindle speed, rad/s.
    pub spindle_rad_per_s: f64,
    /// Spindle angle, rad.
    pub spindle_angle_rad: f64,
    /// 1 where the spindle turns as fast as it is told to, or stands where it is told to.
    pub spindle_at_speed: u32,
    /// 1 where `phase_ns` counts.
    pub has_phase: u32,
    /// How much later than the bus wants it this exchange was, ns: the wall clock steers the next ones by it.
    pub phase_ns: i64,
}

layout!(Feedback {
    homed,
    state,
    fault_code,
    age_periods,
    position,
    speed,
    current_a,
    inputs,
    input_age_periods,
    analog,
    latches,
    spindle_rad_per_s,
    spindle_angle_rad,
    spindle_at_speed,
    has_phase,
    phase_ns
});

impl Default for Feedback {
    /// Joints without torque at zero, everything new, the spindle as it is told to be.
    fn default() -> Self {
        Self {
            homed: 0,
            state: [JointState::Disabled; MAX_AXES],
            fault_code: [0; MAX_AXES],
            age_periods: [0; MAX_AXES],
            position: AxisVector::ZERO,
            speed: AxisVector::ZERO,
            current_a: AxisVector::ZERO,
            inputs: 0,
            input_age_periods: [0; MAX_DIGITAL],
            analog: [0.0; MAX_ANALOG],
            latches: [Latch::default(); MAX_LATCHES],
            spindle_rad_per_s: 0.0,
            spindle_angle_rad: 0.0,
            spindle_at_speed: 1,
            has_phase: 0,
            phase_ns: 0,
        }
    }
}

impl Feedback {
    /// What ideal drives report: `joints` joints stand where they are told to, and hold while they are enabled. Any loop;
    /// does not allocate.
    #[inline]
    pub fn follow(&mut self, setpoint: &Setpoint, joints: usize) {
        self.position = setpoint.position;
        self.speed = setpoint.velocity;
        let state = if setpoint.enable == 0 {
            JointState::Disabled
        } else {
            JointState::Enabled
        };
        // To fill the first of them takes 2 ns longer: it is made to do many at once, and finds out how many there are.
        for (joint, own) in self.state.iter_mut().enumerate() {
            *own = if joint < joints { state } else { *own };
        }
    }
}
