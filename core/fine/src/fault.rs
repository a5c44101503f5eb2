//! What can go wrong on the fine loop, as numbers; the host turns them into words.

use tandem_sdk::JointState;

/// Which limit a sample broke.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Breach {
    /// Not a finite number.
    NotFinite,
    /// Outside the travel.
    Position,
    /// Faster than the axis may go.
    Velocity,
    /// More change of velocity than `A·Δt + V` over some window.
    Acceleration,
    /// More change of acceleration than the jerk limit gives, where the planner keeps one.
    Jerk,
}

/// What an input with a role is a fault by.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum InputFault {
    /// It is an emergency stop.
    EmergencyStop,
    /// The drives are not ready.
    DrivesReady,
    /// It is the end of an axis' way, and something moves.
    Limit,
    /// The motion waits for it and does not hear of it.
    NotHeardOf,
}

/// The cause of a fault.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum FaultKind {
    /// The guard refused a sample of the planner.
    Guard {
        /// Which limit.
        breach: Breach,
        /// Axis index; behind the axes, the number of the joint lane.
        axis: usize,
        /// What the sample would have been, in the limit's unit.
        value: f64,
        /// The limit.
        limit: f64,
    },
    /// A drive reports a fault.
    Drive {
        /// Joint index.
        joint: usize,
        /// The drive's code.
        code: u32,
    },
    /// The driver does not reach a drive any more.
    Lost {
        /// Joint index.
        joint: usize,
        /// The drive's code, as far as it is known.
        code: u32,
    },
    /// A drive has let go of a joint that it is to hold.
    LetGo {
        /// Joint index.
        joint: usize,
        /// What it says instead.
        state: JointState,
    },
    /// A joint was not enabled in the time that its driver has for it.
    NotEnabled {
        /// Joint index.
        joint: usize,
        /// What it says instead.
        state: JointState,
        /// The drive's code.
        code: u32,
    },
    /// A drive did not home its joint in the time that it has for it.
    NotHomed {
        /// Joint index.
        joint: usize,
        /// What it says.
        state: JointState,
        /// The drive's code.
        code: u32,
        /// The time, s.
        within_s: f64,
    },
    /// The driver gives a number as the state of a joint that stands for none.
    State {
        /// Joint index.
        joint: usize,
        /// The number.
        number: u32,
    },
    /// A number of the feedback is not finite.
    Feedback {
        /// Joint index; none for the spindle.
        joint: Option<usize>,
    },
    /// A joint is too far from where it is told to be.
    Following {
        /// Joint index.
        joint: usize,
        /// Distance between command and feedback, mm or rad.
        error_mm: f64,
        /// The limit.
        limit_mm: f64,
    },
    /// The kinematics give no finite number for a joint.
    Kinematics {
        /// Joint index.
        joint: usize,
    },
    /// The kinematics give no finite number for an axis, where the drives report joints that are.
    WayBack {
        /// Axis index.
        axis: usize,
    },
    /// The driver failed to exchange.
    Driver,
    /// The operator's emergency stop.
    EmergencyStop,
    /// An input with a role.
    Input {
        /// Which role.
        role: InputFault,
        /// Number of the input.
        input: u32,
        /// Nothing has been heard of it for longer than it may be old.
        old: bool,
    },
    /// A cut waits, and the spindle has not come to the speed that it was told in the time that it has for it.
    SpindleSlow {
        /// The time, s.
        within_s: f64,
        /// The speed that it was told, rad/s.
        told_rad_per_s: f64,
        /// The speed that its driver reports, rad/s.
        turns_rad_per_s: f64,
    },
    /// A fault on the soft side: the machine stopped on the path.
    Soft,
    /// Program time hardly passed though nothing asked for a stop, the queue was not starved and something was queued.
    NoProgress {
        /// Fine periods in which it did not.
        periods: u64,
        /// Program time that passed in them, s.
        grown_s: f64,
        /// Least rate of program time that was asked for meanwhile.
        asked: f64,
    },
    /// More fine periods were missed in motion than the machine allows.
    MissedPeriods {
        /// How many.
        missed: u64,
        /// How many are allowed.
        most: u64,
        /// They are among so many periods; none where they are in a row.
        of_last: Option<u64>,
    },
}

/// A fault with its place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fault {
    /// The cause.
    pub kind: FaultKind,
    /// Fine period in which it was seen.
    pub tick: u64,
    /// Program line that moved.
    pub line: u32,
}
