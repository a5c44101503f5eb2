//! Changes of state: what each asks of the master's setup, and what is refused with which code.

use super::process;
use crate::al::{AlCode, AlState};
use crate::device::Device;
use crate::esc::registers as at;
use crate::esc::sync_manager::Direction;

/// Time that a device takes for a change of state, in ns.
const CHANGE_NS: u64 = 200_000;
/// How long a device waits for the first outputs or the first SYNC0 before it gives up, in ns.
const PATIENCE_NS: u64 = 2_000_000_000;
/// Bit of AL control and status: an error is acknowledged, or is there.
const ERROR: u16 = 0x10;

/// A change of state under way.
#[derive(Clone, Copy, Debug)]
pub(super) struct Change {
    pub(super) due_ns: u64,
    control: u16,
    gives_up_ns: u64,
}

/// What came of a step to the next state.
enum Outcome {
    Done,
    /// Something is awaited that the master or a clock will bring.
    Later(AlCode),
    Refused(AlCode),
}

impl Device {
    /// The master wrote AL control.
    pub(crate) fn al_control(&mut self, at_ns: u64) {
        let control = self.esc.u16(at::AL_CONTROL);
        if self.plan.simple {
            self.follow_simply(control);
        } else {
            self.firmware.change = Some(Change {
                due_ns: at_ns + CHANGE_NS,
                control,
                gives_up_ns: at_ns + CHANGE_NS + PATIENCE_NS,
            });
        }
    }

    /// A device without firmware shows what it was asked for, whatever it is.
    fn follow_simply(&mut self, control: u16) {
        let Some(state) = AlState::of(control) else {
            return;
        };
        if self.firmware.trouble.hanging.contains(&state) {
            return;
        }
        self.firmware.code = None;
        self.enter(state);
        let refused = self.refusal(state);
        if let Some(code) = refused {
            self.firmware.state = AlState::Init;
            self.firmware.code = Some(code);
            self.show_state();
        } else {
            self.esc.set(at::AL_STATUS, 2, u64::from(control & 0x1f));
            self.esc.set(at::AL_STATUS_CODE, 2, 0);
        }
    }

    fn refusal(&self, state: AlState) -> Option<AlCode> {
        self.firmware
            .trouble
            .refused
            .iter()
            .find(|(refused, _)| *refused == state)
            .map(|(_, code)| *code)
    }

    /// Looks whether a change is due.
    pub(super) fn pursue_change(&mut self, at_ns: u64) {
        let Some(change) = self.firmware.change.filter(|change| change.due_ns <= at_ns) else {
            return;
        };
        let Some(target) = AlState::of(change.control) else {
            let code = if change.control & 0x0f == 3 {
                AlCode::NO_BOOT
            } else {
                AlCode::UNKNOWN_STATE
            };
            self.end_change(Some(code));
            return;
        };
        if self.firmware.trouble.hanging.contains(&target) {
            return;
        }
        let in_error = self.firmware.code.is_some();
        if in_error && change.control & ERROR == 0 && target >= self.firmware.state {
            // An error has to be acknowledged first.
            self.firmware.change = None;
            return;
        }
        if in_error && change.control & ERROR != 0 {
            self.firmware.code = None;
            self.open_process_data();
        }
        if target <= self.firmware.state {
            self.enter(target);
            self.end_change(None);
        } else if self.firmware.state.next() != Some(target) {
            self.end_change(Some(AlCode::INVALID_CHANGE));
        } else {
            match self
                .refusal(target)
                .map_or_else(|| self.step_up(target), Outcome::Refused)
            {
                Outcome::Done => {
                    self.enter(target);
                    self.end_change(None);
                }
                Outcome::Later(code) if at_ns >= change.gives_up_ns => self.end_change(Some(code)),
                Outcome::Later(_) => self.show_state(),
                Outcome::Refused(code) => self.end_change(Some(code)),
            }
        }
    }

    fn end_change(&mut self, code: Option<AlCode>) {
        self.firmware.change = None;
        if code.is_some() {
            self.firmware.code = code;
        }
        self.show_state();
    }

    /// Brings the status registers up to date.
    fn show_state(&mut self) {
        let code = self.firmware.code;
        let error = if code.is_some() { ERROR } else { 0 };
        self.esc.set(
            at::AL_STATUS,
            2,
            u64::from(self.firmware.state.number() | error),
        );
        self.esc.set(
            at::AL_STATUS_CODE,
            2,
            u64::from(code.map_or(0, |code| code.0)),
        );
    }

    /// Whether the setup is good enough for the next state.
    fn step_up(&mut self, target: AlState) -> Outcome {
        match target {
            AlState::Init => Outcome::Done,
            AlState::PreOp => self.judge_mailbox(),
            AlState::SafeOp => self.judge_process_data(),
            AlState::Op => self.judge_sync(),
        }
    }

    fn judge_mailbox(&self) -> Outcome {
        let Some(mailbox) = self.plan.mailbox else {
            return Outcome::Done;
        };
        let fits = |index: usize, direction, (start, length): (u16, u16)| {
            let manager = self.esc.sync_managers[index];
            self.esc.is_set_up(index, direction)
                && manager.is_mailbox()
                && (manager.start, manager.length) == (usize::from(start), usize::from(length))
        };
        let good = fits(0, Direction::ToDevice, mailbox.to_device)
            && fits(1, Direction::ToMaster, mailbox.to_master);
        if good {
            Outcome::Done
        } else {
            Outcome::Refused(AlCode::MAILBOX)
        }
    }

    fn judge_process_data(&mut self) -> Outcome {
        let Some(mappings) = process::mappings(&self.plan.process, &self.firmware.dictionary)
        else {
            return Outcome::Refused(AlCode::OUTPUTS);
        };
        for mapping in &mappings {
            let manager = self.esc.sync_managers[mapping.manager];
            let fits = mapping.bytes == 0 && !manager.is_active()
                || self.esc.is_set_up(mapping.manager, mapping.direction)
                    && manager.length == mapping.bytes;
            if !fits {
                let outputs = mapping.direction == Direction::ToDevice;
                return Outcome::Refused(if outputs {
                    AlCode::OUTPUTS
                } else {
                    AlCode::INPUTS
                });
            }
        }
        let sync = self.esc.clock.sync;
        if let (Some(drive), true) = (&self.firmware.drive, sync.activation & 3 == 3) {
            let shortest = drive.min_cycle_ns();
            if sync.cycle0 < shortest || !sync.cycle0.is_multiple_of(shortest) {
                return Outcome::Refused(AlCode::SYNC_CYCLE);
            }
        }
        self.firmware.mappings = mappings;
        Outcome::Done
    }

    fn judge_sync(&self) -> Outcome {
        let watch = &self.firmware.sync;
        let wants_sync = self.firmware.drive.is_some() && self.esc.clock.sync.activation & 3 == 3;
        // Where outputs are watched, there is nothing to be watched before the first.
        let watched = |mapping: &&process::Mapping| {
            self.esc.sync_managers[mapping.manager].triggers_watchdog()
        };
        let takes_outputs = self
            .firmware
            .mappings
            .iter()
            .filter(watched)
            .any(|mapping| mapping.bytes > 0);
        if wants_sync && !self.esc.clock.sync_runs() {
            Outcome::Refused(AlCode::NO_SYNC)
        } else if wants_sync && watch.pulses == 0 {
            Outcome::Later(AlCode::NO_SYNC)
        } else if takes_outputs && watch.outputs == 0 {
            Outcome::Later(AlCode::WATCHDOG)
        } else {
            Outcome::Done
        }
    }

    /// Enters a state and does what goes with it.
    fn enter(&mut self, state: AlState) {
        let before = std::mem::replace(&mut self.firmware.state, state);
        if before == AlState::Op && state != AlState::Op {
            self.leave_operational();
        }
        if state <= AlState::PreOp {
            self.firmware.mappings.clear();
        }
        if state == AlState::Init {
            if let Some(mailbox) = &mut self.firmware.mailbox {
                mailbox.clear();
            }
            self.firmware.mail_due_ns = None;
            self.esc.sync_managers[1].pdi_control = 0;
        }
        if self.plan.simple && state >= AlState::SafeOp && self.firmware.mappings.is_empty() {
            // There is nobody to judge the setup: whatever fits is exchanged.
            let mappings = process::mappings(&self.plan.process, &self.firmware.dictionary);
            self.firmware.mappings = mappings.unwrap_or_default();
        }
        if before < AlState::SafeOp && state >= AlState::SafeOp {
            self.firmware.sync = super::cycle::SyncWatch::default();
            self.publish_inputs();
        }
        self.open_process_data();
    }

    /// Opens the sync managers of process data from SAFE-OPERATIONAL on. Without firmware they are always open.
    fn open_process_data(&mut self) {
        if self.plan.simple {
            return;
        }
        let closed = u8::from(self.firmware.state < AlState::SafeOp);
        for plan in &self.plan.process {
            let manager = &mut self.esc.sync_managers[usize::from(plan.manager)];
            manager.pdi_control = manager.pdi_control & !1 | closed;
            if closed == 1 {
                manager.full = false;
            }
        }
    }

    /// Falls into a state by an error of the device's own. Outputs are not taken until it is acknowledged.
    pub(crate) fn fall(&mut self, state: AlState, code: AlCode) {
        self.firmware.change = None;
        self.enter(state.min(self.firmware.state));
        self.firmware.code = Some(code);
        for plan in self
            .plan
            .process
            .iter()
            .filter(|plan| plan.direction == Direction::ToDevice)
        {
            let manager = &mut self.esc.sync_managers[usize::from(plan.manager)];
            manager.pdi_control |= 1;
        }
        self.show_state();
    }
}
