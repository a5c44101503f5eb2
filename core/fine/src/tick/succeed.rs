//! One fine loop after another: the next job of a process takes over the drives of the last one while they hold, or lets
//! them be enabled once more.

use std::sync::atomic::Ordering::Relaxed;

use tandem_rings::{Counters, MachineState};
use tandem_sdk::AxisVector;

use super::attach::Attach;
use super::rest::Stop;
use super::{FineLoop, Left, Phase};

/// How a job of a resident machine has ended; its loop stays at the drives until the next one takes over.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct JobEnd {
    /// What the job counted.
    pub counters: Counters,
    /// What was switched last.
    pub left: Left,
    /// Where the machine rests, axis space, mm or rad.
    pub position: AxisVector,
}

impl FineLoop {
    /// The drives stay enabled when the program has ended, and are told to stay where they are, until somebody says that
    /// they are to let go ([`tandem_rings::Controls::let_go`]). Host, before the first tick.
    pub fn stay(&mut self) {
        self.stays = true;
    }

    /// There is nothing to do: the drives are not enabled, and the exchange with them goes on. Host, before the first tick.
    pub fn begin_ended(&mut self) {
        (self.outputs.ended, self.release.had_ended) = (true, true);
        self.release.begin();
    }

    /// Takes the place of `last`, which rests and has ended or is in fault: from here on this loop has the drives, and knows
    /// what they were told and have answered. What this job counts begins anew; what was on stays on. Where the drives of
    /// `last` hold, they go on holding, and the job begins at the next fine period; else they are enabled first, where they
    /// stand, and their faults reset with `resets`.
    ///
    /// Fine thread, between ticks; does not allocate. `last` keeps what it counted, and is dropped by the host.
    pub fn succeed(&mut self, last: &mut Self, resets: bool) {
        self.drives.take_over(&mut last.drives);
        self.space.take_over(&last.space);
        (self.outputs.bits, self.outputs.spindle_rad_per_s) =
            (last.outputs.bits, last.outputs.spindle_rad_per_s);
        self.outputs.by = last.outputs.by;
        self.spin_up = last.spin_up;
        if self.outputs.ended {
            return;
        }
        if last.has_ended() && last.attach.is_done() && last.drives.setpoint.enable != 0 {
            (self.state, self.roles) = (last.state, std::mem::take(&mut last.roles));
            if self.space.is_like(&last.space) {
                self.guard.place(last.guard.position());
            } else {
                // The joints of a gantry were homed each by itself, or are going to be: what is an axis here was none there.
                self.stand_at(&last.drives.setpoint.position);
            }
            self.attach = Attach::held(last.drives.setpoint.position);
            self.end_epoch(Stop::attached());
            self.phase = Phase::Waiting;
        } else {
            // Where the joints stand is asked of the drives once more.
            if self.space.is_like(&last.space) {
                self.guard.place(last.guard.position());
            } else {
                self.stand_at(&last.drives.feedback.position);
            }
            self.attach = Attach::anew(last.drives.feedback.position, resets);
            self.state = MachineState::Disabled;
        }
    }

    /// Whether the program has ended: nothing of this job moves any more. Any side.
    pub fn has_ended(&self) -> bool {
        self.outputs.ended && !matches!(self.phase, Phase::Ramping(_) | Phase::Faulted)
    }

    /// Whether nothing is left to do: the program has ended, and the drives have let go where they do not stay enabled; or a
    /// fault has brought the machine to rest. Any side.
    pub fn is_done(&self) -> bool {
        self.is_over() || self.stays && self.has_ended()
    }

    /// What the job did, once it has ended. Fine thread or host; does not allocate.
    pub fn job_end(&self) -> JobEnd {
        JobEnd {
            counters: self.counters,
            left: Left {
                switched: self.switched(),
                ..self.left
            },
            position: self.config.axes_alone(self.guard.position()),
        }
    }

    /// Whether the drives are to stay enabled though the program has ended.
    pub(super) fn stays_enabled(&self) -> bool {
        // What has begun to let go is enabled by the next job alone, from where the joints are then.
        self.stays && !self.release.has_begun() && !self.controls.let_go.load(Relaxed)
    }
}
