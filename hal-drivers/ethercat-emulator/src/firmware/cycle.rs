//! What a device does in time: its mailbox, its process data, its watchdog, its drive.

use super::sdo::Context;
use crate::al::{AlCode, AlState};
use crate::device::Device;
use crate::drive::Drive;
use crate::esc::sync_manager::Direction;

/// Time that a device takes for a message in its mailbox, in ns.
const MAIL_NS: u64 = 200_000;
/// Sync managers of the mailbox.
const TO_DEVICE: usize = 0;
const TO_MASTER: usize = 1;
/// Bytes of a mailbox header.
const MAIL_HEADER: usize = 6;
/// Cycles without a SYNC0 after which a drive takes it for lost, though frames come.
const MAX_CYCLES_WITHOUT_SYNC: u64 = 5;

/// Outputs and sync pulses since SAFE-OPERATIONAL.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct SyncWatch {
    pub(super) outputs: u64,
    pub(super) pulses: u64,
    /// Outputs came since the last pulse.
    fresh: bool,
    errors: u64,
    /// Pulses that the firmware's loop has seen, and when it last saw another one.
    seen: u64,
    seen_ns: u64,
}

impl Device {
    /// A frame has passed: what cannot wait is done.
    pub(crate) fn frame_passed(&mut self, at_ns: u64) {
        let events = std::mem::take(&mut self.esc.events);
        if events.al_control {
            self.al_control(at_ns);
        }
        if self.plan.mailbox.is_some() {
            if events.written >> TO_DEVICE & 1 == 1 {
                self.firmware.mail_due_ns = Some(at_ns + MAIL_NS);
            }
            if events.emptied >> TO_MASTER & 1 == 1 {
                self.post();
            }
            if events.repeat {
                self.post_again();
            }
        }
        let outputs = self
            .plan
            .process
            .iter()
            .filter(|plan| plan.direction == Direction::ToDevice);
        if outputs
            .map(|plan| events.written >> plan.manager & 1)
            .sum::<u16>()
            > 0
        {
            self.outputs_came();
        }
    }

    fn outputs_came(&mut self) {
        self.firmware.sync.outputs += 1;
        self.firmware.sync.fresh = true;
        self.firmware.counters.outputs += 1;
        if !self.is_synchronous() {
            self.take_outputs(None);
        }
    }

    /// Whether SYNC0 leads the process data; otherwise frames do.
    fn is_synchronous(&self) -> bool {
        self.firmware.drive.is_some() && self.esc.clock.sync.activation & 3 == 3
    }

    fn take_outputs(&mut self, cycle_s: Option<f64>) {
        // Only where the master leads are its outputs meant.
        if self.firmware.state != AlState::Op {
            return;
        }
        let firmware = &mut self.firmware;
        for mapping in firmware
            .mappings
            .iter()
            .filter(|mapping| mapping.direction == Direction::ToDevice)
        {
            mapping.unpack(self.esc.buffer(mapping.manager), &mut firmware.dictionary);
        }
        if let Some(drive) = &mut firmware.drive {
            drive.take_setpoints(cycle_s, &firmware.dictionary);
        }
    }

    /// A frame comes: where frames lead, it finds what the firmware's loop came to last.
    pub(crate) fn frame_comes(&mut self) {
        if self.firmware.state >= AlState::SafeOp && !self.is_synchronous() {
            self.publish_inputs();
        }
    }

    /// Lets the master read the newest inputs.
    pub(crate) fn publish_inputs(&mut self) {
        self.publish_drive();
        let firmware = &self.firmware;
        for mapping in firmware
            .mappings
            .iter()
            .filter(|mapping| mapping.direction == Direction::ToMaster)
        {
            mapping.pack(&firmware.dictionary, self.esc.fill(mapping.manager));
        }
    }

    /// Puts what a drive shows into the dictionary.
    fn publish_drive(&mut self) {
        let firmware = &mut self.firmware;
        if let Some(drive) = &firmware.drive {
            drive.publish(&mut firmware.dictionary);
        }
    }

    /// Whether nothing happens in the firmware's own loop until then: a terminal that waits for its master.
    pub(crate) fn is_idle(&self, until_ns: u64) -> bool {
        let firmware = &self.firmware;
        let waits = firmware.change.is_some() || firmware.mail_due_ns.is_some();
        firmware.drive.is_none()
            && !waits
            && (firmware.state != AlState::Op || !self.esc.watchdog_expired(until_ns))
    }

    /// One step of the firmware's own loop.
    pub(crate) fn tick(&mut self, at_ns: u64) {
        self.pursue_change(at_ns);
        self.pursue_mail(at_ns);
        self.watch(at_ns);
        self.watch_sync(at_ns);
        let led = self.firmware.state == AlState::Op;
        let firmware = &mut self.firmware;
        if let Some(drive) = &mut firmware.drive {
            drive.step(led, &mut firmware.dictionary);
            if let (Some(code), Some(mailbox)) = (drive.take_emergency(), &mut firmware.mailbox) {
                mailbox.emergency(code, 1);
                self.post();
            }
        }
    }

    /// The watchdog of the process data: a device with firmware leaves OPERATIONAL, one without clears its outputs.
    fn watch(&mut self, at_ns: u64) {
        if self.firmware.state != AlState::Op || !self.esc.watchdog_expired(at_ns) {
            return;
        }
        self.esc.watchdog_bit();
        self.firmware.counters.watchdog += 1;
        if self.plan.simple {
            self.clear_outputs();
        } else {
            self.fall(AlState::SafeOp, AlCode::WATCHDOG);
        }
    }

    /// SYNC0 that stays away: its own loop notices, whatever frames come.
    fn watch_sync(&mut self, at_ns: u64) {
        let in_operation = self.firmware.state == AlState::Op && self.is_synchronous();
        let watch = &mut self.firmware.sync;
        if !in_operation || watch.pulses != watch.seen {
            (watch.seen, watch.seen_ns) = (watch.pulses, at_ns);
            return;
        }
        let cycle_ns = self.esc.clock.sync_cycle_ns().map_or(0, u64::from);
        let max_ns = cycle_ns * MAX_CYCLES_WITHOUT_SYNC;
        if watch.pulses > 0 && cycle_ns > 0 && at_ns - watch.seen_ns > max_ns {
            watch.seen_ns = at_ns;
            self.fall(AlState::SafeOp, AlCode::FATAL_SYNC_ERROR);
        }
    }

    fn clear_outputs(&mut self) {
        let firmware = &mut self.firmware;
        for mapping in firmware
            .mappings
            .iter()
            .filter(|mapping| mapping.direction == Direction::ToDevice)
        {
            mapping.clear(&mut firmware.dictionary);
        }
    }

    /// OPERATIONAL is left: outputs are off, and a drive does what it was told to do then.
    pub(super) fn leave_operational(&mut self) {
        if self.firmware.drive.is_none() {
            self.clear_outputs();
        }
        let firmware = &mut self.firmware;
        if let Some(drive) = &mut firmware.drive {
            drive.lose_bus(&mut firmware.dictionary);
        }
    }

    /// A SYNC0 of this device.
    pub(crate) fn sync0(&mut self) {
        let cycle_ns = self.esc.clock.sync_cycle_ns();
        if !self.esc.clock.sync_passes()
            || self.firmware.state < AlState::SafeOp
            || !self.is_synchronous()
        {
            return;
        }
        let watch = &mut self.firmware.sync;
        watch.pulses += 1;
        let fresh = std::mem::take(&mut watch.fresh);
        if self.firmware.state == AlState::Op {
            self.firmware.counters.sync0 += 1;
            if fresh {
                self.firmware.sync.errors = self.firmware.sync.errors.saturating_sub(1);
                self.take_outputs(cycle_ns.map(|ns| f64::from(ns) / 1e9));
            } else {
                self.firmware.counters.sync0_without_outputs += 1;
                self.firmware.sync.errors += 3;
            }
        }
        self.publish_inputs();
        if self.firmware.sync.errors > Drive::sync_error_limit(&self.firmware.dictionary) {
            self.firmware.sync.errors = 0;
            self.fall(AlState::SafeOp, AlCode::SYNC_ERROR);
        }
    }

    fn pursue_mail(&mut self, at_ns: u64) {
        if self.firmware.mail_due_ns.is_none_or(|due| at_ns < due) {
            return;
        }
        self.firmware.mail_due_ns = None;
        self.publish_drive();
        let (Some(plan), Some(mailbox)) = (self.plan.mailbox, &mut self.firmware.mailbox) else {
            return;
        };
        let message = self.esc.buffer(TO_DEVICE).to_vec();
        self.esc.sync_managers[TO_DEVICE].full = false;
        if self.firmware.state == AlState::Init || self.firmware.trouble.silent {
            return;
        }
        let mut context = Context {
            dictionary: &mut self.firmware.dictionary,
            state: self.firmware.state,
            room: usize::from(plan.to_master.1).saturating_sub(MAIL_HEADER),
            complete_access: plan.complete_access,
            refusals: &self.firmware.trouble.sdos,
            is_drive: self.firmware.drive.is_some(),
        };
        let (left, code) = &mut self.firmware.trouble.emergencies;
        if *left > 0 {
            *left -= 1;
            mailbox.emergency(*code, 1);
        }
        mailbox.take(&message, &mut context);
        self.post();
    }

    /// Puts the next message where the master reads it, once it is free.
    fn post(&mut self) {
        if self.esc.sync_managers[TO_MASTER].full || self.firmware.state == AlState::Init {
            return;
        }
        let Some(message) = self
            .firmware
            .mailbox
            .as_mut()
            .and_then(super::mailbox::Mailbox::next)
        else {
            return;
        };
        lay(self.esc.fill(TO_MASTER), message);
    }

    /// The master lost the last message: it is there again, and the device's bit follows the master's.
    fn post_again(&mut self) {
        self.esc.sync_managers[TO_MASTER].pdi_control ^= 2;
        if let Some(mailbox) = &self.firmware.mailbox {
            lay(self.esc.fill(TO_MASTER), mailbox.again());
        }
    }
}

fn lay(into: &mut [u8], message: &[u8]) {
    let count = message.len().min(into.len());
    into[..count].copy_from_slice(&message[..count]);
    into[count..].fill(0);
}
