//! The operator's commands and the fine loop's status, as atomics.

use std::sync::atomic::Ordering::Relaxed;
use std::sync::atomic::{AtomicBool, AtomicI64, AtomicU32, AtomicU64};

use tandem_sdk::{JointState, MAX_AXES};

use crate::{AtomicF64, Counts};

/// The jog that moves, and what keeps it alive.
#[derive(Debug, Default)]
pub struct JogControls {
    /// Counts how often the operator has said that the jog is to go on. Written by the soft side.
    pub beats: AtomicU64,
    /// Fine periods without a beat after which the jog is let go; 0 where nothing needs to be kept alive.
    pub max_periods: AtomicU64,
    /// The jog is let go: stop on the path, drop what is queued, and report the rest. Set by the soft side, and by the
    /// fine loop where the keep-alive is late; cleared by the soft side when it has the rest. Holds stay as they are.
    pub let_go: AtomicBool,
}

/// The operator's commands. Each acts in the next fine period.
#[derive(Debug)]
pub struct Controls {
    /// Feed hold: true holds, false resumes.
    pub hold: AtomicBool,
    /// The program waits for the operator (M0, M1, M6): set by the fine loop, cleared by the host.
    pub program_hold: AtomicBool,
    /// Feed override, 1 for the programmed feed.
    pub feed_override: AtomicF64,
    /// Rapid override, 1 for the machine's rapid feed.
    pub rapid_override: AtomicF64,
    /// Optional stop: M1 waits for the operator.
    pub optional_stop: AtomicBool,
    /// Single block: the machine rests at the end of each block.
    pub single_block: AtomicBool,
    /// Emergency stop: ramp out off the path, then the drives' quick stop. Sticky.
    pub emergency_stop: AtomicBool,
    /// Abort: stop on the path, drop what is queued, and report the rest. Cleared by the fine loop when it has, and with
    /// it both holds: nothing is left that they could hold.
    pub abort: AtomicBool,
    /// The policy script is to be loaded anew: read and cleared by the host between two rough periods.
    pub reload_policy: AtomicBool,
    /// A fault found on the soft side (a plugin, the interpreter): stop on the path, then fault. Sticky.
    pub soft_fault: AtomicBool,
    /// The drives of a machine that stays are to let go between two jobs, at the rest where it stands.
    pub drives_let_go: AtomicBool,
    /// The jog that moves.
    pub jog: JogControls,
}

impl Default for Controls {
    fn default() -> Self {
        Self {
            hold: AtomicBool::new(false),
            program_hold: AtomicBool::new(false),
            single_block: AtomicBool::new(false),
            feed_override: AtomicF64::new(1.0),
            rapid_override: AtomicF64::new(1.0),
            optional_stop: AtomicBool::new(false),
            emergency_stop: AtomicBool::new(false),
            abort: AtomicBool::new(false),
            reload_policy: AtomicBool::new(false),
            soft_fault: AtomicBool::new(false),
            drives_let_go: AtomicBool::new(false),
            jog: JogControls::default(),
        }
    }
}

/// State and fault code of one joint's drive, read together.
#[derive(Debug, Default)]
pub struct JointStatus(AtomicU64);

impl JointStatus {
    /// What the drive has said. Fine loop; does not allocate.
    #[inline]
    pub fn store(&self, state: JointState, code: u32) {
        self.0
            .store(u64::from(state.0) << 32 | u64::from(code), Relaxed);
    }

    /// The last it has said. Any loop; does not allocate.
    pub fn load(&self) -> (JointState, u32) {
        let both = self.0.load(Relaxed);
        (JointState((both >> 32) as u32), both as u32)
    }
}

/// The spindle, as the fine loop last knew it.
#[derive(Debug, Default)]
pub struct SpindleStatus {
    /// True while a cut waits for it to come to its speed.
    pub waits: AtomicBool,
    /// Speed that it was told last, rad/s; 0 behind an open door.
    pub told_rad_per_s: AtomicF64,
    /// Speed that its driver reports, rad/s.
    pub turns_rad_per_s: AtomicF64,
}

/// How well the drives are heard.
#[derive(Debug, Default)]
pub struct BusStatus {
    /// Age of the oldest feedback of a joint, fine periods: 0 is new.
    pub age_periods: AtomicU32,
    /// Fine periods since the drives were attached in which that was not new: a frame was lost or late.
    pub old_periods: AtomicU64,
    /// How much later than the bus wants it the last exchange was, ns; counts where `has_phase`.
    pub phase_ns: AtomicI64,
    /// Whether the bus says so.
    pub has_phase: AtomicBool,
}

/// What the fine loop says of itself; for looking at, not for deciding.
#[derive(Debug, Default)]
pub struct Status {
    /// Fine periods done.
    pub tick: AtomicU64,
    /// Program time since the start of the run, s.
    pub program_time_s: AtomicF64,
    /// Path speed commanded, mm/s.
    pub feed_mm_per_s: AtomicF64,
    /// The first fine period behind the last one with a sample in which something moved: a sample from before it shows a place that
    /// the machine may have left. The host takes it back to 0 where it knows by itself where the machine stands.
    pub rests_from_tick: AtomicU64,
    /// Program line that moves.
    pub line: AtomicU32,
    /// A [`crate::MachineState`] as its number.
    pub state: AtomicU32,
    /// State and fault code of each joint's drive.
    pub joints: [JointStatus; MAX_AXES],
    /// True while the drives are told to hold and not all of them do.
    pub enabling: AtomicBool,
    /// True where codes of the drives are written in hexadecimal. Set by the host.
    pub hexadecimal_codes: AtomicBool,
    /// Inputs with a role that are tripped, a bit each.
    pub tripped: AtomicU64,
    /// What the spindle does.
    pub spindle: SpindleStatus,
    /// How well the drives are heard.
    pub bus: BusStatus,
    /// True while nothing moves and nothing is queued.
    pub idle: AtomicBool,
    /// Digital inputs as last read.
    pub inputs: AtomicU64,
    /// Samples lost because nobody took them from the ring.
    pub lost_samples: AtomicU64,
    /// What was counted so far.
    pub counts: Counts,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn state_and_code_of_a_joint_are_read_as_they_were_stored() {
        let status = JointStatus::default();
        assert_eq!(status.load(), (JointState(0), 0));
        for (state, code) in [(3, 0x8611), (u32::MAX, 1), (7, u32::MAX)] {
            status.store(JointState(state), code);
            assert_eq!(status.load(), (JointState(state), code));
        }
    }
}
